/* The link endpoint: who may do what, dispatch of what came in, order of what goes out. */
#include "goshawk_controller/link.h"

#include <string.h>

#include "link_parts.h"

#define REQUEST_MESSAGE 512u      /* MAV_CMD_REQUEST_MESSAGE */
#define REQUEST_HOME 410u         /* MAV_CMD_GET_HOME_POSITION */
#define REQUEST_CAPABILITIES 520u /* MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES */
#define BURST_US 20000u           /* how much of the byte rate may be saved up */

/* Keeps what a message needs off the stack of those that need more of it themselves. */
#define NOINLINE __attribute__((noinline))

void tc_link_init(tc_link* link, tc_controller* controller, const tc_link_config* config, uint64_t now_us) {
    memset(link, 0, sizeof *link);
    link->config = config;
    link->controller = controller;
    link->started_us = now_us;
    link->budget_us = now_us;
    link->telemetry.state_period_us = 20000;
    link->telemetry.transitions = controller->mission.transitions;
    tc_signing_init(&link->signing, config->key, config->start_10us);
}

static bool lease_holds(const tc_link* link, uint64_t now_us) {
    return link->lease.system_id != 0u && now_us < link->lease.until_us;
}

/* The operator was heard. The controller learns it before the order that comes along: the next tick is no longer one
   after a silence. */
static void hear(tc_link* link, uint64_t now_us) {
    link->lease.heard_us = now_us;
    tc_ground_alive(link->controller, link->controller->telemetry.time_us);
}

static NOINLINE void on_lease(tc_link* link, const link_sender* from, goshawk_payload payload) {
    goshawk_lease_request_msg m;
    goshawk_lease_request_decode(&m, payload);
    const bool may_take = from->in_control || !lease_holds(link, from->now_us);
    if (m.action == 0u && from->in_control) {
        link->lease.system_id = 0;
        link->lease.component_id = 0;
    } else if ((m.action == 1u && may_take) || m.action == 2u) {
        link->lease.system_id = from->system_id;
        link->lease.component_id = from->component_id;
        link->lease.until_us = from->now_us + TC_LINK_LEASE_US;
        hear(link, from->now_us);
    } else {
        /* an unknown action, or one that this station may not take: the answer tells who has control */
    }
    link->lease.nonce = m.nonce;
    link->lease.answer = true;
}

static uint8_t set_state_rate(tc_link* link, float rate_hz) {
    if (!(rate_hz >= 0.0f && rate_hz <= 1000.0f)) {
        return TC_OUT_OF_RANGE;
    }
    link->telemetry.state_period_us = rate_hz >= 0.1f ? (uint32_t)(1e6f / rate_hz) : 0u;
    return TC_OK;
}

/* Whether the order means the trajectory that is active. */
static NOINLINE tc_reason check_trajectory(const tc_link* link, goshawk_payload payload) {
    const tc_store* store = &link->controller->store;
    const uint32_t id = goshawk_get_u32(payload, GOSHAWK_MISSION_COMMAND_TRAJECTORY_ID_AT);
    if (tc_store_active(store) == NULL) {
        return TC_NO_TRAJECTORY;
    }
    const bool meant = tc_store_is_active(store, id, goshawk_get_u32(payload, GOSHAWK_MISSION_COMMAND_CRC32_AT));
    return meant ? TC_OK : (tc_reason)TC_LINK_OTHER_TRAJECTORY;
}

static uint8_t do_order(tc_link* link, uint8_t command, goshawk_payload payload) {
    const float value = goshawk_get_f32(payload, GOSHAWK_MISSION_COMMAND_VALUE_AT);
    if (command < (uint8_t)TC_COMMAND_COUNT) {
        const tc_reason reason =
            command == (uint8_t)TC_COMMAND_START ? check_trajectory(link, payload) : (tc_reason)TC_OK;
        return (uint8_t)(reason != TC_OK ? reason : tc_do(link->controller, (tc_command)command, value));
    }
    switch (command) { /* those that concern the link itself */
        case GOSHAWK_COMMAND_LOG_START:
            return link_log_start(link, link->order.request_id);
        case GOSHAWK_COMMAND_LOG_STOP:
            link->log.running = false;
            return TC_OK;
        case GOSHAWK_COMMAND_STATE_RATE:
            return set_state_rate(link, value);
        default:
            return TC_LINK_UNSUPPORTED;
    }
}

