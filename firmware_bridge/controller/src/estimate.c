/* The door for the estimate: only finite, plausible numbers get in; what is missing is carried forward for a while. */
#include "internal.h"
#include "maths.h"

#define LARGEST_POSITION_M 20000.0f
#define LARGEST_VELOCITY_M_S 100.0f
#define LARGEST_RATE_RAD_S 60.0f

static bool unit(const float q[4]) {
    const float norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    return norm2 > 0.8f && norm2 < 1.2f;
}

static float age_s(uint64_t time_us, uint64_t stamp_us) {
    if (stamp_us >= time_us) return 0.0f;
    const uint64_t age_us = time_us - stamp_us;
    return age_us > 10000000u ? 10.0f : (float)(uint32_t)age_us * 1e-6f;
}

/* Position by the last velocity and the acceleration that the set-point asks for. */
static void predict_position(const tc_controller* c, float ahead_s, tc_estimate* now) {
    for (int i = 0; i < 3; i++) {
        const float acceleration = c->telemetry.setpoint.acceleration_world_m_s2[i];
        now->position_world_m[i] += ahead_s * (now->velocity_world_m_s[i] + 0.5f * ahead_s * acceleration);
        now->velocity_world_m_s[i] += ahead_s * acceleration;
    }
}

/* Attitude by the last body rate: a small turn, second order. */
static void predict_attitude(float ahead_s, tc_estimate* now) {
    float turn[4] = {1.0f, 0.0f, 0.0f, 0.0f}, turned[4];
    for (int i = 0; i < 3; i++) turn[i + 1] = 0.5f * ahead_s * now->rate_body_rad_s[i];
    tc_q_multiply(now->q_world_body, turn, turned);
    tc_q_normalise(turned);
    tc_copy4(now->q_world_body, turned);
}

uint8_t tc_take_estimate(tc_controller* c, uint64_t time_us, const tc_estimate* estimate) {
    const tc_parameters* p = &c->parameters;
    tc_estimate* good = &c->last_good;
    uint8_t faults = 0;
    if (tc_all_within(estimate->position_world_m, 3, LARGEST_POSITION_M) &&
        tc_all_within(estimate->velocity_world_m_s, 3, LARGEST_VELOCITY_M_S)) {
        tc_copy(good->position_world_m, estimate->position_world_m);
        tc_copy(good->velocity_world_m_s, estimate->velocity_world_m_s);
        good->position_time_us = estimate->position_time_us;
    } else {
        faults |= TC_FAULT_POSITION_BAD;
    }
    if (tc_all_within(estimate->q_world_body, 4, 2.0f) && unit(estimate->q_world_body) &&
        tc_all_within(estimate->rate_body_rad_s, 3, LARGEST_RATE_RAD_S)) {
        tc_copy4(good->q_world_body, estimate->q_world_body);
        tc_copy(good->rate_body_rad_s, estimate->rate_body_rad_s);
        good->attitude_time_us = estimate->attitude_time_us;
    } else {
        faults |= TC_FAULT_ATTITUDE_BAD;
    }
    good->battery_v = tc_finite(estimate->battery_v) ? tc_clamp(estimate->battery_v, 0.0f, 1000.0f) : 0.0f;
    const float position_age_s = age_s(time_us, good->position_time_us);
    const float attitude_age_s = age_s(time_us, good->attitude_time_us);
    if (position_age_s > p->estimate_stale_s) faults |= TC_FAULT_POSITION_STALE;
    if (attitude_age_s > p->estimate_stale_s) faults |= TC_FAULT_ATTITUDE_STALE;
    tc_estimate* now = &c->telemetry.estimate;
    *now = *good;
    predict_position(c, tc_min(position_age_s + p->predict_extra_s, p->predict_max_s), now);
    predict_attitude(tc_min(attitude_age_s + p->predict_extra_s, p->predict_max_s), now);
    return faults;
}
