/* The whole, one step per line. */
#include "goshawk_controller/controller.h"

#include "../base/maths.h"
#include "internal.h"

static const uint32_t LONGEST_STEP_US = 20000u; /* a longer tick is a fault of the clock */
static const uint32_t MOST_STALLED_TICKS = 8u;  /* a clock that stands is waited for */
/* The supervisor's limit follows a step with a slope of at most 0.27 times its ramp: so fast that braking stays within
   brake_m_s2. */
static const float STEP_PEAK = 0.2707f;
static const float SLOWEST_1_S = 1.0f;     /* bounds of the ramp: at walking pace braking is not slower, */
static const float FASTEST_1_S = 8.0f;     /* ... and at high speed not more abrupt */
static const float URGENT_BRAKE = 2.0f;    /* harder without position, as dead reckoning does not last, or far off */
static const float SUPERVISED_RATE = 0.1f; /* below, the path's own speed is not told by the set-point's */
static const float HOVER_UPRIGHT = 0.95f;  /* cosine of 18 degrees of tilt: hover thrust is learnt below, */
static const float HOVER_ACCELERATION_M_S2 = 1.0f; /* ... this acceleration asked for, */
static const float HOVER_SPEED_M_S = 1.0f;         /* ... and this speed */
static const float HOVER_FILTER_S = 1.0f; /* time constant of learning it, at first: the model's mass counts as this */
static const float HOVER_LONGEST_S = 10.0f; /* ... and at last: gusts of a second average out */
static const float HOVER_SPREAD = 0.2f;     /* around the weight: what is learnt is not believed beyond */

static const float LEAN = 0.15f; /* tangent of 8 degrees: at most so far into the wind in an emergency */

/* Of the weight, upwards, unless the path itself asks for less: on what feedback leaves of the thrust, a vehicle that
   bounces or has jumped beside a dive would turn over. */
static const float LEAST_LIFT = 0.25f;

void tc_init(tc_controller* c) {
    memset(c, 0, sizeof *c);
    tc_store_init(&c->store);
    tc_mission_init(&c->mission);
    tc_parameters_default(&c->parameters);
    c->telemetry.estimate.q_world_body[0] = 1.0f;
    tc_flatness_reset(&c->telemetry.flatness, c->telemetry.estimate.q_world_body);
    c->felt_m_s2[2] = c->parameters.gravity_m_s2; /* a fall has to be felt first */
    c->time_scale = 1.0f;
    tc_supervisor_reset(&c->supervisor, 0u);
}

/* How fast the path may be flown. */
static void judge_tracking(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    const bool on_path = tc_mission_on_path(c->mission.state);
    const float rate = on_path ? c->clock.flown[0] : 0.0f;
    const float speed = tc_norm(t->setpoint.velocity_world_m_s) / tc_max(rate, SUPERVISED_RATE);
    const bool tracking = (t->estimate_faults & (uint32_t)TC_FAULT_POSITION_STALE) == 0u;
    const bool urgent = !tracking || c->supervisor.stopped;
    const float brake_m_s2 = (urgent ? URGENT_BRAKE : 1.0f) * c->parameters.brake_m_s2;
    const float ramp_1_s = tc_clamp(brake_m_s2 / (STEP_PEAK * tc_max(speed, 0.1f)), SLOWEST_1_S, FASTEST_1_S);
    tc_supervisor_judge(&c->supervisor, &t->setpoint, rate, t->estimate.position_world_m, tc_clearance(c), tracking,
                        ramp_1_s, t->time_us);
}

static void make_setpoint(tc_controller* c, float step_s) {
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    const uint8_t state = c->mission.state;
    if (tc_mission_on_path(state)) {
        const tc_trajectory* trajectory = tc_store_active(&c->store);
        tc_clock_advance(&c->clock, trajectory, c->supervisor.limit, step_s);
        tc_clock_setpoint(&c->clock, trajectory, setpoint);
        tc_supervisor_apply_shift(&c->supervisor, setpoint);
    } else if (tc_mission_in_air(state) && state != TC_EMERGENCY) {
        tc_move_advance(&c->move, step_s);
        tc_move_setpoint(&c->move, setpoint);
        if (state == TC_LANDING) tc_landing_setpoint(c, step_s);
    } else {
        /* no set-point to move */
    }
}

