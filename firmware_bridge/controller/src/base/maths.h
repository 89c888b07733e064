/* Vectors, quaternions and the few functions we do not take from libm. Internal. */
#ifndef GOSHAWK_CONTROLLER_MATHS_H
#define GOSHAWK_CONTROLLER_MATHS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __FAST_MATH__
#error "-ffast-math takes the rounding out of the sine"
#endif

static const float TC_PI = 3.14159265f;
/* Added to a number below 2^21 it leaves no room for what follows the point: it rounds to whole numbers, and these are
   the lowest bits of the sum. */
static const float TC_WHOLE = 12582912.0f;

static inline uint32_t tc_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* By the exponent bits, which no compiler's idea of NaN can take away. */
static inline bool tc_finite(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

/* Finite, not negative, at most `bound`, by one integer comparison; false for NaN. */
static inline bool tc_up_to(float x, float bound) { return tc_bits(x) <= tc_bits(bound); }

static inline bool tc_all_finite(const float* x, size_t count) {
    bool finite = true;
    for (size_t i = 0; i < count; i++) finite = finite && tc_finite(x[i]);
    return finite;
}

/* Plain comparisons: one compare and one select each; NaN gives `low`. */
static inline float tc_clamp(float x, float low, float high) { return x > low ? (x < high ? x : high) : low; }
static inline float tc_min(float a, float b) { return a < b ? a : b; }
static inline float tc_max(float a, float b) { return a > b ? a : b; }
static inline float tc_abs(float x) { return fabsf(x); } /* one instruction, not a call */

/* Seconds from microseconds, at most 71 minutes: a difference of times needs no 64-bit conversion. */
static inline float tc_seconds(uint64_t us) {
    const uint32_t bounded_us = us < UINT32_MAX ? (uint32_t)us : UINT32_MAX;
    return (float)bounded_us * 1e-6f;
}

static inline float tc_dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline float tc_norm(const float a[3]) { return sqrtf(tc_dot(a, a)); }

static inline void tc_copy(float to[3], const float from[3]) { memcpy(to, from, 3u * sizeof *to); }

static inline void tc_copy4(float to[4], const float from[4]) { memcpy(to, from, 4u * sizeof *to); }

/* `out` is neither input. */
void tc_cross(const float a[3], const float b[3], float out[3]);

/* Hamilton product; `out` is neither input. */
void tc_q_multiply(const float a[4], const float b[4], float out[4]);

/* Of the rotation that is still missing from a to b, conjugate(a) * b in a's own axes: w, and z about their third. */
static inline float tc_q_missing(const float a[4], const float b[4], float* z) {
    *z = a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1];
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

static inline float tc_q_size2(const float q[4]) { return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]; }

void tc_q_normalise(float q[4]);

/* Rows: the body's x, y, z axes in world coordinates. */
void tc_q_axes(const float q[4], float axes[3][3]);

void tc_to_body(float axes[3][3], const float v[3], float out[3]);

void tc_to_world(float axes[3][3], const float v[3], float out[3]);

/* Both to about 1e-7 for |x| <= 1000 rad; larger arguments are the caller's mistake and give 0 and 1. */
void tc_sin_cos(float x, float* sine, float* cosine);
/* In (-pi, pi], to about 3e-7. */
float tc_atan2(float y, float x);
/* The same angle in [-pi, pi], for |angle| <= 1000 rad. */
float tc_wrap(float angle_rad);
/* Hopf yaw of an attitude: the turn about z that is left once the shortest tilt is taken out. */
float tc_q_yaw(const float q[4]);

#endif
