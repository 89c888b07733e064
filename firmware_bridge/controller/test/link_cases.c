/* The link endpoint's refusals and answers, one by one: who may do what, what is repeated, what is missing, what is
 * full. */
#include "link_cases.h"

#include <math.h>
#include <string.h>

tc_controller controller;
tc_link ln;
tc_trajectory plan;
uint64_t clock_us;
static uint8_t memory[4u * TC_LINK_RECORD];
static tc_link_config config;
static tc_parser serial;

void begin_anew(bool sign, unsigned records) {
    uint64_t now;
    clock_us = 1000000u;
    set_out(&controller, &now, 0, TC_DISARMED);
    controller.store.has_active = false;
    memset(&config, 0, sizeof config);
    config.system_id = config.component_id = ME;
    config.sign = sign;
    config.bytes_per_s = 1000000000u;
    config.log = memory;
    config.log_records = records;
    config.log_period_us = 10000;
    tc_link_init(&ln, &controller, &config, clock_us);
    short_plan(&plan, 0);
}

void say(uint8_t system, uint8_t component, unsigned message, const uint8_t* payload, unsigned length) {
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
        const uint32_t said = (uint32_t)frame[7] | ((uint32_t)frame[8] << 8) | ((uint32_t)frame[9] << 16);
        if (n != 0u && said == id) {
            memset(kept, 0, sizeof kept);
            memcpy(kept, frame + TC_FRAME_HEADER, frame[1]);
            found = kept;
        }
    }
    return found;
}

void lease(uint8_t system, uint8_t action) {
    SAY(system, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = action);
}

static void leases_and_addresses(void) {
    begin_anew(false, 4);
    say(ME, 190, HEARTBEAT_ROW, (const uint8_t*)"", 1);
    say(0, 190, HEARTBEAT_ROW, (const uint8_t*)"", 1);
    must(ln.counts.not_for_us == 2u, "from its own id and from nobody");
    SAY(OTHER, COMMAND_ACK, command_ack, .command = 1);
    must(ln.counts.accepted == 1u, "what only a vehicle says is heard and means nothing");
    SAY(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_system = 2, .target_component = ME, .action = 1);
    SAY(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_system = ME, .target_component = 9, .action = 1);
    SAY(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_component = 9, .action = 1);
    must(ln.counts.not_for_us == 5u && ln.lease.system_id == 0u, "to others");
    SAY(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .action = 1);
    must(ln.lease.system_id == PILOT, "to all");
    lease(OTHER, 1);
    lease(OTHER, 0);
    lease(OTHER, 7);
    must(ln.lease.system_id == PILOT, "held by another");
    say(PILOT, 7, HEARTBEAT_ROW, (const uint8_t*)"", 1); /* another component of the pilot's system */
    lease(PILOT, 1);
    lease(OTHER, 2);
    must(ln.lease.system_id == OTHER, "by force");
    lease(OTHER, 0);
    must(ln.lease.system_id == 0u && answer(GOSHAWK_LEASE_STATUS_ID) != NULL, "given back");
    lease(PILOT, 1);
    (void)answer(0);
    const tc_link_measured measured = {{0}, {0}};
    const uint64_t end_us = clock_us - (uint32_t)clock_us + ln.until_us;
    tc_link_update(&ln, &measured, end_us - 1u);
    must(ln.lease.system_id == PILOT, "still held");
    tc_link_update(&ln, &measured, end_us);
    must(ln.lease.system_id == 0u, "expired");
    controller.telemetry.time_us = 500000u; /* the vehicle's clock is younger than the silence */
    tc_link_update(&ln, &measured, end_us);
    must(500000u - controller.ground_seen_us == TC_LINK_LEASE_US, "silent since before its start");
    SAY(PILOT, TIMESYNC, timesync, .tc1 = 5, .ts1 = 6);
    must(answer(TIMESYNC_ID) == NULL, "an answer is not answered");
}

static uint8_t order(uint8_t system, uint32_t request, uint8_t command, float value, uint32_t id, uint32_t crc32) {
    SAY(system, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = request, .command = command,
        .value = value, .trajectory_id = id, .crc32 = crc32);
    const uint8_t* result = answer(GOSHAWK_MISSION_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_MISSION_RESULT_REASON_AT];
}

