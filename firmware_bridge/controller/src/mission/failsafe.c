/* What the controller observes about itself; what lasts some tenths of a second is looked at in every other tick. A
   failsafe is an event that one of these posts. */
#include "../base/maths.h"
#include "internal.h"

static const float BATTERY_FILTER_S = 1.0f; /* the sag of a manoeuvre is no low battery */
static const float UPRIGHT = 0.05f;         /* 1 - cosine of the attitude error at which an emergency may end */
static const float BACK_S = 0.2f;           /* ... once everything has been good for this long */
static const float FALLING_M_S2 = 3.0f;     /* specific force below: nothing carries it */
/* A crash, after ArduPilot's check (30 degrees of attitude error): in the air 30 degrees of error accelerate the body
   by 100 rad/s2, so that half a second without a turn is the ground's doing. */
static const float CRASH_TILT = 0.134f; /* 1 - cos of 30 degrees */
static const float CRASH_RATE_RAD_S = 1.0f;
static const float CRASH_S = 0.5f;
static const float CLOCK_WARNING_S = 5.0f; /* the warning stays after the last fault of the clock */

bool tc_inside_fence(const tc_parameters* p, const float position_world_m[3]) {
    for (int i = 0; i < 3; i++) {
        const float at = position_world_m[i];
        if (!(at >= p->fence_min_world_m[i] && at <= p->fence_max_world_m[i])) return false;
    }
    return true;
}

float tc_clearance(const tc_controller* c) {
    const uint8_t state = c->mission.state;
    const bool planned = tc_mission_on_path(state) || state == TC_APPROACH || state == TC_TAKE_OFF;
    if (!planned) return c->parameters.hold_error_m;
    const tc_trajectory* active = tc_store_active(&c->store);
    return active != NULL && active->header.clearance_m > 0.0f ? active->header.clearance_m : c->parameters.clearance_m;
}

static bool faulty(const tc_controller* c, uint32_t bits) { return (c->telemetry.estimate_faults & bits) != 0u; }

static void observe_attitude_estimate(tc_controller* c) {
    const float bearable_s = c->parameters.estimate_stale_s + c->parameters.gyro_hold_s;
    const bool attitude_stale = faulty(c, TC_FAULT_ATTITUDE_STALE);
    if (faulty(c, TC_FAULT_RATE_STALE) || (attitude_stale && tc_lasts(c, c->attitude.true_us, bearable_s))) {
        (void)tc_post(c, TC_EVENT_ATTITUDE_LOST, TC_ATTITUDE_STALE);
    } else if (attitude_stale) {
        (void)tc_post(c, TC_EVENT_POSITION_LOST, TC_GYRO_ONLY);
    } else {
        /* known */
    }
}

/* `tilt`: 1 - cosine of the attitude error, as far as it is the thrust axis's. */
static void observe_position_estimate(tc_controller* c, float tilt) {
    if (faulty(c, TC_FAULT_POSITION_STALE)) {
        if (c->telemetry.reckoning_s > c->parameters.reckoning_s || !tc_mission_in_air(c->mission.state)) {
            const tc_reason reason = faulty(c, TC_FAULT_POSITION_UNUSABLE) ? TC_ESTIMATE_NOT_FINITE : TC_ESTIMATE_STALE;
            const bool lies = !tc_monitor_believes(c);
            c->monitor.final = lies; /* one that lied for so long is not landed by */
            (void)tc_post(c, TC_EVENT_POSITION_LOST, lies ? (tc_reason)c->monitor.reason : reason);
        }
    } else if (c->mission.state == TC_EMERGENCY) {
        const bool good = tc_lasts(c, c->good_since_us, BACK_S) && tc_lasts(c, c->mission.since_us, BACK_S);
        if (tilt < UPRIGHT && good) (void)tc_post(c, TC_EVENT_POSITION_BACK, TC_ESTIMATE_BACK);
    } else {
        /* known */
    }
}