static NOINLINE void on_order(tc_link* link, const link_sender* from, goshawk_payload payload) {
    const uint32_t request_id = goshawk_get_u32(payload, GOSHAWK_MISSION_COMMAND_REQUEST_ID_AT);
    const uint8_t command = goshawk_get_u8(payload, GOSHAWK_MISSION_COMMAND_COMMAND_AT);
    if (request_id == 0u) {
        return;
    }
    if (!from->in_control) {
        link->order.foreign_id = request_id;
        link->order.foreign_command = command;
        return;
    }
    link->order.answer = true;
    if (request_id == link->order.request_id && from->system_id == link->order.system_id &&
        from->component_id == link->order.component_id) {
        return; /* repeated: the first answer again */
    }
    link->order.request_id = request_id;
    link->order.system_id = from->system_id;
    link->order.component_id = from->component_id;
    link->order.command = command;
    link->order.reason = do_order(link, command, payload);
}

/* Whether it is a request for the message whose id follows `below`. */
static bool asks_for(const command_long_msg* m, float below) {
    return m->command == REQUEST_MESSAGE && m->param1 > below && m->param1 < below + 1.0f;
}

static NOINLINE void on_command_long(tc_link* link, goshawk_payload payload) {
    command_long_msg m;
    command_long_decode(&m, payload);
    const bool version = m.command == REQUEST_CAPABILITIES || asks_for(&m, 147.5f);
    const bool home = m.command == REQUEST_HOME || asks_for(&m, 241.5f);
    link->telemetry.version = link->telemetry.version || version;
    link->telemetry.home = link->telemetry.home || home;
    link->command_long = m.command;
    link->command_long_result = version || home ? 0u : 3u;
    link->command_ack = true;
}

static NOINLINE void on_timesync(tc_link* link, goshawk_payload payload) {
    timesync_msg m;
    timesync_decode(&m, payload);
    if (m.tc1 == 0) {
        link->timesync_ts1 = m.ts1;
        link->timesync = true;
    }
}

static void dispatch(tc_link* link, const link_sender* from, uint32_t id, goshawk_payload payload) {
    switch (id) {
        case GOSHAWK_LEASE_REQUEST_ID:
            on_lease(link, from, payload);
            break;
        case GOSHAWK_MISSION_COMMAND_ID:
            on_order(link, from, payload);
            break;
        case GOSHAWK_TRAJECTORY_BEGIN_ID:
            link_on_begin(link, from, payload);
            break;
        case GOSHAWK_TRAJECTORY_SEGMENT_ID:
            link_on_segment(link, from, payload);
            break;
        case GOSHAWK_TRAJECTORY_SAMPLES_ID:
            link_on_samples(link, from, payload);
            break;
        case GOSHAWK_TRAJECTORY_COMMIT_ID:
            link_on_commit(link, from, payload);
            break;
        case GOSHAWK_TRAJECTORY_READ_ID:
            link_on_read(link, payload);
            break;
        case GOSHAWK_PARAMETERS_STAGE_ID:
            link_on_parameters_stage(link, from, payload);
            break;
        case GOSHAWK_PARAMETERS_COMMIT_ID:
            link_on_parameters_commit(link, from, payload);
            break;
        case PARAM_REQUEST_READ_ID:
            link_on_parameter_request(link, payload);
            break;
        case PARAM_REQUEST_LIST_ID:
            link->parameters.next = 0;
            link->parameters.end = tc_parameters_count();
            break;
        case GOSHAWK_LOG_REQUEST_ID:
            link_on_log_request(link, payload);
            break;
        case COMMAND_LONG_ID:
            on_command_long(link, payload);
            break;
        case TIMESYNC_ID:
            on_timesync(link, payload);
            break;
        default:
            break; /* heartbeats, and what only a vehicle says */
    }
}

