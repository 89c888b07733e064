/* The residual wrench, filtered. */
#include "goshawk_controller/observer.h"

#include "../base/maths.h"

static const float TWO_PI = 6.28318531f;
static const float STAGE = 1.5537738f;     /* two equal low-passes are 3 dB down at 1 / 1.55 of their own frequency */
static const float UNKNOWN_LAG_S = 0.025f; /* of rotors whose lag nobody has learnt: none would pass for a torque */
static const float LASTING_S = 2.0f;       /* what lasts longer goes on while the observer may not look */
static const float LASTING_M_S = 2.0f;     /* horizontal force takes twice as long at this speed: drag is no wind */
static const float VARIANCE_S = 1.0f;      /* over which noise is averaged */
static const float DAMPING = 1.4f;         /* of the fusion, twice the ratio */
static const float LARGEST_MISSING_M_S2 = 1.0f;   /* bias and noise of the accelerometer */
static const float LARGEST_INNOVATION_M_S = 0.5f; /* of the velocity that the bias is learnt from */

void tc_observer_reset(tc_observer* o) {
    const uint8_t state = o->state;
    memset(o, 0, sizeof *o);
    o->state = state;
}

void tc_observer_pause(tc_observer* o) {
    float force_n[3], torque_n_m[3];
    tc_copy(force_n, o->lasting_force_n);
    tc_copy(torque_n_m, o->lasting_torque_n_m);
    tc_observer_reset(o);
    tc_copy(o->lasting_force_n, force_n);
    tc_copy(o->lasting_torque_n_m, torque_n_m);
}

void tc_observer_rotors(tc_observer* o, const tc_parameters* p, const float command[TC_ROTORS], float per_battery,
                        float step_s) {
    const float lag_s = p->rotor_lag_s > 0.0f ? p->rotor_lag_s : UNKNOWN_LAG_S;
    const float share = step_s / (lag_s + step_s), sag = 1.0f / per_battery;
    for (int i = 0; i < TC_ROTORS; i++) {
        o->rotor_speed_rad_s[i] += share * (sag * command[i] - o->rotor_speed_rad_s[i]);
    }
}

/* Accelerometer against the velocity of the pose: below the cut-off the pose is right. What differs slowly is the
   accelerometer's bias, or tilt of the estimated attitude; what differs faster, the accelerometer's noise, which would
   move the vehicle. */
static void fuse_velocity(tc_observer* o, const tc_parameters* p, const tc_observed_force* now, float step_s) {
    const float slow = p->observer_fuse_rad_s, turn = slow * slow * step_s;
    for (int i = 0; i < 3; i++) {
        const float off = tc_clamp(now->velocity_world_m_s[i] - o->velocity_world_m_s[i], -LARGEST_INNOVATION_M_S,
                                   LARGEST_INNOVATION_M_S);
        const float acceleration = now->acceleration_world_m_s2[i] + o->missing_m_s2[i];
        o->velocity_world_m_s[i] += step_s * (acceleration + DAMPING * slow * off);
        o->missing_m_s2[i] = tc_clamp(o->missing_m_s2[i] + turn * off, -LARGEST_MISSING_M_S2, LARGEST_MISSING_M_S2);
    }
}

