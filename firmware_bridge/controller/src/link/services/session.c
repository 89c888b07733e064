/* Requests for control, challenges, time. */
#include "services.h"

enum { LEASE_GIVE_BACK = 0, LEASE_TAKE = 1, LEASE_TAKE_OVER = 2 }; /* the actions of a GOSHAWK_LEASE_REQUEST */

/* Whatever is asked, the answer names the station in control. */
void link_receive_lease_request(tc_link* link, const link_message* message) {
    goshawk_lease_request_msg m;
    goshawk_lease_request_decode(&m, message->payload, message->length);
    if (m.action == LEASE_GIVE_BACK && message->in_control) {
        link_release_lease(link);
    } else if (m.action == LEASE_TAKE || m.action == LEASE_TAKE_OVER) {
        (void)link_take_lease(link, message->from, m.action == LEASE_TAKE_OVER);
    } else {
        /* not its to give back, or an unknown action */
    }
    link->lease.nonce = m.nonce;
    link_send(link, LINK_OUT_LEASE);
}

link_encoded link_encode_lease(tc_link* link, uint8_t* payload) {
    const tc_link_lease* lease = &link->lease;
    const bool held = lease->holder.system_id != 0u && lease->until_us > link->clock_us;
    const goshawk_lease_status_msg m = {.nonce = lease->nonce,
                                        .left_ms = held ? (uint32_t)((lease->until_us - link->clock_us) / 1000u) : 0u,
                                        .operator_system = lease->holder.system_id,
                                        .operator_component = lease->holder.component_id};
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
