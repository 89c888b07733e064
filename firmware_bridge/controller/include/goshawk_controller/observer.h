/* Disturbance observer: what pushes and turns the vehicle beside the modelled rotors and drag.

   Incremental inversion of the wrench (Smeur, Chu and de Croon 2016; Tal and Karaman 2021): mass times specific force,
   less the thrust that the model gives at the rotors' speeds, less modelled drag, is the force of everything else:
   wind, a wrong mass, a weak rotor. Likewise inertia times angular acceleration, less the rotors' torque. Both pass two
   equal low-passes. A slow state, driven by the estimated velocity, takes the accelerometer's bias off.

   It runs in flight only, from lift-off on. Landing and emergency hold what it has: ground is no disturbance. Without
   accelerometer it is off. */
#ifndef GOSHAWK_CONTROLLER_OBSERVER_H
#define GOSHAWK_CONTROLLER_OBSERVER_H

#include "goshawk_controller/mixer.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    TC_OBSERVER_OFF = 0,              /* by the parameter */
    TC_OBSERVER_WAITS = 1,            /* for lift-off, or for an attitude that is followed */
    TC_OBSERVER_RUNS = 2,             /* estimates, and is cancelled */
    TC_OBSERVER_HOLDS = 3,            /* landing, emergency: the last estimate is cancelled */
    TC_OBSERVER_NO_ACCELEROMETER = 4, /* nothing is cancelled */
} tc_observer_state;

typedef struct {
    float force_world_n[3]; /* of everything that is not modelled */
    float torque_body_n_m[3];
    float force_variance_n2; /* of one axis, by the noise of what was measured */
    float torque_variance_n2_m2[3];
    float noise_m2_s4; /* variance of one axis of the accelerometer */

    /* First stages of the low-passes, what has lasted; the slow state: accelerometer's integral, and how much it is
       short of the estimate's velocity; the rotors as they lag. */
    float force_stage_n[3], rate_stage_rad_s[3], torque_stage_n_m[3];
    float lasting_force_n[3], lasting_torque_n_m[3];
    float velocity_world_m_s[3], missing_m_s2[3];
    float rotor_speed_rad_s[TC_ROTORS];
    float induced[TC_ROTORS]; /* the mixer's units */
    float thrust_n;           /* of the rotors, by the model, when the torque was last observed */
    /* The last tick: accelerometer, gyro, its length. */
    float last_force_body_m_s2[3], last_rate_rad_s[3], last_step_s;
    float force_s, gained_m_s[3]; /* since the force was last observed: time, and integral of the accelerometer */
    uint8_t state;                /* tc_observer_state */
    bool compared;                /* the pose, in the last even tick */
    bool started;
} tc_observer;

typedef struct {
    const float* rate_body_rad_s;
    const float* torque_n_m;    /* of the rotors, by the model */
    const float* cancelled_n_m; /* torque added against modelled moments */
} tc_observed_torque;

typedef struct {
    const float* acceleration_world_m_s2; /* by the accelerometer */
    const float* velocity_world_m_s;
    const float* known_world_n; /* the rotors' thrust and drag, by the model */
} tc_observed_force;

/* Forgets everything. */
void tc_observer_reset(tc_observer* observer);

/* Forgets everything but what has lasted. */
void tc_observer_pause(tc_observer* observer);

/* The rotors follow `command` for a step, with their lag and the battery's sag. */
void tc_observer_rotors(tc_observer* observer, const tc_parameters* parameters, const float command_rad_s[TC_ROTORS],
                        float per_battery, float step_s);

/* The filters begin where the vehicle is, so that they have nothing to settle. */
void tc_observer_start(tc_observer* observer, const tc_observed_torque* now, const float velocity_world_m_s[3]);
/* `step_s`: since the last one. */
void tc_observer_torque(tc_observer* observer, const tc_parameters* parameters, const tc_observed_torque* now,
                        float step_s);
void tc_observer_force(tc_observer* observer, const tc_parameters* parameters, const tc_observed_force* now,
                       float step_s);

/* From now on what has lasted, until the next step. */
void tc_observer_hold(tc_observer* observer);

/* The estimator has moved its frame: heading, by a quaternion about world z, and its velocity starts anew. */
void tc_observer_turn(tc_observer* observer, const float q_turn[4]);

#ifdef __cplusplus
}
#endif

#endif
