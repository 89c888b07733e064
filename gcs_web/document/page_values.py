"""The document in the page's terms: angles in degrees, edits of the map in words."""

import math

from flight.mission import Ground
from gcs_web import protocol
from gcs_web.document import document, map_edits
from gcs_web.document.map_edits import MapEdit


def waypoint(point: document.Point) -> protocol.Waypoint:
    x, y, z = point.position_world_m
    yaw_deg = None if point.yaw_rad is None else math.degrees(point.yaw_rad)
    asked = point.stay_s, point.fly_by_m, point.leg_speed_m_s, point.velocity_world_m_s, _gate(point.gate)
    return protocol.Waypoint(point.id, x, y, z, yaw_deg, *asked)


def _gate(asked: document.Opening | None) -> protocol.Gate | None:
    if asked is None:
        return None
    turned = (math.degrees(angle) for angle in (asked.heading_rad, asked.pitch_rad, asked.roll_rad))
    return protocol.Gate(asked.width_m, asked.height_m, *turned)


def map_edit(edit: MapEdit) -> protocol.MapEdit:
    solid = edit.edit().solid
    return protocol.MapEdit(edit.id, edit.action, edit.name, map_edits.shape_of(solid), map_edits.words(solid))


def settings(chosen: document.Settings) -> protocol.Settings:
    return protocol.Settings(
        chosen.speed_m_s,
        chosen.acceleration_m_s2,
        chosen.margin_m,
        chosen.yaw,
        chosen.method,
        heading_deg=math.degrees(chosen.heading_rad),
        look_at_m=chosen.look_at_world_m,
    )


def mission(chosen: document.Settings) -> protocol.Mission:
    def ground(asked: Ground | None) -> protocol.Ground | None:
        return None if asked is None else protocol.Ground(*asked.position_world_m, asked.climb_m_s)

    tube = chosen.keep_in
    return protocol.Mission(
        chosen.laps,
        chosen.lap_first,
        chosen.lap_last,
        ground(chosen.take_off),
        ground(chosen.landing),
        keep_in_m=None if tube is None else tube.radius_m,
        keep_in_recorded=tube is not None and tube.polyline_world_m is not None,
    )
