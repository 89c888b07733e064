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

/* Attitude by the last body rate: a small turn, second order. The size of a product is the product of the sizes. */
static inline void predict_attitude(const tc_estimate* from, float q_size2, float rate2, float ahead,
                                    tc_estimate* now) {
    const float half = 0.5f * ahead, *q = from->q_world_body, *rate = from->rate_body_rad_s;
    const float scale = 1.0f / sqrtf(q_size2 * (1.0f + half * half * rate2));
    const float w = scale * q[0], x = scale * q[1], y = scale * q[2], z = scale * q[3];
    const float a = half * rate[0], b = half * rate[1], c = half * rate[2];
    now->q_world_body[0] = w - x * a - y * b - z * c;
    now->q_world_body[1] = x + w * a + y * c - z * b;
    now->q_world_body[2] = y + w * b + z * a - x * c;
    now->q_world_body[3] = z + w * c + x * b - y * a;
    tc_copy(now->rate_body_rad_s, rate);
}

/* Position and velocity, or what was carried so far; returns the fault bits. */
static inline uint8_t take_position(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate) {
    const tc_parameters* p = &c->parameters;
    tc_estimate* now = &c->telemetry.estimate;
    const bool good = tc_up_to(tc_dot(estimate->position_world_m, estimate->position_world_m),
                               LARGEST_POSITION_M * LARGEST_POSITION_M) &&
                      tc_up_to(tc_dot(estimate->velocity_world_m_s, estimate->velocity_world_m_s),
                               LARGEST_VELOCITY_M_S * LARGEST_VELOCITY_M_S);
    if (good) now->position_time_us = estimate->position_time_us;
    const float age = age_s(time_us, now->position_time_us);
    predict_position(good ? estimate : now, c->telemetry.setpoint.acceleration_world_m_s2,
                     ahead_s(p, age, good, step_s), now);
    return (uint8_t)((good ? 0u : (uint32_t)TC_FAULT_POSITION_BAD) |
                     (age > p->estimate_stale_s ? (uint32_t)TC_FAULT_POSITION_STALE : 0u));
}

static inline uint8_t take_attitude(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate) {
    const tc_parameters* p = &c->parameters;
    tc_estimate* now = &c->telemetry.estimate;
    const tc_estimate* from = estimate;
    float q_size2 = tc_q_size2(from->q_world_body), rate2 = tc_dot(from->rate_body_rad_s, from->rate_body_rad_s);
    const bool good = tc_up_to(q_size2 - 0.8f, 0.4f) && tc_up_to(rate2, LARGEST_RATE_RAD_S * LARGEST_RATE_RAD_S);
    if (good) {
        now->attitude_time_us = estimate->attitude_time_us;
    } else {
        from = now;
        q_size2 = tc_q_size2(from->q_world_body);
        rate2 = tc_dot(from->rate_body_rad_s, from->rate_body_rad_s);
    }
    const float age = age_s(time_us, now->attitude_time_us);
    predict_attitude(from, q_size2, rate2, ahead_s(p, age, good, step_s), now);
    return (uint8_t)((good ? 0u : (uint32_t)TC_FAULT_ATTITUDE_BAD) |
                     (age > p->estimate_stale_s ? (uint32_t)TC_FAULT_ATTITUDE_STALE : 0u));
}

uint8_t tc_take_estimate(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate) {
    const uint8_t position = take_position(c, time_us, step_s, estimate);
    const uint8_t attitude = take_attitude(c, time_us, step_s, estimate);
    const float battery_v = estimate->battery_v;
    c->telemetry.estimate.battery_v = tc_up_to(battery_v, LARGEST_BATTERY_V) ? battery_v : 0.0f;
    return position | attitude;
}
