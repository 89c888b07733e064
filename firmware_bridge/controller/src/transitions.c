/* What the controller observes about itself, and what changes with the state. */
#include "copy.h"
#include "internal.h"
#include "maths.h"

#define RAMP_SHORTEST_S 0.5f
#define RAMP_PEAK 1.875f /* largest slope of the quintic over its mean */
#define APPROACH_M_S 0.7f
#define GROUND_M 0.05f
#define BELOW_GROUND_M 0.4f
#define TOUCH_S 0.25f

static uint32_t low_word(uint64_t time_us) { return (uint32_t)(time_us & 0xffffffffu); }

/* A set-point that stands where the vehicle is: after the loss of everything better. */
static TC_RARE void setpoint_here(tc_controller* c) {
    const tc_estimate* estimate = &c->telemetry.estimate;
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    tc_fill(setpoint, 0, sizeof *setpoint);
    tc_copy(setpoint->position_world_m, estimate->position_world_m);
    setpoint->yaw_rad = tc_q_yaw(estimate->q_world_body);
}

TC_RARE void tc_change_rate(tc_controller* c, float rate) {
    const float speed = tc_norm(c->telemetry.setpoint.velocity_world_m_s) / tc_max(c->clock.rate[0], 0.1f);
    const float change = tc_abs(rate - c->clock.rate[0]);
    const float ramp_s = tc_max(RAMP_PEAK * speed * change / c->parameters.brake_m_s2, RAMP_SHORTEST_S);
    tc_clock_retarget(&c->clock, rate, ramp_s);
}

/* Set-point and attitude reference begin again where the vehicle is. */
static TC_RARE void begin_here(tc_controller* c) {
    setpoint_here(c);
    tc_flatness_reset(&c->telemetry.flatness, c->telemetry.estimate.q_world_body);
}

static TC_RARE void move_to_height(tc_controller* c, float z_m, float speed_m_s) {
    const tc_setpoint* from = &c->telemetry.setpoint;
    const float to[3] = {from->position_world_m[0], from->position_world_m[1], z_m};
    tc_move_start(&c->move, from, to, from->yaw_rad, speed_m_s);
}

static void enter_take_off(tc_controller* c) {
    begin_here(c);
    memset(&c->position, 0, sizeof c->position);
    c->ground_z_m = c->telemetry.setpoint.position_world_m[2];
    move_to_height(c, c->ground_z_m + c->take_off_m, c->parameters.take_off_m_s);
}

static void enter_approach(tc_controller* c) {
    const tc_trajectory* trajectory = tc_store_active(&c->store);
    tc_setpoint start;
    tc_trajectory_evaluate(trajectory, 0, 0u, &start);
    const tc_setpoint* from = &c->telemetry.setpoint;
    const float yaw = from->yaw_rad + tc_wrap(start.yaw_rad - from->yaw_rad);
    tc_move_start(&c->move, from, start.position_world_m, yaw, APPROACH_M_S);
}

static void enter_landing(tc_controller* c) {
    if (c->mission.previous_state == TC_EMERGENCY) {
        begin_here(c);
        tc_copy(c->telemetry.setpoint.velocity_world_m_s, c->telemetry.estimate.velocity_world_m_s);
    }
    tc_move_stop(&c->move, c->parameters.brake_m_s2);
    c->touching_since_us = low_word(c->telemetry.time_us);
}

static TC_RARE void enter(tc_controller* c) {
    const uint8_t from = c->mission.previous_state;
    switch (c->mission.state) {
        case TC_TAKE_OFF:
            enter_take_off(c);
            break;
        case TC_HOLD:
            tc_move_stop(&c->move, c->parameters.brake_m_s2);
            break;
        case TC_APPROACH:
            enter_approach(c);
            break;
        case TC_TRAJECTORY:
            if (from == TC_APPROACH) {
                tc_clock_start(&c->clock, c->time_scale);
            } else {
                tc_change_rate(c, c->time_scale);
            }
            break;
        case TC_PAUSING:
        case TC_STOPPING:
        case TC_ABORTING:
            if (c->clock.target_rate > 0.0f) tc_change_rate(c, 0.0f);
            break;
        case TC_LANDING:
            enter_landing(c);
            break;
        default:
            break;
    }
    c->bad_tilt_since_us = low_word(c->telemetry.time_us);
}

TC_RARE tc_reason tc_post(tc_controller* c, uint8_t event, tc_reason reason) {
    const uint8_t before = c->mission.state;
    const tc_reason result = tc_mission_post(&c->mission, event, reason, low_word(c->telemetry.time_us));
    if (result == TC_OK && c->mission.state != before) enter(c);
    return result;
}

TC_RARE bool tc_inside_fence(const tc_parameters* p, const float position_world_m[3]) {
    bool inside = true;
    for (int i = 0; i < 3 && inside; i++) {
        inside = position_world_m[i] >= p->fence_min_world_m[i] && position_world_m[i] <= p->fence_max_world_m[i];
    }
    return inside;
}

/* Whether it has been so for longer than this. */
static TC_APART bool lasts(const tc_controller* c, uint32_t since_us, float limit_s) {
    return (float)(low_word(c->telemetry.time_us) - since_us) * 1e-6f > limit_s;
}

