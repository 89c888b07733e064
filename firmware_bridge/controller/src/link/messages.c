/* The two tables of messages: what is received, with its handler (services.h); what is sent, with its encoder. */
#include "messages.h"

typedef void (*handler)(tc_link* link, const link_message* message);

/* By row of the dialect. What has none is not carried out: heartbeats, and what only a vehicle sends. */
#define HANDLED(row, handle) [row] = handle,
static const handler received[GOSHAWK_DIALECT_ROWS] = {LINK_RECEIVED(HANDLED)};

typedef struct {
    uint8_t row; /* of the dialect's table */
    link_encoded (*encode)(tc_link* link, uint8_t* payload);
} outgoing;

/* The first one that is pending is sent first. */
static const outgoing sent[LINK_OUT_COUNT] = {
    [LINK_OUT_ORDER_RESULT] = {GOSHAWK_MISSION_RESULT_ROW, link_encode_order_result},
    [LINK_OUT_FOREIGN_RESULT] = {GOSHAWK_MISSION_RESULT_ROW, link_encode_foreign_result},
    [LINK_OUT_LEASE] = {GOSHAWK_LEASE_STATUS_ROW, link_encode_lease},
    [LINK_OUT_CHALLENGE] = {PING_ROW, link_encode_challenge},
    [LINK_OUT_TIMESYNC] = {TIMESYNC_ROW, link_encode_timesync},
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

/* The session that a message carries; 0 where it has none. */
static uint32_t session_of(const tc_frame* frame) {
    const unsigned at = link_row(frame->message)->session;
    uint32_t session = 0;
    for (unsigned i = 0; i < 4u && at + i < frame->raw[TC_FRAME_LENGTH]; i++) {
        session |= (uint32_t)frame->raw[TC_FRAME_HEADER + at + i] << (8u * i);
    }
    return session;
}

void link_dispatch(tc_link* link, const tc_frame* frame) {
    link_message message;
    message.payload = frame->raw + TC_FRAME_HEADER;
    message.length = frame->raw[TC_FRAME_LENGTH];
    message.from = link_sender(frame);
    message.in_control = link_is_holder(link, message.from, session_of(frame));
    if (message.in_control) {
        link_note_operator(link);
    }
    if (received[frame->message] != NULL) {
        received[frame->message](link, &message);
    }
}

/* Encodes what is pending if it has something to say after all. */
static bool encode(tc_link* link, link_out what, uint8_t* payload) {
    if (!link_is_pending(link, what)) {
        return false;
    }
    const link_encoded encoded = sent[what].encode(link, payload);
    if (encoded != LINK_MORE) {
        link_cancel(link, what);
    }
    return encoded != LINK_NOTHING;
}

/* The first of [first, end) that has something to say; LINK_OUT_COUNT when none has. */
static link_out encode_among(tc_link* link, unsigned first, unsigned end, uint8_t* payload) {
    for (unsigned i = first; i < end; i++) {
        if (encode(link, (link_out)i, payload)) {
            return (link_out)i;
        }
    }
    return LINK_OUT_COUNT;
}

/* Telemetry takes turns, so that a slow line carries some of each. */
static link_out encode_telemetry(tc_link* link, uint8_t* payload) {
    const unsigned turn = link_is_quiet(link) ? (unsigned)LINK_BULK : link->turn;
    link_out what = encode_among(link, turn, LINK_BULK, payload);
    if (what == LINK_OUT_COUNT && !link_is_quiet(link)) {
        what = encode_among(link, LINK_TELEMETRY, turn, payload);
    }
    if (what != LINK_OUT_COUNT) {
        link->turn = (uint8_t)((unsigned)what + 1u);
    }
    return what;
}

static link_out encode_bulk(tc_link* link, uint8_t* payload) {
    return encode_among(link, LINK_BULK, LINK_OUT_COUNT, payload);
}

link_out link_next_message(tc_link* link, uint8_t* payload, uint8_t* row) {
    const bool bulk_first = link_bulk_first(link);
    link_out what = encode_among(link, 0u, LINK_TELEMETRY, payload);
    if (what == LINK_OUT_COUNT) {
        what = bulk_first ? encode_bulk(link, payload) : encode_telemetry(link, payload);
    }
    if (what == LINK_OUT_COUNT) {
        what = bulk_first ? encode_telemetry(link, payload) : encode_bulk(link, payload);
    }
    if (what != LINK_OUT_COUNT) {
        *row = sent[what].row;
    }
    return what;
}
