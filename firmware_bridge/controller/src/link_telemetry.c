/* What the vehicle tells unasked, and the on-board log, whose records are the same bytes. */
#include <math.h>
#include <string.h>

#include "copy.h"
#include "link_parts.h"

#define FRAME_LOCAL_FRD 20u
#define FRAME_BODY_FRD 12u

typedef struct {
    uint16_t period_ms;
    uint8_t first; /* of what is due */
    uint8_t count;
} series;

/* The period of the state is what the ground asked for. */
static const series all_series[TC_LINK_SERIES] = {
    [SERIES_STATE] = {0, SAY_STATE, 1},
    [SERIES_POSE] = {50, SAY_ATTITUDE, 2}, /* and the position */
    [SERIES_ODOMETRY] = {100, SAY_ODOMETRY, 1},
    [SERIES_SLOW] = {500, SAY_ROTORS, 2}, /* and the battery */
    [SERIES_HEARTBEAT] = {1000, SAY_HEARTBEAT, 1},
    [SERIES_MISSION] = {200, SAY_MISSION, 1},
    [SERIES_VERSION] = {5000, SAY_VERSION, 2}, /* and the home */
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
        const series* one = &all_series[i];
        const uint32_t period_us = i == (unsigned)SERIES_STATE ? link->state_period_us : 1000u * one->period_ms;
        if (period_us != 0u && link_due(&link->due_us[i], now_us, period_us)) {
            link->due |= (DUE(one->count) - 1u) << one->first;
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

static TC_APART float path_time_s(const tc_telemetry* t) {
    return tc_mission_on_path(t->state) ? (float)t->path_time_us * 1e-6f : -1.0f;
}

/* What is copied as it is from the telemetry into a payload: words of four bytes, which all of it begins at. */
typedef struct {
    uint8_t message; /* SAY_... */
    uint8_t to;      /* byte of the payload */
    uint8_t from;    /* word of the telemetry */
    uint8_t words;
} run;

#define FROM(member) (offsetof(tc_telemetry, member) / 4u)
#define POSITION FROM(estimate.position_world_m)
#define VELOCITY FROM(estimate.velocity_world_m_s)
#define ATTITUDE FROM(estimate.q_world_body)
#define RATE FROM(estimate.rate_body_rad_s)
#define FLIPPED 128u /* three words, as LINK_FLIPPED */

/* Neighbours in memory that are neighbours in GOSHAWK_STATE are one run. */
_Static_assert(FROM(estimate.battery_v) - POSITION == 13u, "position, velocity, attitude, rate");
_Static_assert(GOSHAWK_STATE_SPECIFIC_FORCE_BODY_M_S2_AT - GOSHAWK_STATE_POSITION_WORLD_M_AT == 52, "those");
_Static_assert(FROM(setpoint.acceleration_world_m_s2) < 256u, "a word's number is a byte");
_Static_assert(sizeof(tc_link_measured) == 28, "force and rotor speeds");

static const run runs[] = {
    {SAY_MISSION, GOSHAWK_MISSION_STATUS_TIME_US_AT, FROM(time_us), 2},
    {SAY_MISSION, GOSHAWK_MISSION_STATUS_PATH_RATE_AT, FROM(path_rate), 1},
    {SAY_STATE, GOSHAWK_STATE_TIME_US_AT, FROM(time_us), 2},
    {SAY_STATE, GOSHAWK_STATE_POSITION_WORLD_M_AT, POSITION, 13},
    {SAY_STATE, GOSHAWK_STATE_ROTOR_SPEED_COMMAND_RAD_S_AT, FROM(rotor_speed_rad_s), TC_ROTORS},
    {SAY_STATE, GOSHAWK_STATE_SETPOINT_POSITION_WORLD_M_AT, FROM(setpoint.position_world_m), 3},
    {SAY_STATE, GOSHAWK_STATE_SETPOINT_VELOCITY_WORLD_M_S_AT, FROM(setpoint.velocity_world_m_s), 3},
    {SAY_STATE, GOSHAWK_STATE_SETPOINT_Q_WORLD_BODY_AT, FROM(flatness.q_reference), 4},
    {SAY_STATE, GOSHAWK_STATE_BATTERY_V_AT, FROM(estimate.battery_v), 1},
    {SAY_HOME, HOME_POSITION_TIME_USEC_AT, FROM(time_us), 2},
    {SAY_ATTITUDE, ATTITUDE_QUATERNION_Q1_AT, ATTITUDE, 1},
    {SAY_ATTITUDE, ATTITUDE_QUATERNION_Q2_AT, ATTITUDE + 1u, FLIPPED},
    {SAY_ATTITUDE, ATTITUDE_QUATERNION_ROLLSPEED_AT, RATE, FLIPPED},
    {SAY_POSITION, LOCAL_POSITION_NED_X_AT, POSITION, FLIPPED},
    {SAY_POSITION, LOCAL_POSITION_NED_VX_AT, VELOCITY, FLIPPED},
    {SAY_ROTORS, ESC_STATUS_TIME_USEC_AT, FROM(time_us), 2},
    {SAY_ODOMETRY, ODOMETRY_TIME_USEC_AT, FROM(time_us), 2},
    {SAY_ODOMETRY, ODOMETRY_X_AT, POSITION, FLIPPED},
    {SAY_ODOMETRY, ODOMETRY_Q_AT, ATTITUDE, 1},
    {SAY_ODOMETRY, ODOMETRY_Q_AT + 4, ATTITUDE + 1u, FLIPPED},
    {SAY_ODOMETRY, ODOMETRY_ROLLSPEED_AT, RATE, FLIPPED},
};

static void put_u32(uint8_t* place, uint32_t value) { memcpy(place, &value, 4); }

static void put_f32(uint8_t* place, float value) { memcpy(place, &value, 4); }

static TC_APART void put_runs(const tc_telemetry* t, unsigned what, uint8_t* payload) {
    for (unsigned i = 0; i < sizeof runs / sizeof runs[0]; i++) {
        const uint8_t* from = (const uint8_t*)t + 4u * runs[i].from;
        if (runs[i].message == what) {
            const bool flipped = runs[i].words == FLIPPED;
            tc_copy_bytes(payload + runs[i].to, from, flipped ? 12u : 4u * runs[i].words, flipped ? LINK_FLIPPED : 0u);
        }
    }
}

/* The rest of a GOSHAWK_STATE: what was measured at the last tick, and what is not a word of the telemetry. */
static TC_APART void say_state(const tc_link* link, uint8_t record[TC_LINK_RECORD]) {
    const tc_telemetry* t = &link->controller->telemetry;
    tc_copy_bytes(record + GOSHAWK_STATE_SPECIFIC_FORCE_BODY_M_S2_AT, &link->measured, sizeof link->measured, 0);
    put_f32(record + GOSHAWK_STATE_TRAJECTORY_TIME_S_AT, path_time_s(t));
    memcpy(record + GOSHAWK_STATE_SEQUENCE_AT, &link->state_sequence, 2);
    record[GOSHAWK_STATE_MISSION_STATE_AT] = t->state;
    record[GOSHAWK_STATE_SATURATION_AT] = t->saturation;
}

uint8_t link_log_start(tc_link* link, uint32_t id) {
    const uint32_t now_us = (uint32_t)link->controller->telemetry.time_us;
    const uint32_t period_us = link->config->log_period_us;
    if (link->config->log == NULL || link->config->log_records == 0u || period_us == 0u) {
        return TC_LINK_NO_LOG_MEMORY;
    }
    tc_fill(&link->log, 0, sizeof link->log);
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
    uint8_t* record = link->config->log + (size_t)TC_LINK_RECORD * log->records;
    put_runs(&link->controller->telemetry, SAY_STATE, record);
    say_state(link, record);
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
    memcpy(payload + GOSHAWK_LOG_RECORD_INDEX_AT, &index, 4);
    tc_copy_bytes(payload + GOSHAWK_LOG_RECORD_RECORD_AT, link->config->log + (size_t)TC_LINK_RECORD * index,
                  TC_LINK_RECORD, 0);
    link->due |= DUE(SAY_RECORD);
    return true;
}

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
    const tc_trajectory* active = link_active(link);
    const tc_link_counts* c = &link->counts;
    const uint32_t refused = c->without_signature + c->wrong_key + c->replayed + c->faults.checksum_errors;
    put_u32(payload + GOSHAWK_MISSION_STATUS_BOOT_ID_AT, link->config->boot_id);
    if (active != NULL) {
        const float duration_s = (float)tc_trajectory_duration_us(active) * 1e-6f;
        memcpy(payload + GOSHAWK_MISSION_STATUS_ACTIVE_ID_AT, &active->header, 8);
        put_f32(payload + GOSHAWK_MISSION_STATUS_TRAJECTORY_DURATION_S_AT, duration_s);
        tc_copy_bytes(payload + GOSHAWK_MISSION_STATUS_MAP_HASH_AT, &active->origin, sizeof active->origin, 0);
    }
    put_f32(payload + GOSHAWK_MISSION_STATUS_TRAJECTORY_TIME_S_AT, path_time_s(t));
    put_u32(payload + GOSHAWK_MISSION_STATUS_FRAMES_REFUSED_AT, refused);
    put_u32(payload + GOSHAWK_MISSION_STATUS_PARAMETERS_CRC32_AT,
            tc_parameters_crc32(tc_parameters_now(link->controller)));
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

/* In both of them it lies first. */
static void say_boot_ms(const tc_telemetry* t, uint8_t* payload) {
    put_u32(payload, (uint32_t)link_quotient(t->time_us, 1000));
}

static void say_odometry(const tc_controller* c, uint8_t* payload) {
    const tc_estimate* e = &c->telemetry.estimate;
    float along[3];
    for (unsigned i = 0; i < 3u; i++) {
        along[i] = c->axes[i][0] * e->velocity_world_m_s[0] + c->axes[i][1] * e->velocity_world_m_s[1] +
                   c->axes[i][2] * e->velocity_world_m_s[2];
    }
    tc_copy_bytes(payload + ODOMETRY_VX_AT, along, sizeof along, LINK_FLIPPED);
    put_f32(payload + ODOMETRY_POSE_COVARIANCE_AT, NAN); /* nobody knows them */
    put_f32(payload + ODOMETRY_VELOCITY_COVARIANCE_AT, NAN);
    payload[ODOMETRY_FRAME_ID_AT] = FRAME_LOCAL_FRD;
    payload[ODOMETRY_CHILD_FRAME_ID_AT] = FRAME_BODY_FRD;
}

static void say_home(const tc_link* link, uint8_t* payload) {
    tc_copy_bytes(payload + HOME_POSITION_X_AT, link->home_world_m, sizeof link->home_world_m, LINK_FLIPPED);
    put_f32(payload + HOME_POSITION_Q_AT, 1.0f);
}

static void say_rotors(const tc_link* link, uint8_t* payload) {
    const float rpm_per_rad_s = 9.5492966f;
    const tc_telemetry* t = &link->controller->telemetry;
    for (unsigned i = 0; i < TC_ROTORS; i++) {
        const int32_t rpm = (int32_t)(link->measured.rotor_speed_rad_s[i] * rpm_per_rad_s);
        put_u32(payload + ESC_STATUS_RPM_AT + 4u * i, (uint32_t)rpm);
        put_f32(payload + ESC_STATUS_VOLTAGE_AT + 4u * i, t->estimate.battery_v);
    }
}

/* Nothing but the voltage is known. */
static void say_battery(const tc_telemetry* t, uint8_t* payload) {
    const float millivolts = t->estimate.battery_v * 1000.0f;
    tc_fill(payload, 0xFF, BATTERY_STATUS_TIME_REMAINING_AT);
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
    put_runs(&c->telemetry, what, payload);
    switch (what) {
        case SAY_HEARTBEAT:
            say_heartbeat(c->mission.state, payload);
            break;
        case SAY_MISSION:
            say_mission(link, payload);
            break;
        case SAY_STATE:
            say_state(link, payload);
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
        case SAY_POSITION:
            say_boot_ms(&c->telemetry, payload);
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
