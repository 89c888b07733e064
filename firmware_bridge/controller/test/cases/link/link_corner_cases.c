/* What seldom happens to a link: another controller flies, texts without end, a budget of one's own, a commit whose
   upload is gone. */
#include <string.h>

#include "../../../src/link/services/services.h"
#include "link_cases.h"

/* No order of either protocol reaches a vehicle that another controller flies; KILL neither. */
static void orders_in_shadow(void) {
    start_link(false, 0);
    lease(PILOT, 1);
    must(tc_shadow(&controller) == TC_OK, "another controller flies");
    for (uint8_t order = 0; order < TC_COMMAND_COUNT; order++) {
        if (order == TC_COMMAND_START) continue; /* asks for a trajectory first */
        must(send_order(PILOT, 1u + order, order, 1.0f, 0, 0) == TC_WRONG_STATE, "no order of ours");
    }
    static const uint16_t commands[] = {400 /* arm or disarm */, 21 /* land */, 185 /* terminate */};
    for (unsigned i = 0; i < 6u; i++) {
        SEND(PILOT, COMMAND_LONG, command_long, TO_VEHICLE, .command = commands[i / 2u], .param1 = (float)(i % 2u),
             .param2 = 21196.0f);
        must(answer(COMMAND_ACK_ID) != NULL && controller.mission.state == TC_SHADOW, "nor a standard one");
    }
}

/* The sentence about the last transition, and how grave it is: 6 information, 4 warning. */
static uint8_t severity_of(uint8_t reason) {
    statustext_msg m;
    controller.mission.reason = reason;
    controller.mission.transitions++;
    update(1);
    const uint8_t* payload = answer(STATUSTEXT_ID);
    must(payload != NULL, "told");
    statustext_decode(&m, payload, STATUSTEXT_LENGTH);
    return m.severity;
}

static void graveness_of_reasons(void) {
    static const uint8_t planned[] = {TC_OK,        TC_COMMANDED,     TC_REACHED,  TC_FINISHED, TC_STANDING_STILL,
                                      TC_TOUCHDOWN, TC_ESTIMATE_BACK, TC_RELEASED, TC_ENGAGED};
    start_link(false, 0);
    for (unsigned i = 0; i < sizeof planned; i++) must(severity_of(planned[i]) == 6u, "as planned");
    must(severity_of(TC_FENCE_BREACH) == 4u && severity_of(TC_BATTERY_LOW) == 4u, "not as planned");
    controller.mission.state = TC_FAULT;
    must(severity_of(TC_TILT_ERROR) == 3u, "an error");
}

static void warnings_without_a_name(void) {
    start_link(false, 0);
    statustext_msg m;
    controller.telemetry.warnings = 128u;
    update(300);
    const uint8_t* payload = answer(STATUSTEXT_ID);
    must(payload != NULL, "told");
    statustext_decode(&m, payload, STATUSTEXT_LENGTH);
    must(strcmp(m.text, "warning: unknown warning") == 0, "as what it is");
    ln.text.id = UINT16_MAX - 1u;
    (void)severity_of(TC_REACHED);
    must(ln.text.id == UINT16_MAX, "the last number");
    (void)severity_of(TC_REACHED);
    must(ln.text.id == 1u, "0 is for texts in one piece");
}

static void time_on_the_path(void) {
    goshawk_mission_status_msg m;
    start_link(false, 0);
    controller.telemetry.state = TC_TRAJECTORY;
    controller.telemetry.path_time_us = 2500000u;
    update(1000);
    goshawk_mission_status_decode(&m, answer(GOSHAWK_MISSION_STATUS_ID), GOSHAWK_MISSION_STATUS_LENGTH);
    must(m.trajectory_time_s == 2.5f, "since the trajectory's start");
}

enum { FIRST = 7, SECOND = 8 }; /* sessions of two stations with the same id */

static void session_lease(uint32_t session, uint8_t action) {
    SEND(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = action, .session = session,
         .name = "desk");
}

