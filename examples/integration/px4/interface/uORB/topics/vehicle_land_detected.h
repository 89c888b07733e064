#pragma once
#include <stdint.h>
struct vehicle_land_detected_s {
    uint64_t timestamp;
    bool landed;
};
