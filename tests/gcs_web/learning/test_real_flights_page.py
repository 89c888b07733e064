"""Real flights of a nano-drone on the page alone: dropped in, their columns taken, checked, fixed, to a verdict.

The set (`idsia-robotics/nanodrone-sysid-benchmark`) carries no licence, so nothing of it is in this repository: give
its folder, as CSV, in GOSHAWK_NANODRONE. Without it this test is skipped.
"""

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

import vehicle
from flight import flight_log, project
from gcs_web.learning import learning
from sysid.logs import fix
from sysid.report import words
from tests.gcs_web.in_browser import CHROMIUM, FLAGS
from tests.gcs_web.station_process import StationProcess
from tests.waiting import PATIENCE_S, goshawk

DATA = Path(os.environ.get("GOSHAWK_NANODRONE", ""))
FLIGHTS = ("square_20251017_run2", "square_20251017_run3")
"""To learn from, and to judge."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium"),
    pytest.mark.skipif(
        not (DATA / f"{FLIGHTS[0]}.csv.gz").is_file(),
        reason="needs real flights, which have no licence: GOSHAWK_NANODRONE=FOLDER",
    ),
]


@pytest.fixture
def opened(tmp_path: Path, pillar_map: Path) -> project.Project:
    """A project with what the vehicle's page says of it; the map is of another place and only stands behind."""
    made = project.create(tmp_path / "project", "nano-drone")
    shutil.copytree(pillar_map, made.map)
    sizes = ("--mass", 0.045, "--arm", 0.05, "--prop-diameter", 0.055, "--hover-rpm", 16600)
    done = goshawk("vehicle", "new", made.vehicle, *sizes)
    assert done.returncode == 0, done.stderr
    return made


def test_real_flights_come_to_a_verdict_on_the_page(opened: project.Project, tmp_path: Path):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, StationProcess(opened.folder) as station:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
        page.set_default_timeout(3000 * PATIENCE_S)
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))

        def picture(name: str) -> None:
            page.screenshot(path=tmp_path / f"{name}.png")

        page.goto(station.addresses()[-1])
        page.get_by_role("button", name=re.compile("Compare")).first.click()
        for name in FLIGHTS:
            page.get_by_label("Import log").set_input_files(DATA / f"{name}.csv.gz")
            page.get_by_role("heading", name=f"Columns of {name}.csv.gz").wait_for()
            picture("columns")
            page.get_by_role("button", name="Read with these columns").click()
            page.get_by_label(f"What {name} is for").wait_for()
        for name in FLIGHTS:
            page.get_by_role("button", name=re.compile(f"^{name} ")).click()
            page.get_by_role("group", name="Findings of the checks").get_by_role("button").first.wait_for()
            picture("findings")
            page.get_by_role("button", name="Apply the fixes to a new log").click()
            page.get_by_label(f"What {name}-fixed is for").wait_for()
        page.get_by_label(f"What {FLIGHTS[1]}-fixed is for").select_option("held-out")
        page.get_by_role("button", name=re.compile(f"^{FLIGHTS[1]}-fixed ")).click()
        page.get_by_text("Fixed:").first.wait_for()
        picture("fixed")
        page.get_by_text("Take the pieces between them as flights of their own").wait_for()  # jumps of the pose are out

        page.get_by_role("button", name="Compare with the model").click()
        page.get_by_role("heading", name=re.compile("^Residual")).wait_for()
        picture("compared")
        page.get_by_role("button", name="Find the missing effect").click()
        page.get_by_role("button", name="Find the missing effect").click()
        page.get_by_role("button", name="Diagnose again").wait_for()
        verdict = page.get_by_role("main", name="Learn").get_by_role("heading", level=2).first.inner_text()
        picture("verdict")
        ended = page.get_by_role("status").inner_text()
        browser.close()
    assert errors == []
    assert "failed" not in ended
    shown = json.loads(learning.diagnosis_file(opened.folder).read_bytes())
    verbs = by_the_verb(opened)
    said = words.named(verbs["verdict"], [c["name"] for c in verbs["candidates"]])  # the page names effects in words
    assert verdict == shown["verdict"] == f"{said[:1].upper()}{said[1:]}."
    assert shown["probability"] == pytest.approx(verbs["confidence"])
    assert [(c["name"], c["verdict"]) for c in shown["candidates"]] == [
        (c["name"], c["verdict"]) for c in verbs["candidates"]
    ]
    for name in FLIGHTS:
        fixed = flight_log.load(opened.flight(f"{name}-fixed"))
        assert fixed.metadata[fix.FIXES]
        assert fixed.metadata["fixed_from"] == f"{name}.parquet"
        assert vehicle.load(opened.vehicle).effects  # nothing was kept: the file is as it was made


def by_the_verb(opened: project.Project) -> dict[str, Any]:
    learn, held_out = (opened.flight(f"{name}-fixed") for name in FLIGHTS)
    options = ("--vehicle", opened.vehicle, "--held-out", held_out, "--auto", "--split-gaps", "--json")
    return json.loads(goshawk("diagnose", learn, *options).stdout)