static uint8_t session_order(uint32_t session, uint32_t request, uint8_t command) {
    goshawk_mission_result_msg m;
    SEND(PILOT, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = request, .command = command,
         .session = session);
    goshawk_mission_result_decode(&m, answer(GOSHAWK_MISSION_RESULT_ID), GOSHAWK_MISSION_RESULT_LENGTH);
    return m.reason;
}

static goshawk_lease_status_msg lease_status(void) {
    goshawk_lease_status_msg m;
    goshawk_lease_status_decode(&m, answer(GOSHAWK_LEASE_STATUS_ID), GOSHAWK_LEASE_STATUS_LENGTH);
    return m;
}

/* Two stations with the same ids: the operator is the session. Nothing of the other's counts, neither an order nor a
   heartbeat, until it takes over; then nothing of the first one's does. */
static void two_sessions(void) {
    start_link(false, 4);
    session_lease(FIRST, 1);
    must(lease_status().operator_session == (uint32_t)FIRST, "the first has control");
    session_lease(SECOND, 1);
    session_lease(SECOND, 0);
    const goshawk_lease_status_msg refused = lease_status();
    must(refused.operator_session == (uint32_t)FIRST && strcmp(refused.operator_name, "desk") == 0, "and is named");
    must(session_order(SECOND, 1, GOSHAWK_COMMAND_LOG_STOP) == TC_LINK_NOT_IN_CONTROL, "no order of the second");
    must(session_order(0, 2, GOSHAWK_COMMAND_LOG_STOP) == TC_LINK_NOT_IN_CONTROL, "nor one without a session");
    must(stage_parameters(PILOT, 5) == 255u, "nor parameters");
    must(session_order(FIRST, 3, GOSHAWK_COMMAND_LOG_STOP) == TC_OK, "orders of the first");
    const uint64_t heard_us = ln.lease.heard_us;
    clock_us += 1000u;
    SEND(PILOT, HEARTBEAT, heartbeat, .type = 6);
    session_lease(SECOND, 1);
    must(ln.lease.heard_us == heard_us, "the second does not keep the link of the first alive");
    SEND(PILOT, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = 9, .trajectory_id = 1,
         .segments = 2, .coefficient_count = 8, .session = FIRST);
    must(ln.upload.transfer_id == 9u, "the first uploads");
    session_lease(SECOND, 2);
    must(lease_status().operator_session == (uint32_t)SECOND, "taken over");
    must(session_order(FIRST, 4, GOSHAWK_COMMAND_LOG_STOP) == TC_LINK_NOT_IN_CONTROL, "the first has lost it");
    SEND(PILOT, GOSHAWK_TRAJECTORY_SEGMENT, goshawk_trajectory_segment, TO_VEHICLE, .transfer_id = 9,
         .duration_us = 1000000);
    SEND(PILOT, GOSHAWK_TRAJECTORY_COMMIT, goshawk_trajectory_commit, TO_VEHICLE, .transfer_id = 9, .trajectory_id = 1,
         .session = FIRST);
    must(ln.upload.frames == 0u && ln.commit.transfer_id == 0u, "and its upload goes no further");
    session_lease(FIRST, 2);
    SEND(PILOT, GOSHAWK_TRAJECTORY_SEGMENT, goshawk_trajectory_segment, TO_VEHICLE, .transfer_id = 9,
         .duration_us = 1000000);
    must(ln.upload.frames == 1u, "until it takes control back");
    session_lease(FIRST, 0);
    lease(PILOT, 1);
    must(session_order(FIRST, 5, GOSHAWK_COMMAND_LOG_STOP) == TC_LINK_NOT_IN_CONTROL, "a standard station has none");
}

/* A lease that has run out is not told of as one, even where no update has taken it back yet. */
static void lease_that_has_run_out(void) {
    goshawk_lease_status_msg m;
    start_link(false, 0);
    lease(PILOT, 1);
    ln.lease.until_us = ln.clock_us;
    goshawk_lease_status_decode(&m, answer(GOSHAWK_LEASE_STATUS_ID), GOSHAWK_LEASE_STATUS_LENGTH);
    must(m.left_ms == 0u, "nothing is left");
}

