"""Who came in stays in when the station is started anew, and nobody else comes in by that."""

import asyncio
import json
import stat
import time
from pathlib import Path

import aiohttp
import pytest

from gcs_web.gateway import entrants
from gcs_web.gateway.entrants import Entrants
from tests.gcs_web.station_process import StationProcess, new_project


def test_an_open_page_is_served_again_after_the_station_was_killed(tmp_path: Path, pillar_map):
    opened = new_project(tmp_path / "project", pillar_map)

    async def story() -> None:
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as page:
            with StationProcess(opened.folder) as first:
                await first.enter(page)
                port = first.port
                first.kill()
            with StationProcess(opened.folder, "--port", port) as again:
                async with page.get(f"{again.origin}/state") as answer:
                    assert answer.status == 200
                async with page.ws_connect(f"{again.origin}/ws", origin=again.origin) as socket:
                    assert json.loads((await socket.receive()).data)["type"] == "welcome"
                async with aiohttp.ClientSession() as stranger, stranger.get(f"{again.origin}/state") as answer:
                    assert answer.status == 403

    asyncio.run(story())


def test_the_file_lets_nobody_in_who_reads_it_and_only_its_owner_reads_it(tmp_path: Path):
    file = tmp_path / "entrants.json"
    cookie = Entrants(file).admit()
    assert cookie not in file.read_text()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    again = Entrants(file)
    assert again.knows(cookie)
    assert not any(again.knows(known) for known, _ in again.known)


def test_a_cookie_is_good_for_its_time_whatever_the_clock_does(tmp_path: Path, monkeypatch):
    known = Entrants(tmp_path / "entrants.json")
    cookie, now_s = known.admit(), time.time()
    for later_s, good in (
        (entrants.LIFE_S - 1.0, True),
        (entrants.LIFE_S + 1.0, False),
        (-entrants.LIFE_S - 1.0, False),
    ):
        monkeypatch.setattr(time, "time", lambda at_s=now_s + later_s: at_s)
        assert known.knows(cookie) is good


def test_the_oldest_cookie_is_forgotten_first(tmp_path: Path):
    known = Entrants(tmp_path / "entrants.json")
    cookies = [known.admit() for _ in range(entrants.MOST + 1)]
    assert [known.knows(cookie) for cookie in cookies] == [False] + entrants.MOST * [True]


@pytest.mark.parametrize("damaged", ["", "{", "[1]", '[["a"]]', "null"])
def test_a_damaged_file_asks_for_a_token_again(tmp_path: Path, damaged):
    (tmp_path / "entrants.json").write_text(damaged)
    known = Entrants(tmp_path / "entrants.json")
    assert not known.knows("")
    assert known.knows(known.admit())
