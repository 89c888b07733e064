/* The path clock and the rest-to-rest move. */
#include "goshawk_controller/shaping.h"

#include "maths.h"

#define STANDING_RATE 1e-6f
#define LONGEST_STEP_S 0.02f
#define MOVE_ACCELERATION_M_S2 2.0f
#define MOVE_YAW_RATE_RAD_S 1.0f
#define NOT_LAID_OUT -1.0f /* as time elapsed: the septics are not yet those of this move */

void tc_clock_start(tc_clock* clock, float rate) {
    memset(clock, 0, sizeof *clock);
    clock->rate[0] = rate;
    clock->target_rate = rate;
}

/* The quintic over u in [0, 1] with given value, slope and curvature (per u) at 0, ending flat at `end`. */
static void flat_ending_quintic(float value, float slope, float curvature, float end, float out[6]) {
    const float d = end - value - slope - 0.5f * curvature;
    const float d1 = -slope - curvature;
    const float d2 = -curvature;
    out[0] = value;
    out[1] = slope;
    out[2] = 0.5f * curvature;
    out[3] = 10.0f * d - 4.0f * d1 + 0.5f * d2;
    out[4] = -15.0f * d + 7.0f * d1 - d2;
    out[5] = 6.0f * d - 3.0f * d1 + 0.5f * d2;
}

void tc_clock_retarget(tc_clock* clock, float target_rate, float ramp_s) {
    flat_ending_quintic(clock->rate[0], clock->rate[1] * ramp_s, clock->rate[2] * ramp_s * ramp_s, target_rate,
                        clock->ramp_quintic);
    clock->target_rate = target_rate;
    clock->ramp_s = ramp_s;
    clock->ramp_elapsed_s = 0.0f;
}

