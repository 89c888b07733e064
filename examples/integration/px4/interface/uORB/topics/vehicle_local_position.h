#pragma once
#include <stdint.h>
struct vehicle_local_position_s {
    uint64_t timestamp, timestamp_sample;
    bool xy_valid, z_valid, v_xy_valid, v_z_valid;
    float x, y, z, vx, vy, vz;
    float delta_xy[2], delta_z, delta_vxy[2], delta_vz, delta_heading;
    uint8_t xy_reset_counter, z_reset_counter, vxy_reset_counter, vz_reset_counter, heading_reset_counter;
    float eph, epv, evh, evv;
};
