/* The upload: pieces into the staged slot, reports of what arrived, the commit. */
#include <string.h>

#include "services.h"

static const uint32_t STATUS_EVERY = 8u;         /* frames between two reports at the most */
static const uint32_t STATUS_GAP_US = 3000u;     /* and at most this long after a frame */
static const uint32_t STATUS_REPEAT_US = 10000u; /* while pieces are missing and the ground is busy sending */
static const uint32_t STATUS_REPEAT_B = 200u;    /* ... and after at least so many bytes that the line carries */
static const uint32_t STATUS_BUSY_US = 1000000u; /* ... which it is until so long after its last frame */

_Static_assert(TC_MAX_SEGMENTS <= 8u * sizeof(((goshawk_trajectory_status_msg*)0)->bitmap), "the report's bitmap");

/* What the open transfer is about; NULL when none is open, or when the controller has discarded it since. */
static const tc_trajectory_header* opened(const tc_link* link) {
    const tc_trajectory* staged = tc_store_staged(&link->controller->store);
    return link->upload.transfer_id != 0u && staged != NULL ? &staged->header : NULL;
}

static uint16_t segments_wanted(const tc_link* link) {
    const tc_trajectory_header* header = opened(link);
    return header != NULL ? header->segment_count : 0u;
}

/* Ends the transfer. Whatever was not activated is given up. */
static void end_transfer(tc_link* link) {
    if (opened(link) != NULL) {
        tc_store_discard(&link->controller->store);
    }
    memset(&link->upload, 0, sizeof link->upload);
    link_cancel(link, LINK_OUT_UPLOAD_STATUS);
}

/* Opens a transfer. What had been open is given up first. */
static tc_reason begin(tc_link* link, const goshawk_trajectory_begin_msg* m) {
    const tc_trajectory_header header = {.id = m->trajectory_id,
                                         .crc32 = m->crc32,
                                         .segment_count = m->segments,
                                         .coefficient_count = m->coefficient_count,
                                         .link_loss_policy = m->link_loss_policy,
                                         .clearance_m = m->clearance_m};
    end_transfer(link);
    const tc_reason reason = tc_upload_begin(link->controller, &header);
    if (reason == TC_OK) {
        tc_origin origin;
        memcpy(origin.map_hash, m->map_hash, sizeof origin.map_hash);
        memcpy(origin.vehicle_hash, m->vehicle_hash, sizeof origin.vehicle_hash);
        memcpy(origin.name, m->name, sizeof origin.name);
        (void)tc_upload_origin(link->controller, &origin);
        link->upload.samples_wanted = m->samples;
        link->upload.transfer_id = m->transfer_id;
        link->upload.session = m->session;
    }
    return reason;
}

void link_receive_begin(tc_link* link, const link_message* message) {
    goshawk_trajectory_begin_msg m;
    goshawk_trajectory_begin_decode(&m, message->payload, message->length);
    if (m.transfer_id == 0u) {
        return;
    }
    uint8_t reason = TC_LINK_NOT_IN_CONTROL;
    if (message->in_control) { /* repeated: what has arrived stays */
        reason = (uint8_t)(m.transfer_id == link->upload.transfer_id ? TC_OK : begin(link, &m));
    }
    if (reason != (uint8_t)TC_OK) {
        link->refused.transfer_id = m.transfer_id;
        link->refused.reason = reason;
        link_send(link, LINK_OUT_UPLOAD_REFUSED);
        return;
    }
    link->upload.last_frame_us = link->clock_us;
    link_send(link, LINK_OUT_UPLOAD_STATUS);
}

/* Whether a piece belongs to the open transfer, which the session in control opened: a piece carries no session, the
   transfer's number takes its place. One that does not is answered with what is open (0: nothing), so that the ground
   learns of a restart at once. */
static bool belongs(tc_link* link, const link_message* message, uint32_t transfer_id) {
    tc_link_upload* upload = &link->upload;
    if (!link_is_holder_stream(link, message->from)) {
        return false;
    }
    if (transfer_id == link->commit.transfer_id && upload->transfer_id == 0u) {
        return false; /* a late copy of a piece of a finished transfer */
    }
    const bool fits = transfer_id != 0u && transfer_id == upload->transfer_id && upload->session == link->lease.session;
    if (fits) {
        link_note_operator(link);
        upload->frames++;
        upload->last_frame_us = link->clock_us;
    }
    if (!fits || upload->frames % STATUS_EVERY == 0u || link->clock_us - upload->last_status_us >= STATUS_GAP_US) {
        link_send(link, LINK_OUT_UPLOAD_STATUS);
    }
    return fits && upload->reason == (uint8_t)TC_OK;
}

