/* What is to be sent: what is pending, when the periodic messages are due, the byte rate. */
#include "transport.h"

static const int32_t BURST_US = 20000; /* how much of the byte rate may be saved up */

_Static_assert(LINK_OUT_COUNT <= 64, "bits of `pending`");

void link_set_clock(tc_link* link, uint64_t now_us) {
    if (now_us >= link->caller_us) {
        const uint64_t step_us = now_us - link->caller_us;
        link->clock_us += step_us < TC_LINK_LONGEST_STEP_US ? step_us : TC_LINK_LONGEST_STEP_US;
        link->caller_us = now_us;
    } else if (link->caller_us - now_us > TC_LINK_LONGEST_STEP_US) {
        link->caller_us = now_us; /* set back: time goes on from here */
    } else {
        /* read a little before the last one, by another task: no time has passed */
    }
}

static uint64_t bit_of(link_out what) { return (uint64_t)1u << (unsigned)what; }

void link_send(tc_link* link, link_out what) { link->pending |= bit_of(what); }

void link_cancel(tc_link* link, link_out what) { link->pending &= ~bit_of(what); }

/* -- periodic messages ------------------------------------------------------------------------------------------ */

/* Those of the vehicle's clock come first, then those of the link's. */
enum {
    EVERY_STATE,
    EVERY_POSE,
    EVERY_ODOMETRY,
    EVERY_ALTITUDE,
    EVERY_SLOW,
    EVERY_HEARTBEAT,
    EVERY_HEALTH,
    EVERY_STATUS,
    EVERY_VERSION,
    PERIODS
};

_Static_assert(PERIODS == TC_LINK_PERIODS, "as many");

typedef struct {
    uint16_t id;
    link_out what;
} periodic;

typedef struct {
    uint32_t period_us; /* unless a station asks for another */
    periodic first, second;
} series_row;

/* clang-format off: one series per line reads as the table it is */
static const series_row series[PERIODS] = {
    [EVERY_STATE] = {20000u, {GOSHAWK_STATE_ID, LINK_OUT_STATE}, {GOSHAWK_STATE_ID, LINK_OUT_STATE}},
    [EVERY_POSE] = {50000u, {ATTITUDE_QUATERNION_ID, LINK_OUT_ATTITUDE}, {LOCAL_POSITION_NED_ID, LINK_OUT_POSITION}},
    [EVERY_ODOMETRY] = {100000u, {ODOMETRY_ID, LINK_OUT_ODOMETRY}, {ODOMETRY_ID, LINK_OUT_ODOMETRY}},
    [EVERY_ALTITUDE] = {200000u, {ALTITUDE_ID, LINK_OUT_ALTITUDE}, {ALTITUDE_ID, LINK_OUT_ALTITUDE}},
    [EVERY_SLOW] = {500000u, {ESC_STATUS_ID, LINK_OUT_ROTORS}, {BATTERY_STATUS_ID, LINK_OUT_BATTERY}},
    [EVERY_HEARTBEAT] = {1000000u, {HEARTBEAT_ID, LINK_OUT_HEARTBEAT}, {HEARTBEAT_ID, LINK_OUT_HEARTBEAT}},
    [EVERY_HEALTH] = {500000u, {SYS_STATUS_ID, LINK_OUT_SYS_STATUS}, {EXTENDED_SYS_STATE_ID, LINK_OUT_EXTENDED_STATE}},
    [EVERY_STATUS] = {200000u,
                      {GOSHAWK_MISSION_STATUS_ID, LINK_OUT_MISSION_STATUS},
                      {GOSHAWK_MISSION_STATUS_ID, LINK_OUT_MISSION_STATUS}},
    [EVERY_VERSION] = {5000000u, {AUTOPILOT_VERSION_ID, LINK_OUT_VERSION}, {HOME_POSITION_ID, LINK_OUT_HOME}},
};
/* clang-format on */

bool link_is_due(uint64_t* next_us, uint64_t now_us, uint32_t period_us) {
    const bool too_far = *next_us > now_us + period_us; /* the period has been made shorter */
    if (now_us < *next_us && !too_far) {
        return false;
    }
    const bool late = too_far || now_us - *next_us >= period_us; /* what was missed is not made up for */
    *next_us = (late ? now_us : *next_us) + period_us;
    return true;
}

static void schedule(tc_link* link, unsigned first, unsigned end, uint64_t now_us) {
    for (unsigned i = first; i < end; i++) {
        const uint32_t asked_us = link->period_us[i];
        const uint32_t period_us = asked_us == TC_LINK_PRESET ? series[i].period_us : asked_us;
        if (period_us != TC_LINK_NEVER && link_is_due(&link->next_us[i], now_us, period_us)) {
            link_send(link, series[i].first.what);
            link_send(link, series[i].second.what);
            link->state_sequence = (uint16_t)(link->state_sequence + (i == (unsigned)EVERY_STATE ? 1u : 0u));
        }
    }
}

void link_schedule_vehicle(tc_link* link) {
    schedule(link, EVERY_STATE, EVERY_HEARTBEAT, link->controller->telemetry.time_us);
}

void link_schedule_link(tc_link* link) { schedule(link, EVERY_HEARTBEAT, PERIODS, link->clock_us); }

