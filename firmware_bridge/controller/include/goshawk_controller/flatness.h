/* Thrust vector and yaw to attitude, body rates and angular acceleration: the tilt + yaw (Hopf) chart.

   The attitude is the shortest turn that takes the world's z axis to the thrust direction, after a turn by yaw about z.
   That chart is smooth everywhere but at straight-down thrust; there, and where thrust all but vanishes and has no
   direction, the last attitude is transported instead: the axis turns the shortest way at most at a slew limit, and the
   angle about it returns to the chart at the yaw slew limit. */
#ifndef GOSHAWK_CONTROLLER_FLATNESS_H
#define GOSHAWK_CONTROLLER_FLATNESS_H

#include "goshawk_controller/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float q_reference[4]; /* world from body */
    float axes[3][3];     /* the same: the body's x, y, z axes in world coordinates, one a row */
    bool started;
} tc_flatness_state;

typedef struct {
    float force_world_n[3];    /* the thrust vector, eq. (9) */
    float force_rate_n_s[3];   /* its first derivative: mass x jerk */
    float force_rate2_n_s2[3]; /* its second derivative: mass x snap */
    float yaw_rad;
    float yaw_rate_rad_s;
    float yaw_acceleration_rad_s2;
} tc_flat_input;

typedef struct {
    float q_world_body[4];
    float rate_body_rad_s[3];
    float angular_acceleration_rad_s2[3];
} tc_attitude_reference;

/* Forgets the last attitude and starts from this one. */
void tc_flatness_reset(tc_flatness_state* state, const float q_world_body[4]);

/* One step of `step_s`; `weight_n` tells what "little thrust" means. */
void tc_flatness_step(tc_flatness_state* state, const tc_parameters* parameters, const tc_flat_input* input,
                      float weight_n, float step_s, tc_attitude_reference* out);

/* The chart alone, no state; unit length while the axis (a unit vector) is not within 20 degrees of straight down. */
void tc_flatness_chart(const float axis_world[3], float yaw_rad, float q_world_body[4]);

#ifdef __cplusplus
}
#endif

#endif
