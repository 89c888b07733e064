/* Worst counts of the functions of link.h: each kind of frame received, unsigned and signed, with the right and with a
   wrong key; each message sent; the update, a slice of a commit included. */
#include <string.h>

#include "goshawk_controller/link.h"
#include "goshawk_dialect.h"
#include "worst_case.h"

#define ME 1u
#define STATION 255u
#define COMPONENT 190u
#define RECORDS 8u
#define TO_VEHICLE .target_system = ME, .target_component = ME

static tc_controller c;
static tc_link ln;
static tc_link_config config;
static tc_signing friend, stranger;
static uint8_t memory[RECORDS * TC_LINK_RECORD];
static uint64_t now_us = 1000000u;
static bool sign;
static const char* situation = "";

static void tick_and_update(void) {
    tc_estimate e;
    tc_output output;
    memset(&e, 0, sizeof e);
    now_us += 2500u;
    e.valid = TC_VALID_ALL;
    e.q_world_body[0] = 1.0f;
    e.specific_force_body_m_s2[2] = 9.81f;
    e.position_time_us = e.attitude_time_us = e.rate_time_us = now_us;
    (void)tc_tick(&c, now_us, &e, &output);
    count_begin();
    tc_link_update(&ln, now_us);
    count_end("tc_link_update", ln.upload.checking ? "a slice of a commit" : situation);
}

static const char* sent_name(uint32_t id) {
    switch (id) {
        case HEARTBEAT_ID:
            return "HEARTBEAT";
        case PING_ID:
            return "PING";
        case PARAM_VALUE_ID:
            return "PARAM_VALUE";
        case ATTITUDE_QUATERNION_ID:
            return "ATTITUDE_QUATERNION";
        case LOCAL_POSITION_NED_ID:
            return "LOCAL_POSITION_NED";
        case COMMAND_ACK_ID:
            return "COMMAND_ACK";
        case TIMESYNC_ID:
            return "TIMESYNC";
        case ODOMETRY_ID:
            return "ODOMETRY";
        case ESC_STATUS_ID:
            return "ESC_STATUS";
        case BATTERY_STATUS_ID:
            return "BATTERY_STATUS";
        case HOME_POSITION_ID:
            return "HOME_POSITION";
        case AUTOPILOT_VERSION_ID:
            return "AUTOPILOT_VERSION";
        case STATUSTEXT_ID:
            return "STATUSTEXT";
        case GOSHAWK_STATE_ID:
            return "GOSHAWK_STATE";
        case GOSHAWK_TRAJECTORY_STATUS_ID:
            return "GOSHAWK_TRAJECTORY_STATUS";
        case GOSHAWK_TRAJECTORY_BEGIN_ID:
            return "GOSHAWK_TRAJECTORY_BEGIN";
        case GOSHAWK_TRAJECTORY_SEGMENT_ID:
            return "GOSHAWK_TRAJECTORY_SEGMENT";
        case GOSHAWK_TRAJECTORY_RESULT_ID:
            return "GOSHAWK_TRAJECTORY_RESULT";
        case GOSHAWK_MISSION_STATUS_ID:
            return "GOSHAWK_MISSION_STATUS";
        case GOSHAWK_MISSION_RESULT_ID:
            return "GOSHAWK_MISSION_RESULT";
        case GOSHAWK_LEASE_STATUS_ID:
            return "GOSHAWK_LEASE_STATUS";
        case GOSHAWK_PARAMETERS_RESULT_ID:
            return "GOSHAWK_PARAMETERS_RESULT";
        case GOSHAWK_LOG_INFO_ID:
            return "GOSHAWK_LOG_INFO";
        case GOSHAWK_LOG_RECORD_ID:
            return "GOSHAWK_LOG_RECORD";
        default:
            return "another message";
    }
}

/* All there is to send; answers a challenge as a station does. */
static void transmit(void) {
    uint8_t frame[TC_FRAME_MAX], answer[TC_FRAME_MAX];
    for (unsigned i = 0; i < 64u; i++) {
        now_us += 100u;
        count_begin();
        const size_t n = tc_link_transmit(&ln, frame, now_us);
        const uint32_t id = (uint32_t)frame[7] | ((uint32_t)frame[8] << 8) | ((uint32_t)frame[9] << 16);
        count_end("tc_link_transmit", n == 0u ? "nothing to send" : sent_name(id));
        if (n == 0u) return;
        if (id == PING_ID && sign) {
            uint8_t payload[PING_LENGTH] = {0};
            memcpy(payload, frame + TC_FRAME_HEADER, frame[1]);
            ping_msg ping;
            ping_decode(&ping, payload, sizeof payload);
            ping.target_system = ME;
            ping.target_component = ME;
            ping_encode(&ping, answer + TC_FRAME_HEADER);
            friend.now_10us = ln.signing.now_10us;
            const size_t m = tc_frame_build(answer, PING_ROW, PING_LENGTH, 0, STATION, COMPONENT, &friend, 0);
            count_begin();
            tc_link_receive(&ln, answer, m, NULL, now_us);
            count_end("tc_link_receive", "answer to a challenge");
        }
    }
}