static void orders(void) {
    begin_anew(false, 4);
    must(order(PILOT, 1, TC_COMMAND_ARM, 0.0f, 0, 0) == TC_LINK_NOT_IN_CONTROL, "nobody is in control");
    lease(PILOT, 1);
    must(order(PILOT, 0, TC_COMMAND_ARM, 0.0f, 0, 0) == 255u, "without a number there is no answer");
    must(order(PILOT, 2, TC_COMMAND_START, 0.0f, 5, 5) == TC_NO_TRAJECTORY, "none is active");
    must(order(PILOT, 2, TC_COMMAND_ARM, 0.0f, 0, 0) == TC_NO_TRAJECTORY, "a repeated number is a repeated order");
    activate();
    must(order(PILOT, 3, TC_COMMAND_START, 0.0f, 6, plan.header.crc32) == TC_LINK_OTHER_TRAJECTORY, "other id");
    must(order(PILOT, 4, TC_COMMAND_START, 0.0f, 5, 1) == TC_LINK_OTHER_TRAJECTORY, "other CRC");
    must(order(PILOT, 5, TC_COMMAND_START, 0.0f, 5, plan.header.crc32) == TC_WRONG_STATE, "on the ground");
    must(order(PILOT, 6, 99, 0.0f, 0, 0) == TC_LINK_UNSUPPORTED, "unknown");
    static const float rates[] = {-1.0f, 1001.0f, NAN, 0.0f, 50.0f};
    for (unsigned i = 0; i < 5u; i++) {
        const uint8_t reason = order(PILOT, 10u + i, GOSHAWK_COMMAND_STATE_RATE, rates[i], 0, 0);
        must(reason == (i < 3u ? TC_OUT_OF_RANGE : TC_OK), "rates");
    }
    must(ln.state_period_us == 20000u, "fifty a second");
    lease(OTHER, 2); /* the same request number from another system, then from another component of the first */
    must(order(OTHER, 14, 99, 0.0f, 0, 0) == TC_LINK_UNSUPPORTED, "not a repeat");
    ln.lease.component_id = 191;
    const goshawk_mission_command_msg m = {TO_VEHICLE, .request_id = 14, .command = GOSHAWK_COMMAND_LOG_STOP};
    uint8_t payload[TC_PAYLOAD_MAX];
    goshawk_mission_command_encode(&m, payload);
    say(OTHER, 191, GOSHAWK_MISSION_COMMAND_ROW, payload, GOSHAWK_MISSION_COMMAND_LENGTH);
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
        SAY(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = asked[i].command, .param1 = asked[i].param);
        must(asked[i].id == 0u || answer(asked[i].id) != NULL, "what was asked for");
        (void)answer(0);
    }
    SAY(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = 410);
    SAY(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = 410);
    SAY(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = 520);
    must(answer(HOME_POSITION_ID) != NULL && answer(AUTOPILOT_VERSION_ID) == NULL, "both, once");
}

/* The operator is back after a long silence, in control again or still, and orders at once. */
static void silences(void) {
    const tc_link_measured measured = {{0}, {0}};
    const trouble none = {0};
    uint64_t now;
    for (unsigned still = 0; still < 2u; still++) {
        begin_anew(false, 4);
        set_out(&controller, &now, 0, TC_HOLD);
        lease(PILOT, 1);
        tc_link_update(&ln, &measured, clock_us);
        for (unsigned i = 0; i < 28u; i++) {
            clock_us += 100000u;
            (void)run(&controller, &now, 0.1f, &none);
            tc_link_update(&ln, &measured, clock_us);
        }
        must(controller.ground_seen_us + 2500000u < controller.telemetry.time_us, "a silence");
        must((ln.lease.system_id == PILOT) && controller.mission.state == TC_HOLD, "it hovers");
        if (still == 0u) { /* the lease has run out */
            clock_us += 400000u;
            lease(PILOT, 1);
        }
        const tc_trajectory* active = tc_store_active(&controller.store);
        must(order(PILOT, 1, TC_COMMAND_START, 0.0f, active->header.id, active->header.crc32) == TC_OK, "starts");
        must(run(&controller, &now, 0.01f, &none) == TC_APPROACH, "and goes on");
    }
}

