"""Sending the controller's compensation from the page: compared with the kept model, set whole, read back."""

import contextlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

import firmware_bridge
import vehicle
from firmware_bridge import SitlVehicle, closed_loop, controller, keys, parameters
from firmware_bridge.dialect.generated.messages import Command
from flight import FloatArray, LinkError, Trajectory, Waypoints, project
from gcs_web import GroundStation
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, needs_chromium, opened
from tests.gcs_web.station_socket import Page, visit
from tests.gcs_web.two_pillars import START, add_map
from tests.waiting import PATIENCE_S, until
from vehicle import manoeuvres, simulate

DRAG = ("rotor_drag_thrust", "parasitic_drag")
GUARD = """
from vehicle.effects.base import Effect, Spec, Stage

def apply(flow, p):
    flow.force_n[1] -= p.drag_kg_m * flow.velocity_m_s[1]

EFFECT = Effect(name="compensation_guard", number=0, stage=Stage.FORCE, apply=apply,
    parameters=(Spec("drag_kg_m", "N s/m", prior=0.02, bounds=(0.0, 1.0)),),
    law="F_y = -c v_y", source="here", channel="F_y", regressor="v_y", excited_by=("fast_level",))
"""


def without_drag(model: vehicle.Vehicle) -> vehicle.Vehicle:
    for name in DRAG:
        model = model.without_effect(name)
    return model


@pytest.fixture(scope="module")
def truth() -> vehicle.Vehicle:
    return vehicle.example("rigter2019")


@pytest.fixture(scope="module")
def key_file(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("compensation key") / "link.key"


@pytest.fixture(scope="module")
def simulated(truth, key_file):
    plant = simulate.Plant(truth, simulate.State(position_world_m=np.array([0.8, 0.8, 0.0])), ground_m=0.0)
    known = controller.parameters_of(without_drag(truth)).parameters
    with SitlVehicle(plant, known, key=keys.create(key_file)) as running:
        yield running


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory, truth, simulated, key_file):
    made = project.create(tmp_path_factory.mktemp("compensation") / "project", "compensation")
    add_map(made, pillar_map)
    vehicle.save(made.vehicle, without_drag(truth))
    project.save_waypoints(made.waypoints, Waypoints(START, np.full(3, np.nan)))
    with GroundStation(made.folder, vehicle_url=simulated.url, key_file=key_file, triangles=500) as running:
        yield running


@pytest.fixture(autouse=True)
def model_as_given(station, truth):
    """Each test begins with a vehicle that flies with the kept model's parameters, drag not among them."""
    vehicle.save(station.desk.project.vehicle, without_drag(truth))
    until(lambda: station.watch.state().link == "fresh", "the vehicle")
    station.watch.set_parameters(dict(controller.parameters_of(without_drag(truth)).parameters))


def held(station: GroundStation) -> dict[str, float]:
    return station.watch.link.parameters()


def differing(reply: dict) -> dict[str, tuple[float, float]]:
    rows = reply["compensation"]["parameters"]
    return {row["name"]: (row["flies_with"], row["model"]) for row in rows if row["flies_with"] != row["model"]}


def orders(station: GroundStation) -> list[dict]:
    lines = (station.desk.project.folder / ".session" / "audit.jsonl").read_text().splitlines()
    return [line for line in map(json.loads, lines) if line["what"] == "compensation"]


def tracking_m(truth: vehicle.Vehicle, values: dict[str, float], course: Trajectory) -> float:
    """Mean error of the C controller with these parameters on a course."""
    plant = simulate.Plant(truth, simulate.State(course.position([0.0])[0] * [1.0, 1.0, 0.0]), ground_m=0.0)
    flown: FloatArray = closed_loop.fly(plant, controller.Configuration(values), course).error_m
    return float(flown.mean())


