/* What the vehicle tells unasked, and the on-board log, whose records are the same bytes. */
#include <math.h>
#include <string.h>

#include "link_parts.h"

#define HEARTBEAT_US 1000000u
#define STATUS_US 200000u   /* GOSHAWK_MISSION_STATUS */
#define STANDARD_US 50000u  /* ATTITUDE_QUATERNION, LOCAL_POSITION_NED; every other time ODOMETRY */
#define SLOW_US 500000u     /* ESC_STATUS, BATTERY_STATUS */
#define VERSION_US 5000000u /* AUTOPILOT_VERSION, HOME_POSITION */
#define FRAME_LOCAL_FRD 20u
#define FRAME_BODY_FRD 12u

enum { DUE_ATTITUDE = 1, DUE_POSITION = 2, DUE_ESC = 4, DUE_BATTERY = 8, DUE_ODOMETRY = 16 };

/* When the next one of a series is due. A late one is not made up for. */
static bool due(uint64_t* next_us, uint64_t now_us, uint32_t period_us) {
    if (now_us < *next_us) {
        return false;
    }
    *next_us = now_us - *next_us < period_us ? *next_us + period_us : now_us + period_us;
    return true;
}

static bool on_path(uint8_t state) { return tc_mission_on_path(state); }

/* The last tick, with what was measured at it. */
static void encode_state(const tc_link* link, uint8_t record[TC_LINK_RECORD]) {
    const tc_link_measured* measured = &link->telemetry.measured;
    const tc_telemetry* t = &link->controller->telemetry;
    goshawk_state_msg m;
    memset(&m, 0, sizeof m);
    m.time_us = t->time_us;
    memcpy(m.position_world_m, t->estimate.position_world_m, sizeof m.position_world_m);
    memcpy(m.velocity_world_m_s, t->estimate.velocity_world_m_s, sizeof m.velocity_world_m_s);
    memcpy(m.q_world_body, t->estimate.q_world_body, sizeof m.q_world_body);
    memcpy(m.rate_body_rad_s, t->estimate.rate_body_rad_s, sizeof m.rate_body_rad_s);
    memcpy(m.specific_force_body_m_s2, measured->specific_force_body_m_s2, sizeof m.specific_force_body_m_s2);
    memcpy(m.rotor_speed_rad_s, measured->rotor_speed_rad_s, sizeof m.rotor_speed_rad_s);
    memcpy(m.rotor_speed_command_rad_s, t->rotor_speed_rad_s, sizeof m.rotor_speed_command_rad_s);
    memcpy(m.setpoint_position_world_m, t->setpoint.position_world_m, sizeof m.setpoint_position_world_m);
    memcpy(m.setpoint_velocity_world_m_s, t->setpoint.velocity_world_m_s, sizeof m.setpoint_velocity_world_m_s);
    memcpy(m.setpoint_q_world_body, t->flatness.q_reference, sizeof m.setpoint_q_world_body);
    m.battery_v = t->estimate.battery_v;
    m.trajectory_time_s = on_path(t->state) ? (float)t->path_time_us * 1e-6f : -1.0f;
    m.sequence = link->telemetry.state_sequence;
    m.mission_state = t->state;
    m.saturation = t->saturation;
    goshawk_state_encode(&m, record);
}

uint8_t link_log_start(tc_link* link, uint32_t id) {
    if (link->config->log == NULL || link->config->log_records == 0u || link->config->log_period_us == 0u) {
        return TC_LINK_NO_LOG_MEMORY;
    }
    memset(&link->log, 0, sizeof link->log);
    link->read.wanted.next = 8u * TC_LINK_WANTED; /* of the old log nothing is left to send */
    link->log.id = id;
    link->log.running = true;
    /* On whole multiples of the period, so that the spacing is even from the first record on. */
    link->log.due_us =
        (link->controller->telemetry.time_us / link->config->log_period_us + 1u) * link->config->log_period_us;
    return TC_OK;
}

static void write_log(tc_link* link) {
    if (!link->log.running ||
        !due(&link->log.due_us, link->controller->telemetry.time_us, link->config->log_period_us)) {
        return;
    }
    if (link->log.records == link->config->log_records) {
        link->log.not_stored++;
        return;
    }
    encode_state(link, link->config->log + (size_t)TC_LINK_RECORD * link->log.records);
    link->log.records++;
}

