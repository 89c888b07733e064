/* A SIMULATED quadrotor over a flat floor at z = 0, so that this example runs without a vehicle. It is no model to
   tune with: quadratic thrust, rotor lag, a little drag, no wind, no noise. */
#ifndef SIMULATED_BODY_H
#define SIMULATED_BODY_H

#include "goshawk_controller/goshawk_controller.h"

typedef struct {
    tc_parameters parameters; /* mass, inertia, rotors */
    float position_world_m[3];
    float velocity_world_m_s[3];
    float q_world_body[4];
    float rate_body_rad_s[3];
    float rotor_speed_rad_s[TC_ROTORS];
    float specific_force_body_m_s2[3];
} simulated_body;

/* At rest on the floor, with the vehicle of the default parameters. */
void simulated_body_init(simulated_body* body);

/* step_s: at most 0.002. */
void simulated_body_step(simulated_body* body, const float rotor_speed_command_rad_s[TC_ROTORS], float step_s);

/* What a perfect estimator sees of it now. */
void simulated_body_estimate(const simulated_body* body, uint64_t time_us, tc_estimate* estimate);

#endif
