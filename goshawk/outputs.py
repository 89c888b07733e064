"""Where verbs write: the rule of `flight.results`, said in the words of the command line."""

import contextlib
from collections.abc import Generator, Iterable
from pathlib import Path

import click

import vehicle
from flight import FormatError, InputError, file_format, results
from flight.results import Placing
from vehicle import Vehicle, history

overwrite_option = click.option(
    "--overwrite", is_flag=True, help="Replace results that are there; the old ones are kept beside as NAME.old-1."
)
PICTURES = (".svg", ".png", ".ply")
"""What a folder of figures holds."""


def check(*files: Path | None, overwrite: bool, folders: Iterable[Path | None] = ()) -> None:
    """Before the work: whether all results can be put where they are wanted.

    Raises:
        InputError: one cannot; the message says which, why, and the way out.
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
    """Where to write a result; says what was kept of an earlier one."""
    with results.new_file(path, overwrite=overwrite) as placing:
        yield placing.temporary
    tell_kept(path, placing.kept)


@contextlib.contextmanager
def pictures(path: Path, *, overwrite: bool) -> Generator[Placing]:
    """The same for a folder of figures."""
    with results.new_folder(path, overwrite=overwrite, ours=holds_pictures) as placing:
        yield placing
    tell_kept(path, placing.kept)


def write_json(path: Path, document: object, *, overwrite: bool) -> None:
    with file(path, overwrite=overwrite) as temporary:
        file_format.write_bytes(temporary, file_format.json_text(document).encode())


def write_vehicle(path: Path, fitted: Vehicle, action: str, *, effect: str = "", overwrite: bool) -> None:
    """Write a vehicle file; where one is, this becomes its next version and the earlier ones stay in its history."""
    if overwrite and path.is_file() and _is_vehicle(path):
        step = history.record(path, fitted, action, effect=effect)
        click.echo(
            f"{path} is at version {step.number}; `goshawk vehicle undo {path}` returns to the one before", err=True
        )
        return
    with file(path, overwrite=overwrite) as temporary:
        vehicle.save(temporary, fitted)


def tell_kept(path: Path, kept: Path | None) -> None:
    if kept is not None:
        click.echo(f"kept: {kept.name}, what {path} was before", err=True)


def holds_pictures(folder: Path) -> bool:
    """Whether a folder holds figures and nothing else."""
    return all(p.suffix in PICTURES for p in folder.rglob("*") if not p.is_dir())


def _is_vehicle(path: Path) -> bool:
    try:
        vehicle.load(path)
    except (FormatError, InputError):
        return False
    return True
