"""Vehicles of other firmware on the page: looked at, flown, paused, killed, logged; simulated ones, no real PX4."""

import contextlib
import threading
from collections.abc import Iterator

import numpy as np
import pytest

import vehicle
from firmware_bridge.betaflight_sitl import firmware
from flight import FlightLog, LinkError, Waypoints, flight_log, project
from gcs_web import GroundStation
from gcs_web.panels import vehicle as panel
from goshawk.commands.fly import offboard, others
from tests.firmware_bridge.autopilot.flights import MODEL, hover_thrust
from tests.firmware_bridge.autopilot.simulated_autopilot import SimulatedAutopilot
from tests.firmware_bridge.crazyflie.simulated_crazyflie import SimulatedCrazyflie, UdpServer
from tests.gcs_web.station_socket import Page, visit
from tests.gcs_web.two_pillars import START, TRIANGLES, add_map
from tests.waiting import until

SLOW = 1.0
"""Limit of speed, so that there is time to pause."""


@contextlib.contextmanager
def flying_autopilot(**more) -> Iterator[SimulatedAutopilot]:
    """On the ground below the first waypoint; it runs from `switch_on` on: it must not be old when it flies."""
    on_ground = vehicle.simulate.State(position_world_m=START[0] * [1.0, 1.0, 0.0])
    plant = vehicle.simulate.Plant(MODEL, on_ground, rng=np.random.default_rng(1), ground_m=0.0)
    simulation = SimulatedAutopilot(plant, "px4", {"MPC_THR_HOVER": hover_thrust("px4")} | more)
    try:
        yield simulation
    finally:
        simulation.given_up = True
        for thread in threading.enumerate():
            if thread.name == simulation.address:
                thread.join(60.0)
        simulation.close()


def switch_on(simulation: SimulatedAutopilot) -> None:
    threading.Thread(target=simulation.run, name=simulation.address, daemon=True).start()


@contextlib.contextmanager
def simulated_crazyflie() -> Iterator[str]:
    """Its address, of one on the ground below the first waypoint."""
    server = UdpServer(SimulatedCrazyflie(position_m=[0.8, 0.8, 0.0]))
    server.start()
    try:
        yield f"crazyflie:udp://127.0.0.1:{server.port}"
    finally:
        server.ends = True
        server.join(10.0)


@contextlib.contextmanager
def serving(pillar_map, folder, foreign) -> Iterator[GroundStation]:
    opened = project.create(folder, "others")
    add_map(opened, pillar_map)
    vehicle.save(opened.vehicle, MODEL)
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(len(START), np.nan)))
    with GroundStation(opened.folder, triangles=TRIANGLES, foreign=foreign) as running:
        yield running


def by(simulation: SimulatedAutopilot):
    """Flies it in lock step."""

    def new(url, poses, model_of):
        del url, poses
        where = offboard.Where(simulation.address, "127.0.0.1", 0, 0.0, simulation.clock_port)
        return others.AutopilotFlyer(where, model_of)

    return new


async def started(page: Page, simulation: SimulatedAutopilot) -> None:
    await page.checked()
    switch_on(simulation)
    assert not (await page.command("connect", url=simulation.address))["error"]
    await page.until(lambda p: p.state["vehicle"].get("foreign"))
    assert not (await page.command("take_control"))["error"]
    nonce = (await page.command("prepare_order"))["nonce"]
    unseen = await page.command("order", order="start", nonce=nonce, crc32="00000000")
    assert "another one than the page showed" in unseen["error"]
    assert not await ordered(page, "start")


async def ordered(page: Page, order: str) -> str:
    nonce = (await page.command("prepare_order"))["nonce"]
    crc32 = page.state["plan"]["crc32"]
    return (await page.command("order", order=order, nonce=nonce, crc32=crc32))["error"]


def saved(station: GroundStation) -> FlightLog:
    until(lambda: station.desk.project.flights(), "the log")
    (path,) = station.desk.project.flights()
    return flight_log.load(path)


