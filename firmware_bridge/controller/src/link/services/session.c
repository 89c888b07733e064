/* Requests for control, challenges, time. */
#include <string.h>

#include "services.h"

enum { LEASE_GIVE_BACK = 0, LEASE_TAKE = 1, LEASE_TAKE_OVER = 2 }; /* the actions of a GOSHAWK_LEASE_REQUEST */

/* Whatever is asked, the answer names the station in control. What the line carries is told by that station; by any
   while there is none. */
void link_receive_lease_request(tc_link* link, const link_message* message) {
    goshawk_lease_request_msg m;
    goshawk_lease_request_decode(&m, message->payload, message->length);
    tc_link_lease* lease = &link->lease;
    if (m.action == LEASE_GIVE_BACK && message->in_control) {
        link_release_lease(link);
    } else if (m.action == LEASE_TAKE || m.action == LEASE_TAKE_OVER) {
        if (link_take_lease(link, message->from, m.session, m.action == LEASE_TAKE_OVER) && m.name[0] != '\0') {
            memcpy(lease->name, m.name, sizeof lease->name);
        }
    } else {
        /* not its to give back, or only a question */
    }
    const bool is_holder = link_is_holder(link, message->from, m.session);
    lease->names_holder = !is_holder || m.name[0] != '\0'; /* who takes over tells its name to who loses control */
    if (is_holder || lease->holder.system_id == 0u) {
        link_set_line(link, m.line_bytes_per_s);
    }
    lease->nonce = m.nonce;
    link_send(link, LINK_OUT_LEASE);
}

link_encoded link_encode_lease(tc_link* link, uint8_t* payload) {
    const tc_link_lease* lease = &link->lease;
    const bool held = lease->holder.system_id != 0u && lease->until_us > link->clock_us;
    goshawk_lease_status_msg m = {.nonce = lease->nonce,
                                  .left_ms = held ? (uint32_t)(lease->until_us - link->clock_us) / 1000u : 0u,
                                  .operator_system = lease->holder.system_id,
                                  .operator_component = lease->holder.component_id,
                                  .operator_session = lease->session,
                                  .operator_link = lease->holder.link_id};
    if (lease->names_holder) {
        memcpy(m.operator_name, lease->name, sizeof m.operator_name);
    }
    goshawk_lease_status_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_challenge(tc_link* link, uint8_t* payload) {
    const ping_msg m = {.time_usec = link->challenge.time_usec, .seq = link->challenge.seq}; /* a request to all */
    ping_encode(&m, payload);
    return LINK_ENCODED;
}

/* A request has no time of the answerer in it; an answer has, and is not answered. */
void link_receive_timesync(tc_link* link, const link_message* message) {
    timesync_msg m;
    timesync_decode(&m, message->payload, message->length);
    if (m.tc1 == 0) {
        link->timesync.vehicle_ns = (int64_t)(link->controller->telemetry.time_us * 1000u);
        link->timesync.asker_ns = m.ts1;
        link_send(link, LINK_OUT_TIMESYNC);
    }
}

link_encoded link_encode_timesync(tc_link* link, uint8_t* payload) {
    const timesync_msg m = {.tc1 = link->timesync.vehicle_ns, .ts1 = link->timesync.asker_ns};
    timesync_encode(&m, payload);
    return LINK_ENCODED;
}