void link_hurry_status(tc_link* link) { link->next_us[EVERY_STATUS] = link->clock_us; }

/* The series of a message; PERIODS when it is in none. */
static unsigned series_of(uint32_t id) {
    unsigned i = 0;
    while (i < (unsigned)PERIODS && series[i].first.id != id && series[i].second.id != id) {
        i++;
    }
    return i;
}

bool link_send_by_id(tc_link* link, uint32_t id) {
    const unsigned i = series_of(id);
    if (id == PROTOCOL_VERSION_ID) {
        link_send(link, LINK_OUT_PROTOCOL);
        return true;
    }
    if (i == (unsigned)PERIODS) {
        return false;
    }
    link_send(link, series[i].first.id == id ? series[i].first.what : series[i].second.what);
    return true;
}

/* Heartbeat and status stay as they are: stations judge the link by them. */
bool link_set_period(tc_link* link, uint32_t id, uint32_t period_us) {
    const unsigned i = series_of(id);
    if (i == (unsigned)PERIODS || i == (unsigned)EVERY_HEARTBEAT || i == (unsigned)EVERY_STATUS) {
        return false;
    }
    link->period_us[i] = period_us;
    return true;
}

/* -- what goes first -------------------------------------------------------------------------------------------- */

/* A line that is full of telemetry loses the challenge, and nobody gets in to say so. Only on the ground, and only
   while nobody is in control: who has no key must not silence a flight. */
bool link_is_quiet(const tc_link* link) {
    return link->clock_us < link->challenge.quiet_us && link->lease.holder.system_id == 0u &&
           !tc_mission_in_air(link->controller->mission.state);
}

bool link_bulk_first(const tc_link* link) { return link->bulk_lead < 0; }

/* Where both wait, bulk gets three quarters of the bytes on the ground and one quarter in the air. */
void link_account(tc_link* link, link_out what, size_t n) {
    const uint64_t telemetry = bit_of((link_out)LINK_BULK) - bit_of((link_out)LINK_TELEMETRY);
    const uint64_t bulk = bit_of(LINK_OUT_COUNT) - bit_of((link_out)LINK_BULK);
    const int32_t bulk_share = tc_mission_in_air(link->controller->mission.state) ? 1 : 3;
    const bool is_bulk = (unsigned)what >= (unsigned)LINK_BULK;
    if ((unsigned)what < (unsigned)LINK_TELEMETRY) {
        return; /* answers are nobody's share */
    }
    if ((link->pending & (is_bulk ? telemetry : bulk)) == 0u) {
        link->bulk_lead = 0;
        return;
    }
    link->bulk_lead += is_bulk ? (int32_t)n * (4 - bulk_share) : -(int32_t)n * bulk_share;
}

/* -- the byte rate ---------------------------------------------------------------------------------------------- */

void link_set_line(tc_link* link, uint32_t bytes_per_s) {
    link->line.bytes_per_s = bytes_per_s;
    link->line.until_us = link->clock_us + TC_LINK_LEASE_US;
}

uint32_t link_bytes_per_s(const tc_link* link) {
    const uint32_t own = link->config->bytes_per_s > 0u ? link->config->bytes_per_s : 1u;
    const tc_link_line* line = &link->line;
    if (line->bytes_per_s == 0u || link->clock_us >= line->until_us) {
        return own;
    }
    const uint32_t measured = line->bytes_per_s > TC_LINK_LEAST_RATE ? line->bytes_per_s : TC_LINK_LEAST_RATE;
    return measured < own ? measured : own;
}

bool link_may_send(tc_link* link) {
    const int64_t rate = link_bytes_per_s(link);
    const int64_t most = rate * BURST_US + (int64_t)TC_FRAME_MAX * 1000000;
    const uint64_t waited_us = link->clock_us - link->credit_at_us;
    const int64_t earned = rate * (int64_t)(waited_us < TC_LINK_LONGEST_STEP_US ? waited_us : TC_LINK_LONGEST_STEP_US);
    link->credit_at_us = link->clock_us;
    link->byte_credit_us = link->byte_credit_us + earned < most ? link->byte_credit_us + earned : most;
    return link->byte_credit_us >= 0;
}

uint64_t link_divide(uint64_t number, uint32_t by) {
    const uint32_t high = (uint32_t)(number >> 32), low = (uint32_t)number;
    const uint32_t digit[4] = {high >> 16, high & 0xffffu, low >> 16, low & 0xffffu};
    uint64_t quotient = 0u;
    uint32_t left = 0u;
    for (int i = 0; i < 4; i++) {
        left = (left << 16) | digit[i];
        quotient = (quotient << 16) | (left / by);
        left %= by;
    }
    return quotient;
}

size_t link_send_frame(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint8_t row) {
    const tc_link_config* config = link->config;
    const uint64_t clock_10us = config->start_10us + link_divide(link->clock_us, 10u);
    if (clock_10us > link->signing.now_10us) {
        link->signing.now_10us = clock_10us;
    }
    const size_t n = tc_frame_build(frame, row, link_row(row)->length, link->sequence, config->system_id,
                                    config->component_id, config->sign ? &link->signing : NULL, 0);
    link->sequence++;
    link->counts.sent++;
    link->byte_credit_us -= (int64_t)n * 1000000;
    return n;
}
