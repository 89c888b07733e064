"""Flights as spectra and one stream against another, and what is taken away of them, in Chromium."""

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import vehicle
from flight import FlightLog, flight_log, project
from gcs_web import GroundStation
from tests.gcs_web.in_browser import SERIOUS, drawn, needs_chromium, visited
from tests.waiting import until as wait
from vehicle import flights, manoeuvres

pytestmark = needs_chromium
TONE_HZ = 32.0
"""At one of the frequencies that a flight of four seconds has in its spectrum."""
KINDS = "Kind of plot"


def shaken() -> FlightLog:
    """A weave with a vibration in its roll rate."""
    weave = manoeuvres.from_legs(x=[(2.0, 7.0), (2.0, -7.0)], y=[(4.0, 0.0)], z=[(4.0, 0.0)])
    truth = vehicle.example()
    log = flights.measure(flights.fly_trajectory(truth, weave), rng=np.random.default_rng(5))
    shake = 3.0 * np.sin(2.0 * np.pi * TONE_HZ * log.time_s)
    return FlightLog({**log.columns, "rate_body_x_rad_s": log.columns["rate_body_x_rad_s"] + shake}, log.metadata)


@pytest.fixture(scope="module")
def station(tmp_path_factory) -> Iterator[GroundStation]:
    opened = project.create(tmp_path_factory.mktemp("study") / "hall", "hall")
    vehicle.save(opened.vehicle, vehicle.example())
    opened.flight("a").parent.mkdir(exist_ok=True)
    for name in ("a", "b"):
        flight_log.save(opened.flight(name), shaken())
    with GroundStation(opened.folder, triangles=500) as running:
        yield running


@pytest.fixture
def page(station, one_tab):
    with visited(station, one_tab) as opened:
        opened.get_by_text("Saved, revision").wait_for()
        opened.keyboard.press("4")
        opened.get_by_role("button", name=re.compile("^a"), pressed=True).or_(
            opened.get_by_role("button", name=re.compile("^b"), pressed=True)
        ).wait_for()
        choose(opened, "position_x")
        opened.get_by_role("img", name="Position x over time").wait_for()
        yield opened


def choose(page, name: str) -> None:
    """A stream that is drawn from now on, or no more."""
    page.get_by_label("Add or remove a stream").select_option(name)


def test_a_vibration_stands_in_the_spectrum_at_its_frequency(page):
    choose(page, "position_x")  # no more
    choose(page, "rate_x")
    page.keyboard.press("x")
    page.get_by_role("button", name="Spectrum", pressed=True).wait_for()
    picture = page.get_by_role(
        "img", name=re.compile(rf"^Spectrum of Body rate x.*against Frequency, Hz.*{TONE_HZ} Hz")
    )
    picture.wait_for()
    assert picture.evaluate("img => img.decode().then(() => img.naturalWidth)") > 300


def test_a_spectrogram_is_a_picture_over_time_and_frequency(page):
    choose(page, "position_x")  # no more
    choose(page, "rate_x")
    page.get_by_role("group", name=KINDS).get_by_role("button", name="Spectrogram").click()
    picture = page.get_by_role("img", name=re.compile("^Spectrogram of.*Body rate x: frequency, Hz against Time, s"))
    picture.wait_for()
    assert "data:image/png" in picture.evaluate("img => decodeURIComponent(img.src)")


def test_a_formula_is_drawn_refused_in_words_and_brought_back_by_the_link(page):
    choose(page, "formula")
    box = page.get_by_role("textbox", name="Formula of the log's columns")
    box.fill("__import__('os')")
    page.keyboard.press("Enter")
    page.get_by_role("alert").get_by_text(re.compile("may stand in it|the functions are")).wait_for()
    box.fill("hypot(position_world_x_m, position_world_y_m)")
    page.keyboard.press("Enter")
    plot = page.get_by_role("img", name="hypot(position_world_x_m, position_world_y_m) over time")
    plot.wait_for()
    wait(lambda: "formula" in page.evaluate("location.hash"), "the address")
    page.reload()
    plot.wait_for()


def test_a_flight_has_a_note_and_a_name_that_people_gave_it(page, station):
    page.get_by_role("textbox", name="Note").fill("gusts <b>from</b> the door")
    page.get_by_role("textbox", name="Name").fill("windy")
    page.keyboard.press("Enter")
    page.get_by_role("button", name=re.compile("^windy"), pressed=True).wait_for()
    (card,) = (each for each in station.desk.flights.listed() if each.name == "windy")
    assert card.note == "gusts <b>from</b> the door"
    old = ({"a", "b"} - {each.name for each in station.desk.flights.listed()}).pop()
    station.desk.flights.rename("windy", old)


