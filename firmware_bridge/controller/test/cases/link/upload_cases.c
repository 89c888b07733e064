/* Uploads, reading and restoring: every refusal, and what is reported when. */
#include <math.h>
#include <string.h>

#include "link_cases.h"

static uint8_t upload_status(uint8_t* received) {
    const uint8_t* status = answer(GOSHAWK_TRAJECTORY_STATUS_ID);
    must(status != NULL, "the upload is reported");
    *received = status[GOSHAWK_TRAJECTORY_STATUS_RECEIVED_AT];
    return status[GOSHAWK_TRAJECTORY_STATUS_REASON_AT];
}

static void begin(uint8_t system, uint32_t transfer, uint16_t segments, uint8_t samples) {
    SEND(system, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = transfer,
         .trajectory_id = plan.header.id, .crc32 = plan.header.crc32, .segments = segments, .coefficient_count = 8,
         .samples = samples);
}

static void segment(uint8_t system, uint32_t transfer, uint16_t index, float spoil) {
    goshawk_trajectory_segment_msg m = {TO_VEHICLE, .transfer_id = transfer, .index = index, .duration_us = 1500000u};
    uint8_t payload[TC_PAYLOAD_MAX];
    for (unsigned k = 0; k < 8u; k++) m.coefficients[TC_AXES * k + 2u] = plan.segment[index % 2u].coefficient[2][k];
    m.coefficients[0] += spoil;
    goshawk_trajectory_segment_encode(&m, payload);
    deliver(system, 190, GOSHAWK_TRAJECTORY_SEGMENT_ROW, payload, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH);
}

/* All of them at the start, which is at 1 m. */
static void samples(uint32_t transfer, float z) {
    SEND(PILOT, GOSHAWK_TRAJECTORY_SAMPLES, goshawk_trajectory_samples, TO_VEHICLE, .transfer_id = transfer,
         .values = {[2] = z, [6] = z, [10] = z, [14] = z, [18] = z, [22] = z, [26] = z, [30] = z});
}

static uint8_t commit(uint8_t system, uint32_t transfer, uint32_t id, uint32_t crc32) {
    SEND(system, GOSHAWK_TRAJECTORY_COMMIT, goshawk_trajectory_commit, TO_VEHICLE, .transfer_id = transfer,
         .trajectory_id = id, .crc32 = crc32);
    update(4);
    const uint8_t* result = answer(GOSHAWK_TRAJECTORY_RESULT_ID);
    return result == NULL ? 255u : result[GOSHAWK_TRAJECTORY_RESULT_REASON_AT];
}

static void whole(uint32_t transfer) {
    begin(PILOT, transfer, 2, 0);
    segment(PILOT, transfer, 0, 0.0f);
    segment(PILOT, transfer, 1, 0.0f);
}

void activate(void) {
    whole(90);
    must(commit(PILOT, 90, plan.header.id, plan.header.crc32) == TC_OK, "activated");
}

