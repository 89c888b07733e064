/* Attitude loop: tilt-prioritised, or Lee et al. */
#include "goshawk_controller/attitude.h"

#include "maths.h"

/* Rotation vector of the missing turn, thrust axis first: twice the sines of the two half angles. */
static void tilt_error(const float difference[4], float error[3]) {
    const float w = difference[0], x = difference[1], y = difference[2], z = difference[3];
    const float size = sqrtf(w * w + z * z);
    if (size < 1e-4f) { /* upside down: any horizontal axis will do */
        error[0] = 2.0f;
        error[1] = 0.0f;
        error[2] = 0.0f;
        return;
    }
    const float scale = 2.0f / size;
    error[0] = scale * (w * x - y * z);
    error[1] = scale * (w * y + x * z);
    error[2] = scale * (w < 0.0f ? -z : z);
}

/* Lee et al. 2010, eq. (10): half the vee of Rd^T R - R^T Rd, turned round to point at what is missing. */
static void lee_error(const float difference[4], float error[3]) {
    for (int i = 0; i < 3; i++) error[i] = 2.0f * difference[0] * difference[i + 1];
}

void tc_attitude_step(const tc_parameters *p, const tc_attitude_reference *reference, const float q_world_body[4],
                      const float rate_body_rad_s[3], float torque_body_n_m[3]) {
    float difference[4], error[3], feed_rate[3], feed_acceleration[3], momentum[3], gyroscopic[3];
    tc_q_difference(q_world_body, reference->q_world_body, difference);
    if (p->attitude_mode > 0.5f) {
        lee_error(difference, error);
    } else {
        tilt_error(difference, error);
    }
    /* Feed-forward is given in the reference's axes; bring it into the body's. */
    tc_to_world(difference, reference->rate_body_rad_s, feed_rate);
    tc_to_world(difference, reference->angular_acceleration_rad_s2, feed_acceleration);
    for (int i = 0; i < 3; i++) momentum[i] = p->inertia_kg_m2[i] * rate_body_rad_s[i];
    tc_cross(rate_body_rad_s, momentum, gyroscopic);
    for (int i = 0; i < 3; i++) {
        const float kp = i < 2 ? p->att_kp_xy_1_s2 : p->att_kp_z_1_s2;
        const float kd = i < 2 ? p->att_kd_xy_1_s : p->att_kd_z_1_s;
        const float wanted = kp * error[i] + kd * (p->feed_rate * feed_rate[i] - rate_body_rad_s[i]) +
                             p->feed_torque * feed_acceleration[i];
        torque_body_n_m[i] = p->inertia_kg_m2[i] * wanted + gyroscopic[i];
    }
}

void tc_modelled_moment(const tc_parameters *p, const float air_velocity_body_m_s[3], const float rate_body_rad_s[3],
                        const float rotor_speed_rad_s[TC_ROTORS], float moment_body_n_m[3]) {
    for (int i = 0; i < 3; i++) moment_body_n_m[i] = -p->damping_n_m_s[i] * rate_body_rad_s[i];
    for (int i = 0; i < TC_ROTORS; i++) {
        const float x = p->rotor_x_m[i] - p->centre_of_mass_m[0], y = p->rotor_y_m[i] - p->centre_of_mass_m[1];
        const float vx = air_velocity_body_m_s[0] - rate_body_rad_s[2] * y;
        const float vy = air_velocity_body_m_s[1] + rate_body_rad_s[2] * x;
        const float flapping = p->flapping_kg_m * rotor_speed_rad_s[i];
        const float drag = p->rotor_drag_kg * rotor_speed_rad_s[i];
        moment_body_n_m[0] -= flapping * vy;
        moment_body_n_m[1] += flapping * vx;
        moment_body_n_m[2] -= drag * (x * vy - y * vx);
    }
}

float tc_tilt_difference(const float q_a[4], const float q_b[4]) {
    float a[3], b[3];
    tc_q_axis_z(q_a, a);
    tc_q_axis_z(q_b, b);
    return 1.0f - tc_dot(a, b);
}
