"""What people edit on the station's pages: planned, shared, undone, and refused where it makes no sense."""

import numpy as np
import pytest

import esdf
import vehicle
from flight import Waypoints, mission, project
from gcs_web.scene.picking import Surface
from tests.gcs_web.station_socket import Page, visit
from tests.gcs_web.two_pillars import START

pytestmark = pytest.mark.usefixtures("same_waypoints")


def test_an_edit_is_planned_and_undo_brings_the_waypoint_back(station):
    async def talk(page: Page):
        ids = [w["id"] for w in page.state["document"]["waypoints"]]
        assert (await page.edit("move", waypoints=[ids[1]], z_m=1.5))["error"] == ""
        await page.checked()
        assert page.heights() == [1.0, 1.5, 1.2]
        assert page.state["notice"]["undo"]
        await page.command("undo")
        await page.until(lambda p: p.heights() == [1.0, 1.2, 1.2])

    visit(station, 1, talk)


def test_a_missions_requests_are_edited_planned_and_taken_back(station):
    async def talk(page: Page):
        ids = [w["id"] for w in page.state["document"]["waypoints"]]
        assert not (await page.edit("ask", waypoints=[ids[1]], stay_s=1.0))["error"]
        assert not (await page.edit("loop", laps=2))["error"]
        assert not (await page.edit("ground", end="take_off"))["error"]
        await page.until(lambda p: p.state["document"]["mission"]["take_off"] is not None)
        ground = page.state["document"]["mission"]["take_off"]
        assert (ground["x_m"], ground["y_m"]) == (0.8, 0.8)
        assert 0.0 < ground["z_m"] < 0.2  # on the floor below waypoint 0
        await page.checked()
        assert page.state["plan"]["passings"][0]["waypoint"] is None
        saved = mission.load(station.desk.project.waypoints)
        assert saved.laps is not None
        assert (saved.laps.count, saved.stays[0].duration_s) == (2, 1.0)
        for _ in range(3):
            await page.command("undo")
        await page.until(lambda p: p.state["document"]["mission"]["laps"] == 0)
        assert mission.load(station.desk.project.waypoints).plain

    visit(station, 1, talk)


def test_all_pages_know_what_the_one_3d_view_shows(station):
    async def talk(anna: Page, ben: Page):
        await anna.command("show", colour="thrust")
        await ben.until(lambda p: p.state.get("shown", {}).get("colour") == "thrust")
        await anna.command("show", colour="clearance")
        for of in ("distance", "unknown", "could_hide", "surface_std"):
            await anna.command("show_map", slice={"axis": "y", "at_m": 1.0, "of": of}, layers=["cameras", "points"])
            await ben.until(lambda p, of=of: (p.state.get("map_shown", {}).get("slice") or {}).get("of") == of)
        assert ben.state["map_shown"]["layers"] == ["cameras", "points"]
        refused = await anna.command("show_map", slice={"axis": "y", "at_m": 1e9}, layers=[])
        assert "finite place" in refused["error"]
        await anna.command("show_map", slice=None, layers=["mesh", "edits"])

    visit(station, 2, talk)


BOX = {"form": "box", "centre_m": [3.0, 0.8, 1.2], "size_m": [0.2, 4.0, 2.0]}


def test_a_no_fly_zone_over_the_path_is_previewed_applied_refused_and_undone(station):
    async def talk(anna: Page, ben: Page):
        await anna.checked()
        plan = anna.state["plan"]
        shape = BOX | {"size_m": [0.2, 1.0, 2.0]}
        await anna.command("preview_map_edit", action="no-fly", shape=shape)
        await ben.until(lambda p: p.state.get("map_preview", {}).get("voxels", 0) > 0)
        assert 0.0 < ben.state["map_preview"]["closed_m3"] <= 0.3 * 1.1 * 2.1
        assert "another person" in (await ben.command("preview_map_edit", action="add", shape=BOX))["error"]
        assert station.desk.session.content.map_edits == ()
        reply = await anna.edit("add_map_edit", action="no-fly", name="<b>cable</b>", shape=shape)
        assert reply["error"] == ""
        await anna.checked()  # a way round it
        assert anna.state["plan"]["crc32"] != plan["crc32"]
        field = esdf.load(station.desk.project.map / "esdf")
        assert field.distance([[3.0, 0.8, 1.2]])[0] < 0.0
        assert anna.state["map_preview"]["shape"] is None
        number = anna.state["document"]["map_edits"][0]["id"]
        await anna.edit("change_map_edit", edit=number, shape=BOX)  # from wall to wall
        await ben.until(lambda p: p.state["plan"]["state"] == "refused")
        assert ben.state["document"]["undo"] == "no-fly zone <b>cable</b> changed"
        await ben.command("undo")
        await anna.checked()
        await ben.command("undo")
        await anna.checked()
        assert esdf.load_edits(station.desk.project.map / "esdf" / "edits.json") == ()
        await anna.until(lambda p: p.state["plan"]["crc32"] == plan["crc32"])

    visit(station, 2, talk)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ({"action": "no-fly", "name": "", "shape": BOX}, "needs a name"),
        ({"action": "add", "name": "far", "shape": BOX | {"centre_m": [500.0, 0.0, 0.0]}}, "touches no voxel"),
        ({"action": "add", "name": "far", "shape": BOX | {"centre_m": [1e9, 0.0, 0.0]}}, "finite and within"),
        ({"action": "add", "name": "flat", "shape": BOX | {"size_m": [0.0, 1.0, 1.0]}}, "is empty"),
        ({"action": "add", "name": "two", "shape": {"form": "prism", "corners_m": [[0, 0], [1, 1]]}}, "3 corners"),
        ({"action": "burn", "name": "x", "shape": BOX}, "Invalid enum value 'burn'"),
        ({"action": "add", "name": "x" * 61, "shape": BOX}, "at most 60"),
    ],
)
def test_an_edit_of_the_map_that_makes_no_sense_is_refused_and_changes_nothing(station, edit, said):
    async def talk(page: Page):
        assert said in (await page.edit("add_map_edit", **edit))["error"]
        assert station.desk.session.content.map_edits == ()

    visit(station, 1, talk)


