/* Reading: pieces of the active trajectory and of the log, as bits of a request ask for them. */
#include <string.h>

#include "services.h"

enum { PIECES = 8 * TC_LINK_WANTED }; /* in one request */

/* Notes a request for pieces, or, when it asks for none, for what describes the whole. The newest request counts. */
static void request(tc_link* link, const uint8_t wanted[TC_LINK_WANTED], uint32_t first, link_out pieces,
                    link_out whole) {
    unsigned any = 0;
    for (unsigned i = 0; i < TC_LINK_WANTED; i++) {
        any |= wanted[i];
    }
    if (any == 0u) {
        link_send(link, whole);
        return;
    }
    memcpy(link->reading.wanted, wanted, TC_LINK_WANTED);
    link->reading.first = first;
    link->reading.next = 0;
    link_cancel(link, LINK_OUT_TRAJECTORY_SEGMENT);
    link_cancel(link, LINK_OUT_LOG_RECORD);
    link_send(link, pieces);
}

/* The next piece that was asked for and exists, there being `count`; `count` when there is none. */
static uint32_t next_piece(tc_link_reading* reading, uint32_t count) {
    while (reading->next < PIECES) {
        const uint32_t i = reading->next;
        const bool asked = (((unsigned)reading->wanted[i / 8u] >> (i % 8u)) & 1u) != 0u;
        reading->next++;
        if (asked && reading->first < count && i < count - reading->first) {
            return reading->first + i;
        }
    }
    return count;
}

void link_receive_trajectory_read(tc_link* link, const link_message* message) {
    goshawk_trajectory_read_msg m;
    goshawk_trajectory_read_decode(&m, message->payload, message->length);
    link->reading.transfer_id = m.transfer_id;
    request(link, m.wanted, m.first, LINK_OUT_TRAJECTORY_SEGMENT, LINK_OUT_TRAJECTORY_HEADER);
}

void link_receive_log_request(tc_link* link, const link_message* message) {
    goshawk_log_request_msg m;
    goshawk_log_request_decode(&m, message->payload, message->length);
    request(link, m.wanted, m.first, LINK_OUT_LOG_RECORD, LINK_OUT_LOG_INFO);
}

/* Without an active trajectory the header is empty. */
link_encoded link_encode_trajectory_header(tc_link* link, uint8_t* payload) {
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    goshawk_trajectory_begin_msg m = {.transfer_id = link->reading.transfer_id};
    if (active != NULL) {
        const tc_trajectory_header* header = &active->header;
        m.trajectory_id = header->id;
        m.crc32 = header->crc32;
        m.clearance_m = header->clearance_m;
        m.segments = header->segment_count;
        m.coefficient_count = header->coefficient_count;
        m.link_loss_policy = header->link_loss_policy;
        memcpy(m.map_hash, active->origin.map_hash, sizeof m.map_hash);
        memcpy(m.vehicle_hash, active->origin.vehicle_hash, sizeof m.vehicle_hash);
        memcpy(m.name, active->origin.name, sizeof m.name);
    }
    goshawk_trajectory_begin_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_trajectory_segment(tc_link* link, uint8_t* payload) {
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    const uint32_t count = active != NULL ? active->header.segment_count : 0u;
    const uint32_t index = next_piece(&link->reading, count);
    if (index >= count) {
        return LINK_NOTHING;
    }
    const tc_segment* segment = &active->segment[index];
    goshawk_trajectory_segment_msg m = {
        .transfer_id = link->reading.transfer_id, .duration_us = segment->duration_us, .index = (uint16_t)index};
    for (unsigned k = 0; k < TC_MAX_COEFFICIENTS; k++) {
        for (unsigned axis = 0; axis < TC_AXES; axis++) {
            m.coefficients[TC_AXES * k + axis] = segment->coefficient[axis][k];
        }
    }
    goshawk_trajectory_segment_encode(&m, payload);
    return LINK_MORE;
}

link_encoded link_encode_log_record(tc_link* link, uint8_t* payload) {
    const uint32_t index = next_piece(&link->reading, link->log.records);
    if (index >= link->log.records) {
        return LINK_NOTHING;
    }
    goshawk_log_record_msg m = {.log_id = link->log.id, .index = index};
    memcpy(m.record, link->config->log + (size_t)TC_LINK_RECORD * index, TC_LINK_RECORD);
    goshawk_log_record_encode(&m, payload);
    return LINK_MORE;
}
