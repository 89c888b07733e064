/* The whole, one step per line. */
#include "goshawk_controller/controller.h"

#include "internal.h"
#include "maths.h"

#define LONGEST_STEP_US 20000u

void tc_init(tc_controller* c) {
    memset(c, 0, sizeof *c);
    tc_store_init(&c->store);
    tc_mission_init(&c->mission);
    tc_parameters_default(&c->parameters);
    c->last_good.q_world_body[0] = 1.0f;
    tc_flatness_reset(&c->flatness, c->last_good.q_world_body);
    c->time_scale = 1.0f;
}

static void make_setpoint(tc_controller* c, float step_s) {
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    const uint8_t state = c->mission.state;
    if (tc_mission_on_path(state)) {
        const tc_trajectory* trajectory = tc_store_active(&c->store);
        tc_clock_advance(&c->clock, trajectory, step_s);
        tc_clock_setpoint(&c->clock, trajectory, setpoint);
    } else if (tc_mission_in_air(state) && state != TC_EMERGENCY) {
        tc_move_advance(&c->move, step_s);
        tc_move_setpoint(&c->move, setpoint);
    }
}

/* Level, heading kept, a little less thrust than the weight: what attitude alone can do. */
static void emergency_force(const tc_controller* c, tc_flat_input* flat) {
    memset(flat, 0, sizeof *flat);
    flat->force_world_n[2] = c->parameters.emergency_sink * c->parameters.mass_kg * c->parameters.gravity_m_s2;
    flat->yaw_rad = c->telemetry.setpoint.yaw_rad;
}

static float mean_rotor_speed(const tc_controller* c) {
    const float* n = c->telemetry.rotor_speed_rad_s;
    return 0.25f * (n[0] + n[1] + n[2] + n[3]);
}

static void modelled_drag(tc_controller* c, float drag_world_n[3]) {
    static const float still[3] = {0.0f, 0.0f, 0.0f};
    const tc_parameters* p = &c->parameters;
    const tc_telemetry* t = &c->telemetry;
    const bool estimated = p->drag_velocity > 1.5f;
    const float* velocity = estimated ? t->estimate.velocity_world_m_s : t->setpoint.velocity_world_m_s;
    tc_drag(p, p->drag_velocity < 0.5f ? still : velocity, estimated ? c->axes : c->flatness.axes, t->wrench.thrust_n,
            mean_rotor_speed(c), drag_world_n);
}

/* Eq. (9) and the derivatives of its feed-forward part. */
static void flight_force(tc_controller* c, float step_s, tc_flat_input* flat) {
    const tc_parameters* p = &c->parameters;
    const tc_setpoint* setpoint = &c->telemetry.setpoint;
    tc_position_input input = {.largest_thrust_n = c->mixer.largest_thrust_n,
                               .integrate = c->mission.state != TC_TAKE_OFF && c->telemetry.saturation == 0u};
    tc_copy(input.position_world_m, c->telemetry.estimate.position_world_m);
    tc_copy(input.velocity_world_m_s, c->telemetry.estimate.velocity_world_m_s);
    modelled_drag(c, input.drag_world_n);
    const bool limited = tc_position_step(&c->position, p, setpoint, &input, step_s, flat->force_world_n);
    c->telemetry.saturation = limited ? TC_SATURATED_INPUT : 0u;
    for (int i = 0; i < 3; i++) {
        flat->force_rate_n_s[i] = p->mass_kg * setpoint->jerk_world_m_s3[i];
        flat->force_rate2_n_s2[i] = p->mass_kg * setpoint->snap_world_m_s4[i];
    }
    flat->yaw_rad = setpoint->yaw_rad;
    flat->yaw_rate_rad_s = setpoint->yaw_rate_rad_s;
    flat->yaw_acceleration_rad_s2 = setpoint->yaw_acceleration_rad_s2;
}

/* Air speed and rates at the rotors, from the source that was chosen. */
static void airflow(tc_controller* c, const tc_attitude_reference* reference, float air[3], float rate[3]) {
    const tc_telemetry* t = &c->telemetry;
    const float source = c->parameters.airflow_velocity;
    const bool estimated = source > 1.5f;
    const float on = source > 0.5f && c->mission.state != TC_EMERGENCY ? 1.0f : 0.0f;
    const float* velocity = estimated ? t->estimate.velocity_world_m_s : t->setpoint.velocity_world_m_s;
    const float* rates = estimated ? t->estimate.rate_body_rad_s : reference->rate_body_rad_s;
    tc_to_body(c->axes, velocity, air);
    for (int i = 0; i < 3; i++) {
        air[i] *= on;
        rate[i] = on * rates[i];
    }
}

/* Battery sag and rotor lag, taken off the speed command. The lead (lag s + 1) / (filter s + 1) undoes the rotors' lag
   up to the filter's frequency; the plain inverse would drive the rotors with nothing but sensor noise. */