static void observe_attitude(tc_controller* c, float tilt) {
    const tc_parameters* p = &c->parameters;
    if (tilt <= c->tilt_bound) c->tilt_good_us = c->telemetry.time_us;
    if (tc_lasts(c, c->tilt_good_us, p->tilt_error_s)) (void)tc_post(c, TC_EVENT_TILT, TC_TILT_ERROR);
}

/* A body that neither turns nor comes right, under rotors that would turn it: it lies against something. */
static void observe_crash(tc_controller* c, float tilt) {
    const bool turns = tc_norm(c->telemetry.estimate.rate_body_rad_s) > CRASH_RATE_RAD_S;
    if (tilt <= CRASH_TILT || turns) c->uncrashed_us = c->telemetry.time_us;
    if (tc_lasts(c, c->uncrashed_us, CRASH_S)) (void)tc_post(c, TC_EVENT_CRASHED, TC_CRASHED);
}

/* Where neither vertical velocity nor the accelerometer tells of the ground, time has to. */
static void observe_emergency(tc_controller* c) {
    const bool blind = !c->vertical_velocity && (c->telemetry.estimate.valid & (uint8_t)TC_VALID_SPECIFIC_FORCE) == 0u;
    if (blind && tc_lasts(c, c->mission.since_us, c->parameters.emergency_s)) {
        (void)tc_post(c, TC_EVENT_TIMEOUT, TC_TIMEOUT);
    }
}

/* The box of the trajectory that is or was flown last, and its margin. */
static bool inside_plan(const tc_controller* c) {
    const tc_trajectory* plan = tc_store_active(&c->store);
    const float margin_m = c->parameters.plan_margin_m;
    const bool since = c->mission.state == TC_HOLD && tc_mission_on_path(c->mission.previous_state);
    if (plan == NULL || !(margin_m > 0.0f) || !(since || tc_mission_on_path(c->mission.state))) return true;
    const float* at = c->telemetry.estimate.position_world_m;
    for (int i = 0; i < 3; i++) {
        if (!(at[i] >= plan->least_m[i] - margin_m && at[i] <= plan->most_m[i] + margin_m)) return false;
    }
    return true;
}

static void observe_fence(tc_controller* c) {
    if (!inside_plan(c) || !tc_inside_fence(&c->parameters, c->telemetry.estimate.position_world_m)) {
        (void)tc_post(c, TC_EVENT_FENCE, TC_FENCE_BREACH);
    }
}

/* Why it may not go on with what it flies; a landing goes on as long as it tracks. */
static tc_reason why_land(const tc_controller* c) {
    const uint8_t state = c->mission.state;
    if (state != TC_EMERGENCY && tc_supervisor_gives_up(&c->supervisor, c->telemetry.time_us)) return TC_TRACKING_LOST;
    if (state == TC_LANDING) return TC_OK;
    if (state != TC_TAKE_OFF && tc_stands(c)) return TC_GROUNDED;
    if (c->monitor.drifts) return TC_POSE_DRIFTS;
    return tc_gyro_axis_is_gone(c) ? TC_GYRO_AXIS : TC_OK;
}

static void observe_tracking(tc_controller* c) {
    const bool on_path = tc_mission_on_path(c->mission.state);
    if (on_path && tc_even_tick(c) && tc_norm(c->supervisor.shift) > tc_clearance(c)) {
        (void)tc_post(c, TC_EVENT_RELOCALIZED, TC_RELOCALIZED);
    }
    const tc_reason reason = why_land(c);
    if (reason != TC_OK) (void)tc_post(c, TC_EVENT_TRACKING_LOST, reason);
}

bool tc_falls(const tc_controller* c) {
    const bool felt = (c->telemetry.estimate.valid & (uint8_t)TC_VALID_SPECIFIC_FORCE) != 0u;
    return felt && tc_dot(c->felt_m_s2, c->felt_m_s2) < FALLING_M_S2 * FALLING_M_S2;
}

