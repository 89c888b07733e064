"""Reading the settings back: what was not read to its end is not passed as absent."""

import pytest

from firmware_bridge.offboard.msp import ANSWER, Decoder, Frame, encode
from firmware_bridge.offboard.settings import Mode, read
from flight import LinkError

VALUES = {"roll_srate": "100", "deadband": "0", "yaw_deadband": "5", "motor_idle": "550"}


class CommandLine:
    """A command line, simulated, with few settings; `spoil` changes what it answers."""

    def __init__(self, spoil=lambda command, answer: answer) -> None:
        self._out, self._open, self._spoil = b"", False, spoil

    def write(self, data: bytes) -> None:
        if not self._open and data.startswith(b"$X"):
            for frame in Decoder().feed(data):
                self._out += encode(Frame(frame.function, (1 << 14).to_bytes(4, "little"), ANSWER))
            return
        command = data.decode().strip()
        self._open = True
        answer = self._spoil(command, self._answer(command))
        self._out += answer.encode()

    def _answer(self, command: str) -> str:
        if command == "#":
            return "Entering CLI Mode, type 'exit' to reboot\r\n\r\n# "
        if command == "":
            return "\r\n# "
        if command == "exit":
            return "leaving CLI mode\r\n"
        return f"{command}\r\n{self._said(command)}\r\n# "

    def _said(self, command: str) -> str:
        if command.startswith("get "):
            name = command.removeprefix("get ")
            found = [f"{n} = {v}\r\nAllowed range: 0 - 1" for n, v in VALUES.items() if name in n]
            return "\r\n\r\n".join(found) or f"###ERROR IN get: INVALID NAME: {name}###"
        return {
            "version": "# Betaflight / SITL (SITL) 4.6.0 Jul 1 2025",
            "aux": "aux 0 0 0 1700 2100 0 0\r\naux 1 1 1 900 1300 0 0\r\naux 2 0 0 900 900 0 0",
            "map": "map AETR1234",
            "mixer": "Mixer: HEX6X",
            "status": "System Uptime: 4 seconds\r\nArming disable flags: RXLOSS BOOTGRACE CLI",
            "rxrange": "rxrange 0 1000 2000\r\nrxrange 1 1010 2000",
        }[command]

    def read(self, wait_s: float = 0.0) -> bytes:
        data, self._out = self._out, b""
        return data

    def close(self) -> None: ...


def test_what_the_firmware_has_is_read_and_what_it_has_not_is_absent():
    found = read(CommandLine(), patience_s=0.2)
    assert found.values == VALUES
    assert found.modes == (Mode(0, 4, 1700, 2100), Mode(1, 5, 900, 1300))
    assert found.ranges_us == ((1000, 2000), (1010, 2000))
    assert "SITL" in found.firmware
    assert found.mixer == "HEX6X"
    assert found.receiver_lost


@pytest.mark.parametrize("flags", ["Arming disable flags: CLI", "", "RXLOSS is no flag here"])
def test_a_receiver_is_lost_only_where_the_firmware_says_so(flags):
    def told(command: str, answer: str) -> str:
        return f"status\r\n{flags}\r\n# " if command == "status" else answer

    assert not read(CommandLine(told), patience_s=0.2).receiver_lost


def test_a_firmware_without_the_command_mixer_names_none():
    def unknown(command: str, answer: str) -> str:
        return "mixer\r\n###ERROR: UNKNOWN COMMAND: mixer###\r\n# " if command == "mixer" else answer

    assert read(CommandLine(unknown), patience_s=0.2).mixer == ""


@pytest.mark.parametrize("lost", ["get failsafe_delay", "get deadband", "aux", "map", "mixer", "rxrange", "version"])
def test_an_answer_without_an_end_is_an_error(lost):
    def cut(command: str, answer: str) -> str:
        return answer[: len(answer) // 2] if command == lost else answer

    with pytest.raises(LinkError, match=f"does not answer `{lost}`"):
        read(CommandLine(cut), patience_s=0.05)


@pytest.mark.parametrize("arrived", ["", "get dea"])
def test_a_question_that_was_lost_is_asked_again(arrived):
    """The half that arrived is ended first: joined to the second question it would name a setting that is not there."""

    class Lossy(CommandLine):
        def __init__(self) -> None:
            super().__init__()
            self.held = arrived

        def write(self, data: bytes) -> None:
            if data == b"get deadband\n" and self.held is not None:
                return
            if data.startswith(b"\n") and self.held is not None:
                self.held = None
                for command in (arrived + data.decode()).splitlines():
                    super().write(command.encode())
                return
            super().write(data)

    assert read(Lossy(), patience_s=0.2).values == VALUES


def test_a_damaged_answer_is_an_error():
    def spoilt(command: str, answer: str) -> str:
        return answer.replace("motor_idle =", "mot\ufffdr_idle =") if command == "get motor_idle" else answer

    with pytest.raises(LinkError, match="answer to `get motor_idle` is damaged"):
        read(CommandLine(spoilt), patience_s=0.2)