static float command_speed(tc_controller* c, int rotor, float wanted, float step_s) {
    const tc_parameters* p = &c->parameters;
    float* slow = &c->slow_speed_rad_s[rotor];
    if (!c->was_flying) *slow = wanted;
    const float filter_s = tc_max(p->lead_filter_s, step_s);
    *slow += (wanted - *slow) * tc_min(step_s / filter_s, 1.0f);
    const float lead = wanted + (p->rotor_lag_s / filter_s) * (wanted - *slow);
    const float battery_v = c->telemetry.estimate.battery_v;
    const float sag_v = battery_v > 0.0f ? p->battery_reference_v - battery_v : 0.0f;
    const float speed = lead / tc_max(1.0f - p->battery_gain_1_v * sag_v, 0.5f);
    return tc_clamp(speed, p->rotor_min_rad_s, p->rotor_max_rad_s);
}

static void fly(tc_controller* c, float step_s) {
    const tc_parameters* p = &c->parameters;
    tc_telemetry* t = &c->telemetry;
    tc_flat_input flat;
    tc_attitude_reference reference;
    float torque[3], moment[3], air[3], rate[3];
    tc_mix mix;
    t->saturation = 0;
    if (c->mission.state == TC_EMERGENCY) {
        emergency_force(c, &flat);
    } else {
        flight_force(c, step_s, &flat);
    }
    tc_flatness_step(&c->flatness, p, &flat, p->mass_kg * p->gravity_m_s2, step_s, &reference);
    tc_attitude_step(p, &reference, t->estimate.q_world_body, t->estimate.rate_body_rad_s, torque);
    airflow(c, &reference, air, rate);
    tc_modelled_moment(p, &c->mixer, air, t->estimate.rate_body_rad_s, c->wanted_speed_rad_s, moment);
    t->wrench.thrust_n = tc_max(tc_dot(c->axes[2], flat.force_world_n), 0.0f);
    for (int i = 0; i < 3; i++) t->wrench.torque_n_m[i] = torque[i] - moment[i];
    tc_mixer_solve(&c->mixer, p, &t->wrench, air, rate, &mix);
    t->saturation |= mix.saturation;
    for (int i = 0; i < TC_ROTORS; i++) {
        t->rotor_speed_rad_s[i] = command_speed(c, i, mix.rotor_speed_rad_s[i], step_s);
        c->wanted_speed_rad_s[i] = mix.rotor_speed_rad_s[i];
    }
    tc_copy4(t->q_reference, reference.q_world_body);
    tc_copy(t->rate_reference_rad_s, reference.rate_body_rad_s);
    c->was_flying = true;
}

/* On the ground or at fault: the rotors idle or stand, and the reference follows the vehicle. */
static void rest(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    const float speed = c->mission.state == TC_ARMED ? c->parameters.rotor_idle_rad_s : 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        t->rotor_speed_rad_s[i] = speed;
        c->wanted_speed_rad_s[i] = speed;
    }
    memset(&t->setpoint, 0, sizeof t->setpoint);
    memset(&t->wrench, 0, sizeof t->wrench);
    memset(t->rate_reference_rad_s, 0, sizeof t->rate_reference_rad_s);
    tc_copy(t->setpoint.position_world_m, t->estimate.position_world_m);
    tc_copy4(t->q_reference, t->estimate.q_world_body);
    t->saturation = 0;
    c->was_flying = false;
}

static void describe(tc_controller* c) {
    tc_telemetry* t = &c->telemetry;
    const tc_trajectory* active = tc_store_active(&c->store);
    t->state = c->mission.state;
    t->reason = c->mission.reason;
    t->path_rate = tc_mission_on_path(t->state) ? c->clock.rate[0] : 0.0f;
    t->path_time_us = c->clock.path_us;
    t->trajectory_id = active != NULL ? active->header.id : 0u;
    t->trajectory_crc32 = active != NULL ? active->header.crc32 : 0u;
    t->ticks++;
}

static void write_output(const tc_controller* c, tc_output* output) {
    for (int i = 0; i < TC_ROTORS; i++) output->rotor_speed_rad_s[i] = c->telemetry.rotor_speed_rad_s[i];
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
    if (!first && time_us <= c->last_tick_us) {
        c->telemetry.refused_ticks++;
        write_output(c, output);
        return TC_TIME_WENT_BACK;
    }
    const uint64_t step_us = first ? 0u : time_us - c->last_tick_us;
    const bool late = step_us > LONGEST_STEP_US;
    const float step_s = (float)(uint32_t)(late ? LONGEST_STEP_US : step_us) * 1e-6f;
    c->last_tick_us = time_us;
    c->telemetry.time_us = time_us;
    const uint8_t faults = tc_take_estimate(c, time_us, estimate);
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