static void observe_battery(tc_controller* c, float step_s) {
    const tc_parameters* p = &c->parameters;
    const float measured = c->telemetry.estimate.battery_v;
    if (measured > 0.0f) {
        const float pass = step_s / (BATTERY_FILTER_S + step_s);
        c->battery_v = c->battery_v > 0.0f ? c->battery_v + pass * (measured - c->battery_v) : measured;
    }
    const bool in_air = tc_mission_in_air(c->mission.state);
    const bool low = c->battery_v > 0.0f && c->battery_v < p->battery_land_v;
    c->battery_low = low || (c->battery_low && in_air);
    if (c->battery_low && in_air) (void)tc_post(c, TC_EVENT_BATTERY_LOW, TC_BATTERY_LOW);
}

static void observe_link(tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    if (!c->ground_ever_seen || !tc_lasts(c, c->ground_seen_us, p->link_loss_s)) return;
    uint8_t event = TC_EVENT_LINK_LOST_HOLD;
    if (tc_mission_on_path(c->mission.state)) {
        const tc_trajectory* trajectory = tc_store_active(&c->store);
        const uint8_t policy = trajectory->header.link_loss_policy;
        if (policy == (uint8_t)TC_LINK_LOSS_FINISH && c->mission.state == TC_TRAJECTORY) return;
        if (policy == (uint8_t)TC_LINK_LOSS_LAND) event = TC_EVENT_LINK_LOST_LAND;
    }
    const bool hovering = c->mission.state == TC_HOLD || c->mission.state == TC_PAUSED;
    if (hovering && tc_lasts(c, c->mission.since_us, p->link_hold_s) &&
        tc_lasts(c, c->ground_seen_us, p->link_hold_s)) {
        event = TC_EVENT_LINK_LOST_LAND;
    }
    (void)tc_post(c, event, TC_LINK_LOST);
}

static void observe_setpoint(tc_controller* c, float step_s) {
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
            } else {
                /* goes on */
            }
            break;
        case TC_LANDING:
        case TC_EMERGENCY:
            if (tc_landing_observe(c, step_s)) (void)tc_post(c, TC_EVENT_TOUCHDOWN, TC_TOUCHDOWN);
            break;
        default:
            break;
    }
}

static uint8_t warnings(const tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    uint32_t bits = 0;
    if (c->battery_low || (c->battery_v > 0.0f && c->battery_v < p->battery_warn_v)) bits |= TC_WARNING_BATTERY;
    if (c->telemetry.reckoning_s > 0.0f) bits |= TC_WARNING_DEAD_RECKONING;
    if (c->telemetry.refused_ticks > 0u && !tc_lasts(c, c->clock_fault_us, CLOCK_WARNING_S)) bits |= TC_WARNING_CLOCK;
    if (faulty(c, TC_FAULT_ATTITUDE_STALE) && !faulty(c, TC_FAULT_RATE_STALE)) bits |= TC_WARNING_GYRO_ONLY;
    if (c->observer.state == (uint8_t)TC_OBSERVER_NO_ACCELEROMETER) bits |= TC_WARNING_NO_OBSERVER;
    return (uint8_t)bits;
}

void tc_observe(tc_controller* c) {
    const float step_s = tc_seconds(c->step_us), tilt = 1.0f - tc_dot(c->telemetry.flatness.axis, c->axes[2]);
    const bool even = tc_even_tick(c);
    observe_attitude_estimate(c);
    observe_position_estimate(c, tilt);
    observe_setpoint(c, step_s);
    if (even) {
        observe_battery(c, 2.0f * step_s);
        observe_link(c);
    }
    if (tc_moves(c) || tc_falls(c)) c->moved_us = c->telemetry.time_us;
    if (tc_mission_in_air(c->mission.state)) {
        tc_measure_support(c, step_s);
        observe_attitude(c, tilt);
        if (even) {
            observe_fence(c);
        } else {
            observe_crash(c, tilt);
        }
        observe_tracking(c);
        if (c->mission.state == TC_EMERGENCY) observe_emergency(c);
    }
    c->telemetry.warnings = warnings(c);
}
