/* Trajectory slots: evaluation, look-up, CRC. */
#include "goshawk_controller/trajectory.h"

#include "maths.h"

/* One polynomial and its derivatives by repeated Horner; derivative[k] comes out divided by k!. */
static void horner(const float* coefficient, uint32_t count, float s, float derivative[5]) {
    float d0 = coefficient[count - 1u], d1 = 0.0f, d2 = 0.0f, d3 = 0.0f, d4 = 0.0f;
    for (uint32_t i = count - 1u; i > 0u; i--) {
        d4 = d4 * s + d3;
        d3 = d3 * s + d2;
        d2 = d2 * s + d1;
        d1 = d1 * s + d0;
        d0 = d0 * s + coefficient[i - 1u];
    }
    derivative[0] = d0;
    derivative[1] = d1;
    derivative[2] = d2;
    derivative[3] = d3;
    derivative[4] = d4;
}

/* The same for yaw, which needs no more than its second derivative. */
static void horner2(const float* coefficient, uint32_t count, float s, float derivative[3]) {
    float d0 = coefficient[count - 1u], d1 = 0.0f, d2 = 0.0f;
    for (uint32_t i = count - 1u; i > 0u; i--) {
        d2 = d2 * s + d1;
        d1 = d1 * s + d0;
        d0 = d0 * s + coefficient[i - 1u];
    }
    derivative[0] = d0;
    derivative[1] = d1;
    derivative[2] = d2;
}

void tc_trajectory_evaluate(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us, float part_us,
                            tc_setpoint* out) {
    const tc_segment* segment = &trajectory->segment[index];
    const uint32_t count = trajectory->header.coefficient_count;
    const uint32_t start_us = trajectory->start_us[index];
    const uint32_t duration_us = segment->duration_us;
    const uint32_t since_us = time_us > start_us ? time_us - start_us : 0u;
    const uint32_t local_us = since_us < duration_us ? since_us : duration_us;
    const float inverse_us = 1.0f / (float)duration_us;
    /* Centre in integers first: float32 has no room for microseconds in a minute. */
    const int32_t centred_us = 2 * (int32_t)local_us - (int32_t)duration_us;
    const float s = tc_clamp(((float)centred_us + 2.0f * part_us) * inverse_us, -1.0f, 1.0f);
    const float k1 = 2e6f * inverse_us; /* ds/dt */
    const float k2 = k1 * k1, k3 = k2 * k1, k4 = k2 * k2;
    for (int axis = 0; axis < 3; axis++) {
        float d[5];
        horner(segment->coefficient[axis], count, s, d);
        out->position_world_m[axis] = d[0];
        out->velocity_world_m_s[axis] = d[1] * k1;
        out->acceleration_world_m_s2[axis] = 2.0f * d[2] * k2;
        out->jerk_world_m_s3[axis] = 6.0f * d[3] * k3;
        out->snap_world_m_s4[axis] = 24.0f * d[4] * k4;
    }
    float yaw[3];
    horner2(segment->coefficient[3], count, s, yaw);
    out->yaw_rad = yaw[0];
    out->yaw_rate_rad_s = yaw[1] * k1;
    out->yaw_acceleration_rad_s2 = 2.0f * yaw[2] * k2;
}

uint16_t tc_trajectory_find(const tc_trajectory* trajectory, uint32_t time_us) {
    uint32_t low = 0, high = trajectory->header.segment_count; /* the answer is in [low, high) */
    for (int probe = 0; probe < 16 && high - low > 1u; probe++) {
        const uint32_t middle = (low + high) / 2u;
        if (trajectory->start_us[middle] <= time_us) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return (uint16_t)low;
}

uint32_t tc_trajectory_duration_us(const tc_trajectory* trajectory) {
    return trajectory->start_us[trajectory->header.segment_count];
}

static uint32_t crc_u32(uint32_t crc, uint32_t value) {
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    return tc_crc32(crc, bytes, sizeof bytes);
}

uint32_t tc_trajectory_crc32(const tc_trajectory* trajectory) {
    const tc_trajectory_header* header = &trajectory->header;
    const uint32_t counts = (uint32_t)header->segment_count | ((uint32_t)header->coefficient_count << 16) |
                            ((uint32_t)header->link_loss_policy << 24);
    uint32_t crc = crc_u32(crc_u32(0u, header->id), counts);
    for (uint32_t i = 0; i < header->segment_count; i++) {
        const tc_segment* segment = &trajectory->segment[i];
        crc = crc_u32(crc, segment->duration_us);
        for (int axis = 0; axis < TC_AXES; axis++) {
            for (uint32_t j = 0; j < header->coefficient_count; j++) {
                uint32_t bits;
                memcpy(&bits, &segment->coefficient[axis][j], sizeof bits);
                crc = crc_u32(crc, bits);
            }
        }
    }
    return crc;
}
