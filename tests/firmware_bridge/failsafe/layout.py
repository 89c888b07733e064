"""The structures of body_flight.h and of what it includes, field by field, for ctypes."""

import ctypes

_real, _int = ctypes.c_double, ctypes.c_int32


class Vehicle(ctypes.Structure):
    _fields_ = (
        ("mass_kg", _real), ("gravity_m_s2", _real), ("inertia_kg_m2", _real * 3), ("centre_of_mass_m", _real * 2),
        ("rotor_x_m", _real * 4), ("rotor_y_m", _real * 4), ("spin", _real * 4), ("k1_n_s2", _real),
        ("k2_n_s2_m", _real), ("cq_n_m_s2", _real), ("air_density_kg_m3", _real), ("disk_area_m2", _real),
        ("rotor_drag_s_m", _real), ("parasitic_kg_m", _real * 3), ("rotor_lag_s", _real), ("rotor_max_rad_s", _real),
        ("ground_effect", _real), ("foot_m", _real * 3), ("top_m", _real * 3), ("contact_n_m", _real),
        ("contact_n_s_m", _real), ("friction", _real),
    )  # fmt: skip


class World(ctypes.Structure):
    _fields_ = (
        ("floor_m", _real), ("slope", _real * 2), ("bump_m", _real), ("bump_length_m", _real), ("plate_m", _real),
        ("plate_min_m", _real * 2), ("plate_max_m", _real * 2), ("wind_m_s", _real * 3), ("gust_std_m_s", _real),
        ("gust_time_s", _real),
    )  # fmt: skip


class Sensors(ctypes.Structure):
    _fields_ = (
        ("pose_rate_hz", _real), ("delay_s", _real), ("position_noise_m", _real), ("velocity_noise_m_s", _real),
        ("attitude_noise_rad", _real), ("gyro_noise_rad_s", _real), ("accelerometer_noise_m_s2", _real),
        ("vibration_m_s2", _real), ("height_wander_m", _real), ("height_wander_s", _real),
        ("vertical_bias_m_s", _real), ("tilt_error_rad", _real * 2), ("accelerometer_bias_m_s2", _real * 3),
        ("gyro_bias_rad_s", _real * 3),
        ("position_std_m", _real), ("velocity_std_m_s", _real), ("battery_v", _real), ("has_specific_force", _int),
        ("has_vertical_velocity", _int),
    )  # fmt: skip


class Fault(ctypes.Structure):
    _fields_ = (("kind", _int), ("from_state", _int), ("after_s", _real), ("duration_s", _real), ("value", _real * 4))


class Order(ctypes.Structure):
    _fields_ = (("command", _int), ("from_state", _int), ("after_s", _real), ("value", _real))


class Value(ctypes.Structure):
    _fields_ = (("index", _int), ("reserved", _int), ("value", _real))


class Header(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32), ("crc32", ctypes.c_uint32), ("segment_count", ctypes.c_uint16),
        ("coefficient_count", ctypes.c_uint8), ("link_loss_policy", ctypes.c_uint8), ("clearance_m", ctypes.c_float),
    )  # fmt: skip


class Segment(ctypes.Structure):
    _fields_ = (("duration_us", ctypes.c_uint32), ("coefficient", ctypes.c_float * 12 * 4))


class Scenario(ctypes.Structure):
    _fields_ = (
        ("seed", ctypes.c_uint64), ("tick_s", _real), ("tick_jitter", _real), ("limit_s", _real), ("has_link", _int),
        ("in_air", _int), ("start_m", _real * 3), ("start_m_s", _real * 3), ("pilot_m_s", _real * 3),
        ("vehicle", Vehicle), ("world", World), ("sensors", Sensors), ("fault_count", _int), ("order_count", _int),
        ("value_count", _int), ("segment_count", _int), ("fault", Fault * 8), ("order", Order * 16),
        ("value", Value * 24), ("header", Header), ("segment", ctypes.POINTER(Segment)),
    )  # fmt: skip


class Record(ctypes.Structure):
    _fields_ = (
        ("touchdowns", _int), ("first_touchdown_m_s", _real), ("first_touchdown_s", _real),
        ("hardest_touchdown_m_s", _real), ("hardest_touchdown_s", _real), ("last_airborne_s", _real),
        ("largest_tilt_rad", _real), ("largest_speed_m_s", _real), ("rest_s", _real), ("time_s", _real),
    )  # fmt: skip


class Change(ctypes.Structure):
    _fields_ = (("time_s", _real), ("before", _int), ("after", _int), ("reason", _int), ("reserved", _int))


class Result(ctypes.Structure):
    _fields_ = (
        ("body", Record), ("end_s", _real), ("end_position_m", _real * 3), ("end_tilt_rad", _real), ("at_rest", _int),
        ("flew", _int), ("final_state", _int), ("final_reason", _int), ("bad_outputs", _int), ("upload_reason", _int),
        ("stop_clearance_m", _real), ("stop_s", _real), ("stop_tilt_rad", _real), ("stop_state", _int),
        ("stop_reason", _int), ("unlogged_slow_s", _real), ("largest_error_m", _real), ("path_end_s", _real),
        ("limit_reasons", ctypes.c_uint64 * 2), ("warnings", ctypes.c_uint32), ("states", ctypes.c_uint32),
        ("ticks", ctypes.c_uint32), ("refused_ticks", ctypes.c_uint32), ("out_of_command_ticks", ctypes.c_uint32),
        ("change_count", _int), ("change", Change * 48), ("order_reason", _int * 16), ("order_s", _real * 16),
        ("fault_reason", _int * 8), ("fault_s", _real * 8),
    )  # fmt: skip
