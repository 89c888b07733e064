/* Parameters over the link: read one by one as MAVLink does, set as a whole or not at all. */
#include <string.h>

#include "link_parts.h"

#define REAL32 9u /* MAV_PARAM_TYPE_REAL32 */

static unsigned groups(void) { return (tc_parameters_count() + TC_LINK_GROUP - 1u) / TC_LINK_GROUP; }

void link_on_parameter_request(tc_link* link, goshawk_payload payload) {
    param_request_read_msg m;
    param_request_read_decode(&m, payload);
    char name[TC_PARAMETER_NAME_SIZE];
    memcpy(name, m.param_id, sizeof m.param_id);
    name[sizeof m.param_id] = '\0';
    const int32_t index = m.param_index >= 0 ? m.param_index : tc_parameters_find(name);
    if (index >= 0 && index < (int32_t)tc_parameters_count()) {
        link->parameters.next = (uint16_t)index;
        link->parameters.end = (uint16_t)(index + 1);
    }
}

static void take_group(tc_link* link, tc_parameters* staged, unsigned group, goshawk_payload payload) {
    const unsigned first = group * TC_LINK_GROUP;
    for (unsigned i = 0; i < TC_LINK_GROUP && first + i < tc_parameters_count(); i++) {
        const uint16_t index = (uint16_t)(first + i);
        const float value = goshawk_get_f32(payload, GOSHAWK_PARAMETERS_STAGE_VALUES_AT + 4u * i);
        const tc_reason reason = tc_parameters_put(staged, index, value);
        if (reason != TC_OK && link->parameters.reason == (uint8_t)TC_OK) {
            link->parameters.reason = (uint8_t)reason;
            link->parameters.index = index;
        }
    }
    link->parameters.groups = (uint8_t)(link->parameters.groups | (1u << group));
}

/* Begins to gather a set in the memory of the staged slot, which an upload may have. */
static void begin(tc_link* link, const link_sender* from, uint32_t transfer_id) {
    link_give_way(link, from->now_us);
    link->parameters.transfer_id = transfer_id;
    link->parameters.groups = 0;
    link->parameters.reason = (uint8_t)(tc_parameters_stage(link->controller) != NULL ? TC_OK : TC_UPLOAD_OPEN);
    link->parameters.index = 0;
}

void link_on_parameters_stage(tc_link* link, const link_sender* from, goshawk_payload payload) {
    const uint32_t transfer_id = goshawk_get_u32(payload, GOSHAWK_PARAMETERS_STAGE_TRANSFER_ID_AT);
    const unsigned group = goshawk_get_u8(payload, GOSHAWK_PARAMETERS_STAGE_GROUP_AT);
    if (transfer_id == 0u || transfer_id == link->parameters.done_id) {
        return;
    }
    if (transfer_id != link->parameters.transfer_id) {
        if (!from->in_control) {
            return;
        }
        begin(link, from, transfer_id);
    }
    link->parameters.committed = false;
    link->parameters.answer = true;
    tc_parameters* staged = tc_parameters_staged(link->controller);
    if (staged == NULL && link->parameters.reason == (uint8_t)TC_OK) {
        link->parameters.reason = (uint8_t)TC_UPLOAD_OPEN; /* one has begun since, and has taken the memory */
    }
    if (group < groups() && link->parameters.reason == (uint8_t)TC_OK) {
        take_group(link, staged, group, payload);
    }
}

static tc_reason commit(tc_link* link, uint32_t crc32) {
    const tc_parameters* staged = tc_parameters_staged(link->controller);
    if (link->parameters.reason != (uint8_t)TC_OK) {
        return (tc_reason)link->parameters.reason;
    }
    if (staged == NULL) {
        return TC_UPLOAD_OPEN;
    }
    if (link->parameters.groups != (1u << groups()) - 1u) {
        return TC_SEGMENTS_MISSING;
    }
    if (tc_parameters_crc32(staged) != crc32) {
        return TC_CRC_MISMATCH;
    }
    return tc_parameters_set(link->controller, staged);
}

void link_on_parameters_commit(tc_link* link, const link_sender* from, goshawk_payload payload) {
    goshawk_parameters_commit_msg m;
    goshawk_parameters_commit_decode(&m, payload);
    if (m.transfer_id == 0u || !from->in_control) {
        return;
    }
    if (m.transfer_id != link->parameters.done_id) { /* a repeated commit gets the first answer again */
        const bool known = m.transfer_id == link->parameters.transfer_id;
        link->parameters.reason = (uint8_t)(known ? commit(link, m.crc32) : TC_NO_UPLOAD);
        link->parameters.transfer_id = m.transfer_id;
        link->parameters.done_id = m.transfer_id;
        tc_parameters_drop(link->controller);
    }
    link->parameters.committed = true;
    link->parameters.answer = true;
}

static unsigned send_result(tc_link* link, uint8_t* payload, uint32_t* id) {
    goshawk_parameters_result_msg m;
    memset(&m, 0, sizeof m);
    m.transfer_id = link->parameters.transfer_id;
    m.active_crc32 = tc_parameters_crc32(tc_parameters_now(link->controller));
    m.index = link->parameters.index;
    m.staged = link->parameters.groups;
    m.committed = link->parameters.committed ? 1u : 0u;
    m.reason = link->parameters.reason;
    link->parameters.answer = false;
    goshawk_parameters_result_encode(&m, payload);
    *id = GOSHAWK_PARAMETERS_RESULT_ID;
    return GOSHAWK_PARAMETERS_RESULT_LENGTH;
}

unsigned link_send_parameters(tc_link* link, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id) {
    if (link->parameters.answer) {
        return send_result(link, payload, id);
    }
    if (link->parameters.next >= link->parameters.end) {
        return 0;
    }
    const uint16_t index = link->parameters.next;
    char name[TC_PARAMETER_NAME_SIZE];
    tc_parameters_name(index, name);
    link->parameters.next++;
    param_value_msg m;
    memset(&m, 0, sizeof m);
    memcpy(m.param_id, name, sizeof m.param_id);
    m.param_value = tc_parameters_get(tc_parameters_now(link->controller), index);
    m.param_type = REAL32;
    m.param_count = tc_parameters_count();
    m.param_index = index;
    param_value_encode(&m, payload);
    *id = PARAM_VALUE_ID;
    return PARAM_VALUE_LENGTH;
}
