/* What the ground may ask for, each with its guard. Refusals change nothing. */
#include "../base/maths.h"
#include "internal.h"

static const float LEVEL = 0.3f;               /* 1 - cos(tilt): arming is refused beyond 45 degrees */
static const float STILL_S = 0.2f;             /* it has not moved for this long */
static const float SMALLEST_TIME_SCALE = 0.1f; /* ten times as long as planned */

/* By pose, gyro and accelerometer: whoever carries it, or a fall, shows. */
static tc_reason at_rest(const tc_controller* c) {
    if (tc_falls(c)) return TC_FALLING;
    return c->moved_us == 0u || tc_lasts(c, c->moved_us, STILL_S) ? TC_OK : TC_MOVING;
}

tc_reason tc_arming_check(const tc_controller* c) {
    const uint32_t faults = c->telemetry.estimate_faults;
    const uint32_t position = (uint32_t)TC_FAULT_POSITION_UNUSABLE | TC_FAULT_POSITION_STALE;
    if (!c->configured) return TC_NOT_CONFIGURED;
    if (c->telemetry.ticks == 0u || (faults & ~position) != 0u) return TC_ATTITUDE_STALE;
    if (faults != 0u) return TC_ESTIMATE_STALE;
    if (1.0f - c->axes[2][2] > LEVEL) return TC_TILT_ERROR;
    const tc_reason rest = at_rest(c);
    if (rest != TC_OK) return rest;
    if (c->battery_v > 0.0f && c->battery_v < c->parameters.battery_arm_v) return TC_BATTERY_LOW;
    return tc_inside_fence(&c->parameters, c->telemetry.estimate.position_world_m) ? TC_OK : TC_FENCE_BREACH;
}

static tc_reason guard_take_off(const tc_controller* c, float height_m) {
    if (height_m < TC_LOWEST_TAKE_OFF_M || height_m > TC_HIGHEST_TAKE_OFF_M) return TC_OUT_OF_RANGE;
    if (c->telemetry.estimate_faults != 0u) return TC_ESTIMATE_STALE;
    if (1.0f - c->axes[2][2] > LEVEL) return TC_TILT_ERROR;
    const tc_reason rest = at_rest(c);
    if (rest != TC_OK) return rest;
    float top[3];
    tc_copy(top, c->telemetry.estimate.position_world_m);
    top[2] += height_m;
    return tc_inside_fence(&c->parameters, top) ? TC_OK : TC_FENCE_BREACH;
}

static tc_reason guard_start(const tc_controller* c) {
    const tc_trajectory* trajectory = tc_store_active(&c->store);
    if (trajectory == NULL) return TC_NO_TRAJECTORY;
    if (c->mission.state != TC_HOLD) return TC_WRONG_STATE;
    tc_setpoint start;
    float gap[3];
    tc_trajectory_evaluate(trajectory, 0, 0u, &start);
    for (int i = 0; i < 3; i++) gap[i] = start.position_world_m[i] - c->telemetry.estimate.position_world_m[i];
    return tc_norm(gap) <= c->parameters.start_radius_m ? TC_OK : TC_START_TOO_FAR;
}

static tc_reason set_time_scale(tc_controller* c, float scale) {
    if (scale < SMALLEST_TIME_SCALE || scale > 1.0f) return TC_OUT_OF_RANGE;
    c->time_scale = scale;
    if (c->mission.state == TC_TRAJECTORY) tc_change_rate(c, scale);
    return TC_OK;
}

tc_reason tc_do(tc_controller* c, tc_command command, float value) {
    if ((uint32_t)command >= TC_COMMAND_COUNT) return TC_OUT_OF_RANGE;
    if (!tc_finite(value)) return TC_NOT_FINITE;
    tc_reason reason = TC_OK;
    switch (command) {
        case TC_COMMAND_TIME_SCALE:
            return set_time_scale(c, value);
        case TC_COMMAND_ARM:
            reason = c->mission.state == TC_DISARMED ? tc_arming_check(c) : TC_OK;
            break;
        case TC_COMMAND_TAKE_OFF:
            reason = c->mission.state == TC_ARMED ? guard_take_off(c, value) : TC_OK;
            break;
        case TC_COMMAND_START:
            reason = guard_start(c);
            break;
        default:
            break;
    }
    if (reason != TC_OK) return reason;
    if (command == TC_COMMAND_TAKE_OFF && c->mission.state == TC_ARMED) c->take_off_m = value;
    return tc_post(c, (uint8_t)command, TC_COMMANDED);
}

