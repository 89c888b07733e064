"""Recorded flights without a browser: their list, streams at any level of detail, logs that come, are fixed and go."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sysid
import vehicle
from firmware_bridge.controller import State
from flight import FlightError, FlightLog, InputError, flight_log, project, silent
from flight.flight_log import COLUMNS
from gcs_web.flights import pyramid, reading
from gcs_web.flights.flights import Flights
from gcs_web.flights.pyramid import Pyramid
from gcs_web.flights.recorded import MOST_POINTS, Recorded
from gcs_web.jobs import incoming
from gcs_web.protocol import flights as flights_messages
from gcs_web.protocol.flights import Incoming
from goshawk.commands.learn import log_outputs
from sysid.logs import fix
from tests.waiting import until
from vehicle import flights, manoeuvres

STEP_S = 0.005


@given(
    values=st.lists(st.floats(-1e6, 1e6, width=32) | st.just(np.nan), min_size=3, max_size=400),
    points=st.integers(2, 40),
    window=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).filter(lambda w: w[0] < w[1]),
)
def test_every_level_of_detail_keeps_the_extremes_of_what_it_covers(values, points, window):
    samples = np.array(values, dtype=np.float32)
    time_s = np.arange(len(samples), dtype=np.float64)
    from_s, to_s = (share * (len(samples) - 1) for share in window)
    when, (drawn,) = pyramid.part(time_s, [Pyramid.of(samples)], from_s, to_s, points)
    inside = samples[(time_s >= from_s) & (time_s <= to_s)]
    assert len(when) == len(drawn) <= 2 * points + 8
    assert (np.diff(when) >= 0.0).all()
    if np.isfinite(inside).any():
        assert np.nanmin(drawn) <= np.nanmin(inside)
        assert np.nanmax(drawn) >= np.nanmax(inside)
        assert np.nanmin(drawn) >= np.nanmin(samples)
        assert np.nanmax(drawn) <= np.nanmax(samples)


def test_a_spike_of_one_sample_is_seen_among_ten_million():
    values = np.zeros(10_000_000, dtype=np.float32)
    values[7_654_321] = 5.0
    when, (drawn,) = pyramid.part(np.arange(len(values)) * 1e-3, [Pyramid.of(values)], 0.0, 1e4, 800)
    assert len(when) <= 1700
    assert drawn.max() == 5.0


@given(exponent=st.integers(2, 9), count=st.integers(3, 60), lost=st.sampled_from([0.0, 0.3, 0.9, 0.999]))
def test_groups_of_samples_merged_when_drawn_are_those_of_the_levels(exponent, count, lost):
    group, rng = 2**exponent, np.random.default_rng(count)
    samples = rng.normal(size=group * count - int(rng.integers(0, group))).astype(np.float32)
    samples[rng.random(len(samples)) < lost] = np.nan
    low_high = Pyramid.of(samples).extremes(group, 0, count)
    parts = [samples[k * group : (k + 1) * group] for k in range(count)]
    expected = [pick.reduce(part) for part in parts for pick in (np.fmin, np.fmax)]  # NaN where the whole group is
    np.testing.assert_array_equal(low_high, expected)


@given(points=st.integers(4, 400), begin=st.integers(300, 500), lost=st.integers(60, 200))
def test_no_line_is_drawn_across_a_gap_at_any_level_of_detail(points, begin, lost):
    time_s = np.delete(np.arange(1000) * STEP_S, slice(begin, begin + lost))
    gap = pyramid.gaps(time_s)
    np.testing.assert_allclose(gap, [[(begin - 1) * STEP_S, (begin + lost) * STEP_S]])
    found = pyramid.part(time_s, [Pyramid.of(np.ones(len(time_s)))], 0.0, 5.0, points)
    when, (drawn,) = pyramid.parted(*found, gap)
    assert (np.diff(when) >= 0.0).all()
    assert np.isnan(drawn).sum() == 1
    assert gap[0, 0] < when[np.isnan(drawn)][0] < gap[0, 1]


def test_a_slow_column_of_a_fast_log_is_a_line_but_not_across_a_gap_of_its_own():
    time_s = np.arange(1000) * STEP_S
    values = np.full(1000, np.nan)
    values[::5] = time_s[::5]
    values[400:600] = np.nan
    drawn = pyramid.bridged(time_s, values)
    np.testing.assert_allclose(drawn[:396], time_s[:396], rtol=1e-6)
    assert np.isnan(drawn[396:600]).all()
    assert np.isfinite(drawn[600:996]).all()


def flown(rows: int = 4000, *, position_jump: bool = False) -> FlightLog:
    """A flight of a circle with the set-point half a metre aside, on the ground before and after."""
    time_s = 100.0 + STEP_S * np.arange(rows)
    phase = 2.0 * np.pi * np.arange(rows) / 2000.0
    place = np.stack([2.0 * np.cos(phase), 2.0 * np.sin(phase), np.full(rows, 1.5)], axis=1)
    if position_jump:
        place[2000, 0] += 1.0
    state = np.full(rows, float(State.TRAJECTORY))
    state[:400], state[-200:] = State.HOLD, State.HOLD
    still = np.tile([1.0, 0.0, 0.0, 0.0], (rows, 1))
    vectors = {
        "position_world_m": place,
        "velocity_world_m_s": np.gradient(place, STEP_S, axis=0),
        "q_world_body": still,
        "setpoint_position_world_m": place + np.array([0.3, 0.4, 0.0]),
        "setpoint_q_world_body": still,
    }
    return flight_log.from_vectors(
        time_s, vectors, scalars={"mission_state": state}, metadata={"trajectory": "<b>circle</b>"}
    )


@pytest.fixture
def opened(tmp_path: Path) -> project.Project:
    made = project.create(tmp_path / "project", "flights")
    vehicle.save(made.vehicle, vehicle.example())
    made.flight("x").parent.mkdir()
    return made


@pytest.fixture
def listing(opened: project.Project) -> Iterator[tuple[Flights, list[flights_messages.Flights]]]:
    told: list[flights_messages.Flights] = []
    made = Flights(opened, told.append)
    yield made, told
    made.close()


def ready(told: list[flights_messages.Flights]) -> Callable[[], bool]:
    return lambda: bool(told) and all(card.state != "reading" for card in told[-1].flights)


def test_the_list_says_of_each_flight_what_the_verbs_say(opened, listing):
    made, told = listing
    flight_log.save(opened.flight("circle"), flown())
    flight_log.save(opened.flight("jump"), flown(position_jump=True))
    opened.flight("cut off").write_bytes(opened.flight("circle").read_bytes()[:5000])
    made.refresh()
    assert {card.state for card in told[0].flights} == {"reading"}
    until(ready(told), "the cards")
    cards = {card.name: card for card in told[-1].flights}
    assert cards["cut off"].state == "unreadable"
    assert "cut off" in cards["cut off"].sentence
    assert cards["circle"].tracking_mean_m == pytest.approx(0.5)
    assert cards["circle"].trajectory == "<b>circle</b>"
    assert len(cards["circle"].path_m) == 2 * reading.PATH_POINTS
    checked = sysid.check_log(reading.load(opened, "jump"), vehicle.load(opened.vehicle))
    assert cards["jump"].findings == reading.findings(checked)
    assert any("jumps" in finding.sentence and finding.fixable for finding in cards["jump"].findings)
    assert cards["jump"].inconclusive == list(checked.inconclusive)
    assert any("no rotor speed" in sentence for sentence in checked.notes)
    assert cards["jump"].notes == list(checked.notes)


def test_a_set_point_that_is_missing_for_a_while_leaves_the_tracking_error_of_the_rest(opened):
    log = flown()
    aside = log.columns["setpoint_position_world_x_m"].copy()
    aside[1000:1500] = np.nan
    flight_log.save(opened.flight("circle"), FlightLog({**log.columns, "setpoint_position_world_x_m": aside}, {}))
    flight_log.save(
        opened.flight("none"),
        FlightLog({**log.columns, "setpoint_position_world_x_m": np.full(len(log), np.nan)}, {}),
    )
    assert reading.card(opened, "circle", None).tracking_mean_m == pytest.approx(0.5)
    assert reading.card(opened, "none", None).tracking_mean_m is None


def test_a_pose_that_is_missing_for_a_while_is_a_gap_as_a_fit_takes_it(opened):
    truth = vehicle.example()
    flown_truly = flights.fly_trajectory(truth, manoeuvres.scaled(manoeuvres.make("doublets"), 0.5))
    log = flights.measure(flown_truly, rng=np.random.default_rng(1))
    lost = (log.time_s > 3.0) & (log.time_s < 3.1)
    pose = [*COLUMNS["position_world_m"], *COLUMNS["q_world_body"]]
    holed = FlightLog(log.columns | {name: np.where(lost, np.nan, log.columns[name]) for name in pose}, log.metadata)
    for name, saved in (("whole", log), ("holed", holed)):
        flight_log.save(opened.flight(name), saved)
    gaps = {
        name: [finding for finding in reading.card(opened, name, None).findings if finding.what == "gap"]
        for name in ("whole", "holed")
    }
    assert gaps["whole"] == []
    ((begin_s, end_s),) = gaps["holed"][0].spans_s
    assert begin_s == pytest.approx(3.0, abs=0.02)
    assert end_s == pytest.approx(3.1, abs=0.02)
    assert gaps["holed"][0].sentence.startswith("no pose from")
    with pytest.raises(InputError, match=re.escape(gaps["holed"][0].sentence)):
        sysid.compare([holed], {"v": truth})


def test_cards_are_kept_and_made_again_when_the_log_changes(opened, listing):
    made, told = listing
    flight_log.save(opened.flight("circle"), flown())
    made.refresh()
    until(ready(told), "the card")
    again: list[flights_messages.Flights] = []
    other = Flights(opened, again.append)
    other.refresh()
    assert again[0].flights == told[-1].flights
    flight_log.save(opened.flight("circle"), flown(5000))
    assert other.listed()[0].state == "reading"
    other.close()


def test_what_a_flight_is_for_outlives_the_station(opened, listing):
    made, _ = listing
    for name in ("a", "b"):
        flight_log.save(opened.flight(name), flown())
    made.set_role("b", "hold_out")
    assert (made.names("learn"), made.names("hold_out")) == (["a"], ["b"])
    other = Flights(opened, lambda _: None)
    assert (other.names("learn"), other.names("hold_out")) == (["a"], ["b"])
    with pytest.raises(InputError, match="no flight c"):
        made.set_role("c", "learn")


def test_a_name_that_the_disk_refuses_is_said_and_leaves_the_flight_as_it_was(opened, listing, monkeypatch):
    made, _ = listing
    flight_log.save(opened.flight("a"), flown())
    made.set_role("a", "hold_out")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "hardlink_to", full)
    with pytest.raises(InputError, match="a was not renamed"):
        made.rename("a", "b")
    assert [(card.name, card.role) for card in made.listed()] == [("a", "hold_out")]


def test_a_name_and_a_note_are_kept_in_the_project_and_a_taken_name_is_refused(opened, listing):
    made, _ = listing
    for name in ("a", "b"):
        flight_log.save(opened.flight(name), flown())
    made.set_role("a", "hold_out")
    made.set_note("a", "gusts <b>from</b> the door")
    for wrong in ("b", "", "../c"):
        with pytest.raises(InputError):
            made.rename("a", wrong)
    assert made.rename("a", " windy ") == "windy"
    made.set_note("b", "")
    again = {card.name: card for card in Flights(opened, lambda _: None).listed()}
    assert (again["windy"].note, again["windy"].role) == ("gusts <b>from</b> the door", "hold_out")
    assert again.keys() == {"windy", "b"}
    assert again["b"].note == ""
    flight_log.load(opened.flight("windy"))


def test_fixes_go_into_a_new_log_as_the_verb_makes_it_and_can_be_taken_back(opened, listing, tmp_path):
    made, _ = listing
    flight_log.save(opened.flight("jump"), flown(position_jump=True))
    before = opened.flight("jump").read_bytes()
    name, done = made.fix("jump")
    believed = vehicle.load(opened.vehicle)
    log = sysid.read_log(opened.flight("jump"))
    said = log_outputs.write_fixed(
        log, opened.flight("jump"), tmp_path / "verb.parquet", believed, overwrite=False
    ).done
    corrected, ours = flight_log.load(tmp_path / "verb.parquet"), flight_log.load(opened.flight(name))
    assert done == said
    assert ours.metadata[fix.FIXES] == list(done)
    for column, values in corrected.columns.items():
        np.testing.assert_array_equal(ours.columns[column], values)
    assert opened.flight("jump").read_bytes() == before
    with pytest.raises(InputError, match="exists"):
        made.fix("jump")
    kept = made.discard(name)
    assert not opened.flight(name).exists()
    assert made.restore(kept) == name
    assert opened.flight(name).exists()
    for wrong in ("../project.toml", "jump.parquet.old-9", kept):
        with pytest.raises(InputError, match="not kept here"):
            made.restore(wrong)


def test_a_fixed_flight_takes_the_place_of_what_it_was_fixed_from_and_gives_it_back(opened, listing):
    made, _ = listing
    flight_log.save(opened.flight("jump"), flown(position_jump=True))
    made.set_role("jump", "hold_out")
    for _ in range(2):
        fixed, _ = made.fix("jump")
        assert (made.names("hold_out"), made.names("learn"), made.names("leave")) == ([fixed], [], ["jump"])
        kept = made.discard(fixed)
        assert made.names("hold_out") == ["jump"]
    made.restore(kept)
    assert (made.names("hold_out"), made.names("leave")) == ([fixed], ["jump"])


def test_a_log_that_goes_while_cards_are_made_stops_no_other(opened):
    flight_log.save(opened.flight("b"), flown())
    reading.write_cards(opened.folder, ["gone", "b"], silent)
    believed = vehicle.vehicle_hash(vehicle.load(opened.vehicle))
    assert reading.kept_card(opened, "b", reading.signature(opened, "b", believed)) is not None


def test_a_card_of_an_earlier_version_is_made_again(opened, monkeypatch):
    flight_log.save(opened.flight("b"), flown())
    wanted = reading.signature(opened, "b", vehicle.vehicle_hash(vehicle.load(opened.vehicle)))
    with monkeypatch.context() as earlier:
        earlier.setattr(reading, "version", lambda _: "0.0.1")
        reading.write_cards(opened.folder, ["b"], silent)
        assert reading.kept_card(opened, "b", wanted) is not None
    assert reading.kept_card(opened, "b", wanted) is None


def test_a_log_that_went_while_cards_were_made_blames_no_other(opened, listing):
    made, told = listing
    flight_log.save(opened.flight("b"), flown())
    opened.vehicle.unlink()
    made._read(["gone", "b"])
    until(ready(told), "the card")
    assert [card.state for card in told[-1].flights] == ["ready"]


def test_a_log_without_a_fixable_finding_is_not_fixed(opened, listing):
    log = flown()
    plain = {name: values for name, values in log.columns.items() if name.startswith(("time", "position"))}
    flight_log.save(opened.flight("circle"), FlightLog(plain, {}))
    with pytest.raises(InputError, match="no finding proposes a change"):
        listing[0].fix("circle")
    with pytest.raises(InputError, match="the checks no longer find this: the rotors sing"):
        listing[0].fix("circle", "the rotors sing")


def test_a_foreign_csv_asks_for_its_columns_and_is_then_a_flight(opened, listing):
    made, _ = listing
    file = incoming.place(opened, "pond.csv")
    file.parent.mkdir(parents=True)
    rows = ["t;pos_x;pos_y;pos_z;vx;vy;vz"]
    rows += [f"{0.01 * k:.3f};{np.sin(0.01 * k):.5f};{np.cos(0.01 * k):.5f};1.0;0.1;0.2;0" for k in range(400)]
    file.write_text("\n".join(rows))
    asked = made.take("pond.csv")
    assert isinstance(asked, Incoming)
    assert "position_world_m" in {guess.name for guess in asked.guesses}
    with pytest.raises(FlightError):
        made.take_with_map("pond.csv", "no = [toml")
    assert made.take_with_map("pond.csv", asked.column_map) == "pond"
    log = flight_log.load(opened.flight("pond"))
    assert len(log) == 400
    assert log.metadata["imported_from"] == "pond.csv"
    assert list(file.parent.iterdir()) == []


@pytest.mark.parametrize("name", ["../a.csv", "a.exe", ".csv", "a/b.csv", "<img>.csv"])
def test_a_dropped_file_cannot_lead_out_of_its_folder(listing, name):
    with pytest.raises(InputError, match=r"cannot be a name|no flight log"):
        listing[0].take(name)


# --- streams ---


@pytest.fixture
def recorded(opened: project.Project) -> Recorded:
    flight_log.save(opened.flight("circle"), flown())
    return Recorded(opened)


def test_a_flights_time_begins_with_its_trajectory(recorded):
    found = recorded.open("circle")
    assert found.start_s == pytest.approx(-400 * STEP_S)
    assert found.shift_s == pytest.approx(102.0)
    assert {stream.key for stream in found.streams} >= {"speed", "error", "tilt", "column:position_world_x_m"}


def test_streams_are_the_quantities_of_the_log(recorded):
    found = recorded.open("circle")
    error, tilt, x = recorded.read("circle", ["error", "tilt", "position_x"], found.start_s, found.end_s, MOST_POINTS)
    np.testing.assert_allclose(error.curves[0].values, 500.0, rtol=1e-5)
    np.testing.assert_allclose(tilt.curves[1].values, 0.0, atol=1e-3)
    assert [curve.kind for curve in x.curves] == ["plan", "measured"]
    np.testing.assert_allclose(np.subtract(x.curves[0].values, x.curves[1].values), 0.3, atol=1e-6)


def test_a_stretch_is_answered_at_the_detail_that_is_asked_for(recorded):
    (coarse,) = recorded.read("circle", ["speed"], -2.0, 18.0, 50)
    (fine,) = recorded.read("circle", ["speed"], 1.0, 1.1, 50)
    assert len(coarse.time_s) <= 110
    assert len(fine.time_s) == pytest.approx(0.1 / STEP_S, abs=3)


@pytest.mark.parametrize(
    ("flight", "stream", "span", "said"),
    [
        ("none", "speed", (0.0, 1.0), "no flight none"),
        ("circle", "taste", (0.0, 1.0), "no stream taste"),
        ("circle", "speed", (1.0, 1.0), "no length"),
        ("circle", "speed", (0.0, np.nan), "no length"),
    ],
)
def test_what_is_not_there_is_refused(recorded, flight, stream, span, said):
    with pytest.raises(InputError, match=said):
        recorded.read(flight, [stream], *span, 100)


def test_open_flights_are_forgotten_before_they_fill_the_memory(opened, monkeypatch):
    monkeypatch.setattr("gcs_web.flights.recorded.MOST_BYTES", 200_000)
    for name in "abcd":
        flight_log.save(opened.flight(name), flown())
    recorded = Recorded(opened)
    for name in "abcd" * 2:
        recorded.read(name, ["speed", "error"], 0.0, 10.0, 100)
        assert recorded.nbytes < 300_000


def test_paths_follow_the_log_and_skip_what_was_not_measured(opened):
    log = flown()
    columns = {name: values.copy() for name, values in log.columns.items()}
    columns["position_world_x_m"][::2] = np.nan
    flight_log.save(opened.flight("holes"), FlightLog(columns, log.metadata))
    path = Recorded(opened).path("holes")
    assert np.isfinite(path.position_world_m).all()
    np.testing.assert_allclose(np.linalg.norm(path.position_world_m[:, :2], axis=1), 2.0, atol=1e-9)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, ""),
        ({"vehicle": "Kestrel"}, "flown by Kestrel"),
        ({"vehicle_hash": "of the file"}, "its plan was checked with version 0"),
        ({"vehicle_hash": "0" * 16, "vehicle": "Kestrel"}, "its plan was checked with another vehicle file"),
    ],
)
def test_a_card_does_not_take_the_plans_vehicle_for_the_controllers(opened, said, words):
    log, believed = flown(), vehicle.load(opened.vehicle)
    if said.get("vehicle_hash") == "of the file":
        said = {"vehicle_hash": vehicle.vehicle_hash(believed)[:16]}
    kept = {key: value for key, value in log.metadata.items() if key not in ("vehicle", "vehicle_hash")}
    flight_log.save(opened.flight("b"), FlightLog(log.columns, {**kept, **said}))
    assert reading.card(opened, "b", believed).vehicle_said == words