def test_the_learned_model_is_sent_whole_read_back_and_tracks_better(station, truth):
    async def talk(page: Page, other: Page):
        assert "nobody is in control" in (await page.command("prepare_compensation"))["error"]
        await page.command("take_control", force=True)
        assert differing(await page.command("prepare_compensation")) == {}
        vehicle.save(station.desk.project.vehicle, truth)
        shown = await page.command("prepare_compensation")
        assert shown["compensation"]["vehicle"] == truth.name
        expected = parameters.difference(held(station), dict(controller.parameters_of(truth).parameters))
        assert differing(shown) == expected  # what `goshawk params set --vehicle` would change
        assert {"rotor_drag_s_m", "drag_x_kg_m", "drag_y_kg_m", "drag_z_kg_m"} <= set(expected)
        units = {row["name"]: row["unit"] for row in shown["compensation"]["parameters"]}
        assert (units["rotor_drag_s_m"], units["mass_kg"]) == ("s/m", "kg")
        assert "take control first" in (await other.command("send_compensation", nonce=shown["nonce"]))["error"]
        sent = await page.command("send_compensation", nonce=shown["nonce"])
        assert sent["error"] == ""
        assert differing(sent) == {}
        assert "given before" in (await page.command("send_compensation", nonce=shown["nonce"]))["error"]
        again = await page.command("prepare_compensation")
        assert "already" in (await page.command("send_compensation", nonce=again["nonce"]))["error"]

    before = held(station)
    visit(station, 2, talk)
    after = held(station)
    untouched = set(before) - set(parameters.difference(before, after))
    assert {"kp_xy_1_s2", "kd_xy_1_s", "mass_kg"} <= untouched  # gains are no part of the model
    line = orders(station)[-3]
    assert (line["answer"], line["version"]) == ("done", 0)
    assert line["changes"]["rotor_drag_s_m"] == [0.0, pytest.approx(truth.value("rotor_drag_thrust.drag_s_m"))]
    assert [one["answer"].split(":")[0] for one in orders(station)[-2:]] == ["refused", "refused"]
    weave = manoeuvres.from_legs(x=[(2.0, 8.0), (2.0, -8.0)], y=[(1.0, 2.0), (2.0, -4.0), (1.0, 2.0)], z=[(4.0, 0.0)])
    first_m, second_m = tracking_m(truth, before, weave), tracking_m(truth, after, weave)
    assert second_m < 0.5 * first_m, (first_m, second_m)


def test_a_model_that_changed_since_it_was_shown_is_not_sent(station, truth):
    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, truth)
        shown = await page.command("prepare_compensation")
        vehicle.save(station.desk.project.vehicle, truth.with_value("mass_kg", 0.8))
        assert "look at the page again" in (await page.command("send_compensation", nonce=shown["nonce"]))["error"]

    before = held(station)
    visit(station, 1, talk)
    assert held(station) == before


def for_prediction(truth: vehicle.Vehicle) -> vehicle.Vehicle:
    """A model that carries the mark "for prediction, not for design"."""
    fitted = truth.with_value("inertia_zz_kg_m2", 0.006, std=1e-4, source="identified from lap")
    return vehicle.purpose.marked(fitted, {"inertia_zz_kg_m2": "c_q / I_zz is known"})


def test_a_model_for_prediction_is_sent_only_with_consent_to_its_mark(station, truth):
    marked = for_prediction(truth)

    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, marked)
        shown = await page.command("prepare_compensation")
        mark = shown["compensation"]["mark"]
        assert mark == vehicle.purpose.mark_sentence(marked)
        refused = await page.command("send_compensation", nonce=shown["nonce"], accepted_mark="another mark")
        assert mark in refused["error"]
        assert held(station) == before
        shown = await page.command("prepare_compensation")
        sent = await page.command("send_compensation", nonce=shown["nonce"], accepted_mark=mark)
        assert (sent["error"], differing(sent)) == ("", {})

    before = held(station)
    visit(station, 1, talk)
    assert orders(station)[-1]["accepted_mark"] == vehicle.purpose.mark_sentence(marked)