def test_what_is_clicked_to_measure_has_its_clearance_and_the_distance(station):
    async def talk(page: Page):
        await page.command("measure", active=True)
        corners = np.array([[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 18.0, 1.0]])
        station.view.map.mesh.surface = Surface(corners, np.array([[0, 1, 2]]))
        for x in (1.0, 4.0):
            station.view.map.click(np.array([x, 1.0, 5.0]), np.array([0.0, 0.0, -1.0]))
        await page.until(lambda p: len(p.state.get("measured", {}).get("points_m", ())) == 2)
        assert page.state["measured"]["distance_m"] == pytest.approx(3.0)
        near = station.desk.parts.map(station.desk.inputs).field.distance([[1.0, 1.0, 1.0], [4.0, 1.0, 1.0]])
        np.testing.assert_allclose(page.state["measured"]["clearances_m"], near, atol=1e-3)
        await page.command("measure", active=False)
        await page.until(lambda p: p.state["measured"]["points_m"] == [])

    visit(station, 1, talk)


def test_two_people_see_each_others_edits_and_conflicts_are_refused(station):
    async def talk(anna: Page, ben: Page):
        ids = [w["id"] for w in anna.state["document"]["waypoints"]]
        seen = anna.state["document"]["revision"]
        assert not (await anna.edit("move", waypoints=[ids[0]], z_m=1.1, revision=seen))["error"]
        assert not (await ben.edit("move", waypoints=[ids[2]], z_m=1.3, revision=seen))["error"]
        refused = await ben.edit("move", waypoints=[ids[0]], z_m=1.4, revision=seen)
        assert "changed the same meanwhile" in refused["error"]
        for page in (anna, ben):
            await page.until(lambda p: p.heights() == [1.1, 1.2, 1.3])

    visit(station, 2, talk)


def test_a_plan_is_void_once_the_vehicle_changes_underneath(station):
    async def talk(page: Page):
        await page.checked()
        path = station.desk.project.vehicle
        before = path.read_bytes()
        vehicle.save(path, vehicle.load(path).with_value("mass_kg", 0.72))
        await page.until(lambda p: p.state["plan"]["state"] == "void")
        assert "map or the vehicle changed" in (await page.command("save", name="stale"))["error"]
        await page.command("plan_again")
        await page.checked()
        path.write_bytes(before)
        await page.until(lambda p: p.state["plan"]["state"] == "void")
        await page.command("plan_again")
        await page.checked()

    visit(station, 1, talk)


def test_waypoints_changed_by_another_program_appear_on_the_page(station):
    async def talk(page: Page):
        project.save_waypoints(
            station.desk.project.waypoints, Waypoints(np.add(START, (0.0, 0.0, 0.25)), np.full(3, np.nan))
        )
        await page.until(lambda p: p.heights() == [1.25, 1.45, 1.45])
        assert page.state["document"]["author"] == "another program"
        await page.command("undo")
        await page.until(lambda p: p.heights() == [1.0, 1.2, 1.2])

    visit(station, 1, talk)


def test_what_a_page_may_not_send_is_answered_and_does_no_harm(station):
    async def talk(page: Page):
        before = page.state["document"]
        for text in (
            "", "[]", "null", '{"type": "explode"}', '{"type": "move"}', "{" * 3000, '"' + "a" * 100_000 + '"',
            '{"type": "move", "serial": 1, "revision": 0, "waypoints": ["a"]}',
            '{"type": "move", "serial": 1, "revision": 0, "waypoints": [0], "x_m": NaN}',
            '{"type": "move", "serial": 1, "revision": 0, "waypoints": [0], "x_m": 1e400}',
        ):  # fmt: skip
            await page._socket.send_str(text)
            reply = await page._receive()
            while reply["type"] != "reply":
                reply = await page._receive()
            assert "does not understand" in reply["error"]
        huge = await page.edit("move", waypoints=[w["id"] for w in before["waypoints"]], x_m=1e9)
        assert "within 10000 m" in huge["error"]
        assert page.state["document"]["waypoints"] == before["waypoints"]

    visit(station, 1, talk)