static void receive(unsigned message, const uint8_t* payload, unsigned length, const char* name) {
    uint8_t frame[TC_FRAME_MAX];
    memcpy(frame + TC_FRAME_HEADER, payload, length);
    const size_t n = tc_frame_build(frame, message, length, 0, STATION, COMPONENT, sign ? &friend : NULL, 0);
    count_begin();
    tc_link_receive(&ln, frame, n, NULL, now_us);
    count_end(sign ? "tc_link_receive, signed" : "tc_link_receive, unsigned", name);
    transmit();
    tick_and_update();
}

#define SEND(NAME, name, ...)                                \
    do {                                                     \
        uint8_t payload_[TC_PAYLOAD_MAX];                    \
        const name##_msg m_ = {__VA_ARGS__};                 \
        name##_encode(&m_, payload_);                        \
        receive(NAME##_ROW, payload_, NAME##_LENGTH, #NAME); \
    } while (0)

static tc_trajectory plan;

static void open_upload(uint32_t transfer) {
    const uint32_t crc32 = worst_case_plan(&plan, TC_MAX_SEGMENTS);
    SEND(GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = transfer, .trajectory_id = 7,
         .crc32 = crc32, .segments = TC_MAX_SEGMENTS, .coefficient_count = TC_MAX_COEFFICIENTS);
}

static void encode_segment(uint32_t transfer, uint16_t index, uint8_t payload[TC_PAYLOAD_MAX]) {
    goshawk_trajectory_segment_msg m = {TO_VEHICLE, .transfer_id = transfer, .index = index};
    m.duration_us = plan.segment[index].duration_us;
    for (unsigned k = 0; k < TC_AXES * TC_MAX_COEFFICIENTS; k++) {
        m.coefficients[k] = plan.segment[index].coefficient[k % TC_AXES][k / TC_AXES];
    }
    goshawk_trajectory_segment_encode(&m, payload);
}

/* The first segment comes last, so that none is checked before: every slice is a whole one. */
static void upload(void) {
    open_upload(9u);
    for (uint16_t i = 1; i <= TC_MAX_SEGMENTS; i++) {
        uint8_t payload[TC_PAYLOAD_MAX];
        encode_segment(9u, i % TC_MAX_SEGMENTS, payload);
        receive(GOSHAWK_TRAJECTORY_SEGMENT_ROW, payload, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH,
                "GOSHAWK_TRAJECTORY_SEGMENT");
    }
    SEND(GOSHAWK_TRAJECTORY_COMMIT, goshawk_trajectory_commit, TO_VEHICLE, .transfer_id = 9, .trajectory_id = 7,
         .crc32 = plan.header.crc32);
    for (unsigned i = 0; i < 2u * TC_MAX_SEGMENTS; i++) tick_and_update();
    transmit();
}

/* More frames at once than signatures may be checked: one of those left over is decided on in the update. */
static void flood(void) {
    open_upload(11u);
    for (uint16_t i = 0; i < 32u; i++) {
        uint8_t frame[TC_FRAME_MAX];
        encode_segment(11u, i, frame + TC_FRAME_HEADER);
        const size_t n = tc_frame_build(frame, GOSHAWK_TRAJECTORY_SEGMENT_ROW, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH, 0,
                                        STATION, COMPONENT, &friend, 0);
        tc_link_receive(&ln, frame, n, NULL, now_us);
    }
    situation = "a frame beyond the budget";
    tick_and_update();
    situation = "";
}

static void parameters(void) {
    const tc_parameters* now = tc_parameters_now(&c);
    for (uint8_t group = 0; group * TC_LINK_GROUP < tc_parameters_count(); group++) {
        goshawk_parameters_stage_msg m = {TO_VEHICLE, .transfer_id = 5, .group = group};
        for (uint16_t i = 0; i < TC_LINK_GROUP; i++) {
            m.values[i] = tc_parameters_get(now, (uint16_t)(group * TC_LINK_GROUP + i));
        }
        uint8_t payload[TC_PAYLOAD_MAX];
        goshawk_parameters_stage_encode(&m, payload);
        receive(GOSHAWK_PARAMETERS_STAGE_ROW, payload, GOSHAWK_PARAMETERS_STAGE_LENGTH, "GOSHAWK_PARAMETERS_STAGE");
    }
    SEND(GOSHAWK_PARAMETERS_COMMIT, goshawk_parameters_commit, TO_VEHICLE, .transfer_id = 5,
         .crc32 = tc_parameters_crc32(now));
    SEND(PARAM_REQUEST_LIST, param_request_list, TO_VEHICLE);
    SEND(PARAM_REQUEST_READ, param_request_read, TO_VEHICLE, .param_index = 3);
    for (unsigned i = 0; i < 8u; i++) transmit();
}

static void start(bool signs) {
    static const uint8_t wrong[TC_KEY_BYTES] = {9};
    tc_parameters p;
    sign = signs;
    tc_init(&c);
    tc_parameters_default(&p);
    (void)tc_parameters_set(&c, &p);
    memset(&config, 0, sizeof config);
    config.system_id = config.component_id = ME;
    config.sign = signs;
    config.start_10us = 1000u;
    config.boot_id = 1u;
    config.bytes_per_s = 100000000u;
    config.log = memory;
    config.log_records = RECORDS;
    config.log_period_us = 10000u;
    count_begin();
    tc_link_init(&ln, &c, &config, now_us);
    count_end("tc_link_init", "");
    tc_signing_init(&friend, config.key, 5000u);
    tc_signing_init(&stranger, wrong, 5000u);
    for (unsigned i = 0; i < 8u; i++) tick_and_update();
}

/* The longest frames that are refused: they must cost less than those that count. */
static void refused(void) {
    static const char* const kinds[] = {"wrong key", "replayed", "no signature", "damaged", "noise"};
    uint8_t frame[TC_FRAME_MAX];
    for (unsigned kind = 0; kind < 5u; kind++) {
        memset(frame, 0x5a, sizeof frame);
        frame[TC_FRAME_HEADER + goshawk_dialect()[GOSHAWK_TRAJECTORY_SEGMENT_ROW].target] = ME;
        frame[TC_FRAME_HEADER + goshawk_dialect()[GOSHAWK_TRAJECTORY_SEGMENT_ROW].target + 1u] = ME;
        stranger.now_10us = ln.signing.now_10us + 100u;
        tc_signing* by = kind == 0u ? &stranger : kind == 2u ? NULL : &friend;
        size_t n = tc_frame_build(frame, GOSHAWK_TRAJECTORY_SEGMENT_ROW, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH, 0, STATION,
                                  COMPONENT, by, 0);
        if (kind == 1u) tc_link_receive(&ln, frame, n, NULL, now_us);
        if (kind == 3u) frame[20] ^= 1u;
        if (kind == 4u) {
            memset(frame, 0xfd, sizeof frame);
            n = sizeof frame;
        }
        now_us += 100000u; /* the budget of checks is whole */
        count_begin();
        tc_link_receive(&ln, frame, n, NULL, now_us);
        count_end("tc_link_receive, refused", kinds[kind]);
        tick_and_update();
    }
}

static void everything(bool signs) {
    start(signs);
    SEND(HEARTBEAT, heartbeat, .type = 6);
    for (unsigned i = 0; i < 50u; i++) { /* challenges go out now and then */
        tick_and_update();
        transmit();
    }
    SEND(HEARTBEAT, heartbeat, .type = 6);
    SEND(GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = 1, .nonce = 3);
    SEND(TIMESYNC, timesync, .ts1 = 5);
    parameters();
    upload();
    if (signs) flood();
    SEND(GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 3, .wanted = {255, 255});
    SEND(GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = 1,
         .command = GOSHAWK_COMMAND_LOG_START);
    for (unsigned i = 0; i < 100u; i++) tick_and_update();
    SEND(GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .wanted = {255});
    SEND(GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = 2, .command = TC_COMMAND_ARM);
    SEND(GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = 3, .command = TC_COMMAND_KILL);
    SEND(COMMAND_LONG, command_long, TO_VEHICLE, .command = 400, .param1 = 1.0f);
    SEND(GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = 1, .nonce = 4);
    for (unsigned i = 0; i < 400u; i++) { /* telemetry of every kind */
        tick_and_update();
        transmit();
    }
    refused();
}

void worst_case_link(void) {
    everything(false);
    everything(true);
    count_begin();
    (void)tc_link_stamp_to_keep(&ln);
    count_end("tc_link_stamp_to_keep", "");
}
