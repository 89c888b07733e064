/* The Hopf chart, and the transport that replaces it where it has no answer. */
#include "goshawk_controller/flatness.h"

#include "../base/maths.h"

/* Thrust below 5 % of the weight has no usable direction; up to 10 % the axis follows more and more. */
static const float NO_DIRECTION = 0.05f;
static const float FULL_DIRECTION = 0.10f;
/* The chart's yaw is followed fully down to cos(tilt) = -0.7, not at all beyond -0.95. */
static const float CHART_LOST = 0.05f;
static const float CHART_GOOD = 0.30f;
static const float LARGEST_ANGULAR_ACCELERATION_RAD_S2 = 300.0f; /* of the feed-forward: beyond what rotors give */
/* Noise of the force turns the chart to and fro about its axis: seen from tick to tick, faster than the slew limit once
   ticks are short (2 kHz and above). Only what stays one-sided for this long is a turn that is cut, and fed forward. */
static const float YAW_CUT_S = 0.01f;

static void z_axis(const float q[4], float axis_world[3]) {
    axis_world[0] = 2.0f * (q[1] * q[3] + q[0] * q[2]);
    axis_world[1] = 2.0f * (q[2] * q[3] - q[0] * q[1]);
    axis_world[2] = 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]);
}

void tc_flatness_reset(tc_flatness_state* state, const float q_world_body[4]) {
    tc_copy4(state->q_reference, q_world_body);
    tc_q_normalise(state->q_reference);
    z_axis(state->q_reference, state->axis);
    state->yaw_cut_rad_s = 0.0f;
}

void tc_flatness_turn(tc_flatness_state* state, const float q_turn[4]) {
    float turned[4];
    tc_q_multiply(q_turn, state->q_reference, turned);
    tc_copy4(state->q_reference, turned);
    z_axis(turned, state->axis);
    state->yaw_cut_rad_s = 0.0f;
}

/* Of half the yaw. */
typedef struct {
    float sine, cosine;
} half_yaw;

static half_yaw halve(float yaw_rad) {
    half_yaw out;
    tc_sin_cos(0.5f * yaw_rad, &out.sine, &out.cosine);
    return out;
}

static void chart_at(const float axis_world[3], half_yaw yaw, float q_world_body[4]) {
    const float scale = 1.0f / sqrtf(2.0f * tc_max(1.0f + axis_world[2], 1e-6f));
    const float tilt[3] = {(1.0f + axis_world[2]) * scale, -axis_world[1] * scale, axis_world[0] * scale};
    q_world_body[0] = tilt[0] * yaw.cosine;
    q_world_body[1] = tilt[1] * yaw.cosine + tilt[2] * yaw.sine;
    q_world_body[2] = tilt[2] * yaw.cosine - tilt[1] * yaw.sine;
    q_world_body[3] = tilt[0] * yaw.sine;
}

void tc_flatness_chart(const float axis_world[3], float yaw_rad, float q_world_body[4]) {
    chart_at(axis_world, halve(yaw_rad), q_world_body);
}

/* Turns `q`, whose z axis is `z`, the shortest way so that z comes to `axis`, by at most `limit_rad` (small). True if
   it got there. */
static bool transport(const float q[4], const float z[3], const float axis[3], float limit_rad, float out[4]) {
    float step[4] = {1.0f, 0.0f, 0.5f * limit_rad, 0.0f}; /* 1 and the half turn's tangent; about body y */
    tc_cross(z, axis, &out[1]);
    const float cosine = tc_dot(z, axis), sine = tc_norm(&out[1]);
    const bool reached = cosine > 0.0f && sine <= limit_rad;
    if (!(sine > 1e-6f) && !reached) { /* straight opposite: any way round will do; nose up or down */
        tc_q_multiply(q, step, out);
    } else {
        const float scale = reached ? 1.0f / (1.0f + cosine) : step[2] / sine;
        for (int i = 1; i < 4; i++) step[i] = out[i] * scale;
        tc_q_multiply(step, q, out);
    }
    tc_q_normalise(out);
    return reached;
}

/* Turns `q` about its own z axis towards the chart's `other` by at most `limit_rad` (small); returns how far it came,
   `other` then holds where. */
static float turn_towards(const float q[4], float limit_rad, float other[4], bool* arrived) {
    float half;
    if (tc_q_missing(q, other, &half) < 0.0f) half = -half;
    const float half_limit = 0.5f * limit_rad;
    *arrived = tc_abs(half) < half_limit;
    if (*arrived) return 0.0f;
    const float step[4] = {1.0f, 0.0f, 0.0f, half > 0.0f ? half_limit : -half_limit};
    tc_q_multiply(q, step, other);
    tc_q_normalise(other);
    return 2.0f * step[3];
}

