"""Compare and Learn in a real browser: flights opened side by side, the residual looked at, a link that restores it."""

import re
import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest

import mapping
import sysid
import vehicle
from flight import FlightLog, Waypoints, file_format, flight_log, project, silent
from gcs_web import GroundStation
from gcs_web.learning import diagnosis_values, learning, proposed
from gcs_web.protocol.comparison import VariableName
from gcs_web.protocol.learning import Candidate, Confounded, Diagnosis, EffectSize, Evidence
from gcs_web.protocol.next_flight import NextFlight, Section
from goshawk.station_jobs import KINDS, compare
from goshawk.station_jobs.flights import Chosen
from sysid.diagnosis import OutsideFinding
from sysid.diagnosis.envelope import Envelope
from sysid.estimator.validation import changes
from sysid.estimator.validation.comparison import HORIZONS_S
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, SERIOUS, SIZE, drawn, with_plain_light, without_view
from tests.gcs_web.two_pillars import START
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait
from vehicle import flights, manoeuvres

DRAG = "rotor_drag_thrust"
MARKUP = "<img src=x onerror=alert(1)>"
HOSTILE = f"{MARKUP}\n\u202edesrever\u2066 {'wide' * 500}"
"""Markup, a line's end, text from right to left that is never ended, and a word wider than any screen."""
BOB = [(1.25, 1.0), (1.25, -1.0)] * 2

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory) -> Iterator[GroundStation]:
    """Two flights of a vehicle with rotor drag, compared with a model without; the second is held out."""
    opened = project.create(tmp_path_factory.mktemp("station") / "project", "flights")
    shutil.copytree(pillar_map, opened.map)
    truth, rng = vehicle.example(), np.random.default_rng(5)
    vehicle.save(opened.vehicle, truth.without_effect("rotor_drag_thrust"))
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(3, np.nan)))
    opened.flight("a").parent.mkdir()
    for name, size in (("a", 9.0), ("b", -7.0)):
        weave = manoeuvres.from_legs(x=[(2.5, size), (2.5, -size)], y=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], z=BOB)
        log = flights.measure(flights.fly_trajectory(truth, weave), rng=rng)
        flight_log.save(opened.flight(name), FlightLog(log.columns, {**log.metadata, "trajectory": HOSTILE}))
    compare._run(opened.folder, Chosen(["a"], ["b"]), silent)
    learning.own_effects(opened.folder).mkdir()
    (learning.own_effects(opened.folder) / f"{HOSTILE[:200]}.py").write_text("no effect")
    with GroundStation(opened.folder, triangles=500, jobs=KINDS) as running:
        running.desk.flights.set_role("b", "hold_out")
        yield running


@pytest.fixture(scope="module")
def page(station: GroundStation):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        context = without_view(browser.new_context(viewport=SIZE, reduced_motion="reduce"))
        context.set_default_timeout(1000 * PATIENCE_S)
        opened = context.new_page()
        errors: list[str] = []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        opened.goto(station.url)
        opened.get_by_text("Saved, revision").wait_for()
        opened.keyboard.press("4")
        opened.get_by_role("button", name=re.compile("^a"), pressed=True).or_(
            opened.get_by_role("button", name=re.compile("^b"), pressed=True)
        ).wait_for()
        opened.get_by_text(MARKUP).nth(1).wait_for()  # the first flight that was read is open before the other is
        yield opened
        assert errors == []
        browser.close()


def test_flights_stand_side_by_side_and_foreign_text_is_text(page, station):
    assert page.get_by_text(MARKUP).count() == 2
    assert page.locator("img").count() == 0
    assert overflow(page) == []
    page.get_by_role("button", name=re.compile("beside")).click()
    page.locator(".flight-tag").nth(1).wait_for()
    page.get_by_label("Add or remove a stream").select_option("rotor_0")
    page.get_by_role("img", name="Rotor 0 over time").wait_for()
    wait(lambda: len(station.view.flights._paths) == 2, "both flights in 3D")


