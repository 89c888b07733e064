"""What is drawn is what is known, and stands out: colours follow clearance, and differ from each theme's background."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_web import view3d
from gcs_web.comparison import flight_scene
from gcs_web.map import map_view
from gcs_web.scene import course_view, drawing
from gcs_web.vehicle import vehicle_view

CLIENT = Path(view3d.__file__).parent / "client" / "src"
COLOURS = (*flight_scene._COLOURS, *drawing.ARROWS, drawing.PREDICTED)
OTHERS = (
    view3d._WHITE, view3d._SELECTED, view3d._GREY, drawing._MARK, course_view._FRAME, course_view._TUBE,
    vehicle_view._TRAIL, *map_view._COLOURS.values(), map_view._PREVIEW, map_view._CAMERA, map_view._MEASURED,
)  # fmt: skip
SHARES = np.linspace(0.0, 1.0, 9)
SCALES = (
    *drawing.clearance_colours(drawing.PLENTY_ABOVE_M * SHARES, 0.0).tolist(),
    *drawing.colours(SHARES, "cividis").tolist(),
    *drawing.signed_colours(2.0 * SHARES - 1.0).tolist(),
)
"""Along each scale of a path."""


@given(st.floats(-1.0, 5.0), st.floats(-1.0, 5.0))
def test_more_clearance_is_never_brighter(a, b):
    """Brightness alone carries the order, for those who see no colours."""
    low, high = sorted([a, b])
    brightness = drawing.clearance_colours(np.array([low, high]), 0.3) @ [0.2126, 0.7152, 0.0722]
    assert brightness[1] <= brightness[0] + 1e-9


def test_unknown_clearance_is_drawn_as_the_worst():
    colours = drawing.clearance_colours(np.array([np.nan, -1.0, 0.3]), 0.3)
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[0], colours[2])


def luminance(colour) -> float:
    """Relative luminance of an sRGB colour, 0 to 255 each (WCAG 2.2)."""
    share = np.array(colour) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_what_is_drawn_stands_out_from_the_background_in_both_themes():
    """3 to 1, as WCAG asks of graphics; the 3D view is the same for all who look, whatever their theme."""
    backgrounds = re.findall(r"--scene: #(\w{6});", (CLIENT / "styles" / "style.css").read_text())
    assert len(backgrounds) == 2
    for hexadecimal in backgrounds:
        behind = luminance(tuple(bytes.fromhex(hexadecimal)))
        for colour in (*COLOURS, *OTHERS, *SCALES):
            assert (luminance(colour) + 0.05) / (behind + 0.05) >= 3.0


def test_the_legend_has_the_colours_that_are_drawn():
    legend = (CLIENT / "panels" / "learn" / "learn.css").read_text()
    for colour in COLOURS:
        assert f"#{bytes(colour).hex()}" in legend
    scales = (CLIENT / "plots" / "scales.ts").read_text()
    for colour in SCALES[: 2 * len(SHARES)]:
        assert f"#{bytes(colour).hex()}" in scales


DEUTERANOPIA = [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
PROTANOPIA = [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
TRITANOPIA = [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
"""Of linear sRGB (Machado et al. 2009, severity 1)."""


@pytest.mark.parametrize("seen", [np.eye(3), DEUTERANOPIA, PROTANOPIA, TRITANOPIA])
def test_arrows_of_force_and_torque_differ_without_full_colour_vision(seen):
    drawn = np.array(drawing.ARROWS) / 255.0
    linear = np.where(drawn <= 0.04045, drawn / 12.92, ((drawn + 0.055) / 1.055) ** 2.4) @ np.transpose(seen)
    shown = np.clip(np.clip(linear, 0.0, 1.0) ** (1.0 / 2.4) * 1.055 - 0.055, 0.0, 1.0)
    lab = cv2.cvtColor(shown[None].astype(np.float32), cv2.COLOR_RGB2LAB)[0]
    assert np.linalg.norm(lab[0] - lab[1]) > 42.0
