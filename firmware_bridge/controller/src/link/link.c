/* The link endpoint: its four calls. */
#include <string.h>

#include "messages.h"

void tc_link_init(tc_link* link, tc_controller* controller, const tc_link_config* config, uint64_t now_us) {
    memset(link, 0, sizeof *link);
    link->config = config;
    link->controller = controller;
    link->caller_us = now_us;
    link->turn = LINK_TELEMETRY;
    link->reported.transitions = controller->mission.transitions;
    tc_signing_init(&link->signing, config->key, config->start_10us);
    link_admission_init(link);
}

uint64_t tc_link_stamp_to_keep(const tc_link* link) {
    return link->signing.now_10us + (uint64_t)TC_LINK_KEEP_PERIOD_S * 100000u + TC_STAMP_LATE_10US;
}

void tc_link_receive(tc_link* link, const uint8_t* bytes, size_t n, tc_parser* stream, uint64_t now_us) {
    tc_frame frame;
    tc_frame_faults* faults = &link->counts.faults;
    link_set_clock(link, now_us);
    link_expire_lease(link);
    while (stream != NULL ? tc_parser_next(stream, &bytes, &n, &frame, faults)
                          : tc_frame_next(&bytes, &n, &frame, faults)) {
        if (link_admit(link, &frame)) {
            link_dispatch(link, &frame);
        }
    }
}

void tc_link_update(tc_link* link, uint64_t now_us) {
    const tc_telemetry* t = &link->controller->telemetry;
    link_set_clock(link, now_us);
    const tc_frame* drawn = link_draw_lottery(link);
    if (drawn != NULL) {
        link_dispatch(link, drawn);
    }
    link_lease_update(link);
    link_upload_update(link);
    link_log_update(link);
    link_schedule_vehicle(link);
    link_standard_update(link);
    link_note_changes(link);
    if (!tc_mission_in_air(link->controller->mission.state)) {
        memcpy(link->home_world_m, t->estimate.position_world_m, sizeof link->home_world_m);
    }
}

size_t tc_link_transmit(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint64_t now_us) {
    uint8_t row = 0;
    link_set_clock(link, now_us);
    if (!link_may_send(link)) {
        return 0;
    }
    link_schedule_link(link);
    link_upload_schedule(link);
    const link_out what = link_next_message(link, frame + TC_FRAME_HEADER, &row);
    if (what == LINK_OUT_COUNT) {
        return 0;
    }
    const size_t n = link_send_frame(link, frame, row);
    link_account(link, what, n);
    return n;
}
