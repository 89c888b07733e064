/* The door for the estimate: only finite, plausible numbers get in; what is missing is carried forward for a while. */
#include "internal.h"
#include "maths.h"

#define LARGEST_POSITION_M 30000.0f
#define LARGEST_VELOCITY_M_S 150.0f
#define LARGEST_RATE_RAD_S 100.0f
#define LARGEST_BATTERY_V 1000.0f

static inline float age_s(uint64_t time_us, uint64_t stamp_us) {
    const uint64_t age_us = time_us - stamp_us;
    if (stamp_us >= time_us) return 0.0f;
    return age_us > 10000000u ? 10.0f : (float)(uint32_t)age_us * 1e-6f;
}

/* How far to carry forward: a fresh sample by its whole age, what was carried before only by what is new since then. */
static inline float ahead_s(const tc_parameters* p, float age, bool fresh, float step_s) {
    const float ahead = tc_min(age + p->predict_extra_s, p->predict_max_s);
    if (fresh) return ahead;
    return tc_max(ahead - tc_max(age + p->predict_extra_s - step_s, 0.0f), 0.0f);
}

/* Position by the last velocity and the acceleration that the set-point asks for. */
static inline void predict_position(const tc_estimate* from, const float acceleration_world_m_s2[3], float ahead,
                                    tc_estimate* now) {
    for (int i = 0; i < 3; i++) {
        const float velocity = from->velocity_world_m_s[i], gain = ahead * acceleration_world_m_s2[i];
        now->position_world_m[i] = from->position_world_m[i] + ahead * (velocity + 0.5f * gain);
        now->velocity_world_m_s[i] = velocity + gain;
    }
}

/* Attitude by the last body rate: a small turn, second order. */
static inline void predict_attitude(const tc_estimate* from, float ahead, tc_estimate* now) {
    const float half = 0.5f * ahead, *q = from->q_world_body;
    const float turn[4] = {1.0f, half * from->rate_body_rad_s[0], half * from->rate_body_rad_s[1],
                           half * from->rate_body_rad_s[2]};
    float turned[4];
    tc_q_multiply(q, turn, turned);
    tc_q_normalise(turned);
    tc_copy4(now->q_world_body, turned);
    tc_copy(now->rate_body_rad_s, from->rate_body_rad_s);
}

uint8_t tc_take_estimate(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate) {
    const tc_parameters* p = &c->parameters;
    tc_estimate* now = &c->telemetry.estimate;
    uint8_t faults = 0;
    const bool position_good = tc_up_to(tc_dot(estimate->position_world_m, estimate->position_world_m),
                                        LARGEST_POSITION_M * LARGEST_POSITION_M) &&
                               tc_up_to(tc_dot(estimate->velocity_world_m_s, estimate->velocity_world_m_s),
                                        LARGEST_VELOCITY_M_S * LARGEST_VELOCITY_M_S);
    const bool attitude_good =
        tc_up_to(tc_q_size2(estimate->q_world_body) - 0.8f, 0.4f) &&
        tc_up_to(tc_dot(estimate->rate_body_rad_s, estimate->rate_body_rad_s), LARGEST_RATE_RAD_S * LARGEST_RATE_RAD_S);
    if (position_good) {
        now->position_time_us = estimate->position_time_us;
    } else {
        faults |= TC_FAULT_POSITION_BAD;
    }
    if (attitude_good) {
        now->attitude_time_us = estimate->attitude_time_us;
    } else {
        faults |= TC_FAULT_ATTITUDE_BAD;
    }
    const float position_age = age_s(time_us, now->position_time_us);
    const float attitude_age = age_s(time_us, now->attitude_time_us);
    if (position_age > p->estimate_stale_s) faults |= TC_FAULT_POSITION_STALE;
    if (attitude_age > p->estimate_stale_s) faults |= TC_FAULT_ATTITUDE_STALE;
    predict_position(position_good ? estimate : now, c->telemetry.setpoint.acceleration_world_m_s2,
                     ahead_s(p, position_age, position_good, step_s), now);
    predict_attitude(attitude_good ? estimate : now, ahead_s(p, attitude_age, attitude_good, step_s), now);
    now->battery_v = tc_up_to(estimate->battery_v, LARGEST_BATTERY_V) ? estimate->battery_v : 0.0f;
    return faults;
}
