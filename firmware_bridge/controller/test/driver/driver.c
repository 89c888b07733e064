/* Flies a scripted mission against a small rigid body and prints the CRC-32 of everything the controller said. The same
   file runs on the host (sanitizers, gcc against clang) and on Cortex-M under QEMU; equal CRCs mean equal bits. */
#include "driver.h"

#include <string.h>

#include "goshawk_controller/goshawk_controller.h"

#ifndef STEP_US
#define STEP_US 1000u
#endif
#define SEGMENTS 12
#ifndef ADJUST
#define ADJUST /* assignments to `parameters`, for other vehicles than the preset one */
#endif

typedef struct {
    float position[3], velocity[3], q[4], rate[3];
} body;

static tc_controller controller;
static uint32_t random_state;

static float noise(float size) {
    random_state = random_state * 1664525u + 1013904223u;
    return size * ((float)(int32_t)(random_state >> 8) * (1.0f / 8388608.0f) - 1.0f);
}

/* From rest at one corner to rest at the next along the degree-11 smooth step; all twelve coefficients in use. */
static void leg(const float from[TC_AXES], const float to[TC_AXES], uint32_t duration_us, tc_segment* out) {
    static const float step[TC_MAX_COEFFICIENTS] = {0.5f, 1.3535156f,  0.0f, -2.2558594f, 0.0f, 2.7070312f,
                                                    0.0f, -1.9335938f, 0.0f, 0.7519531f,  0.0f, -0.12304688f};
    out->duration_us = duration_us;
    for (int axis = 0; axis < TC_AXES; axis++) {
        for (int i = 0; i < TC_MAX_COEFFICIENTS; i++) out->coefficient[axis][i] = step[i] * (to[axis] - from[axis]);
        out->coefficient[axis][0] += from[axis];
    }
}

static void corner(int index, float out[TC_AXES]) {
    static const float corners[6][TC_AXES] = {{0.0f, 0.0f, 1.5f, 0.0f},   {6.0f, 1.0f, 2.0f, 1.5f},
                                              {4.0f, 5.0f, 1.2f, 0.4f},   {-3.0f, 4.0f, 2.5f, -1.0f},
                                              {-5.0f, -2.0f, 1.0f, 2.0f}, {2.0f, -4.0f, 3.0f, -0.5f}};
    memcpy(out, corners[index % 6], sizeof corners[0]);
}

static tc_reason put_all(uint32_t crc32) {
    const tc_trajectory_header header = {
        .id = 7u, .crc32 = crc32, .segment_count = SEGMENTS, .coefficient_count = TC_MAX_COEFFICIENTS};
    tc_reason reason = tc_upload_begin(&controller, &header);
    for (int i = 0; i < SEGMENTS && reason == TC_OK; i++) {
        float from[TC_AXES], to[TC_AXES];
        tc_segment segment;
        corner(i, from);
        corner(i + 1, to);
        leg(from, to, 2400000u + 100000u * (uint32_t)(i % 5), &segment);
        reason = tc_upload_segment(&controller, (uint16_t)i, &segment);
    }
    return reason;
}

static tc_reason upload(void) {
    tc_reason reason = put_all(0u);
    if (reason != TC_OK) return reason;
    const uint32_t crc32 = tc_trajectory_crc32(tc_store_staged(&controller.store));
    reason = put_all(crc32);
    if (reason == TC_OK) reason = TC_BUSY;
    while (reason == TC_BUSY) reason = tc_upload_finish(&controller);
    return reason == TC_OK ? tc_upload_activate(&controller, 7u, crc32) : reason;
}

static void measure(const body* b, uint64_t time_us, tc_estimate* out) {
    memset(out, 0, sizeof *out);
    out->position_time_us = time_us;
    out->attitude_time_us = time_us;
    out->rate_time_us = time_us;
    out->valid = TC_VALID_POSE | TC_VALID_SPECIFIC_FORCE;
    const tc_telemetry* t = tc_telemetry_now(&controller);
    const tc_parameters* p = &controller.parameters;
    for (int i = 0; i < 3; i++) {
        out->specific_force_body_m_s2[i] = noise(0.1f);
        out->position_world_m[i] = b->position[i] + noise(0.002f);
        out->velocity_world_m_s[i] = b->velocity[i] + noise(0.01f);
        out->rate_body_rad_s[i] = b->rate[i] + noise(0.01f);
    }
    for (int i = 0; i < 4; i++) out->q_world_body[i] = b->q[i] + noise(0.0005f);
    const bool carried = tc_mission_in_air(t->state) && b->position[2] > 0.0f;
    out->specific_force_body_m_s2[2] += carried ? t->wrench.thrust_n / p->mass_kg : p->gravity_m_s2;
}