/* A piece was taken or refused. The last one, and a refusal, are reported at once. */
static void report(tc_link* link, tc_reason reason) {
    const tc_link_upload* upload = &link->upload;
    const bool complete =
        upload->received == segments_wanted(link) && (upload->has_samples || upload->samples_wanted == 0u);
    link->upload.reason = (uint8_t)reason;
    if (reason != TC_OK || complete) {
        link_send(link, LINK_OUT_UPLOAD_STATUS);
    }
}

void link_receive_segment(tc_link* link, const link_message* message) {
    goshawk_trajectory_segment_msg m;
    tc_segment segment;
    goshawk_trajectory_segment_decode(&m, message->payload, message->length);
    if (!belongs(link, message, m.transfer_id)) {
        return;
    }
    link->upload.last_index = m.index;
    if (tc_store_has_segment(&link->controller->store, m.index)) {
        return;
    }
    segment.duration_us = m.duration_us;
    for (unsigned k = 0; k < TC_MAX_COEFFICIENTS; k++) { /* they travel by power and are stored by axis */
        for (unsigned axis = 0; axis < TC_AXES; axis++) {
            segment.coefficient[axis][k] = m.coefficients[TC_AXES * k + axis];
        }
    }
    const tc_reason reason = tc_upload_segment(link->controller, m.index, &segment);
    link->upload.received = (uint16_t)(link->upload.received + (reason == TC_OK ? 1u : 0u));
    report(link, reason);
}

void link_receive_samples(tc_link* link, const link_message* message) {
    goshawk_trajectory_samples_msg m;
    goshawk_trajectory_samples_decode(&m, message->payload, message->length);
    if (!belongs(link, message, m.transfer_id) || link->upload.has_samples) {
        return;
    }
    tc_reason reason = TC_OK;
    for (unsigned i = 0; i < link->upload.samples_wanted && i < TC_MAX_SAMPLES && reason == TC_OK; i++) {
        tc_trajectory_sample sample;
        sample.time_us = m.sample_us[i];
        memcpy(sample.value, m.values + TC_AXES * i, sizeof sample.value);
        reason = tc_upload_sample(link->controller, &sample);
    }
    link->upload.has_samples = reason == TC_OK;
    report(link, reason);
}

/* What can be said before the trajectory is looked at. */
static tc_reason may_commit(const tc_link* link, const goshawk_trajectory_commit_msg* m) {
    const tc_link_upload* upload = &link->upload;
    const tc_trajectory_header* header = opened(link);
    if (m->transfer_id != upload->transfer_id || header == NULL) {
        return TC_NO_UPLOAD;
    }
    if (m->trajectory_id != header->id || m->crc32 != header->crc32) {
        return TC_WRONG_ID;
    }
    if (upload->reason != (uint8_t)TC_OK) {
        return (tc_reason)upload->reason;
    }
    if (upload->samples_wanted > 0u && !upload->has_samples) {
        return (tc_reason)TC_LINK_SAMPLES_MISSING;
    }
    return tc_upload_may_activate(link->controller, header->id, header->crc32);
}

static void answer_commit(tc_link* link, uint32_t transfer_id, tc_reason reason) {
    link->commit.transfer_id = transfer_id;
    link->commit.reason = (uint8_t)reason;
    link->commit.segment = link->controller->store.refused_segment;
    if (transfer_id == link->upload.transfer_id) {
        end_transfer(link); /* one commit ends it, whatever its answer */
    }
    if (reason == TC_OK) {
        link_hurry_status(link);
    }
    link_send(link, LINK_OUT_COMMIT_RESULT);
}

