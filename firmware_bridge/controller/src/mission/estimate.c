/* Input validation of the estimate: only finite, plausible, sufficiently certain numbers are used; what is missing is
   dead reckoned. */
#include "../base/maths.h"
#include "internal.h"

static const float LARGEST_POSITION_M = 30000.0f; /* float32 still resolves 2 mm there */
static const float LARGEST_VELOCITY_M_S = 150.0f; /* no quadrotor is as fast */
static const float LARGEST_TURN_RAD = 6.3f;       /* of a relocalization */
static const float LARGEST_RATE_RAD_S = 100.0f;   /* 5730 degrees a second, beyond the range of gyros */
static const float LARGEST_FORCE_M_S2 = 500.0f;   /* 51 g: a collision at most */
static const float LARGEST_BATTERY_V = 1000.0f;   /* no pack of a quadrotor */
static const float OVERSPEED = 1.5f; /* of rotor_max: no rotor turns faster, but a counter of pulses may say so */
static const uint32_t OLDEST_US = 1000000u; /* a stamp further from the clock, back or ahead, is implausible */
static const float NEVER_S = 1e6f;          /* longer than any limit; finite, to compute with */
static const uint32_t AFTER_STEP_US =
    500000u; /* so long stamps that disagree with the clock are put down to its step */
/* How dead reckoning errs: a velocity of 0.15 m/s, and an acceleration of 0.2 m/s^2 from 1 degree of tilt and the
   accelerometer's bias, in each horizontal axis. */
static const float RECKONED_VELOCITY_STD_M_S = 0.15f;
static const float RECKONED_ACCELERATION_STD_M_S2 = 0.2f;
static const float LONGEST_APART_S = 0.1f;   /* two attitudes that tell how it turns, */
static const float TURNING_FILTER_S = 0.05f; /* whose noise (0.3 rad/s at 100 Hz) is brought to 0.1 */
static const float UNKNOWN_LAG_S = 0.025f;   /* of rotors whose lag nobody has learnt */
static const float FELT_FILTER_S = 0.02f;

static bool marked(const tc_estimate* estimate, uint32_t bits) { return (estimate->valid & bits) == bits; }

static uint64_t longer(uint64_t a_us, uint64_t b_us) { return a_us > b_us ? a_us : b_us; }

/* Notes when a usable sample was true, in controller time. A stamp that has come before keeps its time. */
static void note_sample(const tc_controller* c, tc_sample_time* sample, uint64_t stamp_us) {
    const bool clock_stands = c->stalled_ticks > 0u && c->step_us > 0u; /* and its stamps, while time goes on */
    if (stamp_us == sample->stamp_us && sample->true_us != 0u && !clock_stands) return;
    const uint64_t now_us = c->telemetry.time_us;
    uint64_t age_us = stamp_us < c->caller_us ? c->caller_us - stamp_us : 0u;
    const bool in_time = age_us <= OLDEST_US && stamp_us <= c->caller_us + OLDEST_US;
    const bool clock_stepped = c->telemetry.refused_ticks > 0u && now_us - c->clock_fault_us < AFTER_STEP_US;
    if (!in_time || clock_stands) age_us = clock_stepped || clock_stands ? sample->age_us : longer(age_us, OLDEST_US);
    sample->stamp_us = stamp_us;
    sample->age_us = age_us;
    const uint64_t true_us = age_us < now_us ? now_us - age_us : 1u;
    if (true_us > sample->true_us) sample->true_us = true_us; /* an older sample tells nothing new */
}

/* Of what was true then, in controller time; 0: never. */
static float age_s(const tc_controller* c, uint64_t true_us) {
    const uint64_t now_us = c->telemetry.time_us;
    if (true_us == 0u) return NEVER_S;
    return true_us < now_us ? tc_seconds(now_us - true_us) : 0.0f;
}

/* How far a fresh sample is to be carried to the tick: never back, whatever delay was found. */
static float ahead_s(const tc_parameters* p, float sample_age_s) {
    return tc_clamp(sample_age_s + p->predict_extra_s, 0.0f, p->predict_max_s);
}

