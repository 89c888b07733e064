/* The two slots and the upload that fills one of them. */
#include "copy.h"
#include "goshawk_controller/trajectory.h"
#include "maths.h"
#include "path_check.h"

#define LONGEST_US 3600000000u

_Static_assert(sizeof(tc_parameters) <= sizeof(tc_trajectory), "parameters fit into a slot");

static TC_RARE tc_slot* staged_memory(tc_store* store) { return &store->slot[1u - store->active]; }

static tc_trajectory* staged_slot(tc_store* store) { return &staged_memory(store)->trajectory; }

void tc_store_init(tc_store* store) { tc_fill(store, 0, sizeof *store); }

void tc_store_discard(tc_store* store) {
    store->staged_state = TC_STAGED_EMPTY;
    store->sample_count = 0;
}

tc_reason tc_store_begin(tc_store* store, const tc_trajectory_header* header) {
    if (header->id == 0u) return TC_WRONG_ID;
    if (header->segment_count == 0u || header->segment_count > TC_MAX_SEGMENTS) return TC_SEGMENT_COUNT;
    if (header->coefficient_count == 0u || header->coefficient_count > TC_MAX_COEFFICIENTS) {
        return TC_COEFFICIENT_COUNT;
    }
    if (header->link_loss_policy > (uint8_t)TC_LINK_LOSS_LAND) return TC_OUT_OF_RANGE;
    tc_store_discard(store);
    tc_trajectory* slot = staged_slot(store);
    slot->header = *header;
    tc_fill(&slot->origin, 0, sizeof slot->origin);
    for (uint16_t i = 0; i < header->segment_count; i++) slot->segment[i].duration_us = 0;
    store->staged_state = TC_STAGED_FILLING;
    store->refused_segment = 0;
    return TC_OK;
}

tc_reason tc_store_put_origin(tc_store* store, const tc_origin* origin) {
    if (store->staged_state != TC_STAGED_FILLING) return TC_NO_UPLOAD;
    staged_slot(store)->origin = *origin;
    return TC_OK;
}

TC_RARE bool tc_store_has_segment(const tc_store* store, uint16_t index) {
    const tc_trajectory* slot = tc_store_staged(store);
    return slot != NULL && index < slot->header.segment_count && slot->segment[index].duration_us != 0u;
}

tc_segment* tc_store_place(tc_store* store, uint16_t index) {
    tc_trajectory* slot = staged_slot(store);
    const bool open = store->staged_state == TC_STAGED_FILLING && index < slot->header.segment_count;
    return open && !tc_store_has_segment(store, index) ? &slot->segment[index] : NULL;
}

/* A late repeat of what was already checked is no error; anything else is. */
static tc_reason repeated(const tc_store* store, uint16_t index, const tc_segment* segment) {
    const tc_trajectory* slot = tc_store_staged(store);
    const tc_segment* held = &slot->segment[index];
    bool same = held->duration_us == segment->duration_us;
    for (int axis = 0; axis < TC_AXES; axis++) {
        for (int i = 0; i < slot->header.coefficient_count; i++) {
            same = same && tc_bits(held->coefficient[axis][i]) == tc_bits(segment->coefficient[axis][i]);
        }
    }
    return same ? TC_OK : TC_NO_UPLOAD;
}

tc_reason tc_store_put_segment(tc_store* store, uint16_t index, const tc_segment* segment,
                               const tc_parameters* limits) {
    if (tc_store_staged(store) == NULL) return TC_NO_UPLOAD;
    tc_trajectory* slot = staged_slot(store);
    if (index >= slot->header.segment_count) return TC_SEGMENT_INDEX;
    if (store->staged_state == TC_STAGED_CHECKED) return repeated(store, index, segment);
    const uint32_t count = slot->header.coefficient_count;
    const tc_reason reason = tc_check_segment(segment, count, limits);
    tc_segment* held = &slot->segment[index];
    if (reason != TC_OK) {
        store->refused_segment = index;
        if (held == segment) held->duration_us = 0; /* written into its place, but it is none */
        return reason;
    }
    if (held != segment) tc_copy_bytes(held, segment, sizeof *held, 0); /* it may lie there already */
    for (int axis = 0; axis < TC_AXES; axis++) {
        tc_fill(&held->coefficient[axis][count], 0, (TC_MAX_COEFFICIENTS - count) * sizeof(float));
    }
    return TC_OK;
}

