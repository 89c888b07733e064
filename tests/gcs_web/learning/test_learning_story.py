"""A newcomer with two flights to learn from, one to judge, and only the page: what is missing, kept, sent, flown again.

The script is given no name and no figure: it reads them off the page, and they are compared with the truth at the end.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

import mapping
import planner
import vehicle
from firmware_bridge import Sensors, SitlVehicle, airborne, closed_loop, controller, keys
from flight import FlightLog, Waypoints, flight_log, project
from sysid.report import words
from tests.gcs_web.in_browser import CHROMIUM, FLAGS
from tests.gcs_web.station_process import StationProcess, new_project
from tests.gcs_web.test_newcomer import hold, ordered
from tests.waiting import PATIENCE_S
from vehicle import Vehicle, simulate

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium"),
]
HIDDEN = ("rotor_drag_thrust", "centre_of_mass")
WIND = simulate.Wind(gust_std_m_s=0.1)
COURSES = {
    "climbs": ((0.8, 0.8, 0.8), (3.0, 2.0, 1.7), (5.2, 0.8, 0.8), (5.2, 3.2, 1.8), (3.0, 0.8, 0.8), (0.8, 3.2, 1.7),
               (0.8, 0.8, 0.8), (5.2, 0.8, 1.7), (3.0, 2.0, 0.8), (0.8, 3.2, 1.6)),
    "swings": ((0.8, 3.2, 1.2), (3.0, 2.0, 0.8), (5.2, 0.8, 1.7), (3.0, 0.8, 0.9), (0.8, 0.8, 1.7), (0.8, 3.2, 0.8),
               (3.0, 2.0, 1.7), (5.2, 3.2, 0.8), (5.2, 0.8, 1.7)),
    "round": ((0.8, 0.8, 1.0), (3.0, 2.0, 1.2), (5.2, 0.8, 1.2), (5.2, 3.2, 1.4), (3.0, 2.0, 1.0), (0.8, 3.2, 1.4)),
}  # fmt: skip
SWING_RAD = {"climbs": 0.0, "swings": 1.0, "round": 0.0}
"""By how much the heading goes to either side of the path."""
PICTURES = ("flights", "compared", "moments", "named", "tried", "kept", "planned", "sent", "flying", "fell")


@dataclass(frozen=True)
class Read:
    """What the page said."""

    named: str
    sizes: list[float]
    """Of the named effect, in SI."""
    before_mm: float
    """Position error after 0.5 s on the judging flight, of the model as it was."""
    after_mm: float
    flown_before_mm: float
    """Mean tracking error."""
    flown_again: str
    """Name of the flight with what was learned."""
    flown_after_mm: float
    not_cancelled: str


def drawn(seed: int) -> tuple[str, Vehicle, Vehicle]:
    """An effect, the vehicle that has it, and what is believed of that vehicle."""
    truth = vehicle.example("rigter2019").with_limits(speed_m_s=5.0, acceleration_m_s2=8.0)
    for axis in "xyz":  # the SITL vehicle reports the pose of its centre of mass
        truth = truth.with_value(f"pose_sensor_{axis}_m", 0.0, source="SITL vehicle")
    hidden = HIDDEN[int(np.random.default_rng(seed).integers(len(HIDDEN)))]
    return hidden, truth, truth.without_effect(hidden)


def recorded(opened: project.Project, truth: Vehicle, believed: Vehicle) -> None:
    """The project's three flights, and the waypoints of the last one."""
    opened.flight("round").parent.mkdir()
    vehicle.save(opened.vehicle, believed)
    area = mapping.open_map(opened.map)
    for seed, (name, course) in enumerate(COURSES.items()):
        points = np.array(course)
        sides = SWING_RAD[name] * (-1.0) ** np.arange(len(points))
        yaw = np.unwrap(np.arctan2(*np.gradient(points[:, :2], axis=0).T[::-1])) + sides if sides.any() else None
        asked = Waypoints(points, np.full(len(points), np.nan) if yaw is None else yaw)
        path = planner.plan(asked, area.field, believed).trajectory
        start = simulate.State(path.position([0.0])[0] * [1.0, 1.0, 0.0])
        plant = simulate.Plant(truth, start, rng=np.random.default_rng(seed), wind=WIND, ground_m=0.0)
        flown = closed_loop.fly(
            plant, controller.parameters_of(believed), path, sensors=Sensors.typical(), seed=seed
        ).log
        facts = {**flown.metadata, "trajectory": name, "vehicle_hash": vehicle.vehicle_hash(believed)}
        flight_log.save(opened.flight(name), FlightLog(flown.columns, facts))
    project.save_waypoints(opened.waypoints, asked)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_missing_effect_is_seen_named_kept_sent_and_flown_on_the_page_alone(seed, pillar_map, tmp_path):
    from playwright.sync_api import sync_playwright

    opened = new_project(tmp_path / "project", pillar_map)
    hidden, truth, believed = drawn(seed)
    recorded(opened, truth, believed)
    key_file = tmp_path / "link.key"
    start = simulate.State(np.array(COURSES["round"][0]) * [1.0, 1.0, 0.0])
    plant = simulate.Plant(truth, start, rng=np.random.default_rng(seed), wind=WIND, ground_m=0.0)
    flies_with = controller.parameters_of(believed).parameters
    with (
        sync_playwright() as playwright,
        SitlVehicle(plant, flies_with, key=keys.create(key_file), sensors=Sensors.typical()) as simulated,
        StationProcess(opened.folder, "--url", simulated.url, "--key", key_file) as station,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
        page.set_default_timeout(2000 * PATIENCE_S)
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(station.addresses()[-1])
        said = script(page, lambda name: page.screenshot(path=tmp_path / f"{name}.png"), lambda: ordered(opened))
        browser.close()
    assert errors == []
    assert said.named == words.effect(hidden)
    assert said.after_mm < 0.7 * said.before_mm
    learned = vehicle.load(opened.vehicle)
    assert [effect for effect in learned.effects if effect not in believed.effects] == [hidden]
    names = [name for name in vehicle.specs(truth) if name.startswith(f"{hidden}.")]
    for name, shown in zip(names, said.sizes, strict=True):
        found = learned.parameter(name)
        near = pytest.approx(truth.value(name), abs=max(0.25 * abs(truth.value(name)), 3.0 * found.std))
        assert (found.value, shown) == (near, near)
    for flight, shown_mm in (("round", said.flown_before_mm), (said.flown_again, said.flown_after_mm)):
        flown = airborne.tracking(flight_log.load(opened.flight(flight)))
        assert shown_mm == pytest.approx(1000.0 * flown["tracking_mean_m"], abs=0.51)  # whole millimetres
    if words.effect(hidden) not in said.not_cancelled.lower():
        assert said.flown_after_mm < 0.8 * said.flown_before_mm
    for name in PICTURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


def script(page, picture: Callable[[str], object], orders: Callable[[], list[str]]) -> Read:
    """Ten minutes of a newcomer, by clicks and keys."""

    def step(name: str) -> None:
        page.get_by_role("navigation", name="Steps").get_by_role("button", name=re.compile(name)).click()

    # the flights, and which of them judges
    step("Compare")
    page.get_by_label("What round is for").select_option("held-out")
    page.get_by_role("button", name=re.compile("^round"), pressed=True).wait_for()  # the newest one is open
    flown_before_mm = tracking_mm(page, "round")
    picture("flights")

    # where the model fails
    page.get_by_role("button", name="Compare with the model").click()
    page.get_by_role("heading", name=re.compile("^Residual")).wait_for()
    before_mm = error_mm(page)
    picture("compared")
    page.get_by_role("img", name=re.compile("^Residual . in|^Residual ._. in")).click(position={"x": 250, "y": 80})
    page.get_by_text("of the open flights, shaded").wait_for()
    picture("moments")

    # which effect is missing
    page.get_by_role("button", name="Find the missing effect").click()
    page.get_by_role("button", name="Find the missing effect").click()
    page.get_by_role("button", name="Diagnose again").wait_for()
    card = page.get_by_role("region").filter(has=page.get_by_role("button", name="Try: refit with it"))
    named, sizes = card.get_attribute("aria-label"), estimates(card.locator(".card-side").inner_text())
    picture("named")
    card.get_by_role("button", name="Try: refit with it").click()
    page.get_by_role("button", name="Keep as version 1").wait_for()
    page.get_by_text(re.compile("after 0.5 s on held-out round")).wait_for()
    picture("tried")
    page.get_by_role("button", name="Keep as version 1").click()
    page.get_by_text("the vehicle file is at version 1").wait_for()
    picture("kept")

    # the controller's compensation
    page.get_by_role("button", name="Take control").click()
    page.get_by_role("button", name="Compare with the vehicle").click()
    hold(page, "set", until=page.get_by_text("Set, read back and equal").is_visible)
    unseen = page.get_by_text("of the model that the controller does not cancel")
    not_cancelled = ""
    if unseen.count():
        unseen.click()
        not_cancelled = page.locator("details", has=unseen).inner_text()
    picture("sent")

    # the margins of the plan, now that the model is another, and the flight
    step("Plan")
    page.get_by_role("button", name="Plan and check again").click()
    page.get_by_text("Checked", exact=True).wait_for()
    page.get_by_text("slowest rotor").first.wait_for()
    picture("planned")
    page.get_by_role("button", name="Save", exact=True).first.click()
    page.keyboard.press("Control+A")
    page.keyboard.type("again")
    page.keyboard.press("Enter")
    page.get_by_text("Saved as trajectories/again.json").wait_for()
    page.get_by_role("button", name="Compare and upload").click()
    hold(page, "upload again", until=lambda: "upload" in orders())
    page.get_by_role("status").get_by_text("read back and equal").wait_for()
    step("Fly")
    hold(page, "arm and fly again", until=lambda: "start" in orders())
    picture("flying")
    page.get_by_role("listitem").get_by_text(re.compile("^again-")).wait_for()

    # the error fell
    step("Compare")
    flown_again, flown_after_mm, after_mm = judged_by_the_newest(page)
    picture("fell")
    return Read(named, sizes, before_mm, after_mm, flown_before_mm, flown_again, flown_after_mm, not_cancelled)


def estimates(text: str) -> list[float]:
    """The numbers before a standard error: "1.410 ± 0.020", "(1.800 ± 0.063)·10⁻⁴"."""
    plain = text.translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−", "0123456789--"))
    found = re.findall(r"(-?[\d.]+) ± [\d.]+(?:\)·10(-?\d+))?", plain)
    return [float(f"{value}e{power or 0}") for value, power in found]


def judged_by_the_newest(page) -> tuple[str, float, float]:
    """The new flight, its mean tracking error, and the position error after 0.5 s that the kept model makes on it."""
    newest = page.get_by_role("button", name=re.compile("^again-"))
    name = newest.locator("b").first.inner_text()
    newest.click()
    page.locator(".flight-tag .tag-name").get_by_text(name, exact=True).wait_for()
    page.get_by_label("What round is for").select_option("left out")
    page.get_by_label(f"What {name} is for").select_option("held-out")
    page.get_by_role("button", name="Compare again").click()
    changed = "The vehicle, a flight or the choice of flights changed since. Compare again."
    page.get_by_text(changed).wait_for(state="detached")
    return name, tracking_mm(page, name), error_mm(page)


def tracking_mm(page, flight: str) -> float:
    """Of the list of flights."""
    card = page.locator("li.flight", has=page.get_by_label(f"What {flight} is for"))
    return float(card.locator(".flight-figures b").first.inner_text())


def error_mm(page) -> float:
    """Position error after 0.5 s, of the table of the comparison."""
    table = page.get_by_role("table").filter(has=page.get_by_role("row", name=re.compile("^after")))
    heads = [head.inner_text() for head in table.get_by_role("columnheader").all()]
    row = table.get_by_role("row", name=re.compile("^position")).get_by_role("cell").all()
    assert "mm" in row[0].inner_text()
    return float(row[heads.index("0.5 s")].inner_text())