/* How the reference went on. */
typedef struct {
    float direction; /* how far the force tells where to: 0 not at all, 1 */
    float yaw_rad_s; /* rate about the axis where the chart's is not to be used */
    bool on_chart;
    bool chart_lost; /* near straight down, where the chart's own rate means nothing */
} progress;

/* Where the chart cannot be followed at once: little thrust (`weights`), near straight down, or further than the slew
   limits allow. */
static progress move_on(tc_flatness_state* state, const tc_parameters* p, const float force_n[3], float weights,
                        half_yaw yaw, float step_s) {
    progress out = {tc_clamp((weights - NO_DIRECTION) / (FULL_DIRECTION - NO_DIRECTION), 0.0f, 1.0f), 0.0f, false,
                    false};
    float wanted[3], q[4];
    const float size_n = tc_max(tc_norm(force_n), 1e-6f);
    for (int i = 0; i < 3; i++) wanted[i] = force_n[i] / size_n;
    const float tilt_limit = tc_min(out.direction * p->tilt_slew_rad_s * step_s, 1.0f);
    const bool on_axis = transport(state->q_reference, state->axis, wanted, tilt_limit, q);
    if (!on_axis) z_axis(q, wanted);
    tc_copy(state->axis, wanted);
    const float trust = tc_clamp((1.0f + wanted[2] - CHART_LOST) / (CHART_GOOD - CHART_LOST), 0.0f, 1.0f);
    const float turn_limit = tc_min(trust * p->yaw_slew_rad_s * step_s, 1.0f);
    chart_at(state->axis, yaw, state->q_reference);
    const float turned_rad = turn_towards(q, turn_limit, state->q_reference, &out.on_chart);
    if (step_s > 0.0f) out.yaw_rad_s = turned_rad / step_s;
    out.chart_lost = trust < 1.0f;
    return out;
}

/* Goes straight to the chart when that is close enough: of the turn from the last attitude, (w, x, y, z), the part of
   the axis has half the sine (x, y), what is left of 1 beside w and z; the part about it half the tangent z / w. */
static inline bool follow_chart(tc_flatness_state* state, const tc_parameters* p, const float axis[3], half_yaw yaw,
                                float step_s) {
    float chart[4];
    const float* q = state->q_reference;
    if (axis[2] < CHART_GOOD - 1.0f) return false;
    chart_at(axis, yaw, chart);
    float z;
    const float w = tc_q_missing(q, chart, &z);
    const float half = 0.5f * tc_min(step_s, 0.03f);
    const float tilt = half * p->tilt_slew_rad_s, about = half * p->yaw_slew_rad_s;
    if (1.0f - w * w - z * z > tilt * tilt || tc_abs(z) > about * tc_abs(w)) return false;
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
   components of both. */
static inline void rates(const tc_parameters* p, const tc_setpoint* setpoint, const float z[3], float per_mass,
                         float drag_1_s, const progress* gone, float cut_rad_s, tc_turning* out) {
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
    const float most = gone->direction * LARGEST_ANGULAR_ACCELERATION_RAD_S2;
    float cut = tc_min(tc_abs(cut_rad_s) / p->yaw_slew_rad_s, 1.0f), cut_rate = cut_rad_s;
    if (gone->chart_lost && !gone->on_chart) {
        cut = 1.0f;
        cut_rate = gone->yaw_rad_s;
    }
    float turn = (1.0f - cut) * (setpoint->yaw_rate_rad_s + swirl) + cut_rate;
    float turn1 = (1.0f - cut) * (setpoint->yaw_acceleration_rad_s2 + swirl1);
    turn = tc_clamp(turn, -p->yaw_slew_rad_s, p->yaw_slew_rad_s);
    turn1 = tc_clamp(turn1, -most, most);
    for (int i = 0; i < 3; i++) a[i] += turn * f1[i];
    shorten(w, gone->direction * p->tilt_slew_rad_s);
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
    float axis[3];
    progress gone = {1.0f, 0.0f, true, false};
    const half_yaw yaw = halve(setpoint->yaw_rad);
    for (int i = 0; i < 3; i++) axis[i] = force_world_n[i] * inverse;
    if (size_n < FULL_DIRECTION * weight_n || !follow_chart(state, p, axis, yaw, step_s)) {
        gone = move_on(state, p, force_world_n, size_n / weight_n, yaw, step_s);
    }
    state->yaw_cut_rad_s += step_s / (YAW_CUT_S + step_s) * (gone.yaw_rad_s - state->yaw_cut_rad_s);
    rates(p, setpoint, state->axis, p->mass_kg * inverse, drag_1_s, &gone, state->yaw_cut_rad_s, out);
}
