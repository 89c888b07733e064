/* What the vehicle tells unasked, and the on-board log, whose records are the same bytes. */
#include <math.h>
#include <string.h>

#include "link_parts.h"

#define FRAME_LOCAL_FRD 20u
#define FRAME_BODY_FRD 12u

typedef struct {
    uint32_t period_us, due;
} series;

/* The period of the state is what the ground asked for. */
static const series all_series[TC_LINK_SERIES] = {
    [SERIES_STATE] = {0, DUE(SAY_STATE)},
    [SERIES_POSE] = {50000u, DUE(SAY_ATTITUDE) | DUE(SAY_POSITION)},
    [SERIES_ODOMETRY] = {100000u, DUE(SAY_ODOMETRY)},
    [SERIES_SLOW] = {500000u, DUE(SAY_ROTORS) | DUE(SAY_BATTERY)},
    [SERIES_HEARTBEAT] = {1000000u, DUE(SAY_HEARTBEAT)},
    [SERIES_MISSION] = {200000u, DUE(SAY_MISSION)},
    [SERIES_VERSION] = {5000000u, DUE(SAY_VERSION) | DUE(SAY_HOME)},
};

bool link_due(uint32_t* next_us, uint32_t now_us, uint32_t period_us) {
    if ((uint32_t)(*next_us - now_us - 1u) < period_us) {
        return false; /* ahead by no more than a period */
    }
    *next_us = (now_us - *next_us < period_us ? *next_us : now_us) + period_us;
    return true;
}

void link_series(tc_link* link, unsigned first, unsigned end, uint32_t now_us) {
    for (unsigned i = first; i < end; i++) {
        const uint32_t period_us = i == (unsigned)SERIES_STATE ? link->state_period_us : all_series[i].period_us;
        if (period_us != 0u && link_due(&link->due_us[i], now_us, period_us)) {
            link->due |= all_series[i].due;
            link->state_sequence = (uint16_t)(link->state_sequence + (i == (unsigned)SERIES_STATE ? 1u : 0u));
        }
    }
}

uint64_t link_quotient(uint64_t time, uint32_t unit) {
    const uint32_t high = (uint32_t)(time >> 32);
    const uint32_t middle = ((high % unit) << 16) | ((uint32_t)(time >> 16) & 0xFFFFu);
    const uint32_t low = ((middle % unit) << 16) | ((uint32_t)time & 0xFFFFu);
    return ((uint64_t)(high / unit) << 32) + ((uint64_t)(middle / unit) << 16) + (uint64_t)(low / unit);
}

static float path_time_s(const tc_telemetry* t) {
    return tc_mission_on_path(t->state) ? (float)t->path_time_us * 1e-6f : -1.0f;
}

static uint8_t* put(uint8_t* place, const void* from, size_t n) {
    memcpy(place, from, n);
    return place + n;
}

/* Neighbours in memory that are neighbours in the record. */
_Static_assert(offsetof(tc_estimate, battery_v) - offsetof(tc_estimate, position_world_m) == 52, "one piece");
_Static_assert(GOSHAWK_STATE_SPECIFIC_FORCE_BODY_M_S2_AT - GOSHAWK_STATE_POSITION_WORLD_M_AT == 52, "one piece");
_Static_assert(offsetof(tc_setpoint, acceleration_world_m_s2) == 24, "position and velocity are one piece");
_Static_assert(sizeof(tc_link_measured) == 28, "force and rotor speeds are one piece");

/* The last tick, with what was measured at it; field by field as GOSHAWK_STATE lies. */
static void encode_state(const tc_link* link, uint8_t record[TC_LINK_RECORD]) {
    const tc_telemetry* t = &link->controller->telemetry;
    const float trajectory_time_s = path_time_s(t);
    uint8_t* at = put(record, &t->time_us, sizeof t->time_us);
    at = put(at, (const uint8_t*)&t->estimate + offsetof(tc_estimate, position_world_m), 52);
    at = put(at, &link->measured, sizeof link->measured);
    at = put(at, t->rotor_speed_rad_s, sizeof t->rotor_speed_rad_s);
    at = put(at, &t->setpoint, 24);
    at = put(at, t->flatness.q_reference, sizeof t->flatness.q_reference);
    at = put(at, &t->estimate.battery_v, 4);
    at = put(at, &trajectory_time_s, 4);
    at = put(at, &link->state_sequence, 2);
    at[0] = t->state;
    at[1] = t->saturation;
}