void link_telemetry_update(tc_link* link, const tc_link_measured* measured, uint64_t now_us) {
    const uint64_t vehicle_us = link->controller->telemetry.time_us;
    link->telemetry.measured = *measured;
    write_log(link);
    if (link->telemetry.state_period_us != 0u &&
        due(&link->telemetry.state_due_us, vehicle_us, link->telemetry.state_period_us)) {
        link->telemetry.state_sequence++;
        link->telemetry.state_ready = true;
    }
    if (due(&link->telemetry.standard_due_us, vehicle_us, STANDARD_US)) {
        const bool second = (link->telemetry.standard_due_us / STANDARD_US) % 2u == 0u;
        link->telemetry.standard |= DUE_ATTITUDE | DUE_POSITION | (second ? DUE_ODOMETRY : 0);
    }
    if (due(&link->telemetry.slow_due_us, vehicle_us, SLOW_US)) {
        link->telemetry.standard |= DUE_ESC | DUE_BATTERY;
    }
    if (!tc_mission_in_air(link->controller->mission.state)) {
        memcpy(link->telemetry.home_world_m, link->controller->telemetry.estimate.position_world_m,
               sizeof link->telemetry.home_world_m);
    }
    if (link->telemetry.transitions != link->controller->mission.transitions) {
        link->telemetry.transitions = link->controller->mission.transitions;
        link->telemetry.status_us = now_us;
        link->telemetry.text = true;
    }
}

static unsigned send_heartbeat(tc_link* link, uint8_t* payload, uint32_t* id) {
    const uint8_t state = link->controller->mission.state;
    const bool in_trouble = state == (uint8_t)TC_EMERGENCY || state == (uint8_t)TC_FAULT;
    heartbeat_msg m;
    m.type = 2;      /* MAV_TYPE_QUADROTOR */
    m.autopilot = 0; /* MAV_AUTOPILOT_GENERIC */
    m.base_mode = tc_mission_rotors_on(state) ? 1u + 8u + 128u : 1u + 8u;
    m.custom_mode = state;
    m.system_status = in_trouble ? 6u : tc_mission_in_air(state) ? 4u : 3u;
    m.mavlink_version = 3;
    heartbeat_encode(&m, payload);
    *id = HEARTBEAT_ID;
    return HEARTBEAT_LENGTH;
}

static unsigned send_status(tc_link* link, uint8_t* payload, uint32_t* id) {
    const tc_telemetry* t = &link->controller->telemetry;
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    const tc_link_counts* c = &link->counts;
    goshawk_mission_status_msg m;
    memset(&m, 0, sizeof m);
    m.time_us = t->time_us;
    m.boot_id = link->config->boot_id;
    if (active != NULL) {
        m.active_id = active->header.id;
        m.active_crc32 = active->header.crc32;
        m.trajectory_duration_s = (float)tc_trajectory_duration_us(active) * 1e-6f;
        memcpy(m.map_hash, active->origin.map_hash, sizeof m.map_hash);
        memcpy(m.vehicle_hash, active->origin.vehicle_hash, sizeof m.vehicle_hash);
        memcpy(m.name, active->origin.name, sizeof m.name);
    }
    m.trajectory_time_s = on_path(t->state) ? (float)t->path_time_us * 1e-6f : -1.0f;
    m.frames_refused = c->without_signature + c->wrong_key + c->replayed + c->faults.checksum_errors;
    m.parameters_crc32 = tc_parameters_crc32(tc_parameters_now(link->controller));
    m.path_rate = t->path_rate;
    m.mission_state = link->controller->mission.state;
    m.reason = link->controller->mission.reason;
    m.operator_system = link->lease.system_id;
    m.operator_component = link->lease.component_id;
    goshawk_mission_status_encode(&m, payload);
    *id = GOSHAWK_MISSION_STATUS_ID;
    return GOSHAWK_MISSION_STATUS_LENGTH;
}

static unsigned send_text(tc_link* link, uint8_t* payload, uint32_t* id) {
    const char* words = tc_transition_text(link->controller->mission.reason);
    const uint8_t state = link->controller->mission.state;
    statustext_msg m;
    memset(&m, 0, sizeof m);
    m.severity = state == (uint8_t)TC_EMERGENCY || state == (uint8_t)TC_FAULT ? 3u : 6u;
    for (unsigned i = 0; i < sizeof m.text; i++) { /* at the end of the words it stays at their zero */
        m.text[i] = *words;
        words += *words != '\0' ? 1 : 0;
    }
    link->telemetry.text = false;
    statustext_encode(&m, payload);
    *id = STATUSTEXT_ID;
    return STATUSTEXT_LENGTH;
}

static unsigned send_version(tc_link* link, uint8_t* payload, uint32_t* id) {
    autopilot_version_msg m;
    memset(&m, 0, sizeof m);
    m.capabilities = 8192u; /* MAV_PROTOCOL_CAPABILITY_MAVLINK2 */
    m.flight_sw_version = 0x00010000u;
    m.uid = link->config->system_id;
    link->telemetry.version = false;
    autopilot_version_encode(&m, payload);
    *id = AUTOPILOT_VERSION_ID;
    return AUTOPILOT_VERSION_LENGTH;
}

