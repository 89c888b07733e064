/* The Hopf chart, and the transport that replaces it where it has no answer. */
#include "goshawk_controller/flatness.h"

#include "maths.h"

/* Thrust below 5 % of the weight has no usable direction; up to 10 % the axis follows more and more. */
#define NO_DIRECTION 0.05f
#define FULL_DIRECTION 0.10f
/* The chart's yaw is followed fully down to cos(tilt) = -0.7, not at all beyond -0.95. */
#define CHART_LOST 0.05f
#define CHART_GOOD 0.30f
#define LARGEST_ANGULAR_ACCELERATION_RAD_S2 300.0f

void tc_flatness_reset(tc_flatness_state* state, const float q_world_body[4]) {
    tc_copy4(state->q_reference, q_world_body);
    tc_q_normalise(state->q_reference);
    tc_q_axes(state->q_reference, state->axes);
    state->started = true;
}

void tc_flatness_chart(const float axis_world[3], float yaw_rad, float q_world_body[4]) {
    const float scale = 1.0f / sqrtf(2.0f * tc_max(1.0f + axis_world[2], 1e-6f));
    const float tilt[3] = {(1.0f + axis_world[2]) * scale, -axis_world[1] * scale, axis_world[0] * scale};
    float sine, cosine;
    tc_sin_cos(0.5f * yaw_rad, &sine, &cosine);
    q_world_body[0] = tilt[0] * cosine;
    q_world_body[1] = tilt[1] * cosine + tilt[2] * sine;
    q_world_body[2] = tilt[2] * cosine - tilt[1] * sine;
    q_world_body[3] = tilt[0] * sine;
}

/* Turns `q`, whose z axis is `z`, the shortest way so that z comes to `axis`, by at most `limit_rad` (small). True if
   it got there. */
static bool transport(const float q[4], const float z[3], const float axis[3], float limit_rad, float out[4]) {
    float normal[3];
    tc_cross(z, axis, normal);
    const float cosine = tc_dot(z, axis);
    const float half_limit = 0.5f * limit_rad;
    const bool reached = cosine > 0.0f && tc_dot(normal, normal) <= 4.0f * half_limit * half_limit;
    float step[4];
    if (reached) {
        step[0] = 1.0f + cosine;
        tc_copy(&step[1], normal);
    } else {
        const float length = tc_norm(normal);
        if (length > 1e-6f) {
            for (int i = 0; i < 3; i++) step[i + 1] = normal[i] * half_limit / length;
        } else { /* straight opposite: any way round will do; nose up or down */
            float y[3];
            tc_q_axis_y(q, y);
            for (int i = 0; i < 3; i++) step[i + 1] = y[i] * half_limit;
        }
        step[0] = 1.0f;
    }
    tc_q_normalise(step);
    tc_q_multiply(step, q, out);
    return reached;
}

/* Turns `q` about its own z axis towards the chart by at most `limit_rad` (small). True if it arrived; else
   `turned_rad` tells how far it came. */
static bool turn_to_chart(const float chart[4], float limit_rad, float q[4], float* turned_rad) {
    float difference[4];
    tc_q_difference(q, chart, difference);
    const float half = difference[0] < 0.0f ? -difference[3] : difference[3];
    const float half_limit = 0.5f * limit_rad;
    if (tc_abs(half) <= half_limit) {
        tc_copy4(q, chart);
        return true;
    }
    const float step[4] = {1.0f, 0.0f, 0.0f, half > 0.0f ? half_limit : -half_limit};
    float turned[4];
    tc_q_multiply(q, step, turned);
    tc_q_normalise(turned);
    tc_copy4(q, turned);
    *turned_rad = half > 0.0f ? limit_rad : -limit_rad;
    return false;
}

