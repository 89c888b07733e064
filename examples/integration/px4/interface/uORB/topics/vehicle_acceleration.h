#pragma once
#include <stdint.h>
struct vehicle_acceleration_s {
    uint64_t timestamp, timestamp_sample;
    float xyz[3];
};
