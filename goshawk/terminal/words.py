"""Display names of quantities: `top_speed_m_s` is `top speed`, in `m/s`."""

from flight.flight_log import COLUMNS

_UNITS = {
    "n_s2_m2": "N s2/m2",
    "n_m_s2": "N m s2",
    "n_s2_m": "N s2/m",
    "n_m_s": "N m s",
    "n_s_m": "N s/m",
    "kg_m3": "kg/m3",
    "per_v": "1/V",
    "rad_s2": "rad/s2",
    "kg_m2": "kg m2",
    "n_s2": "N s2",
    "m_s2": "m/s2",
    "m_s3": "m/s3",
    "rad_s": "rad/s",
    "m_s": "m/s",
    "kg_m": "kg/m",
    "n_m": "N m",
    "n_s": "N s",
    "s_m": "s/m",
    "m2": "m2",
    "m3": "m3",
    "hz": "Hz",
    "rad": "rad",
    "deg": "deg",
    "px": "px",
    "kg": "kg",
    "pa": "Pa",
    "s": "s",
    "m": "m",
    "n": "N",
    "v": "V",
    "a": "A",
    "k": "K",
    "ratio": "",
}
_WHOLE = {
    "q_world_body": ("attitude quaternion", ""),
    "setpoint_q_world_body": ("attitude set-point quaternion", ""),
    "position_world_m": ("position in the world", "m"),
    "velocity_world_m_s": ("velocity in the world", "m/s"),
    "rate_body_rad_s": ("body rate (gyro)", "rad/s"),
    "specific_force_body_m_s2": ("specific force (accelerometer)", "m/s2"),
    "rotor_speed_command_rad_s": ("rotor speed, commanded", "rad/s"),
    "setpoint_position_world_m": ("position set-point", "m"),
    "setpoint_velocity_world_m_s": ("velocity set-point", "m/s"),
    "wind_world_m_s": ("wind", "m/s"),
    "disturbance_force_world_n": ("measured disturbance force", "N"),
    "disturbance_torque_body_n_m": ("measured disturbance torque", "N m"),
    "disturbance_force_std_n": ("disturbance force std", "N"),
    "disturbance_torque_std_n_m": ("disturbance torque std", "N m"),
    "rotor_speed_rad_s": ("rotor speed", "rad/s"),
    "battery_v": ("battery", "V"),
    "mission_state": ("mission state (code)", ""),
    "saturation": ("saturation (code)", ""),
    "observer_state": ("disturbance observer (code)", ""),
}
_LABELS = ("0", "1", "2", "3", "w", "x", "y", "z")


def component(column: str) -> str:
    """`x` of `position_world_x_m`, `0` of `rotor_speed_0_rad_s`; empty for a column that is no part of a vector."""
    is_part = any(column in columns for columns in COLUMNS.values())
    return next(part for part in column.split("_")[1:] if part in _LABELS) if is_part else ""


def named(key: str) -> tuple[str, str]:
    """Display name and unit of a key that ends in its unit; no unit: the empty string."""
    if key in _WHOLE:
        return _WHOLE[key]
    for quantity, columns in COLUMNS.items():
        if key in columns:
            words, unit = _WHOLE[quantity]
            return f"{words}, {component(key)}", unit
    for suffix, unit in _UNITS.items():
        if key.endswith("_" + suffix):
            return key.removesuffix("_" + suffix).replace("_", " "), unit
    return key.replace("_", " "), ""


def parameter(name: str) -> str:
    """A parameter of a vehicle file as words: `motor_lag.rise_s` is `motor lag: rise`."""
    effect, _, own = name.rpartition(".")
    words = named(own)[0]
    return f"{effect.replace('_', ' ')}: {words}" if effect else words


def with_unit(key: str, value: object) -> tuple[str, object]:
    """A row of a table: display name, and the value with its unit. A key that is a display name already stays."""
    if " " in key:
        return key, value
    words, unit = named(key)
    if not unit or isinstance(value, str | bool) or value is None:
        return words, "unknown" if value is None else value
    return words, f"{value:.4g} {unit}" if isinstance(value, float) else f"{value} {unit}"
