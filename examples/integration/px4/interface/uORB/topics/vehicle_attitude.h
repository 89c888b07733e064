#pragma once
#include <stdint.h>
struct vehicle_attitude_s {
    uint64_t timestamp, timestamp_sample;
    float q[4];
};