static bool is_for_us(const tc_link* link, const tc_frame* frame) {
    const unsigned at = frame->target_at;
    if (frame->system_id == link->config->system_id || frame->system_id == 0u) {
        return false;
    }
    if (at == GOSHAWK_NO_TARGET) {
        return true;
    }
    const goshawk_payload payload = {frame->payload, frame->payload_length};
    const uint8_t system_id = goshawk_get_u8(payload, at);
    const uint8_t component_id = goshawk_get_u8(payload, at + 1u);
    return (system_id == 0u || system_id == link->config->system_id) &&
           (component_id == 0u || component_id == link->config->component_id);
}

/* Whether the frame is let in. Counts it when not. */
static NOINLINE bool passes(tc_link* link, const tc_frame* frame) {
    if (!is_for_us(link, frame)) {
        link->counts.not_for_us++;
        return false;
    }
    if (!link->config->sign) {
        return true;
    }
    switch (tc_signing_check(&link->signing, frame)) {
        case TC_SIGNATURE_GOOD:
            return true;
        case TC_SIGNATURE_MISSING:
            link->counts.without_signature += frame->id != HEARTBEAT_ID ? 1u : 0u;
            return false;
        case TC_SIGNATURE_WRONG:
            link->counts.wrong_key++;
            return false;
        default:
            link->counts.replayed++;
            return false;
    }
}

void tc_link_receive(tc_link* link, const uint8_t* bytes, size_t n, tc_parser* stream, uint64_t now_us) {
    tc_frame frame;
    tc_frame_faults* faults = &link->counts.faults;
    while (stream != NULL ? tc_parser_next(stream, &bytes, &n, &frame, faults)
                          : tc_frame_next(&bytes, &n, &frame, faults)) {
        if (!passes(link, &frame)) {
            continue;
        }
        const bool in_control = lease_holds(link, now_us) && frame.system_id == link->lease.system_id &&
                                frame.component_id == link->lease.component_id;
        const link_sender from = {frame.system_id, frame.component_id, in_control, now_us};
        if (in_control) {
            hear(link, now_us);
        }
        link->counts.accepted++;
        const goshawk_payload payload = {frame.payload, frame.payload_length};
        dispatch(link, &from, frame.id, payload);
    }
}

void tc_link_update(tc_link* link, const tc_link_measured* measured, uint64_t now_us) {
    const uint64_t vehicle_us = link->controller->telemetry.time_us;
    const uint64_t silent_us = now_us - link->lease.heard_us;
    if (link->lease.heard_us != 0u) {
        tc_ground_alive(link->controller, silent_us < vehicle_us ? vehicle_us - silent_us : 0u);
    }
    if (link->lease.system_id != 0u && !lease_holds(link, now_us)) {
        link->lease.system_id = 0;
        link->lease.component_id = 0;
    }
    link_telemetry_update(link, measured, now_us);
}

static unsigned send_lease(tc_link* link, uint64_t now_us, uint8_t* payload, uint32_t* id) {
    goshawk_lease_status_msg m;
    memset(&m, 0, sizeof m);
    m.nonce = link->lease.nonce;
    m.operator_system = link->lease.system_id;
    m.operator_component = link->lease.component_id;
    m.left_ms = lease_holds(link, now_us) ? (uint32_t)((link->lease.until_us - now_us) / 1000u) : 0u;
    link->lease.answer = false;
    goshawk_lease_status_encode(&m, payload);
    *id = GOSHAWK_LEASE_STATUS_ID;
    return GOSHAWK_LEASE_STATUS_LENGTH;
}

