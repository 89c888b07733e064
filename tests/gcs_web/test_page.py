"""The page in a real browser: save, upload, abort, foreign names; nothing leaves this machine."""

import re

from flight import project, trajectory
from tests.gcs_web.in_browser import cell, drawn, needs_chromium
from tests.waiting import until as wait

pytestmark = needs_chromium


def test_saving_writes_a_checked_trajectory(station, page):
    page.get_by_role("button", name="Save", exact=True).first.click()
    page.keyboard.press("Control+A")
    page.keyboard.type("lap-1")
    page.keyboard.press("Enter")
    path = station.desk.project.trajectory("lap-1")
    wait(path.exists, "the file")
    saved = trajectory.load(path)
    assert saved.checked
    assert saved.map_hash == station.desk.parts.map(station.desk.inputs).hash


def test_an_upload_is_compared_first_and_takes_a_held_button(station, page):
    page.get_by_role("button", name="Compare and upload").click()
    hold = page.get_by_role("button", name=re.compile("Hold to upload"))
    if not hold.is_visible():
        page.get_by_role("button", name=re.compile("Take control")).first.click()
    hold.wait_for()
    hold.focus()
    page.keyboard.down("Space")
    page.keyboard.up("Space")  # let go at once: nothing is sent
    drawn(page)
    assert station.watch.held() is None
    page.keyboard.down("Space")
    wait(lambda: station.watch.held() is not None, "the upload")
    page.keyboard.up("Space")
    page.get_by_role("status").get_by_text("read back and equal").wait_for()
    held = station.watch.held()
    assert held.crc32 == station.watch.planned(station.desk.checked(), station.desk.name).crc32


def test_abort_works_from_inside_a_field_and_is_answered(station, page):
    cell(page, 1, 2).dblclick()
    page.keyboard.press("Shift+Escape")
    wait(lambda: (station.desk.project.folder / ".session" / "audit.jsonl").is_file(), "the order's record")
    wait(lambda: '"abort"' in (station.desk.project.folder / ".session" / "audit.jsonl").read_text(), "the abort")


def test_a_foreign_name_is_shown_as_text(page):
    page.get_by_text("two <b>pillars</b>").first.wait_for()
    assert page.locator("header b").count() == 0


def test_the_projects_beside_this_one_are_listed_as_text(station, page):
    other = project.create(station.desk.project.folder.parent / "yard", "<i>yard</i>")
    page.get_by_title("Projects").click()
    dialog = page.get_by_role("dialog", name="Projects")
    dialog.get_by_text("<i>yard</i>").wait_for()
    assert dialog.get_by_role("button", name="Open <i>yard</i>").is_enabled()
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    (other.folder / "project.toml").unlink()
