"""The page of a preflight: offline, the same from the same flights, and a scrubber that works from the keyboard."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

import esdf
import vehicle
from goshawk.commands.preflight import drawing
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, needs_chromium
from tests.goshawk.running import answer
from tests.waiting import PATIENCE_S


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """A plan that grazes a pillar in gusts, with its page and its result."""
    folder = tmp_path_factory.mktemp("page")
    os.symlink(pillar_map, folder / "map")
    vehicle.save(folder / "vehicle.toml", vehicle.example())
    (folder / "waypoints.csv").write_text("x,y,z\n0.8,0.8,1.0\n3.0,2.0,1.3\n5.2,0.8,1.0\n")
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    ended = answer("plan", folder / "waypoints.csv", *world, "--out", folder / "lap.json", "-q")
    assert ended.returncode == 0, ended.stderr
    for name in ("one", "two"):
        ended = answer(
            "preflight", folder / "lap.json", *world, "--flights", 40, "--risk", 0.1, "--gust-std", 4, "-q",
            "--report", folder / f"{name}.html", "--out", folder / f"{name}.json",
        )  # fmt: skip
        assert ended.returncode == 1, ended.stderr
    return folder


@pytest.fixture(scope="module")
def text(folder) -> str:
    return (folder / "one.html").read_text()


def test_the_page_loads_nothing_and_says_no_go_first(text):
    assert not re.search(r"https?:|\bsrc=|\bhref=|url\((?!#)|@import", text)
    assert "default-src 'none'" in text
    assert text.index("No-go: ") < text.index("<svg")


def test_the_same_flights_make_the_same_page(folder, text):
    assert text == (folder / "two.html").read_text()


def test_page_and_file_tell_the_same_worst_flights(folder, text):
    worst = json.loads((folder / "one.json").read_text())["worst"]
    drawn = json.loads(text.split('id="flights">')[1].split("</script>")[0])["tracks"]
    assert len(worst) == len(drawn) == 3
    assert worst[0]["touches"]
    for told, track in zip(worst, drawn, strict=True):
        i = track["closest"]
        assert told["clearance_m"] == pytest.approx(track["c"][i], abs=6e-4)
        assert told["point_world_m"] == pytest.approx([track["x"][i], track["y"][i], track["z"][i]], abs=6e-4)
        assert track["story"].startswith(f"Flight {told['number']} ")


def test_every_uncertainty_and_sentence_is_in_the_table_of_assumptions(folder, text):
    assumed = text[text.index("What was assumed") :]
    for said in ("mean wind", "4 m/s each axis", "lasting error of the pose", "2.0 cm", "rotor wear", "seed"):
        assert said in assumed
    for sentence in json.loads((folder / "one.json").read_text())["assumed"]:
        assert sentence.split("`")[0][1:40] in assumed


def test_a_page_is_not_replaced_unasked(folder):
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    ended = answer("preflight", folder / "lap.json", *world, "--flights", 5, "--report", folder / "one.html")
    assert ended.returncode == 2
    assert "--overwrite" in ended.stderr


def test_a_touch_has_a_colour_of_its_own_and_the_scale_ends_at_plenty():
    shade = drawing.shades(np.array([-1e-9, 0.0, 0.5 * drawing.PLENTY_M, drawing.PLENTY_M, np.inf]))
    assert shade.tolist() == [0, 1, 1 + drawing.SHADES // 2, drawing.SHADES, drawing.SHADES]


@pytest.mark.parametrize("limit", [0.0, 0.013, -0.031])
@pytest.mark.parametrize("bad_above", [False, True])
def test_red_bars_hold_exactly_what_is_beyond_the_limit(limit, bad_above):
    values = np.random.default_rng(3).normal(0.05, 0.06, 500)
    drawn = drawing.histogram("h", "clearance", "m", np.append(values, np.nan), limit, bad_above=bad_above)
    bars = [(kind, int(n)) for kind, n in re.findall(r"class='bar( bad)?'[^>]*><title>(\d+)</title>", drawn)]
    beyond = values > limit if bad_above else values < limit
    assert sum(n for kind, n in bars if kind) == beyond.sum() > 0
    assert sum(n for _, n in bars) == 500


def test_what_is_far_off_is_in_a_last_bar_that_says_so_and_what_is_not_known_in_none():
    values = np.array([0.5, 1.0, 1.5, 7.0, np.inf])
    drawn = drawing.histogram("h", "clearance", "m", values, 0.0, bad_above=False, most=2.0)
    assert sum(int(n) for n in re.findall(r"<title>(\d+)</title>", drawn)) == 4
    assert re.search(r"clearance \(m; last bar: (1\.9\d?|2) and more\)", drawn)
    assert "last bar" not in drawing.histogram("h", "clearance", "m", values[:3], 0.0, bad_above=False, most=2.0)
    assert drawing.histogram("h", "clearance", "m", np.full(9, np.inf), 0.0, bad_above=False, most=2.0) == ""


def test_a_beam_of_one_voxel_is_drawn_from_above_lightly_and_a_pillar_dark():
    state = np.full((40, 30, 20), esdf.FREE, np.uint8)
    state[10, :, 12] = esdf.OCCUPIED
    state[30, 5, :] = esdf.OCCUPIED
    grid = esdf.Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), state.shape)
    field = esdf.build(state, grid)
    drawn = "".join(drawing._ground(field, drawing.square(np.zeros(2), np.array([4.0, 3.0])), 0.0, 2.0))
    (partly,), (occupied,) = (re.findall(f"class='{kind}' d='([^']*)'", drawn) for kind in ("partly", "occupied"))
    assert partly.startswith("M1.0000 0.000h0.1050v3.000")
    assert occupied.startswith("M3.0000 0.500h0.1050v0.100")


def test_by_levels_the_page_says_that_its_flights_are_of_the_first(folder, tmp_path):
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml", "--gust-std", 2, "-q")
    report = ("--report", tmp_path / "rare.html", "--out", tmp_path / "rare.json")
    answer("preflight", folder / "lap.json", *world, "--rare", "--flights", 200, "--risk", 0.01, *report)
    said = (tmp_path / "rare.html").read_text()
    found = json.loads((tmp_path / "rare.json").read_text())
    risk = found["risk"]
    assert found["loss_shares"]
    assert "% of what loses flights" in said
    assert f"{risk['flights']} simulated flights by levels, the first of 200, of" in said
    assert f"t most {risk['upper95']:.1e} by {risk['levels']} levels" in said
    for heading in ("The worst flights", "How far from the limits", "How they end"):
        assert "of the first level" in said[said.index(heading) :].split("</section>")[0]


def test_nothing_that_was_asked_is_missing_among_the_assumptions(folder, text, tmp_path):
    assert "are not flown" not in text
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml", "-q", "--flights", 4)
    assert "<td>400 Hz, its C code</td><td>assumed</td>" in text
    asked = ("--rate", 500, "--thermals", 0.7, "--motor-fault", 0.23, "--pose-jump", 0.31)
    answer("preflight", folder / "lap.json", *world, *asked, "--report", tmp_path / "asked.html")
    assumed = (tmp_path / "asked.html").read_text().partition("What was assumed")[2]
    for said in ("0.7 m/s upwards at 10 m", "one loses 23 % of its thrust", "31 cm each axis", "full, and stays so"):
        assert said in assumed
    assert "<td>500 Hz, its C code</td><td>asked</td>" in assumed
    assert "--rate" not in assumed


@pytest.mark.parametrize(("low", "high"), [(0.0, 3.6), (-0.7, 2.7), (12.0, 13.0), (0.001, 0.002)])
def test_ticks_are_round_and_inside(low, high):
    found = drawing.ticks(low, high)
    assert 2 <= len(found) <= 7
    assert found[0] >= low - 1e-9
    assert found[-1] <= high + 1e-9
    assert np.ptp(np.diff(found)) < 1e-9


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize("width", [360, 1440])
def test_the_worst_flights_are_on_a_scrubber_that_the_keyboard_moves(folder, width):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        page = browser.new_page(viewport={"width": width, "height": 800})
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(f"file://{folder / 'one.html'}")
        before = page.locator("#v-time").inner_text()
        page.keyboard.press("ArrowLeft")
        after = page.locator("#v-time").inner_text()
        page.keyboard.press("2")
        chosen = page.locator("[data-choose='1']").get_attribute("aria-pressed")
        wide = page.evaluate("document.documentElement.scrollWidth")
        browser.close()
    assert float(after) < float(before)
    assert chosen == "true"
    assert wide <= width
    assert said == []