/* What the vehicle accelerates at: by its accelerometer, else by its attitude and the thrust that was asked for, which
   have the feedback in them: a set-point's acceleration has not, and an error of velocity would be flown for ever. */
static void reckoned_acceleration(tc_controller* c, const tc_estimate* estimate, float out[3]) {
    const tc_parameters* p = &c->parameters;
    const bool in_air = tc_mission_in_air(c->mission.state);
    const float asked_m_s2[3] = {0.0f, 0.0f, in_air ? c->telemetry.wrench.thrust_n / p->mass_kg : p->gravity_m_s2};
    const bool felt = marked(&c->telemetry.estimate, TC_VALID_SPECIFIC_FORCE);
    tc_to_world(c->axes, felt ? estimate->specific_force_body_m_s2 : asked_m_s2, out);
    out[2] -= p->gravity_m_s2;
}

static bool plausible(const float* values, int count, float largest) {
    for (int i = 0; i < count; i++) {
        if (!(tc_abs(values[i]) <= largest)) return false; /* nor is NaN */
    }
    return true;
}

static bool certain(float std, float bound) { return tc_finite(std) && std <= bound; }

/* The horizontal or the vertical part of position and velocity. */
typedef struct {
    uint32_t position_bits, velocity_bits; /* of tc_estimate.valid */
    int first, count;                      /* axes */
    int std;                               /* index of its standard deviations */
} tc_part;

static const tc_part horizontal = {TC_VALID_POSITION_XY, TC_VALID_VELOCITY_XY, 0, 2, 0};
static const tc_part vertical = {TC_VALID_POSITION_Z, TC_VALID_VELOCITY_Z, 2, 1, 1};

typedef struct {
    bool position; /* this sample is usable */
    bool velocity; /* measured, not dead reckoned */
    float age_s;   /* of the last usable position */
} tc_taken;

/* Those of its valid bits whose numbers can be. */
static uint32_t plausible_bits(const tc_estimate* e, const tc_part* part) {
    const bool position = plausible(&e->position_world_m[part->first], part->count, LARGEST_POSITION_M);
    const bool velocity = plausible(&e->velocity_world_m_s[part->first], part->count, LARGEST_VELOCITY_M_S);
    return e->valid & ((position ? part->position_bits : 0u) | (velocity ? part->velocity_bits : 0u));
}

/* Measured and carried to the tick by the acceleration that is asked for, or dead reckoned from where it was. */
static tc_taken take_part(tc_controller* c, const tc_estimate* e, const tc_part* part, tc_position_time* times,
                          const float reckoned_m_s2[3], uint32_t usable, float step_s) {
    const tc_parameters* p = &c->parameters;
    tc_estimate* now = &c->telemetry.estimate;
    const int first = part->first;
    const bool velocity =
        (usable & part->velocity_bits) != 0u && certain(e->velocity_std_m_s[part->std], p->velocity_std_m_s);
    const bool position =
        velocity && (usable & part->position_bits) != 0u && certain(e->position_std_m[part->std], p->position_std_m);
    if (position) {
        note_sample(c, &times->position, e->position_time_us);
        times->velocity = times->position; /* it came with it */
    } else if (velocity) {
        note_sample(c, &times->velocity, e->position_time_us);
    } else {
        /* nothing has come */
    }
    const float position_age_s = age_s(c, times->position.true_us);
    const float ahead = ahead_s(p, position_age_s + tc_position_delay_s(c));
    /* The acceleration has changed on the way, which counts where the pose is later than its stamp says. */
    const float bend_s2 = tc_cancels_disturbance(c) ? 0.5f * ahead * ahead : 0.0f;
    const bool fresh = position && position_age_s <= p->estimate_stale_s; /* and its velocity, which is no older */
    const bool has_velocity = fresh || (velocity && age_s(c, times->velocity.true_us) <= p->estimate_stale_s);
    for (int i = first; i < first + part->count; i++) {
        if (fresh) {
            const float gain = ahead * c->telemetry.setpoint.acceleration_world_m_s2[i];
            const float bend_m_s = bend_s2 * c->telemetry.setpoint.jerk_world_m_s3[i];
            now->position_world_m[i] = e->position_world_m[i] + ahead * (e->velocity_world_m_s[i] + 0.5f * gain);
            now->position_world_m[i] -= 0.6667f * ahead * bend_m_s;
            now->velocity_world_m_s[i] = e->velocity_world_m_s[i] + gain - bend_m_s;
        } else {
            const float gain = step_s * reckoned_m_s2[i];
            if (has_velocity) now->velocity_world_m_s[i] = e->velocity_world_m_s[i] - gain;
            now->position_world_m[i] += step_s * (now->velocity_world_m_s[i] + 0.5f * gain);
            now->velocity_world_m_s[i] += gain;
        }
    }
    now->position_std_m[part->std] = tc_finite(e->position_std_m[part->std]) ? e->position_std_m[part->std] : 0.0f;
    now->velocity_std_m_s[part->std] =
        tc_finite(e->velocity_std_m_s[part->std]) ? e->velocity_std_m_s[part->std] : 0.0f;
    return (tc_taken){position, has_velocity, position_age_s};
}

