/* Which station is in control: a lease that it renews with every message. */
#include "transport.h"

static const tc_link_station nobody = {0u, 0u};

bool link_is_holder(const tc_link* link, tc_link_station station) {
    return link->lease.holder.system_id != 0u && link_same_station(link->lease.holder, station);
}

void link_note_operator(tc_link* link) {
    link->lease.heard_us = link->clock_us;
    link->lease.ever_heard = true;
    tc_ground_alive(link->controller, 0u);
}

bool link_take_lease(tc_link* link, tc_link_station station, bool by_force) {
    const bool is_free = link->lease.holder.system_id == 0u;
    if (!by_force && !is_free && !link_is_holder(link, station)) {
        return false;
    }
    link->lease.holder = station;
    link->lease.until_us = link->clock_us + TC_LINK_LEASE_US;
    link_note_operator(link);
    return true;
}

void link_release_lease(tc_link* link) { link->lease.holder = nobody; }

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
