/* The upload: pieces into the staged slot, reports of what arrived, commit, read-back. */
#include <string.h>

#include "link_parts.h"

#define STATUS_EVERY 8u         /* frames between two reports at the most */
#define STATUS_GAP_US 3000u     /* and at most this long after a frame */
#define STATUS_REPEAT_US 10000u /* while pieces are missing and the ground is busy sending */
#define STATUS_BUSY_US 1000000u /* ... which it is until so long after its last frame */
#define GIVES_WAY_US 500000u    /* parameters may have the memory of an upload that has been silent for so long */

_Static_assert(TC_MAX_SEGMENTS <= 1024, "the report's bitmap holds 1024 segments");

/* What the open transfer is about; NULL when none is open, or when the controller has thrown it away since. */
static const tc_trajectory_header* opened(const tc_link* link) {
    const tc_trajectory* staged = tc_store_staged(&link->controller->store);
    return link->upload.transfer_id != 0u && staged != NULL ? &staged->header : NULL;
}

static unsigned segments_wanted(const tc_link* link) {
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
    link->upload.answer = false;
}

void link_give_way(tc_link* link, uint64_t now_us) {
    if (link->upload.reason != 0u || now_us - link->upload.last_frame_us >= GIVES_WAY_US) {
        end_transfer(link);
    }
}

void link_on_begin(tc_link* link, const link_sender* from, goshawk_payload payload) {
    goshawk_trajectory_begin_msg m;
    goshawk_trajectory_begin_decode(&m, payload);
    if (m.transfer_id == 0u) {
        return;
    }
    if (!from->in_control) {
        link->upload.refused_transfer_id = m.transfer_id;
        link->upload.refused_reason = TC_LINK_NOT_IN_CONTROL;
        return;
    }
    if (m.transfer_id == link->upload.transfer_id) { /* repeated: what has arrived stays */
        link->upload.answer = true;
        link->upload.last_frame_us = from->now_us;
        return;
    }
    const tc_trajectory_header header = {m.trajectory_id, m.crc32, m.segments, m.coefficient_count, m.link_loss_policy};
    end_transfer(link);
    memset(&link->upload, 0, sizeof link->upload);
    const tc_reason reason = tc_upload_begin(link->controller, &header);
    if (reason != TC_OK) {
        link->upload.refused_transfer_id = m.transfer_id;
        link->upload.refused_reason = (uint8_t)reason;
        return;
    }
    tc_origin origin;
    memcpy(origin.map_hash, m.map_hash, sizeof m.map_hash);
    memcpy(origin.vehicle_hash, m.vehicle_hash, sizeof m.vehicle_hash);
    memcpy(origin.name, m.name, sizeof m.name);
    (void)tc_upload_origin(link->controller, &origin);
    link->upload.transfer_id = m.transfer_id;
    link->upload.samples_wanted = m.samples;
    link->upload.answer = true;
    link->upload.last_frame_us = from->now_us;
}

/* Whether a piece belongs to the open transfer. One that does not is answered with what is open (0: nothing), so that
   the ground learns of a restart at once. */
static bool belongs(tc_link* link, const link_sender* from, uint32_t transfer_id) {
    if (!from->in_control) {
        return false;
    }
    if (transfer_id == link->commit.transfer_id && link->upload.transfer_id == 0u) {
        return false; /* a late copy of a piece of a finished transfer */
    }
    const bool fits = transfer_id != 0u && transfer_id == link->upload.transfer_id;
    if (fits) {
        link->upload.frames++;
        link->upload.last_frame_us = from->now_us;
    }
    const bool due = link->upload.frames % STATUS_EVERY == 0u;
    const bool late = from->now_us - link->upload.last_status_us >= STATUS_GAP_US;
    link->upload.answer = link->upload.answer || due || late || !fits;
    return fits;
}

static bool complete(const tc_link* link) {
    return link->upload.received == segments_wanted(link) &&
           (link->upload.samples || link->upload.samples_wanted == 0u);
}

/* Coefficients travel by power, so that the highest can be left out; they are stored by axis. */
static void take_segment(tc_segment* segment, goshawk_payload payload) {
    segment->duration_us = goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_SEGMENT_DURATION_US_AT);
    for (unsigned axis = 0; axis < TC_AXES; axis++) {
        for (unsigned k = 0; k < TC_MAX_COEFFICIENTS; k++) {
            const unsigned at = GOSHAWK_TRAJECTORY_SEGMENT_COEFFICIENTS_AT + 4u * (TC_AXES * k + axis);
            segment->coefficient[axis][k] = goshawk_get_f32(payload, at);
        }
    }
}