/* How long position has been dead reckoned, and what it may be off by then (horizontal, both axes). */
static void describe_reckoning(tc_telemetry* t, float time_s) {
    const float velocity = RECKONED_VELOCITY_STD_M_S * time_s;
    const float acceleration = 0.5f * RECKONED_ACCELERATION_STD_M_S2 * time_s * time_s;
    t->reckoning_s = time_s;
    t->reckoning_std_m = sqrtf(2.0f * (velocity * velocity + acceleration * acceleration));
}

static tc_monitored monitored(uint32_t usable) {
    const uint32_t level = (uint32_t)TC_VALID_POSITION_XY | TC_VALID_VELOCITY_XY;
    const uint32_t height = (uint32_t)TC_VALID_POSITION_Z | TC_VALID_VELOCITY_Z;
    if ((usable & level) == level) return usable == (level | height) ? TC_MONITORED_ALL : TC_MONITORED_LEVEL;
    return (usable & height) == height ? TC_MONITORED_HEIGHT : TC_MONITORED_NONE;
}

/* Whether there is a part of a pose that the monitor can judge, in the air. */
static void monitor(tc_controller* c, const tc_estimate* e, uint32_t usable, const float reckoned_m_s2[3],
                    float step_s) {
    const tc_monitored part = monitored(usable);
    if (!tc_mission_in_air(c->mission.state) || c->parameters.monitor < 0.5f) {
        const float shake_m2_s4 = c->monitor.shake_m2_s4;
        memset(&c->monitor, 0, sizeof c->monitor);
        c->monitor.shake_m2_s4 = shake_m2_s4;
    } else if (part != TC_MONITORED_NONE) {
        const uint64_t age_us = e->position_time_us < c->caller_us ? c->caller_us - e->position_time_us : 0u;
        const float age = tc_seconds(age_us);
        const bool clock_stepped = c->telemetry.refused_ticks > 0u && c->clock_fault_us == c->telemetry.time_us;
        if (age > c->parameters.estimate_stale_s || clock_stepped) {
            c->monitor.running = false;
        } else {
            tc_monitor_step(c, e, part, reckoned_m_s2, ahead_s(&c->parameters, age), step_s);
        }
    } else {
        c->monitor.running = false;
    }
}

static uint32_t take_position(tc_controller* c, const tc_estimate* e, float step_s) {
    float reckoned[3];
    reckoned_acceleration(c, e, reckoned);
    const uint32_t level_bits = plausible_bits(e, &horizontal), height_bits = plausible_bits(e, &vertical);
    monitor(c, e, level_bits | height_bits, reckoned, step_s);
    const uint32_t level_usable = tc_monitor_believes(c) ? level_bits : 0u;
    const uint32_t height_usable = tc_monitor_believes_height(c) ? height_bits : 0u;
    const tc_taken level = take_part(c, e, &horizontal, &c->horizontal, reckoned, level_usable, step_s);
    const tc_taken height = take_part(c, e, &vertical, &c->vertical, reckoned, height_usable, step_s);
    c->vertical_velocity = height.velocity;
    if (level.position) c->telemetry.estimate.position_time_us = e->position_time_us;
    const bool stale = tc_max(level.age_s, height.age_s) > c->parameters.estimate_stale_s;
    if (!stale) c->position_good_us = c->telemetry.time_us;
    describe_reckoning(&c->telemetry, stale ? age_s(c, c->position_good_us) : 0.0f);
    return (level.position && height.position ? 0u : (uint32_t)TC_FAULT_POSITION_UNUSABLE) |
           (stale ? (uint32_t)TC_FAULT_POSITION_STALE : 0u);
}

