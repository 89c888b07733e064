/* When the disturbance observer runs, and what of it is cancelled. */
#include "../base/maths.h"
#include "internal.h"

static const float LIFTED_M = 0.08f; /* above where it stood: off the ground, and out of the thick of its effect */

static const float FOLLOWS = 0.85f; /* cosine of the attitude error beyond which an attitude is not believed */

static bool lifted(const tc_controller* c) {
    return c->mission.state != TC_TAKE_OFF || c->observer.state == (uint8_t)TC_OBSERVER_RUNS ||
           c->telemetry.estimate.position_world_m[2] > c->ground_z_m + LIFTED_M;
}

static tc_observer_state wanted_state(const tc_controller* c) {
    const uint8_t state = c->mission.state, now = c->observer.state;
    const uint32_t faults = (uint32_t)TC_FAULT_POSITION_STALE | TC_FAULT_ATTITUDE_STALE;
    if (c->parameters.observer < 0.5f) return TC_OBSERVER_OFF;
    if (!tc_mission_in_air(state)) return TC_OBSERVER_WAITS;
    if ((c->telemetry.estimate.valid & (uint8_t)TC_VALID_SPECIFIC_FORCE) == 0u) return TC_OBSERVER_NO_ACCELEROMETER;
    if (tc_dot(c->telemetry.flatness.axis, c->axes[2]) < FOLLOWS) return TC_OBSERVER_WAITS;
    if (state == TC_LANDING || state == TC_EMERGENCY || (c->telemetry.estimate_faults & faults) != 0u ||
        !tc_gyro_is_whole(c)) {
        return now == (uint8_t)TC_OBSERVER_NO_ACCELEROMETER ? TC_OBSERVER_WAITS : TC_OBSERVER_HOLDS;
    }
    return lifted(c) ? TC_OBSERVER_RUNS : TC_OBSERVER_WAITS;
}

float tc_disturbance_share(const tc_controller* c) {
    const float weight_n = c->parameters.mass_kg * c->parameters.gravity_m_s2;
    if (c->observer.state != (uint8_t)TC_OBSERVER_HOLDS) return 1.0f;
    return tc_clamp(c->telemetry.wrench.thrust_n / weight_n, 0.0f, 1.0f);
}

static void enter(tc_controller* c, tc_observer_state state) {
    if (state == (tc_observer_state)c->observer.state) return;
    c->observer.state = (uint8_t)state;
    c->observer.started = false;
    c->delay.started = false;
    if (state == TC_OBSERVER_RUNS && c->observer.rotor_speed_rad_s[0] < c->parameters.rotor_min_rad_s) {
        tc_copy4(c->observer.rotor_speed_rad_s, c->telemetry.rotor_speed_rad_s); /* engaged, and not told */
    }
    if (state == TC_OBSERVER_HOLDS) tc_observer_hold(&c->observer);
    if (tc_cancels_disturbance(c)) return;
    if (state == TC_OBSERVER_WAITS && tc_mission_in_air(c->mission.state)) {
        tc_observer_pause(&c->observer);
    } else {
        tc_observer_reset(&c->observer);
    }
    tc_pose_delay_reset(&c->delay);
}

/* Estimate against the IMU: which of them is late. Whether there was something to compare. */
static bool compare_pose(tc_controller* c, const float acceleration_world_m_s2[3], const float rate_body_rad_s[3],
                         float step_s) {
    const tc_estimate* e = &c->telemetry.estimate;
    const tc_pose_compared now = {e->velocity_world_m_s,
                                  e->q_world_body,
                                  acceleration_world_m_s2,
                                  c->telemetry.setpoint.acceleration_world_m_s2,
                                  rate_body_rad_s,
                                  c->observer.noise_m2_s4,
                                  e->position_time_us != c->observed_us,
                                  !c->observer.compared};
    const bool compared = tc_pose_delay_step(&c->delay, &now, step_s);
    if (compared) c->observed_us = e->position_time_us;
    return compared;
}