static void advance_rate(tc_clock* clock, float step_s) {
    clock->ramp_elapsed_s += step_s;
    if (clock->ramp_elapsed_s >= clock->ramp_s) {
        clock->ramp_s = 0.0f;
        clock->rate[0] = clock->target_rate;
        clock->rate[1] = 0.0f;
        clock->rate[2] = 0.0f;
        clock->rate[3] = 0.0f;
        return;
    }
    const float inverse = 1.0f / clock->ramp_s;
    const float u = clock->ramp_elapsed_s * inverse;
    float d0 = clock->ramp_quintic[5], d1 = 0.0f, d2 = 0.0f, d3 = 0.0f;
    for (int i = 4; i >= 0; i--) {
        d3 = d3 * u + d2;
        d2 = d2 * u + d1;
        d1 = d1 * u + d0;
        d0 = d0 * u + clock->ramp_quintic[i];
    }
    clock->rate[0] = d0;
    clock->rate[1] = d1 * inverse;
    clock->rate[2] = 2.0f * d2 * inverse * inverse;
    clock->rate[3] = 6.0f * d3 * inverse * inverse * inverse;
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

void tc_clock_advance(tc_clock* clock, const tc_trajectory* trajectory, float step_s) {
    const float step = tc_clamp(step_s, 0.0f, LONGEST_STEP_S);
    const float rate_before = clock->rate[0];
    const float slope_before = clock->rate[1];
    if (clock->ramp_s > 0.0f) advance_rate(clock, step);
    /* Corrected trapezoid: exact for a cubic rate. */
    const float mean = 0.5f * (rate_before + clock->rate[0]) + step * (slope_before - clock->rate[1]) * (1.0f / 12.0f);
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

bool tc_clock_standing(const tc_clock* clock) { return clock->ramp_s <= 0.0f && clock->rate[0] < STANDING_RATE; }

bool tc_clock_finished(const tc_clock* clock, const tc_trajectory* trajectory) {
    return clock->path_us >= tc_trajectory_duration_us(trajectory);
}

void tc_clock_setpoint(const tc_clock* clock, const tc_trajectory* trajectory, tc_setpoint* out) {
    tc_trajectory_evaluate_running(trajectory, clock->segment, clock->path_us, clock->path_part_us, clock->rate, out);
}

/* The septic over u in [0, 1] that starts with given value and first three derivatives (per u) and ends at rest. */
static inline void resting_septic(float p, float v, float a, float j, float end, float out[8]) {
    const float way = end - p;
    out[0] = p;
    out[1] = v;
    out[2] = 0.5f * a;
    out[3] = (1.0f / 6.0f) * j;
    out[4] = 35.0f * way - 20.0f * v - 5.0f * a - (2.0f / 3.0f) * j;
    out[5] = -84.0f * way + 45.0f * v + 10.0f * a + j;
    out[6] = 70.0f * way - 36.0f * v - 7.5f * a - (2.0f / 3.0f) * j;
    out[7] = -20.0f * way + 10.0f * v + 2.0f * a + out[3];
}

/* The work of a new move is left to its first step: the tick that orders it has evaluated another set-point already. */
static void order(tc_move* move, const float to_world_m[3], float to_yaw_rad, float duration_s) {
    tc_copy(move->to, to_world_m);
    move->to[3] = to_yaw_rad;
    move->duration_s = duration_s;
    move->elapsed_s = NOT_LAID_OUT;
}

static void lay_out(tc_move* move, const tc_setpoint* from) {
    const float t = move->duration_s;
    for (int i = 0; i < 3; i++) {
        resting_septic(from->position_world_m[i], from->velocity_world_m_s[i] * t,
                       from->acceleration_world_m_s2[i] * t * t, from->jerk_world_m_s3[i] * t * t * t, move->to[i],
                       move->septic[i]);
    }
    resting_septic(from->yaw_rad, from->yaw_rate_rad_s * t, from->yaw_acceleration_rad_s2 * t * t, 0.0f, move->to[3],
                   move->septic[3]);
    move->elapsed_s = 0.0f;
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
    order(move, to_world_m, to_yaw_rad, tc_max(tc_max(by_speed, by_acceleration), tc_max(by_yaw, 0.5f)));
}

void tc_move_stop(tc_move* move, const tc_setpoint* from, float brake_m_s2) {
    const float speed = tc_norm(from->velocity_world_m_s);
    const float duration_s = tc_max(2.0f * speed / brake_m_s2, 0.5f), half_s = 0.5f * duration_s;
    float to[3];
    for (int i = 0; i < 3; i++) to[i] = from->position_world_m[i] + half_s * from->velocity_world_m_s[i];
    order(move, to, from->yaw_rad + half_s * from->yaw_rate_rad_s, duration_s);
}

void tc_move_advance(tc_move* move, const tc_setpoint* from, float step_s) {
    if (move->elapsed_s < 0.0f) lay_out(move, from);
    move->elapsed_s = tc_min(move->elapsed_s + step_s, move->duration_s);
}

bool tc_move_done(const tc_move* move) { return move->elapsed_s >= move->duration_s; }

void tc_move_setpoint(const tc_move* move, tc_setpoint* out) {
    const float k1 = 1.0f / move->duration_s;
    const float u = move->elapsed_s * k1;
    const float k2 = k1 * k1, k3 = k2 * k1, k4 = k2 * k2;
    for (int axis = 0; axis < TC_AXES; axis++) {
        const float* c = move->septic[axis];
        float d0 = c[7], d1 = 0.0f, d2 = 0.0f, d3 = 0.0f, d4 = 0.0f;
        for (int i = 6; i >= 0; i--) {
            d4 = d4 * u + d3;
            d3 = d3 * u + d2;
            d2 = d2 * u + d1;
            d1 = d1 * u + d0;
            d0 = d0 * u + c[i];
        }
        if (axis == 3) {
            out->yaw_rad = d0;
            out->yaw_rate_rad_s = d1 * k1;
            out->yaw_acceleration_rad_s2 = 2.0f * d2 * k2;
        } else {
            out->position_world_m[axis] = d0;
            out->velocity_world_m_s[axis] = d1 * k1;
            out->acceleration_world_m_s2[axis] = 2.0f * d2 * k2;
            out->jerk_world_m_s3[axis] = 6.0f * d3 * k3;
            out->snap_world_m_s4[axis] = 24.0f * d4 * k4;
        }
    }
}
