"""The 3D view is drawn plainly for who asks because of a slow machine, as the page measures it."""

import pytest

from gcs_web import GroundStation
from tests.gcs_web.in_browser import needs_chromium, opened
from tests.waiting import until as wait

pytestmark = needs_chromium
FAST = "WebGLRenderingContext.prototype.drawArrays = () => {}; WebGLRenderingContext.prototype.readPixels = () => {};"


@pytest.mark.parametrize(("script", "plain"), [("", True), (FAST, False)])
def test_a_machine_that_draws_slowly_is_measured_before_the_3d_view_is_loaded(
    station: GroundStation, browser, monkeypatch, script: str, plain: bool
):
    monkeypatch.setattr(station.view, "is_plain", False)
    new_context = browser.new_context

    def scripted(**given):
        context = new_context(**given)
        context.add_init_script(script)
        return context

    monkeypatch.setattr(browser, "new_context", scripted)
    with opened(station, browser, with_view=False) as page:
        page.get_by_title("3D view of map and path").wait_for(state="attached")
        wait(lambda: station.hub.people, "the page")
        assert station.view.is_plain == plain