/* Within these another controller's flight can be taken over. */
static const float ENGAGE_GOOD_S = 1.0f;     /* the estimate has been without fault */
static const float ENGAGE_TILT = 0.819f;     /* cosine of 35 degrees */
static const float ENGAGE_RATE_RAD_S = 2.0f; /* hard turns are for who began them */
static const float ENGAGE_SPEED_M_S = 5.0f;  /* brake_m_s2 ends it within metres */

static tc_reason guard_engage(const tc_controller* c) {
    const tc_estimate* e = &c->telemetry.estimate;
    if (!c->configured) return TC_NOT_CONFIGURED;
    if (c->mission.state != TC_DISARMED && c->mission.state != TC_SHADOW) return TC_WRONG_STATE;
    if (c->telemetry.ticks == 0u || !tc_lasts(c, c->good_since_us, ENGAGE_GOOD_S)) return TC_ESTIMATE_STALE;
    const bool calm = c->axes[2][2] > ENGAGE_TILT && tc_norm(e->rate_body_rad_s) < ENGAGE_RATE_RAD_S &&
                      tc_norm(e->velocity_world_m_s) < ENGAGE_SPEED_M_S;
    return calm ? TC_OK : TC_NOT_ENGAGEABLE;
}

/* Begins where the other controller left off: the set-point is the vehicle's own state, its acceleration what thrust
   and weight make of it, the rotors are what they are. */
static void start_bumpless(tc_controller* c, const float rotor_speed_rad_s[TC_ROTORS]) {
    tc_telemetry* t = &c->telemetry;
    const bool force = (t->estimate.valid & (uint8_t)TC_VALID_SPECIFIC_FORCE) != 0u;
    const float hover_m_s2 = c->parameters.gravity_m_s2 / c->axes[2][2];
    const float thrust_m_s2 = force ? t->estimate.specific_force_body_m_s2[2] : hover_m_s2;
    tc_setpoint_here(c);
    for (int i = 0; i < 3; i++) t->setpoint.acceleration_world_m_s2[i] = thrust_m_s2 * c->axes[2][i];
    t->setpoint.acceleration_world_m_s2[2] -= c->parameters.gravity_m_s2;
    t->wrench.thrust_n = c->parameters.mass_kg * thrust_m_s2;
    memset(&c->position, 0, sizeof c->position);
    if (rotor_speed_rad_s != NULL && tc_all_finite(rotor_speed_rad_s, TC_ROTORS)) {
        tc_copy4(t->rotor_speed_rad_s, rotor_speed_rad_s);
        tc_copy4(c->slow_speed_rad_s, rotor_speed_rad_s);
        tc_copy4(c->observer.rotor_speed_rad_s, rotor_speed_rad_s);
        c->was_flying = true;
    }
}

tc_reason tc_engage(tc_controller* c, const float rotor_speed_rad_s[TC_ROTORS]) {
    const tc_reason reason = guard_engage(c);
    if (reason != TC_OK) return reason;
    start_bumpless(c, rotor_speed_rad_s);
    return tc_post(c, TC_EVENT_ENGAGE, TC_ENGAGED);
}

tc_reason tc_shadow(tc_controller* c) {
    return c->configured ? tc_post(c, TC_EVENT_SHADOW, TC_COMMANDED) : TC_NOT_CONFIGURED;
}

tc_reason tc_shadow_end(tc_controller* c) {
    return tc_moves(c) ? TC_MOVING : tc_post(c, TC_EVENT_SHADOW_END, TC_COMMANDED);
}

tc_reason tc_release(tc_controller* c) { return tc_post(c, TC_EVENT_RELEASE, TC_RELEASED); }

static const float LARGEST_MASS_CHANGE = 0.2f; /* of the mass, in flight: more is taken for a mistake */