@pytest.mark.slow
def test_an_autopilot_is_looked_at_flown_and_logged_and_says_whose_failsafe_is_whose(pillar_map, tmp_path):
    with flying_autopilot() as simulation, serving(pillar_map, tmp_path / "p", by(simulation)) as station:

        async def talk(page: Page):
            await started(page, simulation)
            before = page.state["vehicle"]
            whose = [each["whose"] for each in before["foreign"]["failsafes"]]
            assert set(whose) == {"Goshawk's guard", "PX4"}
            await page.until(lambda p: p.state["vehicle"]["mission"] == "trajectory")
            assert page.state["vehicle"]["armed"]
            await page.until(lambda p: (p.state["vehicle"].get("along_s") or 0.0) > 0.2)
            assert page.state["vehicle"]["error_m"] < 0.3
            assert "it disarms itself" in await ordered(page, "disarm")
            await page.until(lambda p: any("Landed" in text for text in p.notices))
            await page.until(lambda p: not p.state["vehicle"]["armed"])

        visit(station, 1, talk)
        log = saved(station)
    assert log.metadata["trajectory"] == station.desk.name
    assert "PX4 holds what we sent last" in log.metadata["failsafe"]
    assert not simulation.armed


@pytest.mark.slow
@pytest.mark.parametrize("how", ["kill", "abort", "pause"])
def test_it_pauses_lands_and_is_killed_from_the_page(pillar_map, tmp_path, how):
    with flying_autopilot() as simulation, serving(pillar_map, tmp_path / "p", by(simulation)) as station:

        async def talk(page: Page):
            await started(page, simulation)
            await page.until(lambda p: p.state["vehicle"]["mission"] == "trajectory")
            if how == "pause":
                assert not await ordered(page, "pause")
                await page.until(lambda p: p.state["vehicle"]["mission"] == "paused")
                assert not await ordered(page, "resume")
                await page.until(lambda p: any("Landed" in text for text in p.notices))
                return
            assert not (await page.command(how))["error"]
            await page.until(lambda p: any("The flight ended early" in text for text in p.notices))

        visit(station, 1, talk)
        log = saved(station)
    assert ("ended_early" in log.metadata) == (how != "pause")
    assert log.vector("position_world_m")[:, 2].max() > 0.5
    if how == "kill":
        assert simulation.fastest_down_m_s > 1.5  # it fell
    else:
        assert simulation.fastest_down_m_s < 1.2


@pytest.mark.slow
def test_one_that_stands_elsewhere_or_is_set_up_badly_is_not_armed(pillar_map, tmp_path):
    with flying_autopilot() as simulation, serving(pillar_map, tmp_path / "p", by(simulation)) as station:
        far = np.array([[3.0, 3.6, 1.0], [5.2, 0.8, 1.2]])
        station.desk.session.take(Waypoints(far, np.full(2, np.nan)), "elsewhere", "test")

        async def talk(page: Page):
            await started(page, simulation)
            await page.until(lambda p: any("the plan begins" in text for text in p.notices))

        visit(station, 1, talk)
        assert simulation.way == [] or max(place[2] for _, place in simulation.way) < 0.1
        assert not station.desk.project.flights()
    with (
        flying_autopilot(COM_OF_LOSS_T=5.0) as simulation,
        serving(pillar_map, tmp_path / "q", by(simulation)) as station,
    ):

        async def refused(page: Page):
            await page.checked()
            switch_on(simulation)
            await page.command("connect", url=simulation.address)
            await page.until(lambda p: p.state["vehicle"].get("checks"))
            failed = [check["name"] for check in page.state["vehicle"]["checks"] if not check["passed"]]
            assert failed == ["COM_OF_LOSS_T"]
            await page.command("take_control")
            assert "not armed. COM_OF_LOSS_T" in await ordered(page, "start")

        visit(station, 1, refused)