/* Upright, heading kept, what attitude alone can do; against the wind that was found before, so that it drifts less. */
static void emergency_force(tc_controller* c, float force_world_n[3]) {
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    memset(setpoint->velocity_world_m_s, 0, sizeof *setpoint - offsetof(tc_setpoint, velocity_world_m_s));
    const float most_n = LEAN * c->parameters.mass_kg * c->parameters.gravity_m_s2;
    for (int i = 0; i < 2; i++) {
        const float wind_n = tc_cancels_disturbance(c) ? c->observer.force_world_n[i] : 0.0f;
        force_world_n[i] = -tc_clamp(tc_disturbance_share(c) * wind_n, -most_n, most_n);
    }
    force_world_n[2] = tc_emergency_thrust(c);
}

/* What a compensation works with. */
static const float* chosen(uint8_t source, const float setpoint[3], const float estimate[3]) {
    static const float still[3] = {0.0f, 0.0f, 0.0f};
    if (source == (uint8_t)TC_VELOCITY_NONE) return still;
    return source == (uint8_t)TC_VELOCITY_ESTIMATE ? estimate : setpoint;
}

/* The velocity of that source in body axes. */
static void chosen_velocity(tc_controller* c, uint8_t source, float velocity_body_m_s[3]) {
    const tc_telemetry* t = &c->telemetry;
    tc_to_body(c->axes, chosen(source, t->setpoint.velocity_world_m_s, t->estimate.velocity_world_m_s),
               velocity_body_m_s);
}

/* What the rotors do: as measured, else as this says. */
static const float* measured_else(const tc_controller* c, const float guess_rad_s[TC_ROTORS]) {
    const tc_estimate* e = &c->telemetry.estimate;
    return (e->valid & (uint8_t)TC_VALID_ROTOR_SPEED) != 0u ? e->rotor_speed_rad_s : guess_rad_s;
}

static float mean_speed(const tc_controller* c) {
    const float* n = measured_else(c, c->telemetry.rotor_speed_rad_s);
    return 0.25f * (n[0] + n[1] + n[2] + n[3]);
}

/* Eq. (9); returns the slope of the drag over speed. */
static float flight_force(tc_controller* c, const float velocity_body_m_s[3], float step_s, float force_world_n[3]) {
    tc_telemetry* t = &c->telemetry;
    float drag[3], drag_world_n[3];
    const float mean_n = c->parameters.rotor_drag_kg > 0.0f ? mean_speed(c) : 0.0f;
    const float slope_n_s_m = tc_drag(&c->parameters, velocity_body_m_s, t->wrench.thrust_n, mean_n, drag);
    tc_to_world(c->axes, drag, drag_world_n);
    tc_copy(c->drag_world_n, drag_world_n);
    if (tc_cancels_disturbance(c)) {
        const float share = tc_disturbance_share(c);
        for (int i = 0; i < 3; i++) drag_world_n[i] += (i < 2 ? share : 1.0f) * c->observer.force_world_n[i];
    }
    const bool limited = tc_position_step(
        &c->position, &c->parameters, &t->setpoint, t->estimate.position_world_m, t->estimate.velocity_world_m_s,
        drag_world_n, 0.95f * c->mixer.largest_thrust_n,
        c->has_integral && c->mission.state != TC_TAKE_OFF && t->saturation == 0u, step_s, force_world_n);
    const float planned_m_s2 = c->parameters.gravity_m_s2 + t->setpoint.acceleration_world_m_s2[2];
    const float least_m_s2 = tc_min(planned_m_s2, LEAST_LIFT * c->parameters.gravity_m_s2);
    force_world_n[2] = tc_max(force_world_n[2], c->parameters.mass_kg * least_m_s2);
    t->saturation = limited ? TC_SATURATED_INPUT : 0u;
    return c->drag_source != (uint8_t)TC_VELOCITY_NONE ? slope_n_s_m : 0.0f;
}

