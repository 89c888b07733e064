/* Polynomials of the four axes, with their derivatives over time: a quarter of a tick goes into these loops. */
#include "goshawk_controller/trajectory.h"
#include "setpoint_parts.h"

/* Value and four derivatives of a polynomial by Horner's scheme; derivative[k] comes out over k!. */
static void derivatives(const float coefficient[TC_MAX_COEFFICIENTS], float x, float derivative[5]) {
    const float* c = coefficient + TC_MAX_COEFFICIENTS - 5;
    float d0 = c[4], d1 = d0; /* each of the first steps begins one derivative */
    d0 = d0 * x + c[3];
    float d2 = d1;
    d1 = d1 * x + d0;
    d0 = d0 * x + c[2];
    float d3 = d2;
    d2 = d2 * x + d1;
    d1 = d1 * x + d0;
    d0 = d0 * x + c[1];
    float d4 = d3;
    d3 = d3 * x + d2;
    d2 = d2 * x + d1;
    d1 = d1 * x + d0;
    d0 = d0 * x + c[0];
    for (int i = TC_MAX_COEFFICIENTS - 6; i >= 0; i--) {
        d4 = d4 * x + d3;
        d3 = d3 * x + d2;
        d2 = d2 * x + d1;
        d1 = d1 * x + d0;
        d0 = d0 * x + coefficient[i];
    }
    derivative[0] = d0;
    derivative[1] = d1;
    derivative[2] = d2;
    derivative[3] = d3;
    derivative[4] = d4;
}

const float tc_true_time[4] = {1.0f, 0.0f, 0.0f, 0.0f};

void tc_evaluate_polynomials(const float coefficient[TC_AXES][TC_MAX_COEFFICIENTS], float x, float x_per_s,
                             const float path_rate[4], tc_setpoint* out) {
    /* Derivatives of x over time; the chain rule takes the path's rate in at the same time. */
    float d[5];
    const float u1 = x_per_s * path_rate[0], u2 = x_per_s * path_rate[1], u3 = x_per_s * path_rate[2];
    const float u4 = x_per_s * path_rate[3], u11 = u1 * u1, u12 = 6.0f * u1 * u2;
    const float a2 = 2.0f * u11, j3 = 6.0f * u11 * u1, s4 = 24.0f * u11 * u11;
    const float s3 = 6.0f * u1 * u12, s2 = 8.0f * u1 * u3 + 6.0f * u2 * u2;
    float* numbers = tc_setpoint_numbers(out);
    for (int axis = 0; axis < TC_AXES; axis++) {
        float* number = &numbers[axis];
        derivatives(coefficient[axis], x, d);
        number[0] = d[0];
        number[TC_AXES] = d[1] * u1;
        number[2 * TC_AXES] = d[2] * a2 + d[1] * u2;
        number[3 * TC_AXES] = d[3] * j3 + d[2] * u12 + d[1] * u3;
        number[4 * TC_AXES] = d[4] * s4 + d[3] * s3 + d[2] * s2 + d[1] * u4;
    }
}
