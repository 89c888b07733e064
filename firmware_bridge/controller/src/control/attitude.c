/* Attitude loop: tilt-prioritised, or Lee et al. */
#include "goshawk_controller/attitude.h"

#include "../base/maths.h"

/* Twice the sines of the half angles of the missing turn, thrust axis first: `axis` is the reference's z axis in body
   axes; w and z of conjugate(q) * q_reference give the turn about it. */
static inline void tilt_error(const float q[4], const float r[4], const float axis[3], float error[3]) {
    const float above = 1.0f + axis[2];
    if (above < 1e-6f) { /* upside down: any horizontal axis will do */
        error[0] = 2.0f;
        error[1] = 0.0f;
        error[2] = 0.0f;
        return;
    }
    float z;
    const float w = tc_q_missing(q, r, &z);
    const float scale = sqrtf(2.0f / above);
    error[0] = -axis[1] * scale;
    error[1] = axis[0] * scale;
    error[2] = (w < 0.0f ? -scale : scale) * z;
}

/* Lee et al. 2010, eq. (10): half the vee of Rd^T R - R^T Rd, turned round to point at what is missing. */
static void lee_error(const float q[4], const float r[4], float error[3]) {
    const float back[4] = {q[0], -q[1], -q[2], -q[3]};
    float difference[4];
    tc_q_multiply(back, r, difference);
    for (int i = 0; i < 3; i++) error[i] = 2.0f * difference[0] * difference[i + 1];
}

void tc_attitude_step(const tc_parameters* p, const tc_flatness_state* reference, const float q_world_body[4],
                      float axes[3][3], const float rate[3], const float feed_rate[3], const float feed_acceleration[3],
                      float torque_body_n_m[3]) {
    float error[3];
    if (p->attitude_mode > 0.5f) {
        lee_error(q_world_body, reference->q_reference, error);
    } else {
        float axis[3];
        tc_to_body(axes, reference->axis, axis);
        tilt_error(q_world_body, reference->q_reference, axis, error);
    }
    const float* inertia = p->inertia_kg_m2;
    const float gyroscopic[3] = {(inertia[2] - inertia[1]) * rate[1] * rate[2],
                                 (inertia[0] - inertia[2]) * rate[2] * rate[0],
                                 (inertia[1] - inertia[0]) * rate[0] * rate[1]};
    for (int i = 0; i < 3; i++) {
        const float kp = i < 2 ? p->att_kp_xy_1_s2 : p->att_kp_z_1_s2;
        const float kd = i < 2 ? p->att_kd_xy_1_s : p->att_kd_z_1_s;
        const float wanted =
            kp * error[i] + kd * (p->feed_rate * feed_rate[i] - rate[i]) + p->feed_torque * feed_acceleration[i];
        torque_body_n_m[i] = inertia[i] * wanted + gyroscopic[i];
    }
}

void tc_opposing_moments(const tc_parameters* p, const tc_mixer* mixer, const float air_velocity_body_m_s[3],
                         const float rate_body_rad_s[3], const float rotor_speed_rad_s[TC_ROTORS],
                         float torque_body_n_m[3]) {
    float sum = 0.0f, sum_x = 0.0f, sum_y = 0.0f, sum_xx = 0.0f; /* of speeds, and of speeds times arms */
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = rotor_speed_rad_s[i], x = mixer->rotor[i].arm_x_m, y = mixer->rotor[i].arm_y_m;
        sum += n;
        sum_x += n * x;
        sum_y += n * y;
        sum_xx += n * (x * x + y * y);
    }
    const float vx = air_velocity_body_m_s[0], vy = air_velocity_body_m_s[1], wz = rate_body_rad_s[2];
    const float drag_moment = vy * sum_x - vx * sum_y + wz * sum_xx;
    torque_body_n_m[0] = p->damping_n_m_s[0] * rate_body_rad_s[0] + p->flapping_kg_m * (vy * sum + wz * sum_x);
    torque_body_n_m[1] = p->damping_n_m_s[1] * rate_body_rad_s[1] - p->flapping_kg_m * (vx * sum - wz * sum_y);
    torque_body_n_m[2] = p->damping_n_m_s[2] * wz + p->rotor_drag_kg * drag_moment;
}

bool tc_has_moments(const tc_parameters* p) { /* only flapping may be negative */
    return p->damping_n_m_s[0] + p->damping_n_m_s[1] + p->damping_n_m_s[2] + p->rotor_drag_kg +
               tc_abs(p->flapping_kg_m) >
           0.0f;
}
