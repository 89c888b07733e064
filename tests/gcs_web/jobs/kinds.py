"""Kinds of jobs for tests. Their processes import this file alone: what a test compares with takes a second."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import msgspec

from flight import InputError, Progress
from gcs_web.jobs.jobs import Kind


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    word: Annotated[str, msgspec.Meta(title="Word", max_length=20)]
    steps: Annotated[int, msgspec.Meta(title="Steps", ge=1, le=5, extra_json_schema={"unit": "steps"})] = 2


def say(folder: Path, asked: Arguments, progress: Progress) -> str:
    for step in range(asked.steps):
        progress("saying", (step + 1) / asked.steps)
    return asked.word * asked.steps


class Given(msgspec.Struct, forbid_unknown_fields=True):
    word: Annotated[str, msgspec.Meta(extra_json_schema={"given": True})] = ""
    steps: int = 1


def say_given(folder: Path, asked: Given, progress: Progress) -> str:
    return asked.word * asked.steps


def refuse(folder: Path, asked: Arguments, progress: Progress) -> None:
    raise InputError(f"{asked.word!r} cannot be said; say another word")


def crash(folder: Path, asked: Arguments, progress: Progress) -> None:
    os.abort()


def lack(folder: Path, asked: Arguments, progress: Progress) -> None:
    sys.modules["cv2"] = None  # type: ignore[assignment]  as in an installation without it; this process is the job's
    import cv2  # noqa: F401


def hold_on(folder: Path, asked: Arguments, progress: Progress) -> None:
    """Works for ever with a child of its own, and does not listen to SIGTERM."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"])
    (folder / "pids").write_text(f"{os.getpid()} {child.pid}")
    progress("holding on", 0.5)
    time.sleep(1000)


def echo(_: Any, result: Any) -> str:
    return f"said {result}"


KINDS = [Kind(work.__name__, work.__name__, Arguments, work, echo) for work in (say, refuse, crash, lack, hold_on)]