@needs_chromium
def test_the_page_asks_for_that_consent_with_each_comparison(station, truth):
    from playwright.sync_api import sync_playwright

    vehicle.save(station.desk.project.vehicle, for_prediction(truth))
    with contextlib.ExitStack() as stack:  # the browser ends with the test: the others have an event loop of their own
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        stack.callback(browser.close)
        page = stack.enter_context(opened(station, browser, with_view=False))
        until(lambda: station.hub.people, "the page")
        station.desk.control.take(next(iter(station.hub.people)), force=True)
        page.keyboard.press("5")
        section = page.get_by_role("region", name="Controller's compensation")
        section.get_by_role("button", name="Compare with the vehicle").click()
        send, accepted = section.get_by_role("button", name=re.compile("^Hold to set")), section.get_by_role("checkbox")
        accepted.wait_for()
        assert send.is_disabled()
        section.get_by_text(vehicle.purpose.mark_sentence(for_prediction(truth))).wait_for()
        accepted.check()
        until(send.is_enabled, "the button")
        section.get_by_role("button", name="Compare again").click()
        until(lambda: not accepted.is_checked(), "the question anew")
        accepted.check()
        send.hover()
        page.mouse.down()
        section.get_by_text("Set, read back and equal").wait_for()
        page.mouse.up()
    expected = dict(controller.parameters_of(for_prediction(truth)).parameters)
    assert parameters.difference(held(station), expected) == {}


def test_an_order_whose_reading_fails_is_in_the_audit_log(station, truth):
    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, truth)
        shown = await page.command("prepare_compensation")
        station.desk.project.vehicle.write_text("no vehicle")
        assert "vehicle.toml" in (await page.command("send_compensation", nonce=shown["nonce"]))["error"]

    before = held(station)
    visit(station, 1, talk)
    assert held(station) == before
    assert orders(station)[-1]["answer"].startswith("refused: ")


def test_a_value_that_the_controller_cannot_take_is_named_and_nothing_is_offered(station, truth):
    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, truth.with_value("mass_kg", 900.0))
        reply = await page.command("prepare_compensation")
        assert "mass_kg is 900" in reply["error"]
        assert reply["nonce"] == ""

    visit(station, 1, talk)


def test_effects_that_the_controller_does_not_cancel_are_named_with_the_reason(station, truth, tmp_path):
    guard = tmp_path / "compensation_guard.py"
    guard.write_text(GUARD)

    vehicle.effects.run_any()  # this process is the station's too
    changed = truth.with_effect("gyroscopic_torque").with_effect_file(guard)

    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, changed)
        left = (await page.command("prepare_compensation"))["compensation"]["not_compensated"]
        why = {effect["title"]: effect["why"] for effect in left}
        assert why["gyroscopic torque"] == "attitude feedback takes it"
        assert "an effect of your own" in why["compensation guard"]

    visit(station, 1, talk)


def test_the_controller_refuses_in_the_air_and_keeps_all_it_has(station, truth):
    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, truth.with_value("inertia_xx_kg_m2", 0.004))
        shown = await page.command("prepare_compensation")
        rows = shown["compensation"]["parameters"]
        assert [row["name"] for row in rows if row["flies_with"] != row["model"] and not row["in_flight"]] == [
            "inertia_xx"
        ]
        station.watch.order(Command.ARM)
        station.watch.link.command(Command.TAKE_OFF, 0.5)
        await page.until(lambda p: p.state["vehicle"]["mission"] not in ("disarmed", "armed"))
        refused = await page.command("send_compensation", nonce=shown["nonce"])
        assert "refused the parameters" in refused["error"]
        assert "nothing was changed" in refused["error"]
        station.watch.link.command(Command.LAND)
        await page.until(lambda p: p.state["vehicle"]["mission"] in ("disarmed", "armed"))
        with contextlib.suppress(LinkError):  # or it has by itself
            station.watch.order(Command.DISARM)
        await page.until(lambda p: p.state["vehicle"]["mission"] == "disarmed")

    before = held(station)
    visit(station, 1, talk)
    assert held(station) == before


def test_another_stations_control_of_the_vehicle_is_respected(station, truth, simulated, key_file):
    async def talk(page: Page):
        await page.command("take_control", force=True)
        vehicle.save(station.desk.project.vehicle, truth)
        shown = await page.command("prepare_compensation")
        with firmware_bridge.connect(simulated.url, key=key_file, system_id=200) as other:
            other.take_control(force=True)
            said = (await page.command("send_compensation", nonce=shown["nonce"]))["error"]
        assert "is in control of the vehicle" in said

    before = held(station)
    visit(station, 1, talk)
    assert held(station) == before