static void turn(body* b, float step_s) {
    const float x = 0.5f * step_s * b->rate[0], y = 0.5f * step_s * b->rate[1], z = 0.5f * step_s * b->rate[2];
    const float* q = b->q;
    const float n[4] = {q[0] - x * q[1] - y * q[2] - z * q[3], q[1] + x * q[0] + z * q[2] - y * q[3],
                        q[2] + y * q[0] - z * q[1] + x * q[3], q[3] + z * q[0] + y * q[1] - x * q[2]};
    /* One Newton step for 1/sqrt near 1 keeps the norm. */
    const float scale = 1.5f - 0.5f * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + n[3] * n[3]);
    for (int i = 0; i < 4; i++) b->q[i] = n[i] * scale;
}

/* The wrench that was asked for acts at once; no drag: the controller's feed-forward is wrong on purpose. */
static void move(body* b, float step_s) {
    const tc_telemetry* t = tc_telemetry_now(&controller);
    const float* q = b->q;
    const float z[3] = {2.0f * (q[1] * q[3] + q[0] * q[2]), 2.0f * (q[2] * q[3] - q[0] * q[1]),
                        1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2])};
    const bool flying = tc_mission_in_air(t->state);
    for (int i = 0; i < 3; i++) {
        const float weight = i == 2 ? controller.parameters.gravity_m_s2 : 0.0f;
        const float acceleration = z[i] * t->wrench.thrust_n / controller.parameters.mass_kg - weight;
        b->velocity[i] = flying ? b->velocity[i] + step_s * acceleration : 0.0f;
        b->position[i] += step_s * b->velocity[i];
        b->rate[i] =
            flying ? b->rate[i] + step_s * t->wrench.torque_n_m[i] / controller.parameters.inertia_kg_m2[i] : 0.0f;
    }
    if (b->position[2] < 0.0f) {
        b->position[2] = 0.0f;
        b->velocity[2] = b->velocity[2] > 0.0f ? b->velocity[2] : 0.0f;
    }
    turn(b, step_s);
}

/* What the operator does, again and again every 40 s. */
static void operate(uint32_t tick) {
    switch (tick * (STEP_US / 1000u) % 40000u) {
        case 10u:
            (void)tc_do(&controller, TC_COMMAND_ARM, 0.0f);
            break;
        case 20u:
            (void)tc_do(&controller, TC_COMMAND_TAKE_OFF, 1.5f);
            break;
        case 6000u:
            (void)tc_do(&controller, TC_COMMAND_START, 0.0f);
            break;
        case 9500u:
            (void)tc_do(&controller, TC_COMMAND_PAUSE, 0.0f);
            break;
        case 13000u:
            (void)tc_do(&controller, TC_COMMAND_TIME_SCALE, 0.8f);
            break;
        case 13010u:
            (void)tc_do(&controller, TC_COMMAND_RESUME, 0.0f);
            break;
        case 20000u:
            (void)tc_do(&controller, TC_COMMAND_TIME_SCALE, 1.0f);
            break;
        case 26000u:
            (void)tc_do(&controller, TC_COMMAND_LAND, 0.0f);
            break;
        default:
            break;
    }
}

static uint32_t add_floats(uint32_t crc, const float* values, int count) {
    for (int i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        const uint8_t bytes[4] = {(uint8_t)bits, (uint8_t)(bits >> 8), (uint8_t)(bits >> 16), (uint8_t)(bits >> 24)};
        crc = tc_crc32(crc, bytes, sizeof bytes);
    }
    return crc;
}

int driver_run(uint32_t ticks, uint32_t* crc32, uint32_t* states) {
    body vehicle = {.q = {1.0f, 0.0f, 0.0f, 0.0f}};
    tc_parameters parameters;
    random_state = 1u;
    *crc32 = 0u;
    *states = 0u;
    tc_init(&controller);
    tc_parameters_default(&parameters);
    ADJUST
    if (tc_parameters_set(&controller, &parameters) != TC_OK) return 1;
    const tc_reason reason = upload();
    if (reason != TC_OK) return 100 + (int)reason;
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const uint64_t time_us = (uint64_t)tick * STEP_US + 1u;
        tc_estimate estimate;
        tc_output output;
        measure(&vehicle, time_us, &estimate);
        operate(tick);
        tc_ground_alive(&controller, 0u);
        driver_tick_begins();
        (void)tc_tick(&controller, time_us, &estimate, &output);
        driver_tick_ends();
        *states |= 1u << output.state;
        *crc32 = add_floats(*crc32, output.rotor_speed_rad_s, TC_ROTORS);
        *crc32 = add_floats(*crc32, tc_telemetry_now(&controller)->flatness.q_reference, 4);
        *crc32 = add_floats(*crc32, tc_telemetry_now(&controller)->setpoint.position_world_m, 3);
        move(&vehicle, (float)STEP_US * 1e-6f);
    }
    return 0;
}
