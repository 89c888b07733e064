/* Eq. (9). */
#include "goshawk_controller/position.h"

#include "../base/maths.h"

float tc_drag(const tc_parameters* p, const float v[3], float thrust_n, float mean_rotor_speed_rad_s,
              float drag_body_n[3]) {
    const float speed = tc_norm(v);
    const float lateral = p->rotor_drag_s_m * thrust_n + 4.0f * p->rotor_drag_kg * mean_rotor_speed_rad_s;
    for (int i = 0; i < 3; i++) {
        const float rotor = i < 2 ? lateral : 0.0f;
        drag_body_n[i] = -v[i] * (rotor + p->parasitic_kg_m[i] * tc_abs(v[i]) + p->parasitic_norm_kg_m[i] * speed);
    }
    return lateral + 2.0f * (p->parasitic_kg_m[0] + p->parasitic_norm_kg_m[0]) * speed;
}

static inline void integrate(tc_position_state* state, const tc_parameters* p, const float error[3], float step_s) {
    for (int i = 0; i < 3; i++) {
        const float gain = i < 2 ? p->ki_xy_1_s3 : p->ki_z_1_s3;
        const float next = state->integral_m_s2[i] + gain * error[i] * step_s;
        state->integral_m_s2[i] = tc_clamp(next, -p->integral_m_s2, p->integral_m_s2);
    }
}

/* Height first: the horizontal part gives way when all together is too much. */
static bool limit_thrust(float largest_n, float force[3]) {
    const float horizontal2 = force[0] * force[0] + force[1] * force[1];
    if (horizontal2 + force[2] * force[2] <= largest_n * largest_n) return false;
    force[2] = tc_clamp(force[2], -largest_n, largest_n);
    const float room = sqrtf(tc_max(largest_n * largest_n - force[2] * force[2], 0.0f));
    const float scale = room / tc_max(sqrtf(horizontal2), 1e-6f);
    force[0] *= tc_min(scale, 1.0f);
    force[1] *= tc_min(scale, 1.0f);
    return true;
}

bool tc_position_step(tc_position_state* state, const tc_parameters* p, const tc_setpoint* setpoint,
                      const float position_world_m[3], const float velocity_world_m_s[3], const float drag_world_n[3],
                      float largest_n, bool integrate_now, float step_s, float force_world_n[3]) {
    float error[3], feedback[3];
    for (int i = 0; i < 3; i++) {
        const float kp = i < 2 ? p->kp_xy_1_s2 : p->kp_z_1_s2;
        const float kd = i < 2 ? p->kd_xy_1_s : p->kd_z_1_s;
        error[i] = setpoint->position_world_m[i] - position_world_m[i];
        feedback[i] = kp * error[i] + kd * (setpoint->velocity_world_m_s[i] - velocity_world_m_s[i]);
    }
    const float size2 = tc_dot(feedback, feedback), gate_m = p->integral_gate_m;
    const bool limited = size2 > p->feedback_m_s2 * p->feedback_m_s2;
    if (limited) {
        const float scale = p->feedback_m_s2 / sqrtf(size2);
        for (int i = 0; i < 3; i++) feedback[i] *= scale;
    }
    if (integrate_now && !limited && tc_dot(error, error) < gate_m * gate_m) integrate(state, p, error, step_s);
    feedback[2] += p->gravity_m_s2;
    for (int i = 0; i < 3; i++) {
        const float wanted = feedback[i] + state->integral_m_s2[i] + setpoint->acceleration_world_m_s2[i];
        force_world_n[i] = p->mass_kg * wanted - drag_world_n[i];
    }
    return limit_thrust(largest_n, force_world_n) || limited;
}
