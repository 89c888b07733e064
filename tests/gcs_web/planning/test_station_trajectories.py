"""Trajectories of the project as the page keeps them: saved, restored, compared and shared."""

import asyncio
import re

import aiohttp
import numpy as np
import pytest

from flight import trajectory
from tests.gcs_web.station_socket import Page, visit
from tests.gcs_web.two_pillars import START
from tests.waiting import until

MARKUP = "<img src=x onerror=alert(1)>"


pytestmark = pytest.mark.usefixtures("same_waypoints")


def test_a_saved_plan_is_checked_and_never_replaced_unasked(station):
    async def talk(page: Page):
        await page.checked()
        assert not (await page.command("save", name="lap-1"))["error"]
        saved = trajectory.load(station.desk.project.trajectory("lap-1"))
        assert saved.checked
        assert saved.map_hash == station.desk.parts.map(station.desk.inputs).hash
        assert 'or "Overwrite" to replace it' in (await page.command("save", name="lap-1"))["error"]
        assert not (await page.command("save", name="lap-1", overwrite=True))["error"]
        assert "kept as lap-1.json.old-1" in page.notices[-1]
        for name in ("../../../x", "<iframe srcdoc=x>", "", ".hidden", "a/b"):
            assert "cannot be a name" in (await page.command("save", name=name))["error"]
        await page.until(lambda p: [t["name"] for t in p.state["files"]["trajectories"]] == ["lap-1"])
        await page.command("discard", name="lap-1")
        await page.until(lambda p: p.state["files"]["trajectories"] == [])

    visit(station, 1, talk)


def test_a_discarded_or_replaced_trajectory_is_restored_and_never_over_another(station):
    async def talk(page: Page):
        def bin_names(p: Page) -> list[str]:
            return [each["file"] for each in p.state["files"]["bin"]]

        await page.checked()
        assert not (await page.command("save", name="lap-7"))["error"]
        first = station.desk.project.trajectory("lap-7").read_bytes()
        assert not (await page.command("discard", name="lap-7"))["error"]
        await page.until(lambda p: "lap-7.json.old-1" in bin_names(p))
        assert not (await page.command("save", name="lap-7"))["error"]
        assert "discard that one first" in (await page.command("restore", file="lap-7.json.old-1"))["error"]
        await page.command("discard", name="lap-7")
        assert not (await page.command("restore", file="lap-7.json.old-1"))["error"]
        await page.until(lambda p: bin_names(p)[:1] == ["lap-7.json.old-2"])
        assert station.desk.project.trajectory("lap-7").read_bytes() == first
        for file in ("lap-7.json.old-9", "../project.toml", "lap-7.json", MARKUP):
            assert "is not in the bin" in (await page.command("restore", file=file))["error"]
        await page.command("discard", name="lap-7")

    visit(station, 1, talk)


def test_two_trajectories_are_compared_for_the_map_and_the_vehicle_as_they_are_now(station):
    async def talk(page: Page):
        await page.checked()
        await page.command("save", name="fast", overwrite=True)
        await page.edit("choose", speed_m_s=1.5)
        await page.checked()
        fast, slow = (await page.command("compare_plans", names=["fast", ""]))["plans"]
        await page.command("undo")
        assert fast["passes"]
        assert slow["passes"]
        assert slow["duration_s"] > fast["duration_s"]
        assert slow["top_speed_m_s"] <= 1.5 < fast["top_speed_m_s"]
        direct_m = np.linalg.norm(np.diff(START, axis=0), axis=1).sum()
        assert fast["length_m"] >= direct_m - 0.1
        for plan in (fast, slow):
            clearance = next(limit for limit in plan["limits"] if limit["name"] == "clearance")
            assert clearance["value"] >= clearance["bound"]
        assert "nowhere" in (await page.command("compare_plans", names=["nowhere", ""]))["error"]
        assert "choose two" in (await page.command("compare_plans", names=[""] * 9))["error"]
        await page.command("discard", name="fast")

    visit(station, 1, talk)


def test_a_plan_is_shared_as_one_file_that_asks_nobody(station):
    async def visit_share() -> None:
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
            origin = station.url.split("/?")[0]
            async with browser.get(f"{origin}/share") as refused:
                assert refused.status == 403  # nobody who was not let in
            async with browser.get(station.url):
                pass
            async with browser.get(f"{origin}/share") as answer:
                text = await answer.text()
                assert answer.headers["Content-Disposition"] == f"attachment; filename*=UTF-8''{station.desk.name}.html"
            assert "passes the gate" in text
            shades = re.findall(r'stroke="(#[0-9a-f]{6})" stroke-width="3"', text)
            assert len(set(shades)) > 3  # coloured by clearance
            assert not re.search(r"(src|href|action)=|url\(|@import|<script", text)
            for name in ("nowhere", "../waypoints", MARKUP):
                async with browser.get(f"{origin}/share", params={"name": name}) as answer:
                    assert answer.status == 404
                    assert answer.content_type == "text/plain"

    until(
        lambda: (
            station.desk.answer is not None and station.desk.answer.request.revision == station.desk.session.revision
        )
    )
    asyncio.run(visit_share())
