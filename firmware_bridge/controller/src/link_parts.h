/* What the files of the link share. Not for users. */
#ifndef LINK_PARTS_H
#define LINK_PARTS_H

#include "goshawk_controller/link.h"
#include "goshawk_dialect.h"

/* Who sent a message, and when. */
typedef struct {
    uint8_t system_id, component_id;
    bool in_control;
    uint64_t now_us;
} link_sender;

/* Receivers: one per message that asks for something. */
void link_on_begin(tc_link* link, const link_sender* from, goshawk_payload payload);
void link_on_segment(tc_link* link, const link_sender* from, goshawk_payload payload);
void link_on_samples(tc_link* link, const link_sender* from, goshawk_payload payload);
void link_on_commit(tc_link* link, const link_sender* from, goshawk_payload payload);
/* Ends an upload that was refused or has fallen silent, so that parameters may have its memory. */
void link_give_way(tc_link* link, uint64_t now_us);
void link_on_read(tc_link* link, goshawk_payload payload);
void link_on_parameters_stage(tc_link* link, const link_sender* from, goshawk_payload payload);
void link_on_parameters_commit(tc_link* link, const link_sender* from, goshawk_payload payload);
void link_on_parameter_request(tc_link* link, goshawk_payload payload);
void link_on_log_request(tc_link* link, goshawk_payload payload);

/* Senders: fill `payload`, set `id`, return the length; 0 when there is nothing to say. */
unsigned link_send_upload(tc_link* link, uint64_t now_us, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id);
unsigned link_send_read(tc_link* link, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id);
unsigned link_send_parameters(tc_link* link, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id);
unsigned link_send_log(tc_link* link, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id);
unsigned link_send_telemetry(tc_link* link, uint64_t now_us, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id);

/* Notes a request for pieces of the log or the trajectory, whose bits lie at `bits_at`; false, and nothing is noted,
   when it asks for none. */
bool link_want(tc_link* link, bool log, uint32_t first, goshawk_payload payload, unsigned bits_at);
/* Takes the next piece that was asked for and exists; `count` when there is none. */
uint32_t link_take(tc_link* link, bool log, uint32_t count);

/* Log and telemetry. */
uint8_t link_log_start(tc_link* link, uint32_t id);
void link_telemetry_update(tc_link* link, const tc_link_measured* measured, uint64_t now_us);

#endif
