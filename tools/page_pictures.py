"""The page as it looks in a browser, light and dark: for tools/pictures.py.

A copy of the demo's project is served and driven as a person would; nothing of it stays.
"""

import io
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from flight import InputError

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

WIDTH, HEIGHT = 1440, 900
FLAGS = ("--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""3D without a graphics card."""
PATIENCE_MS, JOB_MS, DRAWN_MS = 180_000, 600_000, 20_000
"""For a step of a scene; for a comparison or a diagnosis beside other work; for the mesh, which comes in pieces, and
nothing on the page says when it is whole."""
REFUSED = ".verdict.refused, .verdict.void, .job.failed, .notice .danger-text, [role=alert]"
"""What a refusal looks like: of a plan, a job, an act, a form."""
HELD_OUT, LEARNED = "walk", "walk-learned"
"""The demo's flight that judges; the one flown with what was learned."""
_ADDRESS = re.compile(r"https?://\S+/\?token=\S+")


def reach(page: "Page", wanted: "Locator", patience_ms: float = PATIENCE_MS) -> None:
    """Wait for what a scene needs next.

    Raises:
        InputError: the page refuses instead; with the sentence that it shows.
    """
    refusal = page.locator(REFUSED)
    wanted.or_(refusal).first.wait_for(timeout=patience_ms)
    if not wanted.is_visible():
        raise InputError(f"a scene ends at a refusal: {' '.join(refusal.first.inner_text().split())}")


def checked(page: "Page") -> None:
    """The plan is planned and has passed its checks."""
    reach(page, page.get_by_role("region", name="Verdict").get_by_text("Checked", exact=True))


def step(page: "Page", name: str) -> None:
    page.get_by_role("navigation", name="Steps").get_by_role("button", name=re.compile(name)).click()


def the_plan(page: "Page") -> None:
    """The step Plan, as it opens."""
    checked(page)
    page.wait_for_load_state("networkidle")
    page.wait_for_timeout(DRAWN_MS)


def the_map(page: "Page") -> None:
    """The step Map with a no-fly box that is drawn, not yet applied."""
    the_plan(page)
    step(page, "Map")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Box").click()
    form = page.get_by_role("form", name="New edit of the map")
    form.get_by_label("Name").fill("workbench")
    form.get_by_label("Size, m x").fill("1.2")
    form.get_by_label("Size, m x").press("Enter")
    reach(page, form.get_by_text("no longer free"))
    page.wait_for_timeout(DRAWN_MS)


def mission(page: "Page") -> None:
    """Two laps of the demo's path, a landing and a point to look at."""
    the_plan(page)
    page.get_by_role("tab", name="Mission").click()
    page.get_by_role("checkbox", name="Closed loop").click()
    laps = page.get_by_role("textbox", name="Laps")
    laps.fill("2")
    laps.press("Enter")
    reach(page, page.get_by_role("region", name="Verdict").get_by_text("2 laps"))
    page.get_by_role("checkbox", name="Landing").click()
    for axis in "xy":  # where the floor of the map is flat: at the first image
        place = page.get_by_role("region", name="Landing").get_by_label(axis, exact=True)
        place.fill("0")
        place.press("Enter")
    page.get_by_role("radio", name="To a point").click()
    page.get_by_label("Look at x").wait_for()
    page.wait_for_timeout(DRAWN_MS // 4)  # the last change is being planned
    checked(page)


def judged(page: "Page") -> None:
    """The step Compare with the flight that judges."""
    step(page, "Compare")
    page.get_by_label(f"What {HELD_OUT} is for").select_option("held-out")


def compare(page: "Page") -> None:
    """Where the model fails, and the moments of it on the timeline."""
    the_plan(page)
    judged(page)
    page.get_by_role("button", name="Compare with the model").click()
    reach(page, page.get_by_role("heading", name=re.compile("^Residual")), JOB_MS)
    page.get_by_role("img", name=re.compile(r"^Residual . in|^Residual ._. in")).click(position={"x": 250, "y": 80})
    reach(page, page.get_by_text("of the open flights, shaded"))


def learn(page: "Page") -> None:
    """The missing effect, tried and not kept yet."""
    judged(page)
    page.get_by_label(f"What {LEARNED} is for").select_option("left out")
    step(page, "Learn")
    reach(page, page.get_by_text("2 flights to learn from, 1 held out"))
    page.get_by_role("button", name="Find the missing effect").click()
    reach(page, page.get_by_role("button", name="Diagnose again"), JOB_MS)
    page.get_by_role("button", name="Try: refit with it").first.click()
    reach(page, page.get_by_role("button", name=re.compile("^Keep as version")), JOB_MS)


SCENES: dict[str, Callable[["Page"], None]] = {
    "ground_station": the_plan,
    "ground_station_map": the_map,
    "ground_station_mission": mission,
    "ground_station_compare": compare,
    "ground_station_learn": learn,
}
NAMES = tuple(SCENES)


def shots(demo: Path, name: str) -> Iterator[tuple[str, Image.Image]]:
    """Name and image of a scene in both styles.

    Raises:
        InputError: there is no Chromium, or the page refuses what the scene needs, or takes too long.
    """
    from playwright.sync_api import Error, sync_playwright

    chromium = shutil.which("chromium")
    if chromium is None:
        raise InputError("pictures of the page need Chromium: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        project = shutil.copytree(demo, Path(folder) / "room")
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS), timeout=PATIENCE_MS)
        with served(project) as address:
            page = browser.new_page(
                viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light", reduced_motion="reduce"
            )
            page.set_default_timeout(PATIENCE_MS)
            try:
                page.goto(address)
                page.get_by_text("Saved, revision").wait_for()  # until then the page says that it is connecting
                SCENES[name](page)
            except Error as error:
                raise InputError(f"the scene {name} came to no end: {error.message}") from error
            for style in ("light", "dark"):
                page.emulate_media(color_scheme=style)
                page.mouse.move(5.0, 5.0)  # nothing is pointed at
                page.wait_for_timeout(DRAWN_MS // 4)
                yield f"{name}_{style}", Image.open(io.BytesIO(page.screenshot()))
        browser.close()


@contextmanager
def served(project: Path) -> Iterator[str]:
    """The address of a ground station with a project."""
    command = [sys.executable, "-u", "-m", "goshawk", "gcs", str(project), "--port", "0"]
    station = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert station.stdout is not None
    try:
        for line in station.stdout:
            if address := _ADDRESS.search(line):
                yield address[0]
                return
        raise InputError(f"goshawk gcs {project} ended without an address; run it by hand to see why")
    finally:
        station.terminate()
        station.wait()