void link_receive_commit(tc_link* link, const link_message* message) {
    goshawk_trajectory_commit_msg m;
    goshawk_trajectory_commit_decode(&m, message->payload, message->length);
    if (m.transfer_id == 0u || !message->in_control) {
        return; /* a station that is not in control was told so at its beginning */
    }
    if (m.transfer_id == link->commit.transfer_id) {
        link_send(link, LINK_OUT_COMMIT_RESULT); /* repeated: the first answer again */
        return;
    }
    const tc_reason reason = may_commit(link, &m);
    if (reason != TC_OK) {
        answer_commit(link, m.transfer_id, reason);
        return;
    }
    link->upload.checking = true; /* answered when it is done, also where it is repeated until then */
}

/* A commit goes on by a slice; while pieces still arrive, those that are there are checked ahead. */
void link_upload_update(tc_link* link) {
    tc_controller* controller = link->controller;
    if (!link->upload.checking) {
        if (opened(link) != NULL) {
            tc_upload_check_ahead(controller);
        }
        return;
    }
    const tc_trajectory_header* header = opened(link);
    tc_reason reason = header != NULL ? tc_upload_finish(controller) : TC_NO_UPLOAD;
    for (uint32_t slice = 1; slice < link->config->commit_slices && reason == TC_BUSY; slice++) {
        reason = tc_upload_finish(controller);
    }
    if (reason == TC_BUSY) {
        return; /* goes on in the next update */
    }
    if (reason == TC_OK) {
        reason = tc_upload_activate(controller, header->id, header->crc32);
    }
    answer_commit(link, link->upload.transfer_id, reason);
}

void link_upload_schedule(tc_link* link) {
    const tc_link_upload* upload = &link->upload;
    const uint32_t carried_us = STATUS_REPEAT_B * 1000000u / link_bytes_per_s(link);
    const uint32_t repeat_us = carried_us > STATUS_REPEAT_US ? carried_us : STATUS_REPEAT_US;
    if (upload->transfer_id != 0u && link->clock_us - upload->last_frame_us < STATUS_BUSY_US &&
        link->clock_us - upload->last_status_us >= repeat_us) {
        link_send(link, LINK_OUT_UPLOAD_STATUS);
    }
}

link_encoded link_encode_upload_status(tc_link* link, uint8_t* payload) {
    const tc_link_upload* upload = &link->upload;
    goshawk_trajectory_status_msg m = {.transfer_id = upload->transfer_id,
                                       .frames = upload->frames,
                                       .received = upload->received,
                                       .segments = segments_wanted(link),
                                       .last_index = upload->last_index,
                                       .reason = upload->reason,
                                       .samples = upload->has_samples ? 1u : 0u};
    for (uint16_t i = 0; i < m.segments; i++) {
        if (tc_store_has_segment(&link->controller->store, i)) {
            m.bitmap[i / 8u] = (uint8_t)(m.bitmap[i / 8u] | (1u << (i % 8u)));
        }
    }
    link->upload.last_status_us = link->clock_us;
    goshawk_trajectory_status_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_upload_refused(tc_link* link, uint8_t* payload) {
    const goshawk_trajectory_status_msg m = {.transfer_id = link->refused.transfer_id, .reason = link->refused.reason};
    goshawk_trajectory_status_encode(&m, payload);
    return LINK_ENCODED;
}

/* Whatever the answer, what is active now. */
link_encoded link_encode_commit_result(tc_link* link, uint8_t* payload) {
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    const goshawk_trajectory_result_msg m = {.transfer_id = link->commit.transfer_id,
                                             .active_id = active != NULL ? active->header.id : 0u,
                                             .active_crc32 = active != NULL ? active->header.crc32 : 0u,
                                             .segment = link->commit.segment,
                                             .reason = link->commit.reason};
    goshawk_trajectory_result_encode(&m, payload);
    return LINK_ENCODED;
}

tc_reason tc_link_restore(tc_link* link, const tc_trajectory* kept) {
    tc_controller* controller = link->controller;
    tc_reason reason = tc_upload_begin(controller, &kept->header);
    (void)tc_upload_origin(controller, &kept->origin);
    for (uint16_t i = 0; reason == TC_OK && i < kept->header.segment_count; i++) {
        reason = tc_upload_segment(controller, i, &kept->segment[i]);
        tc_upload_check_ahead(controller); /* one at a time, which leaves none to tc_upload_finish */
    }
    if (reason == TC_OK) {
        reason = tc_upload_finish(controller);
    }
    if (reason == TC_OK) {
        reason = tc_upload_activate(controller, kept->header.id, kept->header.crc32);
    }
    return reason;
}