void link_on_segment(tc_link* link, const link_sender* from, goshawk_payload payload) {
    const uint16_t index = goshawk_get_u16(payload, GOSHAWK_TRAJECTORY_SEGMENT_INDEX_AT);
    if (!belongs(link, from, goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_SEGMENT_TRANSFER_ID_AT))) {
        return;
    }
    link->upload.last_index = index;
    if (link->upload.reason != 0u || tc_store_has_segment(&link->controller->store, index)) {
        return;
    }
    tc_segment* place = tc_upload_place(link->controller, index);
    tc_reason reason = opened(link) != NULL && index >= segments_wanted(link) ? TC_SEGMENT_INDEX : TC_NO_UPLOAD;
    if (place != NULL) { /* straight into the staged slot: a copy would cost 200 bytes of stack */
        take_segment(place, payload);
        reason = tc_upload_segment(link->controller, index, place);
    }
    if (reason == TC_OK) {
        link->upload.received++;
    } else {
        link->upload.reason = (uint8_t)reason;
    }
    link->upload.answer = link->upload.answer || reason != TC_OK || complete(link);
}

void link_on_samples(tc_link* link, const link_sender* from, goshawk_payload payload) {
    const bool ours = belongs(link, from, goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_SAMPLES_TRANSFER_ID_AT));
    if (!ours || link->upload.samples || link->upload.reason != 0u) {
        return;
    }
    tc_reason reason = TC_OK;
    for (unsigned i = 0; i < link->upload.samples_wanted && i < TC_MAX_SAMPLES && reason == TC_OK; i++) {
        tc_trajectory_sample sample;
        sample.time_us = goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_SAMPLES_SAMPLE_US_AT + 4u * i);
        for (unsigned axis = 0; axis < TC_AXES; axis++) {
            const unsigned at = GOSHAWK_TRAJECTORY_SAMPLES_VALUES_AT + 4u * (TC_AXES * i + axis);
            sample.value[axis] = goshawk_get_f32(payload, at);
        }
        reason = tc_upload_sample(link->controller, &sample);
    }
    link->upload.samples = reason == TC_OK;
    link->upload.reason = (uint8_t)reason;
    link->upload.answer = link->upload.answer || reason != TC_OK || complete(link);
}

/* Checks and activates what is staged. */
static tc_reason commit(tc_link* link, uint32_t id, uint32_t crc32) {
    const tc_trajectory_header* header = opened(link);
    if (header == NULL) {
        return TC_NO_UPLOAD;
    }
    if (id != header->id || crc32 != header->crc32) {
        return TC_WRONG_ID;
    }
    if (link->upload.reason != 0u) {
        return (tc_reason)link->upload.reason;
    }
    if (link->upload.samples_wanted > 0u && !link->upload.samples) {
        return (tc_reason)TC_LINK_SAMPLES_MISSING;
    }
    tc_reason reason = tc_upload_finish(link->controller);
    if (reason == TC_OK) {
        reason = tc_upload_activate(link->controller, id, crc32);
    }
    return reason;
}

void link_on_commit(tc_link* link, const link_sender* from, goshawk_payload payload) {
    const uint32_t transfer_id = goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_COMMIT_TRANSFER_ID_AT);
    if (transfer_id == 0u || !from->in_control) {
        return; /* a station that is not in control has been told so at its beginning */
    }
    link->commit.answer = true;
    if (transfer_id == link->commit.transfer_id) {
        return; /* repeated: the first answer again */
    }
    link->commit.transfer_id = transfer_id;
    tc_reason reason = TC_NO_UPLOAD;
    if (transfer_id == link->upload.transfer_id) {
        const uint32_t id = goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_COMMIT_TRAJECTORY_ID_AT);
        reason = commit(link, id, goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_COMMIT_CRC32_AT));
        end_transfer(link); /* one commit ends it, whatever its answer */
    }
    link->commit.reason = (uint8_t)reason;
    link->commit.segment = link->controller->store.refused_segment;
    if (reason == TC_OK) {
        link->telemetry.status_us = from->now_us; /* tell everybody at once */
    }
}

bool link_want(tc_link* link, bool log, uint32_t first, goshawk_payload payload, unsigned bits_at) {
    tc_link_wanted* wanted = &link->read.wanted;
    unsigned any = 0;
    for (unsigned i = 0; i < TC_LINK_WANTED; i++) {
        any |= goshawk_get_u8(payload, bits_at + i);
    }
    if (any == 0u) {
        return false;
    }
    for (unsigned i = 0; i < TC_LINK_WANTED; i++) {
        wanted->bits[i] = goshawk_get_u8(payload, bits_at + i);
    }
    wanted->first = first;
    wanted->next = 0;
    link->read.log = log;
    return true;
}

uint32_t link_take(tc_link* link, bool log, uint32_t count) {
    tc_link_wanted* wanted = &link->read.wanted;
    while (link->read.log == log && wanted->next < 8u * TC_LINK_WANTED) {
        const uint32_t i = wanted->next;
        const unsigned bits = wanted->bits[i / 8u];
        const bool asked = ((bits >> (i % 8u)) & 1u) != 0u;
        wanted->next++;
        if (asked && wanted->first < count && i < count - wanted->first) {
            return wanted->first + i;
        }
    }
    return count;
}

void link_on_read(tc_link* link, goshawk_payload payload) {
    const uint32_t first = goshawk_get_u16(payload, GOSHAWK_TRAJECTORY_READ_FIRST_AT);
    link->read.transfer_id = goshawk_get_u32(payload, GOSHAWK_TRAJECTORY_READ_TRANSFER_ID_AT);
    link->read.header = !link_want(link, false, first, payload, GOSHAWK_TRAJECTORY_READ_WANTED_AT);
}

