/* What goes out: the table of messages in the order of their priority, when the periodic ones are due, the byte rate.
 */
#include <string.h>

#include "../link_internal.h"

#define BURST_US 20000 /* how much of the byte rate may be saved up */

_Static_assert(LINK_OUT_COUNT <= 64, "bits of `pending`");

typedef struct {
    uint8_t row; /* of the dialect's table */
    link_encoded (*encode)(tc_link* link, uint8_t* payload);
} outgoing;

static link_encoded encode_order(const tc_link_order_result* result, uint8_t* payload) {
    const goshawk_mission_result_msg m = {.request_id = result->request_id,
                                          .command = result->command,
                                          .reason = result->reason,
                                          .mission_state = result->mission_state};
    goshawk_mission_result_encode(&m, payload);
    return LINK_ENCODED;
}

static link_encoded encode_order_result(tc_link* link, uint8_t* payload) { return encode_order(&link->order, payload); }

static link_encoded encode_foreign_result(tc_link* link, uint8_t* payload) {
    return encode_order(&link->foreign, payload);
}

static link_encoded encode_lease(tc_link* link, uint8_t* payload) {
    const tc_link_lease* lease = &link->lease;
    const bool held = lease->holder.system_id != 0u && lease->until_us > link->clock_us;
    const goshawk_lease_status_msg m = {.nonce = lease->nonce,
                                        .left_ms = held ? (uint32_t)((lease->until_us - link->clock_us) / 1000u) : 0u,
                                        .operator_system = lease->holder.system_id,
                                        .operator_component = lease->holder.component_id};
    goshawk_lease_status_encode(&m, payload);
    return LINK_ENCODED;
}

static link_encoded encode_timesync(tc_link* link, uint8_t* payload) {
    const timesync_msg m = {.tc1 = link->timesync.vehicle_ns, .ts1 = link->timesync.asker_ns};
    timesync_encode(&m, payload);
    return LINK_ENCODED;
}

/* The first one that is pending is sent first. */
static const outgoing messages[LINK_OUT_COUNT] = {
    [LINK_OUT_ORDER_RESULT] = {GOSHAWK_MISSION_RESULT_ROW, encode_order_result},
    [LINK_OUT_FOREIGN_RESULT] = {GOSHAWK_MISSION_RESULT_ROW, encode_foreign_result},
    [LINK_OUT_LEASE] = {GOSHAWK_LEASE_STATUS_ROW, encode_lease},
    [LINK_OUT_CHALLENGE] = {PING_ROW, link_encode_challenge},
    [LINK_OUT_TIMESYNC] = {TIMESYNC_ROW, encode_timesync},
    [LINK_OUT_COMMAND_ACK] = {COMMAND_ACK_ROW, link_encode_command_ack},
    [LINK_OUT_COMMIT_RESULT] = {GOSHAWK_TRAJECTORY_RESULT_ROW, link_encode_commit_result},
    [LINK_OUT_UPLOAD_REFUSED] = {GOSHAWK_TRAJECTORY_STATUS_ROW, link_encode_upload_refused},
    [LINK_OUT_UPLOAD_STATUS] = {GOSHAWK_TRAJECTORY_STATUS_ROW, link_encode_upload_status},
    [LINK_OUT_HEARTBEAT] = {HEARTBEAT_ROW, link_encode_heartbeat},
    [LINK_OUT_MISSION_STATUS] = {GOSHAWK_MISSION_STATUS_ROW, link_encode_mission_status},
    [LINK_OUT_STATE] = {GOSHAWK_STATE_ROW, link_encode_state},
    [LINK_OUT_TEXT] = {STATUSTEXT_ROW, link_encode_text},
    [LINK_OUT_MISSION_COUNT] = {MISSION_COUNT_ROW, link_encode_mission_count},
    [LINK_OUT_MISSION_ACK] = {MISSION_ACK_ROW, link_encode_mission_ack},
    [LINK_OUT_PARAMETER_SET] = {PARAM_VALUE_ROW, link_encode_parameter_set},
    [LINK_OUT_PROTOCOL] = {PROTOCOL_VERSION_ROW, link_encode_protocol},
    [LINK_OUT_SYS_STATUS] = {SYS_STATUS_ROW, link_encode_sys_status},
    [LINK_OUT_EXTENDED_STATE] = {EXTENDED_SYS_STATE_ROW, link_encode_extended_state},
    [LINK_OUT_VERSION] = {AUTOPILOT_VERSION_ROW, link_encode_version},
    [LINK_OUT_HOME] = {HOME_POSITION_ROW, link_encode_home},
    [LINK_OUT_ATTITUDE] = {ATTITUDE_QUATERNION_ROW, link_encode_attitude},
    [LINK_OUT_POSITION] = {LOCAL_POSITION_NED_ROW, link_encode_position},
    [LINK_OUT_ALTITUDE] = {ALTITUDE_ROW, link_encode_altitude},
    [LINK_OUT_ROTORS] = {ESC_STATUS_ROW, link_encode_rotors},
    [LINK_OUT_BATTERY] = {BATTERY_STATUS_ROW, link_encode_battery},
    [LINK_OUT_ODOMETRY] = {ODOMETRY_ROW, link_encode_odometry},
    [LINK_OUT_PARAMETERS_RESULT] = {GOSHAWK_PARAMETERS_RESULT_ROW, link_encode_parameters_result},
    [LINK_OUT_PARAMETER] = {PARAM_VALUE_ROW, link_encode_parameter},
    [LINK_OUT_TRAJECTORY_HEADER] = {GOSHAWK_TRAJECTORY_BEGIN_ROW, link_encode_trajectory_header},
    [LINK_OUT_TRAJECTORY_SEGMENT] = {GOSHAWK_TRAJECTORY_SEGMENT_ROW, link_encode_trajectory_segment},
    [LINK_OUT_LOG_INFO] = {GOSHAWK_LOG_INFO_ROW, link_encode_log_info},
    [LINK_OUT_LOG_RECORD] = {GOSHAWK_LOG_RECORD_ROW, link_encode_log_record},
};

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
    uint32_t period_us; /* unless a station asks for another */
    link_out first, second;
} periodic;

