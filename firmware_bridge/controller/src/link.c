/* The link endpoint: who may do what, dispatch of what came in, order of what goes out. */
#include "goshawk_controller/link.h"

#include <string.h>

#include "copy.h"
#include "link_parts.h"

#define REQUEST_MESSAGE 512u      /* MAV_CMD_REQUEST_MESSAGE */
#define REQUEST_HOME 410u         /* MAV_CMD_GET_HOME_POSITION */
#define REQUEST_CAPABILITIES 520u /* MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES */
#define FLOAT_148 0x43140000u     /* the bits of 148.0f: AUTOPILOT_VERSION, as a parameter */
#define FLOAT_242 0x43720000u     /* HOME_POSITION */
#define BURST_US 20000u           /* how much of the byte rate may be saved up */
#define LONGEST_WAIT_US 1000000u  /* more than that of the byte rate is not made up for */
#define OLDEST_US 0x80000000u     /* moments get no older */
#define EARLY_US 1000000u         /* a moment may be ahead of a clock that was read just before it */
#define STATUS_REPEAT_US 10000u   /* of an upload, while pieces are missing and the ground is busy sending */
#define STATUS_BUSY_US 1000000u   /* ... which it is until so long after its last frame */

static uint32_t low_word(uint64_t time_us) { return (uint32_t)(time_us & 0xFFFFFFFFu); }

void tc_link_init(tc_link* link, tc_controller* controller, const tc_link_config* config, uint64_t now_us) {
    tc_fill(link, 0, sizeof *link);
    link->config = config;
    link->controller = controller;
    link->started_us = now_us;
    link->budget_us = low_word(now_us);
    link->state_period_us = 20000;
    link->transitions = controller->mission.transitions;
    tc_signing_init(&link->signing, config->key, config->start_10us);
}

/* Ends a lease that has run out. */
static void expire(tc_link* link, uint32_t now_us) {
    if ((uint32_t)(link->until_us - now_us - 1u) >= TC_LINK_LEASE_US + EARLY_US) {
        link->lease.system_id = 0;
        link->lease.component_id = 0;
    }
}

/* The operator was heard. The controller learns it before the order that comes along: the next tick is no longer one
   after a silence. */
static void hear(tc_link* link, uint32_t now_us) {
    link->moment_us[HEARD] = now_us;
    link->heard = true;
    tc_ground_alive(link->controller, link->controller->telemetry.time_us);
}

static void on_lease(tc_link* link, const link_message* message) {
    const uint8_t action = message->head.lease.action;
    const bool may_take = message->in_control || link->lease.system_id == 0u;
    if (action == 0u && message->in_control) {
        link->lease.system_id = 0;
        link->lease.component_id = 0;
    } else if ((action == 1u && may_take) || action == 2u) {
        link->lease.system_id = message->frame.raw[TC_FRAME_SYSTEM];
        link->lease.component_id = message->frame.raw[TC_FRAME_COMPONENT];
        link->until_us = message->now_us + TC_LINK_LEASE_US;
        hear(link, message->now_us);
    } else {
        /* an unknown action, or one that this station may not take: the answer tells who has control */
    }
    link->lease.nonce = message->head.id;
    link->lease.left_ms = link->lease.system_id != 0u ? (link->until_us - message->now_us) / 1000u : 0u;
    link->due |= DUE(SAY_LEASE);
}

static uint8_t set_state_rate(tc_link* link, float rate_hz) {
    if (!(rate_hz >= 0.0f && rate_hz <= 1000.0f)) {
        return TC_OUT_OF_RANGE;
    }
    link->state_period_us = rate_hz >= 0.1f ? (uint32_t)(1e6f / rate_hz) : 0u;
    return TC_OK;
}

/* Whether the order means the trajectory that is active. */
static tc_reason check_trajectory(const tc_link* link, const goshawk_mission_command_msg* m) {
    const tc_trajectory* active = link_active(link);
    if (active == NULL) {
        return TC_NO_TRAJECTORY;
    }
    const bool meant = active->header.id == m->trajectory_id && active->header.crc32 == m->crc32;
    return meant ? TC_OK : (tc_reason)TC_LINK_OTHER_TRAJECTORY;
}

static uint8_t do_order(tc_link* link, const goshawk_mission_command_msg* m) {
    if (m->command < (uint8_t)TC_COMMAND_COUNT) {
        const bool start = m->command == (uint8_t)TC_COMMAND_START;
        const tc_reason reason = start ? check_trajectory(link, m) : (tc_reason)TC_OK;
        return (uint8_t)(reason != TC_OK ? reason : tc_do(link->controller, (tc_command)m->command, m->value));
    }
    switch (m->command) { /* those that concern the link itself */
        case GOSHAWK_COMMAND_LOG_START:
            return link_log_start(link, m->request_id);
        case GOSHAWK_COMMAND_LOG_STOP:
            link->log.running = 0;
            return TC_OK;
        case GOSHAWK_COMMAND_STATE_RATE:
            return set_state_rate(link, m->value);
        default:
            return TC_LINK_UNSUPPORTED;
    }
}

