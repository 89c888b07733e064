/* Pose, gyro, accelerometer. */
#include "body_sensors.h"

#include <math.h>
#include <string.h>

#define HOVER_RAD_S 951.0

void body_sensors_default(body_sensors_config* c) {
    memset(c, 0, sizeof *c);
    c->pose_rate_hz = 100.0;
    c->delay_s = 0.01;
    c->position_noise_m = 0.003;
    c->velocity_noise_m_s = 0.02;
    c->attitude_noise_rad = 0.002;
    c->gyro_noise_rad_s = 0.02;
    c->accelerometer_noise_m_s2 = 0.1;
    c->vibration_m_s2 = 1.0;
    c->height_wander_s = 20.0;
    c->has_specific_force = 1;
    c->has_vertical_velocity = 1;
}

void body_sensors_init(body_sensors* s, const body_sensors_config* config, uint64_t seed) {
    memset(s, 0, sizeof *s);
    s->config = *config;
    s->latest.q_world_body[0] = 1.0f;
    body_seed(&s->random, seed, 1u);
    s->bad_axis = s->bad_rotor = -1;
}

static void yawed(double yaw_rad, const double in[3], double out[3]) {
    const double c = cos(yaw_rad), s = sin(yaw_rad), x = in[0], y = in[1];
    out[0] = c * x - s * y;
    out[1] = s * x + c * y;
    out[2] = in[2];
}

static void in_frame(const body_sensors* s, const double position_m[3], double out[3]) {
    yawed(s->yaw_rad, position_m, out);
    for (int k = 0; k < 3; k++) out[k] += s->shift_m[k];
}

void body_sensors_jump(body_sensors* s, const body* b, const double jump_m[3], double yaw_rad, uint8_t counted) {
    double before_m[3], before_m_s[3], after_m[3], after_m_s[3];
    in_frame(s, b->position_m, before_m);
    yawed(s->yaw_rad, b->velocity_m_s, before_m_s);
    s->yaw_rad += yaw_rad;
    in_frame(s, b->position_m, after_m);
    yawed(s->yaw_rad, b->velocity_m_s, after_m_s);
    const double told = counted == 2u ? 0.5 : 1.0;
    for (int k = 0; k < 3; k++) {
        s->shift_m[k] += before_m[k] + jump_m[k] - after_m[k];
        if (counted > 0u) {
            s->reset_position_m[k] = told * jump_m[k];
            s->reset_velocity_m_s[k] = told * (after_m_s[k] - before_m_s[k]);
        }
    }
    if (counted > 0u) s->reset_yaw_rad = told * yaw_rad;
    s->reset_counter = (uint8_t)(s->reset_counter + counted);
}

static void measure_pose(body_sensors* s, const body* b, uint64_t time_us, uint64_t clock_us, tc_estimate* e) {
    const body_sensors_config* c = &s->config;
    const double time_s = 1e-6 * (double)time_us;
    double position[3], velocity[3], turn[3], q[4];
    memset(e, 0, sizeof *e);
    in_frame(s, b->position_m, position);
    yawed(s->yaw_rad, b->velocity_m_s, velocity);
    position[2] += c->height_wander_m * sin(6.283185307179586 * time_s / c->height_wander_s);
    velocity[2] += c->vertical_bias_m_s;
    for (int k = 0; k < 3; k++) {
        e->position_world_m[k] = (float)(position[k] + c->position_noise_m * body_normal(&s->random));
        velocity[k] += s->velocity_error_m_s[k];
        e->velocity_world_m_s[k] = (float)(velocity[k] + c->velocity_noise_m_s * body_normal(&s->random));
        turn[k] = c->attitude_noise_rad * body_normal(&s->random) + (k < 2 ? c->tilt_error_rad[k] : 0.0);
        e->reset_position_world_m[k] = (float)s->reset_position_m[k];
        e->reset_velocity_world_m_s[k] = (float)s->reset_velocity_m_s[k];
    }
    const double seen_rad = s->yaw_rad + s->heading_rad;
    const double w = cos(0.5 * seen_rad), z = sin(0.5 * seen_rad), *p = b->q;
    const double seen[4] = {w * p[0] - z * p[3], w * p[1] - z * p[2], w * p[2] + z * p[1], w * p[3] + z * p[0]};
    body_turn(seen, turn, q);
    for (int k = 0; k < 4; k++) e->q_world_body[k] = (float)q[k];
    const double stamp_us = (double)clock_us + 1e6 * s->pose_stamp_offset_s;
    e->position_time_us = e->attitude_time_us = stamp_us > 0.0 ? (uint64_t)stamp_us : 0u;
    e->reset_counter = s->reset_counter;
    e->reset_yaw_rad = (float)s->reset_yaw_rad;
}

