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

TC_RARE void tc_flatness_reset(tc_flatness_state* state, const float q_world_body[4]) {
    tc_copy4(state->q_reference, q_world_body);
    tc_q_normalise(state->q_reference);
    tc_q_axis_z(state->q_reference, state->axis);
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

/* Where the chart cannot be followed at once: little thrust, near straight down, or further than the slew limits allow.
   Moves `q` and `axis` on; returns the rate about the axis if the chart's is not to be used. */
typedef struct {
    float yaw_rad_s;
    bool on_chart;
} transported;

static TC_RARE transported move_on(tc_flatness_state* state, const tc_parameters* p, const float wanted[3],
                                   float direction, float yaw_rad, float step_s) {
    transported out = {0.0f, false};
    float q[4], chart[4], turned_rad = 0.0f;
    const float tilt_limit = tc_min(direction * p->tilt_slew_rad_s * step_s, 1.0f);
    const bool on_axis = transport(state->q_reference, state->axis, wanted, tilt_limit, q);
    if (on_axis) {
        tc_copy(state->axis, wanted);
    } else {
        tc_q_axis_z(q, state->axis);
    }
    tc_flatness_chart(state->axis, yaw_rad, chart);
    const float trust = tc_clamp((1.0f + state->axis[2] - CHART_LOST) / (CHART_GOOD - CHART_LOST), 0.0f, 1.0f);
    const float turn_limit = tc_min(trust * p->yaw_slew_rad_s * step_s, 1.0f);
    out.on_chart = trust > 0.0f && turn_to_chart(chart, turn_limit, q, &turned_rad);
    out.yaw_rad_s = step_s > 0.0f ? turned_rad / step_s : 0.0f;
    tc_copy4(state->q_reference, q);
    return out;
}

/* Goes straight to the chart when that is close enough: of the turn from the last attitude, (w, x, y, z), the part of
   the axis has half the sine (x, y), what is left of 1 beside w and z; the part about it half the tangent z / w. */
static inline bool follow_chart(tc_flatness_state* state, const tc_parameters* p, const float axis[3], float yaw_rad,
                                float step_s) {
    float chart[4];
    const float* q = state->q_reference;
    if (axis[2] < CHART_GOOD - 1.0f) return false;
    tc_flatness_chart(axis, yaw_rad, chart);
    const float w = q[0] * chart[0] + q[1] * chart[1] + q[2] * chart[2] + q[3] * chart[3];
    const float z = q[0] * chart[3] - q[3] * chart[0] - q[1] * chart[2] + q[2] * chart[1];
    const float half = 0.5f * tc_min(step_s, 0.03f);
    const float tilt = half * p->tilt_slew_rad_s, yaw = half * p->yaw_slew_rad_s;
    if (1.0f - w * w - z * z > tilt * tilt || tc_abs(z) > yaw * tc_abs(w)) return false;
    tc_copy4(state->q_reference, chart);
    tc_copy(state->axis, axis);
    return true;
}

static inline void shorten(float v[3], float largest) {
    const float size2 = tc_dot(v, v);
    if (size2 > largest * largest) {
        const float scale = largest / sqrtf(size2);
        for (int i = 0; i < 3; i++) v[i] *= scale;
    }
}

/* Rates of the axis z and of the chart about it, from the force and its derivatives over its size, f1 and f2: the axis
   turns by w = z x f1, and that changes by z x f2 - 2 (z f1) w. The chart's own turn about the axis is told by the z
   components of both. `other`: the rate about the axis where the chart's is not used, else NULL. */
static inline void rates(const tc_parameters* p, const tc_setpoint* setpoint, const float z[3], float per_mass,
                         float drag_1_s, float direction, const float* other, tc_turning* out) {
    float f1[3], f2[3], w[3], a[3];
    for (int i = 0; i < 3; i++) {
        const float jerk = setpoint->jerk_world_m_s3[i];
        f1[i] = (jerk + drag_1_s * setpoint->acceleration_world_m_s2[i]) * per_mass;
        f2[i] = (setpoint->snap_world_m_s4[i] + drag_1_s * jerk) * per_mass;
    }
    const float along = tc_dot(z, f1);
    tc_cross(z, f1, w);
    tc_cross(z, f2, a);
    for (int i = 0; i < 3; i++) {
        a[i] -= (along + along) * w[i];
        f1[i] -= along * z[i]; /* from here on: how the axis moves */
    }
    const float below = 1.0f / tc_max(1.0f + z[2], CHART_LOST);
    const float swirl = -w[2] * below;
    const float swirl1 = -(a[2] + swirl * f1[2]) * below;
    const float most = direction * LARGEST_ANGULAR_ACCELERATION_RAD_S2;
    float turn = other != NULL ? *other : setpoint->yaw_rate_rad_s + swirl;
    float turn1 = other != NULL ? 0.0f : setpoint->yaw_acceleration_rad_s2 + swirl1;
    turn = tc_clamp(turn, -p->yaw_slew_rad_s, p->yaw_slew_rad_s);
    turn1 = tc_clamp(turn1, -most, most);
    for (int i = 0; i < 3; i++) a[i] += turn * f1[i];
    shorten(w, direction * p->tilt_slew_rad_s);
    shorten(a, most);
    for (int i = 0; i < 3; i++) {
        out->rate_world_rad_s[i] = w[i] + turn * z[i];
        out->acceleration_world_rad_s2[i] = a[i] + turn1 * z[i];
    }
}

void tc_flatness_step(tc_flatness_state* state, const tc_parameters* p, const float force_world_n[3],
                      const tc_setpoint* setpoint, float drag_1_s, float step_s, tc_turning* out) {
    const float size_n = tc_norm(force_world_n);
    const float weight_n = p->mass_kg * p->gravity_m_s2;
    const float inverse = 1.0f / tc_max(size_n, NO_DIRECTION * weight_n);
    float axis[3], direction = 1.0f;
    for (int i = 0; i < 3; i++) axis[i] = force_world_n[i] * inverse;
    const float* other = NULL;
    transported moved;
    if (size_n < FULL_DIRECTION * weight_n) {
        const float share = (size_n / weight_n - NO_DIRECTION) / (FULL_DIRECTION - NO_DIRECTION);
        direction = tc_max(share, 0.0f);
        for (int i = 0; i < 3; i++) axis[i] = force_world_n[i] / tc_max(size_n, 1e-6f);
    }
    if (!state->started) {
        tc_flatness_chart(axis, setpoint->yaw_rad, state->q_reference);
        tc_q_normalise(state->q_reference);
        tc_q_axis_z(state->q_reference, state->axis);
        state->started = true;
    }
    if (direction < 1.0f || !follow_chart(state, p, axis, setpoint->yaw_rad, step_s)) {
        moved = move_on(state, p, axis, direction, setpoint->yaw_rad, step_s);
        if (!moved.on_chart) other = &moved.yaw_rad_s;
    }
    rates(p, setpoint, state->axis, p->mass_kg * inverse, drag_1_s, direction, other, out);
}
