#pragma once
#include <stdint.h>
struct trajectory_setpoint_s {
    uint64_t timestamp;
    float position[3], velocity[3], acceleration[3], jerk[3], yaw, yawspeed;
};
