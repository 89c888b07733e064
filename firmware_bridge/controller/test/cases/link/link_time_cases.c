/* The link and time: rates, clocks that step or differ, times beyond 32 bits. */
#include <math.h>
#include <string.h>

#include "link_cases.h"

static unsigned states_sent(unsigned updates) {
    unsigned count = 0;
    for (unsigned i = 0; i < updates; i++) {
        controller.telemetry.time_us += 1000u;
        update(1);
        count += answer(GOSHAWK_STATE_ID) != NULL ? 1u : 0u;
    }
    return count;
}

/* What was missed is not made up for; a shorter period counts from now on. */
static void rates(void) {
    start_link(false, 4);
    lease(PILOT, 1);
    must(states_sent(200) == 10u, "fifty a second");
    controller.telemetry.time_us += 900000u;
    must(states_sent(40) <= 3u, "after a pause too");
    must(send_order(PILOT, 1, GOSHAWK_COMMAND_STATE_RATE, 0.1f, 0, 0) == TC_OK && states_sent(100) <= 2u,
         "one in ten seconds");
    must(send_order(PILOT, 2, GOSHAWK_COMMAND_STATE_RATE, 100.0f, 0, 0) == TC_OK && states_sent(100) >= 9u,
         "at once more");
    must(send_order(PILOT, 3, GOSHAWK_COMMAND_STATE_RATE, 0.0f, 0, 0) == TC_OK && states_sent(100) == 0u, "none");
}

/* A vehicle whose time runs at another pace than the link's (a simulation): silence is counted by the link's. */
static void two_paces(void) {
    start_link(false, 4);
    controller.telemetry.time_us = 50000000u;
    lease(PILOT, 1);
    controller.telemetry.time_us += 5000000u;
    clock_us += 500000u;
    update(1);
    const uint64_t silent_us = controller.telemetry.time_us - controller.ground_seen_us;
    must(silent_us > 500000u && silent_us < 510000u, "half a second");
}

/* A link task that read its clock just before or after the control task; and one that seldom gets to send. */
static void other_clocks(void) {
    uint8_t frame[TC_FRAME_MAX];
    start_link(false, 4);
    controller.telemetry.time_us = clock_us;
    lease(PILOT, 1);
    tc_link_update(&ln, clock_us - 5u);
    must(ln.lease.holder.system_id == PILOT, "still in control");
    must(controller.ground_seen_us == controller.telemetry.time_us, "received just now");
    (void)answer(0);
    link_config.bytes_per_s = 1000;
    size_t sent = 0;
    for (unsigned i = 0; i < 400u; i++) {
        clock_us += 25000u;
        controller.telemetry.time_us = clock_us;
        tc_link_update(&ln, clock_us);
        for (size_t n = 1; n > 0u; sent += n) n = tc_link_transmit(&ln, frame, clock_us);
    }
    must(sent > 9000u && sent < 11000u, "keeps to its share however seldom it is asked");
}

/* A clock that is set back or leaps: no lease is lost or kept by it, and the telemetry goes on. */
static void clock_steps(void) {
    static const int64_t steps_us[] = {-5000000, 3600000000, -1000, 4294967296, -4294967296};
    for (unsigned i = 0; i < 5u; i++) {
        start_link(false, 4);
        clock_us += 5000000000u;
        update(2);
        lease(PILOT, 1);
        (void)answer(0);
        clock_us = (uint64_t)((int64_t)clock_us + steps_us[i]);
        update(1);
        must(ln.lease.holder.system_id == PILOT, "still in control");
        unsigned heartbeats = 0;
        for (unsigned j = 0; j < 30u; j++) {
            clock_us += 100000u;
            controller.telemetry.time_us = clock_us;
            update(1);
            heartbeats += answer(HEARTBEAT_ID) != NULL ? 1u : 0u;
        }
        must(heartbeats >= 3u && heartbeats <= 4u, "one a second");
        must(ln.lease.holder.system_id == 0u, "and the lease ends");
    }
}

