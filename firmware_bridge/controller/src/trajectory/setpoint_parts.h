/* A set-point as numbers: the derivative of an axis (x, y, z, yaw). Not for users. */
#ifndef SETPOINT_PARTS_H
#define SETPOINT_PARTS_H

#include "goshawk_controller/trajectory.h"

_Static_assert(sizeof(tc_setpoint) == 5u * TC_AXES * sizeof(float), "five orders of four axes, nothing between them");

/* Number 4 order + axis: that derivative of that axis. */
static inline float* tc_setpoint_numbers(tc_setpoint* setpoint) { return (float*)(void*)setpoint; }
static inline const float* tc_setpoint_read(const tc_setpoint* setpoint) { return (const float*)(const void*)setpoint; }

#endif
