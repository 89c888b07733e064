/* Vectors, quaternions and the few functions we do not take from libm. Internal. */
#ifndef GOSHAWK_CONTROLLER_MATHS_H
#define GOSHAWK_CONTROLLER_MATHS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define TC_PI 3.14159265f

/* By the exponent bits, so that -ffast-math in a host project cannot optimise the check away. */
static inline bool tc_finite(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

static inline bool tc_all_finite(const float* x, size_t count) {
    bool finite = true;
    for (size_t i = 0; i < count; i++) finite = finite && tc_finite(x[i]);
    return finite;
}

/* Plain comparisons: one compare and one select each; NaN gives `low`. */
static inline float tc_clamp(float x, float low, float high) { return x > low ? (x < high ? x : high) : low; }
static inline float tc_min(float a, float b) { return a < b ? a : b; }
static inline float tc_max(float a, float b) { return a > b ? a : b; }
static inline float tc_abs(float x) { return x < 0.0f ? -x : x; }

static inline float tc_dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline float tc_norm(const float a[3]) { return sqrtf(tc_dot(a, a)); }

static inline void tc_copy(float to[3], const float from[3]) {
    for (int i = 0; i < 3; i++) to[i] = from[i];
}

static inline void tc_copy4(float to[4], const float from[4]) {
    for (int i = 0; i < 4; i++) to[i] = from[i];
}

static inline void tc_cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Hamilton product; `out` is neither input. */
static inline void tc_q_multiply(const float a[4], const float b[4], float out[4]) {
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    out[2] = a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3];
    out[3] = a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1];
}

/* conjugate(a) * b: the rotation that is still missing from a to b, in a's own axes. */
static inline void tc_q_difference(const float a[4], const float b[4], float out[4]) {
    out[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    out[1] = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2];
    out[2] = a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3];
    out[3] = a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1];
}

static inline void tc_q_normalise(float q[4]) {
    const float norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const float scale = norm2 > 1e-12f ? 1.0f / sqrtf(norm2) : 0.0f;
    for (int i = 0; i < 4; i++) q[i] *= scale;
    if (scale <= 0.0f) q[0] = 1.0f;
}

static inline void tc_q_axis_x(const float q[4], float out[3]) {
    out[0] = 1.0f - 2.0f * (q[2] * q[2] + q[3] * q[3]);
    out[1] = 2.0f * (q[1] * q[2] + q[0] * q[3]);
    out[2] = 2.0f * (q[1] * q[3] - q[0] * q[2]);
}

static inline void tc_q_axis_y(const float q[4], float out[3]) {
    out[0] = 2.0f * (q[1] * q[2] - q[0] * q[3]);
    out[1] = 1.0f - 2.0f * (q[1] * q[1] + q[3] * q[3]);
    out[2] = 2.0f * (q[2] * q[3] + q[0] * q[1]);
}

static inline void tc_q_axis_z(const float q[4], float out[3]) {
    out[0] = 2.0f * (q[1] * q[3] + q[0] * q[2]);
    out[1] = 2.0f * (q[2] * q[3] - q[0] * q[1]);
    out[2] = 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]);
}

/* World to body: the transpose of the rotation applied to v. */
static inline void tc_to_body(const float q[4], const float v[3], float out[3]) {
    float x[3], y[3], z[3];
    tc_q_axis_x(q, x);
    tc_q_axis_y(q, y);
    tc_q_axis_z(q, z);
    out[0] = tc_dot(x, v);
    out[1] = tc_dot(y, v);
    out[2] = tc_dot(z, v);
}

static inline void tc_to_world(const float q[4], const float v[3], float out[3]) {
    float x[3], y[3], z[3];
    tc_q_axis_x(q, x);
    tc_q_axis_y(q, y);
    tc_q_axis_z(q, z);
    for (int i = 0; i < 3; i++) out[i] = x[i] * v[0] + y[i] * v[1] + z[i] * v[2];
}

/* Both to about 1e-7 for |x| <= 1000 rad; larger arguments are the caller's mistake and give 0 and 1. */
void tc_sin_cos(float x, float* sine, float* cosine);
/* In (-pi, pi], to about 3e-7. */
float tc_atan2(float y, float x);
/* The same angle in [-pi, pi], for |angle| <= 1000 rad. */
float tc_wrap(float angle_rad);
/* Hopf yaw of an attitude: the turn about z that is left once the shortest tilt is taken out. */
float tc_q_yaw(const float q[4]);

#endif
