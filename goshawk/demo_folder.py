"""The folder that `goshawk demo` owns: made anew by every run, but never at the cost of what somebody did in it."""

import contextlib
import shutil
from collections.abc import Generator
from pathlib import Path

import click

from flight import FormatError, InputError, file_format, project, results
from goshawk import outputs

FORMAT, FACTS = "goshawk-demo", "demo.json"
VERSION = 1
NAME = "rendered room"
"""Of the demo's project."""


@contextlib.contextmanager
def making(out: Path) -> Generator[None]:
    """Make room for a demo in `out`; what was there is moved aside, and removed at the end if it is a demo as made.

    Raises:
        InputError: `out` holds something else than a demo.
    """
    results.require_free_folder(out, overwrite=True, ours=_is_demo)
    kept = results.move_aside(out) if out.is_dir() and any(out.iterdir()) else None
    if kept is not None and not _is_as_made(kept):
        outputs.tell_kept(out, kept)
        kept = None
    yield
    if kept is not None:
        shutil.rmtree(kept)
        click.echo(f"the earlier demo in {out} was replaced; nothing in it had been changed", err=True)


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file but the facts, by path."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p != folder / FACTS)
    return {str(p.relative_to(folder)): file_format.file_hash(p) for p in files}


def _is_demo(folder: Path) -> bool:
    try:
        return project.open_project(folder).name == NAME
    except (InputError, FormatError):
        return False


def _is_as_made(folder: Path) -> bool:
    try:
        document = file_format.read_json(folder / FACTS, format=FORMAT, version=VERSION)
    except (InputError, FormatError):
        return False
    return document.get("files") == hashes(folder)