static void uploads_refused(void) {
    uint8_t received;
    start_link(false, 4);
    begin(PILOT, 0, 2, 0);
    must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "without a number there is no answer");
    begin(PILOT, 1, 2, 0);
    must(upload_status(&received) == TC_LINK_NOT_IN_CONTROL, "not in control");
    segment(PILOT, 1, 0, 0.0f);
    must(commit(PILOT, 1, 5, 5) == 255u, "and not answered");
    lease(PILOT, 1);
    begin(PILOT, 2, 0, 0);
    must(upload_status(&received) == TC_SEGMENT_COUNT, "no segments");
    segment(PILOT, 3, 0, 0.0f);
    must(upload_status(&received) == TC_OK && received == 0u, "an unknown transfer: none is open");
    segment(PILOT, 0, 0, 0.0f);
    must(commit(PILOT, 0, 5, 5) == 255u, "nor without a number");
    must(commit(PILOT, 3, 5, 5) == TC_NO_UPLOAD, "nothing to commit");
    whole(4);
    must(commit(PILOT, 44, 5, 5) == TC_NO_UPLOAD, "another one is open");
    must(commit(PILOT, 4, 6, plan.header.crc32) == TC_WRONG_ID, "another id");
    whole(5);
    must(commit(PILOT, 5, 5, 6) == TC_WRONG_ID, "another CRC");
    whole(6);
    segment(PILOT, 6, 2, 0.0f);
    must(upload_status(&received) == TC_SEGMENT_INDEX, "beyond the end");
    segment(PILOT, 6, 1, 0.0f); /* what comes later changes nothing */
    samples(6, 1.0f);
    must(commit(PILOT, 6, 5, plan.header.crc32) == TC_SEGMENT_INDEX, "stays refused");
    begin(PILOT, 7, 2, 0);
    segment(PILOT, 7, 0, 5000.0f);
    must(upload_status(&received) == TC_PATH_LEAVES_FENCE, "out of the fence");
    begin(PILOT, 8, 2, 0);
    segment(PILOT, 8, 0, 0.0f);
    tc_store_discard(&controller.store); /* as new limits do */
    segment(PILOT, 8, 1, 0.0f);
    must(upload_status(&received) == TC_NO_UPLOAD, "discarded under way");
    begin(PILOT, 9, 2, 0);
    segment(PILOT, 9, 1, 0.0f);
    must(commit(PILOT, 9, 5, plan.header.crc32) == TC_SEGMENTS_MISSING, "not all there");
    begin(PILOT, 10, 2, 1);
    samples(10, NAN);
    must(upload_status(&received) == TC_NOT_FINITE, "samples that are no numbers");
    begin(PILOT, 11, 2, 1);
    segment(PILOT, 11, 0, 0.0f);
    segment(PILOT, 11, 1, 0.0f);
    must(commit(PILOT, 11, 5, plan.header.crc32) == TC_LINK_SAMPLES_MISSING, "samples missing");
    must(tc_store_active(&controller.store) == NULL, "and none of these took effect");
}

static void uploads_accepted(void) {
    uint8_t received;
    start_link(false, 4);
    lease(PILOT, 1);
    begin(PILOT, 1, 2, 200);
    begin(PILOT, 1, 2, 200);
    samples(1, 1.0f);
    samples(1, 1.0f);
    segment(PILOT, 1, 0, 0.0f);
    segment(PILOT, 1, 0, 0.0f);
    must(upload_status(&received) == TC_OK && received == 1u, "a repeat counts once");
    segment(PILOT, 1, 1, 0.0f);
    must(commit(PILOT, 1, 5, plan.header.crc32) == TC_OK, "accepted");
    must(commit(PILOT, 1, 5, plan.header.crc32) == TC_OK, "repeated: the same answer");
    segment(PILOT, 1, 1, 0.0f);
    must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "a late copy is no news");
    whole(2);
    must(commit(PILOT, 2, 5, plan.header.crc32) == TC_OK, "the same plan again");
    begin(PILOT, 3, 2, 1);
    segment(PILOT, 3, 0, 0.0f);
    segment(PILOT, 3, 1, 0.0f);
    samples(3, 1.0f);
    must(upload_status(&received) == TC_OK, "samples complete it");
    for (uint32_t i = 0; i < 20u; i++) segment(PILOT, 3, 1, 0.0f); /* more than one report's worth */
}

