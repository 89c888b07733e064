/* Thrust vector and yaw to attitude, body rates and angular acceleration: the tilt + yaw (Hopf) chart.

   The attitude is the shortest turn that takes the world's z axis to the thrust direction, after a turn by yaw about z.
   That chart is smooth everywhere but at straight-down thrust; there, and where thrust all but vanishes and has no
   direction, the last attitude is transported instead: the axis turns the shortest way at most at a slew limit, and the
   angle about it returns to the chart at the yaw slew limit. */
#ifndef GOSHAWK_CONTROLLER_FLATNESS_H
#define GOSHAWK_CONTROLLER_FLATNESS_H

#include "goshawk_controller/parameters.h"
#include "goshawk_controller/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float q_reference[4]; /* world from body */
    float axis[3];        /* its z axis in world coordinates */
    float yaw_cut_rad_s;  /* low-passed: how fast it turns about that axis while the yaw slew limit holds it back */
} tc_flatness_state;

/* How the reference turns, in world axes. The reference itself is in the state. */
typedef struct {
    float rate_world_rad_s[3];
    float acceleration_world_rad_s2[3];
} tc_turning;

/* Forgets the last attitude and starts from this one: before the first step, and when the vehicle was elsewhere. */
void tc_flatness_reset(tc_flatness_state* state, const float q_world_body[4]);

/* Turns the reference in the world, by a unit quaternion: after the estimator has corrected its heading. */
void tc_flatness_turn(tc_flatness_state* state, const float q_turn[4]);

/* One step of `step_s` towards the thrust vector `force_world_n` (eq. (9)) and the yaw of the set-point, whose jerk and
   snap, times the mass, are the derivatives of that vector; `drag_1_s`, drag over momentum, adds what cancelling the
   drag contributes to them. */
void tc_flatness_step(tc_flatness_state* state, const tc_parameters* parameters, const float force_world_n[3],
                      const tc_setpoint* setpoint, float drag_1_s, float step_s, tc_turning* out);

/* The chart alone, no state; unit length while the axis (a unit vector) is not within 20 degrees of straight down. */
void tc_flatness_chart(const float axis_world[3], float yaw_rad, float q_world_body[4]);

#ifdef __cplusplus
}
#endif

#endif
