/* The two slots and the upload that fills one of them. */
#include "../base/maths.h"
#include "goshawk_controller/trajectory.h"
#include "path_check.h"

static const uint32_t LONGEST_US = 3600000000u; /* an hour; 32 bits hold 71 minutes */

static tc_trajectory* staged_slot(tc_store* store) { return &store->slot[1u - store->active]; }

/* The checks of the whole begin at the first segment. */
static void restart_check(tc_store* store) {
    memset(&store->check, 0, sizeof store->check);
    store->check.crc32 = tc_trajectory_header_crc32(&staged_slot(store)->header);
}

void tc_store_init(tc_store* store) { memset(store, 0, sizeof *store); }

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
    if (!tc_finite(header->clearance_m)) return TC_NOT_FINITE;
    if (header->clearance_m < 0.0f || header->clearance_m > TC_MAX_CLEARANCE_M) return TC_OUT_OF_RANGE;
    tc_store_discard(store);
    tc_trajectory* slot = staged_slot(store);
    slot->header = *header;
    memset(&slot->origin, 0, sizeof slot->origin);
    for (uint16_t i = 0; i < header->segment_count; i++) slot->segment[i].duration_us = 0;
    store->staged_state = TC_STAGED_FILLING;
    store->refused_segment = 0;
    restart_check(store);
    return TC_OK;
}

tc_reason tc_store_put_origin(tc_store* store, const tc_origin* origin) {
    if (store->staged_state != TC_STAGED_FILLING) return TC_NO_UPLOAD;
    staged_slot(store)->origin = *origin;
    return TC_OK;
}

bool tc_store_has_segment(const tc_store* store, uint16_t index) {
    const tc_trajectory* slot = tc_store_staged(store);
    return slot != NULL && index < slot->header.segment_count && slot->segment[index].duration_us != 0u;
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
        return reason;
    }
    if (index < store->check.next) restart_check(store); /* it has been counted as it was */
    *held = *segment;
    for (int axis = 0; axis < TC_AXES; axis++) {
        memset(&held->coefficient[axis][count], 0, (TC_MAX_COEFFICIENTS - count) * sizeof(float));
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

/* Notes the first refusal of the check in progress. */
static void refuse(tc_store* store, uint16_t segment, tc_reason reason) {
    if (store->check.reason == (uint8_t)TC_OK && reason != TC_OK) {
        store->check.reason = (uint8_t)reason;
        store->check.refused_segment = segment;
    }
}

/* The box of the whole takes the segment's in: a polynomial of s in [-1, 1] is no further from its constant term than
   its other coefficients add up to. */
static void widen_box(tc_trajectory* slot, uint16_t index) {
    const tc_segment* segment = &slot->segment[index];
    for (int axis = 0; axis < 3; axis++) {
        const float* c = segment->coefficient[axis];
        float reach = 0.0f;
        for (int i = 1; i < TC_MAX_COEFFICIENTS; i++) reach += tc_abs(c[i]);
        const float least = c[0] - reach, most = c[0] + reach;
        slot->least_m[axis] = index == 0u ? least : tc_min(slot->least_m[axis], least);
        slot->most_m[axis] = index == 0u ? most : tc_max(slot->most_m[axis], most);
    }
}

/* Takes the next segment in: where it starts, CRC, join to the one before. */
static void check_next(tc_store* store) {
    tc_trajectory* slot = staged_slot(store);
    tc_store_check* check = &store->check;
    const uint16_t i = check->next;
    const tc_segment* segment = &slot->segment[i];
    if (i == 0u) slot->start_us[0] = 0u;
    const uint64_t end_us = (uint64_t)slot->start_us[i] + segment->duration_us;
    slot->start_us[i + 1u] = end_us > LONGEST_US ? LONGEST_US : (uint32_t)end_us;
    if (end_us > LONGEST_US) refuse(store, i, TC_SEGMENT_DURATION);
    check->crc32 = tc_trajectory_segment_crc32(check->crc32, segment, slot->header.coefficient_count);
    if (i > 0u) refuse(store, i, tc_check_join(slot, i));
    widen_box(slot, i);
    check->next++;
}

void tc_store_check_ahead(tc_store* store) {
    if (store->staged_state != TC_STAGED_FILLING) return;
    for (unsigned i = 0; i < TC_SEGMENTS_PER_CALL && tc_store_has_segment(store, store->check.next); i++) {
        check_next(store);
    }
}

/* The first segment that has not arrived; the segment count when all have. */
static uint16_t first_missing(const tc_store* store) {
    uint16_t i = store->check.next; /* those before it are there */
    while (tc_store_has_segment(store, i)) i++;
    return i;
}

/* What is left when every segment has been taken in. */
static tc_reason check_whole(const tc_store* store) {
    const tc_trajectory* slot = tc_store_staged(store);
    if (store->check.crc32 != slot->header.crc32) return TC_CRC_MISMATCH;
    if (store->check.reason != (uint8_t)TC_OK) return (tc_reason)store->check.reason;
    tc_reason reason = tc_check_ends(slot);
    for (uint32_t i = 0; i < store->sample_count && reason == TC_OK; i++) {
        reason = tc_check_sample(slot, &store->sample[i]);
    }
    return reason;
}

tc_reason tc_store_finish(tc_store* store) {
    if (store->staged_state == TC_STAGED_CHECKED) return TC_OK;
    if (store->staged_state != TC_STAGED_FILLING) return TC_NO_UPLOAD;
    const uint16_t count = staged_slot(store)->header.segment_count;
    const uint16_t missing = first_missing(store);
    if (missing < count) {
        store->refused_segment = missing;
        return TC_SEGMENTS_MISSING;
    }
    if (store->check.next < count) {
        tc_store_check_ahead(store);
        return TC_BUSY;
    }
    const tc_reason reason = check_whole(store);
    const bool at_a_segment = reason != TC_OK && reason == (tc_reason)store->check.reason;
    store->refused_segment = at_a_segment ? store->check.refused_segment : 0u;
    if (reason == TC_OK) store->staged_state = TC_STAGED_CHECKED;
    return reason;
}

tc_reason tc_store_activate(tc_store* store, uint32_t id, uint32_t crc32) {
    const tc_trajectory* staged = tc_store_staged(store);
    const bool ready =
        store->staged_state == TC_STAGED_CHECKED && staged->header.id == id && staged->header.crc32 == crc32;
    if (tc_store_is_active(store, id, crc32)) {
        if (ready) store->slot[store->active].origin = staged->origin; /* it may have got another name */
        return TC_OK;
    }
    if (!ready) return TC_NOT_STAGED;
    store->active = (uint8_t)(1u - store->active);
    store->has_active = true;
    tc_store_discard(store);
    return TC_OK;
}

const tc_trajectory* tc_store_active(const tc_store* store) {
    return store->has_active ? &store->slot[store->active] : NULL;
}

bool tc_store_is_active(const tc_store* store, uint32_t id, uint32_t crc32) {
    const tc_trajectory* active = tc_store_active(store);
    return active != NULL && active->header.id == id && active->header.crc32 == crc32;
}

const tc_trajectory* tc_store_staged(const tc_store* store) {
    const bool open = store->staged_state == TC_STAGED_FILLING || store->staged_state == TC_STAGED_CHECKED;
    return open ? &store->slot[1u - store->active] : NULL;
}
