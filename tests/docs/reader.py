"""Types the commands of a page as its reader would, in one folder; vehicles and stations go on until the page ends."""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from tests.docs.blocks import Block
from tests.goshawk.test_grammar import VERBS
from tests.test_words import LONGEST, sentences
from tests.waiting import PATIENCE_S

PORT, LISTEN, SCHEDULER = "14550", "14551", "8786"
"""Where vehicles, the proxy and Dask's scheduler listen on the pages; a test takes free ports instead."""
ELSEWHERE = {"192.168.4.1": "127.0.0.1", "192.168.1.10": "127.0.0.1", "station.example": "localhost"}
"""Other machines of the pages, and where their part runs in a test."""
LONGEST_S, LOOKED_AT_S = 2.0 * PATIENCE_S, 5.0
SERVING = ("sitl", "gcs", "proxy")
"""Verbs that go on until they are stopped."""
FILE = re.compile(r"# (\w+\.py)\n")
"""First line of a Python block that is a file of the reader's."""
ANSWERS_NO = "exit code 1"
"""In the remark behind a command: this answer is expected."""


class Reader:
    """Somebody with an empty folder, a home of its own, and Goshawk on the path."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        free = {PORT: free_port(), LISTEN: free_port(), SCHEDULER: free_port(socket.SOCK_STREAM)}
        self._other = ELSEWHERE | {usual: str(port) for usual, port in free.items()}
        self._serving: list[subprocess.Popen[bytes]] = []
        self._python = ""
        programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self._environment = os.environ | {"PATH": programs, "HOME": str(folder.parent / "home")}
        folder.mkdir(parents=True)

    def type(self, block: Block) -> None:
        """Run a block; fails with what the command said where it does not end well."""
        if block.language == "python":
            self._run_python(self._substituted(block.text))
            return
        for line in block.commands:
            self._one(line, ANSWERS_NO in block.remark(line))

    def _run_python(self, text: str) -> None:
        """A file is kept; a program follows those of the blocks above, and one that serves goes on."""
        if named := FILE.match(text):
            (self.folder / named[1]).write_text(text)
            return
        self._python += text + "\n"
        (self.folder / "typed.py").write_text(self._python)
        command = f"{sys.executable} -W error typed.py"
        if ".serve()" in text:
            self._serve(command, says_something=False)
        else:
            self._finish(command)

    def _one(self, line: str, no: bool = False) -> None:
        if served(line):
            self.start(line)
        else:
            self._finish(self._here(line), 1 if no else 0)

    def type_each(self, block: Block) -> None:
        """Run every line as if it were the only one."""
        whole = self.folder
        for i, line in enumerate(block.commands):
            self.folder = whole.with_name(f"{whole.name}-{block.line}-{i}")
            shutil.copytree(whole, self.folder, symlinks=True)
            before = len(self._serving)
            self._one(line)
            if len(self._serving) > before:
                self.stop()
        self.folder = whole

    def stop(self) -> None:
        """End what still runs, and forget the Python above."""
        self._python = ""
        for process in self._serving:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        self._serving.clear()

    def _here(self, line: str) -> str:
        """The line with this test's port in place of the usual one."""
        verb = verb_of(line)
        options = {name for option in VERBS[verb].params for name in option.opts} if verb else set()
        if verb == ("sitl",) and "--port" not in line:
            line += f" --port {PORT}"
        elif "--url" in options and "--url" not in line and verb != ("gcs",):
            line += f" --url udp://127.0.0.1:{PORT}"
        if verb == ("gcs",) and "--port" not in line:
            line += " --port 0"
        if verb == ("proxy",) and "--listen" not in line:
            line += f" --listen 127.0.0.1:{LISTEN}"
        if "--yes" in options and "--yes" not in line:
            line += " --yes"  # the reader confirms
        return self._substituted(line)

    def _substituted(self, text: str) -> str:
        for usual, here in self._other.items():
            text = text.replace(usual, here)
        return text

    def start(self, line: str) -> None:
        """Start what goes on until the page ends, and wait for its first word."""
        self._serve(self._here(line))

    def _serve(self, line: str, says_something: bool = True) -> None:
        out = self.folder.parent / f"served-{len(self._serving)}.txt"
        with out.open("wb") as file:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {line}"],
                cwd=self.folder, env=self._environment, stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        self._serving.append(process)
        ends_s = time.monotonic() + PATIENCE_S
        while says_something and not out.stat().st_size and process.poll() is None and time.monotonic() < ends_s:
            time.sleep(0.1)
        if not says_something:
            time.sleep(LOOKED_AT_S)
        assert process.poll() is None, f"{line}\n{out.read_text()}"

    def _finish(self, line: str, code: int = 0) -> None:
        done = subprocess.run(
            ["bash", "-e", "-c", line],
            cwd=self.folder, env=self._environment, capture_output=True, text=True, timeout=LONGEST_S, check=False,
        )  # fmt: skip
        assert done.returncode == code, f"{line}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        assert "Traceback" not in done.stderr
        too_long = long_sentences(f"{done.stdout}\n{done.stderr}")
        assert not too_long, f"{line} prints sentences of more than {LONGEST} words: {too_long}"


def long_sentences(said: str) -> list[str]:
    """Of what a command printed, outside tables and JSON; a number is no word."""
    lines = [line for line in said.splitlines() if not line.startswith((" ", "{", "[")) and "   " not in line]
    return [s for line in lines for s in sentences(line) if len(re.findall(r"\S*[a-z]\S*", s)) > LONGEST]


def verb_of(line: str) -> tuple[str, ...]:
    """The words of the verb that a line calls; empty where it calls none of ours."""
    words = tuple(line.split())
    return next((words[1:n] for n in (4, 3, 2) if words[0] == "goshawk" and words[1:n] in VERBS), ())


def served(line: str) -> bool:
    ours = verb_of(line)[:1] != () and verb_of(line)[0] in SERVING and "--help" not in line
    return ours or line.startswith("dask ")


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    """A port, of UDP by default, that nobody listens at now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
