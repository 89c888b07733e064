/* The link endpoint: time, who is in control, orders, and what is done with what was received. */
#include <string.h>

#include "link_internal.h"

#define LEASE_GIVE_BACK 0u /* the actions of a GOSHAWK_LEASE_REQUEST */
#define LEASE_TAKE 1u
#define LEASE_TAKE_OVER 2u
#define LEAST_STATE_RATE_HZ 0.1f
#define LARGEST_STATE_RATE_HZ 1000.0f

static const tc_link_station nobody = {0u, 0u};

void tc_link_init(tc_link* link, tc_controller* controller, const tc_link_config* config, uint64_t now_us) {
    memset(link, 0, sizeof *link);
    link->config = config;
    link->controller = controller;
    link->caller_us = now_us;
    link->reported.transitions = controller->mission.transitions;
    tc_signing_init(&link->signing, config->key, config->start_10us);
    link_admission_init(link);
}

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

uint64_t tc_link_stamp_to_keep(const tc_link* link) {
    return link->signing.now_10us + (uint64_t)TC_LINK_KEEP_PERIOD_S * 100000u + TC_STAMP_LATE_10US;
}

/* -- control -------------------------------------------------------------------------------------------------- */

bool link_is_holder(const tc_link* link, tc_link_station station) {
    const tc_link_station holder = link->lease.holder;
    return holder.system_id != 0u && holder.system_id == station.system_id &&
           holder.component_id == station.component_id;
}

/* The operator was heard. The controller learns it before the order that comes along. */
static void note_operator(tc_link* link) {
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
    note_operator(link);
    return true;
}

void link_release_lease(tc_link* link) { link->lease.holder = nobody; }

static void expire_lease(tc_link* link) {
    if (link->clock_us >= link->lease.until_us) {
        link_release_lease(link);
    }
}