def test_the_3d_view_takes_the_flights_without_an_error(page, station, request):
    with_plain_light(station)
    context = page.context.browser.new_context(viewport=SIZE, reduced_motion="reduce")
    request.addfinalizer(context.close)
    context.set_default_timeout(1000 * PATIENCE_S)
    other, errors = context.new_page(), []
    other.on("pageerror", lambda error: errors.append(str(error)))
    wait(
        lambda: "%7C" in page.evaluate("location.hash").partition("flights=")[2].partition("&")[0],
        "both in the address",
    )
    other.goto(f"{station.url}{page.evaluate('location.hash')}")
    wait(lambda: len(station.server.get_clients()) == 1, "the 3D view")
    other.frame_locator("iframe").locator("canvas").first.wait_for()
    drawn(other)
    wait(lambda: len(station.view.flights._paths) == 2, "both flights in 3D")
    assert errors == []


def test_columns_of_a_foreign_log_are_shown_as_text(page):
    heads = ["t", "pos_x", "pos_y", "pos_z", HOSTILE.replace("\n", " ")]
    rows = [heads, *([f"{0.01 * k:.2f}", "0.1", "0.2", "1.0", "5"] for k in range(400))]
    text = "\n".join(";".join(row) for row in rows).encode()
    page.get_by_label("Import log").set_input_files({"name": "pond.csv", "mimeType": "text/csv", "buffer": text})
    form = page.locator("form").filter(has=page.get_by_role("heading", name="Columns of pond.csv"))
    form.get_by_text("Not used").wait_for()
    assert MARKUP in form.inner_text()
    assert page.locator("img").count() == 0
    assert overflow(page) == []
    form.get_by_role("button", name="Cancel").click()


def test_flights_are_aligned_by_each_way_and_doubt_leaves_them(page, station):
    said = page.locator(".notice")
    ways = page.get_by_role("group", name="Align with the first flight by")
    ways.get_by_role("button", name="Take-off").click()
    said.get_by_text(re.compile("B moved by .* s: take-off")).wait_for()
    shift = page.get_by_label(re.compile("^Shift of . in seconds"))
    shift.fill("2.5")
    shift.blur()
    wait(lambda: "moved=0%7C2.5" in page.evaluate("location.hash"), "the shift by hand in the address")
    wait(lambda: list(station.view.flights._moved_s.values()) == [2.5], "the shift in 3D")
    ways.get_by_role("button", name="Speed").click()
    said.get_by_text(re.compile("B stays: cannot tell: speed of . was not measured")).wait_for()
    assert shift.input_value() == "2.5"
    shift.fill("0")
    shift.blur()


def test_residuals_stand_as_arrows_at_the_vehicles_until_they_are_switched_off(page, station):
    page.get_by_text(re.compile(r"Force, 1 m = (0\.0*)?[125]")).wait_for()
    page.get_by_role("img", name="Rotor 0 over time").click(position={"x": 300, "y": 40})
    wait(lambda: any(node.visible for node in station.view.flights._arrows.values()), "an arrow")
    page.get_by_label("Residual as arrows").uncheck()
    wait(lambda: not station.view.flights._arrows, "no arrows")
    wait(lambda: "arrows=no" in page.evaluate("location.hash"), "the choice in the address")
    page.get_by_label("Residual as arrows").check()
    page.get_by_text(re.compile("Torque, 1 m =")).wait_for()


def test_the_vehicle_stands_there_as_the_model_predicts_it_until_it_is_switched_off(page, station):
    switch = page.get_by_label("predicted (A)")
    page.get_by_role("img", name="Rotor 0 over time").click(position={"x": 300, "y": 40})
    wait(lambda: station.view.flights._predicted.visible, "the predicted vehicle")
    off_m = np.subtract(station.view.flights._predicted.position, station.view.flights._vehicles[0].position)
    assert 0.0 < np.linalg.norm(off_m) < 1.0
    switch.focus()
    page.keyboard.press("Space")
    wait(lambda: not station.view.flights._predicted.visible, "no predicted vehicle")
    wait(lambda: "predicted=no" in page.evaluate("location.hash"), "the choice in the address")
    page.reload()
    switch.wait_for()
    assert not switch.is_checked()
    switch.check()
    wait(lambda: station.view.flights._predicted.visible, "the predicted vehicle again")