@pytest.mark.slow
def test_betaflights_own_firmware_is_flown_from_the_page(pillar_map, tmp_path):
    try:
        firmware.program()
    except firmware.UnavailableError as reason:
        pytest.skip(str(reason))
    flyers: list[others.BetaflightFlyer] = []
    with serving(pillar_map, tmp_path / "p", lambda *_: flyers[0]) as station:
        desk = station.desk
        until(lambda: desk.answer is not None and desk.answer.file is not None, "a plan")
        body = offboard.body_of(MODEL, desk.checked().trajectory, seed=1)
        with offboard.rehearsing(body) as (where, restarted):
            flyers.append(others.BetaflightFlyer(where, lambda: MODEL, restarted))

            async def talk(page: Page):
                assert not (await page.command("connect", url=where.address))["error"]
                await page.until(lambda p: p.state["vehicle"].get("foreign"))
                whose = [each["whose"] for each in page.state["vehicle"]["foreign"]["failsafes"]]
                assert whose == ["Goshawk's guard", "Goshawk's guard", "Betaflight"]
                assert all(check["passed"] for check in page.state["vehicle"]["checks"])
                assert not (await page.command("take_control"))["error"]
                assert not await ordered(page, "start")
                await page.until(lambda p: any("Landed" in text or "early" in text for text in p.notices))

            visit(station, 1, talk)
        log = saved(station)
    assert "ended_early" not in log.metadata
    assert body.fastest_down_m_s < 1.2


def test_a_crazyflie_is_looked_at_and_cannot_pause(pillar_map, tmp_path):
    with simulated_crazyflie() as address, serving(pillar_map, tmp_path / "p", others.flyer) as station:

        async def talk(page: Page):
            await page.command("connect", url=address)
            await page.until(lambda p: p.state["vehicle"].get("foreign"))
            said = page.state["vehicle"]["foreign"]
            assert not said["can_pause"]
            assert [each["whose"] for each in said["failsafes"]] == ["A process of ours", "Crazyflie"]
            assert all(check["passed"] for check in page.state["vehicle"]["checks"])
            assert not page.state["vehicle"]["armed"]

        visit(station, 1, talk)


def test_an_address_that_is_none_is_refused_and_one_that_nobody_answers_says_so(pillar_map, tmp_path):
    with serving(pillar_map, tmp_path / "p", others.flyer) as station:

        async def talk(page: Page):
            for bad in ("mavlink:udp://10.0.0.1:14540", "crazyflie:radio://0/80/2M", "betaflight:tcp://x",
                        "betaflight:tcp://127.0.0.1:99999", "betaflight:tcp://10.0.0.1:5761"):  # fmt: skip
                said = (await page.command("connect", url=bad))["error"]
                assert said, bad
            assert "udp://" in (await page.command("connect", url="mavlink:udp://127.0.0.1:9", poses="7777"))["error"]
            far = await page.command("connect", url="betaflight:tcp://127.0.0.1:5761", poses="udp://10.0.0.1:7777")
            assert "this machine only" in far["error"]
            assert not (await page.command("connect", url="crazyflie:udp://127.0.0.1:9"))["error"]
            await page.until(lambda p: "does not answer" in p.state["vehicle"].get("reason", ""))
            assert page.state["vehicle"]["link"] == "lost"

        visit(station, 1, talk)


def test_orders_without_a_flight_are_refused():
    class Nobody:
        can_pause = True

        def look(self):
            raise LinkError("nobody")

        def fly(self, file, asked, told, progress):
            raise LinkError("nobody")

    from gcs_web.vehicle.foreign_watch import ForeignWatch

    watch = ForeignWatch("crazyflie:udp://127.0.0.1:9", Nobody())
    for act in (watch.land, watch.kill, lambda: watch.order(panel._COMMANDS["pause"]), watch.require_fit):
        with pytest.raises(LinkError):
            act()
