"""What was added is taken out only if the model without it can be fitted and does not want it back."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

import vehicle
from flight import InputError
from sysid import Options
from sysid.diagnosis import fitting
from sysid.diagnosis.evidence.candidates import Candidate

VEHICLE = vehicle.example().with_effect("angular_damping").with_effect("flapping_moment")


def candidate(name: str) -> Candidate:
    return Candidate(name, name, (), (), (), ("M_x",), "w", ())


@pytest.fixture
def earlier(monkeypatch: pytest.MonkeyPatch) -> list[Candidate]:
    """Two additions that the last one made unnecessary; without the first no fit gets better in any direction."""
    first, second = candidate("angular_damping"), candidate("flapping_moment")

    def identify(logs: Any, given: vehicle.Vehicle, options: Options, **how: Any) -> Any:
        if first.name not in given.effects:
            raise InputError("the fit does not get better in any direction")
        return SimpleNamespace(vehicle=given)

    monkeypatch.setattr(fitting, "identify", identify)
    monkeypatch.setattr(fitting, "examine", lambda fit: SimpleNamespace(fit=fit))
    monkeypatch.setattr(fitting, "significant", lambda model: [])
    chance = {first.name: 1.0, second.name: 0.9}
    monkeypatch.setattr(fitting, "loss", lambda model, one: SimpleNamespace(significance=chance[one.name]))
    return [first, second]


def test_an_addition_without_which_no_fit_is_found_stays_and_the_next_is_looked_at(earlier):
    model = cast("Any", SimpleNamespace(fit=SimpleNamespace(vehicle=VEHICLE)))
    assert fitting.superfluous((), model, earlier[:1], Options()) is None
    found = fitting.superfluous((), model, earlier, Options())
    assert found is not None
    dropped, without = found
    assert dropped.name == "flapping_moment"
    assert without.fit.vehicle.effects == VEHICLE.without_effect("flapping_moment").effects