/* Three of our numbers as MAVLink's (NED from world, FRD from body: a half turn about x), at a place of the payload. */
static void put_flipped(uint8_t* payload, unsigned at, const float v[3]) {
    goshawk_put_f32(payload + at, v[0]);
    goshawk_put_f32(payload + at + 4u, -v[1]);
    goshawk_put_f32(payload + at + 8u, -v[2]);
}

static unsigned send_attitude(const tc_telemetry* t, uint8_t* payload, uint32_t* id) {
    memset(payload, 0, ATTITUDE_QUATERNION_LENGTH);
    goshawk_put_u32(payload + ATTITUDE_QUATERNION_TIME_BOOT_MS_AT, (uint32_t)(t->time_us / 1000u));
    goshawk_put_f32(payload + ATTITUDE_QUATERNION_Q1_AT, t->estimate.q_world_body[0]);
    put_flipped(payload, ATTITUDE_QUATERNION_Q2_AT, &t->estimate.q_world_body[1]);
    put_flipped(payload, ATTITUDE_QUATERNION_ROLLSPEED_AT, t->estimate.rate_body_rad_s);
    *id = ATTITUDE_QUATERNION_ID;
    return ATTITUDE_QUATERNION_LENGTH;
}

static unsigned send_position(const tc_telemetry* t, uint8_t* payload, uint32_t* id) {
    goshawk_put_u32(payload + LOCAL_POSITION_NED_TIME_BOOT_MS_AT, (uint32_t)(t->time_us / 1000u));
    put_flipped(payload, LOCAL_POSITION_NED_X_AT, t->estimate.position_world_m);
    put_flipped(payload, LOCAL_POSITION_NED_VX_AT, t->estimate.velocity_world_m_s);
    *id = LOCAL_POSITION_NED_ID;
    return LOCAL_POSITION_NED_LENGTH;
}

/* Straight into the payload: the message's struct has 240 bytes, most of them covariances that nobody knows. */
static unsigned send_odometry(const tc_controller* c, uint8_t* payload, uint32_t* id) {
    const tc_estimate* e = &c->telemetry.estimate;
    float along[3];
    for (unsigned i = 0; i < 3u; i++) {
        along[i] = c->axes[i][0] * e->velocity_world_m_s[0] + c->axes[i][1] * e->velocity_world_m_s[1] +
                   c->axes[i][2] * e->velocity_world_m_s[2];
    }
    memset(payload, 0, ODOMETRY_LENGTH);
    goshawk_put_u64(payload + ODOMETRY_TIME_USEC_AT, c->telemetry.time_us);
    put_flipped(payload, ODOMETRY_X_AT, e->position_world_m);
    goshawk_put_f32(payload + ODOMETRY_Q_AT, e->q_world_body[0]);
    put_flipped(payload, ODOMETRY_Q_AT + 4u, &e->q_world_body[1]);
    put_flipped(payload, ODOMETRY_VX_AT, along);
    put_flipped(payload, ODOMETRY_ROLLSPEED_AT, e->rate_body_rad_s);
    goshawk_put_f32(payload + ODOMETRY_POSE_COVARIANCE_AT, NAN);
    goshawk_put_f32(payload + ODOMETRY_VELOCITY_COVARIANCE_AT, NAN);
    payload[ODOMETRY_FRAME_ID_AT] = FRAME_LOCAL_FRD;
    payload[ODOMETRY_CHILD_FRAME_ID_AT] = FRAME_BODY_FRD;
    *id = ODOMETRY_ID;
    return ODOMETRY_LENGTH;
}

static unsigned send_home(tc_link* link, uint8_t* payload, uint32_t* id) {
    memset(payload, 0, HOME_POSITION_LENGTH);
    put_flipped(payload, HOME_POSITION_X_AT, link->telemetry.home_world_m);
    goshawk_put_f32(payload + HOME_POSITION_Q_AT, 1.0f);
    goshawk_put_u64(payload + HOME_POSITION_TIME_USEC_AT, link->controller->telemetry.time_us);
    link->telemetry.home = false;
    *id = HOME_POSITION_ID;
    return HOME_POSITION_LENGTH;
}

