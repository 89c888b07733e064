/* The link endpoint's refusals and answers, one by one: who may do what, what is repeated, what is missing, what is
 * full. */
#include "link_cases.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

tc_controller controller;
tc_link ln;
tc_trajectory plan;
uint64_t clock_us;
static uint8_t memory[4u * TC_LINK_RECORD];
tc_link_config link_config;

void start_link(bool sign, unsigned records) {
    uint64_t now;
    clock_us = 1000000u;
    set_out(&controller, &now, 0, TC_DISARMED);
    controller.store.has_active = false;
    memset(&link_config, 0, sizeof link_config);
    link_config.system_id = link_config.component_id = ME;
    link_config.sign = sign;
    link_config.bytes_per_s = 1000000000u;
    link_config.log = memory;
    link_config.log_records = records;
    link_config.log_period_us = 10000;
    tc_link_init(&ln, &controller, &link_config, clock_us);
    short_plan(&plan, 0);
}

void deliver(uint8_t system, uint8_t component, unsigned message, const uint8_t* payload, unsigned length) {
    uint8_t frame[TC_FRAME_MAX];
    memcpy(frame + TC_FRAME_HEADER, payload, length);
    const size_t n = tc_frame_build(frame, message, length, 0, system, component, NULL, 0);
    tc_link_receive(&ln, frame, n, NULL, clock_us);
}

const uint8_t* answer(uint32_t id) {
    static uint8_t kept[TC_PAYLOAD_MAX];
    uint8_t frame[TC_FRAME_MAX] = {0};
    const uint8_t* found = NULL;
    for (size_t n = 1; n != 0u;) {
        clock_us++; /* earns a thousand bytes */
        n = tc_link_transmit(&ln, frame, clock_us);
        const uint32_t sent = (uint32_t)frame[7] | ((uint32_t)frame[8] << 8) | ((uint32_t)frame[9] << 16);
        if (n != 0u && sent == id) {
            memset(kept, 0, sizeof kept);
            memcpy(kept, frame + TC_FRAME_HEADER, frame[1]);
            found = kept;
        }
    }
    return found;
}

void update(unsigned times) {
    for (unsigned i = 0; i < times; i++) {
        clock_us += 1000u;
        tc_link_update(&ln, clock_us);
    }
}

void lease(uint8_t system, uint8_t action) {
    SEND(system, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = action);
}

static void leases_and_addresses(void) {
    start_link(false, 4);
    deliver(ME, 190, HEARTBEAT_ROW, (const uint8_t*)"", 1);
    deliver(0, 190, HEARTBEAT_ROW, (const uint8_t*)"", 1);
    must(ln.counts.not_for_us == 2u, "from its own id and from nobody");
    SEND(OTHER, COMMAND_ACK, command_ack, .command = 1);
    must(ln.counts.accepted == 1u, "what only a vehicle sends is received and means nothing");
    SEND(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_system = 2, .target_component = ME, .action = 1);
    SEND(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_system = ME, .target_component = 9, .action = 1);
    SEND(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_component = 9, .action = 1);
    must(ln.counts.not_for_us == 5u && ln.lease.holder.system_id == 0u, "to others");
    SEND(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .action = 1);
    must(ln.lease.holder.system_id == PILOT, "to all");
    lease(OTHER, 1);
    lease(OTHER, 0);
    lease(OTHER, 7);
    must(ln.lease.holder.system_id == PILOT, "held by another");
    deliver(PILOT, 7, HEARTBEAT_ROW, (const uint8_t*)"", 1); /* another component of the pilot's system */
    lease(PILOT, 1);
    lease(OTHER, 2);
    must(ln.lease.holder.system_id == OTHER, "by force");
    lease(OTHER, 0);
    must(ln.lease.holder.system_id == 0u && answer(GOSHAWK_LEASE_STATUS_ID) != NULL, "given back");
    lease(PILOT, 1);
    (void)answer(0);
    const uint64_t left_us = ln.lease.until_us - ln.clock_us;
    for (uint64_t i = 1; i < 4u; i++) tc_link_update(&ln, clock_us + i * left_us / 4u);
    tc_link_update(&ln, clock_us + left_us - 1u);
    must(ln.lease.holder.system_id == PILOT, "still held");
    tc_link_update(&ln, clock_us + left_us);
    must(ln.lease.holder.system_id == 0u, "expired");
    clock_us += left_us;
    SEND(PILOT, TIMESYNC, timesync, .tc1 = 5, .ts1 = 6);
    must(answer(TIMESYNC_ID) == NULL, "an answer is not answered");
}

