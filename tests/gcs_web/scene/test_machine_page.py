"""Less is drawn in the 3D view where a machine is slow, as the page measures it: at the start, and from then on."""

import numpy as np
import pytest

from gcs_web import GroundStation
from gcs_web.map import display_mesh
from tests.gcs_web.in_browser import needs_chromium, opened, tab, visited
from tests.waiting import until as wait

pytestmark = needs_chromium
FAST = "WebGLRenderingContext.prototype.drawArrays = () => {}; WebGLRenderingContext.prototype.readPixels = () => {};"


@pytest.mark.parametrize(("script", "plain"), [("", True), (FAST, False)])
def test_a_machine_that_draws_slowly_is_measured_before_the_3d_view_is_loaded(
    station: GroundStation, browser, monkeypatch, script: str, plain: bool
):
    monkeypatch.setattr(station.view, "is_plain", False)
    monkeypatch.setattr(station.view, "plain_views", {})
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
        assert list(station.view.plain_views.values()) == ([6_000] if plain else [])


def paced(pause_ms: int) -> str:
    """Frames that take so long each, on a clock that runs ten times as fast."""
    return f"""const now = performance.now.bind(performance);
performance.now = () => 10 * now();
window.requestAnimationFrame = (run) => setTimeout(() => run(performance.now()), {pause_ms / 10});"""


@pytest.mark.parametrize(("pause_ms", "few"), [(400, True), (30, False)])
def test_triangles_are_left_out_while_frames_are_few_and_then_the_map_from_above_is_offered(
    station: GroundStation, browser, monkeypatch, pause_ms: int, few: bool
):
    asked: list[int] = []
    monkeypatch.setattr(station.view, "draw_plainly", lambda view, triangles: asked.append(triangles))
    with tab(browser, with_view=True) as new:
        new.page.context.add_init_script(FAST)
        new.page.context.add_init_script(paced(pause_ms))
        view = "<canvas></canvas>"  # none that draws: its frames are as many as the page's
        new.page.context.route("**/viser/**", lambda route: route.fulfill(body=view, content_type="text/html"))
        with visited(station, new) as page:
            page.frame_locator("iframe").locator("canvas").wait_for()
            if few:
                page.get_by_text("frames a second here. T shows Top").wait_for()
                assert [asked[0], *np.unique(asked)[::-1]] == [20_000, *display_mesh.PLAIN_TRIANGLES[::-1]]
            else:
                page.wait_for_timeout(2500)
                assert asked == []
            assert page.get_by_role("button", name="3D", pressed=True).is_visible()  # nobody's view is taken away
            page.keyboard.press("t")
            page.get_by_role("button", name="Top", pressed=True).wait_for()
