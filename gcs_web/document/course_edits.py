"""Edits of what the path passes through: gates, and the tube that it keeps in."""

import math
from dataclasses import replace

import msgspec
import numpy as np

from flight import InputError
from flight.mission import KeepIn
from gcs_web.document.document import Content, Opening
from gcs_web.protocol.document import ClearGate, SetGate, SetTube

Edited = tuple[Content, str]


def set_gate(content: Content, edit: SetGate) -> Edited:
    number = content.number_of(edit.waypoint)
    if number in (0, len(content.points) - 1):
        raise InputError(f"waypoint {number + 1} is an end of the path and met exactly; give gates to inner waypoints")
    lengths = {"width_m": edit.width_m, "height_m": edit.height_m}
    angles = {"heading_rad": edit.heading_deg, "pitch_rad": edit.pitch_deg, "roll_rad": edit.roll_deg}
    wrong = [name for name, degrees in angles.items() if degrees is not None and not math.isfinite(degrees)]
    if wrong:
        raise InputError(f"the gate's {wrong[0].removesuffix('_rad')} must be finite; give degrees")
    given = {name: value for name, value in lengths.items() if value is not None}
    given |= {
        name: math.remainder(math.radians(degrees), 2.0 * math.pi)
        for name, degrees in angles.items()
        if degrees is not None
    }
    gate = msgspec.structs.replace(content.points[number].gate or _upright(content, number), **given)
    size = f"{gate.width_m:.2f} x {gate.height_m:.2f} m, heading {math.degrees(gate.heading_rad):.0f}°"
    return _with_gate(content, number, gate), f"gate at waypoint {number + 1} {size}"


def clear_gate(content: Content, edit: ClearGate) -> Edited:
    number = content.number_of(edit.waypoint)
    return _with_gate(content, number, None), f"gate at waypoint {number + 1} dropped"


def set_tube(content: Content, edit: SetTube) -> Edited:
    old = content.settings.keep_in
    tube = None if edit.radius_m is None else replace(old or KeepIn(edit.radius_m), radius_m=edit.radius_m)
    settings = msgspec.structs.replace(content.settings, keep_in=tube)
    label = "no tube to keep in" if edit.radius_m is None else f"tube of {edit.radius_m:g} m to keep in"
    return msgspec.structs.replace(content, settings=settings), label


def turned_round(gate: Opening) -> Opening:
    """The same opening, to be passed the other way."""
    heading_rad = math.remainder(gate.heading_rad + math.pi, 2.0 * math.pi)
    return Opening(gate.width_m, gate.height_m, heading_rad, -gate.pitch_rad, -gate.roll_rad)


def _upright(content: Content, number: int) -> Opening:
    """A metre wide and high, along the way from the waypoint before to the one behind."""
    before, behind = (content.points[number + step].position_world_m for step in (-1, 1))
    x, y, _ = np.subtract(behind, before)
    return Opening(1.0, 1.0, float(np.arctan2(y, x)))


def _with_gate(content: Content, number: int, gate: Opening | None) -> Content:
    points = list(content.points)
    points[number] = msgspec.structs.replace(points[number], gate=gate)
    return content.with_points(points)