def test_the_vehicle_is_predicted_over_the_horizon_that_is_chosen_and_a_link_restores_it(page, station):
    chosen = page.get_by_label("How long before the prediction begins")
    assert chosen.get_by_role("option").all_inner_texts() == [
        f"from {horizon_s:g} s before" for horizon_s in HORIZONS_S
    ]
    first = page.evaluate("new URLSearchParams(location.hash.slice(1)).get('flights').split('|')[0]")
    for horizon_s in HORIZONS_S:
        chosen.select_option(f"from {horizon_s:g} s before")
        residual = station.desk.comparing._residual(first)
        off = np.array(residual.predicted[HORIZONS_S.index(horizon_s)].deviation).T
        wait(lambda off=off: np.array_equal(drawn_deviation(station), off), f"predictions over {horizon_s} s")
    wait(lambda: f"predicted={HORIZONS_S[-1]:g}" in page.evaluate("location.hash"), "the choice in the address")
    page.reload()
    wait(lambda: chosen.input_value() == f"{HORIZONS_S[-1]:g}", "the same choice")
    chosen.select_option("from 0.5 s before")


def drawn_deviation(station: GroundStation) -> np.ndarray:
    """(k, 6) by which the one predicted vehicle is off, without the gaps."""
    (shown,) = station.view.flights._deviations.values()
    return shown.pose[np.isfinite(shown.pose).all(axis=1)]


def test_a_cell_is_looked_at_everywhere_and_a_bin_shows_its_moments(page, station):
    page.get_by_role("button", name=re.compile("^F_x against v_x")).click()
    page.get_by_role("heading", name=re.compile("Residual F.* against v")).wait_for()
    page.get_by_role("img", name="Residual x over time").wait_for()
    assert page.get_by_label("Colour of the flights' paths").input_value() == "F_x"
    low, high = (page.locator(".legend-ends span").get_by_text(re.compile(f"^{end} ")) for end in "≤≥")
    assert low.inner_text().replace("≤ −", "≥ ") + " N" == high.inner_text()
    page.get_by_role("img", name=re.compile("Residual F_x in N")).click(position={"x": 120, "y": 80})
    page.get_by_text(re.compile("of the open flights, shaded")).wait_for()
    wait(lambda: station.view.flights._marks, "the moments on the paths")
    page.get_by_role("button", name="Clear").click()
    wait(lambda: not station.view.flights._marks, "the paths without them")


def test_another_persons_steps_take_nothing_out_of_the_3d_view(page, station, request):
    view = station.view
    ours = list(view.flights._paths)
    wait(lambda: view._set_aside, "no plan while everybody compares")
    other = without_view(page.context.browser.new_context(viewport=SIZE)).new_page()
    request.addfinalizer(other.context.close)
    other.set_default_timeout(1000 * PATIENCE_S)
    other.goto(station.url)
    other.get_by_text(re.compile("looks at flights? .* here")).wait_for()
    page.get_by_text("The plan stands here too: not everybody is on Compare.").wait_for()
    assert not view._set_aside
    assert list(view.flights._paths) == ours

    other.keyboard.press("4")
    wait(lambda: view._set_aside, "no plan again")
    page.get_by_text(re.compile("looks at flight [^,]+ here")).wait_for()
    wait(lambda: len(view.flights._paths) == 1, "the other's flight")
    page.get_by_role("button", name="Show mine instead").click()
    wait(lambda: list(view.flights._paths) == ours, "ours")
    other.get_by_role("button", name="Show mine instead").click()
    wait(lambda: len(view.flights._paths) == 1, "the other's flight")
    other.keyboard.press("2")
    wait(lambda: list(view.flights._paths) == ours, "ours, when the other looks elsewhere")
    wait(lambda: any(vehicle.visible for vehicle in view.flights._vehicles), "the vehicles at our moment")
    page.keyboard.press("2")
    wait(lambda: not view.flights._paths, "no flights when nobody looks at them")
    assert not view._set_aside

    other.keyboard.press("4")
    wait(lambda: len(view.flights._paths) == 1, "the other's flight")
    assert not view._set_aside  # we are on Plan
    other.context.close()
    wait(lambda: not view.flights._paths, "no flights of somebody who left")
    page.keyboard.press("4")
    wait(lambda: list(view.flights._paths) == ours, "ours")


