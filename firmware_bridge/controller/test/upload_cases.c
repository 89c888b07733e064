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
    SAY(system, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = transfer,
        .trajectory_id = plan.header.id, .crc32 = plan.header.crc32, .segments = segments, .coefficient_count = 8,
        .samples = samples);
}

static void segment(uint8_t system, uint32_t transfer, uint16_t index, float spoil) {
    goshawk_trajectory_segment_msg m = {TO_VEHICLE, .transfer_id = transfer, .index = index, .duration_us = 1500000u};
    uint8_t payload[TC_PAYLOAD_MAX];
    for (unsigned k = 0; k < 8u; k++) m.coefficients[TC_AXES * k + 2u] = plan.segment[index % 2u].coefficient[2][k];
    m.coefficients[0] += spoil;
    goshawk_trajectory_segment_encode(&m, payload);
    say(system, 190, GOSHAWK_TRAJECTORY_SEGMENT_ROW, payload, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH);
}

/* All of them at the start, which is at 1 m. */
static void samples(uint32_t transfer, float z) {
    SAY(PILOT, GOSHAWK_TRAJECTORY_SAMPLES, goshawk_trajectory_samples, TO_VEHICLE, .transfer_id = transfer,
        .values = {[2] = z, [6] = z, [10] = z, [14] = z, [18] = z, [22] = z, [26] = z, [30] = z});
}

static uint8_t commit(uint8_t system, uint32_t transfer, uint32_t id, uint32_t crc32) {
    SAY(system, GOSHAWK_TRAJECTORY_COMMIT, goshawk_trajectory_commit, TO_VEHICLE, .transfer_id = transfer,
        .trajectory_id = id, .crc32 = crc32);
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
    begin_anew(false, 4);
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
    begin_anew(false, 4);
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
    begin_anew(false, 4);
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
    begin(PILOT, 4, 2, 0);
    (void)upload_status(&received);
    segment(PILOT, 4, 0, 5000.0f);
    must(upload_status(&received) == TC_PATH_LEAVES_FENCE, "a refusal");
    begin(PILOT, 5, 2, 3);
    (void)upload_status(&received);
    samples(5, NAN);
    must(upload_status(&received) == TC_NOT_FINITE, "a refusal, and the other samples are not looked at");
}

static void reading(void) {
    begin_anew(false, 4);
    SAY(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 1);
    must(answer(GOSHAWK_TRAJECTORY_BEGIN_ID) != NULL, "a header, with nothing in it");
    SAY(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 1, .wanted = {255});
    must(answer(GOSHAWK_TRAJECTORY_SEGMENT_ID) == NULL, "there is none");
    lease(PILOT, 1);
    activate();
    SAY(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 2);
    must(answer(GOSHAWK_TRAJECTORY_BEGIN_ID)[GOSHAWK_TRAJECTORY_BEGIN_SEGMENTS_AT] == 2u, "two segments");
    for (uint16_t first = 0; first < 4u; first++) {
        SAY(OTHER, GOSHAWK_TRAJECTORY_READ, goshawk_trajectory_read, TO_VEHICLE, .transfer_id = 2, .first = first,
            .wanted = {253});
        must((answer(GOSHAWK_TRAJECTORY_SEGMENT_ID) != NULL) == (first < 2u), "only what there is");
    }
}

static void restoring(void) {
    static const tc_origin origin = {{1}, {2}, "kept"};
    begin_anew(false, 4);
    plan.origin = origin;
    must(tc_link_restore(&ln, &plan) == TC_OK, "whole");
    must(memcmp(&tc_store_active(&controller.store)->origin, &origin, sizeof origin) == 0, "with its origin");
    plan.origin.name[0] = 'l';
    must(tc_link_restore(&ln, &plan) == TC_OK, "once more");
    must(tc_store_active(&controller.store)->origin.name[0] == 'l', "under a new name");
    must(tc_upload_activate(&controller, plan.header.id, plan.header.crc32) == TC_OK, "a repeat");
    begin_anew(false, 4);
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

/* Parameters and an upload share the staged slot: the one that is under way keeps it. */
static void one_memory_for_two(void) {
    uint8_t received;
    begin_anew(false, 4);
    lease(PILOT, 1);
    const uint32_t before = tc_parameters_crc32(tc_parameters_now(&controller));
    begin(PILOT, 1, 2, 0);
    (void)upload_status(&received);
    segment(PILOT, 1, 0, 0.0f);
    must(stage_parameters(1, 0) == TC_UPLOAD_OPEN && stage_parameters(1, 1) == TC_UPLOAD_OPEN, "refused in words");
    must(commit_parameters(1, before) == TC_UPLOAD_OPEN, "and stays refused");
    segment(PILOT, 1, 1, 0.0f);
    must(commit(PILOT, 1, plan.header.id, plan.header.crc32) == TC_OK, "and the upload did not feel it");
    must(stage_parameters(2, 0) == TC_OK && stage_parameters(2, 1) == TC_OK, "afterwards there is room");
    begin(PILOT, 3, 2, 0);
    (void)upload_status(&received);
    must(stage_parameters(2, 1) == TC_UPLOAD_OPEN, "an upload that begins takes it back");
    must(commit_parameters(2, before) == TC_UPLOAD_OPEN, "and nothing is set");
    clock_us += 600000u; /* the upload has fallen silent */
    must(stage_parameters(4, 0) == TC_OK && stage_parameters(4, 1) == TC_OK, "it gives way");
    begin(PILOT, 5, 2, 0);
    must(commit_parameters(4, before) == TC_UPLOAD_OPEN, "taken back between the last piece and the commit");
    segment(PILOT, 5, 0, 5000.0f);
    must(upload_status(&received) == TC_PATH_LEAVES_FENCE, "a refused upload");
    must(stage_parameters(6, 0) == TC_OK && stage_parameters(6, 1) == TC_OK, "gives way at once");
    segment(PILOT, 5, 1, 0.0f);
    must(upload_status(&received) == TC_OK && received == 0u, "and is told that none is open");
    must(commit_parameters(6, before) == TC_OK, "set");
    must(tc_parameters_crc32(tc_parameters_now(&controller)) == before, "to what they were");
    must(tc_store_is_active(&controller.store, plan.header.id, plan.header.crc32), "the plan is active still");
    must(tc_trajectory_crc32(tc_store_active(&controller.store)) == plan.header.crc32, "and whole");
    must(tc_upload_begin(&controller, &plan.header) == TC_OK, "an upload that does not come over the link");
    must(stage_parameters(7, 0) == TC_UPLOAD_OPEN, "keeps its memory");
    must(tc_upload_segment(&controller, 0, &plan.segment[0]) == TC_OK, "and its pieces");
    tc_store_discard(&controller.store);
    must(tc_upload_origin(&controller, &plan.origin) == TC_NO_UPLOAD, "no upload, no origin");
    begin(PILOT, 8, 2, 0);
    tc_store_discard(&controller.store); /* behind the link's back */
    segment(PILOT, 8, 0, 0.0f);
    must(upload_status(&received) == TC_NO_UPLOAD, "it is told");
    must(commit(PILOT, 8, plan.header.id, plan.header.crc32) == TC_NO_UPLOAD, "and nothing is committed");
}

void upload_cases(void) {
    uploads_refused();
    uploads_accepted();
    reports();
    reading();
    restoring();
    one_memory_for_two();
}
