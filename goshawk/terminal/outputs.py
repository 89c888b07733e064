"""Output files of the verbs: the rule of `flight.results`, with the command line's messages."""

import contextlib
from collections.abc import Generator, Iterable
from pathlib import Path

import click

import vehicle
from flight import FormatError, InputError, results
from flight.results import Placing
from goshawk.terminal import console
from vehicle import Vehicle, history

overwrite_option = click.option(
    "--overwrite", is_flag=True, help="Replace existing results; the old ones are kept beside as NAME.old-1."
)
PICTURES = (".svg", ".png", ".ply")
"""File types in a folder of figures."""


def check(*files: Path | None, overwrite: bool, folders: Iterable[Path | None] = ()) -> None:
    """Check, before the work, that all results can be written.

    Raises:
        InputError: one cannot; the message names it, the reason and the remedy.
    """
    folders = [folder for folder in folders if folder is not None]
    results.require_apart([*files, *folders])
    for file in files:
        if file is None:
            continue
        if not overwrite and file.suffix == ".toml" and file.is_file() and _is_vehicle(file):
            raise InputError(
                f"{file} is a vehicle file; give another name, or --overwrite to make this its next version "
                "(`goshawk vehicle undo` returns to the present one)"
            )
        results.require_free(file, overwrite=overwrite)
    for folder in folders:
        results.require_free_folder(folder, overwrite=overwrite, ours=holds_pictures)


@contextlib.contextmanager
def file(path: Path, *, overwrite: bool) -> Generator[Path]:
    """Yield where to write a result; reports the name under which an earlier one was kept."""
    with results.new_file(path, overwrite=overwrite) as placing:
        yield placing.temporary
    report_kept(path, placing.kept)


@contextlib.contextmanager
def pictures(path: Path, *, overwrite: bool) -> Generator[Placing]:
    """As `file`, for a folder of figures."""
    with results.new_folder(path, overwrite=overwrite, ours=holds_pictures) as placing:
        yield placing
    report_kept(path, placing.kept)


def write_vehicle(path: Path, fitted: Vehicle, action: str, *, effect: str = "", overwrite: bool) -> None:
    """Write a vehicle file; an existing one gets this as its next version and keeps the earlier ones in its history."""
    if overwrite and path.is_file() and _is_vehicle(path):
        step = history.record(path, fitted, action, effect=effect)
        console.note(f"{path} is at version {step.number}; `goshawk vehicle undo {path}` returns to the one before")
        return
    with file(path, overwrite=overwrite) as temporary:
        vehicle.save(temporary, fitted)


def report_kept(path: Path, kept: Path | None) -> None:
    if kept is not None:
        console.note(f"kept: {kept.name}, what {path} was before")


def holds_pictures(folder: Path) -> bool:
    """Whether a folder holds figures and nothing else."""
    return all(p.suffix in PICTURES for p in folder.rglob("*") if not p.is_dir())


def _is_vehicle(path: Path) -> bool:
    try:
        vehicle.load(path)
    except (FormatError, InputError):
        return False
    return True