static void observe_torque(tc_controller* c, const tc_mixer_flow* flow, const float rate_rad_s[3], float step_s) {
    tc_observer* o = &c->observer;
    tc_wrench rotors;
    tc_mixer_wrench(&c->mixer, o->rotor_speed_rad_s, flow, o->induced, &rotors);
    const tc_observed_torque now = {rate_rad_s, rotors.torque_n_m, c->cancelled_n_m};
    o->thrust_n = rotors.thrust_n;
    if (o->started) {
        tc_observer_torque(o, &c->parameters, &now, step_s);
    } else {
        tc_observer_start(o, &now, c->telemetry.estimate.velocity_world_m_s);
    }
}

/* Where the pose is compared, the force waits for its next turn. */
static void observe_force(tc_controller* c, const float force_body_m_s2[3], const float rate_rad_s[3], float step_s) {
    tc_observer* o = &c->observer;
    float acceleration[3], known[3];
    tc_to_world(c->axes, force_body_m_s2, acceleration);
    acceleration[2] -= c->parameters.gravity_m_s2;
    o->force_s += step_s;
    for (int i = 0; i < 3; i++) o->gained_m_s[i] += step_s * acceleration[i];
    o->compared = compare_pose(c, acceleration, rate_rad_s, step_s);
    if (o->compared || !(o->force_s > 0.0f)) return;
    for (int i = 0; i < 3; i++) {
        acceleration[i] = o->gained_m_s[i] / o->force_s;
        known[i] = o->thrust_n * c->axes[2][i] + c->drag_world_n[i];
        o->gained_m_s[i] = 0.0f;
    }
    const tc_observed_force now = {acceleration, c->telemetry.estimate.velocity_world_m_s, known};
    tc_observer_force(o, &c->parameters, &now, o->force_s);
    o->force_s = 0.0f;
}

static void mean(const float a[3], const float b[3], float out[3]) {
    for (int i = 0; i < 3; i++) out[i] = 0.5f * (a[i] + b[i]);
}

/* Torque in odd ticks, force in even ones: half of the work a tick, while both change within 16 ms at the fastest. */
static void observe(tc_controller* c, const tc_mixer_flow* flow, float step_s) {
    const tc_estimate* e = &c->telemetry.estimate;
    tc_observer* o = &c->observer;
    const float both_s = step_s + o->last_step_s;
    float rate[3];
    mean(e->rate_body_rad_s, o->started ? o->last_rate_rad_s : e->rate_body_rad_s, rate);
    if (!tc_even_tick(c)) {
        observe_torque(c, flow, rate, both_s);
    } else if (o->started) {
        float force[3];
        mean(e->specific_force_body_m_s2, o->last_force_body_m_s2, force);
        observe_force(c, force, rate, both_s);
    } else {
        /* it starts with the torque */
    }
    o->last_step_s = step_s;
    tc_copy(o->last_rate_rad_s, e->rate_body_rad_s);
    tc_copy(o->last_force_body_m_s2, e->specific_force_body_m_s2);
}

void tc_observe_disturbance(tc_controller* c, const tc_mixer_flow* flow, float step_s) {
    const tc_estimate* e = &c->telemetry.estimate;
    enter(c, wanted_state(c));
    if (c->observer.state == (uint8_t)TC_OBSERVER_OFF) return;
    const bool measured = (e->valid & (uint8_t)TC_VALID_ROTOR_SPEED) != 0u;
    if (measured) tc_copy4(c->observer.rotor_speed_rad_s, e->rotor_speed_rad_s);
    if (c->observer.state == (uint8_t)TC_OBSERVER_RUNS) observe(c, flow, step_s);
    if (measured) return;
    tc_observer_rotors(&c->observer, &c->parameters, c->telemetry.rotor_speed_rad_s, tc_per_battery(c), step_s);
}