def test_a_drag_zooms_and_a_link_restores_the_view(page):
    box = page.get_by_role("img", name="Speed over time").or_(page.get_by_role("img", name="Rotor 0 over time")).first
    area = box.bounding_box()
    page.mouse.move(area["x"] + 300, area["y"] + 20)
    page.mouse.down()
    page.mouse.move(area["x"] + 420, area["y"] + 20, steps=4)
    page.mouse.up()
    page.get_by_role("button", name="All of it").wait_for()
    wait(lambda: "from_to=" in page.evaluate("location.hash"), "the view in the address")
    address = page.evaluate("location.href")
    page.reload()
    page.get_by_role("button", name="All of it").wait_for()
    page.locator(".flight-tag").nth(1).wait_for()
    wait(lambda: page.evaluate("location.href") == address, "the same view")


def test_learn_says_what_is_missing_before_any_diagnosis(page):
    page.keyboard.press("5")
    page.get_by_role("heading", name="Which effect does the model lack?").wait_for()
    assert page.get_by_role("button", name="Find the missing effect").is_enabled()
    assert page.get_by_role("heading", name="Parameters").is_visible()
    page.keyboard.press("2")
    page.get_by_role("grid", name="Waypoints").wait_for()


FLOWN = Envelope(level_speed_m_s=3.0, climb_m_s=1.0, sink_m_s=1.0, rate_rad_s=4.0).sentence


def diagnosed() -> Diagnosis:
    """Drag is missing, and beside it something of one rotor's thrust that no known effect is."""
    at = [0.1 * k for k in range(20)]
    v_x = VariableName("v_x", "m/s", "velocity along x")
    size = EffectSize("rotor drag", "N s/m", 0.02, 0.001, 0.018, 0.022, 0.022, 0.002, 0.02)
    evidence = Evidence("F_x", "N", v_x, at, at, at, at, at, at, at)
    confounded = [Confounded("drag_linear", "linear drag", 0.4)]
    found = Candidate(
        DRAG, HOSTILE, "present", "follows the velocity", 0.9, "F = -c v", [size], 4.0, confounded, "", evidence
    )
    others = [
        msgspec.structs.replace(found, name=name, title=name, verdict=verdict, outlook="a dive would show it")
        for name, verdict in (("ground_effect", "inconclusive"), ("weak_rotor", "excluded"))
    ]
    x = np.array(at)
    outside = OutsideFinding("T_2", "n_2", "rad/s", x, -0.1 * x, np.full(20, 0.01), 1.0, 9.0, 0.0, 0.8)
    return Diagnosis(
        "current", "Rotor drag is missing.", 0.8, "Probability 80% that this is right.", FLOWN, "usable", ["a"],
        ["b"], [found, *others],
        outside=diagnosis_values._outside(outside), unobservable=["mass: only ratios to it show"], left=["F_x 0.01 N"],
        findings=["the rotors turn too little"],
    )  # fmt: skip


def test_a_curve_of_rotor_thrust_is_shown_with_its_words_and_unit(page, station):
    save_diagnosis(station)
    page.keyboard.press("5")
    card = page.get_by_role("region", name="No known effect")
    card.get_by_text("the thrust of rotor 2 follows speed of rotor 2, from −19.0 to 0 % of the thrust").wait_for()
    head = page.get_by_text(FLOWN.partition(". ")[0])
    assert head.is_visible()
    head.get_by_role("button", name="More").click()
    assert page.get_by_text(FLOWN).is_visible()
    assert page.get_by_text(MARKUP).first.is_visible()
    assert page.get_by_role("region", name="Effects of your own").get_by_text(MARKUP).is_visible()
    assert page.get_by_role("region", name="Findings").get_by_text("The rotors turn too little").is_visible()
    assert page.get_by_text("Size ± σ: rotor drag").first.is_visible()
    assert page.get_by_text("0.0200 ± 0.0010").first.is_visible()
    assert page.locator("img").count() == 0
    assert overflow(page) == []