uint8_t link_log_start(tc_link* link, uint32_t id) {
    const uint32_t now_us = (uint32_t)link->controller->telemetry.time_us;
    const uint32_t period_us = link->config->log_period_us;
    if (link->config->log == NULL || link->config->log_records == 0u || period_us == 0u) {
        return TC_LINK_NO_LOG_MEMORY;
    }
    memset(&link->log, 0, sizeof link->log);
    link->due &= ~DUE(SAY_RECORD); /* of the old log nothing is left to send */
    link->log.id = id;
    link->log.running = 1;
    /* On whole multiples of the period, so that the spacing is even from the first record on. */
    link->log_due_us = now_us - now_us % period_us + period_us;
    return TC_OK;
}

static void write_log(tc_link* link, uint32_t now_us) {
    tc_link_log* log = &link->log;
    if (log->running == 0u || !link_due(&link->log_due_us, now_us, link->config->log_period_us)) {
        return;
    }
    if (log->records == link->config->log_records) {
        log->not_stored++;
        return;
    }
    encode_state(link, link->config->log + (size_t)TC_LINK_RECORD * log->records);
    log->records++;
}

void link_telemetry_update(tc_link* link, const tc_link_measured* measured) {
    const tc_telemetry* t = &link->controller->telemetry;
    link->measured = *measured;
    write_log(link, (uint32_t)t->time_us);
    link_series(link, SERIES_STATE, SERIES_HEARTBEAT, (uint32_t)t->time_us);
    if (!tc_mission_in_air(link->controller->mission.state)) {
        memcpy(link->home_world_m, t->estimate.position_world_m, sizeof link->home_world_m);
    }
}

bool link_say_record(tc_link* link, uint8_t* payload) {
    const uint32_t index = link_take(link, link->log.records);
    if (index >= link->log.records) {
        return false;
    }
    memcpy(payload, &link->log.id, 4);
    memcpy(payload + GOSHAWK_LOG_RECORD_INDEX_AT, &index, 4);
    memcpy(payload + GOSHAWK_LOG_RECORD_RECORD_AT, link->config->log + (size_t)TC_LINK_RECORD * index, TC_LINK_RECORD);
    link->due |= DUE(SAY_RECORD);
    return true;
}

static void put_u32(uint8_t* place, uint32_t value) { memcpy(place, &value, 4); }

static void put_f32(uint8_t* place, float value) { memcpy(place, &value, 4); }

static bool in_trouble(uint8_t state) { return state == (uint8_t)TC_EMERGENCY || state == (uint8_t)TC_FAULT; }

static void say_heartbeat(uint8_t state, uint8_t* payload) {
    payload[HEARTBEAT_CUSTOM_MODE_AT] = state;
    payload[HEARTBEAT_TYPE_AT] = 2; /* MAV_TYPE_QUADROTOR; the autopilot is 0, MAV_AUTOPILOT_GENERIC */
    payload[HEARTBEAT_BASE_MODE_AT] = tc_mission_rotors_on(state) ? 1u + 8u + 128u : 1u + 8u;
    payload[HEARTBEAT_SYSTEM_STATUS_AT] = in_trouble(state) ? 6u : tc_mission_in_air(state) ? 4u : 3u;
    payload[HEARTBEAT_MAVLINK_VERSION_AT] = 3;
}