def test_two_streams_stand_against_each_other_and_a_link_brings_them_back(page, station):
    page.get_by_role("group", name=KINDS).get_by_role("button", name="x-y").click()
    page.get_by_label("Stream along x").select_option("position_x")
    page.get_by_label("Stream along y").select_option("rate_x")
    picture = page.get_by_role("img", name="x-y of Body rate x, °/s against Position x, m")
    picture.wait_for()
    wait(lambda: "plot=xy" in page.evaluate("location.hash"), "the address")
    page.reload()
    picture.wait_for()
    assert page.get_by_label("Stream along x").input_value() == "position_x"


def test_what_is_too_short_for_a_spectrum_says_so_and_what_helps(page):
    page.goto(re.sub(r"#.*", "", page.url) + "#step=4&plot=spectrum&streams=rate_x&from_to=1.0|1.1")
    page.reload()
    page.get_by_role("status").get_by_text(re.compile("a spectrum needs 64: zoom out")).wait_for()


def saved(page, kind: str, to: Path) -> Path:
    with page.expect_download() as found:
        page.get_by_label("Save plots or data").select_option(kind)
    path = to / found.value.suggested_filename
    found.value.save_as(path)
    return path


def test_plots_are_saved_as_svg_and_png(page, tmp_path):
    page.get_by_role("button", name=re.compile("^b")).first.click()
    choose(page, "rate_x")
    page.get_by_role("img", name="Body rate x over time").wait_for()
    drawn(page)
    svg = saved(page, "svg", tmp_path)
    root = ElementTree.fromstring(svg.read_text())
    lines = [path for path in root.iter("{http://www.w3.org/2000/svg}path") if path.get("d", "").count("L") > 50]
    assert len(lines) == 2
    words = "".join(root.itertext())
    assert "Body rate x, °/s" in words
    assert "Time, s" in words
    png = saved(page, "png", tmp_path)
    assert png.read_bytes().startswith(b"\x89PNG")
    assert png.suffix == ".png"


def test_data_are_saved_as_every_sample_of_the_shown_stretch(page, station, tmp_path):
    page.get_by_role("button", name=re.compile("^a")).first.click()
    choose(page, "rate_x")
    page.get_by_role("img", name="Body rate x over time").wait_for()
    choose(page, "column:position_world_x_m")
    path = saved(page, "csv", tmp_path)
    head, *rows = csv.reader(path.read_text().splitlines())
    log = flight_log.load(station.desk.project.flight("a"))
    assert head[:2] == ["log_time_s", "plot_time_s"]
    column = head.index("column:position_world_x_m [m]")
    assert len(rows) == len(log)
    np.testing.assert_allclose([float(row[column]) for row in rows], log.columns["position_world_x_m"], atol=1e-5)


def test_a_browser_that_is_not_let_in_gets_no_data(page, station):
    address = station.url.split("?")[0] + "data?flight=a&streams=rate_x&from=0&to=1"
    assert page.request.get(address).status == 200
    assert page.request.get(address.replace("flight=a", "flight=..%2Fa")).status == 404
    for other in ("from=x", "from=nan", "from=1"):
        assert page.request.get(address.replace("from=0", other)).status == 404
    many = "|".join(f"s{i}" for i in range(65))
    assert page.request.get(address.replace("streams=rate_x", f"streams={many}")).status == 404
    repeated = page.request.get(address.replace("streams=rate_x", "streams=rate_x|rate_x"))
    assert repeated.body() == page.request.get(address).body()
    page.context.clear_cookies()
    assert page.request.get(address).status == 403


@pytest.mark.parametrize("size", [(360, 740), (768, 1024), (1440, 900)])
def test_the_plots_are_in_the_window_and_nothing_is_a_barrier(page, size, tmp_path):
    from axe_playwright_python.sync_playwright import Axe

    page.set_viewport_size({"width": size[0], "height": size[1]})
    for kind in ("Spectrum", "x-y"):
        page.get_by_role("group", name=KINDS).get_by_role("button", name=kind).click()
        picture = page.get_by_role("img", name=re.compile(f"^{kind}"))
        picture.wait_for()
        drawn(page)
        box = picture.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= size[0]
        page.screenshot(path=tmp_path / f"{kind}.png")
    found = [rule["id"] for rule in Axe().run(page).response["violations"] if rule["impact"] in SERIOUS]
    assert found == []