def overflow(page) -> list[str]:
    """Classes of what reaches beyond the screen, of columns that must be scrolled sideways, of words cut off."""
    return page.evaluate(
        """() => [...document.querySelectorAll("aside, .list-area, header, footer, .card, .flight, .legend span, "
                + ".learn .block-head > *, .heat-map th, .parameters td")]
            .filter(e => e.getBoundingClientRect().right > innerWidth + 1 || e.scrollWidth > e.clientWidth + 1)
            .map(e => e.className)"""
    )


PROPOSED = NextFlight(
    "current", name="next-flight", manoeuvre="oblique", candidates=[HOSTILE, "payload"], size=0.6, heading_rad=0.5,
    duration_s=7.7, top_speed_m_s=3.6, clearance_m=0.6, required_clearance_m=0.5, known_log_odds=1.2,
    expected_log_odds=11.5, needed_log_odds=2.9, path_m=[1.0, 1.0, 1.0, 2.0, 1.5, 1.2],
    section=Section((0.0, 0.0), 1.1, 0.5, ["########", "#......#", "#..#...#", "########"]),
)  # fmt: skip


def test_the_next_flight_is_shown_in_its_map_and_a_refusal_is_an_answer(page, station):
    save_diagnosis(station)
    page.keyboard.press("5")
    card = page.get_by_role("region", name="Next flight")
    card.get_by_role("img", name="Oblique from above, in a map of 4.0 by 2.0 m").wait_for()
    card.get_by_text("1.2 → 12.7").wait_for()
    card.get_by_text("The vehicle, a flight or the map changed since. Propose again.").wait_for()  # of no real hashes
    assert overflow(page) == []
    refusal = "not in this map: oblique needs 8.0 x 8.0 x 6.0 m of free space to answer payload"
    proposed.save(station.desk.project.folder, NextFlight("current", refusal=refusal))
    station.desk.show_learning()
    card.get_by_text("No flight in this map answers what is open.").wait_for()
    card.get_by_text("Not in this map: oblique needs 8.0 x 8.0 x 6.0 m of free space to answer payload.").wait_for()
    assert card.get_by_role("img").count() == 0
    assert card.get_by_role("button", name="Propose next flight").is_enabled()


def test_the_consent_to_a_doubtful_map_is_to_that_map_alone(page, station, monkeypatch):
    save_diagnosis(station)
    page.keyboard.press("5")
    card = page.get_by_role("region", name="Next flight")
    propose, consent = card.get_by_role("button", name="Propose next flight"), card.get_by_role("checkbox")
    for doubt, map_hash in (("the walk is short", "a"), ("the walk is short", "b"), ("the lens is bent", "b")):
        monkeypatch.setattr("gcs_web.planning.inputs.doubt", lambda _, doubt=doubt: doubt)
        monkeypatch.setattr(mapping.Map, "hash", map_hash)
        station.desk.map.changed()
        card.get_by_text(doubt).wait_for()
        wait(propose.is_disabled, "another map, to which nobody agreed")
        assert not consent.is_checked()
        consent.check()
        assert propose.is_enabled()
    monkeypatch.undo()
    station.desk.map.changed()
    consent.wait_for(state="detached")
    assert propose.is_enabled()


@pytest.mark.parametrize("width", [1440, 900, 360])
def test_words_of_compare_and_learn_are_whole_at_each_width(page, station, width):
    save_diagnosis(station)
    page.set_viewport_size({"width": width, "height": 844})
    for step in "45":
        page.keyboard.press(step)
        drawn(page)
        assert overflow(page) == [], f"step {step}"
    effects = page.get_by_text(re.compile("Effects: ")).inner_text()
    assert "centre of mass" in effects
    assert "_" not in effects
    page.set_viewport_size(SIZE)


