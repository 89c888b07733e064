/* The path clock and the rest-to-rest move. */
#include "goshawk_controller/shaping.h"

#include "../base/maths.h"
#include "setpoint_parts.h"

static const float STANDING_RATE = 1e-6f;         /* the path clock stands: a microsecond of path in a second */
static const float LONGEST_STEP_S = 0.02f;        /* what a late tick may advance the path by */
static const float MOVE_ACCELERATION_M_S2 = 2.0f; /* of a move: a fifth of g tilts by 11 degrees */
static const float MOVE_YAW_RATE_RAD_S = 1.0f;    /* of a move */
static const float SHORTEST_MOVE_S = 0.5f;        /* a shorter one would ask for jerk that nothing needs */

/* The product of two functions of time, each with its first three derivatives (Leibniz). */
static void multiply(const float a[4], const float b[4], float out[4]) {
    out[0] = a[0] * b[0];
    out[1] = a[1] * b[0] + a[0] * b[1];
    out[2] = a[2] * b[0] + 2.0f * a[1] * b[1] + a[0] * b[2];
    out[3] = a[3] * b[0] + 3.0f * (a[2] * b[1] + a[1] * b[2]) + a[0] * b[3];
}

void tc_clock_start(tc_clock* clock, float rate) {
    clock->path_us = 0u;
    clock->path_part_us = 0.0f;
    clock->segment = 0u;
    for (int i = 1; i < 4; i++) clock->rate[i] = 0.0f;
    clock->rate[0] = rate;
    memcpy(clock->flown, clock->rate, sizeof clock->flown);
    clock->target_rate = rate;
    clock->ramp_s = 1.0f;
    clock->ramp_left_s = 0.0f; /* which empties the ramp */
}

void tc_clock_retarget(tc_clock* clock, float target_rate, float ramp_s) {
    /* Over x, which runs from 1 to 0: value, slope and curvature at its beginning, of the cube times the parabola. */
    const float off = clock->rate[0] - target_rate;
    const float slope = -clock->rate[1] * ramp_s - 3.0f * off;
    const float bend = clock->rate[2] * ramp_s * ramp_s - 6.0f * (slope + off);
    clock->ramp[2] = 0.5f * bend;
    clock->ramp[1] = slope - bend;
    clock->ramp[0] = off - clock->ramp[1] - clock->ramp[2];
    clock->target_rate = target_rate;
    clock->ramp_s = ramp_s;
    clock->ramp_left_s = ramp_s;
}

/* The same work whether the rate changes or not. */
static inline void advance_rate(tc_clock* clock, float step_s) {
    clock->ramp_left_s -= step_s;
    if (clock->ramp_left_s <= 0.0f) {
        clock->ramp_left_s = 0.0f;
        for (int i = 0; i < 3; i++) clock->ramp[i] = 0.0f;
    }
    const float inverse = -1.0f / clock->ramp_s; /* x by time */
    const float x = -clock->ramp_left_s * inverse;
    /* The parabola g, x g' and x^2 g'' / 2. */
    const float g2 = x * x * clock->ramp[2], linear = x * clock->ramp[1];
    const float g = clock->ramp[0] + linear + g2, g1 = linear + g2 + g2;
    const float first = inverse * x * x;
    clock->rate[0] = clock->target_rate + x * x * x * g;
    clock->rate[1] = first * (3.0f * g + g1);
    clock->rate[2] = inverse * inverse * x * (6.0f * (g + g1) + g2 + g2);
    clock->rate[3] = inverse * inverse * inverse * (6.0f * g + 18.0f * (g1 + g2));
}

/* At most one segment on, or one back: segments outlast the longest step. */
static void move_cursor(tc_clock* clock, const tc_trajectory* trajectory) {
    const uint32_t last = trajectory->header.segment_count - 1u;
    if (clock->segment < last && clock->path_us >= trajectory->start_us[clock->segment + 1u]) {
        clock->segment++;
    } else if (clock->segment > 0u && clock->path_us < trajectory->start_us[clock->segment]) {
        clock->segment--;
    }
}

void tc_clock_advance(tc_clock* clock, const tc_trajectory* trajectory, const float limit[4], float step_s) {
    const float step = tc_clamp(step_s, 0.0f, LONGEST_STEP_S);
    const float rate_before = clock->flown[0];
    const float slope_before = clock->flown[1];
    advance_rate(clock, step);
    multiply(clock->rate, limit, clock->flown);
    /* Corrected trapezoid: exact for a cubic rate. */
    const float mean =
        0.5f * (rate_before + clock->flown[0]) + step * (slope_before - clock->flown[1]) * (1.0f / 12.0f);
    const float part = tc_max(clock->path_part_us + 1e6f * step * mean, 0.0f);
    const uint32_t whole = (uint32_t)part;
    const uint32_t duration_us = tc_trajectory_duration_us(trajectory);
    clock->path_us += whole;
    clock->path_part_us = part - (float)whole;
    if (clock->path_us >= duration_us) {
        clock->path_us = duration_us;
        clock->path_part_us = 0.0f;
    }
    move_cursor(clock, trajectory);
}

