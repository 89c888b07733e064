"""Flight logs for the estimator: the rows in the air, without take-off and landing."""

from collections.abc import Iterable
from pathlib import Path

import sysid
from firmware_bridge.airborne import in_the_air
from flight import FlightLog, InputError, file_format
from goshawk.terminal import console
from sysid.logs.reading import DRAFTED, read_joined


def load(path: Path, columns: Path | None = None) -> FlightLog:
    """Read a log; if it has the mission state, keep the rows between take-off and landing.

    Args:
        columns: column map (TOML) of a CSV log.

    Raises:
        InputError: the vehicle was never in the air.
    """
    log = read(path, columns)
    return in_the_air(log, str(path)) if log.has("mission_state") else log


def read(path: Path, columns: Path | None = None, *, imu: Path | None = None, align: bool = False) -> FlightLog:
    """A log as it is; where its columns were drafted on the spot, the draft is shown.

    Args:
        imu: a second file of the same clock, from which the IMU comes.
        align: of another clock.
    """
    log = sysid.read_log(path, columns) if imu is None else read_joined(path, imu, columns, align=align)
    for sentence in log.metadata.get(DRAFTED, ()):
        console.note(f"{path}, drafted {sentence}")
    if DRAFTED in log.metadata:
        console.note(f"to correct it: goshawk log draft-columns {path} --out columns.toml, then --columns columns.toml")
    return log


def refuse_repeated(paths: Iterable[Path], use: str) -> None:
    """Refuse files that hold the same flight, by their content.

    Args:
        use: what each flight may be given for, in the words of the verb.

    Raises:
        InputError: two files are the same, or one is missing.
    """
    seen: dict[str, Path] = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: there is no such file")
        digest = file_format.file_hash(path) if path.is_file() else str(path.resolve())
        if digest in seen:
            raise InputError(f"{path} and {seen[digest]} are the same flight; give each flight once, {use}")
        seen[digest] = path


def marked_file(path: Path) -> Path:
    """The file that marks are written to: the log itself if it is in our format, else a converted one beside it."""
    return path.with_suffix(".parquet")
