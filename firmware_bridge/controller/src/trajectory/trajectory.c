/* Trajectory slots: evaluation, look-up, CRC. */
#include "goshawk_controller/trajectory.h"

#include "../base/maths.h"

void tc_trajectory_evaluate_running(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us, float part_us,
                                    const float path_rate[4], tc_setpoint* out) {
    const tc_segment* segment = &trajectory->segment[index];
    const uint32_t start_us = trajectory->start_us[index];
    const uint32_t duration_us = segment->duration_us;
    const uint32_t since_us = time_us > start_us ? time_us - start_us : 0u;
    const uint32_t local_us = since_us < duration_us ? since_us : duration_us;
    const float inverse_us = 1.0f / (float)duration_us;
    /* Centre in integers first: float32 has no room for microseconds in a minute. */
    const int32_t centred_us = 2 * (int32_t)local_us - (int32_t)duration_us;
    const float s = tc_min(((float)centred_us + 2.0f * part_us) * inverse_us, 1.0f);
    tc_evaluate_polynomials(segment->coefficient, s, 2e6f * inverse_us, path_rate, out);
}

void tc_trajectory_evaluate(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us, tc_setpoint* out) {
    tc_trajectory_evaluate_running(trajectory, index, time_us, 0.0f, tc_true_time, out);
}

uint16_t tc_trajectory_find(const tc_trajectory* trajectory, uint32_t time_us) {
    uint16_t index = 0;
    while (index + 1u < trajectory->header.segment_count && trajectory->start_us[index + 1u] <= time_us) index++;
    return index;
}

uint32_t tc_trajectory_duration_us(const tc_trajectory* trajectory) {
    return trajectory->start_us[trajectory->header.segment_count];
}

uint32_t tc_trajectory_header_crc32(const tc_trajectory_header* header) {
    const uint32_t counts = (uint32_t)header->segment_count | ((uint32_t)header->coefficient_count << 16) |
                            ((uint32_t)header->link_loss_policy << 24);
    const uint32_t crc = tc_crc32_u32(tc_crc32_u32(0u, header->id), counts);
    return tc_crc32_u32(crc, tc_bits(header->clearance_m));
}

uint32_t tc_trajectory_segment_crc32(uint32_t crc, const tc_segment* segment, uint32_t coefficient_count) {
    crc = tc_crc32_u32(crc, segment->duration_us);
    for (int axis = 0; axis < TC_AXES; axis++) {
        for (uint32_t j = 0; j < coefficient_count; j++) {
            crc = tc_crc32_u32(crc, tc_bits(segment->coefficient[axis][j]));
        }
    }
    return crc;
}

uint32_t tc_trajectory_crc32(const tc_trajectory* trajectory) {
    uint32_t crc = tc_trajectory_header_crc32(&trajectory->header);
    for (uint32_t i = 0; i < trajectory->header.segment_count; i++) {
        crc = tc_trajectory_segment_crc32(crc, &trajectory->segment[i], trajectory->header.coefficient_count);
    }
    return crc;
}