static unsigned send_status(tc_link* link, uint64_t now_us, uint8_t* payload, uint32_t* id) {
    goshawk_trajectory_status_msg m;
    memset(&m, 0, sizeof m);
    m.transfer_id = link->upload.transfer_id;
    m.frames = link->upload.frames;
    m.received = link->upload.received;
    m.segments = (uint16_t)segments_wanted(link);
    m.last_index = link->upload.last_index;
    m.reason = link->upload.reason;
    m.samples = link->upload.samples ? 1u : 0u;
    for (uint16_t i = 0; i < m.segments; i++) {
        if (tc_store_has_segment(&link->controller->store, i)) {
            m.bitmap[i / 8u] = (uint8_t)(m.bitmap[i / 8u] | (1u << (i % 8u)));
        }
    }
    link->upload.answer = false;
    link->upload.last_status_us = now_us;
    goshawk_trajectory_status_encode(&m, payload);
    *id = GOSHAWK_TRAJECTORY_STATUS_ID;
    return GOSHAWK_TRAJECTORY_STATUS_LENGTH;
}

static unsigned send_refusal(tc_link* link, uint8_t* payload, uint32_t* id) {
    goshawk_trajectory_status_msg m;
    memset(&m, 0, sizeof m);
    m.transfer_id = link->upload.refused_transfer_id;
    m.reason = link->upload.refused_reason;
    link->upload.refused_transfer_id = 0;
    goshawk_trajectory_status_encode(&m, payload);
    *id = GOSHAWK_TRAJECTORY_STATUS_ID;
    return GOSHAWK_TRAJECTORY_STATUS_LENGTH;
}

static unsigned send_result(tc_link* link, uint8_t* payload, uint32_t* id) {
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    goshawk_trajectory_result_msg m;
    memset(&m, 0, sizeof m);
    m.transfer_id = link->commit.transfer_id;
    m.active_id = active != NULL ? active->header.id : 0u;
    m.active_crc32 = active != NULL ? active->header.crc32 : 0u;
    m.reason = link->commit.reason;
    m.segment = link->commit.segment;
    link->commit.answer = false;
    goshawk_trajectory_result_encode(&m, payload);
    *id = GOSHAWK_TRAJECTORY_RESULT_ID;
    return GOSHAWK_TRAJECTORY_RESULT_LENGTH;
}

unsigned link_send_upload(tc_link* link, uint64_t now_us, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id) {
    const bool open = link->upload.transfer_id != 0u;
    const bool busy = open && now_us - link->upload.last_frame_us < STATUS_BUSY_US;
    if (link->commit.answer) {
        return send_result(link, payload, id);
    }
    if (link->upload.refused_transfer_id != 0u) {
        return send_refusal(link, payload, id);
    }
    if (link->upload.answer || (busy && now_us - link->upload.last_status_us >= STATUS_REPEAT_US)) {
        return send_status(link, now_us, payload, id);
    }
    return 0;
}

static unsigned send_header(tc_link* link, const tc_trajectory* active, uint8_t* payload, uint32_t* id) {
    goshawk_trajectory_begin_msg m;
    memset(&m, 0, sizeof m);
    m.transfer_id = link->read.transfer_id;
    if (active != NULL) {
        m.trajectory_id = active->header.id;
        m.crc32 = active->header.crc32;
        m.segments = active->header.segment_count;
        m.coefficient_count = active->header.coefficient_count;
        m.link_loss_policy = active->header.link_loss_policy;
        memcpy(m.map_hash, active->origin.map_hash, sizeof m.map_hash);
        memcpy(m.vehicle_hash, active->origin.vehicle_hash, sizeof m.vehicle_hash);
        memcpy(m.name, active->origin.name, sizeof m.name);
    }
    link->read.header = false;
    goshawk_trajectory_begin_encode(&m, payload);
    *id = GOSHAWK_TRAJECTORY_BEGIN_ID;
    return GOSHAWK_TRAJECTORY_BEGIN_LENGTH;
}

unsigned link_send_read(tc_link* link, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id) {
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    if (link->read.header) {
        return send_header(link, active, payload, id);
    }
    const uint32_t count = active != NULL ? active->header.segment_count : 0u;
    const uint32_t index = link_take(link, false, count);
    if (index >= count) {
        return 0;
    }
    const tc_segment* segment = &active->segment[index];
    goshawk_trajectory_segment_msg m;
    memset(&m, 0, sizeof m);
    m.transfer_id = link->read.transfer_id;
    m.index = (uint16_t)index;
    m.duration_us = segment->duration_us;
    for (unsigned axis = 0; axis < TC_AXES; axis++) {
        for (unsigned k = 0; k < TC_MAX_COEFFICIENTS; k++) {
            m.coefficients[TC_AXES * k + axis] = segment->coefficient[axis][k];
        }
    }
    goshawk_trajectory_segment_encode(&m, payload);
    *id = GOSHAWK_TRAJECTORY_SEGMENT_ID;
    return GOSHAWK_TRAJECTORY_SEGMENT_LENGTH;
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