/* On the ground, or to find that out: the stage's collective, no attitude to steer to. */
static void unload(tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    tc_wrench* wrench = &c->telemetry.wrench;
    wrench->thrust_n = c->landing.thrust_n;
    for (int i = 0; i < 3; i++) {
        const float damping = i < 2 ? p->att_kd_xy_1_s : p->att_kd_z_1_s;
        wrench->torque_n_m[i] = -p->inertia_kg_m2[i] * damping * c->telemetry.estimate.rate_body_rad_s[i];
    }
}

/* Thrust vector to attitude, attitude error to torque; the reference's turning is brought into body axes. */
static void steer(tc_controller* c, const float velocity_body_m_s[3], float step_s) {
    const tc_parameters* p = &c->parameters;
    tc_telemetry* t = &c->telemetry;
    float force[3], feed_acceleration[3];
    tc_turning turning;
    float drag_1_s = 0.0f;
    if (c->mission.state == TC_EMERGENCY) {
        t->saturation = 0u;
        emergency_force(c, force);
    } else {
        drag_1_s = flight_force(c, velocity_body_m_s, step_s, force) / p->mass_kg;
    }
    tc_flatness_step(&t->flatness, p, force, &t->setpoint, drag_1_s, step_s, &turning);
    tc_to_body(c->axes, turning.rate_world_rad_s, t->rate_reference_rad_s);
    tc_to_body(c->axes, turning.acceleration_world_rad_s2, feed_acceleration);
    tc_attitude_step(p, &t->flatness, t->estimate.q_world_body, c->axes, t->estimate.rate_body_rad_s,
                     t->rate_reference_rad_s, feed_acceleration, t->wrench.torque_n_m);
    t->wrench.thrust_n = tc_max(tc_dot(c->axes[2], force), 0.0f);
    if (tc_landing_unloads(&c->landing)) unload(c);
    if (c->mission.state == TC_EMERGENCY) t->wrench.torque_n_m[0] += tc_landing_test_torque(c);
}

/* Battery sag and rotor lag, taken off the speed commands. The lead (lag s + 1) / (filter s + 1) undoes the rotors' lag
   up to the filter's frequency; the plain inverse would drive the rotors with nothing but sensor noise. */
static void lead_speeds(tc_controller* c, float step_s) {
    const tc_parameters* p = &c->parameters;
    float* speed = c->telemetry.rotor_speed_rad_s;
    const float filter_s = tc_max(p->lead_filter_s, step_s);
    const float per_filter = 1.0f / filter_s;
    const float pass = step_s * per_filter, lead = p->rotor_lag_s * per_filter;
    const float per_battery = tc_per_battery(c);
    if (!c->was_flying) tc_copy4(c->slow_speed_rad_s, speed);
    for (int i = 0; i < TC_ROTORS; i++) {
        float behind = speed[i] - c->slow_speed_rad_s[i];
        behind -= pass * behind;
        c->slow_speed_rad_s[i] = speed[i] - behind;
        speed[i] = tc_clamp((speed[i] + lead * behind) * per_battery, p->rotor_min_rad_s, p->rotor_max_rad_s);
    }
}

/* What the vehicle takes to hover: its thrust while it neither climbs nor turns hard. */
static void learn_hover_thrust(tc_controller* c, float step_s) {
    const tc_telemetry* t = &c->telemetry;
    const float weight_n = c->parameters.mass_kg * c->parameters.gravity_m_s2;
    const bool steady = t->estimate_faults == 0u && !tc_landing_unloads(&c->landing) && c->axes[2][2] > HOVER_UPRIGHT &&
                        tc_norm(t->setpoint.acceleration_world_m_s2) < HOVER_ACCELERATION_M_S2 &&
                        tc_norm(t->estimate.velocity_world_m_s) < HOVER_SPEED_M_S && t->saturation == 0u &&
                        c->mission.state != TC_TAKE_OFF && c->mission.state != TC_LANDING;
    if (steady) {
        c->hover_s = tc_min(c->hover_s + step_s, HOVER_LONGEST_S);
        c->hover_thrust_n += step_s / (c->hover_s + step_s) * (t->wrench.thrust_n - c->hover_thrust_n);
    }
    c->hover_thrust_n = tc_clamp(c->hover_thrust_n, (1.0f - HOVER_SPREAD) * weight_n, (1.0f + HOVER_SPREAD) * weight_n);
}

