"""A load on some flights only: it is weighed, its flights are named, and logs that say of it are believed."""

import warnings
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import pytest

import vehicle
from flight import FlightLog, InputError
from sysid import Options, compare, identify
from sysid.diagnosis import diagnose, examined, procedure
from sysid.diagnosis.evidence import load
from sysid.diagnosis.evidence.candidates import candidate_set
from sysid.diagnosis.evidence.evidence import Blocks, Evidence
from sysid.diagnosis.procedure import while_searching
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.problem import linearise
from sysid.estimator.prepare import prepare
from sysid.estimator.uncertainty import agreement
from sysid.logs.checks.payload import PAYLOAD_CARRIED
from tests.sysid import flying

LOAD_KG = 0.06


def truth(loaded: bool) -> flying.Truth:
    """The vehicle, with a point mass at its centre of mass or without."""
    plain = flying.Truth(gust=0.1)
    return replace(plain, mass=plain.mass + LOAD_KG) if loaded else plain


def flights(carried: tuple[bool, ...], seed: int, duration_s: float = 12.0) -> list[FlightLog]:
    """One flight per entry, of the three kinds in turn."""
    rng = np.random.default_rng(seed)
    flown = {loaded: fly(truth(loaded), rng, duration_s, -(-len(carried) // 3)) for loaded in (False, True)}
    logs = [flown[loaded][i] for i, loaded in enumerate(carried)]
    return [FlightLog(log.columns, {"name": f"lap-{i + 1}"}) for i, log in enumerate(logs)]


def fly(truth: flying.Truth, rng: np.random.Generator, duration_s: float, times: int = 1) -> list[FlightLog]:
    """Each of the three kinds so many times."""
    reference = flying.paper_flights(rng, times, spread=0.2)
    return flying.fly(truth, reference, 3 * times, duration_s=duration_s, rng=rng, rate_hz=100.0)


def told(logs: list[FlightLog], carried: tuple[bool, ...]) -> list[FlightLog]:
    return [FlightLog(log.columns, {**log.metadata, PAYLOAD_CARRIED: c}) for log, c in zip(logs, carried, strict=True)]


def examine(logs: list[FlightLog]) -> examined.Model:
    return examined.examine(identify(logs, vehicle.example(), while_searching(Options(gusts="white"))))


PARTLY = (False, True, False, True)


@pytest.fixture(scope="module")
def partly() -> list[FlightLog]:
    return flights(PARTLY, 11, 10.0)


@pytest.fixture(scope="module")
def weighed(partly) -> examined.Model:
    return examine(partly)


def test_a_load_is_weighed_and_its_flights_are_found(weighed):
    assert weighed.load is not None
    assert weighed.load.carriers == {1, 3}
    assert not weighed.load.doubt
    found = weighed.scores["payload"]
    assert found.size[0] == pytest.approx(LOAD_KG, rel=0.1)  # one step; the fit that follows is exact
    assert [f.carries_payload for f in weighed.flights] == list(PARTLY)
    assert found.significance < 1e-3
    assert max(weighed.scores, key=lambda name: weighed.scores[name].gain_unseen) == "payload"


def test_logs_that_say_of_the_load_are_believed(partly, weighed):
    model = examine(told(partly, PARTLY))
    assert model.load is None
    assert model.scores["payload"].size == pytest.approx(weighed.scores["payload"].size, rel=1e-3)
    assert model.scores["payload"].significance < weighed.scores["payload"].significance  # no choice to pay for


def test_a_fit_to_logs_that_say_of_the_load_finds_its_weight(partly):
    start = vehicle.example().with_effect("payload", added_kg=0.02)
    fit = identify(told(partly, PARTLY), start, while_searching(Options(gusts="white")))
    weight = fit.estimate("payload.added_kg")
    assert abs(weight.value - LOAD_KG) < 2.0 * weight.std_robust
    assert weight.std_robust < 0.05 * LOAD_KG
    light = identify(told(partly, PARTLY)[::2], vehicle.example(), while_searching(Options(gusts="white")))
    thrust = light.estimate("thrust_bem.k1_n_s2")
    assert abs(fit.vehicle.value("thrust_bem.k1_n_s2") - thrust.value) < 3.0 * thrust.std_robust


def test_a_load_on_every_flight_or_on_one_alone_cannot_be_seen(partly):
    on_all = [replace(f, carries_payload=True) for i, log in enumerate(partly) for f in prepare(log, i, Options())]
    for few in (
        on_all,
        [replace(on_all[0], carries_payload=None)],
        [replace(f, carries_payload=False) for f in on_all],
    ):
        lined = candidate_set(vehicle.example(), few)
        assert "payload" in dict(lined.invisible)
        assert "payload" not in lined.vehicle.effects


def test_nothing_is_carried_when_nothing_is(partly):
    model = examine(flights((False,) * 4, 3))
    assert "payload" not in {s.name for s in examined.significant(model)}


def evidence(rng: np.random.Generator, weight: tuple[float, ...], thrust: tuple[float, ...]) -> Evidence:
    """Linear evidence, ten blocks a flight: thrust makes force and torque, weight takes away force alone."""
    many = 10 * len(weight)
    force, torque, places = rng.normal(size=(many, 30)), rng.normal(size=(many, 30)), rng.normal(size=(3, many, 30))
    nothing = np.zeros_like(force)
    columns = [np.concatenate([force, torque], axis=1), np.concatenate([-force, nothing], axis=1)]
    columns += [np.concatenate([nothing, place], axis=1) for place in places]
    made = np.repeat(thrust, 10)[:, None] * columns[0] + np.repeat(weight, 10)[:, None] * columns[1]
    residual = rng.normal(size=made.shape) - made
    both = np.stack(columns, axis=2)
    told = object.__new__(Evidence)  # what `load.find` reads of it, without flights
    told.named = Blocks(np.einsum("bri,br->bi", both, residual), np.einsum("bri,brj->bij", both, both))
    told.names, told.base = ("thrust_bem.k1_n_s2", *load.COLUMNS), np.array([0])
    told.flight_of_block = np.repeat(np.arange(len(weight)), 10)
    told._masks, told._free = [], {}
    return told


def found_of(weight: tuple[float, ...], thrust: tuple[float, ...]) -> load.Load:
    flown = [Lap(i) for i in range(len(weight))]
    return load.find(evidence(np.random.default_rng(5), weight, thrust), cast(list[Flight], flown))


@dataclass(frozen=True)
class Lap:
    log_index: int


def test_the_carriers_are_any_set_of_flights():
    none = (0.0,) * 5
    for carried in ((0, 1, 0, 1, 1), (1, 0, 0, 0, 0), (0, 1, 1, 1, 1)):
        found = found_of(tuple(0.6 * c for c in carried), none)
        assert found.carriers == set(np.flatnonzero(carried))
        assert not found.doubt
        assert found.score.size[0] == pytest.approx(0.6, abs=4.0 * found.score.sigma[0])
        assert found.score.significance < THRESHOLDS.chance
    assert found_of(none, none).score.significance > 1e-3


def test_weight_that_grows_from_flight_to_flight_is_no_load():
    found = found_of((0.0, 0.3, 0.6, 0.9, 1.2), (0.0,) * 5)
    assert "thrust by 0, 3" in found.doubt
    assert found.score.significance == 1.0
    assert found.score.gain_unseen == 0.0


def test_propellers_that_make_less_thrust_and_torque_are_no_load():
    found = found_of((0.0,) * 5, (0.0, -0.5, 0.0, -0.5, 0.0))
    assert "see the propellers" in found.doubt
    assert found.score.significance == 1.0


def test_a_flight_that_carries_nothing_is_flown_by_the_vehicle_without_it(partly):
    """Marked as carrying it, nothing changes; marked as not, the payload neither acts nor has a column."""
    loaded = vehicle.example().with_effect("payload", added_kg=LOAD_KG, x_m=0.01)
    fit = identify(partly[:1], vehicle.example(), while_searching(Options(gusts="white")))
    unknowns = replace(fit.unknowns, model=(*fit.unknowns.model, "payload.added_kg", "payload.x_m"))
    point = replace(fit.solution.point, vehicle=loaded)
    bare = replace(point, vehicle=vehicle.example())
    (flight,), (states,) = fit.flights, point.states

    def rows(carries: bool | None, at=point, of=unknowns):
        return linearise(replace(flight, carries_payload=carries), states, at, of, fit.noise, False)

    unsaid, carried, left = rows(None), rows(True), rows(False)
    np.testing.assert_array_equal(carried.defect, unsaid.defect)
    np.testing.assert_array_equal(carried.defect_border, unsaid.defect_border)
    np.testing.assert_allclose(left.defect, rows(None, bare, fit.unknowns).defect, atol=1e-12)
    last = len(fit.unknowns.model)
    assert np.abs(left.defect_border[:, :, last : last + 2]).max() == 0.0
    assert np.abs(carried.defect_border[:, :, last : last + 2]).max(axis=(0, 1)).min() > 0.0
    both = {"with": loaded, "without": vehicle.example()}
    errors = compare(told(partly[:1], (False,)), both).errors
    assert errors["with"]["position"] == pytest.approx(errors["without"]["position"], rel=1e-4)


def test_a_mark_that_is_no_yes_or_no_is_refused(partly):
    log = FlightLog(partly[0].columns, {"name": "lap", PAYLOAD_CARRIED: "yes"})
    with pytest.raises(InputError, match="lap: payload_carried in its metadata is 'yes'"):
        prepare(log, 0, Options())


def test_only_what_the_logs_did_not_say_is_news(partly):
    said = told(partly, PARTLY)
    assert procedure._newly_told(said, told(partly, PARTLY)) == ()
    unsaid = [*said[:3], partly[3]]  # the fourth carries it, as logs do that say nothing
    assert procedure._newly_told(unsaid, unsaid) == ()
    assert procedure._newly_told([*unsaid, partly[0]], [*unsaid, said[0]]) == (*PARTLY, False)


def test_flights_are_compared_where_one_alone_carries_the_load(partly):
    """Without that flight nothing is known of the load; what is known of all else stays as it was."""
    logs = told(partly[:3], (False, True, False))
    loaded = vehicle.example().with_effect("payload", added_kg=0.5 * LOAD_KG)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = identify(logs, loaded, while_searching(Options(gusts="white")))
    named = fit.unknowns.model
    own = fit.solution.information[1]
    left = agreement.covariance_without(fit.solution.hessian, own)
    weight = named.index("payload.added_kg")
    assert not left[weight].any()
    rest = np.delete(np.arange(len(left)), weight)
    others = (fit.solution.hessian - own)[np.ix_(rest, rest)]
    np.testing.assert_allclose(left[np.ix_(rest, rest)] @ others, np.eye(len(rest)), atol=1e-6)


@pytest.mark.slow
def test_the_diagnosis_names_the_load_and_its_flights(partly):
    found = diagnose(partly, vehicle.example(), held_out=flights((True, False), 2), auto=True)
    assert found.additions == ("payload",)
    assert found.payload_carried == (False, True, False, True, True, False)
    assert "payload (carried by lap-2, lap-4, lap-1 alone)" in found.verdict
    weight = found.vehicle.parameter("payload.added_kg")
    assert abs(weight.value - LOAD_KG) < 2.0 * weight.std
    before, after = (s.position_m["0.5 s"] for s in found.staircase[-2:])
    assert after < 0.8 * before
    assert found.as_dict()["payload_carried"] == list(found.payload_carried)
    assert found.outside is None
