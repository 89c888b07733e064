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
from tests.waiting import PATIENCE_S

PORT = "14550"
"""Where vehicles are by default; a test takes a free port instead."""
LONGEST_S = 2.0 * PATIENCE_S
SERVING = ("sitl", "gcs", "proxy")
"""Verbs that go on until they are stopped."""


class Reader:
    """Somebody with an empty folder, a home of its own, and Goshawk on the path."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, str(free_port())
        self._serving: list[subprocess.Popen[bytes]] = []
        self._python = ""
        programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self._environment = os.environ | {"PATH": programs, "HOME": str(folder.parent / "home")}
        folder.mkdir(parents=True)

    def type(self, block: Block) -> None:
        """Run a block; fails with what the command said where it does not end well."""
        if block.language == "python":
            self._python += block.text.replace(PORT, self.port) + "\n"
            (self.folder / "typed.py").write_text(self._python)
            self._finish(f"{sys.executable} -W error typed.py")
            return
        for line in block.commands:
            if served(line):
                self.start(line)
            else:
                self._finish(self._here(line))

    def type_each(self, block: Block) -> None:
        """Run every line as if it were the only one."""
        whole = self.folder
        for i, line in enumerate(block.commands):
            self.folder = whole.with_name(f"{whole.name}-{block.line}-{i}")
            shutil.copytree(whole, self.folder, symlinks=True)
            self._finish(self._here(line))
        self.folder = whole

    def stop(self) -> None:
        """End what still runs."""
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
        if "--yes" in options and "--yes" not in line:
            line += " --yes"  # the reader confirms
        return line.replace(PORT, self.port)

    def start(self, line: str) -> None:
        """Start what goes on until the page ends, and wait for its first word."""
        line = self._here(line)
        out = self.folder.parent / f"served-{len(self._serving)}.txt"
        with out.open("wb") as file:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {line}"],
                cwd=self.folder, env=self._environment, stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        self._serving.append(process)
        ends_s = time.monotonic() + PATIENCE_S
        while not out.stat().st_size and process.poll() is None and time.monotonic() < ends_s:
            time.sleep(0.1)
        assert process.poll() is None, f"{line}\n{out.read_text()}"

    def _finish(self, line: str) -> None:
        done = subprocess.run(
            ["bash", "-e", "-c", line],
            cwd=self.folder, env=self._environment, capture_output=True, text=True, timeout=LONGEST_S, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{line}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        assert "Traceback" not in done.stderr


def verb_of(line: str) -> tuple[str, ...]:
    """The words of the verb that a line calls; empty where it calls none of ours."""
    words = tuple(line.split())
    return next((words[1:n] for n in (4, 3, 2) if words[0] == "goshawk" and words[1:n] in VERBS), ())


def served(line: str) -> bool:
    return verb_of(line)[:1] != () and verb_of(line)[0] in SERVING and not re.search(r"--help", line)


def free_port() -> int:
    """A UDP port that nobody listens at now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
