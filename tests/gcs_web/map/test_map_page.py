"""The step Map in a real browser: edits of the map by numbers and handles, measuring, an oblique slice."""

import time

import msgspec
import numpy as np

import esdf
from gcs_web import GroundStation
from gcs_web.map import slices
from gcs_web.map.bodies import pulled, triple
from gcs_web.protocol.map import AddMapEdit, ChangeMapEdit, Shape
from tests.gcs_web.in_browser import needs_chromium
from tests.waiting import until as wait

pytestmark = needs_chromium


def test_a_number_typed_while_an_earlier_one_is_previewed_stays(page, station: GroundStation, monkeypatch):
    compute = station.desk.map._show_preview

    def slowly(*args, **kwargs):
        time.sleep(0.5)
        compute(*args, **kwargs)

    monkeypatch.setattr(station.desk.map, "_show_preview", slowly)
    page.keyboard.press("1")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Box").click()
    form = page.get_by_role("form", name="New edit of the map")
    fields = [form.get_by_label(f"Centre, m {axis}") for axis in "xyz"]
    wait(lambda: station.desk.map._preview.shape is not None, "the first preview")
    first = station.desk.map._preview
    for field, value in zip(fields, ("3.0", "3.4", "0.5"), strict=True):
        if field is fields[2]:  # two were typed during the preview of the first, whose answer comes now
            wait(lambda: station.desk.map._preview is not first, "the answer to the first number")
            page.wait_for_timeout(200)  # until the page has read it, and before the second is answered
        field.fill(value)
        field.press("Enter")
    wait(lambda: station.view.map._shape.centre_m == (3.0, 3.4, 0.5), "the box of the last number typed")
    assert [float(field.input_value()) for field in fields] == [3.0, 3.4, 0.5]
    form.get_by_role("button", name="Cancel").click()


def test_a_no_fly_zone_is_drawn_by_numbers_and_by_its_handle_previewed_applied_and_undone(page, station: GroundStation):
    page.keyboard.press("1")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Box").click()
    form = page.get_by_role("form", name="New edit of the map")
    form.get_by_label("Name").fill("<i>cable</i>")
    for axis, value in zip("xyz", ("3.0", "3.4", "0.5"), strict=True):
        form.get_by_label(f"Centre, m {axis}").fill(value)
        form.get_by_label(f"Centre, m {axis}").press("Enter")
    form.get_by_text("no longer free").wait_for()
    wait(lambda: "centre" in station.view.map._handles, "the handles")
    wait(lambda: station.view.map._shape.centre_m == (3.0, 3.4, 0.5), "the box of the last number typed")
    assert not station.desk.map._preview.drawn  # so that no answer replaces what was typed since
    shape = pulled(station.view.map._shape, "size", np.array([3.4, 3.6, 1.0]))  # as viser tells of a drag's end
    station.view.map.on_shape(shape, True)
    assert station.desk.map._preview.drawn
    wait(lambda: form.get_by_label("Size, m x").input_value() == "0.9", "the numbers of the pulled box")
    assert station.desk.session.content.map_edits == ()
    form.get_by_role("button", name="Add to the map").click()
    page.get_by_role("button", name="No-fly: <i>cable</i>").wait_for()
    edits = station.desk.project.map / "esdf" / "edits.json"
    assert [(edit.action, edit.name) for edit in esdf.load_edits(edits)] == [("no-fly", "<i>cable</i>")]
    page.keyboard.press("Control+z")
    page.get_by_text("None. Draw a box").wait_for()
    assert esdf.load_edits(edits) == ()


def test_what_another_person_made_of_a_zone_meanwhile_is_not_overwritten(page, station: GroundStation):
    session = station.desk.session
    shape = Shape("box", (3.0, 3.4, 0.5), (0.5, 0.5, 0.5))
    asked = {"serial": 0, "revision": session.revision, "shape": shape}
    session.edit(AddMapEdit(action="no-fly", name="cable", **asked), "Ada")
    page.keyboard.press("1")
    page.get_by_role("button", name="No-fly: cable").click()
    form = page.get_by_role("form", name="Edit of the map")
    form.get_by_label("Centre, m x").wait_for()
    wide = msgspec.structs.replace(shape, size_m=(1.5, 0.5, 0.5))
    asked = {"serial": 0, "revision": session.revision, "shape": wide}
    session.edit(ChangeMapEdit(edit=session.content.map_edits[0].id, **asked), "Ada")
    page.get_by_role("button", name="No-fly: cable").get_by_text("0.4 m³").wait_for()
    form.get_by_label("Name").fill("wire")
    form.get_by_role("button", name="Apply").click()
    form.get_by_role("alert").get_by_text("changed the same meanwhile").wait_for()
    (zone,) = session.document().map_edits
    assert (zone.name, zone.shape.size_m) == ("cable", (1.5, 0.5, 0.5))
    session.undo("Ada")
    session.undo("Ada")


def test_an_oblique_slice_stands_through_the_measured_points(station, page):
    page.keyboard.press("1")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Measure").click()
    wait(lambda: station.view.map.measuring, "measuring")
    a, b = np.array([1.0, 0.5, 0.4]), np.array([4.0, 2.5, 1.5])
    for point in (a, b):
        station.view.map.on_measure(triple(point))
    page.get_by_role("group", name="Axis of the slice").get_by_role("button", name="oblique").click()
    page.get_by_role("button", name="Through the two measured points").click()
    wait(lambda: station.view.map._slice is not None and station.view.map._slice.at_m != 0.0, "the slice")

    def misses() -> float:
        shown = station.view.map._slice
        return max(abs(float(slices.normal(shown) @ point) - shown.at_m) for point in (a, b))

    wait(lambda: misses() < 0.01, "the slice through both points")
    page.get_by_role("group", name="Axis of the slice").get_by_role("button", name="oblique").click()
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Measure").click()
    wait(lambda: station.view.map._slice is None and not station.view.map.measuring, "an end")
    page.keyboard.press("2")