/* Nothing is reported unasked but what is late, every eighth piece, a refusal, and the last piece. */
static void reports(void) {
    uint8_t received;
    start_link(false, 4);
    lease(PILOT, 1);
    begin(PILOT, 1, 2, 1);
    (void)upload_status(&received);
    segment(PILOT, 1, 0, 0.0f);
    segment(PILOT, 1, 1, 0.0f);
    must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "nothing to report, the samples are missing");
    clock_us += 3000u;
    segment(PILOT, 1, 1, 0.0f);
    must(upload_status(&received) == TC_OK && received == 2u, "a while after the last report");
    samples(1, 1.0f);
    must(upload_status(&received) == TC_OK && received == 2u, "the last piece");
    begin(PILOT, 2, 2, 1);
    (void)upload_status(&received);
    samples(2, 1.0f);
    must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "samples, but no segments");
    begin(PILOT, 3, 2, 0);
    (void)upload_status(&received);
    segment(PILOT, 3, 0, 0.0f);
    segment(PILOT, 3, 1, 0.0f);
    must(upload_status(&received) == TC_OK && received == 2u, "the last piece, no samples wanted");
    begin(PILOT, 3, 2, 0);
    (void)upload_status(&received);
    for (unsigned i = 0; i < 4u; i++) segment(PILOT, 3, 0, 0.0f);
    must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "no news");
    for (unsigned i = 0; i < 4u; i++) segment(PILOT, 3, 0, 0.0f);
    must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) != NULL, "every eighth frame");
    begin(PILOT, 4, 2, 0);
    (void)upload_status(&received);
    segment(OTHER, 4, 0, 0.0f);
    samples(4, 1.0f);
    begin(PILOT, 4, 2, 0);
    must(upload_status(&received) == TC_OK && received == 0u, "of another station nothing is taken");
    segment(PILOT, 4, 0, 5000.0f);
    must(upload_status(&received) == TC_PATH_LEAVES_FENCE, "a refusal");
    begin(PILOT, 5, 2, 3);
    (void)upload_status(&received);
    samples(5, NAN);
    must(upload_status(&received) == TC_NOT_FINITE, "a refusal, and the other samples are not looked at");
}

static void reading(void) {
    start_link(false, 4);
    SEND(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 1);
    must(answer(GOSHAWK_TRAJECTORY_BEGIN_ID) != NULL, "a header, with nothing in it");
    SEND(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 1, .wanted = {255});
    must(answer(GOSHAWK_TRAJECTORY_SEGMENT_ID) == NULL, "there is none");
    lease(PILOT, 1);
    activate();
    SEND(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 2);
    must(answer(GOSHAWK_TRAJECTORY_BEGIN_ID)[GOSHAWK_TRAJECTORY_BEGIN_SEGMENTS_AT] == 2u, "two segments");
    for (uint16_t first = 0; first < 4u; first++) {
        SEND(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 2, .first = first,
             .wanted = {253});
        must((answer(GOSHAWK_TRAJECTORY_SEGMENT_ID) != NULL) == (first < 2u), "only what there is");
    }
}

static void restoring(void) {
    static const tc_origin origin = {{1}, {2}, "kept"};
    start_link(false, 4);
    plan.origin = origin;
    must(tc_link_restore(&ln, &plan) == TC_OK, "whole");
    must(memcmp(&tc_store_active(&controller.store)->origin, &origin, sizeof origin) == 0, "with its origin");
    plan.origin.name[0] = 'l';
    must(tc_link_restore(&ln, &plan) == TC_OK, "once more");
    must(tc_store_active(&controller.store)->origin.name[0] == 'l', "under a new name");
    must(tc_upload_activate(&controller, plan.header.id, plan.header.crc32) == TC_OK, "a repeat");
    start_link(false, 4);
    plan.header.segment_count = 0;
    must(tc_link_restore(&ln, &plan) == TC_SEGMENT_COUNT, "empty");
    short_plan(&plan, 0);
    plan.segment[1].duration_us = 1;
    must(tc_link_restore(&ln, &plan) == TC_SEGMENT_DURATION, "a damaged segment");
    short_plan(&plan, 0);
    plan.header.crc32 ^= 1u;
    must(tc_link_restore(&ln, &plan) == TC_CRC_MISMATCH, "a damaged header");
    uint64_t now;
    set_out(&controller, &now, 0, TC_TRAJECTORY);
    short_plan(&plan, 1);
    plan.origin = origin;
    must(tc_link_restore(&ln, &plan) == TC_SLOT_IN_USE, "not in flight");
    must(tc_store_active(&controller.store)->origin.name[0] == '\0', "and none took effect");
}

