"""An effect file of the user's own is code: shown, agreed to by its hash, asked for again when it changes."""

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FormatError, InputError, Progress, Waypoints, project, silent
from gcs_web import GroundStation
from gcs_web.jobs.job_process import Done, Failed, JobProcess
from gcs_web.learning import consent
from gcs_web.learning.consent import Consent
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, SERIOUS, SIZE, without_view
from tests.gcs_web.station_socket import Page, visit
from tests.gcs_web.two_pillars import START, add_map
from tests.waiting import PATIENCE_S, goshawk

EFFECT = '''"""{words}"""
from pathlib import Path

from vehicle.effects.base import Effect, Spec, Stage

Path({mark!r}).open("a").write("ran ")


def apply(flow, p):
    flow.force_n[1] -= p.drag_kg_m * flow.velocity_m_s[1]


EFFECT = Effect(name={name!r}, number=0, stage=Stage.FORCE, apply=apply,
    parameters=(Spec("drag_kg_m", "N s/m", prior=0.02, bounds=(0.0, 1.0)),),
    law="F_y = -c v_y", source="here", channel="F_y", regressor="v_y", excited_by=("fast_level",))
'''
MODEL = {"effects": []}
MARKUP = "</pre><script>alert(1)</script>"


@pytest.fixture
def mark(tmp_path: Path) -> Path:
    """A file that the effect writes when it is run."""
    return tmp_path / "mark"


@pytest.fixture
def text(request: pytest.FixtureRequest, mark: Path) -> Callable[[str], str]:
    """An effect file with these words in it; each test has an effect of its own, as they share a process."""
    name = f"guard_{hashlib.sha256(request.node.name.encode()).hexdigest()[:8]}"
    return lambda words: EFFECT.format(words=words, mark=str(mark), name=name)


@pytest.fixture
def opened(pillar_map: Path, tmp_path: Path, mark: Path, text) -> project.Project:
    """A project whose vehicle file names an effect file."""
    made = project.create(tmp_path / "project", "consent")
    add_map(made, pillar_map)
    project.save_waypoints(made.waypoints, Waypoints(START, np.full(3, np.nan)))
    guard = made.folder / "consent_guard.py"
    guard.write_text(text(MARKUP))
    vehicle.save(made.vehicle, vehicle.example().with_effect_file(guard))
    mark.unlink()
    return made


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_nothing_runs_before_somebody_agrees_and_a_changed_file_asks_again(opened, mark, text):
    guard = opened.folder / "consent_guard.py"

    async def talk(page: Page):
        await page.until(lambda p: p.state["plan"]["state"] == "refused")
        assert "nobody has agreed" in page.state["plan"]["sentence"]
        await page.until(lambda p: "effect_files" in p.state)
        (file,) = page.state["effect_files"]["files"]
        assert (file["path"], file["sha256"], file["agreed"]) == (str(guard), digest(guard), False)
        assert MARKUP in file["text"]
        refused = await page.command("agree_to_effect_file", path=str(guard), sha256="0" * 64)
        assert "changed since it was shown" in refused["error"]
        foreign = await page.command("agree_to_effect_file", path=str(opened.vehicle), sha256=digest(opened.vehicle))
        assert "no effect file of this project" in foreign["error"]
        assert not mark.exists()
        assert (await page.command("agree_to_effect_file", path=str(guard), sha256=digest(guard)))["error"] == ""
        await page.until(lambda p: p.state["effect_files"]["files"][0]["agreed"])
        await page.until(lambda p: any(name.startswith("guard_") for name in p.state.get("model", MODEL)["effects"]))
        await page.checked()
        mark.unlink()
        guard.write_text(text("changed"))
        await page.until(lambda p: p.state["plan"]["state"] == "void")
        await page.until(lambda p: p.state["effect_files"]["files"][0]["changed"])
        await page.command("plan_again")
        await page.until(lambda p: p.state["plan"]["state"] == "refused")
        assert not mark.exists()

    with GroundStation(opened.folder, triangles=500) as station:
        visit(station, 1, talk)
        agreed = digest(guard)
        lines = (opened.folder / ".session" / "audit.jsonl").read_text().splitlines()
    said = [line for line in map(json.loads, lines) if line["what"] == "run effect file"]
    assert [line["answer"].split(":")[0] for line in said] == ["refused", "refused", "done"]
    assert (said[-1]["path"], said[-1]["sha256"] != agreed) == (str(guard), True)
    assert vehicle.load(opened.vehicle).effects[-1].startswith("guard_")  # not asked any more when it has ended


def load_vehicle(folder: Path, _: object, __: Progress) -> str:
    return vehicle.load(project.Project(folder, "").vehicle).name


def test_jobs_and_verbs_that_the_station_starts_do_not_run_it_behind_the_page(opened, mark, tmp_path):
    guard = opened.folder / "consent_guard.py"
    with closing(Consent(opened)) as asked:
        behind = JobProcess(load_vehicle, opened.folder, None, tmp_path / "job.log").outcome(silent)
        verb = goshawk("vehicle", "show", opened.vehicle)
        assert isinstance(behind, Failed)
        assert "nobody has agreed" in behind.reason
        assert "nobody has agreed" in verb.stderr
        assert not mark.exists()
        asked.agree(str(guard), digest(guard))
        assert JobProcess(load_vehicle, opened.folder, None, tmp_path / "job.log").outcome(silent) == Done("rigter2019")
    assert mark.exists()