static void say_mission(const tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    const tc_trajectory* active = tc_store_active(&link->controller->store);
    const tc_link_counts* c = &link->counts;
    const uint32_t refused = c->without_signature + c->wrong_key + c->replayed + c->faults.checksum_errors;
    memcpy(payload, &t->time_us, 8);
    put_u32(payload + GOSHAWK_MISSION_STATUS_BOOT_ID_AT, link->config->boot_id);
    if (active != NULL) {
        const float duration_s = (float)tc_trajectory_duration_us(active) * 1e-6f;
        memcpy(payload + GOSHAWK_MISSION_STATUS_ACTIVE_ID_AT, &active->header, 8);
        put_f32(payload + GOSHAWK_MISSION_STATUS_TRAJECTORY_DURATION_S_AT, duration_s);
        memcpy(payload + GOSHAWK_MISSION_STATUS_MAP_HASH_AT, &active->origin, sizeof active->origin);
    }
    put_f32(payload + GOSHAWK_MISSION_STATUS_TRAJECTORY_TIME_S_AT, path_time_s(t));
    put_u32(payload + GOSHAWK_MISSION_STATUS_FRAMES_REFUSED_AT, refused);
    put_u32(payload + GOSHAWK_MISSION_STATUS_PARAMETERS_CRC32_AT,
            tc_parameters_crc32(tc_parameters_now(link->controller)));
    put_f32(payload + GOSHAWK_MISSION_STATUS_PATH_RATE_AT, t->path_rate);
    payload[GOSHAWK_MISSION_STATUS_MISSION_STATE_AT] = link->controller->mission.state;
    payload[GOSHAWK_MISSION_STATUS_REASON_AT] = link->controller->mission.reason;
    payload[GOSHAWK_MISSION_STATUS_OPERATOR_SYSTEM_AT] = link->lease.system_id;
    payload[GOSHAWK_MISSION_STATUS_OPERATOR_COMPONENT_AT] = link->lease.component_id;
}

static void say_text(const tc_mission* mission, uint8_t* payload) {
    const char* words = tc_transition_text(mission->reason);
    payload[STATUSTEXT_SEVERITY_AT] = in_trouble(mission->state) ? 3u : 6u;
    for (unsigned at = STATUSTEXT_TEXT_AT; at < (unsigned)STATUSTEXT_ID_AT; at++) {
        payload[at] = (uint8_t)*words; /* at the end of the words it stays at their zero */
        words += *words != '\0' ? 1 : 0;
    }
}

static void say_version(const tc_link* link, uint8_t* payload) {
    payload[AUTOPILOT_VERSION_CAPABILITIES_AT + 1] = 32;     /* 8192, MAV_PROTOCOL_CAPABILITY_MAVLINK2 */
    payload[AUTOPILOT_VERSION_FLIGHT_SW_VERSION_AT + 2] = 1; /* 0x00010000 */
    payload[AUTOPILOT_VERSION_UID_AT] = link->config->system_id;
}

/* Three of our numbers as MAVLink's: NED from world, FRD from body, a half turn about x. */
static void put_flipped(uint8_t* place, const float v[3]) {
    put_f32(place, v[0]);
    put_f32(place + 4, -v[1]);
    put_f32(place + 8, -v[2]);
}

/* A unit quaternion likewise. */
static void put_flipped_q(uint8_t* place, const float q[4]) {
    put_f32(place, q[0]);
    put_flipped(place + 4, q + 1);
}

static void put_boot_ms(uint8_t* payload, const tc_telemetry* t) {
    put_u32(payload, (uint32_t)link_quotient(t->time_us, 1000));
}

static void say_attitude(const tc_telemetry* t, uint8_t* payload) {
    put_boot_ms(payload, t);
    put_flipped_q(payload + ATTITUDE_QUATERNION_Q1_AT, t->estimate.q_world_body);
    put_flipped(payload + ATTITUDE_QUATERNION_ROLLSPEED_AT, t->estimate.rate_body_rad_s);
}

static void say_position(const tc_telemetry* t, uint8_t* payload) {
    put_boot_ms(payload, t);
    put_flipped(payload + LOCAL_POSITION_NED_X_AT, t->estimate.position_world_m);
    put_flipped(payload + LOCAL_POSITION_NED_VX_AT, t->estimate.velocity_world_m_s);
}

