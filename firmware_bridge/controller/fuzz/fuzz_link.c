/* Fuzz target for the link endpoint and everything behind it: frames, uploads, parameters, orders, the state machine.

   The input is a list of steps. Most are well-formed frames with the input's bytes as payload, so that the fuzzer gets
   past checksums and leases; some are raw bytes; some are ticks with whatever estimate the bytes make. After each step
   it must hold that
   - what is active is whole: its CRC-32 is the one in its header;
   - the parameters in force are those before the step, or the whole set that the step sent;
   - a single parameter, set by the station in control, changes that one or none;
   - a frame of a station that is not in control, and does not get there by it, changes nothing of the controller;
   - rotor speeds are finite and within the limits;
   - a stream opens by the exact echo of a challenge that is not too old, and by nothing else;
   - a second endpoint, which signs, lets nothing in: no lease, no upload, no order.

   With libFuzzer:  clang -fsanitize=fuzzer,address,undefined with this file and those of src.
   Without:         fuzz_main.c drives it with random inputs (see docs/reference/link.md). */
#include <stdlib.h>
#include <string.h>

#include "goshawk_controller/link.h"
#include "goshawk_dialect.h"

#define TICK_US 20000u /* the longest regular step: most of a flight for the fewest ticks */
#define LONG_WAIT 24u  /* ticks */
#define LOG_RECORDS 4u
#define PILOT 255u
#define GUEST 200u

/* Row and length of those that ask for something. */
static const uint8_t kinds[][2] = {
    {GOSHAWK_LEASE_REQUEST_ROW, GOSHAWK_LEASE_REQUEST_LENGTH},
    {GOSHAWK_MISSION_COMMAND_ROW, GOSHAWK_MISSION_COMMAND_LENGTH},
    {GOSHAWK_TRAJECTORY_BEGIN_ROW, GOSHAWK_TRAJECTORY_BEGIN_LENGTH},
    {GOSHAWK_TRAJECTORY_SEGMENT_ROW, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH},
    {GOSHAWK_TRAJECTORY_SAMPLES_ROW, GOSHAWK_TRAJECTORY_SAMPLES_LENGTH},
    {GOSHAWK_TRAJECTORY_COMMIT_ROW, GOSHAWK_TRAJECTORY_COMMIT_LENGTH},
    {GOSHAWK_TRAJECTORY_READ_ROW, GOSHAWK_TRAJECTORY_READ_LENGTH},
    {GOSHAWK_PARAMETERS_STAGE_ROW, GOSHAWK_PARAMETERS_STAGE_LENGTH},
    {GOSHAWK_PARAMETERS_COMMIT_ROW, GOSHAWK_PARAMETERS_COMMIT_LENGTH},
    {GOSHAWK_LOG_REQUEST_ROW, GOSHAWK_LOG_REQUEST_LENGTH},
    {PARAM_REQUEST_READ_ROW, PARAM_REQUEST_READ_LENGTH},
    {PARAM_REQUEST_LIST_ROW, PARAM_REQUEST_LIST_LENGTH},
    {PARAM_SET_ROW, PARAM_SET_LENGTH},
    {COMMAND_LONG_ROW, COMMAND_LONG_LENGTH},
    {COMMAND_INT_ROW, COMMAND_INT_LENGTH},
    {TIMESYNC_ROW, TIMESYNC_LENGTH},
    {HEARTBEAT_ROW, HEARTBEAT_LENGTH},
};

typedef struct {
    tc_controller controller;
    tc_link link;
    tc_link_config config;
    tc_parser stream;
    uint8_t log[LOG_RECORDS * TC_LINK_RECORD];
} vehicle;

/* One step's share of the input. */
typedef struct {
    const uint8_t* data;
    size_t n;
} bytes;

static uint8_t take(bytes* input) {
    if (input->n == 0u) {
        return 0;
    }
    input->n--;
    return *input->data++;
}

static void must(bool holds) {
    if (!holds) {
        abort();
    }
}