tc_reason tc_store_put_sample(tc_store* store, const tc_trajectory_sample* sample) {
    if (store->staged_state != TC_STAGED_FILLING) return TC_NO_UPLOAD;
    if (!tc_all_finite(sample->value, TC_AXES)) return TC_NOT_FINITE;
    for (uint32_t i = 0; i < store->sample_count; i++) { /* a repeat replaces */
        if (store->sample[i].time_us == sample->time_us) {
            store->sample[i] = *sample;
            return TC_OK;
        }
    }
    if (store->sample_count >= TC_MAX_SAMPLES) return TC_OUT_OF_RANGE;
    store->sample[store->sample_count] = *sample;
    store->sample_count++;
    return TC_OK;
}

/* Sums the durations; refuses when segments are missing (then `refused_segment` is the first) or it gets too long. */
static tc_reason lay_out(tc_store* store, tc_trajectory* slot) {
    uint64_t start_us = 0;
    for (uint16_t i = 0; i < slot->header.segment_count; i++) {
        store->refused_segment = i;
        if (!tc_store_has_segment(store, i)) return TC_SEGMENTS_MISSING;
        slot->start_us[i] = (uint32_t)start_us;
        start_us += slot->segment[i].duration_us;
        if (start_us > LONGEST_US) return TC_SEGMENT_DURATION;
    }
    slot->start_us[slot->header.segment_count] = (uint32_t)start_us;
    return TC_OK;
}

static tc_reason check_joins(tc_store* store, const tc_trajectory* slot) {
    for (uint16_t i = 1; i < slot->header.segment_count; i++) {
        store->refused_segment = i;
        const tc_reason reason = tc_check_join(slot, i);
        if (reason != TC_OK) return reason;
    }
    return TC_OK;
}

tc_reason tc_store_finish(tc_store* store) {
    if (store->staged_state == TC_STAGED_CHECKED) return TC_OK;
    if (store->staged_state != TC_STAGED_FILLING) return TC_NO_UPLOAD;
    tc_trajectory* slot = staged_slot(store);
    tc_reason reason = lay_out(store, slot);
    if (reason != TC_OK) return reason;
    store->refused_segment = 0;
    if (tc_trajectory_crc32(slot) != slot->header.crc32) return TC_CRC_MISMATCH;
    reason = check_joins(store, slot);
    if (reason != TC_OK) return reason;
    store->refused_segment = 0;
    reason = tc_check_ends(slot);
    for (uint32_t i = 0; i < store->sample_count && reason == TC_OK; i++) {
        reason = tc_check_sample(slot, &store->sample[i]);
    }
    if (reason == TC_OK) store->staged_state = TC_STAGED_CHECKED;
    return reason;
}

tc_reason tc_store_activate(tc_store* store, uint32_t id, uint32_t crc32) {
    const tc_trajectory* staged = tc_store_staged(store);
    const bool ready =
        store->staged_state == TC_STAGED_CHECKED && staged->header.id == id && staged->header.crc32 == crc32;
    if (tc_store_is_active(store, id, crc32)) {
        if (ready) store->slot[store->active].trajectory.origin = staged->origin; /* it may have got another name */
        return TC_OK;
    }
    if (!ready) return TC_NOT_STAGED;
    store->active = (uint8_t)(1u - store->active);
    store->has_active = true;
    tc_store_discard(store);
    return TC_OK;
}

TC_RARE const tc_trajectory* tc_store_active(const tc_store* store) {
    return store->has_active ? &store->slot[store->active].trajectory : NULL;
}

TC_RARE bool tc_store_is_active(const tc_store* store, uint32_t id, uint32_t crc32) {
    const tc_trajectory* active = tc_store_active(store);
    return active != NULL && active->header.id == id && active->header.crc32 == crc32;
}

TC_RARE const tc_trajectory* tc_store_staged(const tc_store* store) {
    const bool open = store->staged_state == TC_STAGED_FILLING || store->staged_state == TC_STAGED_CHECKED;
    return open ? &store->slot[1u - store->active].trajectory : NULL;
}

tc_parameters* tc_store_stage_parameters(tc_store* store, const tc_parameters* present) {
    if (tc_store_staged(store) != NULL) return NULL;
    store->staged_state = TC_STAGED_PARAMETERS;
    tc_parameters* staged = &staged_memory(store)->parameters;
    tc_copy_bytes(staged, present, sizeof *staged, 0);
    return staged;
}

TC_RARE tc_parameters* tc_store_staged_parameters(tc_store* store) {
    return store->staged_state == TC_STAGED_PARAMETERS ? &staged_memory(store)->parameters : NULL;
}