/* Standing at 1 m in as many segments as the store holds. */
static void long_plan(void) {
    memset(&plan, 0, sizeof plan);
    plan.header.id = 9;
    plan.header.segment_count = TC_MAX_SEGMENTS;
    plan.header.coefficient_count = 8;
    plan.header.clearance_m = 0.25f;
    for (unsigned i = 0; i < TC_MAX_SEGMENTS; i++) {
        plan.segment[i].duration_us = 1500000;
        plan.segment[i].coefficient[2][0] = 1.0f;
    }
    plan.header.crc32 = tc_trajectory_crc32(&plan);
}

/* All but the segments from `end` on. */
static void send_long_plan(uint32_t transfer, uint16_t end) {
    SEND(PILOT, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = transfer,
         .trajectory_id = plan.header.id, .crc32 = plan.header.crc32, .segments = TC_MAX_SEGMENTS,
         .coefficient_count = 8, .clearance_m = plan.header.clearance_m);
    for (uint16_t i = 0; i < end; i++) segment(PILOT, transfer, i, 0.0f);
}

static void send_commit(uint32_t transfer) {
    SEND(PILOT, GOSHAWK_TRAJECTORY_COMMIT, goshawk_trajectory_commit, TO_VEHICLE, .transfer_id = transfer,
         .trajectory_id = plan.header.id, .crc32 = plan.header.crc32);
}

/* A commit goes on by a slice an update, whatever else arrives, and is answered once it is done. */
static void commits_in_slices(void) {
    uint8_t received;
    start_link(false, 4);
    lease(PILOT, 1);
    long_plan();
    send_long_plan(1, TC_MAX_SEGMENTS);
    must(upload_status(&received) == TC_OK && received == TC_MAX_SEGMENTS, "all there");
    must(controller.store.check.next == 0u, "nothing is checked while it is received");
    send_commit(1);
    for (unsigned done = TC_SEGMENTS_PER_CALL; done <= TC_MAX_SEGMENTS; done += TC_SEGMENTS_PER_CALL) {
        must(answer(GOSHAWK_TRAJECTORY_RESULT_ID) == NULL, "not answered yet");
        update(1);
        must(controller.store.check.next == done, "a slice an update");
        if (done == 8u) send_commit(1);
        if (done == 12u) segment(PILOT, 1, 0, 5000.0f);
    }
    update(1);
    const uint8_t* result = answer(GOSHAWK_TRAJECTORY_RESULT_ID);
    must(result != NULL && result[GOSHAWK_TRAJECTORY_RESULT_REASON_AT] == TC_OK, "answered when it is done");
    must(tc_store_active(&controller.store)->header.clearance_m == 0.25f, "with its clearance");
    link_config.commit_slices = 64;
    send_long_plan(2, TC_MAX_SEGMENTS);
    send_commit(2);
    update(1);
    must(answer(GOSHAWK_TRAJECTORY_RESULT_ID) != NULL, "many slices at once where they are asked for");
    link_config.commit_slices = 0;
    send_long_plan(3, TC_MAX_SEGMENTS - 1u);
    update(TC_MAX_SEGMENTS / TC_SEGMENTS_PER_CALL + 1u);
    must(controller.store.check.next == TC_MAX_SEGMENTS - 1u, "what has arrived is checked ahead");
    segment(PILOT, 3, TC_MAX_SEGMENTS - 1u, 0.0f);
    send_commit(3);
    update(2);
    must(answer(GOSHAWK_TRAJECTORY_RESULT_ID) != NULL, "so that little is left");
    plan.header.crc32 ^= 1u;
    plan.segment[1].coefficient[2][0] = 7.0f;
    send_long_plan(4, TC_MAX_SEGMENTS);
    send_commit(4);
    update(TC_MAX_SEGMENTS);
    must(answer(GOSHAWK_TRAJECTORY_RESULT_ID)[GOSHAWK_TRAJECTORY_RESULT_REASON_AT] == TC_CRC_MISMATCH,
         "damage is named before the jump that it leads to");
    long_plan();
    send_long_plan(5, TC_MAX_SEGMENTS);
    send_commit(5);
    update(2);
    begin(PILOT, 6, 2, 0);
    update(TC_MAX_SEGMENTS);
    must(answer(GOSHAWK_TRAJECTORY_RESULT_ID) == NULL, "an upload that begins ends the check");
    must(tc_store_is_active(&controller.store, 9, plan.header.crc32), "what was active stays so");
}

