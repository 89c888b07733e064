/* Trajectory slots: evaluation, look-up, CRC. */
#include "goshawk_controller/trajectory.h"

#include "maths.h"
#include "setpoint_parts.h"

/* Derivatives of a polynomial at x by repeated synthetic division, with x divided out: the coefficients are multiplied
   by powers of x first, so that only additions are left (Shaw and Traub 1974). derivative[k] comes out times x^k / k!.
 */
static inline void derivatives(const float coefficient[TC_MAX_COEFFICIENTS], const float power[TC_MAX_COEFFICIENTS],
                               float derivative[5]) {
    float sum[TC_MAX_COEFFICIENTS];
    sum[0] = coefficient[0];
    for (int i = 1; i < TC_MAX_COEFFICIENTS; i++) sum[i] = coefficient[i] * power[i];
    for (int k = 0; k < 5; k++) {
        for (int i = TC_MAX_COEFFICIENTS - 2; i >= k; i--) sum[i] += sum[i + 1];
        derivative[k] = sum[k];
    }
}

/* Closer than this to zero x is taken to be this: 0.1 mm at 12 m/s in the longest segment, and nothing to speak of in
   others. Division by the powers of x stays within float32. */
#define SMALLEST_X 2.4e-7f

const float tc_true_time[4] = {1.0f, 0.0f, 0.0f, 0.0f};

TC_APART void tc_evaluate_polynomials(const float coefficient[TC_AXES][TC_MAX_COEFFICIENTS], float x, float x_per_s,
                                      const float path_rate[4], tc_setpoint* out) {
    float power[TC_MAX_COEFFICIENTS], d[5];
    power[0] = 1.0f;
    power[1] = tc_abs(x) > SMALLEST_X ? x : SMALLEST_X;
    for (int i = 2; i < TC_MAX_COEFFICIENTS; i++) power[i] = power[i - 1] * power[1];
    /* Derivatives of x over x by time; the chain rule takes the path's rate in at the same time. */
    const float per_s = x_per_s / power[1];
    const float u1 = per_s * path_rate[0], u2 = per_s * path_rate[1], u3 = per_s * path_rate[2];
    const float u4 = per_s * path_rate[3], u11 = u1 * u1, u12 = 6.0f * u1 * u2;
    const float a2 = 2.0f * u11, j3 = 6.0f * u11 * u1, s4 = 24.0f * u11 * u11;
    const float s3 = 6.0f * u1 * u12, s2 = 8.0f * u1 * u3 + 6.0f * u2 * u2;
    float* numbers = tc_setpoint_numbers(out);
    for (int axis = 0; axis < TC_AXES; axis++) {
        float* number = &numbers[axis];
        derivatives(coefficient[axis], power, d);
        number[0] = d[0];
        number[TC_AXES] = d[1] * u1;
        number[2 * TC_AXES] = d[2] * a2 + d[1] * u2;
        number[3 * TC_AXES] = d[3] * j3 + d[2] * u12 + d[1] * u3;
        number[4 * TC_AXES] = d[4] * s4 + d[3] * s3 + d[2] * s2 + d[1] * u4;
    }
}

TC_APART void tc_trajectory_evaluate_running(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us,
                                             float part_us, const float path_rate[4], tc_setpoint* out) {
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

TC_RARE void tc_trajectory_evaluate(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us,
                                    tc_setpoint* out) {
    tc_trajectory_evaluate_running(trajectory, index, time_us, 0.0f, tc_true_time, out);
}

TC_RARE uint16_t tc_trajectory_find(const tc_trajectory* trajectory, uint32_t time_us) {
    uint16_t index = 0;
    while (index + 1u < trajectory->header.segment_count && trajectory->start_us[index + 1u] <= time_us) index++;
    return index;
}

uint32_t tc_trajectory_duration_us(const tc_trajectory* trajectory) {
    return trajectory->start_us[trajectory->header.segment_count];
}

TC_RARE uint32_t tc_crc32_u32(uint32_t crc, uint32_t value) {
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    return tc_crc32(crc, bytes, sizeof bytes);
}

TC_RARE uint32_t tc_trajectory_crc32(const tc_trajectory* trajectory) {
    const tc_trajectory_header* header = &trajectory->header;
    const uint32_t counts = (uint32_t)header->segment_count | ((uint32_t)header->coefficient_count << 16) |
                            ((uint32_t)header->link_loss_policy << 24);
    uint32_t crc = tc_crc32_u32(tc_crc32_u32(0u, header->id), counts);
    for (uint32_t i = 0; i < header->segment_count; i++) {
        const tc_segment* segment = &trajectory->segment[i];
        crc = tc_crc32_u32(crc, segment->duration_us);
        for (int axis = 0; axis < TC_AXES; axis++) {
            for (uint32_t j = 0; j < header->coefficient_count; j++) {
                crc = tc_crc32_u32(crc, tc_bits(segment->coefficient[axis][j]));
            }
        }
    }
    return crc;
}
