/* A set-point as numbers: the derivative of an axis (x, y, z, yaw). Not for users. */
#ifndef SETPOINT_PARTS_H
#define SETPOINT_PARTS_H

#include <string.h>

#include "goshawk_controller/trajectory.h"

_Static_assert(sizeof(tc_setpoint) == 5u * TC_AXES * sizeof(float), "five orders of four axes, nothing between them");

static inline float tc_setpoint_get(const tc_setpoint* setpoint, unsigned order, unsigned axis) {
    float value;
    memcpy(&value, (const uint8_t*)setpoint + sizeof value * (TC_AXES * order + axis), sizeof value);
    return value;
}

static inline void tc_setpoint_put(tc_setpoint* setpoint, unsigned order, unsigned axis, float value) {
    memcpy((uint8_t*)setpoint + sizeof value * (TC_AXES * order + axis), &value, sizeof value);
}

#endif