bool tc_clock_standing(const tc_clock* clock) { return clock->ramp_left_s <= 0.0f && clock->rate[0] < STANDING_RATE; }

bool tc_clock_finished(const tc_clock* clock, const tc_trajectory* trajectory) {
    return clock->path_us >= tc_trajectory_duration_us(trajectory);
}

void tc_clock_setpoint(const tc_clock* clock, const tc_trajectory* trajectory, tc_setpoint* out) {
    tc_trajectory_evaluate_running(trajectory, clock->segment, clock->path_us, clock->path_part_us, clock->flown, out);
}

/* The septics over x = left / duration that start (x = 1) with the set-point and its first three derivatives and end
   (x = 0) at rest at the point in their constant terms: the end, and x^4 times a cubic. */
static void lay_out(tc_move* move, const tc_setpoint* from) {
    const float* now = tc_setpoint_read(from);
    const float t = -move->duration_s, t2 = t * t, t3 = t2 * t; /* time by x */
    for (int i = 0; i < TC_AXES; i++) {
        float* c = move->septic[i];
        const float v = now[TC_AXES + i] * t;
        const float g = now[i] - c[0]; /* the cubic and its derivatives at x = 1 */
        const float g1 = v - 4.0f * g;
        const float g2 = now[2 * TC_AXES + i] * t2 - 12.0f * g - 8.0f * g1;
        const float g3 = now[3 * TC_AXES + i] * t3 - 24.0f * g - 36.0f * g1 - 12.0f * g2;
        c[7] = (1.0f / 6.0f) * g3;
        c[6] = 0.5f * (g2 - g3);
        c[5] = g1 - 2.0f * c[6] - 3.0f * c[7];
        c[4] = g - c[5] - c[6] - c[7];
    }
    move->left_s = move->duration_s;
}

void tc_move_start(tc_move* move, const tc_setpoint* from, const float to_world_m[3], float to_yaw_rad,
                   float speed_m_s) {
    float way[3];
    for (int i = 0; i < 3; i++) way[i] = to_world_m[i] - from->position_world_m[i];
    const float length_m = tc_norm(way);
    /* The septic's largest slope and curvature over its mean slope: 35/16 and 7.513. */
    const float by_speed = 2.1875f * length_m / speed_m_s;
    const float by_acceleration = sqrtf(7.513f * length_m / MOVE_ACCELERATION_M_S2);
    const float by_yaw = 2.1875f * tc_abs(to_yaw_rad - from->yaw_rad) / MOVE_YAW_RATE_RAD_S;
    move->duration_s = tc_max(tc_max(by_speed, by_acceleration), tc_max(by_yaw, SHORTEST_MOVE_S));
    for (int i = 0; i < 3; i++) move->septic[i][0] = to_world_m[i];
    move->septic[3][0] = to_yaw_rad;
    lay_out(move, from);
}

/* Where it comes to rest follows from the speed: the mean speed of a stop is half the first. */
void tc_move_stop(tc_move* move, const tc_setpoint* from, float brake_m_s2) {
    const float* now = tc_setpoint_read(from);
    move->duration_s = tc_max(2.0f * tc_norm(from->velocity_world_m_s) / brake_m_s2, SHORTEST_MOVE_S);
    for (int i = 0; i < TC_AXES; i++) move->septic[i][0] = now[i] + 0.5f * move->duration_s * now[TC_AXES + i];
    lay_out(move, from);
}

void tc_move_shift(tc_move* move, const float position_m[3], float yaw_rad) {
    for (int i = 0; i < 3; i++) move->septic[i][0] += position_m[i];
    move->septic[3][0] += yaw_rad;
}

void tc_move_advance(tc_move* move, float step_s) { move->left_s = tc_max(move->left_s - step_s, 0.0f); }

bool tc_move_done(const tc_move* move) { return move->left_s <= 0.0f; }

void tc_move_setpoint(const tc_move* move, tc_setpoint* out) {
    const float per_s = 1.0f / move->duration_s;
    tc_evaluate_polynomials(move->septic, move->left_s * per_s, -per_s, tc_true_time, out);
}