static void observe_estimate(tc_controller* c, uint8_t faults) {
    if ((faults & TC_FAULT_ATTITUDE_STALE) != 0u) {
        (void)tc_post(c, TC_EVENT_ATTITUDE_LOST, TC_ATTITUDE_STALE);
    } else if ((faults & TC_FAULT_POSITION_STALE) != 0u) {
        const bool bad = (faults & TC_FAULT_POSITION_BAD) != 0u;
        (void)tc_post(c, TC_EVENT_POSITION_LOST, bad ? TC_ESTIMATE_NOT_FINITE : TC_ESTIMATE_STALE);
    } else if (c->mission.state == TC_EMERGENCY && faults == 0u) {
        const float tilt = 1.0f - tc_dot(c->telemetry.flatness.axis, c->axes[2]);
        if (tilt < 0.05f && lasts(c, c->mission.since_us, 0.2f)) {
            (void)tc_post(c, TC_EVENT_POSITION_BACK, TC_ESTIMATE_BACK);
        }
    }
}

static void observe_attitude(tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    const float tilt = 1.0f - tc_dot(c->telemetry.flatness.axis, c->axes[2]);
    if (tilt <= c->tilt_bound) c->bad_tilt_since_us = low_word(c->telemetry.time_us);
    if (lasts(c, c->bad_tilt_since_us, p->tilt_error_s)) (void)tc_post(c, TC_EVENT_TILT, TC_TILT_ERROR);
    if (c->mission.state == TC_EMERGENCY && lasts(c, c->mission.since_us, p->emergency_s)) {
        (void)tc_post(c, TC_EVENT_TIMEOUT, TC_TIMEOUT);
    }
}

static void observe_fence(tc_controller* c) {
    if (!tc_inside_fence(&c->parameters, c->telemetry.estimate.position_world_m)) {
        (void)tc_post(c, TC_EVENT_FENCE, TC_FENCE_BREACH);
    }
}

static void observe_link(tc_controller* c) {
    if (!c->ground_ever_seen) return;
    const tc_parameters* p = &c->parameters;
    if (!lasts(c, c->ground_seen_us, p->link_loss_s)) return;
    uint8_t event = TC_EVENT_LINK_LOST_HOLD;
    if (tc_mission_on_path(c->mission.state)) {
        const tc_trajectory* trajectory = tc_store_active(&c->store);
        const uint8_t policy = trajectory->header.link_loss_policy;
        if (policy == (uint8_t)TC_LINK_LOSS_FINISH && c->mission.state == TC_TRAJECTORY) return;
        if (policy == (uint8_t)TC_LINK_LOSS_LAND) event = TC_EVENT_LINK_LOST_LAND;
    }
    const bool hovering = c->mission.state == TC_HOLD || c->mission.state == TC_PAUSED;
    if (hovering && lasts(c, c->mission.since_us, p->link_hold_s) && lasts(c, c->ground_seen_us, p->link_hold_s)) {
        event = TC_EVENT_LINK_LOST_LAND;
    }
    (void)tc_post(c, event, TC_LINK_LOST);
}

/* On the ground when close to the take-off height and slow, or when the set-point has sunk below a vehicle that stands.
 */
static TC_RARE void observe_landing(tc_controller* c) {
    const tc_estimate* estimate = &c->telemetry.estimate;
    const float setpoint_z_m = c->telemetry.setpoint.position_world_m[2], z_m = estimate->position_world_m[2];
    if (tc_move_done(&c->move)) { /* the stop is over, or the ground was not where it was expected */
        c->busy = true;
        move_to_height(c, tc_min(c->ground_z_m, setpoint_z_m) - BELOW_GROUND_M, c->parameters.landing_m_s);
    }
    const float speed = tc_norm(estimate->velocity_world_m_s);
    const bool low = z_m < c->ground_z_m + GROUND_M && speed < 0.6f;
    const bool stuck = setpoint_z_m < z_m - 0.3f && speed < 0.1f;
    if (!low && !stuck) c->touching_since_us = low_word(c->telemetry.time_us);
    if (lasts(c, c->touching_since_us, TOUCH_S)) (void)tc_post(c, TC_EVENT_TOUCHDOWN, TC_TOUCHDOWN);
}

static void observe_setpoint(tc_controller* c) {
    switch (c->mission.state) {
        case TC_TAKE_OFF:
        case TC_APPROACH:
            if (tc_move_done(&c->move)) (void)tc_post(c, TC_EVENT_REACHED, TC_REACHED);
            break;
        case TC_TRAJECTORY:
        case TC_PAUSING:
        case TC_STOPPING:
        case TC_ABORTING:
            if (tc_clock_finished(&c->clock, tc_store_active(&c->store))) {
                (void)tc_post(c, TC_EVENT_FINISHED, TC_FINISHED);
            } else if (tc_clock_standing(&c->clock)) {
                (void)tc_post(c, TC_EVENT_STANDING_STILL, TC_STANDING_STILL);
            }
            break;
        case TC_LANDING:
            observe_landing(c);
            break;
        default:
            break;
    }
}

/* What takes tenths of a second to matter is looked at by every other tick, the link by every eighth, and nothing of
   that by those two that have enough to do with what the set-point has led to. */
TC_APART void tc_observe(tc_controller* c, uint8_t faults) {
    const bool in_air = tc_mission_in_air(c->mission.state);
    observe_estimate(c, faults);
    const uint8_t before = c->mission.state;
    const bool busy = c->busy;
    c->busy = false;
    observe_setpoint(c);
    if (c->mission.state != before) c->busy = true;
    if (busy || c->busy) return;
    const uint32_t turn = c->telemetry.ticks & 7u;
    if (turn == 7u) {
        observe_link(c);
    } else if (in_air) {
        if ((turn & 1u) == 0u) {
            observe_fence(c);
        } else {
            observe_attitude(c);
        }
    } else {
        /* on the ground neither matters */
    }
}