static void take_offs_in_frames(void) {
    static const struct {
        uint8_t frame;
        uint8_t result; /* 3: not supported */
    } frames[] = {{0, 0}, {3, 0}, {5, 0}, {6, 0}, {1, 3}, {8, 3}};
    for (unsigned i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        uint64_t now;
        command_ack_msg ack;
        start_link(false, 0);
        set_out(&controller, &now, 0, TC_ARMED);
        lease(PILOT, 1);
        SEND(PILOT, COMMAND_INT, command_int, TO_VEHICLE, .command = 22, .frame = frames[i].frame, .z = 1.0f);
        command_ack_decode(&ack, answer(COMMAND_ACK_ID), COMMAND_ACK_LENGTH);
        must(ack.result == frames[i].result, "heights of the global frames, and of no other");
    }
}

/* The controller has forgotten the upload since the commit began: new limits of the path make it. */
static void upload_that_is_gone(void) {
    start_link(false, 0);
    lease(PILOT, 1);
    ln.upload.transfer_id = ln.commit.transfer_id = 9u;
    ln.upload.checking = true;
    must(tc_store_staged(&controller.store) == NULL, "nothing is staged");
    update(1);
    const uint8_t* result = answer(GOSHAWK_TRAJECTORY_RESULT_ID);
    must(result != NULL && result[GOSHAWK_TRAJECTORY_RESULT_REASON_AT] == TC_NO_UPLOAD, "answered, with the reason");
}

/* A frame of a stream that is not open is not noted. */
static void stream_that_is_not_open(void) {
    static const uint8_t key[TC_KEY_BYTES] = {7};
    tc_signing sender, receiver;
    tc_signing_init(&sender, key, 5000);
    tc_signing_init(&receiver, key, 1000);
    uint8_t bytes[TC_FRAME_MAX] = {0};
    const uint8_t* at = bytes;
    size_t n = tc_frame_build(bytes, HEARTBEAT_ROW, HEARTBEAT_LENGTH, 0, 9, 1, &sender, 0);
    tc_frame frame;
    tc_frame_faults faults = {0};
    must(tc_frame_next(&at, &n, &frame, &faults), "a frame");
    tc_signing_accept(&receiver, &frame);
    must(receiver.accepted == 0u && receiver.now_10us == 1000u, "nothing of it");
}

/* Geometry may change on the ground only, mass in the air by a fifth, whoever asks. */
static void vehicle_changed_in_the_air(void) {
    uint64_t now;
    set_out(&controller, &now, 0, TC_ARMED);
    tc_parameters p = *tc_parameters_now(&controller);
    p.rotor_x_m[0] += 0.01f;
    must(tc_parameters_set(&controller, &p) == TC_ONLY_WHEN_DISARMED, "armed");
    p.rotor_x_m[0] -= 0.02f;
    must(tc_parameters_set(&controller, &p) == TC_ONLY_WHEN_DISARMED, "smaller, too");
    set_out(&controller, &now, 0, TC_HOLD);
    p = *tc_parameters_now(&controller);
    p.mass_kg *= 1.21f;
    must(tc_parameters_set(&controller, &p) == TC_CHANGE_TOO_LARGE, "nor more mass in the air");
    p.mass_kg *= 0.79f / 1.21f;
    must(tc_parameters_set(&controller, &p) == TC_CHANGE_TOO_LARGE, "nor less");
    p.mass_kg *= 0.81f / 0.79f;
    must(tc_parameters_set(&controller, &p) == TC_OK, "but for a fifth");
}

void link_corner_cases(void) {
    orders_in_shadow();
    graveness_of_reasons();
    warnings_without_a_name();
    time_on_the_path();
    lease_that_has_run_out();
    two_sessions();
    take_offs_in_frames();
    upload_that_is_gone();
    stream_that_is_not_open();
    vehicle_changed_in_the_air();
}
