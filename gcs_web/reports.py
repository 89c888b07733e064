"""The newest report of a comparison or a diagnosis, one offline HTML file each, as the page offers it for download."""

from pathlib import Path

from flight import InputError
from flight.project import Project

REPORTS = ("comparison", "diagnosis")


def report_file(folder: Path, what: str) -> Path:
    """Where the station keeps it.

    Raises:
        InputError: there is no such kind of report.
    """
    if what not in REPORTS:
        raise InputError(f"there is no report {what!r}; there are {' and '.join(REPORTS)}")
    return folder / ".session" / f"{what}.html"


def read(project: Project, what: str) -> tuple[str, str]:
    """A name for the file, and its text.

    Raises:
        InputError: there is none yet.
    """
    try:
        return f"{project.name} {what}", report_file(project.folder, what).read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(f"there is no report of a {what} yet; press Save as report first") from error
