#pragma once
#include <stdint.h>
struct vehicle_torque_setpoint_s {
    uint64_t timestamp, timestamp_sample;
    float xyz[3];
};
