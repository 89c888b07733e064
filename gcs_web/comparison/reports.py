"""The report of the newest comparison and diagnosis, one offline HTML file each, as the page offers it for download.

Each is written with the result that it is about.
"""

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


def withdrawn(folder: Path, what: str) -> Path:
    """Where a report goes whose result is about to be saved; the one of the result before is gone. Raises as above."""
    file = report_file(folder, what)
    file.unlink(missing_ok=True)
    return file


def read(project: Project, what: str) -> tuple[str, str]:
    """A name for the file, and its text.

    Raises:
        InputError: there is none yet.
    """
    try:
        return f"{project.name} {what}", report_file(project.folder, what).read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(f"there is no report of a {what} yet; it is made with the next one") from error