uint8_t send_order(uint8_t system, uint32_t request, uint8_t command, float value, uint32_t id, uint32_t crc32) {
    SEND(system, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = request,
         .command = command, .value = value, .trajectory_id = id, .crc32 = crc32);
    const uint8_t* result = answer(GOSHAWK_MISSION_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_MISSION_RESULT_REASON_AT];
}

static void orders(void) {
    start_link(false, 4);
    must(send_order(PILOT, 1, TC_COMMAND_ARM, 0.0f, 0, 0) == TC_LINK_NOT_IN_CONTROL, "nobody is in control");
    lease(PILOT, 1);
    must(send_order(PILOT, 0, TC_COMMAND_ARM, 0.0f, 0, 0) == 255u, "without a number there is no answer");
    must(send_order(PILOT, 2, TC_COMMAND_START, 0.0f, 5, 5) == TC_NO_TRAJECTORY, "none is active");
    must(send_order(PILOT, 2, TC_COMMAND_ARM, 0.0f, 0, 0) == TC_NO_TRAJECTORY, "a repeated number is a repeated order");
    activate();
    must(send_order(PILOT, 3, TC_COMMAND_START, 0.0f, 6, plan.header.crc32) == TC_LINK_OTHER_TRAJECTORY, "other id");
    must(send_order(PILOT, 4, TC_COMMAND_START, 0.0f, 5, 1) == TC_LINK_OTHER_TRAJECTORY, "other CRC");
    must(send_order(PILOT, 5, TC_COMMAND_START, 0.0f, 5, plan.header.crc32) == TC_WRONG_STATE, "on the ground");
    must(send_order(PILOT, 6, 99, 0.0f, 0, 0) == TC_LINK_UNSUPPORTED, "unknown");
    static const float rates[] = {-1.0f, 1001.0f, NAN, 0.0f, 50.0f};
    for (unsigned i = 0; i < 5u; i++) {
        const uint8_t reason = send_order(PILOT, 10u + i, GOSHAWK_COMMAND_STATE_RATE, rates[i], 0, 0);
        must(reason == (i < 3u ? TC_OUT_OF_RANGE : TC_OK), "rates");
    }
    must(ln.period_us[0] == 20000u, "fifty a second");
    lease(OTHER, 2); /* the same request number from another system, then from another component of the first */
    must(send_order(OTHER, 14, 99, 0.0f, 0, 0) == TC_LINK_UNSUPPORTED, "not a repeat");
    ln.lease.holder.component_id = 191;
    const goshawk_mission_command_msg m = {TO_VEHICLE, .request_id = 14, .command = GOSHAWK_COMMAND_LOG_STOP};
    uint8_t payload[TC_PAYLOAD_MAX];
    goshawk_mission_command_encode(&m, payload);
    deliver(OTHER, 191, GOSHAWK_MISSION_COMMAND_ROW, payload, GOSHAWK_MISSION_COMMAND_LENGTH);
    must(answer(GOSHAWK_MISSION_RESULT_ID)[GOSHAWK_MISSION_RESULT_REASON_AT] == TC_OK, "nor from a component");
    static const struct {
        uint16_t command;
        float param;
        uint32_t id;
    } asked[] = {{520, 0.0f, AUTOPILOT_VERSION_ID},
                 {512, 148.0f, AUTOPILOT_VERSION_ID},
                 {512, 149.0f, 0},
                 {410, 0.0f, HOME_POSITION_ID},
                 {512, 242.0f, HOME_POSITION_ID},
                 {512, 12.0f, 0},
                 {400, 1.0f, 0}};
    (void)answer(0);
    for (unsigned i = 0; i < 7u; i++) {
        SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = asked[i].command, .param1 = asked[i].param);
        must(asked[i].id == 0u || answer(asked[i].id) != NULL, "what was asked for");
        (void)answer(0);
    }
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = 410);
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = 410);
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = 520);
    must(answer(HOME_POSITION_ID) != NULL && answer(AUTOPILOT_VERSION_ID) == NULL, "both, once");
}

