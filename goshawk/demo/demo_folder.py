"""The folder that `goshawk demo` owns: made anew by every run, but never at the cost of what somebody did in it.

A demo that was broken off (Ctrl-C, a link that died) keeps `unfinished.json`: the steps it had finished and what came
of them. The next run with the same settings goes on after them.
"""

import contextlib
import shutil
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flight import FormatError, InputError, file_format, project, results
from goshawk.terminal import console, outputs

FORMAT, FACTS = "goshawk-demo", "demo.json"
UNFINISHED = "unfinished.json"
VERSION = 1
NAME = "rendered room"
"""Of the demo's project."""


@dataclass(slots=True)
class Steps:
    """The steps of a demo: each is done once, however often the demo is broken off and started again."""

    folder: Path
    settings: Mapping[str, Any]
    """What the steps depend on; a demo with others does not go on with them."""
    done: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    """What came of each finished step, by its name."""
    not_ours: dict[str, str] = field(default_factory=dict[str, str])
    """Files, by hash, that lay there when the demo went on and that no finished step had left."""

    def do(self, name: str, work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """What comes of a step, which must fit into JSON; the work is left out if an earlier run did it."""
        if name not in self.done:
            self.done[name] = work()
            self.record()
        return self.done[name]

    def record(self) -> None:
        """Write down what is done, for a run that goes on."""
        body = {"settings": dict(self.settings), "steps": self.done, "files": self._files()}
        file_format.write_json(self.folder / UNFINISHED, format=FORMAT, version=VERSION, body=body)

    def finish(self, facts: Mapping[str, Any]) -> None:
        """Write the facts of the whole demo in the place of the record of its steps."""
        body = {**facts, "files": self._files()}
        file_format.write_json(self.folder / FACTS, format=FORMAT, version=VERSION, body=body)
        (self.folder / UNFINISHED).unlink(missing_ok=True)

    def _files(self) -> dict[str, str]:
        return dict(hashes(self.folder).items() - self.not_ours.items())


@contextlib.contextmanager
def making(out: Path, settings: Mapping[str, Any]) -> Generator[Steps]:
    """Make room for a demo in `out` and take up its steps where an earlier run was broken off.

    A finished demo that was there is moved aside, and removed at the end if nothing in it was changed.

    Raises:
        InputError: `out` holds something else than a demo.
    """
    results.require_free_folder(out, overwrite=True, ours=_is_demo)
    out = out.resolve()  # a link stays a link
    steps, earlier = _unfinished(out, settings), None
    if steps is not None:
        console.note(f"going on with the demo in {out} after: {', '.join(steps.done) or 'nothing yet'}")
    else:
        steps, earlier = Steps(out, settings), _moved_aside(out)
        project.create(out, NAME)
        steps.record()
    try:
        yield steps
    except BaseException:
        done = ", ".join(steps.done) or "nothing yet"
        console.note(f"finished: {done}; the same command continues from there")
        raise
    if earlier is not None:
        shutil.rmtree(earlier)
        console.note(f"the earlier demo in {out} was replaced; nothing in it had been changed")


def _moved_aside(out: Path) -> Path | None:
    """Move away what is there; where it is now, if it is a demo as made, which need not be kept."""
    if not out.is_dir() or not any(out.iterdir()):
        return None
    kept = results.move_aside(out)
    if _is_as_made(kept):
        return kept
    outputs.report_kept(out, kept)
    return None


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file but the demo's own records, by path."""
    own = (folder / FACTS, folder / UNFINISHED)
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p not in own)
    return {str(p.relative_to(folder)): file_format.file_hash(p) for p in files}


def _is_demo(folder: Path) -> bool:
    try:
        return project.open_project(folder).name == NAME
    except (InputError, FormatError):
        return False


def _unfinished(folder: Path, settings: Mapping[str, Any]) -> Steps | None:
    """The steps that an earlier run finished, if it had these settings and the steps' files are as they were left."""
    document = _read(folder / UNFINISHED)
    left, present = document.get("files", {}), hashes(folder)
    if document.get("settings") != dict(settings) or not left.items() <= present.items():
        return None
    return Steps(folder, settings, document["steps"], dict(present.items() - left.items()))


def _is_as_made(folder: Path) -> bool:
    return _read(folder / FACTS).get("files") == hashes(folder)


def _read(path: Path) -> dict[str, Any]:
    try:
        return file_format.read_json(path, format=FORMAT, version=VERSION)
    except (InputError, FormatError):
        return {}
