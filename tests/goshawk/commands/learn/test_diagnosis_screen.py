"""A short diagnosis keeps to its lines: what gives way first, and what never does."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from goshawk.commands.learn import diagnosis_screen
from goshawk.commands.learn.diagnose import first
from goshawk.terminal.screen import Screen
from sysid.diagnosis import Diagnosis
from sysid.diagnosis.findings import CandidateFinding, Size, Verdict
from sysid.estimator import verdict as fits

NEEDED = diagnosis_screen.NEEDED


@pytest.mark.parametrize(
    ("ranked", "left"),
    [
        ([(NEEDED, 5), (6, 3), (2, 3), (NEEDED, 7)], [5, 3, 3, 7]),
        ([(NEEDED, 5), (6, 3), (2, 4), (NEEDED, 7)], [5, 4, 7, 1]),
        ([(NEEDED, 9), (6, 3), (2, 4), (NEEDED, 9)], [9, 9, 1]),
        ([(NEEDED, 20), (1, 1)], [20, 1]),
        ([(NEEDED, 10), (3, 6), (3, 5)], [10, 6, 1]),
    ],
)
def test_what_has_no_room_gives_way_by_its_rank_from_the_last_and_is_counted(monkeypatch, ranked, left):
    paragraphs = [(rank, [f"{i}"] * lines) for i, (rank, lines) in enumerate(ranked)]
    gone = len(ranked) - sum(lines in left for _, lines in ranked)
    monkeypatch.setattr(diagnosis_screen, "_ranked", lambda found: paragraphs)
    said = lines(diagnosis_screen.short(cast("Any", None)))
    assert [said.count(name) for name in dict.fromkeys(said)] == left
    assert not gone or said[-1] == f"no room here for {gone} more sentence{'s' * (gone > 1)} (--details)"


def lines(screen: Screen) -> list[str]:
    return [part["line"] for part in screen.parts]


HOVER = "all flights hover: no yaw, so what acts there cannot be told; fly yaw_doublets"
STAIRS = [SimpleNamespace(model=f"{i}", position_m={"0.5 s": 0.01}) for i in range(3)]
REASON = "thrust came out 0.5, where propellers have 0.005 to 0.04. Check the unit of rotor speed"


def diagnosis(**changed: Any) -> Diagnosis:
    """Two effects stated, a proxy beside them, and a fit that is refused for three reasons: more than has room."""
    two = (Verdict.PRESENT, Verdict.PRESENT, Verdict.PROXY)
    values = [(f"{axis}_kg", -0.0123456, 0.001) for axis in "xyz"]
    known: dict[str, Any] = {
        "verdict": "missing was drag_0 and drag_1",
        "confidence": 0.5,
        "families": [SimpleNamespace(has_forms=True, sentence="drag 97%: drag_0 60%, another form 37%")] * 2,
        "outside": None,
        "search": SimpleNamespace(equation=None),
        "candidates": [replace(finding(*values), name=f"drag_{i}", verdict=v) for i, v in enumerate(two)],
        "belief": SimpleNamespace(something_unknown=0.2, otherwise=0.1),
        "envelope": SimpleNamespace(level_speed_m_s=0.4, climb_m_s=0.2, sink_m_s=0.1, rate_rad_s=0.3),
        "staircase": [SimpleNamespace(model="as given", position_m={"0.5 s": 0.01})],
        "held_out": ("x",),
        "predicts": SimpleNamespace(ratio90=(0.3, 0.5)),
        "fit_verdict": fits.Verdict(against=(REASON, "another"), doubts=("a third",)),
        "cause": None,
        "invisible": [],
        "findings": ("flight 1: gyro is 3.0 ± 0.1 ms early; the fit allows for it", "b"),
    }
    return cast("Any", SimpleNamespace(**{**known, **changed}))


def test_the_second_missing_effect_has_its_size_before_a_proxy_has():
    said = lines(diagnosis_screen.short(diagnosis(staircase=STAIRS)))
    assert len(said) <= diagnosis_screen.MOST_LINES
    assert sum(line.startswith(("  drag_0:", "  drag_1:")) for line in said) == 2
    assert not any(line.startswith("  drag_2:") for line in said)
    assert any(line.startswith("  within the flown envelope") for line in said)
    assert said[-1].startswith("no room here for ")


def test_what_has_no_room_is_counted_with_the_notes():
    said = lines(diagnosis_screen.short(diagnosis(staircase=STAIRS)))
    assert said[-1] == "no room here for 4 more sentences and 2 notes (--details)"


def test_that_all_flights_hover_is_always_said_whole_and_first_among_the_notes():
    said = " ".join(lines(diagnosis_screen.short(diagnosis(findings=(HOVER, "b")))))
    assert f"note: {HOVER}, and 1 more note" in " ".join(said.split())


def test_a_note_of_one_flight_says_what_is_noted():
    clock = diagnosis_screen._first_note(diagnosis().findings, whole=False)
    assert clock == "note: flight 1: gyro is 3.0 ± 0.1 ms early, and 1 more note"
    assert diagnosis_screen._first_note(("a: b. c", "d", "e"), whole=False) == "note: a: b, and 2 more notes"
    mass = "the mass was given as 0.7 kg and not estimated: only ratios to it are identifiable. Weigh it"
    said = diagnosis_screen._first_note((mass, "b", "c"), whole=False)
    assert said == "note: the mass was given as 0.7 kg and not estimated, and 2 more notes"
    assert diagnosis_screen._first_note(("a",), whole=False) == "note: a"


def test_the_reasons_against_a_fit_are_counted_and_the_remedy_is_kept():
    judged, remedy = diagnosis_screen._of_the_fit(diagnosis())
    assert judged == (
        "the fit is do not use: thrust came out 0.5, where propellers have 0.005 to 0.04 (and 2 more); 0.5 s ahead "
        "0.3 to 0.5 times as far off as the model given (90 %)"
    )
    assert remedy == "Check the unit of rotor speed"
    fine = diagnosis(fit_verdict=fits.Verdict(), predicts=SimpleNamespace(ratio90=(0.0, float("inf"))))
    assert diagnosis_screen._of_the_fit(fine) == (f"the fit is {fits.Verdict().use}", "")


def test_the_first_command_is_shown_with_its_remarks_and_the_others_are_counted():
    assert first(["(mend it)", "goshawk diagnose a", "goshawk next-flight a", "goshawk b"]) == [
        "(mend it)",
        "goshawk diagnose a",
        "(2 more with --details)",
    ]
    assert first(["goshawk diagnose a"]) == ["goshawk diagnose a"]
    marks = ["goshawk log mark a --payload left", "goshawk log mark b --payload left"]
    assert first([*marks, "goshawk diagnose a", "goshawk b"], writes=True) == [
        *marks,
        "goshawk diagnose a",
        "(1 more with --details, without --out)",
    ]
    assert first(["(nothing can be made of it)"]) == ["(nothing can be made of it)"]
    assert first([]) == []


def finding(*values: tuple[str, float, float]) -> CandidateFinding:
    sizes = tuple(Size(f"drag.{name}", "kg", value, half / 1.6, half, 0.1, 1.0) for name, value, half in values)
    return CandidateFinding("drag", Verdict.PRESENT, "", sizes, 0.0, 0.0, 0.0146, 0.9, (), (), (), "")


def test_a_size_that_may_be_nothing_stands_by_its_name_alone():
    said = diagnosis_screen._size_sentence(finding(("x_kg", 0.1, 0.3), ("y_kg", -0.2, 0.3), ("z_kg", 0.5, 0.2)))
    assert said == "drag: z_kg 0.5 (0.3 to 0.7) kg, x_kg, y_kg not apart from 0; alone 14.6 mm of position in 0.5 s"
    assert diagnosis_screen._size_sentence(finding(("x_kg", 0.1, 0.3))).startswith("drag: x_kg 0.1 (-0.2 to 0.4) kg;")


def test_errors_are_in_columns_of_one_width():
    stairs = [SimpleNamespace(model=name, position_m={"0.1 s": 0.1, "0.5 s": 1.2, "1 s": 20.0}) for name in "abcd"]
    lines = diagnosis_screen._prediction(cast("Any", SimpleNamespace(staircase=stairs, held_out=("x",))))
    assert len({len(line) for line in lines}) == 1
    assert [line.split()[0] for line in lines[1:]] == ["a", "b", "d"]
    assert lines[1].split() == ["a", "100.0", "1200.0", "20000.0"]
    assert len(lines[0]) <= diagnosis_screen.COLUMNS