static TC_APART void on_order(tc_link* link, const link_message* message) {
    const uint8_t system_id = message->frame.raw[TC_FRAME_SYSTEM];
    const uint8_t component_id = message->frame.raw[TC_FRAME_COMPONENT];
    const goshawk_mission_command_msg* m = &message->head.order;
    if (m->request_id == 0u) {
        return;
    }
    tc_link_order* order = message->in_control ? &link->order : &link->foreign;
    const bool repeated =
        m->request_id == order->request_id && system_id == link->order_from[0] && component_id == link->order_from[1];
    link->due |= message->in_control ? DUE(SAY_ORDER) : DUE(SAY_FOREIGN);
    if (!message->in_control) {
        order->request_id = m->request_id;
        order->command = m->command;
        order->reason = TC_LINK_NOT_IN_CONTROL;
    } else if (!repeated) { /* else the first answer again */
        order->request_id = m->request_id;
        order->command = m->command;
        link->order_from[0] = system_id;
        link->order_from[1] = component_id;
        order->reason = do_order(link, m);
    } else {
        /* nothing is carried out twice */
    }
    order->mission_state = link->controller->mission.state;
}

static void on_command_long(tc_link* link, const link_message* message) {
    uint16_t command;
    tc_frame_read(&message->frame, COMMAND_LONG_COMMAND_AT, &command, sizeof command);
    /* the command, or, of a request for a message, the bits of the message's number: the first parameter lies first */
    const uint32_t asked = command == REQUEST_MESSAGE ? message->head.id : command;
    link->acknowledged.command = command;
    link->acknowledged.result = 0;
    link->due |= DUE(SAY_ACKNOWLEDGED);
    if (asked == REQUEST_CAPABILITIES || asked == FLOAT_148) {
        link->due |= DUE(SAY_VERSION);
    } else if (asked == REQUEST_HOME || asked == FLOAT_242) {
        link->due |= DUE(SAY_HOME);
    } else {
        link->acknowledged.result = 3;
    }
}

static void on_timesync(tc_link* link, const timesync_msg* m) {
    if (m->tc1 == 0) {
        link->timesync.vehicle_ns = (int64_t)(link->controller->telemetry.time_us * 1000u);
        link->timesync.asker_ns = m->ts1;
        link->due |= DUE(SAY_TIMESYNC);
    }
}

static void dispatch(tc_link* link, const link_message* message) {
    switch (message->frame.message) {
        case GOSHAWK_LEASE_REQUEST_ROW:
            on_lease(link, message);
            break;
        case GOSHAWK_MISSION_COMMAND_ROW:
            on_order(link, message);
            break;
        case GOSHAWK_TRAJECTORY_BEGIN_ROW:
            link_on_begin(link, message);
            break;
        case GOSHAWK_TRAJECTORY_SEGMENT_ROW:
            link_on_segment(link, message);
            break;
        case GOSHAWK_TRAJECTORY_SAMPLES_ROW:
            link_on_samples(link, message);
            break;
        case GOSHAWK_TRAJECTORY_COMMIT_ROW:
            link_on_commit(link, message);
            break;
        case GOSHAWK_TRAJECTORY_READ_ROW:
            link_on_read(link, message);
            break;
        case GOSHAWK_PARAMETERS_STAGE_ROW:
            link_on_parameters_stage(link, message);
            break;
        case GOSHAWK_PARAMETERS_COMMIT_ROW:
            link_on_parameters_commit(link, message);
            break;
        case PARAM_REQUEST_READ_ROW:
            link_on_parameter_request(link, message);
            break;
        case PARAM_REQUEST_LIST_ROW:
            link_on_parameter_list(link, 0, tc_parameters_count());
            break;
        case GOSHAWK_LOG_REQUEST_ROW:
            link_on_log_request(link, message);
            break;
        case COMMAND_LONG_ROW:
            on_command_long(link, message);
            break;
        case TIMESYNC_ROW:
            on_timesync(link, &message->head.timesync);
            break;
        default:
            break; /* heartbeats, and what only a vehicle says */
    }
}

static bool is_for_us(const tc_link* link, const tc_frame* frame) {
    const uint8_t system_id = link->config->system_id;
    const uint8_t from = frame->raw[TC_FRAME_SYSTEM];
    uint8_t target[2];
    tc_frame_read(frame, frame->target_at, target, sizeof target); /* 0, to all, where there is none */
    return from != 0u && from != system_id && (target[0] == 0u || target[0] == system_id) &&
           (target[1] == 0u || target[1] == link->config->component_id);
}