static unsigned send_order(tc_link* link, uint8_t* payload, uint32_t* id) {
    goshawk_mission_result_msg m;
    memset(&m, 0, sizeof m);
    if (link->order.answer) {
        m.request_id = link->order.request_id;
        m.command = link->order.command;
        m.reason = link->order.reason;
        link->order.answer = false;
    } else {
        m.request_id = link->order.foreign_id;
        m.command = link->order.foreign_command;
        m.reason = TC_LINK_NOT_IN_CONTROL;
        link->order.foreign_id = 0;
    }
    m.mission_state = link->controller->mission.state;
    goshawk_mission_result_encode(&m, payload);
    *id = GOSHAWK_MISSION_RESULT_ID;
    return GOSHAWK_MISSION_RESULT_LENGTH;
}

static unsigned send_timesync(tc_link* link, uint8_t* payload, uint32_t* id) {
    timesync_msg m;
    memset(&m, 0, sizeof m);
    m.tc1 = (int64_t)(link->controller->telemetry.time_us * 1000u);
    m.ts1 = link->timesync_ts1;
    link->timesync = false;
    timesync_encode(&m, payload);
    *id = TIMESYNC_ID;
    return TIMESYNC_LENGTH;
}

static unsigned send_command_ack(tc_link* link, uint8_t* payload, uint32_t* id) {
    command_ack_msg m;
    memset(&m, 0, sizeof m);
    m.command = link->command_long;
    m.result = link->command_long_result;
    link->command_ack = false;
    command_ack_encode(&m, payload);
    *id = COMMAND_ACK_ID;
    return COMMAND_ACK_LENGTH;
}

/* The most urgent thing to say: answers, then telemetry, then bulk. */
static unsigned next_payload(tc_link* link, uint64_t now_us, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id) {
    unsigned length = 0;
    if (link->order.answer || link->order.foreign_id != 0u) {
        return send_order(link, payload, id);
    }
    if (link->lease.answer) {
        return send_lease(link, now_us, payload, id);
    }
    if (link->timesync) {
        return send_timesync(link, payload, id);
    }
    if (link->command_ack) {
        return send_command_ack(link, payload, id);
    }
    length = link_send_upload(link, now_us, payload, id);
    if (length == 0u) {
        length = link_send_telemetry(link, now_us, payload, id);
    }
    if (length == 0u) {
        length = link_send_parameters(link, payload, id);
    }
    if (length == 0u) {
        length = link_send_read(link, payload, id);
    }
    if (length == 0u) {
        length = link_send_log(link, payload, id);
    }
    return length;
}

size_t tc_link_transmit(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint64_t now_us) {
    const uint64_t waited_us = now_us - link->budget_us;
    const uint64_t most = (uint64_t)link->config->bytes_per_s * BURST_US / 1000000u + TC_FRAME_MAX;
    const uint64_t earned = waited_us > BURST_US ? most : waited_us * link->config->bytes_per_s / 1000000u;
    if (earned > 0u) { /* else keep the fraction of a byte for later */
        link->budget_us = now_us;
        link->budget_bytes += (int64_t)earned;
    }
    if (link->budget_bytes > (int64_t)most) {
        link->budget_bytes = (int64_t)most;
    }
    if (link->budget_bytes < 0) {
        return 0;
    }
    uint8_t* payload = frame + TC_FRAME_HEADER; /* where it belongs */
    uint32_t id = 0;
    const unsigned length = next_payload(link, now_us, payload, &id);
    if (length == 0u) {
        return 0;
    }
    const uint64_t clock_10us = link->config->start_10us + (now_us - link->started_us) / 10u;
    if (clock_10us > link->signing.now_10us) {
        link->signing.now_10us = clock_10us;
    }
    const size_t n = tc_frame_build(frame, id, payload, length, link->sequence, link->config->system_id,
                                    link->config->component_id, link->config->sign ? &link->signing : NULL, 0);
    link->sequence++;
    link->counts.sent++;
    link->budget_bytes -= (int64_t)n;
    return n;
}
