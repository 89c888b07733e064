#include "simulated_body.h"

#include <math.h>
#include <string.h>

static const float rotor_lag_s = 0.015f;
static const float drag_1_s = 0.14f;   /* per unit of mass */
static const float damping_1_s = 0.3f; /* per unit of inertia */

void simulated_body_init(simulated_body* body) {
    memset(body, 0, sizeof *body);
    tc_parameters_default(&body->parameters);
    body->q_world_body[0] = 1.0f;
    body->specific_force_body_m_s2[2] = body->parameters.gravity_m_s2;
}

/* The body axes in world coordinates. */
static void axes_of(const float q[4], float axes[3][3]) {
    const float w = q[0], x = q[1], y = q[2], z = q[3];
    const float rows[3][3] = {
        {1.0f - 2.0f * (y * y + z * z), 2.0f * (x * y + w * z), 2.0f * (x * z - w * y)},
        {2.0f * (x * y - w * z), 1.0f - 2.0f * (x * x + z * z), 2.0f * (y * z + w * x)},
        {2.0f * (x * z + w * y), 2.0f * (y * z - w * x), 1.0f - 2.0f * (x * x + y * y)},
    };
    memcpy(axes, rows, sizeof rows);
}

static void turn(float q[4], const float rate[3], float step_s) {
    const float x = 0.5f * step_s * rate[0], y = 0.5f * step_s * rate[1], z = 0.5f * step_s * rate[2];
    const float next[4] = {
        q[0] - x * q[1] - y * q[2] - z * q[3],
        q[1] + x * q[0] + z * q[2] - y * q[3],
        q[2] + y * q[0] - z * q[1] + x * q[3],
        q[3] + z * q[0] + y * q[1] - x * q[2],
    };
    const float size = sqrtf(next[0] * next[0] + next[1] * next[1] + next[2] * next[2] + next[3] * next[3]);
    for (int i = 0; i < 4; i++) q[i] = next[i] / size;
}

static float turn_rotors(simulated_body* body, const float command[TC_ROTORS], float step_s, float torque[3]) {
    const tc_parameters* p = &body->parameters;
    float thrust_n = 0.0f;
    torque[0] = torque[1] = torque[2] = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        float* speed = &body->rotor_speed_rad_s[i];
        *speed += (command[i] - *speed) * step_s / (rotor_lag_s + step_s);
        const float one = p->quad_n_s2 * *speed * *speed;
        thrust_n += one;
        torque[0] += one * (p->rotor_y_m[i] - p->centre_of_mass_m[1]);
        torque[1] -= one * (p->rotor_x_m[i] - p->centre_of_mass_m[0]);
        torque[2] += p->rotor_spin[i] * p->cq_n_m_s2 * *speed * *speed;
    }
    return thrust_n;
}

void simulated_body_step(simulated_body* body, const float rotor_speed_command_rad_s[TC_ROTORS], float step_s) {
    const tc_parameters* p = &body->parameters;
    float torque[3], axes[3][3], force_world_n[3];
    const float thrust_n = turn_rotors(body, rotor_speed_command_rad_s, step_s, torque);
    const float* inertia = p->inertia_kg_m2;
    float* rate = body->rate_body_rad_s;
    axes_of(body->q_world_body, axes);
    for (int i = 0; i < 3; i++)
        force_world_n[i] = thrust_n * axes[2][i] - p->mass_kg * drag_1_s * body->velocity_world_m_s[i];
    const bool held = force_world_n[2] < p->mass_kg * p->gravity_m_s2 || body->velocity_world_m_s[2] < 0.0f;
    const bool on_floor = body->position_world_m[2] <= 0.0f && held;
    if (on_floor) { /* the floor carries the rest, and nothing slides or turns */
        force_world_n[0] = force_world_n[1] = 0.0f;
        force_world_n[2] = p->mass_kg * p->gravity_m_s2;
        body->position_world_m[2] = 0.0f;
        for (int i = 0; i < 3; i++) body->velocity_world_m_s[i] = rate[i] = 0.0f;
    } else {
        const float gyroscopic[3] = {(inertia[2] - inertia[1]) * rate[1] * rate[2],
                                     (inertia[0] - inertia[2]) * rate[2] * rate[0],
                                     (inertia[1] - inertia[0]) * rate[0] * rate[1]};
        for (int i = 0; i < 3; i++) {
            const float weight = i == 2 ? p->gravity_m_s2 : 0.0f;
            rate[i] += ((torque[i] - gyroscopic[i]) / inertia[i] - damping_1_s * rate[i]) * step_s;
            body->velocity_world_m_s[i] += (force_world_n[i] / p->mass_kg - weight) * step_s;
            body->position_world_m[i] += body->velocity_world_m_s[i] * step_s;
        }
        turn(body->q_world_body, rate, step_s);
    }
    for (int i = 0; i < 3; i++) {
        body->specific_force_body_m_s2[i] =
            (axes[i][0] * force_world_n[0] + axes[i][1] * force_world_n[1] + axes[i][2] * force_world_n[2]) /
            p->mass_kg;
    }
}

void simulated_body_estimate(const simulated_body* body, uint64_t time_us, tc_estimate* estimate) {
    memset(estimate, 0, sizeof *estimate);
    estimate->position_time_us = estimate->attitude_time_us = estimate->rate_time_us = time_us;
    memcpy(estimate->position_world_m, body->position_world_m, sizeof body->position_world_m);
    memcpy(estimate->velocity_world_m_s, body->velocity_world_m_s, sizeof body->velocity_world_m_s);
    memcpy(estimate->q_world_body, body->q_world_body, sizeof body->q_world_body);
    memcpy(estimate->rate_body_rad_s, body->rate_body_rad_s, sizeof body->rate_body_rad_s);
    memcpy(estimate->specific_force_body_m_s2, body->specific_force_body_m_s2, sizeof body->specific_force_body_m_s2);
    estimate->battery_v = 15.5f;
    memcpy(estimate->rotor_speed_rad_s, body->rotor_speed_rad_s, sizeof body->rotor_speed_rad_s);
    estimate->valid = TC_VALID_ALL | TC_VALID_ROTOR_SPEED;
}
