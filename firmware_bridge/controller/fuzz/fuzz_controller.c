/* Arbitrary bytes as estimates, commands, uploads and parameters. Whatever they are, the rotor speeds must be finite
   and in range, the state one of the table, and time must not stop.

     clang -g -O1 -fsanitize=fuzzer,address,undefined -DTC_MAX_SEGMENTS=8 ... fuzz_controller.c ../src/...   libFuzzer
     gcc -DSTANDALONE ...                                                     a short run with its own random bytes */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "goshawk_controller/goshawk_controller.h"

#define TICK_US 20000u /* the longest regular step: most of a flight for the fewest ticks */

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

typedef struct {
    const uint8_t* at;
    size_t left;
} bytes;

static void take(bytes* in, void* out, size_t count) {
    memset(out, 0, count);
    const size_t there = count < in->left ? count : in->left;
    memcpy(out, in->at, there);
    in->at += there;
    in->left -= there;
}

static uint8_t take_byte(bytes* in) {
    uint8_t value;
    take(in, &value, 1);
    return value;
}

static void must(int condition, const char* what) {
    if (!condition) {
        fprintf(stderr, "violated: %s\n", what);
        abort();
    }
}

static void check(const tc_controller* c, const tc_output* output) {
    must(output->state < TC_MISSION_STATE_COUNT, "known state");
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = output->rotor_speed_rad_s[i];
        if (!(n >= 0.0f && n <= c->parameters.rotor_max_rad_s)) fprintf(stderr, "rotor %d: %g\n", i, (double)n);
        must(n >= 0.0f && n <= c->parameters.rotor_max_rad_s, "rotor speed in range"); /* false for NaN */
        must(tc_mission_in_air(output->state) || n <= c->parameters.rotor_idle_rad_s, "resting rotors rest");
        must(!tc_mission_in_air(output->state) || n >= c->parameters.rotor_min_rad_s, "idle floor in flight");
    }
}

/* A believable vehicle with some of its numbers overwritten by anything at all. */
static void tick(tc_controller* c, bytes* in, uint64_t* time_us) {
    static const float level[4] = {1.0f, 0.0f, 0.0f, 0.0f};
    tc_estimate estimate;
    tc_output output;
    memset(&estimate, 0, sizeof estimate);
    memcpy(estimate.q_world_body, level, sizeof level);
    memcpy(estimate.position_world_m, c->telemetry.setpoint.position_world_m, sizeof estimate.position_world_m);
    *time_us += (uint64_t)take_byte(in) * 100u;
    estimate.position_time_us = estimate.attitude_time_us = *time_us;
    const uint8_t spoil = take_byte(in);
    if ((spoil & 1u) != 0u) take(in, estimate.position_world_m, 24);
    if ((spoil & 2u) != 0u) take(in, estimate.q_world_body, 16);
    if ((spoil & 4u) != 0u) take(in, estimate.rate_body_rad_s, 16);
    if ((spoil & 8u) != 0u) take(in, &estimate.position_time_us, 16);
    const uint32_t repeats = 1u + (uint32_t)(spoil >> 4) * 3u;
    for (uint32_t i = 0; i < repeats; i++) {
        (void)tc_tick(c, *time_us, &estimate, &output);
        check(c, &output);
        *time_us += TICK_US;
        if ((spoil & 8u) == 0u) estimate.position_time_us = estimate.attitude_time_us = *time_us;
    }
}

static void upload(tc_controller* c, bytes* in) {
    static const float step[8] = {0.5f, 1.09375f, 0.0f, -1.09375f, 0.0f, 0.65625f, 0.0f, -0.15625f};
    static tc_trajectory plan; /* too large for a stack */
    const uint8_t kind = take_byte(in);
    plan.header = (tc_trajectory_header){.id = 1u, .segment_count = 2u, .coefficient_count = 8u};
    plan.header.link_loss_policy = kind & 3u;
    for (uint16_t i = 0; i < 2u; i++) {
        tc_segment* segment = &plan.segment[i];
        memset(segment, 0, sizeof *segment);
        segment->duration_us = 1500000u;
        for (int j = 0; j < 8; j++) segment->coefficient[2][j] = i == 0u ? step[j] : -step[j];
        segment->coefficient[2][0] = 1.5f;
        if ((kind & 16u) != 0u) take(in, segment, 24);
    }
    plan.header.crc32 = tc_trajectory_crc32(&plan) ^ (kind & 32u);
    if (tc_upload_begin(c, &plan.header) != TC_OK) return;
    for (uint16_t i = 0; i < 2u; i++) (void)tc_upload_segment(c, i, &plan.segment[i]);
    (void)tc_upload_finish(c);
    (void)tc_upload_activate(c, 1u, plan.header.crc32);
}

static void set_parameters(tc_controller* c, bytes* in) {
    tc_parameters next = c->parameters;
    for (int i = take_byte(in) % 4; i >= 0; i--) {
        float value;
        const uint16_t index = take_byte(in);
        take(in, &value, sizeof value);
        (void)tc_parameters_put(&next, index, value);
    }
    (void)tc_parameters_set(c, &next);
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static tc_controller c, beginning; /* too large for a stack; every input starts from the same beginning */
    bytes in = {data, size};
    uint64_t time_us = 1000;
    if (!beginning.configured) {
        tc_parameters parameters;
        tc_parameters_default(&parameters);
        tc_init(&beginning);
        (void)tc_parameters_set(&beginning, &parameters);
    }
    c = beginning;
    while (in.left > 0u) {
        switch (take_byte(&in) % 6u) {
            case 0: {
                float value;
                const uint8_t command = take_byte(&in) % (TC_COMMAND_COUNT + 1u);
                take(&in, &value, sizeof value);
                (void)tc_do(&c, (tc_command)command, command == TC_COMMAND_TAKE_OFF ? 1.0f : value);
                break;
            }
            case 1:
                upload(&c, &in);
                break;
            case 2:
                set_parameters(&c, &in);
                break;
            case 3:
                tc_ground_alive(&c, time_us);
                break;
            default:
                tick(&c, &in, &time_us);
                break;
        }
    }
    return 0;
}

#ifdef STANDALONE
int main(int argc, char** argv) {
    const unsigned long runs = argc > 1 ? strtoul(argv[1], NULL, 10) : 1000ul;
    uint32_t state = 1u;
    uint8_t data[256];
    for (unsigned long run = 0; run < runs; run++) {
        for (size_t i = 0; i < sizeof data; i++) {
            state = state * 1664525u + 1013904223u;
            data[i] = (uint8_t)(state >> 24);
        }
        (void)LLVMFuzzerTestOneInput(data, sizeof data);
    }
    printf("%lu runs\n", runs);
    return 0;
}
#endif
