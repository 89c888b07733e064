/* The whole, one step per line. */
#include "goshawk_controller/controller.h"

#include "copy.h"
#include "internal.h"
#include "maths.h"

#define LONGEST_STEP_US 20000u

TC_RARE void tc_init(tc_controller* c) {
    tc_fill(c, 0, sizeof *c);
    tc_store_init(&c->store);
    tc_mission_init(&c->mission);
    tc_parameters_default(&c->parameters);
    c->telemetry.estimate.q_world_body[0] = 1.0f;
    tc_flatness_reset(&c->telemetry.flatness, c->telemetry.estimate.q_world_body);
    c->time_scale = 1.0f;
}

static inline void make_setpoint(tc_controller* c, float step_s) {
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    const uint8_t state = c->mission.state;
    if (tc_mission_on_path(state)) {
        const tc_trajectory* trajectory = tc_store_active(&c->store);
        tc_clock_advance(&c->clock, trajectory, step_s);
        tc_clock_setpoint(&c->clock, trajectory, setpoint);
    } else if (tc_mission_in_air(state) && state != TC_EMERGENCY) {
        tc_move_advance(&c->move, setpoint, step_s);
        tc_move_setpoint(&c->move, setpoint);
    }
}

/* Level, heading kept, a little less thrust than the weight: what attitude alone can do. */
static TC_RARE void emergency_force(tc_controller* c, float force_world_n[3]) {
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    tc_fill(setpoint->velocity_world_m_s, 0, sizeof *setpoint - offsetof(tc_setpoint, velocity_world_m_s));
    force_world_n[0] = 0.0f;
    force_world_n[1] = 0.0f;
    force_world_n[2] = c->parameters.emergency_sink * c->parameters.mass_kg * c->parameters.gravity_m_s2;
}

/* What a compensation works with. */
static const float* chosen(uint8_t source, const float setpoint[3], const float estimate[3]) {
    static const float still[3] = {0.0f, 0.0f, 0.0f};
    if (source == (uint8_t)TC_VELOCITY_NONE) return still;
    return source == (uint8_t)TC_VELOCITY_ESTIMATE ? estimate : setpoint;
}

/* The velocity of that source in body axes. */
static TC_APART void chosen_velocity(tc_controller* c, uint8_t source, float velocity_body_m_s[3]) {
    const tc_telemetry* t = &c->telemetry;
    tc_to_body(c->axes, chosen(source, t->setpoint.velocity_world_m_s, t->estimate.velocity_world_m_s),
               velocity_body_m_s);
}

/* Eq. (9). */
static inline float flight_force(tc_controller* c, const float velocity_body_m_s[3], float step_s,
                                 float force_world_n[3]) {
    tc_telemetry* t = &c->telemetry;
    const float* n = t->rotor_speed_rad_s;
    float drag[3], drag_world_n[3];
    const float mean_n = c->parameters.rotor_drag_kg > 0.0f ? 0.25f * (n[0] + n[1] + n[2] + n[3]) : 0.0f;
    tc_drag(&c->parameters, velocity_body_m_s, t->wrench.thrust_n, mean_n, drag);
    tc_to_world(c->axes, drag, drag_world_n);
    const bool limited = tc_position_step(
        &c->position, &c->parameters, &t->setpoint, t->estimate.position_world_m, t->estimate.velocity_world_m_s,
        drag_world_n, 0.95f * c->mixer.largest_thrust_n,
        c->has_integral && c->mission.state != TC_TAKE_OFF && t->saturation == 0u, step_s, force_world_n);
    t->saturation = limited ? TC_SATURATED_INPUT : 0u;
    return c->drag_source != (uint8_t)TC_VELOCITY_NONE
               ? tc_drag_slope(&c->parameters, velocity_body_m_s, t->wrench.thrust_n, mean_n)
               : 0.0f;
}

/* Thrust vector to attitude, attitude error to torque; the reference's turning is brought into body axes. */
static TC_APART void steer(tc_controller* c, const float velocity_body_m_s[3], float step_s) {
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
}

/* Battery sag and rotor lag, taken off the speed commands. The lead (lag s + 1) / (filter s + 1) undoes the rotors' lag
   up to the filter's frequency; the plain inverse would drive the rotors with nothing but sensor noise. */
