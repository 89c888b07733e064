/* The upload: pieces into the staged slot, reports of what arrived, commit, read-back. */
#include <string.h>

#include "copy.h"
#include "link_parts.h"

#define STATUS_EVERY 8u      /* frames between two reports at the most */
#define STATUS_GAP_US 3000u  /* and at most this long after a frame */
#define GIVES_WAY_US 500000u /* parameters may have the memory of an upload that has been silent for so long */
#define PIECES (8u * TC_LINK_WANTED)

_Static_assert(TC_MAX_SEGMENTS <= 1024, "the report's bitmap holds 1024 segments");

TC_APART const tc_trajectory* link_active(const tc_link* link) { return tc_store_active(&link->controller->store); }

/* What the open transfer is about; NULL when none is open, or when the controller has thrown it away since. */
static const tc_trajectory_header* opened(const tc_link* link) {
    const tc_trajectory* staged = tc_store_staged(&link->controller->store);
    return link->upload.transfer_id != 0u && staged != NULL ? &staged->header : NULL;
}

static uint16_t segments_wanted(const tc_link* link) {
    const tc_trajectory_header* header = opened(link);
    return header != NULL ? header->segment_count : 0u;
}

/* Ends the transfer. Whatever was not activated is given up, and so is its memory. */
static void end_transfer(tc_link* link) {
    if (opened(link) != NULL) {
        tc_store_discard(&link->controller->store);
    }
    link->upload.transfer_id = 0;
    link->upload.received = 0;
    link->upload.reason = 0;
    link->due &= ~DUE(SAY_UPLOAD);
}

void link_give_way(tc_link* link, uint32_t now_us) {
    if (link->upload.reason != 0u || now_us - link->moment_us[LAST_FRAME] >= GIVES_WAY_US) {
        end_transfer(link);
    }
}

/* Opens a transfer. What had been open is given up first. */
static tc_reason begin(tc_link* link, const link_message* message) {
    const link_begin_head* m = &message->head.begin;
    const tc_trajectory_header header = {m->trajectory_id, m->crc32, m->segments, m->coefficient_count,
                                         m->link_loss_policy};
    tc_origin origin;
    end_transfer(link);
    tc_fill(&link->upload, 0, sizeof link->upload);
    const tc_reason reason = tc_upload_begin(link->controller, &header);
    if (reason == TC_OK) {
        tc_frame_read(&message->frame, GOSHAWK_TRAJECTORY_BEGIN_MAP_HASH_AT, &origin, sizeof origin);
        (void)tc_upload_origin(link->controller, &origin);
        link->samples_wanted = m->samples;
        link->upload.transfer_id = m->transfer_id;
    }
    return reason;
}

void link_on_begin(tc_link* link, const link_message* message) {
    const uint32_t transfer_id = message->head.id;
    uint8_t reason = TC_LINK_NOT_IN_CONTROL;
    if (transfer_id == 0u) {
        return;
    }
    if (message->in_control) { /* repeated: what has arrived stays */
        reason = (uint8_t)(transfer_id == link->upload.transfer_id ? TC_OK : begin(link, message));
    }
    if (reason != (uint8_t)TC_OK) {
        link->refused.transfer_id = transfer_id;
        link->refused.reason = reason;
        link->due |= DUE(SAY_REFUSED);
        return;
    }
    link->moment_us[LAST_FRAME] = message->now_us;
    link->due |= DUE(SAY_UPLOAD);
}

/* Whether a piece belongs to the open transfer. One that does not is answered with what is open (0: nothing), so that
   the ground learns of a restart at once. */
static bool belongs(tc_link* link, const link_message* message) {
    const uint32_t transfer_id = message->head.id;
    if (!message->in_control) {
        return false;
    }
    if (transfer_id == link->commit.transfer_id && link->upload.transfer_id == 0u) {
        return false; /* a late copy of a piece of a finished transfer */
    }
    const bool fits = transfer_id != 0u && transfer_id == link->upload.transfer_id;
    if (fits) {
        link->upload.frames++;
        link->moment_us[LAST_FRAME] = message->now_us;
    }
    if (!fits || link->upload.frames % STATUS_EVERY == 0u ||
        message->now_us - link->moment_us[LAST_STATUS] >= STATUS_GAP_US) {
        link->due |= DUE(SAY_UPLOAD);
    }
    return fits && link->upload.reason == 0u;
}

/* A piece was taken or refused. The last one, and a refusal, are reported at once. */
static void report(tc_link* link, tc_reason reason) {
    const bool complete = link->upload.received == segments_wanted(link) &&
                          (link->upload.has_samples != 0u || link->samples_wanted == 0u);
    link->upload.reason = (uint8_t)reason;
    if (reason != TC_OK || complete) {
        link->due |= DUE(SAY_UPLOAD);
    }
}