static const periodic series[PERIODS] = {
    [EVERY_STATE] = {20000u, LINK_OUT_STATE, LINK_OUT_STATE},
    [EVERY_POSE] = {50000u, LINK_OUT_ATTITUDE, LINK_OUT_POSITION},
    [EVERY_ODOMETRY] = {100000u, LINK_OUT_ODOMETRY, LINK_OUT_ODOMETRY},
    [EVERY_ALTITUDE] = {200000u, LINK_OUT_ALTITUDE, LINK_OUT_ALTITUDE},
    [EVERY_SLOW] = {500000u, LINK_OUT_ROTORS, LINK_OUT_BATTERY},
    [EVERY_HEARTBEAT] = {1000000u, LINK_OUT_HEARTBEAT, LINK_OUT_HEARTBEAT},
    [EVERY_HEALTH] = {500000u, LINK_OUT_SYS_STATUS, LINK_OUT_EXTENDED_STATE},
    [EVERY_STATUS] = {200000u, LINK_OUT_MISSION_STATUS, LINK_OUT_MISSION_STATUS},
    [EVERY_VERSION] = {5000000u, LINK_OUT_VERSION, LINK_OUT_HOME},
};

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
            link_send(link, series[i].first);
            link_send(link, series[i].second);
            link->state_sequence = (uint16_t)(link->state_sequence + (i == (unsigned)EVERY_STATE ? 1u : 0u));
        }
    }
}

void link_schedule_vehicle(tc_link* link) {
    schedule(link, EVERY_STATE, EVERY_HEARTBEAT, link->controller->telemetry.time_us);
}

void link_hurry_status(tc_link* link) { link->next_us[EVERY_STATUS] = link->clock_us; }

/* The series of a message; PERIODS when it is in none. */
static unsigned series_of(uint32_t id) {
    unsigned i = 0;
    while (i < (unsigned)PERIODS && link_row(messages[series[i].first].row)->id != id &&
           link_row(messages[series[i].second].row)->id != id) {
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
    link_send(link, link_row(messages[series[i].first].row)->id == id ? series[i].first : series[i].second);
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

/* -- the byte rate ---------------------------------------------------------------------------------------------- */

/* Earns what the byte rate gives since the last time; whether anything may be sent. */
static bool may_send(tc_link* link) {
    const int64_t rate = link->config->bytes_per_s;
    const int64_t most = rate * BURST_US + (int64_t)TC_FRAME_MAX * 1000000;
    const uint64_t waited_us = link->clock_us - link->credit_at_us;
    const int64_t earned = rate * (int64_t)(waited_us < TC_LINK_LONGEST_STEP_US ? waited_us : TC_LINK_LONGEST_STEP_US);
    link->credit_at_us = link->clock_us;
    link->byte_credit_us = link->byte_credit_us + earned < most ? link->byte_credit_us + earned : most;
    return link->byte_credit_us >= 0;
}

/* Encodes the most urgent pending message; false when nothing is pending. */
static bool encode_next(tc_link* link, uint8_t* payload, uint8_t* row) {
    for (unsigned i = 0; i < (unsigned)LINK_OUT_COUNT; i++) {
        const link_out what = (link_out)i;
        if ((link->pending & bit_of(what)) != 0u) {
            const link_encoded encoded = messages[i].encode(link, payload);
            if (encoded != LINK_MORE) {
                link_cancel(link, what);
            }
            if (encoded != LINK_NOTHING) {
                *row = messages[i].row;
                return true;
            }
        }
    }
    return false;
}

size_t tc_link_transmit(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint64_t now_us) {
    const tc_link_config* config = link->config;
    uint8_t row = 0;
    link_set_clock(link, now_us);
    if (!may_send(link)) {
        return 0;
    }
    schedule(link, EVERY_HEARTBEAT, PERIODS, link->clock_us);
    link_upload_schedule(link);
    if (!encode_next(link, frame + TC_FRAME_HEADER, &row)) {
        return 0;
    }
    const uint64_t clock_10us = config->start_10us + link->clock_us / 10u;
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