/* Whether the frame is let in. Counts it. */
static TC_APART bool passes(tc_link* link, const tc_frame* frame) {
    uint32_t* counted = &link->counts.not_for_us;
    if (is_for_us(link, frame)) {
        switch (link->config->sign ? tc_signing_check(&link->signing, frame) : TC_SIGNATURE_GOOD) {
            case TC_SIGNATURE_GOOD:
                counted = &link->counts.accepted;
                break;
            case TC_SIGNATURE_MISSING:
                if (frame->message == (uint8_t)HEARTBEAT_ROW) {
                    return false;
                }
                counted = &link->counts.without_signature;
                break;
            case TC_SIGNATURE_WRONG:
                counted = &link->counts.wrong_key;
                break;
            default:
                counted = &link->counts.replayed;
                break;
        }
    }
    (*counted)++;
    return counted == &link->counts.accepted;
}

void tc_link_receive(tc_link* link, const uint8_t* bytes, size_t n, tc_parser* stream, uint64_t now_us) {
    link_message message;
    tc_frame* frame = &message.frame;
    tc_frame_faults* faults = &link->counts.faults;
    message.now_us = low_word(now_us);
    expire(link, message.now_us);
    while (stream != NULL ? tc_parser_next(stream, &bytes, &n, frame, faults)
                          : tc_frame_next(&bytes, &n, frame, faults)) {
        if (passes(link, frame)) {
            message.in_control = frame->raw[TC_FRAME_SYSTEM] == link->lease.system_id &&
                                 frame->raw[TC_FRAME_COMPONENT] == link->lease.component_id;
            if (message.in_control) {
                hear(link, message.now_us);
            }
            tc_frame_read(frame, 0, &message.head, sizeof message.head);
            dispatch(link, &message);
        }
    }
}

void tc_link_update(tc_link* link, const tc_link_measured* measured, uint64_t now_us) {
    const uint32_t now = low_word(now_us);
    for (unsigned i = 0; i < TC_LINK_MOMENTS; i++) {
        const uint32_t age_us = now - link->moment_us[i];
        if (age_us > OLDEST_US) {
            link->moment_us[i] = now - (age_us > UINT32_MAX - EARLY_US ? 0u : OLDEST_US);
        }
    }
    if (link->heard) { /* in the vehicle's time it has been silent for as long as in the link's */
        tc_ground_alive(link->controller, link->controller->telemetry.time_us - (now - link->moment_us[HEARD]));
    }
    expire(link, now);
    link_telemetry_update(link, measured);
    if (link->transitions != link->controller->mission.transitions) {
        link->transitions = link->controller->mission.transitions;
        link->due_us[SERIES_MISSION] = now;
        link->due |= DUE(SAY_TEXT);
    }
}

/* What of the link is a payload as it lies: where, and how much of it. The others have to be put together. */
#define READY(part, row, end) {offsetof(tc_link, part), (row), (end)}
#define MADE(row) {0, (row), 0}

typedef struct {
    uint16_t at;
    uint8_t message, length;
} saying;

