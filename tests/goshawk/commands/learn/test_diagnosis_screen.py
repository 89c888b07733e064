"""A short diagnosis keeps to its lines: what gives way first, and what never does."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from goshawk.commands.learn import diagnosis_screen
from goshawk.commands.learn.diagnose import first
from sysid.diagnosis.findings import CandidateFinding, Size, Verdict

NEEDED = diagnosis_screen.NEEDED


@pytest.mark.parametrize(
    ("ranked", "left"),
    [
        ([(NEEDED, 5), (6, 3), (2, 3), (NEEDED, 7)], [5, 3, 3, 7]),
        ([(NEEDED, 5), (6, 3), (2, 4), (NEEDED, 7)], [5, 4, 7]),
        ([(NEEDED, 9), (6, 3), (2, 4), (NEEDED, 9)], [9, 9]),
        ([(NEEDED, 20), (1, 1)], [20]),
        ([(NEEDED, 10), (3, 6), (3, 5)], [10, 5]),
    ],
)
def test_what_has_no_room_gives_way_by_its_rank_and_what_is_needed_never(monkeypatch, ranked, left):
    paragraphs = [(rank, [f"{i}"] * lines) for i, (rank, lines) in enumerate(ranked)]
    monkeypatch.setattr(diagnosis_screen, "_ranked", lambda found: paragraphs)
    said = [part["line"] for part in diagnosis_screen.short(cast("Any", None)).parts]
    assert [said.count(name) for name in dict.fromkeys(said)] == left


def test_the_first_command_is_shown_with_its_remarks_and_the_others_are_counted():
    assert first(["(mend it)", "goshawk diagnose a", "goshawk next-flight a", "goshawk b"]) == [
        "(mend it)",
        "goshawk diagnose a",
        "(2 more with --details)",
    ]
    assert first(["goshawk diagnose a"]) == ["goshawk diagnose a"]
    assert first(["(nothing can be made of it)"]) == ["(nothing can be made of it)"]
    assert first([]) == []


def finding(*values: tuple[str, float, float]) -> CandidateFinding:
    sizes = tuple(Size(f"drag.{name}", "kg", value, half / 1.6, half, 0.1, 1.0) for name, value, half in values)
    return CandidateFinding("drag", Verdict.PRESENT, "", sizes, 0.0, 0.0, 0.0146, 0.9, (), (), (), "")


def test_a_size_that_may_be_nothing_stands_by_its_name_alone():
    said = diagnosis_screen._size_sentence(finding(("x_kg", 0.1, 0.3), ("y_kg", -0.2, 0.3), ("z_kg", 0.5, 0.2)))
    assert said == "drag: z_kg 0.5 (0.3 to 0.7) kg, x_kg, y_kg not apart from 0; alone 14.6 mm in 0.5 s"
    assert diagnosis_screen._size_sentence(finding(("x_kg", 0.1, 0.3))).startswith("drag: x_kg 0.1 (-0.2 to 0.4) kg;")


def test_errors_stand_in_columns_of_one_width():
    stairs = [SimpleNamespace(model=name, position_m={"0.1 s": 0.1, "0.5 s": 1.2, "1 s": 20.0}) for name in "abcd"]
    lines = diagnosis_screen._prediction(cast("Any", SimpleNamespace(staircase=stairs, held_out=("x",))))
    assert len({len(line) for line in lines}) == 1
    assert [line.split()[0] for line in lines[1:]] == ["a", "b", "d"]
    assert lines[1].split() == ["a", "100.0", "1200.0", "20000.0"]
    assert len(lines[0]) <= diagnosis_screen.COLUMNS
