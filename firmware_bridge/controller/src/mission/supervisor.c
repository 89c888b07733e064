/* How fast the path may be flown, from how well it is tracked. */
#include "goshawk_controller/supervisor.h"

#include "../base/maths.h"
#include "../trajectory/setpoint_parts.h"

/* Of the clearance. */
static const float SLOW_FROM = 0.3f;        /* the path slows down */
static const float STOP_AT = 0.7f;          /* it stands */
static const float GO_ON_BELOW = 0.35f;     /* half of that, so that it does not go to and fro */
static const float NEARER = 0.05f;          /* what counts as an approach */
static const uint32_t TOO_FAR_US = 300000u; /* beyond the clearance for this long: give up */
static const uint32_t STANDS_US = 2000000u; /* standing for this long without an approach: give up */
static const float FULL_RATE = 0.999f;      /* of the limit: nothing limits any more */
static const float STANDING = 1e-3f;        /* of the limit */
static const float SHIFT_1_S = 1.0f;        /* the shift decays critically damped, 1 / time constant */
static const float SMALLEST_RATE = 0.01f;   /* below, the set-point's velocity tells no direction */

void tc_supervisor_reset(tc_supervisor* s, uint64_t time_us) {
    memset(s, 0, sizeof *s);
    for (int i = 0; i < 3; i++) s->stage[i] = 1.0f;
    s->limit[0] = 1.0f;
    s->target = 1.0f;
    s->within_us = time_us;
    s->approaching_us = time_us;
}

void tc_supervisor_shift(tc_supervisor* s, const float position_m[3], const float velocity_m_s[3], float yaw_rad) {
    for (int i = 0; i < 3; i++) {
        s->shift[i] += position_m[i];
        s->shift_1_s[i] += velocity_m_s[i];
    }
    s->shift[3] += yaw_rad;
}

/* s'' = -2 k s' - k^2 s, and its derivatives. */
void tc_supervisor_apply_shift(const tc_supervisor* s, tc_setpoint* setpoint) {
    float* out = tc_setpoint_numbers(setpoint);
    const float k = SHIFT_1_S;
    for (int i = 0; i < TC_AXES; i++) {
        const float s0 = s->shift[i], s1 = s->shift_1_s[i];
        const float s2 = -2.0f * k * s1 - k * k * s0;
        const float s3 = -2.0f * k * s2 - k * k * s1;
        out[i] += s0;
        out[TC_AXES + i] += s1;
        out[2 * TC_AXES + i] += s2;
        out[3 * TC_AXES + i] += s3;
        out[4 * TC_AXES + i] += -2.0f * k * s3 - k * k * s2;
    }
}

static void decay_shift(tc_supervisor* s, float step_s) {
    const float k = SHIFT_1_S;
    for (int i = 0; i < TC_AXES; i++) {
        s->shift_1_s[i] += step_s * (-2.0f * k * s->shift_1_s[i] - k * k * s->shift[i]);
        s->shift[i] += step_s * s->shift_1_s[i];
    }
}

/* Distance to the set-point, without what the vehicle is ahead of it along the path. */
static float tracking_error(tc_supervisor* s, const tc_setpoint* setpoint, float path_rate,
                            const float position_world_m[3]) {
    float error[3];
    const float speed = tc_norm(setpoint->velocity_world_m_s);
    if (path_rate > SMALLEST_RATE && speed > SMALLEST_RATE) {
        for (int i = 0; i < 3; i++) s->tangent[i] = setpoint->velocity_world_m_s[i] / speed;
    }
    for (int i = 0; i < 3; i++) error[i] = setpoint->position_world_m[i] - position_world_m[i];
    const float ahead = tc_min(tc_dot(error, s->tangent), 0.0f);
    for (int i = 0; i < 3; i++) error[i] -= ahead * s->tangent[i];
    return tc_norm(error);
}

/* Three low-passes of the target, one behind the other: never outside [0, 1], and three times differentiable. */
static void follow(tc_supervisor* s, float step_s) {
    const float pass = s->ramp_1_s * step_s / (1.0f + s->ramp_1_s * step_s);
    float before = s->target;
    for (int i = 0; i < 3; i++) {
        s->stage[i] += pass * (before - s->stage[i]);
        before = s->stage[i];
    }
    const float a = s->stage[0], b = s->stage[1], c = s->stage[2], k = s->ramp_1_s;
    s->limit[0] = c;
    s->limit[1] = k * (b - c);
    s->limit[2] = k * k * (a - 2.0f * b + c);
    s->limit[3] = k * k * k * (s->target - 3.0f * a + 3.0f * b - c);
}

void tc_supervisor_step(tc_supervisor* s, float step_s) {
    decay_shift(s, step_s);
    follow(s, step_s);
    if (s->reason == (uint8_t)TC_OK || s->target < 1.0f) return;
    const bool full = s->stage[0] > FULL_RATE && s->stage[1] > FULL_RATE && s->stage[2] > FULL_RATE;
    if (full) s->reason = (uint8_t)TC_OK; /* until then the last one still shows */
}

void tc_supervisor_judge(tc_supervisor* s, const tc_setpoint* setpoint, float path_rate,
                         const float position_world_m[3], float clearance_m, bool tracking, float ramp_1_s,
                         uint64_t time_us) {
    const float tracking_m = tracking_error(s, setpoint, path_rate, position_world_m);
    s->error_m = tracking_m + tc_norm(s->shift);
    const float share = s->error_m / clearance_m;
    s->stopped = share >= STOP_AT || (s->stopped && share >= GO_ON_BELOW);
    const bool may_fly = tracking && !s->stopped;
    s->target = may_fly ? tc_clamp((STOP_AT - share) / (STOP_AT - SLOW_FROM), 0.0f, 1.0f) : 0.0f;
    s->ramp_1_s = ramp_1_s;
    if (!tracking) {
        s->reason = (uint8_t)TC_DEAD_RECKONING;
    } else if (s->target < 1.0f) {
        s->reason = (uint8_t)TC_TRACKING_ERROR;
    } else {
        /* nothing limits, but it may still recover */
    }
    if (tracking_m <= clearance_m || !tracking) s->within_us = time_us;
    const bool standing = s->stopped && tracking && s->limit[0] < STANDING;
    if (!standing || s->error_m < s->nearest_m - NEARER * clearance_m) {
        s->nearest_m = s->error_m;
        s->approaching_us = time_us;
    }
}

bool tc_supervisor_gives_up(const tc_supervisor* s, uint64_t time_us) {
    return time_us - s->within_us > TOO_FAR_US || time_us - s->approaching_us > STANDS_US;
}