/* A small turn by the body rate, second order. The size of a product is the product of the sizes. */
static void turn(const float q[4], float q_size2, const float rate[3], float time_s, float out[4]) {
    const float half = 0.5f * time_s;
    const float scale = 1.0f / sqrtf(q_size2 * (1.0f + half * half * tc_dot(rate, rate)));
    const float w = scale * q[0], x = scale * q[1], y = scale * q[2], z = scale * q[3];
    const float a = half * rate[0], b = half * rate[1], c = half * rate[2];
    out[0] = w - x * a - y * b - z * c;
    out[1] = x + w * a + y * c - z * b;
    out[2] = y + w * b + z * a - x * c;
    out[3] = z + w * c + x * b - y * a;
}

/* The rate without a gyro: the torque that is asked of the rotors, as they lag, over the inertia. */
static void predict_turning(tc_controller* c, float step_s) {
    const tc_parameters* p = &c->parameters;
    const float lag_s = p->rotor_lag_s > 0.0f ? p->lead_filter_s : UNKNOWN_LAG_S;
    const float pass = step_s / (lag_s + step_s);
    if (!c->turning_known) {
        tc_copy(c->turning_rad_s, c->telemetry.estimate.rate_body_rad_s);
        tc_copy(c->lagging_n_m, c->telemetry.wrench.torque_n_m);
        c->turning_us = 0u;
        c->turning_known = true;
    }
    for (int i = 0; i < 3; i++) {
        c->lagging_n_m[i] += pass * (c->telemetry.wrench.torque_n_m[i] - c->lagging_n_m[i]);
        c->turning_rad_s[i] += step_s * c->lagging_n_m[i] / p->inertia_kg_m2[i];
    }
}

/* ... corrected by two attitudes in a row. They tell the rate of half their distance and the pose's delay ago, so that
   it is compared with what was predicted at the first of them. */
static void measure_turning(tc_controller* c, const float q[4], uint64_t stamp_us) {
    const uint64_t apart_us = stamp_us - c->turning_us;
    if (apart_us == 0u) return;
    const float apart_s = tc_seconds(apart_us);
    if (apart_s < LONGEST_APART_S && c->turning_us != 0u) {
        const float back[4] = {c->last_q[0], -c->last_q[1], -c->last_q[2], -c->last_q[3]};
        float change[4];
        tc_q_multiply(back, q, change);
        const float per_s = (change[0] < 0.0f ? -2.0f : 2.0f) / apart_s, pass = apart_s / (TURNING_FILTER_S + apart_s);
        for (int i = 0; i < 3; i++) c->turning_rad_s[i] += pass * (per_s * change[i + 1] - c->turned_rad_s[i]);
    }
    tc_copy(c->turned_rad_s, c->turning_rad_s);
    tc_copy4(c->last_q, q);
    c->turning_us = stamp_us;
}

/* Axes that the gyro does not give are told by torque and attitude, or for a while by torque alone. Whether any was
   measured. */
static bool replace_axes(tc_controller* c, float rate_rad_s[3], float step_s) {
    const bool corrected = (c->telemetry.estimate_faults & (uint32_t)TC_FAULT_ATTITUDE_STALE) == 0u;
    bool any = false;
    if (!corrected && tc_gyro_axis_is_gone(c)) return false;
    predict_turning(c, step_s);
    for (int i = 0; i < 3; i++) {
        const bool good = tc_abs(rate_rad_s[i]) <= LARGEST_RATE_RAD_S;
        any = any || good;
        if (!good) rate_rad_s[i] = c->turning_rad_s[i];
    }
    return any;
}

