/* What the parts of the controller share. Internal. */
#ifndef GOSHAWK_CONTROLLER_INTERNAL_H
#define GOSHAWK_CONTROLLER_INTERNAL_H

#include "../base/maths.h"
#include "goshawk_controller/controller.h"
#include "standing.h"

/* lasting.c: whether it has been so for longer than this; `since_us` in controller time. */
bool tc_lasts(const tc_controller* c, uint64_t since_us, float limit_s);

/* What follows the flight over some tenths of a second is looked at in every other tick, half of it in the even ones.
 */
static inline bool tc_even_tick(const tc_controller* c) { return c->telemetry.ticks % 2u == 0u; }

/* estimate.c: takes what is usable of `estimate`, dead reckons the rest, folds relocalizations into the set-point, and
   writes telemetry.estimate, its faults and what is known of the dead reckoning. */
void tc_take_estimate(tc_controller* c, const tc_estimate* estimate, float step_s);

/* transitions.c: posts an event; when the state changes, prepares the set-point source of the new one. */
tc_reason tc_post(tc_controller* c, uint8_t event, tc_reason reason);
/* Changes the rate of the path clock, so slowly that braking stays within brake_m_s2. */
void tc_change_rate(tc_controller* c, float rate);
/* The set-point is where the vehicle is, and moves with it; the attitude reference is the vehicle's own. */
void tc_setpoint_here(tc_controller* c);

/* failsafe.c: posts everything that may change the state by itself, after the set-point has been advanced. */
void tc_observe(tc_controller* c);
bool tc_inside_fence(const tc_parameters* p, const float position_world_m[3]);
/* By the accelerometer: next to nothing carries it. */
bool tc_falls(const tc_controller* c);
/* What the supervisor measures errors by: the clearance of the active trajectory, or a parameter's. */
float tc_clearance(const tc_controller* c);

static inline float tc_position_delay_s(const tc_controller* c) {
    return c->delay.attitude.delay_s + c->delay.velocity.delay_s;
}

/* disturbance.c: runs the observer where it may run; at the end of a tick, as it works with that tick's model. */
void tc_observe_disturbance(tc_controller* c, const tc_mixer_flow* flow, float step_s);
static inline bool tc_cancels_disturbance(const tc_controller* c) {
    return c->observer.state == (uint8_t)TC_OBSERVER_RUNS || c->observer.state == (uint8_t)TC_OBSERVER_HOLDS;
}
/* Of what it holds, 0 .. 1: as the thrust falls on the ground, the vehicle is not to lean into the wind any further. */
float tc_disturbance_share(const tc_controller* c);
/* What speed commands are raised by against the battery's sag. */
static inline float tc_per_battery(const tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    const float battery_v = c->telemetry.estimate.battery_v;
    if (!(battery_v > 0.0f)) return 1.0f;
    return 1.0f / tc_max(1.0f - p->battery_gain_1_v * (p->battery_reference_v - battery_v), 0.5f);
}

/* An axis of the gyro has been missing for so long that it lands; without an attitude, that the rate is lost. */
static inline bool tc_gyro_axis_is_gone(const tc_controller* c) { return tc_lasts(c, c->gyro_good_us, 0.5f); }
/* Whether the gyro gives all three axes; else the missing ones are told by the attitude, late. */
static inline bool tc_gyro_is_whole(const tc_controller* c) { return c->gyro_good_us == c->telemetry.time_us; }

/* monitor.c */
/* Whether the pose is believed now. */
bool tc_monitor_believes(const tc_controller* c);
bool tc_monitor_believes_height(const tc_controller* c);
/* The attitude of `estimate`, turned back to its old heading when that has jumped. */
void tc_monitor_heading(tc_controller* c, const tc_estimate* estimate, float step_s, float q[4]);
/* Horizontal speed, squared, as the position tells it over some seconds. */
float tc_monitor_speed2(const tc_controller* c);
/* How much the accelerometer shakes from tick to tick: before the new sample is taken. */
void tc_monitor_shaking(tc_controller* c, const float force_body_m_s2[3], float step_s);
/* One step with that part of a pose, `ahead_s` old; `acceleration_m_s2` by the accelerometer, world axes. Where the
   pose turns out to be wrong, telemetry.estimate goes back to what the IMU makes of the pose before. */
void tc_monitor_step(tc_controller* c, const tc_estimate* estimate, tc_monitored part, const float acceleration_m_s2[3],
                     float ahead_s, float step_s);

/* landing.c */
void tc_landing_begin(tc_controller* c);
/* The vertical part of the set-point; the horizontal part is a move to rest. */
void tc_landing_setpoint(tc_controller* c, float step_s);
/* Goes through the stages; whether the vehicle has come to rest on the ground. */
bool tc_landing_observe(tc_controller* c, float step_s);
/* The collective is the stage's, and the attitude is only damped: UNLOAD and IDLE. */
static inline bool tc_landing_unloads(const tc_landing* landing) {
    return landing->stage == (uint8_t)TC_LANDING_UNLOAD || landing->stage == (uint8_t)TC_LANDING_IDLE;
}
/* Roll torque, N m, that tells the ground where nothing else does; 0 else. */
float tc_landing_test_torque(const tc_controller* c);
/* Something carries it beside the rotors: their thrust is small, and yet it neither falls nor moves. */
bool tc_stands(const tc_controller* c);
void tc_measure_support(tc_controller* c, float step_s);
/* It flies along or turns, by the estimate; a vehicle that hovers does not. */
bool tc_moves(const tc_controller* c);
/* The collective of the emergency descent, N. */
float tc_emergency_thrust(const tc_controller* c);

#endif