/* Whatever is asked, the answer names the station in control. */
static void receive_lease_request(tc_link* link, const link_message* message) {
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

/* -- orders --------------------------------------------------------------------------------------------------- */

static uint8_t set_state_rate(tc_link* link, float rate_hz) {
    if (!(rate_hz >= 0.0f && rate_hz <= LARGEST_STATE_RATE_HZ)) {
        return TC_OUT_OF_RANGE;
    }
    const uint32_t period_us = rate_hz >= LEAST_STATE_RATE_HZ ? (uint32_t)(1e6f / rate_hz) : TC_LINK_NEVER;
    (void)link_set_period(link, GOSHAWK_STATE_ID, period_us);
    return TC_OK;
}

/* Whether the order means the trajectory that is active. */
static uint8_t check_trajectory(const tc_link* link, const link_order* order) {
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    if (active == NULL) {
        return TC_NO_TRAJECTORY;
    }
    const bool meant = active->header.id == order->trajectory_id && active->header.crc32 == order->crc32;
    return meant ? (uint8_t)TC_OK : (uint8_t)TC_LINK_OTHER_TRAJECTORY;
}

uint8_t link_do(tc_link* link, tc_command command, float value) {
    if (link->controller->mission.state == (uint8_t)TC_SHADOW) {
        return TC_WRONG_STATE; /* another controller flies: only the integrator's calls lead out */
    }
    return (uint8_t)tc_do(link->controller, command, value);
}

static uint8_t carry_out(tc_link* link, const link_order* order) {
    switch (order->command) {
        case GOSHAWK_COMMAND_LOG_START:
            return link_log_start(link, order->request_id);
        case GOSHAWK_COMMAND_LOG_STOP:
            link_log_stop(link);
            return TC_OK;
        case GOSHAWK_COMMAND_STATE_RATE:
            return set_state_rate(link, order->value);
        default:
            break; /* one for the controller */
    }
    if (order->command >= (uint8_t)TC_COMMAND_COUNT) {
        return TC_LINK_UNSUPPORTED;
    }
    const bool start = order->command == (uint8_t)TC_COMMAND_START;
    const uint8_t reason = start ? check_trajectory(link, order) : (uint8_t)TC_OK;
    return reason != (uint8_t)TC_OK ? reason : link_do(link, (tc_command)order->command, order->value);
}

const tc_link_order_result* link_execute_order(tc_link* link, const link_message* from, const link_order* order) {
    tc_link_order_result* result = from->in_control ? &link->order : &link->foreign;
    const bool repeated = order->request_id == result->request_id && from->from.system_id == result->from.system_id &&
                          from->from.component_id == result->from.component_id;
    if (!repeated) {
        result->from = from->from;
        result->request_id = order->request_id;
        result->command = order->command;
        result->reason = from->in_control ? carry_out(link, order) : (uint8_t)TC_LINK_NOT_IN_CONTROL;
    }
    result->mission_state = link->controller->mission.state;
    return result;
}

static void receive_mission_command(tc_link* link, const link_message* message) {
    goshawk_mission_command_msg m;
    goshawk_mission_command_decode(&m, message->payload, message->length);
    if (m.request_id != 0u) {
        const link_order order = {m.request_id, m.command, m.value, m.trajectory_id, m.crc32};
        (void)link_execute_order(link, message, &order);
        link_send(link, message->in_control ? LINK_OUT_ORDER_RESULT : LINK_OUT_FOREIGN_RESULT);
    }
}

/* -- what is received ------------------------------------------------------------------------------------------ */

/* A request has no time of the answerer in it; an answer has, and is not answered. */
static void receive_timesync(tc_link* link, const link_message* message) {
    timesync_msg m;
    timesync_decode(&m, message->payload, message->length);
    if (m.tc1 == 0) {
        link->timesync.vehicle_ns = (int64_t)(link->controller->telemetry.time_us * 1000u);
        link->timesync.asker_ns = m.ts1;
        link_send(link, LINK_OUT_TIMESYNC);
    }
}

static void receive(tc_link* link, const link_message* message) {
    switch (message->row) {
        case GOSHAWK_LEASE_REQUEST_ROW:
            receive_lease_request(link, message);
            break;
        case GOSHAWK_MISSION_COMMAND_ROW:
            receive_mission_command(link, message);
            break;
        case GOSHAWK_TRAJECTORY_BEGIN_ROW:
            link_receive_begin(link, message);
            break;
        case GOSHAWK_TRAJECTORY_SEGMENT_ROW:
            link_receive_segment(link, message);
            break;
        case GOSHAWK_TRAJECTORY_SAMPLES_ROW:
            link_receive_samples(link, message);
            break;
        case GOSHAWK_TRAJECTORY_COMMIT_ROW:
            link_receive_commit(link, message);
            break;
        case GOSHAWK_TRAJECTORY_READ_ROW:
            link_receive_trajectory_read(link, message);
            break;
        case GOSHAWK_PARAMETERS_STAGE_ROW:
            link_receive_parameters_stage(link, message);
            break;
        case GOSHAWK_PARAMETERS_COMMIT_ROW:
            link_receive_parameters_commit(link, message);
            break;
        case PARAM_REQUEST_READ_ROW:
            link_receive_parameter_request(link, message);
            break;
        case PARAM_REQUEST_LIST_ROW:
            link_send_parameters(link, 0, tc_parameters_count());
            break;
        case GOSHAWK_LOG_REQUEST_ROW:
            link_receive_log_request(link, message);
            break;
        case COMMAND_LONG_ROW:
            link_receive_command_long(link, message);
            break;
        case COMMAND_INT_ROW:
            link_receive_command_int(link, message);
            break;
        case SET_MODE_ROW:
            link_receive_set_mode(link, message);
            break;
        case PARAM_SET_ROW:
            link_receive_parameter_set(link, message);
            break;
        case MISSION_REQUEST_LIST_ROW:
            link_receive_mission_request_list(link, message);
            break;
        case MISSION_COUNT_ROW:
            link_receive_mission_count(link, message);
            break;
        case TIMESYNC_ROW:
            receive_timesync(link, message);
            break;
        default:
            break; /* heartbeats, and what only a vehicle sends */
    }
}

void link_dispatch(tc_link* link, const tc_frame* frame) {
    link_message message;
    message.payload = frame->raw + TC_FRAME_HEADER;
    message.length = frame->raw[TC_FRAME_LENGTH];
    message.row = frame->message;
    message.from.system_id = frame->raw[TC_FRAME_SYSTEM];
    message.from.component_id = frame->raw[TC_FRAME_COMPONENT];
    message.in_control = link_is_holder(link, message.from);
    if (message.in_control) {
        note_operator(link);
    }
    receive(link, &message);
}

void tc_link_receive(tc_link* link, const uint8_t* bytes, size_t n, tc_parser* stream, uint64_t now_us) {
    tc_frame frame;
    tc_frame_faults* faults = &link->counts.faults;
    link_set_clock(link, now_us);
    expire_lease(link);
    while (stream != NULL ? tc_parser_next(stream, &bytes, &n, &frame, faults)
                          : tc_frame_next(&bytes, &n, &frame, faults)) {
        link_receive_frame(link, &frame);
    }
}

/* In the vehicle's time the operator has been silent for as long as in the link's. */
static void report_silence(tc_link* link) {
    const uint64_t silent_us = link->clock_us - link->lease.heard_us;
    if (link->lease.ever_heard) {
        tc_ground_alive(link->controller, silent_us);
    }
}

void tc_link_update(tc_link* link, const tc_link_measured* measured, uint64_t now_us) {
    const tc_telemetry* t = &link->controller->telemetry;
    link_set_clock(link, now_us);
    link_draw_lottery(link);
    report_silence(link);
    expire_lease(link);
    link_upload_update(link);
    link->measured = *measured;
    link_log_update(link);
    link_schedule_vehicle(link);
    link_standard_update(link);
    link_note_changes(link);
    if (!tc_mission_in_air(link->controller->mission.state)) {
        memcpy(link->home_world_m, t->estimate.position_world_m, sizeof link->home_world_m);
    }
}