/* Of modelled moments, and of what the observer finds beside them while the rotors have an attitude to hold. */
static void cancel_torques(tc_controller* c, const float air_body_m_s[3]) {
    tc_telemetry* t = &c->telemetry;
    float* torque = t->wrench.torque_n_m;
    if (c->has_moments) {
        tc_opposing_moments(&c->parameters, &c->mixer, air_body_m_s, t->estimate.rate_body_rad_s,
                            measured_else(c, c->slow_speed_rad_s), c->cancelled_n_m);
        for (int i = 0; i < 3; i++) torque[i] += c->cancelled_n_m[i];
    }
    if (!tc_cancels_disturbance(c) || tc_landing_unloads(&c->landing) || !tc_gyro_is_whole(c)) return;
    const float share = tc_disturbance_share(c);
    for (int i = 0; i < 3; i++) torque[i] -= share * c->observer.torque_body_n_m[i];
}

static void fly(tc_controller* c, float step_s) {
    const bool known = c->mission.state != TC_EMERGENCY; /* where the vehicle goes */
    const uint8_t drag = known ? c->drag_source : (uint8_t)TC_VELOCITY_NONE;
    const uint8_t airflow = known ? c->airflow_source : (uint8_t)TC_VELOCITY_NONE;
    tc_telemetry* t = &c->telemetry;
    float air[3];
    chosen_velocity(c, drag, air);
    steer(c, air, step_s);
    if (airflow != drag) chosen_velocity(c, airflow, air);
    cancel_torques(c, air);
    const float* rate = chosen(airflow, t->rate_reference_rad_s, t->estimate.rate_body_rad_s);
    tc_mixer_flow flow;
    tc_mixer_flow_at(&c->mixer, air, rate, &flow);
    t->saturation |= tc_mixer_solve(&c->mixer, &t->wrench, &flow, t->rotor_speed_rad_s);
    if (tc_even_tick(c)) learn_hover_thrust(c, 2.0f * step_s);
    if (c->has_lead) {
        lead_speeds(c, step_s);
        c->was_flying = true;
    }
    tc_observe_disturbance(c, &flow, step_s);
}

/* Another controller flies: what this one would do to keep the vehicle's velocity. */
static void shadow(tc_controller* c, float step_s) {
    tc_setpoint_here(c);
    fly(c, step_s);
}

/* On the ground or at fault: the rotors idle or stand, and the reference follows the vehicle. */
static void rest(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    const float speed = c->mission.state == TC_ARMED ? c->parameters.rotor_idle_rad_s : 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        t->rotor_speed_rad_s[i] = speed;
        c->slow_speed_rad_s[i] = speed;
    }
    memset(&t->setpoint, 0, sizeof t->setpoint);
    memset(&t->wrench, 0, sizeof t->wrench);
    memset(t->rate_reference_rad_s, 0, sizeof t->rate_reference_rad_s);
    tc_copy(t->setpoint.position_world_m, t->estimate.position_world_m);
    tc_copy4(t->flatness.q_reference, t->estimate.q_world_body);
    t->saturation = 0;
    c->was_flying = false;
    c->support_m_s2 = 0.0f;
    c->ground_z_m = t->estimate.position_world_m[2];
    if (c->observer.state != (uint8_t)TC_OBSERVER_OFF) {
        tc_observer_reset(&c->observer);
        tc_pose_delay_reset(&c->delay);
    }
    c->observer.state = c->parameters.observer > 0.5f ? (uint8_t)TC_OBSERVER_WAITS : (uint8_t)TC_OBSERVER_OFF;
    c->hover_thrust_n = c->parameters.mass_kg * c->parameters.gravity_m_s2;
    c->hover_s = HOVER_FILTER_S;
}