static void start(vehicle* v, bool sign) {
    tc_link_config* config = &v->config;
    memset(v, 0, sizeof *v);
    config->system_id = 1;
    config->component_id = 1;
    config->sign = sign;
    config->start_10us = 1000;
    config->boot_id = 1;
    config->bytes_per_s = 100000000u;
    config->log = v->log;
    config->log_records = LOG_RECORDS;
    config->log_period_us = 5000;
    tc_parameters parameters;
    tc_parameters_default(&parameters);
    tc_init(&v->controller);
    (void)tc_parameters_set(&v->controller, &parameters);
    tc_link_init(&v->link, &v->controller, config, 1);
}

/* A frame of the dialect whose payload comes from the input, by the pilot or, with the first bit, by a guest; small
   numbers where the fuzzer would need luck. */
static size_t make_frame(bytes* input, uint8_t sequence, uint8_t frame[TC_FRAME_MAX]) {
    uint8_t* payload = frame + TC_FRAME_HEADER;
    const uint8_t what = take(input);
    const uint8_t* kind = kinds[what % 128u % (sizeof kinds / sizeof kinds[0])];
    const goshawk_dialect_row* row = &goshawk_dialect()[kind[0]];
    const unsigned given = take(input);
    memset(payload, 0, TC_PAYLOAD_MAX);
    for (unsigned i = 0; i < kind[1] && i < given; i++) {
        payload[i] = take(input);
    }
    if (row->target != GOSHAWK_NO_TARGET) {
        payload[row->target] = 1;
        payload[row->target + 1u] = 1;
    }
    return tc_frame_build(frame, kind[0], kind[1], sequence, what < 128u ? PILOT : GUEST, 190, NULL, 0);
}

/* A payload's length without the zeros at its end, eight bytes at a time: tc_frame_build would look at each. */
static __attribute__((no_sanitize("address", "undefined"))) unsigned trimmed(const uint8_t* payload, unsigned length) {
    uint64_t last = 0;
    while (length > 8u && last == 0u) {
        memcpy(&last, payload + length - 8u, sizeof last);
        length -= last == 0u ? 8u : 0u;
    }
    return length;
}

