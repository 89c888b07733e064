"""The newest identification on the page: values, correlation, confounded pairs and trials are those of the fit."""

import numpy as np
import pytest

import vehicle
from flight import flight_log, project, silent
from gcs_web.flights.flights import Flights
from gcs_web.learning import identified
from gcs_web.learning.learning import Learning
from goshawk.station_jobs import identify
from sysid.estimator.uncertainty.unsettled import CONFOUNDED
from tests.goshawk.station_jobs.test_station_learning import BOB
from vehicle import flights, manoeuvres

TRUE_S_M = vehicle.example().value("rotor_drag_thrust.drag_s_m")


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> project.Project:
    """Two flights, and a model whose rotor drag is twice what they show."""
    made = project.create(tmp_path_factory.mktemp("identified") / "project", "identified")
    made.flight("a").parent.mkdir()
    truth, rng = vehicle.example(), np.random.default_rng(3)
    for name, size in (("a", 9.0), ("b", -7.0)):
        weave = manoeuvres.from_legs(x=[(2.5, size), (2.5, -size)], y=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], z=BOB)
        flight_log.save(made.flight(name), flights.measure(flights.fly_trajectory(truth, weave), rng=rng))
    vehicle.save(made.vehicle, truth.with_value("rotor_drag_thrust.drag_s_m", 2.0 * TRUE_S_M, std=0.02))
    return made


def test_a_fit_with_trials_is_kept_shown_and_becomes_old(opened):
    asked = identify.Arguments(["a", "b"], trials=True)
    identify._run(opened.folder, asked, silent)
    listed = Flights(opened, lambda _: None)
    learning = Learning(opened, listed)
    found = learning.identification()
    assert found == identified.load(opened.folder)
    assert (found.state, found.written) == ("current", ["fitted.toml", "fitted.html"])
    rows = {row.name: row for row in found.parameters}
    assert [name for name in found.free if rows[name].status != "free"] == []
    assert len({row.words for row in found.parameters}) == len(found.parameters)
    drag = rows["rotor_drag_thrust.drag_s_m"]
    assert drag.start == 2.0 * TRUE_S_M
    assert abs(drag.value - TRUE_S_M) < 4.0 * drag.sigma < TRUE_S_M
    assert (drag.value, drag.unit) == (vehicle.load(opened.folder / "fitted.toml").value(drag.name), "s/m")

    r = np.array(found.correlation)
    assert r.shape == (len(found.free), len(found.free))
    np.testing.assert_allclose(r, r.T, atol=1e-12)
    np.testing.assert_allclose(np.diag(r), 1.0)
    assert np.count_nonzero(np.abs(np.triu(r, 1)) >= CONFOUNDED) == len(found.confounded)
    sizes = [abs(pair.correlation) for pair in found.confounded]
    assert sizes == sorted(sizes, reverse=True)

    assert [trial.flight for trial in found.trials] == ["a", "b"]
    at = found.free.index(drag.name)
    for trial in found.trials:
        assert len(trial.values) == len(trial.sigmas) == len(found.free)
        assert abs(trial.values[at] - TRUE_S_M) < 5.0 * trial.sigmas[at]

    vehicle.save(opened.vehicle, vehicle.example())
    assert learning.identification().state == "old"
    listed.close()


def test_before_any_fit_there_is_none_and_a_damaged_file_is_none(tmp_path):
    assert identified.load(tmp_path).state == "none"
    identified.identification_file(tmp_path).parent.mkdir()
    identified.identification_file(tmp_path).write_text("{")
    assert identified.load(tmp_path).state == "none"