/* The short plan, with one number changed before its CRC is computed. */
static uint8_t flawed(uint32_t transfer, unsigned segment_index, float change, unsigned power, float z_sample) {
    goshawk_trajectory_segment_msg m;
    uint8_t payload[TC_PAYLOAD_MAX];
    short_plan(&plan, 0);
    plan.segment[segment_index].coefficient[2][power] += change;
    plan.header.crc32 = tc_trajectory_crc32(&plan);
    begin(PILOT, transfer, 2, 1);
    for (uint16_t i = 0; i < 2u; i++) {
        memset(&m, 0, sizeof m);
        m.target_system = m.target_component = ME;
        m.transfer_id = transfer;
        m.index = i;
        m.duration_us = plan.segment[i].duration_us;
        for (unsigned k = 0; k < 8u; k++) m.coefficients[TC_AXES * k + 2u] = plan.segment[i].coefficient[2][k];
        goshawk_trajectory_segment_encode(&m, payload);
        deliver(PILOT, 190, GOSHAWK_TRAJECTORY_SEGMENT_ROW, payload, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH);
    }
    samples(transfer, z_sample);
    return commit(PILOT, transfer, plan.header.id, plan.header.crc32);
}

/* What only the whole trajectory shows, with the right CRC. */
static void flawed_plans(void) {
    start_link(false, 4);
    lease(PILOT, 1);
    must(flawed(1, 1, 0.0f, 0, 1.0f) == TC_OK, "none");
    must(flawed(2, 1, 0.1f, 0, 1.0f) == TC_JUMP_AT_JOIN && ln.commit.segment == 1u, "a jump");
    must(flawed(3, 0, 0.1f, 0, 1.0f) == TC_JUMP_AT_JOIN, "from the other side");
    must(flawed(4, 1, 0.0f, 0, 1.1f) == TC_SAMPLE_MISMATCH, "another curve than the planner's");
    must(flawed(5, 0, 0.1f, 2, 1.0f) != TC_OK, "an acceleration");
    short_plan(&plan, 0);
    plan.header.segment_count = 1;
    plan.segment[0].coefficient[2][1] += 0.2f;
    plan.header.crc32 = tc_trajectory_crc32(&plan);
    must(tc_upload_begin(&controller, &plan.header) == TC_OK, "one segment");
    must(tc_upload_segment(&controller, 0, &plan.segment[0]) == TC_OK, "of it all");
    must(tc_upload_finish(&controller) == TC_BUSY && tc_upload_finish(&controller) == TC_NOT_AT_REST, "not at rest");
}

/* While another trajectory is flown a commit is refused before any of it is looked at. */
static void commit_in_flight(void) {
    uint64_t now;
    start_link(false, 4);
    set_out(&controller, &now, 0, TC_TRAJECTORY);
    lease(PILOT, 1);
    long_plan();
    send_long_plan(1, TC_MAX_SEGMENTS);
    send_commit(1);
    const uint8_t* result = answer(GOSHAWK_TRAJECTORY_RESULT_ID);
    must(result != NULL && result[GOSHAWK_TRAJECTORY_RESULT_REASON_AT] == TC_SLOT_IN_USE, "refused at once");
    must(controller.store.check.next == 0u, "without a check");
}

