#pragma once
#include <stdint.h>
struct vehicle_control_mode_s {
    uint64_t timestamp;
    bool flag_control_manual_enabled, flag_control_position_enabled, flag_control_velocity_enabled;
    bool flag_control_altitude_enabled, flag_control_climb_rate_enabled, flag_control_attitude_enabled;
    bool flag_control_rates_enabled, flag_control_allocation_enabled, flag_control_termination_enabled;
    uint8_t source_id;
};