static unsigned send_esc(tc_link* link, uint8_t* payload, uint32_t* id) {
    const float rpm_per_rad_s = 9.5492966f;
    esc_status_msg m;
    memset(&m, 0, sizeof m);
    m.time_usec = link->controller->telemetry.time_us;
    for (unsigned i = 0; i < TC_ROTORS; i++) {
        m.rpm[i] = (int32_t)(link->telemetry.measured.rotor_speed_rad_s[i] * rpm_per_rad_s);
        m.voltage[i] = link->controller->telemetry.estimate.battery_v;
    }
    esc_status_encode(&m, payload);
    *id = ESC_STATUS_ID;
    return ESC_STATUS_LENGTH;
}

static unsigned send_battery(const tc_telemetry* t, uint8_t* payload, uint32_t* id) {
    const float millivolts = t->estimate.battery_v * 1000.0f;
    battery_status_msg m;
    memset(&m, 0, sizeof m);
    m.type = 1;
    m.temperature = INT16_MAX;
    memset(m.voltages, 0xFF, sizeof m.voltages);
    if (millivolts > 0.0f && millivolts < 65000.0f) {
        m.voltages[0] = (uint16_t)millivolts;
    }
    m.current_battery = -1;
    m.current_consumed = -1;
    m.energy_consumed = -1;
    m.battery_remaining = -1;
    battery_status_encode(&m, payload);
    *id = BATTERY_STATUS_ID;
    return BATTERY_STATUS_LENGTH;
}

static unsigned send_standard(tc_link* link, uint8_t* payload, uint32_t* id) {
    const tc_telemetry* t = &link->controller->telemetry;
    const unsigned waiting = link->telemetry.standard;
    link->telemetry.standard = (uint8_t)(waiting & (waiting - 1u)); /* takes the lowest bit off */
    switch (waiting & ~(waiting - 1u)) {
        case DUE_ATTITUDE:
            return send_attitude(t, payload, id);
        case DUE_POSITION:
            return send_position(t, payload, id);
        case DUE_ESC:
            return send_esc(link, payload, id);
        case DUE_ODOMETRY:
            return send_odometry(link->controller, payload, id);
        default:
            return send_battery(t, payload, id);
    }
}

unsigned link_send_telemetry(tc_link* link, uint64_t now_us, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id) {
    if (due(&link->telemetry.heartbeat_us, now_us, HEARTBEAT_US)) {
        return send_heartbeat(link, payload, id);
    }
    if (due(&link->telemetry.status_us, now_us, STATUS_US)) {
        return send_status(link, payload, id);
    }
    if (link->telemetry.state_ready) {
        link->telemetry.state_ready = false;
        encode_state(link, payload);
        *id = GOSHAWK_STATE_ID;
        return GOSHAWK_STATE_LENGTH;
    }
    if (link->telemetry.text) {
        return send_text(link, payload, id);
    }
    if (link->telemetry.version || due(&link->telemetry.version_us, now_us, VERSION_US)) {
        link->telemetry.home = link->telemetry.home || !link->telemetry.version; /* the regular one brings its fellow */
        return send_version(link, payload, id);
    }
    if (link->telemetry.home) {
        return send_home(link, payload, id);
    }
    return link->telemetry.standard != 0u ? send_standard(link, payload, id) : 0u;
}

void link_on_log_request(tc_link* link, goshawk_payload payload) {
    const uint32_t first = goshawk_get_u32(payload, GOSHAWK_LOG_REQUEST_FIRST_AT);
    link->log.info = !link_want(link, true, first, payload, GOSHAWK_LOG_REQUEST_WANTED_AT);
}

static unsigned send_log_info(tc_link* link, uint8_t* payload, uint32_t* id) {
    goshawk_log_info_msg m;
    memset(&m, 0, sizeof m);
    m.log_id = link->log.id;
    m.records = link->log.records;
    m.capacity = link->config->log_records;
    m.not_stored = link->log.not_stored;
    m.period_us = link->config->log_period_us;
    m.running = link->log.running ? 1u : 0u;
    link->log.info = false;
    goshawk_log_info_encode(&m, payload);
    *id = GOSHAWK_LOG_INFO_ID;
    return GOSHAWK_LOG_INFO_LENGTH;
}

unsigned link_send_log(tc_link* link, uint8_t payload[TC_PAYLOAD_MAX], uint32_t* id) {
    if (link->log.info) {
        return send_log_info(link, payload, id);
    }
    const uint32_t index = link_take(link, true, link->log.records);
    if (index >= link->log.records) {
        return 0;
    }
    goshawk_log_record_msg m;
    m.log_id = link->log.id;
    m.index = index;
    memcpy(m.record, link->config->log + (size_t)TC_LINK_RECORD * index, sizeof m.record);
    goshawk_log_record_encode(&m, payload);
    *id = GOSHAWK_LOG_RECORD_ID;
    return GOSHAWK_LOG_RECORD_LENGTH;
}
