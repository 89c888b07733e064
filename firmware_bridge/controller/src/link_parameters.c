/* Parameters over the link: read one by one as MAVLink does, set as a whole or not at all. */
#include <string.h>

#include "copy.h"
#include "link_parts.h"

#define REAL32 9u /* MAV_PARAM_TYPE_REAL32 */

static unsigned groups(void) { return (tc_parameters_count() + TC_LINK_GROUP - 1u) / TC_LINK_GROUP; }

void link_on_parameter_list(tc_link* link, uint16_t first, uint16_t end) {
    link->value_next = first;
    link->value_end = end;
    link->due |= DUE(SAY_VALUE);
}

void link_on_parameter_request(tc_link* link, const link_message* message) {
    const param_request_read_msg* m = &message->head.parameter;
    const int32_t index = m->param_index >= 0 ? m->param_index : tc_parameters_find(m->param_id);
    if (index >= 0 && index < (int32_t)tc_parameters_count()) {
        link_on_parameter_list(link, (uint16_t)index, (uint16_t)(index + 1));
    }
}

/* Tells how the set stands. */
static void answer(tc_link* link, tc_reason reason, bool committed) {
    link->set.reason = (uint8_t)reason;
    link->set.committed = committed ? 1u : 0u;
    link->set.active_crc32 = tc_parameters_crc32(tc_parameters_now(link->controller));
    link->due |= DUE(SAY_SET);
}

static tc_reason take_group(tc_link* link, tc_parameters* staged, unsigned group, const tc_frame* frame) {
    const unsigned first = group * TC_LINK_GROUP;
    tc_reason refused = TC_OK;
    for (unsigned i = 0; i < TC_LINK_GROUP && first + i < tc_parameters_count() && refused == TC_OK; i++) {
        float value;
        tc_frame_read(frame, GOSHAWK_PARAMETERS_STAGE_VALUES_AT + 4u * i, &value, sizeof value);
        refused = tc_parameters_put(staged, (uint16_t)(first + i), value);
        if (refused != TC_OK) {
            link->set.index = (uint16_t)(first + i);
        }
    }
    link->set.groups = (uint8_t)(link->set.groups | (1u << group));
    return refused;
}

void link_on_parameters_stage(tc_link* link, const link_message* message) {
    const uint32_t transfer_id = message->head.id;
    uint8_t group;
    tc_frame_read(&message->frame, GOSHAWK_PARAMETERS_STAGE_GROUP_AT, &group, sizeof group);
    tc_reason reason = (tc_reason)link->set.reason;
    if (transfer_id == 0u || transfer_id == link->set_done_id) {
        return;
    }
    if (transfer_id != link->set.transfer_id) {
        if (!message->in_control) {
            return;
        }
        /* It gathers in the memory of the staged slot, which an upload may have. */
        link_give_way(link, message->now_us);
        tc_fill(&link->set, 0, sizeof link->set);
        link->set.transfer_id = transfer_id;
        (void)tc_parameters_stage(link->controller);
        reason = TC_OK;
    }
    tc_parameters* staged = tc_parameters_staged(link->controller);
    if (reason == TC_OK && staged == NULL) {
        reason = TC_UPLOAD_OPEN; /* or one has begun since, and has taken the memory */
    }
    if (reason == TC_OK && group < groups()) {
        reason = take_group(link, staged, group, &message->frame);
    }
    answer(link, reason, false);
}

static tc_reason commit(tc_link* link, uint32_t crc32) {
    const tc_parameters* staged = tc_parameters_staged(link->controller);
    if (link->set.reason != (uint8_t)TC_OK) {
        return (tc_reason)link->set.reason;
    }
    if (staged == NULL) {
        return TC_UPLOAD_OPEN;
    }
    if (link->set.groups != (1u << groups()) - 1u) {
        return TC_SEGMENTS_MISSING;
    }
    if (tc_parameters_crc32(staged) != crc32) {
        return TC_CRC_MISMATCH;
    }
    return tc_parameters_set(link->controller, staged);
}

void link_on_parameters_commit(tc_link* link, const link_message* message) {
    const uint32_t transfer_id = message->head.id;
    tc_reason reason = (tc_reason)link->set.reason;
    if (transfer_id == 0u || !message->in_control) {
        return;
    }
    if (transfer_id != link->set_done_id) { /* a repeated commit gets the first answer again */
        reason = transfer_id == link->set.transfer_id ? commit(link, message->head.parameters.crc32) : TC_NO_UPLOAD;
        link->set.transfer_id = transfer_id;
        link->set_done_id = transfer_id;
        tc_parameters_drop(link->controller);
    }
    answer(link, reason, true);
}

bool link_say_value(tc_link* link, uint8_t* payload) {
    const uint16_t index = link->value_next;
    if (index >= link->value_end) {
        return false;
    }
    const float value = tc_parameters_get(tc_parameters_now(link->controller), index);
    const uint16_t count = tc_parameters_count();
    memcpy(payload, &value, sizeof value);
    memcpy(payload + PARAM_VALUE_PARAM_COUNT_AT, &count, sizeof count);
    memcpy(payload + PARAM_VALUE_PARAM_INDEX_AT, &index, sizeof index);
    tc_parameters_name(index, (char*)payload + PARAM_VALUE_PARAM_ID_AT); /* its last zero goes where the type will be */
    payload[PARAM_VALUE_PARAM_TYPE_AT] = REAL32;
    link->value_next++;
    link->due |= DUE(SAY_VALUE);
    return true;
}
