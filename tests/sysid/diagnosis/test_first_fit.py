"""With which disturbances and clock a diagnosis is made: decided by its first fit."""

from types import SimpleNamespace
from typing import Any

import pytest

import vehicle
from flight import silent
from sysid import Options
from sysid.diagnosis import first_fit
from sysid.estimator import fit_to_use, verdict
from sysid.estimator.result import NOT_SETTLED

YAW = "inertia_zz_kg_m2"
TRUTH = vehicle.example()
WHITE = Options(gusts="white")
WITH_POSE: Any = SimpleNamespace(has=lambda name: True)


def fit(times: float, *, lasting: bool = False, settled: bool = True) -> Any:
    """Of yaw inertia so many times the file's; what did not settle is held there."""
    estimate = SimpleNamespace(
        name=YAW, value=TRUTH.value(YAW), unit="kg m2", status="free" if settled else NOT_SETTLED
    )
    fitted, free = TRUTH.with_value(YAW, times * TRUTH.value(YAW)), (YAW,) if settled else ()
    return SimpleNamespace(
        vehicle=fitted,
        verdict=verdict.of_fit(TRUTH, fitted, (), free, ()),
        converged=True,
        noise=SimpleNamespace(gusts="half a second" if lasting else None),
        parameters=(estimate,),
        clocks="late" if times == 1.5 else "",
    )


@pytest.mark.parametrize(
    ("fits", "options", "kept", "gusts", "held", "sentences"),
    [
        ([fit(1.0)], WHITE, 0, "white", (), 0),
        ([fit(40.0), fit(1.1, lasting=True)], WHITE, 1, "estimate", (), 1),
        ([fit(40.0), fit(1.0, lasting=True, settled=False)], WHITE, 1, "estimate", (YAW,), 2),
        ([fit(40.0), fit(1.0)], WHITE, 0, "white", (), 0),  # lasting ones did not settle
        ([fit(40.0), fit(40.0, lasting=True)], WHITE, 0, "white", (), 0),
        ([fit(40.0, lasting=True), fit(40.0)], Options(), 0, "estimate", (), 0),
        ([fit(40.0, lasting=True), fit(1.1)], Options(), 1, "white", (), 1),  # lasting ones take up what is the model's
        ([fit(1.5), fit(1.0)], WHITE, 1, "white", (), 0),  # a late pose is measured by the rotors' clock
        ([fit(40.0), fit(1.5, lasting=True), fit(1.0, lasting=True)], WHITE, 2, "estimate", (), 1),
    ],
)
def test_the_first_fit_decides_how_all_fits_are_made(
    monkeypatch: pytest.MonkeyPatch, fits, options: Options, kept: int, gusts: str, held, sentences: int
):
    made: list[Options] = []

    def identify(logs: Any, given: Any, options: Options, **how: Any) -> Any:
        made.append(options)
        return fits[len(made) - 1]

    monkeypatch.setattr(first_fit, "identify", identify)
    monkeypatch.setattr(fit_to_use, "identify", identify)
    monkeypatch.setattr(first_fit, "pose_is_late", lambda clocks: clocks == "late")
    found = first_fit.first_fit((WITH_POSE,), TRUTH, options, silent)
    assert len(made) == len(fits)
    assert found.fit is fits[kept]
    assert (found.options.gusts, found.options.held) == (gusts, held)
    late = fits[kept - 1].clocks == "late" if kept else False
    assert found.options.clock == ("rotor speed" if late else "pose")
    assert len(found.said) == sentences
    assert all(YAW in sentence for sentence in found.said)