/* The operator is back after a long silence, in control again or still, and orders at once. */
static void silences(void) {
    const trouble none = {0};
    uint64_t now;
    for (unsigned still = 0; still < 2u; still++) {
        start_link(false, 4);
        set_out(&controller, &now, 0, TC_HOLD);
        lease(PILOT, 1);
        tc_link_update(&ln, clock_us);
        for (unsigned i = 0; i < 28u; i++) {
            clock_us += 100000u;
            (void)run(&controller, &now, 0.1f, &none);
            tc_link_update(&ln, clock_us);
        }
        must(controller.ground_seen_us + 2500000u < controller.telemetry.time_us, "a silence");
        must((ln.lease.holder.system_id == PILOT) && controller.mission.state == TC_HOLD, "it hovers");
        if (still == 0u) { /* the lease has run out */
            clock_us += 400000u;
            lease(PILOT, 1);
        }
        const tc_trajectory* active = tc_store_active(&controller.store);
        must(send_order(PILOT, 1, TC_COMMAND_START, 0.0f, active->header.id, active->header.crc32) == TC_OK, "starts");
        must(run(&controller, &now, 0.01f, &none) == TC_APPROACH, "and goes on");
    }
}

static void logs(void) {
    const trouble none = {0};
    uint64_t now = 2000000u;
    start_link(false, 0);
    lease(PILOT, 1);
    must(send_order(PILOT, 1, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_LINK_NO_LOG_MEMORY, "no records fit");
    link_config.log_records = 4;
    link_config.log_period_us = 0;
    must(send_order(PILOT, 2, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_LINK_NO_LOG_MEMORY, "no period");
    link_config.log_period_us = 10000;
    link_config.log = NULL;
    must(send_order(PILOT, 3, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_LINK_NO_LOG_MEMORY, "no memory");
    link_config.log = memory;
    must(send_order(PILOT, 4, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_OK, "runs");
    for (unsigned i = 0; i < 8u; i++) {
        (void)run(&controller, &now, 0.011f, &none);
        tc_link_update(&ln, clock_us);
    }
    tc_link_update(&ln, clock_us); /* no time has passed: nothing is due */
    SEND(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = 0);
    const uint8_t* info = answer(GOSHAWK_LOG_INFO_ID);
    must(info[GOSHAWK_LOG_INFO_RECORDS_AT] == 4u && info[GOSHAWK_LOG_INFO_NOT_STORED_AT] > 0u, "full, and says so");
    must(info[GOSHAWK_LOG_INFO_RUNNING_AT] == 1u, "runs still");
    SEND(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = UINT32_MAX, .wanted = {254});
    must(answer(GOSHAWK_LOG_RECORD_ID) == NULL, "nothing beyond the last number");
    SEND(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = 2, .wanted = {255});
    must(answer(GOSHAWK_LOG_RECORD_ID)[GOSHAWK_LOG_RECORD_INDEX_AT] == 3u, "up to the last one");
    must(send_order(PILOT, 5, GOSHAWK_COMMAND_LOG_STOP, 0.0f, 0, 0) == TC_OK, "stops");
    SEND(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = 0);
    must(answer(GOSHAWK_LOG_INFO_ID)[GOSHAWK_LOG_INFO_RUNNING_AT] == 0u, "stopped");
}

/* One group of the present parameters; the first value of it may be another. */
static uint8_t stage(uint8_t system, uint32_t transfer, uint8_t group, const float* first) {
    goshawk_parameters_stage_msg m = {TO_VEHICLE, .transfer_id = transfer, .group = group};
    uint8_t payload[TC_PAYLOAD_MAX];
    for (unsigned i = 0; i < TC_LINK_GROUP; i++) {
        m.values[i] = tc_parameters_get(tc_parameters_now(&controller), (uint16_t)(TC_LINK_GROUP * group + i));
    }
    if (first != NULL) m.values[0] = *first;
    goshawk_parameters_stage_encode(&m, payload);
    deliver(system, 190, GOSHAWK_PARAMETERS_STAGE_ROW, payload, GOSHAWK_PARAMETERS_STAGE_LENGTH);
    const uint8_t* result = answer(GOSHAWK_PARAMETERS_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_PARAMETERS_RESULT_REASON_AT];
}

/* All groups; the last answer. */
static uint8_t stage_all(uint8_t system, uint32_t transfer, const float* first) {
    uint8_t reason = 255u;
    for (uint8_t group = 0; group * TC_LINK_GROUP < tc_parameters_count(); group++) {
        reason = stage(system, transfer, group, group == 0u ? first : NULL);
    }
    return reason;
}

uint8_t stage_parameters(uint8_t system, uint32_t transfer) { return stage_all(system, transfer, NULL); }

uint8_t commit_parameters(uint8_t system, uint32_t transfer, uint32_t crc32) {
    SEND(system, GOSHAWK_PARAMETERS_COMMIT, goshawk_parameters_commit, TO_VEHICLE, .transfer_id = transfer,
         .crc32 = crc32);
    const uint8_t* result = answer(GOSHAWK_PARAMETERS_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_PARAMETERS_RESULT_REASON_AT];
}

static void parameters(void) {
    static const float heavier = 0.71f, none = NAN;
    start_link(false, 4);
    tc_parameters wanted = *tc_parameters_now(&controller);
    const uint32_t before = tc_parameters_crc32(&wanted);
    must(stage(PILOT, 1, 0, NULL) == 255u && commit_parameters(PILOT, 1, before) == 255u, "not in control");
    lease(PILOT, 1);
    must(stage(PILOT, 0, 0, NULL) == 255u && commit_parameters(PILOT, 0, before) == 255u, "without a number");
    must(commit_parameters(PILOT, 2, before) == TC_NO_UPLOAD, "unknown");
    must(stage(PILOT, 2, 0, NULL) == 255u, "and then done");
    must(stage(PILOT, 3, 0, NULL) == TC_OK && stage(PILOT, 3, 7, NULL) == TC_OK, "a group that there is not");
    must(commit_parameters(PILOT, 3, before) == TC_SEGMENTS_MISSING, "not all there");
    must(stage(PILOT, 4, 0, &none) == TC_NOT_FINITE && stage(PILOT, 4, 1, NULL) == TC_NOT_FINITE, "no number");
    must(commit_parameters(PILOT, 4, before) == TC_NOT_FINITE, "stays refused");
    must(stage_all(PILOT, 5, &heavier) == TC_OK, "all there");
    must(commit_parameters(PILOT, 5, before) == TC_CRC_MISMATCH, "another CRC");
    must(tc_parameters_crc32(tc_parameters_now(&controller)) == before, "changes nothing");
    must(stage_all(PILOT, 6, &heavier) == TC_OK, "all there");
    wanted.mass_kg = heavier;
    const uint32_t after = tc_parameters_crc32(&wanted);
    must(commit_parameters(PILOT, 6, after) == TC_OK, "set");
    must(tc_parameters_crc32(tc_parameters_now(&controller)) == after, "as wanted");
    must(commit_parameters(PILOT, 6, 0) == TC_OK, "repeated: the same answer");
    static const int16_t indices[] = {0, -1, 30000};
    for (unsigned i = 0; i < 3u; i++) {
        SEND(OTHER, PARAM_REQUEST_READ, param_request_read, TO_VEHICLE, .param_index = indices[i],
             .param_id = "kp_z_1_s2");
        must((answer(PARAM_VALUE_ID) != NULL) == (i < 2u), "by index, by name, and what there is not");
    }
    SEND(OTHER, PARAM_REQUEST_READ, param_request_read, TO_VEHICLE, .param_index = -1, .param_id = "nonsense");
    must(answer(PARAM_VALUE_ID) == NULL, "no such name");
    SEND(OTHER, PARAM_REQUEST_LIST, param_request_list, TO_VEHICLE);
    must(answer(PARAM_VALUE_ID)[PARAM_VALUE_PARAM_INDEX_AT] == tc_parameters_count() - 1u, "to the last one");
}

/* A station without control names the transfer of the one that has it: nothing of the open set changes. */
static void foreign_stage(void) {
    static const float heavier = 0.71f, none = NAN;
    start_link(false, 4);
    const uint32_t before = tc_parameters_crc32(tc_parameters_now(&controller));
    lease(PILOT, 1);
    must(stage_parameters(PILOT, 1) == TC_OK, "staged");
    const tc_link_set staged = ln.set;
    must(stage_all(OTHER, 1, &heavier) == 255u && stage(OTHER, 1, 0, &none) == 255u, "not answered");
    must(stage_all(OTHER, 2, &heavier) == 255u && commit_parameters(OTHER, 1, before) == 255u, "nor this");
    must(memcmp(&staged, &ln.set, sizeof staged) == 0, "not a byte of the set has changed");
    must(commit_parameters(PILOT, 1, before) == TC_OK, "and the set can be committed");
}

/* A poor line makes it wait. */
static void slow_line(void) {
    uint8_t frame[TC_FRAME_MAX];
    start_link(false, 4);
    link_config.bytes_per_s = 1000;
    must(tc_link_transmit(&ln, frame, clock_us) > 0u, "a first frame");
    must(tc_link_transmit(&ln, frame, clock_us) == 0u, "then it waits");
    must((ln.pending != 0u) && ln.byte_credit_us < 0, "nothing left to spend");
    must(tc_link_transmit(&ln, frame, clock_us + 500u) == 0u, "half a byte is kept for later");
    must(tc_link_transmit(&ln, frame, clock_us + 1000000u) > 0u, "saved up");
}

static void telemetry(void) {
    const trouble lost = {.no_attitude = true}, none = {0};
    uint64_t now;
    start_link(false, 4);
    set_out(&controller, &now, 0, TC_HOLD);
    controller.telemetry.estimate.battery_v = 15.0f;
    tc_link_update(&ln, clock_us);
    must(answer(HEARTBEAT_ID)[HEARTBEAT_SYSTEM_STATUS_AT] == 4u, "active");
    (void)memset(ln.next_us, 0, sizeof ln.next_us);
    (void)run(&controller, &now, 0.3f, &lost);
    tc_link_update(&ln, clock_us);
    must(answer(HEARTBEAT_ID)[HEARTBEAT_SYSTEM_STATUS_AT] == 6u, "in trouble");
    set_out(&controller, &now, 0, TC_TRAJECTORY);
    (void)run(&controller, &now, 0.05f, &none);
    controller.telemetry.estimate.battery_v = 70.0f;
    (void)memset(ln.next_us, 0, sizeof ln.next_us);
    tc_link_update(&ln, clock_us);
    must(answer(GOSHAWK_MISSION_STATUS_ID)[GOSHAWK_MISSION_STATUS_MISSION_STATE_AT] == TC_TRAJECTORY, "flies");
}

/* The next text for the pilot, put together from its chunks; "" when there is none. */
static const char* next_text(uint8_t* severity) {
    static char text[151];
    uint8_t frame[TC_FRAME_MAX];
    unsigned chunks = 0;
    memset(text, 0, sizeof text);
    for (size_t n = 1; n != 0u;) {
        clock_us++;
        n = tc_link_transmit(&ln, frame, clock_us);
        if (n != 0u && frame[7] == STATUSTEXT_ID && frame[8] == 0u) {
            statustext_msg m;
            statustext_decode(&m, frame + TC_FRAME_HEADER, frame[1]);
            must(m.chunk_seq == chunks && (m.id != 0u || chunks == 0u), "chunks in their order");
            memcpy(text + 50u * chunks, m.text, sizeof m.text);
            *severity = m.severity;
            chunks++;
            if (m.id == 0u || m.text[49] == '\0') break;
        }
    }
    return text;
}

/* What changes is reported in words: the state and why, the limit of the path rate, warnings. */
static void texts(void) {
    uint8_t severity = 0;
    start_link(false, 4);
    (void)next_text(&severity);
    controller.mission.state = TC_LANDING;
    controller.mission.reason = TC_LINK_LOST;
    controller.mission.transitions++;
    update(1);
    must(strcmp(next_text(&severity), "landing: link is lost") == 0 && severity == 4u, "a failsafe warns");
    controller.mission.reason = TC_COMMANDED;
    controller.mission.transitions++;
    update(1);
    must(strcmp(next_text(&severity), "landing: commanded") == 0 && severity == 6u, "an order does not");
    controller.mission.state = TC_EMERGENCY;
    controller.mission.reason = TC_RELOCALIZED;
    controller.mission.transitions++;
    update(1);
    char whole[151];
    (void)snprintf(whole, sizeof whole, "%s: %s", tc_mission_state_text(TC_EMERGENCY), tc_reason_text(TC_RELOCALIZED));
    must(strlen(whole) > 50u && strcmp(next_text(&severity), whole) == 0 && severity == 3u, "a long one, in chunks");
    update(300);
    controller.telemetry.limit_reason = TC_TRACKING_ERROR;
    update(1);
    must(strcmp(next_text(&severity), "path: slowed by its tracking error") == 0 && severity == 4u, "slowed");
    update(300);
    controller.telemetry.limit_reason = TC_OK;
    controller.telemetry.warnings = TC_WARNING_BATTERY | TC_WARNING_GYRO_ONLY;
    update(1);
    must(strcmp(next_text(&severity), "path: at the rate asked for") == 0 && severity == 6u, "no longer");
    update(300);
    must(strcmp(next_text(&severity), "warning: battery is low") == 0 && severity == 4u, "one warning");
    update(300);
    must(strncmp(next_text(&severity), "warning: attitude is lost", 25) == 0, "and the other");
    controller.telemetry.warnings = TC_WARNING_GYRO_ONLY;
    update(300);
    must(strcmp(next_text(&severity), "over: battery is low") == 0 && severity == 6u, "over");
    update(300);
    must(next_text(&severity)[0] == '\0', "nothing new");
    unsigned texts = 0;
    for (unsigned i = 0; i < 1000u; i++) {
        controller.telemetry.warnings ^= TC_WARNING_CLOCK;
        update(1);
        texts += next_text(&severity)[0] != '\0' ? 1u : 0u;
    }
    must(texts >= 1u && texts <= 6u, "one that flickers is not reported each time");
}

/* A GOSHAWK_STATE holds what the controller knows, field by field; a record of the log is the same. */
static void states(void) {
    tc_telemetry* t = &controller.telemetry;
    goshawk_state_msg m;
    start_link(false, 4);
    lease(PILOT, 1);
    (void)answer(0);
    t->time_us = 7000000u;
    t->reason = TC_REACHED;
    t->limit_reason = TC_TRACKING_ERROR;
    t->warnings = 5;
    t->landing_stage = 2;
    t->path_rate = 0.5f;
    t->path_limit = 0.25f;
    t->reckoning_s = 0.1f;
    t->reckoning_std_m = 0.2f;
    t->estimate_faults = 3;
    t->estimate.valid = 127;
    for (unsigned i = 0; i < TC_ROTORS; i++) t->estimate.rotor_speed_rad_s[i] = (float)(i + 1u);
    t->estimate.specific_force_body_m_s2[2] = 9.5f;
    t->estimate.battery_v = 15.5f;
    must(send_order(PILOT, 4, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_OK, "a log");
    t->time_us += 20000u;
    tc_link_update(&ln, clock_us);
    goshawk_state_decode(&m, answer(GOSHAWK_STATE_ID), GOSHAWK_STATE_LENGTH);
    must(m.time_us == 7020000u && m.reason == TC_REACHED && m.limit_reason == TC_TRACKING_ERROR, "time, reasons");
    must(m.warnings == 5u && m.landing_stage == 2u && m.estimate_faults == 3u && m.estimate_valid == 127u, "bits");
    must(m.path_rate == 0.5f && m.path_limit == 0.25f && m.trajectory_time_s == -1.0f, "path");
    must(m.reckoning_s == 0.1f && m.reckoning_std_m == 0.2f, "dead reckoning");
    must(m.specific_force_body_m_s2[2] == 9.5f && m.battery_v == 15.5f && m.rotor_speed_rad_s[3] == 4.0f, "sensors");
    must(memcmp(memory, &m, GOSHAWK_STATE_MISSION_STATE_AT - 2) == 0, "as in the log, up to the sequence number");
}

void link_cases(void) {
    leases_and_addresses();
    orders();
    silences();
    upload_cases();
    logs();
    parameters();
    foreign_stage();
    slow_line();
    admission_cases();
    telemetry();
    texts();
    states();
    link_time_cases();
    link_corner_cases();
}