void tc_observer_force(tc_observer* o, const tc_parameters* p, const tc_observed_force* now, float step_s) {
    const float turn = TWO_PI * STAGE * p->observer_force_hz * step_s, pass = turn / (1.0f + turn);
    const float slow = step_s / (VARIANCE_S + step_s), limit = p->observer_force_m_s2 * p->mass_kg;
    const float speed2 = tc_dot(now->velocity_world_m_s, now->velocity_world_m_s) / (LASTING_M_S * LASTING_M_S);
    const float level = step_s / (LASTING_S * (1.0f + speed2) + step_s), upright = step_s / (LASTING_S + step_s);
    float noise2 = 0.0f;
    for (int i = 0; i < 3; i++) {
        const float gravity = i == 2 ? p->gravity_m_s2 : 0.0f;
        const float felt = p->mass_kg * (now->acceleration_world_m_s2[i] + o->missing_m_s2[i] + gravity);
        const float off = felt - now->known_world_n[i] - o->force_stage_n[i];
        noise2 += off * off;
        o->force_stage_n[i] = tc_clamp(o->force_stage_n[i] + pass * off, -limit, limit);
        o->force_world_n[i] += pass * (o->force_stage_n[i] - o->force_world_n[i]);
        o->lasting_force_n[i] += (i < 2 ? level : upright) * (o->force_world_n[i] - o->lasting_force_n[i]);
    }
    noise2 *= 1.0f / 3.0f;
    o->force_variance_n2 += slow * (0.25f * pass * noise2 - o->force_variance_n2);
    o->noise_m2_s4 += slow * (2.0f * noise2 / (p->mass_kg * p->mass_kg) - o->noise_m2_s4); /* a mean of two has half */
    fuse_velocity(o, p, now, step_s);
}

/* Angular acceleration is the difference of the rate and its low-pass: nothing is differentiated. */
void tc_observer_torque(tc_observer* o, const tc_parameters* p, const tc_observed_torque* now, float step_s) {
    const float* inertia = p->inertia_kg_m2;
    const float* rate = now->rate_body_rad_s;
    const float cut = TWO_PI * STAGE * p->observer_torque_hz, pass = cut * step_s / (1.0f + cut * step_s);
    const float slow = step_s / (VARIANCE_S + step_s), noise = 0.5f * pass, lasting = step_s / (LASTING_S + step_s);
    const float gyroscopic[3] = {(inertia[2] - inertia[1]) * rate[1] * rate[2],
                                 (inertia[0] - inertia[2]) * rate[2] * rate[0],
                                 (inertia[1] - inertia[0]) * rate[0] * rate[1]};
    for (int i = 0; i < 3; i++) {
        const float known = now->torque_n_m[i] - gyroscopic[i] - now->cancelled_n_m[i];
        const float limit = p->observer_turn_rad_s2 * inertia[i];
        o->rate_stage_rad_s[i] += pass * (rate[i] - o->rate_stage_rad_s[i]);
        o->torque_stage_n_m[i] += pass * (known - o->torque_stage_n_m[i]);
        const float residual = inertia[i] * cut * (rate[i] - o->rate_stage_rad_s[i]) - o->torque_stage_n_m[i];
        const float off = tc_clamp(residual, -limit, limit) - o->torque_body_n_m[i];
        o->torque_body_n_m[i] += pass * off;
        o->torque_variance_n2_m2[i] += slow * (noise * off * off - o->torque_variance_n2_m2[i]);
        o->lasting_torque_n_m[i] += lasting * (o->torque_body_n_m[i] - o->lasting_torque_n_m[i]);
    }
}

void tc_observer_start(tc_observer* o, const tc_observed_torque* now, const float velocity_world_m_s[3]) {
    tc_copy(o->velocity_world_m_s, velocity_world_m_s);
    tc_copy(o->rate_stage_rad_s, now->rate_body_rad_s);
    tc_copy(o->torque_stage_n_m, now->torque_n_m);
    o->force_s = 0.0f;
    memset(o->gained_m_s, 0, sizeof o->gained_m_s);
    o->started = true;
}

void tc_observer_hold(tc_observer* o) {
    tc_copy(o->force_world_n, o->lasting_force_n);
    tc_copy(o->force_stage_n, o->lasting_force_n);
    tc_copy(o->torque_body_n_m, o->lasting_torque_n_m);
}

void tc_observer_turn(tc_observer* o, const float q[4]) {
    const float sine = 2.0f * q[0] * q[3], cosine = 1.0f - 2.0f * q[3] * q[3]; /* of the doubled angle */
    float* const force[3] = {o->force_world_n, o->force_stage_n, o->lasting_force_n};
    for (int i = 0; i < 3; i++) {
        const float x = force[i][0], y = force[i][1];
        force[i][0] = cosine * x - sine * y;
        force[i][1] = sine * x + cosine * y;
    }
    o->started = false;
}