static uint32_t take_rate(tc_controller* c, const tc_estimate* e, float step_s) {
    tc_estimate* now = &c->telemetry.estimate;
    const bool whole =
        tc_up_to(tc_dot(e->rate_body_rad_s, e->rate_body_rad_s), LARGEST_RATE_RAD_S * LARGEST_RATE_RAD_S);
    float rate[3];
    tc_copy(rate, e->rate_body_rad_s);
    const bool usable = marked(e, TC_VALID_RATE) && (whole || replace_axes(c, rate, step_s));
    if (whole && usable) {
        c->gyro_good_us = c->telemetry.time_us;
        c->turning_known = false;
    }
    if (usable) {
        note_sample(c, &c->rate, e->rate_time_us);
        tc_copy(now->rate_body_rad_s, rate);
        now->rate_time_us = e->rate_time_us;
    }
    return (usable ? 0u : (uint32_t)TC_FAULT_RATE_UNUSABLE) |
           (age_s(c, c->rate.true_us) > c->parameters.estimate_stale_s ? (uint32_t)TC_FAULT_RATE_STALE : 0u);
}

/* Over the way that the attitude is to be carried: its middle is half as far back, as a low-pass of that time is. */
static const float* mean_rate(tc_controller* c, float ahead, float step_s) {
    const float* rate = c->telemetry.estimate.rate_body_rad_s;
    if (!tc_cancels_disturbance(c)) {
        tc_copy(c->mean_rate_rad_s, rate);
        return rate;
    }
    const float pass = step_s / (step_s + 0.5f * ahead + 1e-6f);
    for (int i = 0; i < 3; i++) c->mean_rate_rad_s[i] += pass * (rate[i] - c->mean_rate_rad_s[i]);
    return c->mean_rate_rad_s;
}

/* Measured and carried to the tick, or the last one turned on by the gyro. */
static uint32_t take_attitude(tc_controller* c, const tc_estimate* e, float step_s) {
    tc_estimate* now = &c->telemetry.estimate;
    const float q_size2 = tc_q_size2(e->q_world_body);
    const bool usable = marked(e, TC_VALID_ATTITUDE) && tc_up_to(q_size2 - 0.8f, 0.4f);
    if (usable) {
        note_sample(c, &c->attitude, e->attitude_time_us);
        if (c->turning_known) measure_turning(c, e->q_world_body, e->attitude_time_us);
        now->attitude_time_us = e->attitude_time_us;
    }
    const float attitude_age_s = age_s(c, c->attitude.true_us);
    const bool stale = attitude_age_s > c->parameters.estimate_stale_s;
    if (usable && !stale) {
        const float ahead = ahead_s(&c->parameters, attitude_age_s + c->delay.attitude.delay_s);
        float q[4];
        tc_monitor_heading(c, e, step_s, q);
        turn(q, q_size2, mean_rate(c, ahead, step_s), ahead, now->q_world_body);
    } else {
        turn(now->q_world_body, tc_q_size2(now->q_world_body), now->rate_body_rad_s, step_s, now->q_world_body);
    }
    return (usable ? 0u : (uint32_t)TC_FAULT_ATTITUDE_UNUSABLE) | (stale ? (uint32_t)TC_FAULT_ATTITUDE_STALE : 0u);
}

/* Whether the accelerometer tells something. */
static bool take_force(tc_controller* c, const tc_estimate* e, float step_s) {
    const float* force = e->specific_force_body_m_s2;
    const bool usable = marked(e, TC_VALID_SPECIFIC_FORCE) &&
                        tc_up_to(tc_dot(force, force), LARGEST_FORCE_M_S2 * LARGEST_FORCE_M_S2) &&
                        (c->telemetry.estimate_faults & (uint32_t)TC_FAULT_RATE_STALE) == 0u;
    if (usable) {
        tc_monitor_shaking(c, force, step_s);
        tc_copy(c->telemetry.estimate.specific_force_body_m_s2, force);
        const float pass = step_s / (FELT_FILTER_S + step_s);
        for (int i = 0; i < 3; i++) c->felt_m_s2[i] += pass * (force[i] - c->felt_m_s2[i]);
    }
    return usable;
}