/* Rates of the axis and of the chart about it, from the force and its derivatives. */
static void rates(const tc_flat_input* input, float axes[3][3], float size_n, tc_attitude_reference* out) {
    const float *x = axes[0], *y = axes[1], *z = axes[2];
    float z1[3], z2[3];
    const float inverse = 1.0f / size_n;
    const float along1 = tc_dot(z, input->force_rate_n_s) * inverse;
    for (int i = 0; i < 3; i++) z1[i] = input->force_rate_n_s[i] * inverse - z[i] * along1;
    const float along2 = tc_dot(z, input->force_rate2_n_s2) * inverse;
    for (int i = 0; i < 3; i++) {
        z2[i] = input->force_rate2_n_s2[i] * inverse - z[i] * along2 - 2.0f * along1 * z1[i];
    }
    const float below = 1.0f / tc_max(1.0f + z[2], CHART_LOST);
    const float swirl = z[1] * z1[0] - z[0] * z1[1];
    float *w = out->rate_body_rad_s, *a = out->angular_acceleration_rad_s2;
    w[0] = -tc_dot(z1, y);
    w[1] = tc_dot(z1, x);
    w[2] = input->yaw_rate_rad_s + swirl * below;
    a[0] = -tc_dot(z2, y) + w[2] * w[1];
    a[1] = tc_dot(z2, x) - w[2] * w[0];
    a[2] = input->yaw_acceleration_rad_s2 + (z[1] * z2[0] - z[0] * z2[1]) * below - swirl * z1[2] * below * below;
}

void tc_flatness_step(tc_flatness_state* state, const tc_parameters* p, const tc_flat_input* input, float weight_n,
                      float step_s, tc_attitude_reference* out) {
    const float size_n = tc_norm(input->force_world_n);
    const float usable = tc_max(size_n, NO_DIRECTION * weight_n);
    float axis[3], q[4], chart[4];
    for (int i = 0; i < 3; i++) axis[i] = input->force_world_n[i] / tc_max(size_n, 1e-6f);
    if (!state->started) {
        tc_flatness_chart(axis, input->yaw_rad, state->q_reference);
        tc_q_normalise(state->q_reference);
        tc_q_axes(state->q_reference, state->axes);
        state->started = true;
    }
    const float direction = tc_clamp((size_n / weight_n - NO_DIRECTION) / (FULL_DIRECTION - NO_DIRECTION), 0.0f, 1.0f);
    const float tilt_limit = tc_min(direction * p->tilt_slew_rad_s * step_s, 1.0f);
    const bool on_axis = transport(state->q_reference, state->axes[2], axis, tilt_limit, q);
    if (!on_axis) tc_q_axis_z(q, axis);
    tc_flatness_chart(axis, input->yaw_rad, chart);
    const float trust = tc_clamp((1.0f + axis[2] - CHART_LOST) / (CHART_GOOD - CHART_LOST), 0.0f, 1.0f);
    float turned_rad = 0.0f;
    const float turn_limit = tc_min(trust * p->yaw_slew_rad_s * step_s, 1.0f);
    const bool on_chart = trust > 0.0f && turn_to_chart(chart, turn_limit, q, &turned_rad);
    tc_copy4(state->q_reference, q);
    tc_copy4(out->q_world_body, q);
    tc_q_axes(q, state->axes);
    rates(input, state->axes, usable, out);
    if (!on_chart) {
        out->rate_body_rad_s[2] = step_s > 0.0f ? turned_rad / step_s : 0.0f;
        out->angular_acceleration_rad_s2[2] = 0.0f;
    }
    for (int i = 0; i < 3; i++) {
        const float slew = i < 2 ? direction * p->tilt_slew_rad_s : p->yaw_slew_rad_s;
        const float largest = direction * LARGEST_ANGULAR_ACCELERATION_RAD_S2;
        out->rate_body_rad_s[i] = tc_clamp(out->rate_body_rad_s[i], -slew, slew);
        out->angular_acceleration_rad_s2[i] = tc_clamp(out->angular_acceleration_rad_s2[i], -largest, largest);
    }
}
