/* Arbitrary bytes as estimates, clocks, commands, uploads and parameters. Whatever they are, after every step
   - rotor speeds are finite and in range, zero when the vehicle does not fly, and the state is one of the table;
   - a kill is honoured in the next tick, whatever the clock and the estimate are;
   - set-point and attitude reference are finite;
   - the active trajectory is the one that was activated last, whole;
   - the parameters in force are those from before, or the whole set that was sent.

     clang -g -O1 -fsanitize=fuzzer,address,undefined -DTC_MAX_SEGMENTS=8 ... fuzz_controller.c ../src/...   libFuzzer
     gcc -DSTANDALONE ...                                                     a short run with its own random bytes */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "goshawk_controller/goshawk_controller.h"

#define TICK_US 20000u /* the longest regular step: most of a flight for the fewest ticks */
#define LONG_WAIT 46u  /* ticks */

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

typedef struct {
    tc_controller c;
    uint64_t time_us;      /* the caller's clock */
    uint32_t active_crc32; /* of what was activated last, 0: nothing */
    tc_parameters in_force;
    bool killed; /* and not ticked since */
} bench;

static bool finite(const float* values, size_t count) {
    bool all = true;
    for (size_t i = 0; i < count; i++) all = all && values[i] - values[i] == 0.0f;
    return all;
}

static void check_output(bench* b, const tc_output* output) {
    const tc_parameters* p = &b->c.parameters;
    const tc_telemetry* t = tc_telemetry_now(&b->c);
    must(output->state < TC_MISSION_STATE_COUNT && output->state == b->c.mission.state, "known state");
    must(output->in_command == (output->state != TC_SHADOW), "in command but in shadow");
    const bool flies = tc_mission_in_air(output->state) || output->state == TC_SHADOW;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = output->rotor_speed_rad_s[i];
        if (!(n >= 0.0f && n <= p->rotor_max_rad_s)) fprintf(stderr, "rotor %d: %g\n", i, (double)n);
        must(n >= 0.0f && n <= p->rotor_max_rad_s, "rotor speed in range"); /* false for NaN */
        must(flies || n <= (output->state == TC_ARMED ? p->rotor_idle_rad_s : 0.0f), "resting rotors rest");
        must(!flies || n >= p->rotor_min_rad_s, "idle floor in flight");
    }
    must(!b->killed || output->state == TC_DISARMED || output->state == TC_FAULT, "a kill is honoured at once");
    b->killed = false;
    must(finite(t->setpoint.position_world_m, sizeof t->setpoint / sizeof(float)), "the set-point is finite");
    must(finite(t->flatness.q_reference, 4) && finite(t->estimate.q_world_body, 4), "attitudes are finite");
    must(finite(&t->wrench.thrust_n, 1) && finite(t->wrench.torque_n_m, 3), "the wrench is finite");
    must(finite(t->estimate.position_world_m, 3) && finite(t->estimate.velocity_world_m_s, 3), "the estimate is");
    must(t->path_limit >= 0.0f && t->path_limit <= 1.0f, "the limit is a share");
}

static void check(const bench* b) {
    const tc_trajectory* active = tc_store_active(&b->c.store);
    must(active == NULL || tc_trajectory_crc32(active) == b->active_crc32, "the active trajectory is untouched");
    must(memcmp(&b->c.parameters, &b->in_force, sizeof b->in_force) == 0, "parameters are as they were set");
}

/* The caller's clock goes on, stands still, or steps by anything. */
static uint64_t next_time(uint64_t time_us, bytes* in) {
    const uint8_t how = take_byte(in);
    if (how < 240u) return time_us + (uint64_t)how * 100u;
    int64_t step_us;
    take(in, &step_us, how % 2u == 0u ? sizeof step_us : 4u);
    return time_us + (uint64_t)step_us;
}