def test_a_consent_does_not_come_along_with_a_project(opened, mark):
    guard = opened.folder / "consent_guard.py"
    with closing(Consent(opened)) as asked:
        asked.agree(str(guard), digest(guard))
        assert [file.agreed for file in asked.files()] == [True]
    with closing(Consent(opened)) as again:
        assert [file.agreed for file in again.files()] == [False]
        with pytest.raises(FormatError, match="nobody has agreed"):
            vehicle.load(opened.vehicle)
    assert not mark.exists()
    assert vehicle.load(opened.vehicle)
    assert mark.exists()


def test_nothing_runs_between_two_projects_of_one_station(opened, mark):
    guard = opened.folder / "consent_guard.py"
    vehicle.effects.run_only(())  # as `goshawk gcs` begins
    try:
        with closing(Consent(opened)) as asked:
            asked.agree(str(guard), digest(guard))
        with pytest.raises(FormatError, match="nobody has agreed"):  # a thread of the first project that ends late
            vehicle.load(opened.vehicle)
        assert not mark.exists()
    finally:
        vehicle.effects.run_any()


def test_the_next_project_may_have_another_effect_of_the_same_name(opened, mark, text, tmp_path):
    other = project.create(tmp_path / "other", "another")
    shutil.copy(opened.vehicle, other.vehicle)
    guard = other.folder / "consent_guard.py"
    guard.write_text(text("another text"))
    vehicle.effects.forget_files(vehicle.effects.from_files())
    for each in (opened, other):
        with closing(Consent(each)) as asked:
            (file,) = asked.files()
            asked.agree(file.path, file.sha256)
            assert vehicle.load(each.vehicle).effects[-1].startswith("guard_")


def test_what_cannot_be_shown_as_it_is_cannot_be_agreed_to(opened, mark):
    guard = opened.folder / "consent_guard.py"
    with closing(Consent(opened)) as asked:
        hidden = b"# coding: utf-7\n# +AAo-import os\n"  # Python would read a second line of code here
        long = b"#" * (consent.LARGEST_BYTES + 1)
        for content, said in ((b"# caf\xe9", "not UTF-8"), (hidden, "utf-7, not UTF-8"), (long, "more than")):
            guard.write_bytes(content)
            (file,) = asked.files()
            assert said in file.problem
            assert file.text == file.sha256 == ""
            with pytest.raises(InputError, match=said):
                asked.agree(str(guard), digest(guard))
        secret = opened.folder / "secret.txt"
        secret.write_text("a key")
        opened.vehicle.write_text(opened.vehicle.read_text().replace("consent_guard.py", "secret.txt"))
        (file,) = asked.files()
        assert "no Python file" in file.problem
        assert "a key" not in file.text


def test_characters_that_show_nothing_or_turn_the_text_are_written_out():
    hidden = "x = 1\r\n\ty\u202e\u200b\x0cz\r"
    assert consent.visible(hidden) == "x = 1\n\ty<U+202E><U+200B><U+000C>z<U+000D>"


def test_a_vehicles_hash_tells_two_texts_of_one_effect_apart(opened, mark):
    before = vehicle.vehicle_hash(vehicle.load(opened.vehicle))
    assert before == vehicle.vehicle_hash(vehicle.load(opened.vehicle))
    guard = opened.folder / "consent_guard.py"
    guard.write_text(guard.read_text().replace("flow.force_n[1] -=", "flow.force_n[1] -= 2.0 *"))
    assert vehicle.vehicle_hash(vehicle.load(opened.vehicle)) != before


def test_a_station_of_a_vehicle_without_such_files_asks_nothing(opened):
    vehicle.save(opened.vehicle, vehicle.example())
    with closing(Consent(opened)) as asked:
        assert asked.files() == []
        assert vehicle.load(opened.vehicle)
    assert not any("EFFECT_FILES" in name for name in os.environ)


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")
def test_the_page_shows_the_text_asks_and_goes_on_once_somebody_agreed(opened, mark):
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import sync_playwright

    guard = opened.folder / "consent_guard.py"
    with GroundStation(opened.folder, triangles=500) as station, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        page = without_view(browser.new_context(viewport=SIZE, reduced_motion="reduce")).new_page()
        page.set_default_timeout(1000 * PATIENCE_S)
        alerts: list[str] = []
        page.on("dialog", lambda dialog: (alerts.append(dialog.message), dialog.dismiss()))
        page.goto(station.url)
        asked = page.get_by_role("dialog", name=re.compile("Run this file"))
        asked.get_by_text(MARKUP).wait_for()
        asked.get_by_text(str(guard)).wait_for()
        asked.get_by_text(digest(guard)).wait_for()
        barriers = Axe().run(page, context={"exclude": [["iframe"]]}).response["violations"]  # viser's own page
        assert [rule["id"] for rule in barriers if rule["impact"] in SERIOUS] == []
        page.keyboard.press("Escape")
        asked.wait_for(state="hidden")
        page.keyboard.press("5")
        page.get_by_role("button", name="Look at it").click()
        assert not mark.exists()
        page.get_by_role("button", name="Run consent_guard.py").click()
        asked.wait_for(state="hidden")
        page.get_by_role("cell", name=re.compile("guard .*drag")).wait_for()
        assert alerts == []
        assert mark.exists()
        browser.close()
