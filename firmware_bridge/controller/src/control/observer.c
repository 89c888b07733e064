/* The residual wrench, filtered. */
#include "goshawk_controller/observer.h"

#include "../base/maths.h"

static const float TWO_PI = 6.28318531f;
static const float STAGE = 1.5537738f;     /* two equal low-passes are 3 dB down at 1 / 1.55 of their own frequency */
static const float UNKNOWN_LAG_S = 0.025f; /* of rotors whose lag nobody has learnt: none would pass for a torque */
static const float LASTING_S = 2.0f;       /* what lasts longer goes on while the observer may not look */
static const float VARIANCE_S = 1.0f;      /* over which noise is averaged */
static const float LARGEST_BIAS_M_S2 = 1.0f;
static const float LARGEST_INNOVATION_M_S = 0.5f; /* of the velocity that the bias is learnt from */

void tc_observer_reset(tc_observer* o) {
    const uint8_t state = o->state;
    memset(o, 0, sizeof *o);
    o->state = state;
}

void tc_observer_rotors(tc_observer* o, const tc_parameters* p, const float command[TC_ROTORS], float per_battery,
                        float step_s) {
    const float lag_s = p->rotor_lag_s > 0.0f ? p->rotor_lag_s : UNKNOWN_LAG_S;
    const float share = step_s / (lag_s + step_s);
    for (int i = 0; i < TC_ROTORS; i++) {
        o->rotor_speed_rad_s[i] += share * (command[i] / per_battery - o->rotor_speed_rad_s[i]);
    }
}

/* Accelerometer against the velocity of the pose: what differs slowly is the accelerometer's bias (or tilt of the
   estimated attitude, which acts the same). */
static void learn_bias(tc_observer* o, const tc_parameters* p, const float force_world_m_s2[3], const float velocity[3],
                       float axes[3][3], float step_s) {
    const float slow = p->observer_fuse_rad_s;
    float innovation[3], body[3];
    for (int i = 0; i < 3; i++) {
        const float gravity = i == 2 ? p->gravity_m_s2 : 0.0f;
        innovation[i] =
            tc_clamp(velocity[i] - o->velocity_world_m_s[i], -LARGEST_INNOVATION_M_S, LARGEST_INNOVATION_M_S);
        o->velocity_world_m_s[i] += step_s * (force_world_m_s2[i] - gravity + 1.4f * slow * innovation[i]);
    }
    tc_to_body(axes, innovation, body);
    for (int i = 0; i < 3; i++) {
        o->bias_m_s2[i] =
            tc_clamp(o->bias_m_s2[i] - step_s * slow * slow * body[i], -LARGEST_BIAS_M_S2, LARGEST_BIAS_M_S2);
    }
}

static void observe_force(tc_observer* o, const tc_parameters* p, const tc_observed* now, float axes[3][3],
                          float step_s) {
    float body[3], world[3], felt[3];
    const float turn = TWO_PI * STAGE * p->observer_force_hz * step_s, pass = turn / (1.0f + turn);
    const float slow = step_s / (VARIANCE_S + step_s), limit = p->observer_force_m_s2 * p->mass_kg;
    float noise2 = 0.0f;
    for (int i = 0; i < 3; i++) body[i] = now->specific_force_body_m_s2[i] - o->bias_m_s2[i];
    tc_to_world(axes, body, felt);
    for (int i = 0; i < 3; i++) body[i] = p->mass_kg * body[i] - now->drag_body_n[i];
    body[2] -= now->rotors->thrust_n;
    tc_to_world(axes, body, world);
    for (int i = 0; i < 3; i++) {
        const float off = world[i] - o->force_stage_n[i];
        noise2 += off * off;
        o->force_stage_n[i] = tc_clamp(o->force_stage_n[i] + pass * off, -limit, limit);
        o->force_world_n[i] += pass * (o->force_stage_n[i] - o->force_world_n[i]);
    }
    o->force_variance_n2 += slow * (noise2 * (1.0f / 3.0f) - o->force_variance_n2);
    o->force_std_n = 0.5f * sqrtf(pass * o->force_variance_n2);
    learn_bias(o, p, felt, now->velocity_world_m_s, axes, step_s);
}

/* Angular acceleration is the difference of the rate and its low-pass: nothing is differentiated. */
static void observe_torque(tc_observer* o, const tc_parameters* p, const tc_observed* now, float step_s) {
    const float* inertia = p->inertia_kg_m2;
    const float* rate = now->rate_body_rad_s;
    const float cut = TWO_PI * STAGE * p->observer_torque_hz, pass = cut * step_s / (1.0f + cut * step_s);
    const float slow = step_s / (VARIANCE_S + step_s);
    const float gyroscopic[3] = {(inertia[2] - inertia[1]) * rate[1] * rate[2],
                                 (inertia[0] - inertia[2]) * rate[2] * rate[0],
                                 (inertia[1] - inertia[0]) * rate[0] * rate[1]};
    for (int i = 0; i < 3; i++) {
        const float known = now->rotors->torque_n_m[i] - gyroscopic[i] - now->cancelled_n_m[i];
        const float limit = p->observer_turn_rad_s2 * inertia[i];
        o->rate_stage_rad_s[i] += pass * (rate[i] - o->rate_stage_rad_s[i]);
        o->torque_stage_n_m[i] += pass * (known - o->torque_stage_n_m[i]);
        const float residual = inertia[i] * cut * (rate[i] - o->rate_stage_rad_s[i]) - o->torque_stage_n_m[i];
        const float off = tc_clamp(residual, -limit, limit) - o->torque_body_n_m[i];
        o->torque_body_n_m[i] += pass * off;
        o->torque_variance_n2_m2[i] += slow * (off * off - o->torque_variance_n2_m2[i]);
        o->torque_std_n_m[i] = sqrtf(0.5f * pass * o->torque_variance_n2_m2[i]);
    }
}

/* Filters begin where the vehicle is, so that they have nothing to settle. */
static void start(tc_observer* o, const tc_observed* now) {
    tc_copy(o->velocity_world_m_s, now->velocity_world_m_s);
    tc_copy(o->rate_stage_rad_s, now->rate_body_rad_s);
    tc_copy(o->torque_stage_n_m, now->rotors->torque_n_m);
    o->started = true;
}

void tc_observer_step(tc_observer* o, const tc_parameters* p, const tc_observed* now, float axes[3][3], float step_s) {
    if (!o->started) start(o, now);
    observe_force(o, p, now, axes, step_s);
    observe_torque(o, p, now, step_s);
    const float slow = step_s / (LASTING_S + step_s);
    for (int i = 0; i < 3; i++) {
        o->lasting_force_n[i] += slow * (o->force_world_n[i] - o->lasting_force_n[i]);
        o->lasting_torque_n_m[i] += slow * (o->torque_body_n_m[i] - o->lasting_torque_n_m[i]);
    }
}

void tc_observer_hold(tc_observer* o) {
    tc_copy(o->force_world_n, o->lasting_force_n);
    tc_copy(o->force_stage_n, o->lasting_force_n);
    tc_copy(o->torque_body_n_m, o->lasting_torque_n_m);
}

void tc_observer_turn(tc_observer* o, float yaw_rad) {
    float sine, cosine;
    tc_sin_cos(yaw_rad, &sine, &cosine);
    float* const force[3] = {o->force_world_n, o->force_stage_n, o->lasting_force_n};
    for (int i = 0; i < 3; i++) {
        const float x = force[i][0], y = force[i][1];
        force[i][0] = cosine * x - sine * y;
        force[i][1] = sine * x + cosine * y;
    }
    o->started = false;
}