/* Hours without the ground: what is over stays over. */
static void long_times(void) {
    start_link(false, 4);
    lease(PILOT, 1);
    activate();
    SEND(PILOT, GOSHAWK_TRAJECTORY_BEGIN, goshawk_trajectory_begin, TO_VEHICLE, .transfer_id = 3, .trajectory_id = 9,
         .segments = 2, .coefficient_count = 8);
    (void)answer(0);
    for (unsigned hour = 0; hour < 3u; hour++) {
        for (unsigned i = 0; i < 3600u; i++) {
            clock_us += 1000000u;
            controller.telemetry.time_us = clock_us;
            update(1);
        }
        must(ln.lease.holder.system_id == 0u, "the lease is over and stays over");
        must(answer(GOSHAWK_TRAJECTORY_STATUS_ID) == NULL, "nobody waits for reports on the upload");
    }
    lease(PILOT, 1);
    must(ln.lease.holder.system_id == PILOT, "may be taken anew");
}

/* What is sent within `us`, a millisecond a step: bytes, and how many of them are parameters, which are bulk. */
static unsigned sent_within(uint32_t us, unsigned* bulk) {
    uint8_t frame[TC_FRAME_MAX];
    unsigned bytes = 0;
    *bulk = 0;
    for (uint32_t t = 0; t < us; t += 1000u) {
        clock_us += 1000u;
        controller.telemetry.time_us += 1000u;
        tc_link_update(&ln, clock_us);
        for (size_t n = tc_link_transmit(&ln, frame, clock_us); n != 0u; n = tc_link_transmit(&ln, frame, clock_us)) {
            const uint32_t id = (uint32_t)frame[7] | ((uint32_t)frame[8] << 8) | ((uint32_t)frame[9] << 16);
            bytes += (unsigned)n;
            *bulk += id == PARAM_VALUE_ID ? (unsigned)n : 0u;
        }
    }
    return bytes;
}

static void report_line(uint8_t action, uint32_t bytes_per_s) {
    SEND(PILOT, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = action,
         .line_bytes_per_s = bytes_per_s);
}

/* A slow line carries bulk and telemetry, in their shares: on the ground and in the air. */
static void shares_of_a_slow_line(void) {
    unsigned bulk;
    for (unsigned in_air = 0; in_air < 2u; in_air++) {
        start_link(false, 4);
        link_config.bytes_per_s = 2000;
        controller.mission.state = (uint8_t)(in_air != 0u ? TC_HOLD : TC_DISARMED);
        (void)sent_within(1000000, &bulk);
        SEND(PILOT, PARAM_REQUEST_LIST, param_request_list, TO_VEHICLE);
        const unsigned bytes = sent_within(1000000, &bulk);
        must(bytes > 1700u && bytes < 2300u, "as fast as it carries");
        must(in_air != 0u ? bulk > bytes / 7u && bulk < bytes / 3u : bulk > bytes / 2u && bulk < 5u * bytes / 6u,
             "in shares");
    }
}

/* What the operator measured limits what is sent, for as long as it is reported; what another one says does not. */
static void measured_line(void) {
    unsigned bulk;
    start_link(false, 4);
    const unsigned whole = sent_within(1000000, &bulk);
    report_line(3, 1000);
    const unsigned any = sent_within(1000000, &bulk);
    must(any < 1700u && any > 700u && whole > 4u * any, "while nobody is in control any station's report counts");
    report_line(1, 2000);
    SEND(OTHER, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = 1, .line_bytes_per_s = 300);
    const unsigned measured = sent_within(1000000, &bulk);
    must(measured > 1600u && measured < 2400u, "then only the operator's");
    report_line(1, 1);
    (void)sent_within(1000000, &bulk);
    report_line(1, 1);
    const unsigned least = sent_within(1000000, &bulk);
    must(least > 0u && least < 3u * TC_LINK_LEAST_RATE, "a line carries something");
    (void)sent_within(TC_LINK_LEASE_US, &bulk);
    must(sent_within(1000000, &bulk) > whole / 2u, "forgotten when it is no longer reported");
    report_line(1, 2000);
    report_line(1, 0);
    must(sent_within(1000000, &bulk) > whole / 2u, "taken back");
    link_config.bytes_per_s = 0;
    (void)sent_within(1000000, &bulk);
    must(sent_within(1000000, &bulk) < 1000u, "no rate at all is no division by it");
}

void link_time_cases(void) {
    rates();
    two_paces();
    clock_steps();
    long_times();
    other_clocks();
    shares_of_a_slow_line();
    measured_line();
}
