"""The document in the page's terms: angles in degrees, edits of the map in words."""

import math

from flight.mission import Ground
from gcs_web.document import document, map_edits
from gcs_web.document.map_edits import MapEdit
from gcs_web.protocol import document as document_messages
from gcs_web.protocol import map as map_messages
from gcs_web.protocol.document import Gate, Mission, Settings, Waypoint


def waypoint(point: document.Point) -> Waypoint:
    x, y, z = point.position_world_m
    yaw_deg = None if point.yaw_rad is None else math.degrees(point.yaw_rad)
    asked = point.stay_s, point.fly_by_m, point.leg_speed_m_s, point.leg_jerk_m_s3
    return Waypoint(point.id, x, y, z, yaw_deg, *asked, point.velocity_world_m_s, _gate(point.gate))


def _gate(asked: document.Opening | None) -> Gate | None:
    if asked is None:
        return None
    turned = (math.degrees(angle) for angle in (asked.heading_rad, asked.pitch_rad, asked.roll_rad))
    return Gate(asked.width_m, asked.height_m, *turned)


def map_edit(edit: MapEdit) -> map_messages.MapEdit:
    solid = edit.edit().solid
    return map_messages.MapEdit(edit.id, edit.action, edit.name, map_edits.shape_of(solid), map_edits.words(solid))


def settings(chosen: document.Settings) -> Settings:
    return Settings(
        chosen.speed_m_s,
        chosen.acceleration_m_s2,
        chosen.jerk_m_s3,
        chosen.margin_m,
        chosen.yaw,
        chosen.method,
        heading_deg=math.degrees(chosen.heading_rad),
        look_at_m=chosen.look_at_world_m,
    )


def mission(chosen: document.Settings) -> Mission:
    def ground(asked: Ground | None) -> document_messages.Ground | None:
        return None if asked is None else document_messages.Ground(*asked.position_world_m, asked.climb_m_s)

    tube = chosen.keep_in
    return Mission(
        chosen.laps,
        chosen.lap_first,
        chosen.lap_last,
        ground(chosen.take_off),
        ground(chosen.landing),
        keep_in_m=None if tube is None else tube.radius_m,
        keep_in_recorded=tube is not None and tube.polyline_world_m is not None,
    )
