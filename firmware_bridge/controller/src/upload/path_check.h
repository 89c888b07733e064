/* The checks that a vehicle makes of a trajectory before it agrees to fly it. Internal. */
#ifndef GOSHAWK_CONTROLLER_PATH_CHECK_H
#define GOSHAWK_CONTROLLER_PATH_CHECK_H

#include "goshawk_controller/trajectory.h"

/* One segment alone: finite, duration, and by Bernstein hulls fence, speed, acceleration, jerk, yaw and yaw rate. */
tc_reason tc_check_segment(const tc_segment* segment, uint32_t coefficient_count, const tc_parameters* limits);

/* Value, velocity and acceleration at the join of segments `index - 1` and `index`. */
tc_reason tc_check_join(const tc_trajectory* trajectory, uint16_t index);

/* At rest at the beginning and at the end. */
tc_reason tc_check_ends(const tc_trajectory* trajectory);

/* The planner's own evaluation against ours. */
tc_reason tc_check_sample(const tc_trajectory* trajectory, const tc_trajectory_sample* sample);

#endif