/* Encodes a message by its name and hands it to the vehicle, as the pilot's. */
#define SEND(v, now_us, NAME, name, message)                                                   \
    do {                                                                                       \
        uint8_t frame_[TC_FRAME_MAX];                                                          \
        name##_encode(&(message), frame_ + TC_FRAME_HEADER);                                   \
        const unsigned length_ = trimmed(frame_ + TC_FRAME_HEADER, NAME##_LENGTH);             \
        const size_t n_ = tc_frame_build(frame_, NAME##_ROW, length_, 0, PILOT, 190, NULL, 0); \
        tc_link_receive(&(v)->link, frame_, n_, NULL, now_us);                                 \
    } while (0)

/* A plan that passes all checks (standing still at 1 m for a while), sent whole but for its flaws: bit 0 and 1 together
   a wrong CRC; bit 1 wrong samples; bit 2 with samples, which bit 0 then loses; bit 3 pieces missing; bit 4 two
   commits. */
static void send_plan(vehicle* v, uint64_t now_us, uint8_t salt, uint8_t flaws) {
    static tc_trajectory plan; /* too large for a stack */
    memset(&plan, 0, sizeof plan);
    plan.header.id = 1u + salt;
    plan.header.segment_count = (uint16_t)(1u + salt % TC_MAX_SEGMENTS);
    plan.header.coefficient_count = 1;
    plan.header.link_loss_policy = salt % 3u;
    for (unsigned i = 0; i < plan.header.segment_count; i++) {
        plan.segment[i].duration_us = 100000;
        plan.segment[i].coefficient[2][0] = 1.0f;
    }
    plan.header.crc32 = tc_trajectory_crc32(&plan) ^ ((flaws & 3u) == 3u ? 1u : 0u);
    goshawk_trajectory_begin_msg begin = {0};
    begin.target_system = begin.target_component = 1;
    begin.transfer_id = 77u + salt + 256u * (flaws / 32u);
    begin.trajectory_id = plan.header.id;
    begin.crc32 = plan.header.crc32;
    begin.segments = plan.header.segment_count;
    begin.coefficient_count = 1;
    begin.link_loss_policy = plan.header.link_loss_policy;
    begin.samples = (flaws & 4u) != 0u ? 2 : 0;
    SEND(v, now_us, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, begin);
    for (uint16_t i = 0; i < plan.header.segment_count; i++) {
        goshawk_trajectory_segment_msg segment = {0};
        segment.target_system = segment.target_component = 1;
        segment.transfer_id = begin.transfer_id;
        segment.index = i;
        segment.duration_us = plan.segment[i].duration_us;
        segment.coefficients[2] = 1.0f;
        if ((flaws & 8u) == 0u || i % 3u != 1u) {
            SEND(v, now_us, GOSHAWK_TRAJECTORY_SEGMENT, goshawk_trajectory_segment, segment);
        }
    }
    goshawk_trajectory_samples_msg samples = {0};
    samples.target_system = samples.target_component = 1;
    samples.transfer_id = begin.transfer_id;
    samples.values[2] = samples.values[6] = (flaws & 2u) != 0u ? 2.0f : 1.0f;
    if ((flaws & 5u) == 4u) {
        SEND(v, now_us, GOSHAWK_TRAJECTORY_SAMPLES, goshawk_trajectory_samples, samples);
    }
    goshawk_trajectory_commit_msg commit = {0};
    commit.target_system = commit.target_component = 1;
    commit.transfer_id = begin.transfer_id;
    commit.trajectory_id = plan.header.id;
    commit.crc32 = plan.header.crc32;
    for (unsigned i = 0; i < 1u + (flaws >> 4) % 2u; i++) {
        SEND(v, now_us, GOSHAWK_TRAJECTORY_COMMIT, goshawk_trajectory_commit, commit);
    }
}

/* An order that names the active plan, as a ground station's would. */
static void send_order(vehicle* v, uint64_t now_us, uint32_t request_id, bytes* input) {
    const tc_trajectory* active = tc_store_active(&v->controller.store);
    goshawk_mission_command_msg order = {0};
    const uint8_t command = take(input) & 15u;
    order.target_system = order.target_component = 1;
    order.request_id = request_id;
    order.command = command < 10u ? command : (uint8_t)(90u + command);
    order.value = 1.0f;
    if (active != NULL) {
        order.trajectory_id = active->header.id;
        order.crc32 = active->header.crc32;
    }
    SEND(v, now_us, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, order);
}

/* All parameters as they are, two of them changed by the input, then the commit. Afterwards all of them are in force or
   none. Highest bits of the first byte: an upload begins before the second group or before the commit. */
static void send_parameters(vehicle* v, uint64_t now_us, uint32_t transfer_id, bytes* input) {
    const tc_parameters before = *tc_parameters_now(&v->controller);
    tc_parameters next = before;
    goshawk_parameters_commit_msg commit = {0};
    const uint8_t how = take(input);
    (void)tc_parameters_put(&next, how % 64u, (float)take(input) * 0.1f);
    (void)tc_parameters_put(&next, 94u - how % 8u, (float)(how % 32u) * 0.1f);
    for (uint8_t group = 0; group * TC_LINK_GROUP < tc_parameters_count(); group++) {
        goshawk_parameters_stage_msg stage = {0};
        if (how / 64u == group + 1u) {
            send_plan(v, now_us, how, 8u);
        }
        stage.target_system = stage.target_component = 1;
        stage.transfer_id = transfer_id;
        stage.group = group;
        for (unsigned i = 0; i < TC_LINK_GROUP; i++) {
            stage.values[i] = tc_parameters_get(&next, (uint16_t)(group * TC_LINK_GROUP + i));
        }
        SEND(v, now_us, GOSHAWK_PARAMETERS_STAGE, goshawk_parameters_stage, stage);
    }
    commit.target_system = commit.target_component = 1;
    commit.transfer_id = transfer_id;
    commit.crc32 = tc_parameters_crc32(&next);
    if (how / 64u == 3u) {
        send_plan(v, now_us, how, 8u);
    }
    SEND(v, now_us, GOSHAWK_PARAMETERS_COMMIT, goshawk_parameters_commit, commit);
    const tc_parameters* now = tc_parameters_now(&v->controller);
    must(memcmp(now, &next, sizeof next) == 0 || memcmp(now, &before, sizeof before) == 0);
}

/* One parameter by its name. */
static void send_parameter(vehicle* v, uint64_t now_us, bytes* input) {
    const tc_parameters before = *tc_parameters_now(&v->controller);
    const bool in_control = v->link.lease.holder.system_id == PILOT;
    tc_parameters next = before;
    const uint16_t index = take(input) % tc_parameters_count();
    const uint8_t size = take(input);
    param_set_msg m = {.target_system = 1, .target_component = 1, .param_type = size % 8u == 7u ? 6 : 9};
    m.param_value = tc_parameters_get(&before, index) * (0.5f + (float)size * (1.0f / 128.0f));
    memcpy(m.param_id, tc_parameters_name(index), strlen(tc_parameters_name(index)));
    const tc_reason put = tc_parameters_put(&next, index, m.param_value);
    SEND(v, now_us, PARAM_SET, param_set, m);
    const tc_parameters* now = tc_parameters_now(&v->controller);
    const bool may_change = in_control && put == TC_OK && m.param_type == 9u;
    must(memcmp(now, &before, sizeof before) == 0 || (may_change && memcmp(now, &next, sizeof next) == 0));
}

/* Whether the same streams are open. */
static bool same_streams(const tc_signing* a, const tc_signing* b) {
    bool same = true;
    for (unsigned i = 0; i < TC_STREAMS; i++) {
        const tc_stream *one = &a->streams[i], *other = &b->streams[i];
        same = same && one->open == other->open && memcmp(&one->sender, &other->sender, sizeof one->sender) == 0;
    }
    return same;
}

/* A signed heartbeat, or an answer to the challenge, sent twice: with the right key it counts at most once, with
   another one never. Only the exact answer opens a stream, once. */
static void send_signed(vehicle* v, uint64_t now_us, tc_signing* station, bytes* input) {
    uint8_t frame[TC_FRAME_MAX];
    const uint8_t how = take(input);
    const heartbeat_msg heartbeat = {0};
    const tc_link_challenge* challenge = &v->link.challenge;
    ping_msg answer = {
        .time_usec = challenge->time_usec, .seq = challenge->seq, .target_system = 1, .target_component = 1};
    const bool answers = (how & 32u) != 0u;
    const uint64_t issued_us = challenge->issued_us;
    bool exact = answers;
    if (answers) {
        const uint8_t damage = take(input); /* a bit of the 96, or of the address */
        if (damage < 64u) answer.time_usec ^= 1ull << damage;
        if (damage >= 64u && damage < 96u) answer.seq ^= 1u << (damage - 64u);
        if (damage == 96u) answer.target_component = 0;
        exact = damage > 96u;
        ping_encode(&answer, frame + TC_FRAME_HEADER);
    } else {
        heartbeat_encode(&heartbeat, frame + TC_FRAME_HEADER);
    }
    station->now_10us += take(input);
    const size_t n = tc_frame_build(frame, answers ? PING_ROW : HEARTBEAT_ROW, answers ? PING_LENGTH : HEARTBEAT_LENGTH,
                                    0, (uint8_t)(2u + how % 12u), 190, station, how >> 6);
    if ((how & 16u) != 0u && station->now_10us > 1400u) {
        station->now_10us -= 300u; /* the next ones come with older stamps */
    }
    const tc_signing before = v->link.signing;
    tc_link_receive(&v->link, frame, n, NULL, now_us);
    const tc_signing between = v->link.signing;
    tc_link_receive(&v->link, frame, n, NULL, now_us);
    exact = exact && v->link.clock_us - issued_us < TC_LINK_ANSWER_US;
    must(exact || same_streams(&before, &between));
    must(same_streams(&between, &v->link.signing));
}

static void one_tick(vehicle* v, const tc_estimate* estimate, uint64_t now_us) {
    tc_output output;
    (void)tc_tick(&v->controller, now_us, estimate, &output);
    const tc_parameters* p = tc_parameters_now(&v->controller);
    for (unsigned i = 0; i < TC_ROTORS; i++) {
        must(output.rotor_speed_rad_s[i] >= 0.0f && output.rotor_speed_rad_s[i] <= p->rotor_max_rad_s);
    }
    tc_link_update(&v->link, now_us);
}

/* What a vehicle would measure that flies as it is asked to: less, and the monitor would find that it lies. */
static void follow(const tc_controller* c, tc_estimate* estimate) {
    const tc_telemetry* t = &c->telemetry;
    memcpy(estimate->position_world_m, t->setpoint.position_world_m, sizeof estimate->position_world_m);
    estimate->position_world_m[2] += 1e-4f * (float)(t->ticks % 3u); /* one that repeats itself is frozen */
    memcpy(estimate->velocity_world_m_s, t->setpoint.velocity_world_m_s, sizeof estimate->velocity_world_m_s);
    memcpy(estimate->q_world_body, t->flatness.q_reference, sizeof estimate->q_world_body);
    estimate->specific_force_body_m_s2[2] = t->wrench.thrust_n / c->parameters.mass_kg;
}

/* Time goes on. Low half of the byte: 0 to 11 the vehicle is where it should be, 12 it is not, 13 it is for half a
   second, 14 the estimate is anything at all, 15 three seconds without a tick. */
static void tick(vehicle* v, bytes* input, uint64_t* now_us) {
    tc_estimate estimate;
    memset(&estimate, 0, sizeof estimate);
    const unsigned how = take(input);
    const bool in_place = how % 16u < 12u || how % 16u == 13u;
    const unsigned ticks = how % 16u == 13u ? LONG_WAIT : 1u;
    *now_us += how % 16u == 15u ? 3000000u : 0u;
    estimate.q_world_body[0] = 1.0f;
    estimate.specific_force_body_m_s2[2] = 9.81f;
    estimate.valid = TC_VALID_ALL;
    for (unsigned i = 0; i < ticks; i++) {
        *now_us += TICK_US;
        estimate.position_time_us = estimate.attitude_time_us = estimate.rate_time_us = *now_us;
        if (tc_mission_in_air(v->controller.mission.state) && in_place) {
            follow(&v->controller, &estimate);
        } else {
            estimate.position_world_m[2] = (float)(how / 16u) * 0.2f;
        }
        if (how % 16u == 14u) { /* NaN included */
            uint8_t* raw = (uint8_t*)&estimate;
            for (unsigned j = 0; j < sizeof estimate && input->n > 0u; j++) {
                raw[j] = take(input);
            }
        }
        one_tick(v, &estimate, *now_us);
    }
}

static void drain(vehicle* v, uint64_t now_us) {
    uint8_t frame[TC_FRAME_MAX];
    for (unsigned i = 0; i < 64u; i++) {
        const size_t n = tc_link_transmit(&v->link, frame, now_us);
        must(n <= TC_FRAME_MAX);
        if (n == 0u) {
            return;
        }
        must(frame[0] == 0xFDu && n >= 12u);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

/* Three vehicles: one without signatures, one whose key nobody has, one whose key `friend` has. */
typedef struct {
    vehicle open, closed, keyed;
    tc_signing friend, stranger;
    tc_parameters in_force; /* of the open one */
    tc_trajectory whole;    /* its active trajectory, when its CRC was last computed */
    uint32_t steps, signed_frames;
    uint64_t now_us;
} scene;

static void set_scene(scene* s) {
    static const uint8_t right_key[TC_KEY_BYTES] = {0}, other_key[TC_KEY_BYTES] = {1};
    start(&s->open, false);
    start(&s->closed, true);
    start(&s->keyed, true);
    tc_signing_init(&s->friend, right_key, 1000);
    tc_signing_init(&s->stranger, other_key, 1000);
    s->in_force = *tc_parameters_now(&s->open.controller);
    s->steps = s->signed_frames = 0;
    s->now_us = 1;
}

static void check(scene* s) {
    const vehicle *open = &s->open, *closed = &s->closed;
    const tc_trajectory* active = tc_store_active(&open->controller.store);
    if (active != NULL && memcmp(active, &s->whole, sizeof s->whole) != 0) { /* a comparison costs less than a CRC */
        must(tc_trajectory_crc32(active) == active->header.crc32);
        s->whole = *active;
    }
    must(memcmp(tc_parameters_now(&open->controller), &s->in_force, sizeof s->in_force) == 0);
    must(open->controller.mission.state < (uint8_t)TC_MISSION_STATE_COUNT);
    must(closed->link.counts.accepted == 0u && closed->link.lease.holder.system_id == 0u);
    must(tc_store_active(&closed->controller.store) == NULL);
    must(closed->controller.mission.state == (uint8_t)TC_DISARMED);
}

static void to_both(scene* s, const uint8_t* data, size_t n, bool datagram) {
    tc_link_receive(&s->open.link, data, n, datagram ? NULL : &s->open.stream, s->now_us);
    tc_link_receive(&s->closed.link, data, n, datagram ? NULL : &s->closed.stream, s->now_us);
}

static bool holds(const vehicle* v, uint8_t system) { return v->link.lease.holder.system_id == system; }

/* What the holder's frames may change, a guest's may not; nobody's may change parameters but by PARAM_SET, by one. */
static void send_frame(scene* s, bytes* input) {
    static tc_controller before; /* too large for a stack */
    uint8_t frame[TC_FRAME_MAX];
    const size_t n = make_frame(input, (uint8_t)s->steps, frame);
    const uint8_t from = frame[TC_FRAME_SYSTEM];
    const bool held = holds(&s->open, from);
    before = s->open.controller;
    to_both(s, frame, n, true);
    must(held || holds(&s->open, from) || memcmp(&before, &s->open.controller, sizeof before) == 0);
    if (frame[7] == PARAM_SET_ID && frame[8] == 0u && held) {
        s->in_force = *tc_parameters_now(&s->open.controller);
    }
}

static void act(scene* s, bytes* input) {
    const unsigned step = take(input) % 16u;
    s->steps++;
    if (step < 3u) {
        send_frame(s, input);
    } else if (step == 3u) {
        send_parameter(&s->open, s->now_us, input);
        s->in_force = *tc_parameters_now(&s->open.controller);
    } else if (step == 4u) {
        const size_t n = input->n > 0u ? (size_t)input->data[0] % (input->n + 1u) : 0u;
        to_both(s, input->data, n, (n & 1u) != 0u);
        input->data += n;
        input->n -= n;
    } else if (step == 5u) {
        const uint8_t salt = take(input);
        send_plan(&s->open, s->now_us, salt, take(input));
    } else if (step == 6u) {
        send_parameters(&s->open, s->now_us, s->steps, input);
        s->in_force = *tc_parameters_now(&s->open.controller);
    } else if (step == 7u) {
        s->signed_frames++;
        send_signed(&s->keyed, s->now_us, &s->friend, input);
        send_signed(&s->closed, s->now_us, &s->stranger, input);
        must(s->keyed.link.counts.accepted <= s->signed_frames);
    } else if (step < 10u) {
        send_order(&s->open, s->now_us, s->steps, input);
    } else if (step == 10u) {
        drain(&s->open, s->now_us);
        drain(&s->closed, s->now_us);
    } else {
        tick(&s->open, input, &s->now_us);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static scene s, beginning; /* too large for a stack; every input starts from the same beginning */
    bytes input = {data, size};
    if (beginning.now_us == 0u) {
        set_scene(&s);
        beginning = s;
    }
    s = beginning;
    while (input.n > 0u) {
        act(&s, &input);
        check(&s);
    }
    return 0;
}