static void take_poses(body_sensors* s, const body* b, uint64_t time_us, uint64_t clock_us) {
    const body_sensors_config* c = &s->config;
    if (time_us >= s->next_pose_us) {
        body_pose* pose = &s->queue[s->queued++ % BODY_QUEUE];
        measure_pose(s, b, time_us, clock_us, &pose->estimate);
        pose->deliver_us = time_us + (uint64_t)(1e6 * c->delay_s);
        s->next_pose_us += (uint64_t)(1e6 / c->pose_rate_hz);
        if (s->next_pose_us <= time_us) s->next_pose_us = time_us + (uint64_t)(1e6 / c->pose_rate_hz);
    }
    while (s->delivered < s->queued && s->queue[s->delivered % BODY_QUEUE].deliver_us <= time_us) {
        const tc_estimate* e = &s->queue[s->delivered++ % BODY_QUEUE].estimate;
        tc_estimate* now = &s->latest;
        now->reset_counter = e->reset_counter;
        now->reset_yaw_rad = e->reset_yaw_rad;
        memcpy(now->reset_position_world_m, e->reset_position_world_m, sizeof e->reset_position_world_m);
        memcpy(now->reset_velocity_world_m_s, e->reset_velocity_world_m_s, sizeof e->reset_velocity_world_m_s);
        if (s->position != BODY_FROZEN) {
            const uint64_t older_us = (uint64_t)(int64_t)(1e6 * s->pose_age_s);
            now->position_time_us = e->position_time_us - older_us;
        }
        if (s->position != BODY_FROZEN && !s->stuck) {
            memcpy(now->position_world_m, e->position_world_m, sizeof e->position_world_m);
            memcpy(now->velocity_world_m_s, e->velocity_world_m_s, sizeof e->velocity_world_m_s);
        }
        if (s->attitude != BODY_FROZEN) {
            now->attitude_time_us = e->attitude_time_us;
            memcpy(now->q_world_body, e->q_world_body, sizeof e->q_world_body);
        }
    }
}

static void measure_rate(body_sensors* s, const body* b, uint64_t clock_us) {
    const body_sensors_config* c = &s->config;
    double fastest = 0.0;
    for (int i = 0; i < BODY_ROTORS; i++) fastest = fmax(fastest, b->rotor_rad_s[i] / HOVER_RAD_S);
    const double shaking = c->vibration_m_s2 * fastest * fastest;
    const double noise = sqrt(c->accelerometer_noise_m_s2 * c->accelerometer_noise_m_s2 + shaking * shaking);
    for (int k = 0; k < 3; k++) {
        s->latest.rate_body_rad_s[k] =
            (float)(b->rate_rad_s[k] + c->gyro_bias_rad_s[k] + c->gyro_noise_rad_s * body_normal(&s->random));
        s->latest.specific_force_body_m_s2[k] =
            (float)(b->specific_force_m_s2[k] + c->accelerometer_bias_m_s2[k] + noise * body_normal(&s->random));
    }
    s->latest.rate_time_us = clock_us;
}

static void spoil(float* values, int count) {
    for (int i = 0; i < count; i++) values[i] = NAN;
}

static uint8_t valid_bits(const body_sensors* s) {
    uint8_t valid = TC_VALID_ALL;
    if (s->position == BODY_NOT_VALID) valid &= (uint8_t)~15u; /* position and velocity, all axes */
    if (s->position == BODY_NO_XY) valid &= (uint8_t)~(unsigned)(TC_VALID_POSITION_XY | TC_VALID_VELOCITY_XY);
    if (s->attitude == BODY_NOT_VALID) valid &= (uint8_t)~(unsigned)TC_VALID_ATTITUDE;
    if (s->rate == BODY_NOT_VALID) valid &= (uint8_t)~(unsigned)(TC_VALID_RATE | TC_VALID_SPECIFIC_FORCE);
    if (s->config.has_specific_force == 0) valid &= (uint8_t)~(unsigned)TC_VALID_SPECIFIC_FORCE;
    if (s->config.has_vertical_velocity == 0) valid &= (uint8_t)~(unsigned)TC_VALID_VELOCITY_Z;
    return valid;
}

void body_sensors_read(body_sensors* s, const body* b, uint64_t time_us, uint64_t clock_us, double step_s,
                       tc_estimate* out) {
    const body_sensors_config* c = &s->config;
    for (int k = 0; k < 3; k++) s->shift_m[k] += step_s * s->drift_m_s[k];
    take_poses(s, b, time_us, clock_us);
    if (s->rate != BODY_FROZEN) measure_rate(s, b, clock_us);
    *out = s->latest;
    out->valid = valid_bits(s);
    out->position_std_m[0] = out->position_std_m[1] = (float)c->position_std_m;
    out->velocity_std_m_s[0] = out->velocity_std_m_s[1] = (float)c->velocity_std_m_s;
    out->battery_v = (float)c->battery_v;
    if (s->position == BODY_NAN || s->position == BODY_NOT_VALID || s->position == BODY_NO_XY) {
        const int count = s->position == BODY_NO_XY ? 2 : 3;
        spoil(out->position_world_m, count);
        spoil(out->velocity_world_m_s, count);
    }
    if (s->attitude == BODY_NAN || s->attitude == BODY_NOT_VALID) spoil(out->q_world_body, 4);
    if (c->has_vertical_velocity == 0) spoil(out->velocity_world_m_s + 2, 1);
    if (c->has_specific_force == 0) spoil(out->specific_force_body_m_s2, 3);
    if (s->bad_axis >= 0) spoil(out->rate_body_rad_s + s->bad_axis, 1);
    if (s->bad_rotor >= 0) {
        for (int i = 0; i < BODY_ROTORS; i++) out->rotor_speed_rad_s[i] = (float)b->rotor_rad_s[i];
        out->rotor_speed_rad_s[s->bad_rotor] = (float)s->rotor_rad_s;
        out->valid |= (uint8_t)TC_VALID_ROTOR_SPEED;
    }
    if (s->rate == BODY_NAN || s->rate == BODY_NOT_VALID) {
        spoil(out->rate_body_rad_s, 3);
        spoil(out->specific_force_body_m_s2, 3);
    }
}
