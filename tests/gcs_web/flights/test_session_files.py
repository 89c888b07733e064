"""Files in `.session/` that are damaged, whatever is in them, count as missing, and the station opens all the same."""

from pathlib import Path

import msgspec
import pytest

from flight import project
from gcs_web.comparison import comparing, residuals
from gcs_web.flights.flights import Flights
from gcs_web.learning import identified, learning, proposed
from gcs_web.learning.learning import Learning
from gcs_web.protocol.learning import Diagnosis

DAMAGED = {
    "empty": b"",
    "no text": b"\x82\xff\x00",
    "a byte within a word": b'{"type":"next_flight","state":"\xffurrent","verdict":"\xff","a":"\xff"}',
    "of another kind": b"[1]",
    "too deep": b'{"type":"next_flight","a":' + b"[" * 100_000,
    "out of range": b'{"type":"next_flight","state":"current","size":1e999}',
}


@pytest.mark.parametrize("data", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_file_counts_as_missing(tmp_path: Path, data: bytes):
    opened = project.create(tmp_path / "project", "damaged")
    folder = opened.folder
    kept = [
        learning.diagnosis_file(folder),
        *learning.tried_files(folder),
        comparing.comparison_file(folder),
        identified.identification_file(folder),
        proposed.file(folder),
        folder / ".session" / "roles.json",
    ]
    kept[0].parent.mkdir(exist_ok=True)
    for file in kept:
        file.write_bytes(data)
    shown = Learning(opened, Flights(opened, lambda _: None))
    assert shown.diagnosis() == Diagnosis("none")
    assert (shown.identification().state, shown.next_flight().state) == ("none", "none")
    assert shown._trial() is None
    assert residuals.load(comparing.comparison_file(folder)) is None


@pytest.mark.parametrize(
    "change", [{"variables": ["nobody's"]}, {"rms": []}, {"errors": {"mood": [1.0]}}, {"version": 2}]
)
def test_a_comparison_that_cannot_be_shown_counts_as_missing(tmp_path: Path, change: dict[str, object]):
    whole = residuals.Compared(
        residuals.FORMAT, residuals.VERSION, "", "", ["v_x"], [[0.1]] * 6, "held out", [0.1] * 6, {}, 1, [], []
    )
    residuals.save(tmp_path / "kept", whole)
    assert residuals.load(tmp_path / "kept") == whole
    residuals.save(tmp_path / "kept", msgspec.structs.replace(whole, **change))
    assert residuals.load(tmp_path / "kept") is None
