"""No text of the page is long before somebody opens it, however long the station's sentences are."""

import pytest

from gcs_web import GroundStation
from gcs_web.protocol.flights import Finding, FlightCard, Flights
from gcs_web.protocol.learning import Candidate, Diagnosis
from gcs_web.protocol.plan import Plan, Problem
from tests.gcs_web.in_browser import drawn, needs_chromium
from tests.waiting import until as wait

pytestmark = needs_chromium
MOST = 25
LONG = "The gyro's clock, which nothing in this flight turned fast enough to compare, is not checked, and " + " ".join(
    ["so is its delay"] * 12
)
TEXTS = """() => {
  const blocks = "p, li, dt, dd, td, th, h1, h2, h3, button, label, figcaption, summary, legend, div";
  const found = [];
  for (const each of document.querySelectorAll(blocks)) {
    if (each.querySelector(blocks.replace(", button", "")) || !each.checkVisibility()) continue;
    const shut = [...each.querySelectorAll("select")].reduce(  // of a closed list only what is chosen is shown
      (text, select) => text.replace(select.innerText, select.selectedOptions[0]?.text ?? ""), each.innerText);
    const text = shut.trim();
    found.push([text.split(/\\s+/).length, text]);
  }
  return found.sort((a, b) => b[0] - a[0]);
}"""


def longest(page) -> tuple[int, str]:
    drawn(page)
    return tuple(page.evaluate(TEXTS)[0])


@pytest.mark.parametrize("width", [1440, 360])
def test_every_text_that_is_shown_unopened_has_at_most_25_words(station: GroundStation, page, width: int):
    page.set_viewport_size({"width": width, "height": 900})
    revision = station.desk.session.revision
    station.hub.publish(Plan(revision, "refused", LONG, problem=Problem(f"{LONG} here", LONG, None)))
    card = FlightCard(
        "lap", "ready", "learn", duration_s=5.0, tracking_mean_m=0.1,
        findings=[Finding("warning", f"{LONG} in a gap", LONG, fixable=False, spans_s=[])],
        inconclusive=[LONG], notes=[LONG],
    )  # fmt: skip
    station.hub.publish(Flights([card]))
    candidates = [
        Candidate(f"effect {k}", f"an effect of number {k}", "excluded", LONG, 0.0, "F = 0", [], 0.0, [], "", None)
        for k in range(25)
    ]
    station.hub.publish(Diagnosis("current", LONG, 0.5, LONG, LONG, "usable", ["lap"], candidates=candidates))
    station.desk.notice(LONG)
    page.get_by_text("The gyro's clock").first.wait_for()
    for step in ("0", "1", "2", "3", "4", "5"):
        page.keyboard.press(step)
        words, text = longest(page)
        assert words <= MOST, f"step {step}: {words} words: {text}"
    page.keyboard.press("2")
    page.get_by_role("region", name="Verdict").get_by_role("button", name="More").first.click()
    wait(lambda: longest(page)[0] > MOST, "the text that was opened")


def test_after_a_refusal_no_panel_is_blank(station: GroundStation, page):
    station.hub.publish(
        Plan(station.desk.session.revision, "refused", "No path.", problem=Problem("Too near.", "", None))
    )
    station.hub.publish(Diagnosis("none"))
    page.get_by_text("No path: the plan was refused.").wait_for()
    page.keyboard.press("5")
    page.get_by_role("region", name="Before the first diagnosis").wait_for()
