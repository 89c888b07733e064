/* Orders of our own dialect, each carried out once. */
#include "services.h"

typedef struct {
    uint32_t request_id; /* not 0 */
    uint8_t command;     /* GOSHAWK_COMMAND */
    float value;
    uint32_t trajectory_id, crc32; /* for START */
} link_order;

static const float LEAST_STATE_RATE_HZ = 0.1f;      /* less is never */
static const float LARGEST_STATE_RATE_HZ = 1000.0f; /* as many as the ticks of a fast control task */

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

/* Under a request id that the station has used last it is not carried out again, and the first answer holds. */
static void execute(tc_link* link, const link_message* from, const link_order* order) {
    tc_link_order_result* result = from->in_control ? &link->order : &link->foreign;
    const bool repeated = order->request_id == result->request_id && link_same_station(from->from, result->from);
    if (!repeated) {
        result->from = from->from;
        result->request_id = order->request_id;
        result->command = order->command;
        result->reason = from->in_control ? carry_out(link, order) : (uint8_t)TC_LINK_NOT_IN_CONTROL;
    }
    result->mission_state = link->controller->mission.state;
}

void link_receive_mission_command(tc_link* link, const link_message* message) {
    goshawk_mission_command_msg m;
    goshawk_mission_command_decode(&m, message->payload, message->length);
    if (m.request_id != 0u) {
        const link_order order = {m.request_id, m.command, m.value, m.trajectory_id, m.crc32};
        execute(link, message, &order);
        link_send(link, message->in_control ? LINK_OUT_ORDER_RESULT : LINK_OUT_FOREIGN_RESULT);
    }
}

static link_encoded encode_order(const tc_link_order_result* result, uint8_t* payload) {
    const goshawk_mission_result_msg m = {.request_id = result->request_id,
                                          .command = result->command,
                                          .reason = result->reason,
                                          .mission_state = result->mission_state};
    goshawk_mission_result_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_order_result(tc_link* link, uint8_t* payload) { return encode_order(&link->order, payload); }

link_encoded link_encode_foreign_result(tc_link* link, uint8_t* payload) {
    return encode_order(&link->foreign, payload);
}