static void describe(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    const bool on_path = tc_mission_on_path(c->mission.state);
    t->state = c->mission.state;
    t->reason = c->mission.reason;
    t->path_rate = on_path ? c->clock.flown[0] : 0.0f;
    t->path_limit = on_path ? c->supervisor.limit[0] : 1.0f;
    t->limit_reason = on_path ? c->supervisor.reason : (uint8_t)TC_OK;
    t->landing_stage = c->landing.stage;
    t->path_time_us = c->clock.path_us;
    t->ticks++;
}

static void write_output(const tc_controller* c, tc_output* output) {
    tc_copy4(output->rotor_speed_rad_s, c->telemetry.rotor_speed_rad_s);
    output->saturation = c->telemetry.saturation;
    output->state = c->mission.state;
    output->in_command = c->mission.state != TC_SHADOW;
}

static tc_reason estimate_reason(uint8_t faults) {
    const uint32_t attitude =
        (uint32_t)TC_FAULT_ATTITUDE_UNUSABLE | TC_FAULT_ATTITUDE_STALE | TC_FAULT_RATE_UNUSABLE | TC_FAULT_RATE_STALE;
    if ((faults & attitude) != 0u) return TC_ATTITUDE_STALE;
    if ((faults & (uint32_t)TC_FAULT_POSITION_UNUSABLE) != 0u) return TC_ESTIMATE_NOT_FINITE;
    return (faults & (uint32_t)TC_FAULT_POSITION_STALE) != 0u ? TC_ESTIMATE_STALE : TC_OK;
}

/* Controller time goes on by the caller's step. A clock that stands, or has gone back by a little (jitter), is waited
   for during some ticks of no length; then, and after any larger step, it is taken up anew, and the tick is as long as
   the last good one. Returns whether the step was possible. */
static bool advance_time(tc_controller* c, uint64_t caller_us) {
    const uint64_t ahead_us = caller_us - c->caller_us, back_us = c->caller_us - caller_us;
    if (c->telemetry.ticks == 0u) {
        c->telemetry.time_us = caller_us;
        c->caller_us = caller_us;
        return true;
    }
    if (caller_us > c->caller_us && ahead_us <= LONGEST_STEP_US) {
        c->stalled_ticks = 0;
        c->good_step_us = ahead_us;
        c->step_us = ahead_us;
        c->caller_us = caller_us;
        c->telemetry.time_us += c->step_us;
        return true;
    }
    const bool waits = caller_us <= c->caller_us && back_us <= LONGEST_STEP_US && c->stalled_ticks < MOST_STALLED_TICKS;
    if (waits) {
        c->stalled_ticks++;
        c->step_us = 0;
    } else {
        c->step_us = c->good_step_us;
        c->caller_us = caller_us;
    }
    c->telemetry.time_us += c->step_us;
    c->telemetry.refused_ticks++;
    c->clock_fault_us = c->telemetry.time_us;
    return false;
}

tc_reason tc_tick(tc_controller* c, uint64_t time_us, const tc_estimate* estimate, tc_output* output) {
    const bool possible = advance_time(c, time_us);
    const float step_s = tc_seconds(c->step_us);
    tc_take_estimate(c, estimate, step_s);
    if (!tc_even_tick(c)) judge_tracking(c);
    tc_supervisor_step(&c->supervisor, step_s);
    make_setpoint(c, step_s);
    tc_observe(c);
    if (tc_mission_in_air(c->mission.state)) {
        fly(c, step_s);
    } else if (c->mission.state == TC_SHADOW) {
        shadow(c, step_s);
    } else {
        rest(c);
    }
    describe(c);
    write_output(c, output);
    return possible ? estimate_reason(c->telemetry.estimate_faults) : TC_TIME_WENT_BACK;
}

const tc_telemetry* tc_telemetry_now(const tc_controller* c) { return &c->telemetry; }

const tc_observer* tc_observer_now(const tc_controller* c) { return &c->observer; }