/* Whether rotor speeds are measured; zero where not. */
static bool take_rotors(tc_controller* c, const tc_estimate* e) {
    tc_estimate* now = &c->telemetry.estimate;
    const bool told = marked(e, TC_VALID_ROTOR_SPEED);
    if (!told && !marked(now, TC_VALID_ROTOR_SPEED)) return false; /* as in the last tick */
    const bool usable = told && plausible(e->rotor_speed_rad_s, TC_ROTORS, OVERSPEED * c->parameters.rotor_max_rad_s);
    for (int i = 0; i < TC_ROTORS; i++) now->rotor_speed_rad_s[i] = usable ? e->rotor_speed_rad_s[i] : 0.0f;
    return usable;
}

/* What is measured beside the pose, in its valid bits of telemetry.estimate: whether it is there. */
static void take_more(tc_controller* c, const tc_estimate* e, float step_s) {
    const uint32_t force = take_force(c, e, step_s) ? 0u : (uint32_t)TC_VALID_SPECIFIC_FORCE;
    const uint32_t rotors = take_rotors(c, e) ? 0u : (uint32_t)TC_VALID_ROTOR_SPEED;
    c->telemetry.estimate.valid = (uint8_t)(e->valid & ~(force | rotors));
}

/* The estimator has moved its frame: what is flown moves with it, so that nothing jumps. */
static void follow_reset(tc_controller* c, const tc_estimate* e) {
    const uint8_t steps = (uint8_t)(e->reset_counter - c->reset_counter);
    const bool known = c->had_estimate;
    c->reset_counter = e->reset_counter;
    c->had_estimate = true;
    if (!known || steps == 0u || !tc_mission_in_air(c->mission.state) || c->mission.state == TC_EMERGENCY) return;
    if (steps != 1u || !plausible(e->reset_position_world_m, 3, LARGEST_POSITION_M) ||
        !plausible(e->reset_velocity_world_m_s, 3, LARGEST_VELOCITY_M_S) ||
        !plausible(&e->reset_yaw_rad, 1, LARGEST_TURN_RAD)) {
        (void)tc_post(c, TC_EVENT_RELOCALIZED, TC_RELOCALIZED);
        return;
    }
    if (tc_mission_on_path(c->mission.state)) {
        tc_supervisor_shift(&c->supervisor, e->reset_position_world_m, e->reset_velocity_world_m_s, e->reset_yaw_rad);
    } else {
        tc_move_shift(&c->move, e->reset_position_world_m, e->reset_yaw_rad);
        c->landing.z_m += e->reset_position_world_m[2];
    }
    for (int i = 0; i < 3; i++) c->telemetry.setpoint.position_world_m[i] += e->reset_position_world_m[i];
    c->telemetry.setpoint.yaw_rad += e->reset_yaw_rad;
    float sine, cosine;
    tc_sin_cos(0.5f * e->reset_yaw_rad, &sine, &cosine);
    const float heading[4] = {cosine, 0.0f, 0.0f, sine};
    tc_flatness_turn(&c->telemetry.flatness, heading);
    tc_observer_turn(&c->observer, heading);
    c->delay.started = false;
}

void tc_take_estimate(tc_controller* c, const tc_estimate* estimate, float step_s) {
    const uint32_t rate = take_rate(c, estimate, step_s);
    const uint32_t attitude = take_attitude(c, estimate, step_s);
    c->telemetry.estimate_faults = (uint8_t)rate;
    take_more(c, estimate, step_s);
    const uint32_t position = take_position(c, estimate, step_s);
    const uint32_t faults = rate | attitude | position;
    c->telemetry.estimate_faults = (uint8_t)faults;
    if (faults != 0u || c->good_since_us == 0u) c->good_since_us = c->telemetry.time_us;
    if ((faults & (uint32_t)TC_FAULT_POSITION_UNUSABLE) == 0u) follow_reset(c, estimate);
    c->seen_counter = estimate->reset_counter;
    const float battery_v = estimate->battery_v;
    c->telemetry.estimate.battery_v = tc_up_to(battery_v, LARGEST_BATTERY_V) ? battery_v : 0.0f;
    tc_q_axes(c->telemetry.estimate.q_world_body, c->axes);
}