/* What the store does beside the link: a segment that is sent again with other numbers is checked again. */
static void changed_segments(void) {
    start_link(false, 4);
    tc_segment other;
    must(tc_upload_begin(&controller, &plan.header) == TC_OK, "begun");
    must(tc_upload_finish(&controller) == TC_SEGMENTS_MISSING, "nothing is there");
    other = plan.segment[0];
    other.coefficient[0][0] = 0.5f;
    must(tc_upload_segment(&controller, 0, &other) == TC_OK, "another beginning");
    must(tc_upload_segment(&controller, 1, &plan.segment[1]) == TC_OK, "the rest");
    must(tc_upload_finish(&controller) == TC_BUSY && tc_upload_finish(&controller) == TC_CRC_MISMATCH, "not the plan");
    must(tc_upload_segment(&controller, 0, &plan.segment[0]) == TC_OK, "now the right one");
    must(tc_upload_finish(&controller) == TC_BUSY && tc_upload_finish(&controller) == TC_OK, "and it is");
    tc_trajectory_header header = plan.header;
    static const float wrong[] = {-0.1f, 101.0f, NAN, INFINITY};
    for (unsigned i = 0; i < 4u; i++) {
        header.clearance_m = wrong[i];
        const tc_reason reason = tc_upload_begin(&controller, &header);
        must(reason == (i < 2u ? TC_OUT_OF_RANGE : TC_NOT_FINITE), "no clearance");
    }
    const uint32_t before = tc_trajectory_crc32(&plan);
    plan.header.clearance_m = 0.3f;
    must(tc_trajectory_crc32(&plan) != before, "the CRC covers the clearance");
}

/* Parameters and an upload at the same time: neither feels the other. */
static void parameters_beside_upload(void) {
    uint8_t received;
    start_link(false, 4);
    lease(PILOT, 1);
    const uint32_t before = tc_parameters_crc32(tc_parameters_now(&controller));
    begin(PILOT, 1, 2, 0);
    segment(PILOT, 1, 0, 0.0f);
    must(stage_parameters(PILOT, 1) == TC_OK, "staged beside an open upload");
    segment(PILOT, 1, 1, 0.0f);
    must(commit_parameters(PILOT, 1, before) == TC_OK, "and set");
    must(commit(PILOT, 1, plan.header.id, plan.header.crc32) == TC_OK, "and the upload did not feel it");
    must(stage_parameters(PILOT, 2) == TC_OK, "staged");
    begin(PILOT, 3, 2, 0);
    (void)upload_status(&received);
    must(commit_parameters(PILOT, 2, before) == TC_OK, "an upload that begins takes nothing away");
    must(tc_store_is_active(&controller.store, plan.header.id, plan.header.crc32), "the plan is active still");
    must(tc_trajectory_crc32(tc_store_active(&controller.store)) == plan.header.crc32, "and whole");
    tc_store_discard(&controller.store);
    must(tc_upload_origin(&controller, &plan.origin) == TC_NO_UPLOAD, "no upload, no origin");
    begin(PILOT, 8, 2, 0);
    tc_store_discard(&controller.store); /* behind the link's back */
    segment(PILOT, 8, 0, 0.0f);
    must(upload_status(&received) == TC_NO_UPLOAD, "it is reported");
    must(commit(PILOT, 8, plan.header.id, plan.header.crc32) == TC_NO_UPLOAD, "and nothing is committed");
}

void upload_cases(void) {
    uploads_refused();
    uploads_accepted();
    reports();
    reading();
    restoring();
    commits_in_slices();
    flawed_plans();
    commit_in_flight();
    changed_segments();
    parameters_beside_upload();
}