static void say_odometry(const tc_controller* c, uint8_t* payload) {
    const tc_estimate* e = &c->telemetry.estimate;
    float along[3];
    for (unsigned i = 0; i < 3u; i++) {
        along[i] = c->axes[i][0] * e->velocity_world_m_s[0] + c->axes[i][1] * e->velocity_world_m_s[1] +
                   c->axes[i][2] * e->velocity_world_m_s[2];
    }
    memcpy(payload, &c->telemetry.time_us, 8);
    put_flipped(payload + ODOMETRY_X_AT, e->position_world_m);
    put_flipped_q(payload + ODOMETRY_Q_AT, e->q_world_body);
    put_flipped(payload + ODOMETRY_VX_AT, along);
    put_flipped(payload + ODOMETRY_ROLLSPEED_AT, e->rate_body_rad_s);
    put_f32(payload + ODOMETRY_POSE_COVARIANCE_AT, NAN); /* nobody knows them */
    put_f32(payload + ODOMETRY_VELOCITY_COVARIANCE_AT, NAN);
    payload[ODOMETRY_FRAME_ID_AT] = FRAME_LOCAL_FRD;
    payload[ODOMETRY_CHILD_FRAME_ID_AT] = FRAME_BODY_FRD;
}

static void say_home(const tc_link* link, uint8_t* payload) {
    put_flipped(payload + HOME_POSITION_X_AT, link->home_world_m);
    put_f32(payload + HOME_POSITION_Q_AT, 1.0f);
    memcpy(payload + HOME_POSITION_TIME_USEC_AT, &link->controller->telemetry.time_us, 8);
}

static void say_rotors(const tc_link* link, uint8_t* payload) {
    const float rpm_per_rad_s = 9.5492966f;
    const tc_telemetry* t = &link->controller->telemetry;
    memcpy(payload, &t->time_us, 8);
    for (unsigned i = 0; i < TC_ROTORS; i++) {
        const int32_t rpm = (int32_t)(link->measured.rotor_speed_rad_s[i] * rpm_per_rad_s);
        put_u32(payload + ESC_STATUS_RPM_AT + 4u * i, (uint32_t)rpm);
        put_f32(payload + ESC_STATUS_VOLTAGE_AT + 4u * i, t->estimate.battery_v);
    }
}

/* Nothing but the voltage is known. */
static void say_battery(const tc_telemetry* t, uint8_t* payload) {
    const float millivolts = t->estimate.battery_v * 1000.0f;
    memset(payload, 0xFF, BATTERY_STATUS_TIME_REMAINING_AT);
    payload[BATTERY_STATUS_ID_AT] = 0;
    payload[BATTERY_STATUS_BATTERY_FUNCTION_AT] = 0;
    payload[BATTERY_STATUS_TYPE_AT] = 1;
    payload[BATTERY_STATUS_TEMPERATURE_AT + 1] = 0x7F; /* INT16_MAX */
    if (millivolts > 0.0f && millivolts < 65000.0f) {
        const uint16_t rounded = (uint16_t)millivolts;
        memcpy(payload + BATTERY_STATUS_VOLTAGES_AT, &rounded, 2);
    }
}

void link_say_telemetry(const tc_link* link, unsigned what, uint8_t* payload) {
    const tc_controller* c = link->controller;
    switch (what) {
        case SAY_HEARTBEAT:
            say_heartbeat(c->mission.state, payload);
            break;
        case SAY_MISSION:
            say_mission(link, payload);
            break;
        case SAY_STATE:
            encode_state(link, payload);
            break;
        case SAY_TEXT:
            say_text(&c->mission, payload);
            break;
        case SAY_VERSION:
            say_version(link, payload);
            break;
        case SAY_HOME:
            say_home(link, payload);
            break;
        case SAY_ATTITUDE:
            say_attitude(&c->telemetry, payload);
            break;
        case SAY_POSITION:
            say_position(&c->telemetry, payload);
            break;
        case SAY_ROTORS:
            say_rotors(link, payload);
            break;
        case SAY_BATTERY:
            say_battery(&c->telemetry, payload);
            break;
        case SAY_ODOMETRY:
            say_odometry(c, payload);
            break;
        default:
            break; /* it lies there already */
    }
}