static const saying sayings[SAYINGS] = {
    [SAY_ORDER] = READY(order, GOSHAWK_MISSION_RESULT_ROW, GOSHAWK_MISSION_RESULT_LENGTH),
    [SAY_FOREIGN] = READY(foreign, GOSHAWK_MISSION_RESULT_ROW, GOSHAWK_MISSION_RESULT_LENGTH),
    [SAY_LEASE] = READY(lease, GOSHAWK_LEASE_STATUS_ROW, GOSHAWK_LEASE_STATUS_LENGTH),
    [SAY_TIMESYNC] = READY(timesync, TIMESYNC_ROW, TIMESYNC_TARGET_SYSTEM_AT),
    [SAY_ACKNOWLEDGED] = READY(acknowledged, COMMAND_ACK_ROW, COMMAND_ACK_PROGRESS_AT),
    [SAY_COMMIT] = READY(commit, GOSHAWK_TRAJECTORY_RESULT_ROW, GOSHAWK_TRAJECTORY_RESULT_LENGTH),
    [SAY_REFUSED] = READY(refused, GOSHAWK_TRAJECTORY_STATUS_ROW, GOSHAWK_TRAJECTORY_STATUS_BITMAP_AT),
    [SAY_UPLOAD] = READY(upload, GOSHAWK_TRAJECTORY_STATUS_ROW, GOSHAWK_TRAJECTORY_STATUS_BITMAP_AT),
    [SAY_HEARTBEAT] = MADE(HEARTBEAT_ROW),
    [SAY_MISSION] = MADE(GOSHAWK_MISSION_STATUS_ROW),
    [SAY_STATE] = MADE(GOSHAWK_STATE_ROW),
    [SAY_TEXT] = MADE(STATUSTEXT_ROW),
    [SAY_VERSION] = MADE(AUTOPILOT_VERSION_ROW),
    [SAY_HOME] = MADE(HOME_POSITION_ROW),
    [SAY_ATTITUDE] = MADE(ATTITUDE_QUATERNION_ROW),
    [SAY_POSITION] = MADE(LOCAL_POSITION_NED_ROW),
    [SAY_ROTORS] = MADE(ESC_STATUS_ROW),
    [SAY_BATTERY] = MADE(BATTERY_STATUS_ROW),
    [SAY_ODOMETRY] = MADE(ODOMETRY_ROW),
    [SAY_SET] = READY(set, GOSHAWK_PARAMETERS_RESULT_ROW, GOSHAWK_PARAMETERS_RESULT_LENGTH),
    [SAY_VALUE] = MADE(PARAM_VALUE_ROW),
    [SAY_HEADER] = READY(read_transfer_id, GOSHAWK_TRAJECTORY_BEGIN_ROW, 4),
    [SAY_SEGMENT] = READY(read_transfer_id, GOSHAWK_TRAJECTORY_SEGMENT_ROW, 4),
    [SAY_LOG] = READY(log, GOSHAWK_LOG_INFO_ROW, GOSHAWK_LOG_INFO_LENGTH),
    [SAY_RECORD] = READY(log, GOSHAWK_LOG_RECORD_ROW, 4),
};

/* Puts a payload together; false when there is nothing to say after all. */
static bool say(tc_link* link, unsigned what, uint8_t* payload) {
    tc_copy_bytes(payload, (const uint8_t*)link + sayings[what].at, sayings[what].length, 0);
    switch (what) {
        case SAY_UPLOAD:
            link_say_bitmap(link, payload);
            return true;
        case SAY_VALUE:
            return link_say_value(link, payload);
        case SAY_HEADER:
            link_say_header(link, payload);
            return true;
        case SAY_SEGMENT:
            return link_say_segment(link, payload);
        case SAY_RECORD:
            return link_say_record(link, payload);
        default:
            link_say_telemetry(link, what, payload);
            return true;
    }
}

/* Earns what the byte rate gives since the last time; whether anything may be sent. */
static bool may_send(tc_link* link, uint32_t now_us) {
    const uint32_t waited_us = now_us - link->budget_us;
    const int64_t most = (int64_t)link->config->bytes_per_s * BURST_US + (int64_t)TC_FRAME_MAX * 1000000;
    const int64_t rate = link->config->bytes_per_s;
    const int64_t earned = link->budget_byte_us + rate * (waited_us < LONGEST_WAIT_US ? waited_us : LONGEST_WAIT_US);
    link->budget_us = now_us;
    link->budget_byte_us = earned > most ? most : earned;
    return link->budget_byte_us >= 0;
}

size_t tc_link_transmit(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint64_t now_us) {
    const uint32_t now = low_word(now_us);
    uint8_t* payload = frame + TC_FRAME_HEADER; /* where it belongs */
    unsigned what = 0;
    bool said = false;
    if (!may_send(link, now)) {
        return 0;
    }
    link_series(link, SERIES_HEARTBEAT, TC_LINK_SERIES, now);
    if (link->upload.transfer_id != 0u && now - link->moment_us[LAST_FRAME] < STATUS_BUSY_US &&
        now - link->moment_us[LAST_STATUS] >= STATUS_REPEAT_US) {
        link->due |= DUE(SAY_UPLOAD);
    }
    tc_fill(payload, 0, TC_PAYLOAD_MAX);
    while (!said && link->due != 0u) {
        what = (unsigned)__builtin_ctz(link->due);
        link->due &= link->due - 1u; /* takes the lowest bit off */
        said = say(link, what, payload);
    }
    if (!said) {
        return 0;
    }
    if (what == (unsigned)SAY_UPLOAD) {
        link->moment_us[LAST_STATUS] = now;
    }
    const uint64_t clock_10us = link->config->start_10us + link_quotient(now_us - link->started_us, 10);
    if (clock_10us > link->signing.now_10us) {
        link->signing.now_10us = clock_10us;
    }
    const size_t n =
        tc_frame_build(frame, sayings[what].message, TC_PAYLOAD_MAX, link->sequence, link->config->system_id,
                       link->config->component_id, link->config->sign ? &link->signing : NULL, 0);
    link->sequence++;
    link->counts.sent++;
    link->budget_byte_us -= (int64_t)n * 1000000;
    return n;
}
