/* What is prepared when the state of the mission changes. */
#include "../base/maths.h"
#include "internal.h"

static const float RAMP_SHORTEST_S = 0.5f; /* a faster change of the rate would be felt as jerk */
static const float RAMP_PEAK = 1.875f;     /* largest slope of the quintic over its mean */
static const float APPROACH_M_S = 0.7f;    /* to the start of a path: slow, as no plan has checked that way */

void tc_change_rate(tc_controller* c, float rate) {
    const float speed = tc_norm(c->telemetry.setpoint.velocity_world_m_s) / tc_max(c->clock.flown[0], 0.1f);
    const float change = tc_abs(rate - c->clock.rate[0]);
    const float ramp_s = tc_max(RAMP_PEAK * speed * change / c->parameters.brake_m_s2, RAMP_SHORTEST_S);
    tc_clock_retarget(&c->clock, rate, ramp_s);
}

void tc_setpoint_here(tc_controller* c) {
    const tc_estimate* estimate = &c->telemetry.estimate;
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    memset(setpoint, 0, sizeof *setpoint);
    tc_copy(setpoint->position_world_m, estimate->position_world_m);
    tc_copy(setpoint->velocity_world_m_s, estimate->velocity_world_m_s);
    setpoint->yaw_rad = tc_q_yaw(estimate->q_world_body);
    tc_flatness_reset(&c->telemetry.flatness, estimate->q_world_body);
}

static void enter_take_off(tc_controller* c) {
    tc_setpoint_here(c);
    tc_setpoint* from = &c->telemetry.setpoint;
    memset(from->velocity_world_m_s, 0, sizeof from->velocity_world_m_s);
    memset(&c->position, 0, sizeof c->position);
    const float to[3] = {from->position_world_m[0], from->position_world_m[1],
                         from->position_world_m[2] + c->take_off_m};
    tc_move_start(&c->move, from, to, from->yaw_rad, c->parameters.take_off_m_s);
}

static void enter_approach(tc_controller* c) {
    const tc_trajectory* trajectory = tc_store_active(&c->store);
    tc_setpoint start;
    tc_trajectory_evaluate(trajectory, 0, 0u, &start);
    const tc_setpoint* from = &c->telemetry.setpoint;
    const float yaw = from->yaw_rad + tc_wrap(start.yaw_rad - from->yaw_rad);
    tc_move_start(&c->move, from, start.position_world_m, yaw, APPROACH_M_S);
}

/* A relocalization during the approach has moved its end: the path begins with that shift. */
static void enter_trajectory(tc_controller* c) {
    if (c->mission.previous_state != TC_APPROACH) {
        tc_change_rate(c, c->time_scale);
        return;
    }
    tc_setpoint start;
    float shift[3];
    static const float none[3] = {0.0f, 0.0f, 0.0f};
    const tc_setpoint* now = &c->telemetry.setpoint;
    tc_trajectory_evaluate(tc_store_active(&c->store), 0, 0u, &start);
    for (int i = 0; i < 3; i++) shift[i] = now->position_world_m[i] - start.position_world_m[i];
    tc_clock_start(&c->clock, c->time_scale);
    tc_supervisor_shift(&c->supervisor, shift, none, tc_wrap(now->yaw_rad - start.yaw_rad));
}

static void enter_landing(tc_controller* c) {
    const uint8_t from = c->mission.previous_state;
    const bool anew = from == TC_EMERGENCY || c->mission.reason == (uint8_t)TC_TRACKING_LOST ||
                      c->mission.reason == (uint8_t)TC_GROUNDED || c->mission.reason == (uint8_t)TC_FENCE_BREACH;
    if (anew) tc_setpoint_here(c); /* the set-point is not where the vehicle is */
    tc_move_stop(&c->move, &c->telemetry.setpoint, c->parameters.brake_m_s2);
    tc_landing_begin(c);
}

static void enter(tc_controller* c) {
    const uint64_t now_us = c->telemetry.time_us;
    c->tilt_good_us = now_us;
    c->uncrashed_us = now_us;
    c->landing.stage = (uint8_t)TC_LANDING_NONE;
    if (!tc_mission_on_path(c->mission.state) || c->mission.previous_state == TC_APPROACH) {
        tc_supervisor_reset(&c->supervisor, now_us);
    }
    switch (c->mission.state) {
        case TC_TAKE_OFF:
            enter_take_off(c);
            break;
        case TC_HOLD:
            tc_move_stop(&c->move, &c->telemetry.setpoint, c->parameters.brake_m_s2);
            break;
        case TC_APPROACH:
            enter_approach(c);
            break;
        case TC_TRAJECTORY:
            enter_trajectory(c);
            break;
        case TC_PAUSING:
        case TC_STOPPING:
        case TC_ABORTING:
            if (c->clock.target_rate > 0.0f) tc_change_rate(c, 0.0f);
            break;
        case TC_LANDING:
            enter_landing(c);
            break;
        case TC_EMERGENCY:
            tc_landing_begin(c);
            break;
        default:
            break;
    }
}

tc_reason tc_post(tc_controller* c, uint8_t event, tc_reason reason) {
    const uint8_t before = c->mission.state;
    const tc_reason result = tc_mission_post(&c->mission, event, reason, c->telemetry.time_us);
    if (result == TC_OK && c->mission.state != before) enter(c);
    return result;
}
