/* Which station is in control: a lease that it renews. Who renews is a session, not an id: two stations may have the
   same one, and neither the orders nor the heartbeats of the other may pass for the operator's. A station that starts
   anew is a new session and waits until the lease of its predecessor ends: nothing tells a restart from a second one.
 */
#include <string.h>

#include "signing.h"
#include "transport.h"

tc_link_station link_sender(const tc_frame* frame) {
    const bool is_signed = frame->raw[TC_FRAME_FLAGS] != 0u;
    const tc_link_station sender = {frame->raw[TC_FRAME_SYSTEM], frame->raw[TC_FRAME_COMPONENT],
                                    is_signed ? frame->raw[frame->length - LINK_SIGNATURE] : (uint8_t)0u};
    return sender;
}

bool link_is_holder_stream(const tc_link* link, tc_link_station station) {
    return link->lease.holder.system_id != 0u && link_same_station(link->lease.holder, station);
}

bool link_is_holder(const tc_link* link, tc_link_station station, uint32_t session) {
    return link_is_holder_stream(link, station) && link->lease.session == session;
}

void link_note_operator(tc_link* link) {
    link->lease.heard_us = link->clock_us;
    link->lease.ever_heard = true;
    tc_ground_alive(link->controller, 0u);
}

bool link_take_lease(tc_link* link, tc_link_station station, uint32_t session, bool by_force) {
    const bool is_free = link->lease.holder.system_id == 0u;
    const bool is_renewal = link_is_holder(link, station, session);
    if (!by_force && !is_free && !is_renewal) {
        return false;
    }
    if (!is_renewal) {
        link_release_lease(link);
    }
    link->lease.holder = station;
    link->lease.session = session;
    link->lease.until_us = link->clock_us + TC_LINK_LEASE_US;
    link_note_operator(link);
    return true;
}

void link_release_lease(tc_link* link) {
    tc_link_lease* lease = &link->lease;
    memset(&lease->holder, 0, sizeof lease->holder);
    memset(lease->name, 0, sizeof lease->name);
    lease->session = 0;
}

void link_expire_lease(tc_link* link) {
    if (link->clock_us >= link->lease.until_us) {
        link_release_lease(link);
    }
}

void link_lease_update(tc_link* link) {
    if (link->lease.ever_heard) {
        tc_ground_alive(link->controller, link->clock_us - link->lease.heard_us);
    }
    link_expire_lease(link);
}
