/* Messages about the vehicle. */
#include <math.h>
#include <string.h>

#include "../../base/maths.h"
#include "services.h"

enum { FRAME_LOCAL_FRD = 20, FRAME_BODY_FRD = 12 }; /* MAV_FRAME */
static const float RPM_PER_RAD_S = 9.5492966f;      /* 60 / (2 pi) */
enum { BATTERY_LIPO = 1 };                          /* MAV_BATTERY_TYPE */
static const float MOST_BATTERY_V = 65.0f;          /* that millivolts in 16 bits hold */

/* World (z up) to NED, body (y left, z up) to FRD, and back: a half turn about x. */
static void flip(const float in[3], float out[3]) {
    out[0] = in[0];
    out[1] = -in[1];
    out[2] = -in[2];
}

static uint32_t boot_ms(const tc_telemetry* t) { return (uint32_t)link_divide(t->time_us, 1000u); }

static float path_time_s(const tc_telemetry* t) {
    return tc_mission_on_path(t->state) ? (float)t->path_time_us * 1e-6f : -1.0f;
}

link_encoded link_encode_mission_status(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    const tc_link_counts* c = &link->counts;
    goshawk_mission_status_msg m = {
        .time_us = t->time_us,
        .boot_id = link->config->boot_id,
        .trajectory_time_s = path_time_s(t),
        .frames_refused = c->without_signature + c->wrong_key + c->replayed + c->unopened + c->over_budget +
                          c->faults.checksum_errors,
        .parameters_crc32 = tc_parameters_crc32(tc_parameters_now(link->controller)),
        .path_rate = t->path_rate,
        .mission_state = link->controller->mission.state,
        .reason = link->controller->mission.reason,
        .operator_system = link->lease.holder.system_id,
        .operator_component = link->lease.holder.component_id,
    };
    if (active != NULL) {
        m.active_id = active->header.id;
        m.active_crc32 = active->header.crc32;
        m.trajectory_duration_s = (float)tc_trajectory_duration_us(active) * 1e-6f;
        memcpy(m.map_hash, active->origin.map_hash, sizeof m.map_hash);
        memcpy(m.vehicle_hash, active->origin.vehicle_hash, sizeof m.vehicle_hash);
        memcpy(m.name, active->origin.name, sizeof m.name);
    }
    goshawk_mission_status_encode(&m, payload);
    return LINK_ENCODED;
}

static void fill_disturbance(const tc_controller* c, goshawk_state_msg* m) {
    const tc_observer* o = tc_observer_now(c);
    tc_copy(m->disturbance_force_world_n, o->force_world_n);
    tc_copy(m->disturbance_torque_body_n_m, o->torque_body_n_m);
    for (int i = 0; i < 3; i++) m->disturbance_torque_std_n_m[i] = sqrtf(o->torque_variance_n2_m2[i]);
    m->disturbance_force_std_n = sqrtf(o->force_variance_n2);
    m->pose_delay_s[0] = c->delay.attitude.delay_s + c->delay.velocity.delay_s;
    m->pose_delay_s[1] = c->delay.attitude.delay_s;
    m->observer_state = o->state;
}

void link_fill_state(const tc_link* link, goshawk_state_msg* m) {
    const tc_telemetry* t = &link->controller->telemetry;
    const tc_estimate* e = &t->estimate;
    memset(m, 0, sizeof *m);
    m->time_us = t->time_us;
    tc_copy(m->position_world_m, e->position_world_m);
    tc_copy(m->velocity_world_m_s, e->velocity_world_m_s);
    tc_copy4(m->q_world_body, e->q_world_body);
    tc_copy(m->rate_body_rad_s, e->rate_body_rad_s);
    tc_copy(m->specific_force_body_m_s2, e->specific_force_body_m_s2);
    tc_copy4(m->rotor_speed_rad_s, e->rotor_speed_rad_s);
    tc_copy4(m->rotor_speed_command_rad_s, t->rotor_speed_rad_s);
    tc_copy(m->setpoint_position_world_m, t->setpoint.position_world_m);
    tc_copy(m->setpoint_velocity_world_m_s, t->setpoint.velocity_world_m_s);
    tc_copy4(m->setpoint_q_world_body, t->flatness.q_reference);
    m->battery_v = e->battery_v;
    m->trajectory_time_s = path_time_s(t);
    m->path_rate = t->path_rate;
    m->path_limit = t->path_limit;
    m->reckoning_s = t->reckoning_s;
    m->reckoning_std_m = t->reckoning_std_m;
    m->sequence = link->state_sequence;
    m->mission_state = t->state;
    m->reason = t->reason;
    m->limit_reason = t->limit_reason;
    m->warnings = t->warnings;
    m->landing_stage = t->landing_stage;
    m->estimate_valid = e->valid;
    m->estimate_faults = t->estimate_faults;
    m->saturation = t->saturation;
    fill_disturbance(link->controller, m);
}