static void logs(void) {
    const tc_link_measured measured = {.rotor_speed_rad_s = {1.0f}};
    const trouble none = {0};
    uint64_t now = 2000000u;
    begin_anew(false, 0);
    lease(PILOT, 1);
    must(order(PILOT, 1, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_LINK_NO_LOG_MEMORY, "no records fit");
    config.log_records = 4;
    config.log_period_us = 0;
    must(order(PILOT, 2, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_LINK_NO_LOG_MEMORY, "no period");
    config.log_period_us = 10000;
    config.log = NULL;
    must(order(PILOT, 3, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_LINK_NO_LOG_MEMORY, "no memory");
    config.log = memory;
    must(order(PILOT, 4, GOSHAWK_COMMAND_LOG_START, 0.0f, 0, 0) == TC_OK, "runs");
    for (unsigned i = 0; i < 8u; i++) {
        (void)run(&controller, &now, 0.011f, &none);
        tc_link_update(&ln, &measured, clock_us);
    }
    tc_link_update(&ln, &measured, clock_us); /* no time has passed: nothing is due */
    SAY(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = 0);
    const uint8_t* info = answer(GOSHAWK_LOG_INFO_ID);
    must(info[GOSHAWK_LOG_INFO_RECORDS_AT] == 4u && info[GOSHAWK_LOG_INFO_NOT_STORED_AT] > 0u, "full, and says so");
    must(info[GOSHAWK_LOG_INFO_RUNNING_AT] == 1u, "runs still");
    SAY(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = 2, .wanted = {255});
    must(answer(GOSHAWK_LOG_RECORD_ID)[GOSHAWK_LOG_RECORD_INDEX_AT] == 3u, "up to the last one");
    must(order(PILOT, 5, GOSHAWK_COMMAND_LOG_STOP, 0.0f, 0, 0) == TC_OK, "stops");
    SAY(OTHER, GOSHAWK_LOG_REQUEST, goshawk_log_request, TO_VEHICLE, .first = 0);
    must(answer(GOSHAWK_LOG_INFO_ID)[GOSHAWK_LOG_INFO_RUNNING_AT] == 0u, "stopped");
}

static uint8_t stage(uint8_t system, uint32_t transfer, uint8_t group, float first) {
    goshawk_parameters_stage_msg m = {TO_VEHICLE, .transfer_id = transfer, .group = group};
    uint8_t payload[TC_PAYLOAD_MAX];
    for (unsigned i = 0; i < TC_LINK_GROUP; i++) {
        m.values[i] = tc_parameters_get(tc_parameters_now(&controller), (uint16_t)(TC_LINK_GROUP * group + i));
    }
    if (isnan(first) || first != 0.0f) m.values[0] = first;
    goshawk_parameters_stage_encode(&m, payload);
    say(system, 190, GOSHAWK_PARAMETERS_STAGE_ROW, payload, GOSHAWK_PARAMETERS_STAGE_LENGTH);
    const uint8_t* result = answer(GOSHAWK_PARAMETERS_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_PARAMETERS_RESULT_REASON_AT];
}

static uint8_t set(uint8_t system, uint32_t transfer, uint32_t crc32) {
    SAY(system, GOSHAWK_PARAMETERS_COMMIT, goshawk_parameters_commit, TO_VEHICLE, .transfer_id = transfer,
        .crc32 = crc32);
    const uint8_t* result = answer(GOSHAWK_PARAMETERS_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_PARAMETERS_RESULT_REASON_AT];
}

uint8_t stage_parameters(uint32_t transfer, uint8_t group) { return stage(PILOT, transfer, group, 0.0f); }

uint8_t commit_parameters(uint32_t transfer, uint32_t crc32) { return set(PILOT, transfer, crc32); }

static void parameters(void) {
    begin_anew(false, 4);
    tc_parameters wanted = *tc_parameters_now(&controller);
    const uint32_t before = tc_parameters_crc32(&wanted);
    must(stage(PILOT, 1, 0, 0.0f) == 255u && set(PILOT, 1, before) == 255u, "not in control");
    lease(PILOT, 1);
    must(stage(PILOT, 0, 0, 0.0f) == 255u && set(PILOT, 0, before) == 255u, "without a number");
    must(set(PILOT, 2, before) == TC_NO_UPLOAD && stage(PILOT, 2, 0, 0.0f) == 255u, "unknown, and then done");
    must(stage(PILOT, 3, 0, 0.0f) == TC_OK && stage(PILOT, 3, 7, 0.0f) == TC_OK, "a group that there is not");
    must(set(PILOT, 3, before) == TC_SEGMENTS_MISSING, "not all there");
    must(stage(PILOT, 4, 0, NAN) == TC_NOT_FINITE && stage(PILOT, 4, 1, 0.0f) == TC_NOT_FINITE, "no number");
    must(set(PILOT, 4, before) == TC_NOT_FINITE, "stays refused");
    must(stage(PILOT, 5, 0, 0.71f) == TC_OK && stage(PILOT, 5, 1, 0.0f) == TC_OK, "all there");
    must(set(PILOT, 5, before) == TC_CRC_MISMATCH && controller.parameters.mass_kg == 0.7f, "another CRC");
    must(stage(PILOT, 6, 0, 0.71f) == TC_OK && stage(PILOT, 6, 1, 0.0f) == TC_OK, "all there");
    wanted.mass_kg = 0.71f;
    must(set(PILOT, 6, tc_parameters_crc32(&wanted)) == TC_OK && controller.parameters.mass_kg == 0.71f, "set");
    must(set(PILOT, 6, 0) == TC_OK, "repeated: the same answer");
    static const int16_t indices[] = {0, -1, 30000};
    for (unsigned i = 0; i < 3u; i++) {
        SAY(OTHER, PARAM_REQUEST_READ, param_request_read, TO_VEHICLE, .param_index = indices[i],
            .param_id = "kp_z_1_s2");
        must((answer(PARAM_VALUE_ID) != NULL) == (i < 2u), "by index, by name, and what there is not");
    }
    SAY(OTHER, PARAM_REQUEST_READ, param_request_read, TO_VEHICLE, .param_index = -1, .param_id = "nonsense");
    must(answer(PARAM_VALUE_ID) == NULL, "no such name");
    SAY(OTHER, PARAM_REQUEST_LIST, param_request_list, TO_VEHICLE);
    must(answer(PARAM_VALUE_ID)[PARAM_VALUE_PARAM_INDEX_AT] == tc_parameters_count() - 1u, "to the last one");
}

/* A signing vehicle: what it counts, and that a poor line makes it wait. */
static void signed_and_slow(void) {
    static const uint8_t key[TC_KEY_BYTES] = {0}, wrong[TC_KEY_BYTES] = {1};
    uint8_t frame[TC_FRAME_MAX];
    static const heartbeat_msg nothing = {0};
    tc_signing friend, stranger;
    begin_anew(true, 4);
    tc_signing_init(&friend, key, 10);
    tc_signing_init(&stranger, wrong, 10);
    lease(PILOT, 1);
    say(PILOT, 190, HEARTBEAT_ROW, (const uint8_t*)"", 1);
    must(ln.counts.without_signature == 1u, "heartbeats are not counted");
    heartbeat_encode(&nothing, frame + TC_FRAME_HEADER);
    size_t n = tc_frame_build(frame, HEARTBEAT_ROW, HEARTBEAT_LENGTH, 0, PILOT, 190, &stranger, 0);
    tc_link_receive(&ln, frame, n, NULL, clock_us);
    heartbeat_encode(&nothing, frame + TC_FRAME_HEADER);
    n = tc_frame_build(frame, HEARTBEAT_ROW, HEARTBEAT_LENGTH, 0, PILOT, 190, &friend, 0);
    tc_link_receive(&ln, frame, n, &serial, clock_us);
    tc_link_receive(&ln, frame, n, NULL, clock_us);
    must(ln.counts.wrong_key == 1u && ln.counts.accepted == 1u && ln.counts.replayed == 1u, "counted");
    config.bytes_per_s = 1000;
    ln.budget_byte_us = -1000000;
    ln.budget_us = (uint32_t)clock_us;
    must(tc_link_transmit(&ln, frame, clock_us) == 0u, "nothing to spend");
    must(tc_link_transmit(&ln, frame, clock_us + 500u) == 0u, "half a byte is kept for later");
    must(tc_link_transmit(&ln, frame, clock_us + 1000000u) > 0u, "saved up");
}

static void tellings(void) {
    const tc_link_measured measured = {{0}, {0}};
    const trouble lost = {.no_attitude = true}, none = {0};
    uint64_t now;
    begin_anew(false, 4);
    set_out(&controller, &now, 0, TC_HOLD);
    controller.telemetry.estimate.battery_v = 15.0f;
    tc_link_update(&ln, &measured, clock_us);
    must(answer(HEARTBEAT_ID)[HEARTBEAT_SYSTEM_STATUS_AT] == 4u, "active");
    (void)memset(ln.due_us, 0, sizeof ln.due_us);
    (void)run(&controller, &now, 2.0f, &lost);
    tc_link_update(&ln, &measured, clock_us);
    must(answer(HEARTBEAT_ID)[HEARTBEAT_SYSTEM_STATUS_AT] == 6u, "in trouble");
    set_out(&controller, &now, 0, TC_TRAJECTORY);
    (void)run(&controller, &now, 0.05f, &none);
    controller.telemetry.estimate.battery_v = 70.0f;
    (void)memset(ln.due_us, 0, sizeof ln.due_us);
    tc_link_update(&ln, &measured, clock_us);
    must(answer(GOSHAWK_MISSION_STATUS_ID)[GOSHAWK_MISSION_STATUS_MISSION_STATE_AT] == TC_TRAJECTORY, "flies");
    set_out(&controller, &now, 0, TC_HOLD);
    (void)run(&controller, &now, 1.0f, &(trouble){.no_position = true});
    (void)memset(ln.due_us, 0, sizeof ln.due_us);
    tc_link_update(&ln, &measured, clock_us);
    must(answer(STATUSTEXT_ID)[STATUSTEXT_SEVERITY_AT] == 3u, "an emergency is an error");
}

/* A link task that read its clock just before or after the control task; and one that seldom gets to send. */
static void other_clocks(void) {
    const tc_link_measured measured = {0};
    uint8_t frame[TC_FRAME_MAX];
    begin_anew(false, 4);
    controller.telemetry.time_us = clock_us;
    lease(PILOT, 1);
    tc_link_update(&ln, &measured, clock_us - 5u);
    must(ln.lease.system_id == PILOT, "still in control");
    must((uint32_t)controller.telemetry.time_us - controller.ground_seen_us == 0u, "heard just now");
    (void)answer(0);
    config.bytes_per_s = 1000;
    size_t sent = 0;
    for (unsigned i = 0; i < 400u; i++) {
        clock_us += 25000u;
        controller.telemetry.time_us = clock_us;
        tc_link_update(&ln, &measured, clock_us);
        for (size_t n = 1; n > 0u; sent += n) n = tc_link_transmit(&ln, frame, clock_us);
    }
    must(sent > 9000u && sent < 11000u, "keeps to its share however seldom it is asked");
}

/* Times are low words. Over their wrap all goes on; what is long past stays past, also when its low word is back. */
static void long_times(void) {
    const tc_link_measured measured = {0};
    const uint64_t round_us = (uint64_t)1 << 32;
    begin_anew(false, 4);
    clock_us = round_us - 1500000u;
    lease(PILOT, 1);
    (void)answer(0);
    unsigned heartbeats = 0;
    for (unsigned i = 0; i < 40u; i++) {
        clock_us += 100000u;
        lease(PILOT, 1);
        tc_link_update(&ln, &measured, clock_us);
        must(ln.lease.system_id == PILOT, "renewed over the wrap");
        heartbeats += answer(HEARTBEAT_ID) != NULL ? 1u : 0u;
    }
    must(heartbeats == 4u, "one a second over the wrap");
    activate();
    SAY(PILOT, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = 3, .trajectory_id = 9,
        .segments = 2, .coefficient_count = 8);
    (void)answer(0);
    controller.telemetry.time_us = clock_us;
    const uint64_t start_us = clock_us;
    for (unsigned i = 1; i <= 5u; i++) { /* 14 to 72 minutes; the last one just before and behind a whole round */
        clock_us = start_us + (i < 5u ? i * (round_us / 5u) : round_us + 400000u);
        controller.telemetry.time_us = clock_us;
        tc_link_update(&ln, &measured, clock_us);
        must(ln.lease.system_id == 0u, "the lease is over and stays over");
        must((uint32_t)clock_us - controller.ground_seen_us >= 800000000u, "silent for long, and not heard again");
        must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "nobody waits for reports on the upload");
        clock_us += 1000000u;
        must(answer(HEARTBEAT_ID) != NULL, "while the heart goes on beating");
    }
    lease(PILOT, 1);
    must(ln.lease.system_id == PILOT, "may be taken anew");
    must(stage_parameters(4, 0) == TC_OK, "and the upload gives way");
}

void link_cases(void) {
    leases_and_addresses();
    orders();
    silences();
    upload_cases();
    logs();
    parameters();
    signed_and_slow();
    tellings();
    long_times();
    other_clocks();
}