/* A believable vehicle with some of its numbers overwritten by anything at all. */
static void tick(bench* b, bytes* in) {
    static const float level[4] = {1.0f, 0.0f, 0.0f, 0.0f};
    const tc_telemetry* t = tc_telemetry_now(&b->c);
    tc_estimate estimate;
    tc_output output;
    memset(&estimate, 0, sizeof estimate);
    memcpy(estimate.q_world_body, level, sizeof level);
    memcpy(estimate.position_world_m, t->setpoint.position_world_m, sizeof estimate.position_world_m);
    memcpy(estimate.velocity_world_m_s, t->setpoint.velocity_world_m_s, sizeof estimate.velocity_world_m_s);
    estimate.specific_force_body_m_s2[2] = 9.81f;
    estimate.reset_counter = b->c.reset_counter;
    estimate.valid = TC_VALID_ALL;
    b->time_us = next_time(b->time_us, in);
    const uint8_t spoil = take_byte(in), more = (spoil & 8u) != 0u ? take_byte(in) : 0u;
    if ((spoil & 1u) != 0u) take(in, estimate.position_world_m, 24);
    if ((spoil & 2u) != 0u) take(in, estimate.q_world_body, 16);
    if ((spoil & 4u) != 0u) take(in, estimate.rate_body_rad_s, 24);
    if ((spoil & 16u) != 0u) {
        estimate.valid |= TC_VALID_ROTOR_SPEED;
        take(in, estimate.rotor_speed_rad_s, 16);
    }
    if ((more & 1u) != 0u) estimate.valid = take_byte(in);
    if ((more & 2u) != 0u) take(in, estimate.position_std_m, 16);
    if ((more & 4u) != 0u) {
        estimate.reset_counter = (uint8_t)(estimate.reset_counter + (more >> 6));
        take(in, estimate.reset_position_world_m, 28);
    }
    if ((more & 8u) != 0u) take(in, &estimate.battery_v, 4);
    if ((more & 16u) != 0u) memset(estimate.velocity_world_m_s, 0, sizeof estimate.velocity_world_m_s); /* stands */
    const bool stale = (more & 32u) != 0u;
    const uint32_t repeats = spoil >= 240u ? LONG_WAIT : 1u + (spoil >> 6); /* mostly few: ticks are what costs */
    estimate.position_time_us = estimate.attitude_time_us = estimate.rate_time_us = b->time_us;
    if (stale) take(in, &estimate.position_time_us, 24);
    for (uint32_t i = 0; i < repeats; i++) {
        (void)tc_tick(&b->c, b->time_us, &estimate, &output);
        check_output(b, &output);
        b->time_us += TICK_US;
        if (!stale) estimate.position_time_us = estimate.attitude_time_us = estimate.rate_time_us = b->time_us;
    }
}

/* A short plan with chosen flaws, or none; begun, and with bit 6 left open. */
static void upload(bench* b, bytes* in) {
    static const float step[8] = {0.5f, 1.09375f, 0.0f, -1.09375f, 0.0f, 0.65625f, 0.0f, -0.15625f};
    static tc_trajectory plan; /* too large for a stack */
    tc_controller* c = &b->c;
    const uint8_t kind = take_byte(in);
    plan.header = (tc_trajectory_header){.id = 1u + (kind >> 7), .segment_count = 2u, .coefficient_count = 8u};
    plan.header.link_loss_policy = kind & 3u;
    plan.header.clearance_m = (kind & 4u) != 0u ? 0.3f : 0.0f;
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
    if ((kind & 64u) != 0u) return;
    tc_reason reason = TC_BUSY;
    for (unsigned calls = 0; calls < 8u && reason == TC_BUSY; calls++) {
        reason = tc_upload_finish(c);
        if (calls == 1u) tick(b, in); /* a slice a call, ticks between them */
    }
    must(reason != TC_BUSY, "the checks end");
    if (tc_upload_activate(c, plan.header.id, plan.header.crc32) == TC_OK) {
        must((kind & 32u) == 0u, "a wrong CRC is refused");
        b->active_crc32 = plan.header.crc32;
    }
}

static void set_parameters(bench* b, bytes* in) {
    tc_parameters next = b->c.parameters;
    for (int i = take_byte(in) % 4; i >= 0; i--) {
        float value;
        const uint16_t index = take_byte(in);
        take(in, &value, sizeof value);
        (void)tc_parameters_put(&next, index, value);
    }
    if (tc_parameters_set(&b->c, &next) == TC_OK) b->in_force = next;
}

static void command(bench* b, bytes* in) {
    float value;
    const uint8_t number = take_byte(in) % (TC_COMMAND_COUNT + 1u);
    take(in, &value, sizeof value);
    const tc_reason reason = tc_do(&b->c, (tc_command)number, number == TC_COMMAND_TAKE_OFF ? 1.0f : value);
    if (reason == TC_OK) b->killed = false; /* another order after it holds */
    if (number == TC_COMMAND_KILL && value - value == 0.0f) {
        must(reason == TC_OK, "a kill is never refused");
        b->killed = true;
    }
}

static void in_the_air(bench* b, bytes* in) {
    float speeds[TC_ROTORS];
    b->killed = false; /* the integrator may take over again */
    switch (take_byte(in) % 4u) {
        case 0:
            (void)tc_shadow(&b->c);
            break;
        case 1:
            take(in, speeds, sizeof speeds);
            (void)tc_engage(&b->c, speeds);
            break;
        case 2:
            (void)tc_engage(&b->c, NULL);
            break;
        default:
            (void)tc_release(&b->c);
            break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static bench b, beginning; /* too large for a stack; every input starts from the same beginning */
    bytes in = {data, size};
    if (!beginning.c.configured) {
        beginning.time_us = 1000;
        tc_parameters_default(&beginning.in_force);
        tc_init(&beginning.c);
        (void)tc_parameters_set(&beginning.c, &beginning.in_force);
    }
    b = beginning;
    while (in.left > 0u) {
        switch (take_byte(&in) % 8u) {
            case 0:
                command(&b, &in);
                break;
            case 1:
                upload(&b, &in);
                break;
            case 2:
                set_parameters(&b, &in);
                break;
            case 3:
                tc_ground_alive(&b.c, 0u);
                break;
            case 4:
                in_the_air(&b, &in);
                break;
            default:
                tick(&b, &in);
                break;
        }
        check(&b);
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