static TC_RARE void lead_speeds(tc_controller* c, float step_s) {
    const tc_parameters* p = &c->parameters;
    float* speed = c->telemetry.rotor_speed_rad_s;
    const float filter_s = tc_max(p->lead_filter_s, step_s);
    const float per_filter = 1.0f / filter_s;
    const float pass = step_s * per_filter, lead = p->rotor_lag_s * per_filter;
    const float battery_v = c->telemetry.estimate.battery_v;
    float per_battery = 1.0f;
    if (battery_v > 0.0f) {
        per_battery = 1.0f / tc_max(1.0f - p->battery_gain_1_v * (p->battery_reference_v - battery_v), 0.5f);
    }
    for (int i = 0; i < TC_ROTORS; i++) {
        float behind = c->was_flying ? speed[i] - c->slow_speed_rad_s[i] : 0.0f;
        behind -= pass * behind;
        c->slow_speed_rad_s[i] = speed[i] - behind;
        speed[i] = tc_clamp((speed[i] + lead * behind) * per_battery, p->rotor_min_rad_s, p->rotor_max_rad_s);
    }
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
    if (c->has_moments) {
        tc_cancel_moments(&c->parameters, &c->mixer, air, t->estimate.rate_body_rad_s, c->slow_speed_rad_s,
                          t->wrench.torque_n_m);
    }
    t->saturation |=
        tc_mixer_solve(&c->mixer, &t->wrench, air,
                       chosen(airflow, t->rate_reference_rad_s, t->estimate.rate_body_rad_s), t->rotor_speed_rad_s);
    if (c->has_lead) {
        lead_speeds(c, step_s);
        c->was_flying = true;
    }
}

/* On the ground or at fault: the rotors idle or stand, and the reference follows the vehicle. */
static TC_RARE void rest(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    const float speed = c->mission.state == TC_ARMED ? c->parameters.rotor_idle_rad_s : 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        t->rotor_speed_rad_s[i] = speed;
        c->slow_speed_rad_s[i] = speed;
    }
    tc_fill(&t->setpoint, 0, sizeof t->setpoint);
    tc_fill(&t->wrench, 0, sizeof t->wrench);
    tc_fill(t->rate_reference_rad_s, 0, sizeof t->rate_reference_rad_s);
    tc_copy(t->setpoint.position_world_m, t->estimate.position_world_m);
    tc_copy4(t->flatness.q_reference, t->estimate.q_world_body);
    t->saturation = 0;
    c->was_flying = false;
}

static void describe(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    t->state = c->mission.state;
    t->reason = c->mission.reason;
    t->path_rate = tc_mission_on_path(t->state) ? c->clock.rate[0] : 0.0f;
    t->path_time_us = c->clock.path_us;
    t->ticks++;
}

static void write_output(const tc_controller* c, tc_output* output) {
    tc_copy4(output->rotor_speed_rad_s, c->telemetry.rotor_speed_rad_s);
    output->saturation = c->telemetry.saturation;
    output->state = c->mission.state;
}

static tc_reason estimate_reason(uint8_t faults) {
    if ((faults & (TC_FAULT_ATTITUDE_BAD | TC_FAULT_ATTITUDE_STALE)) != 0u) return TC_ATTITUDE_STALE;
    if ((faults & TC_FAULT_POSITION_BAD) != 0u) return TC_ESTIMATE_NOT_FINITE;
    return (faults & TC_FAULT_POSITION_STALE) != 0u ? TC_ESTIMATE_STALE : TC_OK;
}

tc_reason tc_tick(tc_controller* c, uint64_t time_us, const tc_estimate* estimate, tc_output* output) {
    const bool first = c->telemetry.ticks == 0u;
    if (!first && time_us <= c->telemetry.time_us) {
        c->telemetry.refused_ticks++;
        write_output(c, output);
        return TC_TIME_WENT_BACK;
    }
    const uint64_t step_us = first ? 0u : time_us - c->telemetry.time_us;
    const bool late = step_us > LONGEST_STEP_US;
    const float step_s = (float)(uint32_t)(late ? LONGEST_STEP_US : step_us) * 1e-6f;
    c->telemetry.time_us = time_us;
    const uint8_t faults = tc_take_estimate(c, time_us, step_s, estimate);
    c->telemetry.estimate_faults = faults;
    tc_q_axes(c->telemetry.estimate.q_world_body, c->axes);
    make_setpoint(c, step_s);
    tc_observe(c, faults);
    if (tc_mission_in_air(c->mission.state)) {
        fly(c, step_s);
    } else {
        rest(c);
    }
    describe(c);
    write_output(c, output);
    if (late) c->telemetry.refused_ticks++;
    return late ? TC_TIME_WENT_BACK : estimate_reason(faults);
}

const tc_telemetry* tc_telemetry_now(const tc_controller* c) { return &c->telemetry; }
