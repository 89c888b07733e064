/* Parameters over the link: read one by one as MAVLink does, set as a whole or not at all. */
#include <string.h>

#include "services.h"

enum { MAV_PARAM_TYPE_REAL32 = 9 }; /* MAV_PARAM_TYPE */

static unsigned group_count(void) { return (tc_parameters_count() + TC_LINK_GROUP - 1u) / TC_LINK_GROUP; }

/* Has those from `first` up to `end` sent. */
static void send_parameters(tc_link* link, uint16_t first, uint16_t end) {
    link->reading.value_next = first;
    link->reading.value_end = end;
    link_send(link, LINK_OUT_PARAMETER);
}

void link_receive_parameter_request(tc_link* link, const link_message* message) {
    param_request_read_msg m;
    param_request_read_decode(&m, message->payload, message->length);
    const int32_t index = m.param_index >= 0 ? m.param_index : tc_parameters_find(m.param_id);
    if (index >= 0 && index < (int32_t)tc_parameters_count()) {
        send_parameters(link, (uint16_t)index, (uint16_t)(index + 1));
    }
}

void link_receive_parameter_list(tc_link* link, const link_message* message) {
    (void)message;
    send_parameters(link, 0, tc_parameters_count());
}

/* Reports how the set stands. */
static void answer(tc_link* link, tc_reason reason, bool committed) {
    link->set.reason = (uint8_t)reason;
    link->set.committed = committed;
    link_send(link, LINK_OUT_PARAMETERS_RESULT);
}

/* Opens a set, which begins as the present parameters. */
static void open_set(tc_link* link, uint32_t transfer_id) {
    tc_link_set* set = &link->set;
    set->transfer_id = transfer_id;
    set->index = 0;
    set->groups = 0;
    set->committed = false;
    set->reason = (uint8_t)TC_OK;
    set->staged = *tc_parameters_now(link->controller);
}

static tc_reason stage_group(tc_link_set* set, const goshawk_parameters_stage_msg* m) {
    const unsigned first = m->group * TC_LINK_GROUP;
    for (unsigned i = 0; i < TC_LINK_GROUP && first + i < tc_parameters_count(); i++) {
        const tc_reason reason = tc_parameters_put(&set->staged, (uint16_t)(first + i), m->values[i]);
        if (reason != TC_OK) {
            set->index = (uint16_t)(first + i);
            return reason;
        }
    }
    set->groups = (uint8_t)(set->groups | (1u << m->group));
    return TC_OK;
}

/* Only the station in control stages, whatever transfer another one names. */
void link_receive_parameters_stage(tc_link* link, const link_message* message) {
    tc_link_set* set = &link->set;
    goshawk_parameters_stage_msg m;
    goshawk_parameters_stage_decode(&m, message->payload, message->length);
    if (m.transfer_id == 0u || m.transfer_id == set->done_id || !message->in_control) {
        return;
    }
    if (m.transfer_id != set->transfer_id) {
        open_set(link, m.transfer_id);
    }
    tc_reason reason = (tc_reason)set->reason; /* a refused set stays refused */
    if (reason == TC_OK && m.group < group_count()) {
        reason = stage_group(set, &m);
    }
    answer(link, reason, false);
}

static tc_reason commit(tc_link* link, const goshawk_parameters_commit_msg* m) {
    const tc_link_set* set = &link->set;
    if (m->transfer_id != set->transfer_id) {
        return TC_NO_UPLOAD;
    }
    if (set->reason != (uint8_t)TC_OK) {
        return (tc_reason)set->reason;
    }
    if (set->groups != (1u << group_count()) - 1u) {
        return TC_SEGMENTS_MISSING;
    }
    if (tc_parameters_crc32(&set->staged) != m->crc32) {
        return TC_CRC_MISMATCH;
    }
    return tc_parameters_set(link->controller, &set->staged);
}

void link_receive_parameters_commit(tc_link* link, const link_message* message) {
    goshawk_parameters_commit_msg m;
    goshawk_parameters_commit_decode(&m, message->payload, message->length);
    if (m.transfer_id == 0u || !message->in_control) {
        return;
    }
    tc_reason reason = (tc_reason)link->set.reason;
    if (m.transfer_id != link->set.done_id) { /* a repeated commit gets the first answer again */
        reason = commit(link, &m);
        link->set.transfer_id = m.transfer_id;
        link->set.done_id = m.transfer_id;
    }
    answer(link, reason, true);
}

link_encoded link_encode_parameters_result(tc_link* link, uint8_t* payload) {
    const tc_link_set* set = &link->set;
    const goshawk_parameters_result_msg m = {
        .transfer_id = set->transfer_id,
        .active_crc32 = tc_parameters_crc32(tc_parameters_now(link->controller)),
        .index = set->index,
        .staged = set->groups,
        .committed = set->committed ? 1u : 0u,
        .reason = set->reason,
    };
    goshawk_parameters_result_encode(&m, payload);
    return LINK_ENCODED;
}

static void fill_parameter(const tc_link* link, uint16_t index, uint8_t* payload) {
    param_value_msg m = {.param_value = tc_parameters_get(tc_parameters_now(link->controller), index),
                         .param_count = tc_parameters_count(),
                         .param_index = index,
                         .param_type = MAV_PARAM_TYPE_REAL32};
    const char* name = tc_parameters_name(index);
    for (unsigned i = 0; i < sizeof m.param_id && name[i] != '\0'; i++) {
        m.param_id[i] = name[i];
    }
    param_value_encode(&m, payload);
}

link_encoded link_encode_parameter(tc_link* link, uint8_t* payload) {
    const uint16_t index = link->reading.value_next;
    if (index >= link->reading.value_end) {
        return LINK_NOTHING;
    }
    fill_parameter(link, index, payload);
    link->reading.value_next++;
    return LINK_MORE;
}

/* -- a single one, as standard stations set it -------------------------------------------------------------------- */

/* One value, through the same checks as a whole set, which has to be opened anew then. */
static uint8_t set_parameter(tc_link* link, uint16_t index, const param_set_msg* m) {
    tc_link_set* set = &link->set;
    if (m->param_type != MAV_PARAM_TYPE_REAL32) {
        return TC_LINK_UNSUPPORTED;
    }
    set->transfer_id = 0;
    set->staged = *tc_parameters_now(link->controller);
    const tc_reason reason = tc_parameters_put(&set->staged, index, m->param_value);
    return (uint8_t)(reason == TC_OK ? tc_parameters_set(link->controller, &set->staged) : reason);
}

/* The answer is the value that holds then: the old one if the new one was refused. */
void link_receive_parameter_set(tc_link* link, const link_message* message) {
    param_set_msg m;
    param_set_decode(&m, message->payload, message->length);
    const int32_t index = tc_parameters_find(m.param_id);
    uint8_t reason = TC_UNKNOWN_PARAMETER;
    if (index >= 0) {
        reason = message->in_control ? set_parameter(link, (uint16_t)index, &m) : (uint8_t)TC_LINK_NOT_IN_CONTROL;
        link->standard.parameter = (uint16_t)index;
        link_send(link, LINK_OUT_PARAMETER_SET);
    }
    if (reason != (uint8_t)TC_OK) {
        link_report_refusal(link, index >= 0 ? tc_parameters_name((uint16_t)index) : "parameter", reason);
    }
}

link_encoded link_encode_parameter_set(tc_link* link, uint8_t* payload) {
    fill_parameter(link, link->standard.parameter, payload);
    return LINK_ENCODED;
}
