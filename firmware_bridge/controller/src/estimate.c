/* The door for the estimate: only finite, plausible numbers get in; what is missing is carried forward for a while. */
#include "internal.h"
#include "maths.h"

#define LARGEST_POSITION_M 30000.0f
#define LARGEST_VELOCITY_M_S 150.0f
#define LARGEST_RATE_RAD_S 100.0f
#define LARGEST_BATTERY_V 1000.0f
#define LONGEST_AGE_S 10.0f
#define LONGEST_AGE_US 10000000u
/* Of the fault bits, from the position's to the attitude's. */
#define ATTITUDE_BITS 2u
_Static_assert((uint32_t)TC_FAULT_ATTITUDE_STALE == (uint32_t)TC_FAULT_POSITION_STALE << ATTITUDE_BITS &&
                   (uint32_t)TC_FAULT_ATTITUDE_BAD == (uint32_t)TC_FAULT_POSITION_BAD << ATTITUDE_BITS,
               "the bits of the attitude follow those of the position");

/* What both halves of an estimate ask: is it too old (the fault bits, as for the position), and how far is it to be
   carried forward: a fresh sample by its whole age, what was carried before only by what is new since then. */
static TC_APART uint8_t carry(const tc_parameters* p, uint64_t time_us, uint64_t stamp_us, float step_s, bool fresh,
                              float* ahead_s) {
    const uint64_t since_us = stamp_us < time_us ? time_us - stamp_us : 0u;
    const float age_s = since_us > LONGEST_AGE_US ? LONGEST_AGE_S : (float)(uint32_t)since_us * 1e-6f;
    const float whole_s = age_s + p->predict_extra_s;
    *ahead_s = tc_min(whole_s, p->predict_max_s);
    if (!fresh) *ahead_s = tc_max(*ahead_s - tc_max(whole_s - step_s, 0.0f), 0.0f);
    return (uint8_t)((fresh ? 0u : (uint32_t)TC_FAULT_POSITION_BAD) |
                     (age_s > p->estimate_stale_s ? (uint32_t)TC_FAULT_POSITION_STALE : 0u));
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
    tc_estimate* now = &c->telemetry.estimate;
    const bool good = tc_up_to(tc_dot(estimate->position_world_m, estimate->position_world_m),
                               LARGEST_POSITION_M * LARGEST_POSITION_M) &&
                      tc_up_to(tc_dot(estimate->velocity_world_m_s, estimate->velocity_world_m_s),
                               LARGEST_VELOCITY_M_S * LARGEST_VELOCITY_M_S);
    if (good) now->position_time_us = estimate->position_time_us;
    float ahead_s;
    const uint8_t faults = carry(&c->parameters, time_us, now->position_time_us, step_s, good, &ahead_s);
    predict_position(good ? estimate : now, c->telemetry.setpoint.acceleration_world_m_s2, ahead_s, now);
    return faults;
}

static inline uint8_t take_attitude(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate) {
    tc_estimate* now = &c->telemetry.estimate;
    const tc_estimate* from = estimate;
    float q_size2 = tc_q_size2(from->q_world_body), rate2 = tc_dot(from->rate_body_rad_s, from->rate_body_rad_s);
    const bool good = tc_up_to(q_size2 - 0.8f, 0.4f) && tc_up_to(rate2, LARGEST_RATE_RAD_S * LARGEST_RATE_RAD_S);
    if (good) {
        now->attitude_time_us = estimate->attitude_time_us;
    } else {
        from = now;
        q_size2 = 1.0f;
        rate2 = tc_dot(from->rate_body_rad_s, from->rate_body_rad_s);
    }
    float ahead_s;
    const uint8_t faults = carry(&c->parameters, time_us, now->attitude_time_us, step_s, good, &ahead_s);
    predict_attitude(from, q_size2, rate2, ahead_s, now);
    return faults;
}

uint8_t tc_take_estimate(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate) {
    const uint8_t position = take_position(c, time_us, step_s, estimate);
    const uint8_t attitude = take_attitude(c, time_us, step_s, estimate);
    const float battery_v = estimate->battery_v;
    c->telemetry.estimate.battery_v = tc_up_to(battery_v, LARGEST_BATTERY_V) ? battery_v : 0.0f;
    return (uint8_t)(position | attitude << ATTITUDE_BITS);
}