/* Coefficients travel by power, so that the highest can be left out; they are stored by axis. */
static void take_segment(tc_segment* segment, const link_message* message) {
    unsigned at = GOSHAWK_TRAJECTORY_SEGMENT_COEFFICIENTS_AT;
    segment->duration_us = message->head.segment.duration_us;
    for (unsigned k = 0; k < TC_MAX_COEFFICIENTS; k++) {
        for (unsigned axis = 0; axis < TC_AXES; axis++) {
            tc_frame_read(&message->frame, at, &segment->coefficient[axis][k], 4);
            at += 4u;
        }
    }
}

void link_on_segment(tc_link* link, const link_message* message) {
    const uint16_t index = message->head.segment.index;
    if (!belongs(link, message)) {
        return;
    }
    link->upload.last_index = index;
    if (tc_store_has_segment(&link->controller->store, index)) {
        return;
    }
    tc_segment* place = tc_upload_place(link->controller, index);
    tc_reason reason = opened(link) != NULL && index >= segments_wanted(link) ? TC_SEGMENT_INDEX : TC_NO_UPLOAD;
    if (place != NULL) { /* straight into the staged slot: a copy would cost 200 bytes of stack */
        take_segment(place, message);
        reason = tc_upload_segment(link->controller, index, place);
    }
    link->upload.received = (uint16_t)(link->upload.received + (reason == TC_OK ? 1u : 0u));
    report(link, reason);
}

void link_on_samples(tc_link* link, const link_message* message) {
    if (!belongs(link, message) || link->upload.has_samples != 0u) {
        return;
    }
    tc_reason reason = TC_OK;
    for (unsigned i = 0; i < link->samples_wanted && i < TC_MAX_SAMPLES && reason == TC_OK; i++) {
        tc_trajectory_sample sample;
        tc_frame_read(&message->frame, GOSHAWK_TRAJECTORY_SAMPLES_SAMPLE_US_AT + 4u * i, &sample.time_us, 4);
        tc_frame_read(&message->frame, GOSHAWK_TRAJECTORY_SAMPLES_VALUES_AT + 16u * i, sample.value, 16);
        reason = tc_upload_sample(link->controller, &sample);
    }
    link->upload.has_samples = reason == TC_OK ? 1u : 0u;
    report(link, reason);
}

/* Checks and activates what is staged. */
static tc_reason commit(tc_link* link, const goshawk_trajectory_commit_msg* m) {
    const tc_trajectory_header* header = opened(link);
    if (header == NULL) {
        return TC_NO_UPLOAD;
    }
    if (m->trajectory_id != header->id || m->crc32 != header->crc32) {
        return TC_WRONG_ID;
    }
    if (link->upload.reason != 0u) {
        return (tc_reason)link->upload.reason;
    }
    if (link->samples_wanted > 0u && link->upload.has_samples == 0u) {
        return (tc_reason)TC_LINK_SAMPLES_MISSING;
    }
    const tc_reason reason = tc_upload_finish(link->controller);
    return reason == TC_OK ? tc_upload_activate(link->controller, m->trajectory_id, m->crc32) : reason;
}

void link_on_commit(tc_link* link, const link_message* message) {
    const uint32_t transfer_id = message->head.id;
    if (transfer_id == 0u || !message->in_control) {
        return; /* a station that is not in control has been told so at its beginning */
    }
    if (transfer_id != link->commit.transfer_id) { /* else repeated: the first answer again */
        tc_reason reason = TC_NO_UPLOAD;
        link->commit.transfer_id = transfer_id;
        if (transfer_id == link->upload.transfer_id) {
            reason = commit(link, &message->head.commit);
            end_transfer(link); /* one commit ends it, whatever its answer */
        }
        link->commit.reason = (uint8_t)reason;
        link->commit.segment = link->controller->store.refused_segment;
        if (reason == TC_OK) {
            link->due_us[SERIES_MISSION] = message->now_us; /* tell everybody at once */
        }
    }
    link->commit.active_id = 0;
    link->commit.active_crc32 = 0;
    const tc_trajectory* active = link_active(link);
    if (active != NULL) {
        link->commit.active_id = active->header.id;
        link->commit.active_crc32 = active->header.crc32;
    }
    link->due |= DUE(SAY_COMMIT);
}

