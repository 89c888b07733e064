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

void tc_attitude_step(const tc_parameters* p, const tc_attitude_reference* reference, const float q_world_body[4],
                      const float rate_body_rad_s[3], float torque_body_n_m[3]) {
    float axes[3][3];
    float difference[4], error[3], feed_rate[3], feed_acceleration[3], momentum[3], gyroscopic[3];
    tc_q_difference(q_world_body, reference->q_world_body, difference);
    if (p->attitude_mode > 0.5f) {
        lee_error(difference, error);
    } else {
        tilt_error(difference, error);
    }
    /* Feed-forward is given in the reference's axes; bring it into the body's. */
    tc_q_axes(difference, axes);
    tc_to_world(axes, reference->rate_body_rad_s, feed_rate);
    tc_to_world(axes, reference->angular_acceleration_rad_s2, feed_acceleration);
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

void tc_modelled_moment(const tc_parameters* p, const tc_mixer* mixer, const float air_velocity_body_m_s[3],
                        const float rate_body_rad_s[3], const float rotor_speed_rad_s[TC_ROTORS],
                        float moment_body_n_m[3]) {
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
    moment_body_n_m[0] = -p->damping_n_m_s[0] * rate_body_rad_s[0] - p->flapping_kg_m * (vy * sum + wz * sum_x);
    moment_body_n_m[1] = -p->damping_n_m_s[1] * rate_body_rad_s[1] + p->flapping_kg_m * (vx * sum - wz * sum_y);
    moment_body_n_m[2] = -p->damping_n_m_s[2] * wz - p->rotor_drag_kg * drag_moment;
}