/* Takes the new parameters. A trajectory was accepted under the limits of its time: new limits, new upload. */
static void adopt(tc_controller* c, const tc_parameters* parameters, bool other_limits) {
    memcpy(&c->parameters, parameters, sizeof c->parameters);
    c->configured = true;
    if (other_limits) {
        c->store.has_active = false;
        tc_store_discard(&c->store);
    }
}

/* What follows from the parameters, so that no tick has to ask for what it does not need. */
static void prepare(tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    float sine, cosine;
    tc_sin_cos(p->tilt_error_rad, &sine, &cosine);
    c->tilt_bound = 1.0f - cosine;
    c->drag_source = (uint8_t)p->drag_velocity;
    c->airflow_source = (uint8_t)p->airflow_velocity;
    c->has_moments = tc_has_moments(p);
    c->has_lead = c->has_moments || p->rotor_lag_s + p->battery_gain_1_v > 0.0f; /* neither is negative */
    c->has_integral = p->ki_xy_1_s3 + p->ki_z_1_s3 > 0.0f;
    if (!c->has_lead) c->was_flying = false; /* the filter starts anew when it comes to be needed */
}

tc_reason tc_parameters_set(tc_controller* c, const tc_parameters* parameters) {
    tc_reason reason = tc_parameters_check(parameters, NULL);
    if (reason != TC_OK) return reason;
    const uint32_t changes = tc_parameters_changes(&c->parameters, parameters);
    if (c->mission.state != TC_DISARMED && (changes & (uint32_t)TC_CHANGES_GROUND) != 0u) {
        return TC_ONLY_WHEN_DISARMED;
    }
    const float mass_change = parameters->mass_kg - c->parameters.mass_kg;
    if (tc_mission_in_air(c->mission.state) && tc_abs(mass_change) > LARGEST_MASS_CHANGE * c->parameters.mass_kg) {
        return TC_CHANGE_TOO_LARGE;
    }
    reason = tc_mixer_configure(&c->mixer, parameters);
    if (reason != TC_OK) { /* back to what was: cheaper than 200 bytes of stack for a copy */
        if (c->configured) (void)tc_mixer_configure(&c->mixer, &c->parameters);
        return reason;
    }
    adopt(c, parameters, (changes & (uint32_t)TC_CHANGES_LIMIT) != 0u);
    prepare(c);
    return TC_OK;
}

const tc_parameters* tc_parameters_now(const tc_controller* c) { return &c->parameters; }

tc_reason tc_upload_begin(tc_controller* c, const tc_trajectory_header* header) {
    return c->configured ? tc_store_begin(&c->store, header) : TC_NOT_CONFIGURED;
}

tc_reason tc_upload_segment(tc_controller* c, uint16_t index, const tc_segment* segment) {
    return tc_store_put_segment(&c->store, index, segment, &c->parameters);
}

tc_reason tc_upload_origin(tc_controller* c, const tc_origin* origin) { return tc_store_put_origin(&c->store, origin); }

tc_reason tc_upload_sample(tc_controller* c, const tc_trajectory_sample* sample) {
    return tc_store_put_sample(&c->store, sample);
}

void tc_upload_check_ahead(tc_controller* c) { tc_store_check_ahead(&c->store); }

tc_reason tc_upload_finish(tc_controller* c) { return tc_store_finish(&c->store); }

tc_reason tc_upload_may_activate(const tc_controller* c, uint32_t id, uint32_t crc32) {
    const uint8_t state = c->mission.state;
    const bool in_use = state == TC_APPROACH || tc_mission_on_path(state);
    return in_use && !tc_store_is_active(&c->store, id, crc32) ? TC_SLOT_IN_USE : TC_OK;
}

tc_reason tc_upload_activate(tc_controller* c, uint32_t id, uint32_t crc32) {
    const tc_reason reason = tc_upload_may_activate(c, id, crc32);
    return reason == TC_OK ? tc_store_activate(&c->store, id, crc32) : reason;
}

void tc_ground_alive(tc_controller* c, uint64_t ago_us) {
    const uint64_t now_us = c->telemetry.time_us;
    c->ground_seen_us = ago_us < now_us ? now_us - ago_us : 0u;
    c->ground_ever_seen = true;
}