/* Notes a request for pieces whose bits begin at `at`, or, when it asks for none, for what tells of the whole. */
static void want(tc_link* link, const tc_frame* frame, unsigned at, unsigned pieces, unsigned whole, uint32_t first) {
    unsigned any = 0;
    for (unsigned i = at; i < frame->raw[TC_FRAME_LENGTH]; i++) {
        any |= frame->raw[TC_FRAME_HEADER + i];
    }
    if (any == 0u) {
        link->due |= DUE(whole);
        return;
    }
    tc_frame_read(frame, at, link->wanted, sizeof link->wanted);
    link->wanted_first = first;
    link->wanted_next = 0;
    link->due &= ~(DUE(SAY_SEGMENT) | DUE(SAY_RECORD)); /* one request at a time, the newest */
    link->due |= DUE(pieces);
}

uint32_t link_take(tc_link* link, uint32_t count) {
    while (link->wanted_next < PIECES) {
        const uint32_t i = link->wanted_next;
        const bool asked = (((unsigned)link->wanted[i / 8u] >> (i % 8u)) & 1u) != 0u;
        link->wanted_next++;
        if (asked && link->wanted_first < count && i < count - link->wanted_first) {
            return link->wanted_first + i;
        }
    }
    return count;
}

void link_on_read(tc_link* link, const link_message* message) {
    const uint32_t first = message->head.read.first;
    link->read_transfer_id = message->head.id;
    want(link, &message->frame, GOSHAWK_TRAJECTORY_READ_WANTED_AT, SAY_SEGMENT, SAY_HEADER, first);
}

void link_on_log_request(tc_link* link, const link_message* message) {
    link->log.capacity = link->config->log_records;
    link->log.period_us = link->config->log_period_us;
    want(link, &message->frame, GOSHAWK_LOG_REQUEST_WANTED_AT, SAY_RECORD, SAY_LOG, message->head.id);
}

void link_say_bitmap(const tc_link* link, uint8_t* payload) {
    const uint16_t segments = segments_wanted(link);
    uint8_t* bitmap = payload + GOSHAWK_TRAJECTORY_STATUS_BITMAP_AT;
    memcpy(payload + GOSHAWK_TRAJECTORY_STATUS_SEGMENTS_AT, &segments, sizeof segments);
    for (uint16_t i = 0; i < segments; i++) {
        if (tc_store_has_segment(&link->controller->store, i)) {
            bitmap[i / 8u] = (uint8_t)(bitmap[i / 8u] | (1u << (i % 8u)));
        }
    }
}

void link_say_header(const tc_link* link, uint8_t* payload) {
    const tc_trajectory* active = link_active(link);
    if (active != NULL) {
        memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_TRAJECTORY_ID_AT, &active->header, 10);
        memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_COEFFICIENT_COUNT_AT, &active->header.coefficient_count, 2);
        tc_copy_bytes(payload + GOSHAWK_TRAJECTORY_BEGIN_MAP_HASH_AT, &active->origin, sizeof active->origin, 0);
    }
}

bool link_say_segment(tc_link* link, uint8_t* payload) {
    const tc_trajectory* active = link_active(link);
    const uint32_t count = active != NULL ? active->header.segment_count : 0u;
    const uint32_t index = link_take(link, count);
    if (index >= count) {
        return false;
    }
    const tc_segment* segment = &active->segment[index];
    uint8_t* at = payload + GOSHAWK_TRAJECTORY_SEGMENT_COEFFICIENTS_AT;
    memcpy(payload + GOSHAWK_TRAJECTORY_SEGMENT_INDEX_AT, &index, 2);
    memcpy(payload + GOSHAWK_TRAJECTORY_SEGMENT_DURATION_US_AT, &segment->duration_us, 4);
    for (unsigned k = 0; k < TC_MAX_COEFFICIENTS; k++) {
        for (unsigned axis = 0; axis < TC_AXES; axis++) {
            memcpy(at, &segment->coefficient[axis][k], 4);
            at += 4;
        }
    }
    link->due |= DUE(SAY_SEGMENT);
    return true;
}

tc_reason tc_link_restore(tc_link* link, const tc_trajectory* kept) {
    tc_reason reason = tc_upload_begin(link->controller, &kept->header);
    (void)tc_upload_origin(link->controller, &kept->origin);
    for (uint16_t i = 0; reason == TC_OK && i < kept->header.segment_count; i++) {
        reason = tc_upload_segment(link->controller, i, &kept->segment[i]);
    }
    if (reason == TC_OK) {
        reason = tc_upload_finish(link->controller);
    }
    if (reason == TC_OK) {
        reason = tc_upload_activate(link->controller, kept->header.id, kept->header.crc32);
    }
    return reason;
}