def test_two_people_see_one_diagnosis_and_one_keeps_it_for_both(page, station):
    save_diagnosis(station)
    before = station.desk.project.vehicle.read_bytes()
    other = without_view(page.context.browser.new_context(viewport=SIZE)).new_page()
    other.set_default_timeout(1000 * PATIENCE_S)
    other.goto(station.url)
    for each in (page, other):
        each.keyboard.press("5")
        each.get_by_role("heading", name="Rotor drag is missing.").wait_for()
        each.get_by_role("button", name="Keep as version 1").wait_for()
    other.get_by_role("button", name="Keep as version 1").click()
    for each in (page, other):
        each.get_by_role("button", name="Keep as version 1").wait_for(state="detached")
        each.get_by_text("The vehicle, a flight or the choice of flights changed since. Diagnose again.").wait_for()
        each.get_by_text("rotor drag with thrust, drag").first.wait_for()
    page.get_by_role("button", name="Return").first.click()
    other.get_by_text("rotor drag with thrust, drag").first.wait_for(state="detached")
    other.context.close()
    assert station.desk.project.vehicle.read_bytes() == before


def save_diagnosis(station: GroundStation) -> None:
    folder = station.desk.project.folder
    learning.diagnosis_file(folder).write_bytes(msgspec.json.encode(diagnosed()))
    present = vehicle.load(station.desk.project.vehicle)
    changed = present.with_effect(DRAG, source="assumed")
    tried = diagnosis_values.tried(present, DRAG, changes.Change(changed, {}, None, (), None), [])
    file_sha256 = file_format.file_hash(station.desk.project.vehicle)
    learning.save_trial(folder, changed, learning.KeptTrial(tried, None, file_sha256))
    proposed.save(folder, PROPOSED)
    station.desk.show_learning()


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_compare_and_learn_are_no_serious_barrier(page, station, width, scheme):
    from axe_playwright_python.sync_playwright import Axe

    save_diagnosis(station)
    page.set_viewport_size({"width": width, "height": 844})
    page.evaluate(f"document.documentElement.dataset.theme = '{scheme}'")
    found: dict[str, list[str]] = {}
    page.keyboard.press("5")
    drawn(page)
    each = page.locator(".inspector").evaluate(
        "e => [...e.children].map(c => [c.className, c.getBoundingClientRect().top, c.scrollHeight])"
    )
    over = [(above, below) for above, below in pairwise(each) if above[1] + above[2] > below[1] + 1.0]
    assert over == []  # panels that lie over each other
    for step in "45":
        page.keyboard.press(step)
        drawn(page)
        for rule in Axe().run(page, context={"exclude": [["iframe"]]}).response["violations"]:  # viser's own page
            if rule["impact"] in SERIOUS:
                found[f"step {step}: {rule['id']}"] = [node["html"] for node in rule["nodes"]]
    page.set_viewport_size(SIZE)
    assert found == {}


def test_a_card_shows_what_was_not_checked_and_what_the_log_is_of_no_use_for(page, station):
    opened = station.desk.project
    whole = flight_log.load(opened.flight("a"))
    kept = {name: values for name, values in whole.columns.items() if not name.startswith("rotor_speed")}
    flight_log.save(opened.flight("no rotors"), FlightLog(kept, {}))
    checked = sysid.check_log(flight_log.load(opened.flight("no rotors")), vehicle.load(opened.vehicle))
    assert checked.inconclusive
    assert checked.notes
    station.desk.flights.refresh()
    page.keyboard.press("4")
    page.get_by_role("button", name=re.compile("^no rotors ")).click()
    sentences = [f"Not checked: {each}" for each in checked.inconclusive]
    for sentence in [*sentences, *(f"Note: {each}" for each in checked.notes)]:
        said = page.get_by_text(sentence[:40])
        said.wait_for()
        if said.get_by_role("button", name="More").count():
            said.get_by_role("button", name="More").click()
        page.get_by_text(sentence).wait_for()
    for width in (1440, 400):
        page.set_viewport_size({"width": width, "height": 844})
        drawn(page)
        assert overflow(page) == []
    page.set_viewport_size(SIZE)
    page.get_by_role("button", name="Discard").click()
    page.get_by_role("button", name=re.compile("^no rotors ")).wait_for(state="detached")
