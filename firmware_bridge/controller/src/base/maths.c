/* Quaternions; sine, cosine and arc tangent in plain float32 arithmetic: the same bits on every machine. */
#include "maths.h"

void tc_cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

void tc_to_body(float axes[3][3], const float v[3], float out[3]) {
    const float x = v[0], y = v[1], z = v[2];
    out[0] = axes[0][0] * x + axes[0][1] * y + axes[0][2] * z;
    out[1] = axes[1][0] * x + axes[1][1] * y + axes[1][2] * z;
    out[2] = axes[2][0] * x + axes[2][1] * y + axes[2][2] * z;
}

void tc_to_world(float axes[3][3], const float v[3], float out[3]) {
    const float x = v[0], y = v[1], z = v[2];
    out[0] = axes[0][0] * x + axes[1][0] * y + axes[2][0] * z;
    out[1] = axes[0][1] * x + axes[1][1] * y + axes[2][1] * z;
    out[2] = axes[0][2] * x + axes[1][2] * y + axes[2][2] * z;
}

void tc_q_axes(const float q[4], float axes[3][3]) {
    const float x = 2.0f * q[1], y = 2.0f * q[2], z = 2.0f * q[3];
    const float wx = q[0] * x, wy = q[0] * y, wz = q[0] * z;
    const float xx = q[1] * x, xy = q[1] * y, xz = q[1] * z, yy = q[2] * y, yz = q[2] * z, zz = q[3] * z;
    axes[0][0] = 1.0f - (yy + zz);
    axes[0][1] = xy + wz;
    axes[0][2] = xz - wy;
    axes[1][0] = xy - wz;
    axes[1][1] = 1.0f - (xx + zz);
    axes[1][2] = yz + wx;
    axes[2][0] = xz + wy;
    axes[2][1] = yz - wx;
    axes[2][2] = 1.0f - (xx + yy);
}

void tc_q_normalise(float q[4]) {
    const float norm2 = tc_q_size2(q);
    const float scale = norm2 > 1e-12f ? 1.0f / sqrtf(norm2) : 0.0f;
    for (int i = 0; i < 4; i++) q[i] *= scale;
    if (scale <= 0.0f) q[0] = 1.0f;
}

void tc_q_multiply(const float a[4], const float b[4], float out[4]) {
    out[0] = a[0] * b[0] - (a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
    out[1] = (a[2] * b[3] - a[3] * b[2]) + (a[1] * b[0] + a[0] * b[1]);
    out[2] = (a[3] * b[1] - a[1] * b[3]) + (a[2] * b[0] + a[0] * b[2]);
    out[3] = (a[1] * b[2] - a[2] * b[1]) + (a[3] * b[0] + a[0] * b[3]);
}

/* pi/2 in three parts (Cody and Waite): the first two have so few bits that their products with the turn are exact. */
static float reduce(float x, uint32_t* quadrant) {
    const float shifted = x * 0.636619772f + TC_WHOLE;
    const float k = shifted - TC_WHOLE;
    *quadrant = tc_bits(shifted);
    return ((x - k * 1.5703125f) - k * 4.83751297e-4f) - k * 7.54978942e-8f;
}

void tc_sin_cos(float x, float* sine, float* cosine) {
    const bool usable = tc_abs(x) <= 1000.0f; /* false for NaN */
    uint32_t quadrant;
    const float r = reduce(usable ? x : 0.0f, &quadrant);
    const float r2 = r * r;
    /* Minimax on [-pi/4, pi/4], after Cephes' sinf and cosf polynomials. */
    const float s = r + r * r2 * (-1.66666546e-1f + r2 * (8.33216087e-3f + r2 * -1.95152959e-4f));
    const float c = 1.0f - 0.5f * r2 + r2 * r2 * (4.16666456e-2f + r2 * (-1.38873163e-3f + r2 * 2.44331571e-5f));
    const bool swapped = (quadrant & 1u) != 0u;
    const bool sine_negative = (quadrant & 2u) != 0u;
    const bool cosine_negative = ((quadrant + 1u) & 2u) != 0u;
    const float a = swapped ? c : s;
    const float b = swapped ? s : c;
    *sine = sine_negative ? -a : a;
    *cosine = cosine_negative ? -b : b;
}

/* By Newton's method on sine and cosine: from 90 degrees off, the error goes 1.57, 0.57, 0.031, 5e-6 rad, 0. */
float tc_atan2(float y, float x) {
    const float size = sqrtf(x * x + y * y);
    if (!(size > 1e-15f)) return 0.0f;
    float angle = y < 0.0f ? -0.5f * TC_PI : 0.5f * TC_PI;
    for (int i = 0; i < 5; i++) {
        float sine, cosine;
        tc_sin_cos(angle, &sine, &cosine);
        angle += (y * cosine - x * sine) / size;
    }
    return angle;
}

float tc_wrap(float angle_rad) {
    const float n = (tc_clamp(angle_rad, -1000.0f, 1000.0f) * 0.159154943f + TC_WHOLE) - TC_WHOLE;
    return (angle_rad - n * 6.28125f) - n * 1.93530717e-3f;
}

float tc_q_yaw(const float q[4]) { return tc_wrap(2.0f * tc_atan2(q[3], q[0])); }