link_encoded link_encode_state(tc_link* link, uint8_t* payload) {
    goshawk_state_msg m;
    link_fill_state(link, &m);
    goshawk_state_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_home(tc_link* link, uint8_t* payload) {
    float ned_m[3];
    flip(link->home_world_m, ned_m);
    const home_position_msg m = {
        .x = ned_m[0], .y = ned_m[1], .z = ned_m[2], .q = {1.0f}, .time_usec = link->controller->telemetry.time_us};
    home_position_encode(&m, payload);
    return LINK_ENCODED;
}

/* NED from FRD. */
static void flip_attitude(const float q_world_body[4], float q[4]) {
    q[0] = q_world_body[0];
    flip(q_world_body + 1, q + 1);
}

link_encoded link_encode_attitude(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    float q[4], rate_rad_s[3];
    flip_attitude(t->estimate.q_world_body, q);
    flip(t->estimate.rate_body_rad_s, rate_rad_s);
    const attitude_quaternion_msg m = {.time_boot_ms = boot_ms(t),
                                       .q1 = q[0],
                                       .q2 = q[1],
                                       .q3 = q[2],
                                       .q4 = q[3],
                                       .rollspeed = rate_rad_s[0],
                                       .pitchspeed = rate_rad_s[1],
                                       .yawspeed = rate_rad_s[2]};
    attitude_quaternion_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_position(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    float position_m[3], velocity_m_s[3];
    flip(t->estimate.position_world_m, position_m);
    flip(t->estimate.velocity_world_m_s, velocity_m_s);
    const local_position_ned_msg m = {.time_boot_ms = boot_ms(t),
                                      .x = position_m[0],
                                      .y = position_m[1],
                                      .z = position_m[2],
                                      .vx = velocity_m_s[0],
                                      .vy = velocity_m_s[1],
                                      .vz = velocity_m_s[2]};
    local_position_ned_encode(&m, payload);
    return LINK_ENCODED;
}

/* Velocity is along the axes of the body. The covariances are not known: their first number is NaN. */
link_encoded link_encode_odometry(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    const tc_estimate* e = &t->estimate;
    float axes[3][3], velocity_body_m_s[3], position_m[3], velocity_m_s[3], rate_rad_s[3];
    tc_q_axes(e->q_world_body, axes);
    tc_to_body(axes, e->velocity_world_m_s, velocity_body_m_s);
    flip(e->position_world_m, position_m);
    flip(velocity_body_m_s, velocity_m_s);
    flip(e->rate_body_rad_s, rate_rad_s);
    odometry_msg m = {.time_usec = t->time_us,
                      .x = position_m[0],
                      .y = position_m[1],
                      .z = position_m[2],
                      .vx = velocity_m_s[0],
                      .vy = velocity_m_s[1],
                      .vz = velocity_m_s[2],
                      .rollspeed = rate_rad_s[0],
                      .pitchspeed = rate_rad_s[1],
                      .yawspeed = rate_rad_s[2],
                      .pose_covariance = {NAN},
                      .velocity_covariance = {NAN},
                      .frame_id = FRAME_LOCAL_FRD,
                      .child_frame_id = FRAME_BODY_FRD};
    flip_attitude(e->q_world_body, m.q);
    odometry_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_rotors(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    esc_status_msg m = {.time_usec = t->time_us};
    for (unsigned i = 0; i < TC_ROTORS; i++) {
        m.rpm[i] = (int32_t)(t->estimate.rotor_speed_rad_s[i] * RPM_PER_RAD_S);
        m.voltage[i] = t->estimate.battery_v;
    }
    esc_status_encode(&m, payload);
    return LINK_ENCODED;
}

uint16_t link_battery_mv(const tc_link* link) {
    const float battery_v = link->controller->telemetry.estimate.battery_v;
    return battery_v > 0.0f && battery_v < MOST_BATTERY_V ? (uint16_t)(battery_v * 1000.0f) : UINT16_MAX;
}

/* Nothing but the voltage is known. */
link_encoded link_encode_battery(tc_link* link, uint8_t* payload) {
    battery_status_msg m = {.current_consumed = -1,
                            .energy_consumed = -1,
                            .temperature = INT16_MAX,
                            .current_battery = -1,
                            .battery_remaining = -1,
                            .type = BATTERY_LIPO};
    for (unsigned i = 0; i < sizeof m.voltages / sizeof m.voltages[0]; i++) {
        m.voltages[i] = UINT16_MAX;
    }
    m.voltages[0] = link_battery_mv(link);
    battery_status_encode(&m, payload);
    return LINK_ENCODED;
}
