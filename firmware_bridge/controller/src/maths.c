/* Quaternions; sine, cosine and arc tangent in plain float32 arithmetic: the same bits on every machine. */
#include "maths.h"

TC_RARE void tc_q_normalise(float q[4]) {
    const float norm2 = tc_q_size2(q);
    const float scale = norm2 > 1e-12f ? 1.0f / sqrtf(norm2) : 0.0f;
    for (int i = 0; i < 4; i++) q[i] *= scale;
    if (scale <= 0.0f) q[0] = 1.0f;
}

TC_RARE void tc_q_multiply(const float a[4], const float b[4], float out[4]) {
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    out[2] = a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3];
    out[3] = a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1];
}

TC_RARE void tc_q_difference(const float a[4], const float b[4], float out[4]) {
    out[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    out[1] = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2];
    out[2] = a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3];
    out[3] = a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1];
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

TC_RARE float tc_atan2(float y, float x) {
    const float ay = tc_abs(y);
    const float ax = tc_abs(x);
    const float larger = tc_max(ax, ay);
    if (!(larger > 1e-30f)) return 0.0f;
    const float ratio = tc_min(ax, ay) / larger;
    /* atan(t) = pi/4 + atan((t - 1)/(t + 1)) brings [0, 1] into |u| <= tan(pi/8). */
    const bool upper = ratio > 0.414213562f;
    const float u = upper ? (ratio - 1.0f) / (ratio + 1.0f) : ratio;
    const float u2 = u * u;
    const float series =
        u + u * u2 * (-3.33329491e-1f + u2 * (1.99777106e-1f + u2 * (-1.38776856e-1f + u2 * 8.05374449e-2f)));
    float angle = upper ? 0.785398163f + series : series;
    angle = ay > ax ? 1.57079633f - angle : angle;
    angle = x < 0.0f ? TC_PI - angle : angle;
    return y < 0.0f ? -angle : angle;
}

TC_RARE float tc_wrap(float angle_rad) {
    const float n = (tc_clamp(angle_rad, -1000.0f, 1000.0f) * 0.159154943f + TC_WHOLE) - TC_WHOLE;
    return (angle_rad - n * 6.28125f) - n * 1.93530717e-3f;
}

TC_RARE float tc_q_yaw(const float q[4]) { return tc_wrap(2.0f * tc_atan2(q[3], q[0])); }
