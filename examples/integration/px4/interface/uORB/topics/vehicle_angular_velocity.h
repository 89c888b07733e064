#pragma once
#include <stdint.h>
struct vehicle_angular_velocity_s {
    uint64_t timestamp, timestamp_sample;
    float xyz[3];
};
