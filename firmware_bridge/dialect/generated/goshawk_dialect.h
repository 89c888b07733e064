/* Written by dialect/generate.py from goshawk.xml; do not edit. */
#ifndef GOSHAWK_DIALECT_H
#define GOSHAWK_DIALECT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Payloads are little-endian, and so must be the machine: a message's struct and its payload are the same bytes. */
#if defined(__BYTE_ORDER__)
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a little-endian machine");
#endif

/* GOSHAWK_COMMAND */
enum {
    GOSHAWK_COMMAND_ARM = 0, /* Start the rotors at idle. */
    GOSHAWK_COMMAND_DISARM = 1, /* Stop the rotors; refused in the air. Leads out of a fault. */
    GOSHAWK_COMMAND_TAKE_OFF = 2, /* Climb by value (m), then hold. */
    GOSHAWK_COMMAND_START = 3, /* Fly the active trajectory; its id and CRC must match. */
    GOSHAWK_COMMAND_PAUSE = 4, /* Slow down along the trajectory and stand on it. */
    GOSHAWK_COMMAND_RESUME = 5, /* Continue a paused trajectory. */
    GOSHAWK_COMMAND_HOLD = 6, /* Leave the trajectory and hover. */
    GOSHAWK_COMMAND_LAND = 7, /* Brake along the path, then land straight down. */
    GOSHAWK_COMMAND_KILL = 8, /* Stop the rotors now, in the air too. */
    GOSHAWK_COMMAND_TIME_SCALE = 9, /* Fly the path at value (0.1 to 1) times its planned rate. */
    GOSHAWK_COMMAND_LOG_START = 100, /* Empty the on-board log and record. */
    GOSHAWK_COMMAND_LOG_STOP = 101, /* Stop recording; the log stays readable. */
    GOSHAWK_COMMAND_STATE_RATE = 102, /* Send GOSHAWK_STATE value times a second (0: never). */
};

/* GOSHAWK_MISSION_STATE */
enum {
    GOSHAWK_MISSION_STATE_DISARMED = 0, /* rotors stopped */
    GOSHAWK_MISSION_STATE_ARMED = 1, /* rotors idle on the ground */
    GOSHAWK_MISSION_STATE_TAKE_OFF = 2, /* straight up */
    GOSHAWK_MISSION_STATE_HOLD = 3, /* hovers at a point */
    GOSHAWK_MISSION_STATE_APPROACH = 4, /* slides from the hover point to the start of the trajectory */
    GOSHAWK_MISSION_STATE_TRAJECTORY = 5, /* flies the active trajectory */
    GOSHAWK_MISSION_STATE_PAUSING = 6, /* slows down along the path to stand on it */
    GOSHAWK_MISSION_STATE_PAUSED = 7, /* stands on the path */
    GOSHAWK_MISSION_STATE_STOPPING = 8, /* slows down along the path, then holds */
    GOSHAWK_MISSION_STATE_ABORTING = 9, /* slows down along the path, then lands */
    GOSHAWK_MISSION_STATE_LANDING = 10, /* straight down until touchdown */
    GOSHAWK_MISSION_STATE_EMERGENCY = 11, /* position lost: level, sinking gently */
    GOSHAWK_MISSION_STATE_FAULT = 12, /* rotors stopped; only disarming leads out */
    GOSHAWK_MISSION_STATE_SHADOW = 13, /* another controller flies; this one computes and commands nothing */
};

/* GOSHAWK_LINK_REASON */
enum {
    GOSHAWK_LINK_REASON_NOT_IN_CONTROL = 70, /* another station holds control of the vehicle */
    GOSHAWK_LINK_REASON_UNSUPPORTED = 71, /* this vehicle knows no such command */
    GOSHAWK_LINK_REASON_OTHER_TRAJECTORY = 72, /* another trajectory is active */
    GOSHAWK_LINK_REASON_NO_LOG_MEMORY = 73, /* this vehicle has no memory for a log */
    GOSHAWK_LINK_REASON_SAMPLES_MISSING = 74, /* the check samples have not arrived */
};

/* Sent at 1 Hz by everyone on the link. */
#define HEARTBEAT_ID 0u
#define HEARTBEAT_LENGTH 9u
#define HEARTBEAT_CRC_EXTRA 50u
typedef struct {
    uint32_t custom_mode; /* PX4's main mode in byte 2 and sub mode in byte 3; of a generic autopilot the mission state. */
    uint8_t type; /* MAV_TYPE: 2 quadrotor, 6 ground station. */
    uint8_t autopilot; /* MAV_AUTOPILOT: 12 PX4 or 0 generic (tc_link_identity), 8 none (a ground station). */
    uint8_t base_mode; /* MAV_MODE_FLAG: 128 armed, 8 guided, 1 custom mode. */
    uint8_t system_status; /* MAV_STATE: 3 standby, 4 active, 6 emergency. */
    uint8_t mavlink_version; /* 3. */
} heartbeat_msg;
enum {
    HEARTBEAT_CUSTOM_MODE_AT = 0,
    HEARTBEAT_TYPE_AT = 4,
    HEARTBEAT_AUTOPILOT_AT = 5,
    HEARTBEAT_BASE_MODE_AT = 6,
    HEARTBEAT_SYSTEM_STATUS_AT = 7,
    HEARTBEAT_MAVLINK_VERSION_AT = 8,
};

static inline void heartbeat_encode(const heartbeat_msg *m, uint8_t payload[HEARTBEAT_LENGTH])
{
    _Static_assert(offsetof(heartbeat_msg, mavlink_version) == HEARTBEAT_MAVLINK_VERSION_AT, "no gaps");
    memcpy(payload, m, HEARTBEAT_LENGTH);
}

static inline void heartbeat_decode(heartbeat_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < HEARTBEAT_LENGTH ? length : HEARTBEAT_LENGTH);
}

/* What the vehicle has, and whether it is well. Bits are MAV_SYS_STATUS_SENSOR. */
#define SYS_STATUS_ID 1u
#define SYS_STATUS_LENGTH 43u
#define SYS_STATUS_CRC_EXTRA 124u
typedef struct {
    uint32_t onboard_control_sensors_present; /* What there is. */
    uint32_t onboard_control_sensors_enabled; /* What is used. */
    uint32_t onboard_control_sensors_health; /* What is well; bit 28 (pre-arm check): arming would be accepted now. */
    uint16_t load; /* 0, not measured. */
    uint16_t voltage_battery; /* mV; UINT16_MAX unknown. */
    int16_t current_battery; /* -1, unknown. */
    uint16_t drop_rate_comm; /* 0. */
    uint16_t errors_comm; /* 0. */
    uint16_t errors_count1; /* 0. */
    uint16_t errors_count2; /* 0. */
    uint16_t errors_count3; /* 0. */
    uint16_t errors_count4; /* 0. */
    int8_t battery_remaining; /* -1, unknown. */
    uint32_t onboard_control_sensors_present_extended; /* 0. */
    uint32_t onboard_control_sensors_enabled_extended; /* 0. */
    uint32_t onboard_control_sensors_health_extended; /* 0. */
} sys_status_msg;
enum {
    SYS_STATUS_ONBOARD_CONTROL_SENSORS_PRESENT_AT = 0,
    SYS_STATUS_ONBOARD_CONTROL_SENSORS_ENABLED_AT = 4,
    SYS_STATUS_ONBOARD_CONTROL_SENSORS_HEALTH_AT = 8,
    SYS_STATUS_LOAD_AT = 12,
    SYS_STATUS_VOLTAGE_BATTERY_AT = 14,
    SYS_STATUS_CURRENT_BATTERY_AT = 16,
    SYS_STATUS_DROP_RATE_COMM_AT = 18,
    SYS_STATUS_ERRORS_COMM_AT = 20,
    SYS_STATUS_ERRORS_COUNT1_AT = 22,
    SYS_STATUS_ERRORS_COUNT2_AT = 24,
    SYS_STATUS_ERRORS_COUNT3_AT = 26,
    SYS_STATUS_ERRORS_COUNT4_AT = 28,
    SYS_STATUS_BATTERY_REMAINING_AT = 30,
    SYS_STATUS_ONBOARD_CONTROL_SENSORS_PRESENT_EXTENDED_AT = 31,
    SYS_STATUS_ONBOARD_CONTROL_SENSORS_ENABLED_EXTENDED_AT = 35,
    SYS_STATUS_ONBOARD_CONTROL_SENSORS_HEALTH_EXTENDED_AT = 39,
};

static inline void sys_status_encode(const sys_status_msg *m, uint8_t payload[SYS_STATUS_LENGTH])
{
    memcpy(payload + SYS_STATUS_ONBOARD_CONTROL_SENSORS_PRESENT_AT, &m->onboard_control_sensors_present, 4u);
    memcpy(payload + SYS_STATUS_ONBOARD_CONTROL_SENSORS_ENABLED_AT, &m->onboard_control_sensors_enabled, 4u);
    memcpy(payload + SYS_STATUS_ONBOARD_CONTROL_SENSORS_HEALTH_AT, &m->onboard_control_sensors_health, 4u);
    memcpy(payload + SYS_STATUS_LOAD_AT, &m->load, 2u);
    memcpy(payload + SYS_STATUS_VOLTAGE_BATTERY_AT, &m->voltage_battery, 2u);
    memcpy(payload + SYS_STATUS_CURRENT_BATTERY_AT, &m->current_battery, 2u);
    memcpy(payload + SYS_STATUS_DROP_RATE_COMM_AT, &m->drop_rate_comm, 2u);
    memcpy(payload + SYS_STATUS_ERRORS_COMM_AT, &m->errors_comm, 2u);
    memcpy(payload + SYS_STATUS_ERRORS_COUNT1_AT, &m->errors_count1, 2u);
    memcpy(payload + SYS_STATUS_ERRORS_COUNT2_AT, &m->errors_count2, 2u);
    memcpy(payload + SYS_STATUS_ERRORS_COUNT3_AT, &m->errors_count3, 2u);
    memcpy(payload + SYS_STATUS_ERRORS_COUNT4_AT, &m->errors_count4, 2u);
    memcpy(payload + SYS_STATUS_BATTERY_REMAINING_AT, &m->battery_remaining, 1u);
    memcpy(payload + SYS_STATUS_ONBOARD_CONTROL_SENSORS_PRESENT_EXTENDED_AT, &m->onboard_control_sensors_present_extended, 4u);
    memcpy(payload + SYS_STATUS_ONBOARD_CONTROL_SENSORS_ENABLED_EXTENDED_AT, &m->onboard_control_sensors_enabled_extended, 4u);
    memcpy(payload + SYS_STATUS_ONBOARD_CONTROL_SENSORS_HEALTH_EXTENDED_AT, &m->onboard_control_sensors_health_extended, 4u);
}

static inline void sys_status_decode(sys_status_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[SYS_STATUS_LENGTH] = {0};
    memcpy(whole, payload, length < SYS_STATUS_LENGTH ? length : SYS_STATUS_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->onboard_control_sensors_present, whole + SYS_STATUS_ONBOARD_CONTROL_SENSORS_PRESENT_AT, 4u);
    memcpy(&m->onboard_control_sensors_enabled, whole + SYS_STATUS_ONBOARD_CONTROL_SENSORS_ENABLED_AT, 4u);
    memcpy(&m->onboard_control_sensors_health, whole + SYS_STATUS_ONBOARD_CONTROL_SENSORS_HEALTH_AT, 4u);
    memcpy(&m->load, whole + SYS_STATUS_LOAD_AT, 2u);
    memcpy(&m->voltage_battery, whole + SYS_STATUS_VOLTAGE_BATTERY_AT, 2u);
    memcpy(&m->current_battery, whole + SYS_STATUS_CURRENT_BATTERY_AT, 2u);
    memcpy(&m->drop_rate_comm, whole + SYS_STATUS_DROP_RATE_COMM_AT, 2u);
    memcpy(&m->errors_comm, whole + SYS_STATUS_ERRORS_COMM_AT, 2u);
    memcpy(&m->errors_count1, whole + SYS_STATUS_ERRORS_COUNT1_AT, 2u);
    memcpy(&m->errors_count2, whole + SYS_STATUS_ERRORS_COUNT2_AT, 2u);
    memcpy(&m->errors_count3, whole + SYS_STATUS_ERRORS_COUNT3_AT, 2u);
    memcpy(&m->errors_count4, whole + SYS_STATUS_ERRORS_COUNT4_AT, 2u);
    memcpy(&m->battery_remaining, whole + SYS_STATUS_BATTERY_REMAINING_AT, 1u);
    memcpy(&m->onboard_control_sensors_present_extended, whole + SYS_STATUS_ONBOARD_CONTROL_SENSORS_PRESENT_EXTENDED_AT, 4u);
    memcpy(&m->onboard_control_sensors_enabled_extended, whole + SYS_STATUS_ONBOARD_CONTROL_SENSORS_ENABLED_EXTENDED_AT, 4u);
    memcpy(&m->onboard_control_sensors_health_extended, whole + SYS_STATUS_ONBOARD_CONTROL_SENSORS_HEALTH_EXTENDED_AT, 4u);
}

/* A request (target 0, 0) is returned as it came, its target the one who asked. The vehicle's challenge: see docs/reference/link.md. */
#define PING_ID 4u
#define PING_LENGTH 14u
#define PING_CRC_EXTRA 237u
typedef struct {
    uint64_t time_usec; /* Returned as sent. */
    uint32_t seq; /* Returned as sent. */
    uint8_t target_system; /* 0: a request to all; else an answer to this system. */
    uint8_t target_component; /* 0: a request to all; else an answer to this component. */
} ping_msg;
enum {
    PING_TIME_USEC_AT = 0,
    PING_SEQ_AT = 8,
    PING_TARGET_SYSTEM_AT = 12,
    PING_TARGET_COMPONENT_AT = 13,
};

static inline void ping_encode(const ping_msg *m, uint8_t payload[PING_LENGTH])
{
    _Static_assert(offsetof(ping_msg, target_component) == PING_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, PING_LENGTH);
}

static inline void ping_decode(ping_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < PING_LENGTH ? length : PING_LENGTH);
}

/* Ask for a mode; the older form of MAV_CMD_DO_SET_MODE. */
#define SET_MODE_ID 11u
#define SET_MODE_LENGTH 6u
#define SET_MODE_CRC_EXTRA 89u
typedef struct {
    uint32_t custom_mode; /* PX4's: main mode in byte 2, sub mode in byte 3. */
    uint8_t target_system; /* System asked. */
    uint8_t base_mode; /* MAV_MODE_FLAG: 1, the custom mode counts. */
} set_mode_msg;
enum {
    SET_MODE_CUSTOM_MODE_AT = 0,
    SET_MODE_TARGET_SYSTEM_AT = 4,
    SET_MODE_BASE_MODE_AT = 5,
};

static inline void set_mode_encode(const set_mode_msg *m, uint8_t payload[SET_MODE_LENGTH])
{
    _Static_assert(offsetof(set_mode_msg, base_mode) == SET_MODE_BASE_MODE_AT, "no gaps");
    memcpy(payload, m, SET_MODE_LENGTH);
}

static inline void set_mode_decode(set_mode_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < SET_MODE_LENGTH ? length : SET_MODE_LENGTH);
}

/* Ask for one parameter by index or by name. */
#define PARAM_REQUEST_READ_ID 20u
#define PARAM_REQUEST_READ_LENGTH 20u
#define PARAM_REQUEST_READ_CRC_EXTRA 214u
typedef struct {
    int16_t param_index; /* Index, or -1. */
    uint8_t target_system; /* System asked. */
    uint8_t target_component; /* Component asked. */
    char param_id[16]; /* Name; counts when the index is -1. */
} param_request_read_msg;
enum {
    PARAM_REQUEST_READ_PARAM_INDEX_AT = 0,
    PARAM_REQUEST_READ_TARGET_SYSTEM_AT = 2,
    PARAM_REQUEST_READ_TARGET_COMPONENT_AT = 3,
    PARAM_REQUEST_READ_PARAM_ID_AT = 4,
};

static inline void param_request_read_encode(const param_request_read_msg *m, uint8_t payload[PARAM_REQUEST_READ_LENGTH])
{
    _Static_assert(offsetof(param_request_read_msg, param_id) == PARAM_REQUEST_READ_PARAM_ID_AT, "no gaps");
    memcpy(payload, m, PARAM_REQUEST_READ_LENGTH);
}

static inline void param_request_read_decode(param_request_read_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < PARAM_REQUEST_READ_LENGTH ? length : PARAM_REQUEST_READ_LENGTH);
}

/* Ask for all parameters. */
#define PARAM_REQUEST_LIST_ID 21u
#define PARAM_REQUEST_LIST_LENGTH 2u
#define PARAM_REQUEST_LIST_CRC_EXTRA 159u
typedef struct {
    uint8_t target_system; /* System asked. */
    uint8_t target_component; /* Component asked. */
} param_request_list_msg;
enum {
    PARAM_REQUEST_LIST_TARGET_SYSTEM_AT = 0,
    PARAM_REQUEST_LIST_TARGET_COMPONENT_AT = 1,
};

static inline void param_request_list_encode(const param_request_list_msg *m, uint8_t payload[PARAM_REQUEST_LIST_LENGTH])
{
    _Static_assert(offsetof(param_request_list_msg, target_component) == PARAM_REQUEST_LIST_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, PARAM_REQUEST_LIST_LENGTH);
}

static inline void param_request_list_decode(param_request_list_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < PARAM_REQUEST_LIST_LENGTH ? length : PARAM_REQUEST_LIST_LENGTH);
}

/* One parameter. */
#define PARAM_VALUE_ID 22u
#define PARAM_VALUE_LENGTH 25u
#define PARAM_VALUE_CRC_EXTRA 220u
typedef struct {
    float param_value; /* Value. */
    uint16_t param_count; /* How many there are. */
    uint16_t param_index; /* Which one this is. */
    char param_id[16]; /* Name, zero-terminated unless 16 long. */
    uint8_t param_type; /* MAV_PARAM_TYPE: 9 real32. */
} param_value_msg;
enum {
    PARAM_VALUE_PARAM_VALUE_AT = 0,
    PARAM_VALUE_PARAM_COUNT_AT = 4,
    PARAM_VALUE_PARAM_INDEX_AT = 6,
    PARAM_VALUE_PARAM_ID_AT = 8,
    PARAM_VALUE_PARAM_TYPE_AT = 24,
};

static inline void param_value_encode(const param_value_msg *m, uint8_t payload[PARAM_VALUE_LENGTH])
{
    _Static_assert(offsetof(param_value_msg, param_type) == PARAM_VALUE_PARAM_TYPE_AT, "no gaps");
    memcpy(payload, m, PARAM_VALUE_LENGTH);
}

static inline void param_value_decode(param_value_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < PARAM_VALUE_LENGTH ? length : PARAM_VALUE_LENGTH);
}

/* Set one parameter. The answer is a PARAM_VALUE with what holds then: the old value if it was refused. */
#define PARAM_SET_ID 23u
#define PARAM_SET_LENGTH 23u
#define PARAM_SET_CRC_EXTRA 168u
typedef struct {
    float param_value; /* Value. */
    uint8_t target_system; /* System asked. */
    uint8_t target_component; /* Component asked. */
    char param_id[16]; /* Name, zero-terminated unless 16 long. */
    uint8_t param_type; /* MAV_PARAM_TYPE: 9 real32. */
} param_set_msg;
enum {
    PARAM_SET_PARAM_VALUE_AT = 0,
    PARAM_SET_TARGET_SYSTEM_AT = 4,
    PARAM_SET_TARGET_COMPONENT_AT = 5,
    PARAM_SET_PARAM_ID_AT = 6,
    PARAM_SET_PARAM_TYPE_AT = 22,
};

static inline void param_set_encode(const param_set_msg *m, uint8_t payload[PARAM_SET_LENGTH])
{
    _Static_assert(offsetof(param_set_msg, param_type) == PARAM_SET_PARAM_TYPE_AT, "no gaps");
    memcpy(payload, m, PARAM_SET_LENGTH);
}

static inline void param_set_decode(param_set_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < PARAM_SET_LENGTH ? length : PARAM_SET_LENGTH);
}

/* Attitude, NED from FRD. */
#define ATTITUDE_QUATERNION_ID 31u
#define ATTITUDE_QUATERNION_LENGTH 48u
#define ATTITUDE_QUATERNION_CRC_EXTRA 246u
typedef struct {
    uint32_t time_boot_ms; /* Vehicle time. */
    float q1; /* w. */
    float q2; /* x. */
    float q3; /* y. */
    float q4; /* z. */
    float rollspeed; /* Rate about FRD x, rad/s. */
    float pitchspeed; /* Rate about FRD y, rad/s. */
    float yawspeed; /* Rate about FRD z, rad/s. */
    float repr_offset_q[4]; /* Unused. */
} attitude_quaternion_msg;
enum {
    ATTITUDE_QUATERNION_TIME_BOOT_MS_AT = 0,
    ATTITUDE_QUATERNION_Q1_AT = 4,
    ATTITUDE_QUATERNION_Q2_AT = 8,
    ATTITUDE_QUATERNION_Q3_AT = 12,
    ATTITUDE_QUATERNION_Q4_AT = 16,
    ATTITUDE_QUATERNION_ROLLSPEED_AT = 20,
    ATTITUDE_QUATERNION_PITCHSPEED_AT = 24,
    ATTITUDE_QUATERNION_YAWSPEED_AT = 28,
    ATTITUDE_QUATERNION_REPR_OFFSET_Q_AT = 32,
};

static inline void attitude_quaternion_encode(const attitude_quaternion_msg *m, uint8_t payload[ATTITUDE_QUATERNION_LENGTH])
{
    _Static_assert(offsetof(attitude_quaternion_msg, repr_offset_q) == ATTITUDE_QUATERNION_REPR_OFFSET_Q_AT, "no gaps");
    memcpy(payload, m, ATTITUDE_QUATERNION_LENGTH);
}

static inline void attitude_quaternion_decode(attitude_quaternion_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < ATTITUDE_QUATERNION_LENGTH ? length : ATTITUDE_QUATERNION_LENGTH);
}

/* Position and velocity, NED. */
#define LOCAL_POSITION_NED_ID 32u
#define LOCAL_POSITION_NED_LENGTH 28u
#define LOCAL_POSITION_NED_CRC_EXTRA 185u
typedef struct {
    uint32_t time_boot_ms; /* Vehicle time. */
    float x; /* North, m. */
    float y; /* East, m. */
    float z; /* Down, m. */
    float vx; /* m/s. */
    float vy; /* m/s. */
    float vz; /* m/s. */
} local_position_ned_msg;
enum {
    LOCAL_POSITION_NED_TIME_BOOT_MS_AT = 0,
    LOCAL_POSITION_NED_X_AT = 4,
    LOCAL_POSITION_NED_Y_AT = 8,
    LOCAL_POSITION_NED_Z_AT = 12,
    LOCAL_POSITION_NED_VX_AT = 16,
    LOCAL_POSITION_NED_VY_AT = 20,
    LOCAL_POSITION_NED_VZ_AT = 24,
};

static inline void local_position_ned_encode(const local_position_ned_msg *m, uint8_t payload[LOCAL_POSITION_NED_LENGTH])
{
    _Static_assert(offsetof(local_position_ned_msg, vz) == LOCAL_POSITION_NED_VZ_AT, "no gaps");
    memcpy(payload, m, LOCAL_POSITION_NED_LENGTH);
}

static inline void local_position_ned_decode(local_position_ned_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < LOCAL_POSITION_NED_LENGTH ? length : LOCAL_POSITION_NED_LENGTH);
}

/* Ask for the mission, the fence or the rally points. */
#define MISSION_REQUEST_LIST_ID 43u
#define MISSION_REQUEST_LIST_LENGTH 3u
#define MISSION_REQUEST_LIST_CRC_EXTRA 132u
typedef struct {
    uint8_t target_system; /* System asked. */
    uint8_t target_component; /* Component asked. */
    uint8_t mission_type; /* MAV_MISSION_TYPE: 0 mission, 1 fence, 2 rally points. */
} mission_request_list_msg;
enum {
    MISSION_REQUEST_LIST_TARGET_SYSTEM_AT = 0,
    MISSION_REQUEST_LIST_TARGET_COMPONENT_AT = 1,
    MISSION_REQUEST_LIST_MISSION_TYPE_AT = 2,
};

static inline void mission_request_list_encode(const mission_request_list_msg *m, uint8_t payload[MISSION_REQUEST_LIST_LENGTH])
{
    _Static_assert(offsetof(mission_request_list_msg, mission_type) == MISSION_REQUEST_LIST_MISSION_TYPE_AT, "no gaps");
    memcpy(payload, m, MISSION_REQUEST_LIST_LENGTH);
}

static inline void mission_request_list_decode(mission_request_list_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < MISSION_REQUEST_LIST_LENGTH ? length : MISSION_REQUEST_LIST_LENGTH);
}

/* How many items there are: always none, as trajectories are not missions. */
#define MISSION_COUNT_ID 44u
#define MISSION_COUNT_LENGTH 9u
#define MISSION_COUNT_CRC_EXTRA 221u
typedef struct {
    uint16_t count; /* 0. */
    uint8_t target_system; /* Who asked. */
    uint8_t target_component; /* Who asked. */
    uint8_t mission_type; /* As asked. */
    uint32_t opaque_id; /* 0. */
} mission_count_msg;
enum {
    MISSION_COUNT_COUNT_AT = 0,
    MISSION_COUNT_TARGET_SYSTEM_AT = 2,
    MISSION_COUNT_TARGET_COMPONENT_AT = 3,
    MISSION_COUNT_MISSION_TYPE_AT = 4,
    MISSION_COUNT_OPAQUE_ID_AT = 5,
};

static inline void mission_count_encode(const mission_count_msg *m, uint8_t payload[MISSION_COUNT_LENGTH])
{
    memcpy(payload + MISSION_COUNT_COUNT_AT, &m->count, 2u);
    memcpy(payload + MISSION_COUNT_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + MISSION_COUNT_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + MISSION_COUNT_MISSION_TYPE_AT, &m->mission_type, 1u);
    memcpy(payload + MISSION_COUNT_OPAQUE_ID_AT, &m->opaque_id, 4u);
}

static inline void mission_count_decode(mission_count_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[MISSION_COUNT_LENGTH] = {0};
    memcpy(whole, payload, length < MISSION_COUNT_LENGTH ? length : MISSION_COUNT_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->count, whole + MISSION_COUNT_COUNT_AT, 2u);
    memcpy(&m->target_system, whole + MISSION_COUNT_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + MISSION_COUNT_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->mission_type, whole + MISSION_COUNT_MISSION_TYPE_AT, 1u);
    memcpy(&m->opaque_id, whole + MISSION_COUNT_OPAQUE_ID_AT, 4u);
}

/* Answer to a station that wants to send a mission. */
#define MISSION_ACK_ID 47u
#define MISSION_ACK_LENGTH 8u
#define MISSION_ACK_CRC_EXTRA 153u
typedef struct {
    uint8_t target_system; /* Who asked. */
    uint8_t target_component; /* Who asked. */
    uint8_t type; /* MAV_MISSION_RESULT: 3, unsupported. */
    uint8_t mission_type; /* As asked. */
    uint32_t opaque_id; /* 0. */
} mission_ack_msg;
enum {
    MISSION_ACK_TARGET_SYSTEM_AT = 0,
    MISSION_ACK_TARGET_COMPONENT_AT = 1,
    MISSION_ACK_TYPE_AT = 2,
    MISSION_ACK_MISSION_TYPE_AT = 3,
    MISSION_ACK_OPAQUE_ID_AT = 4,
};

static inline void mission_ack_encode(const mission_ack_msg *m, uint8_t payload[MISSION_ACK_LENGTH])
{
    _Static_assert(offsetof(mission_ack_msg, opaque_id) == MISSION_ACK_OPAQUE_ID_AT, "no gaps");
    memcpy(payload, m, MISSION_ACK_LENGTH);
}

static inline void mission_ack_decode(mission_ack_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < MISSION_ACK_LENGTH ? length : MISSION_ACK_LENGTH);
}

/* A command of the common set, with a position as integers. */
#define COMMAND_INT_ID 75u
#define COMMAND_INT_LENGTH 35u
#define COMMAND_INT_CRC_EXTRA 158u
typedef struct {
    float param1; /* Parameter 1. */
    float param2; /* Parameter 2. */
    float param3; /* Parameter 3. */
    float param4; /* Parameter 4. */
    int32_t x; /* Parameter 5; INT32_MAX none. */
    int32_t y; /* Parameter 6; INT32_MAX none. */
    float z; /* Parameter 7. */
    uint16_t command; /* MAV_CMD. */
    uint8_t target_system; /* System asked. */
    uint8_t target_component; /* Component asked. */
    uint8_t frame; /* MAV_FRAME of the position. */
    uint8_t current; /* Unused. */
    uint8_t autocontinue; /* Unused. */
} command_int_msg;
enum {
    COMMAND_INT_PARAM1_AT = 0,
    COMMAND_INT_PARAM2_AT = 4,
    COMMAND_INT_PARAM3_AT = 8,
    COMMAND_INT_PARAM4_AT = 12,
    COMMAND_INT_X_AT = 16,
    COMMAND_INT_Y_AT = 20,
    COMMAND_INT_Z_AT = 24,
    COMMAND_INT_COMMAND_AT = 28,
    COMMAND_INT_TARGET_SYSTEM_AT = 30,
    COMMAND_INT_TARGET_COMPONENT_AT = 31,
    COMMAND_INT_FRAME_AT = 32,
    COMMAND_INT_CURRENT_AT = 33,
    COMMAND_INT_AUTOCONTINUE_AT = 34,
};

static inline void command_int_encode(const command_int_msg *m, uint8_t payload[COMMAND_INT_LENGTH])
{
    _Static_assert(offsetof(command_int_msg, autocontinue) == COMMAND_INT_AUTOCONTINUE_AT, "no gaps");
    memcpy(payload, m, COMMAND_INT_LENGTH);
}

static inline void command_int_decode(command_int_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < COMMAND_INT_LENGTH ? length : COMMAND_INT_LENGTH);
}

/* A command of the common set. */
#define COMMAND_LONG_ID 76u
#define COMMAND_LONG_LENGTH 33u
#define COMMAND_LONG_CRC_EXTRA 152u
typedef struct {
    float param1; /* Parameter 1. */
    float param2; /* Parameter 2. */
    float param3; /* Parameter 3. */
    float param4; /* Parameter 4. */
    float param5; /* Parameter 5. */
    float param6; /* Parameter 6. */
    float param7; /* Parameter 7. */
    uint16_t command; /* MAV_CMD. */
    uint8_t target_system; /* System asked. */
    uint8_t target_component; /* Component asked. */
    uint8_t confirmation; /* 0 at first, then counts repeats. */
} command_long_msg;
enum {
    COMMAND_LONG_PARAM1_AT = 0,
    COMMAND_LONG_PARAM2_AT = 4,
    COMMAND_LONG_PARAM3_AT = 8,
    COMMAND_LONG_PARAM4_AT = 12,
    COMMAND_LONG_PARAM5_AT = 16,
    COMMAND_LONG_PARAM6_AT = 20,
    COMMAND_LONG_PARAM7_AT = 24,
    COMMAND_LONG_COMMAND_AT = 28,
    COMMAND_LONG_TARGET_SYSTEM_AT = 30,
    COMMAND_LONG_TARGET_COMPONENT_AT = 31,
    COMMAND_LONG_CONFIRMATION_AT = 32,
};

static inline void command_long_encode(const command_long_msg *m, uint8_t payload[COMMAND_LONG_LENGTH])
{
    _Static_assert(offsetof(command_long_msg, confirmation) == COMMAND_LONG_CONFIRMATION_AT, "no gaps");
    memcpy(payload, m, COMMAND_LONG_LENGTH);
}

static inline void command_long_decode(command_long_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < COMMAND_LONG_LENGTH ? length : COMMAND_LONG_LENGTH);
}

/* Answer to COMMAND_LONG and COMMAND_INT. */
#define COMMAND_ACK_ID 77u
#define COMMAND_ACK_LENGTH 10u
#define COMMAND_ACK_CRC_EXTRA 143u
typedef struct {
    uint16_t command; /* MAV_CMD. */
    uint8_t result; /* MAV_RESULT: 0 accepted, 1 rejected for now (not in control), 2 denied, 3 unsupported. */
    uint8_t progress; /* Unused. */
    int32_t result_param2; /* tc_reason or GOSHAWK_LINK_REASON. */
    uint8_t target_system; /* Who asked. */
    uint8_t target_component; /* Who asked. */
} command_ack_msg;
enum {
    COMMAND_ACK_COMMAND_AT = 0,
    COMMAND_ACK_RESULT_AT = 2,
    COMMAND_ACK_PROGRESS_AT = 3,
    COMMAND_ACK_RESULT_PARAM2_AT = 4,
    COMMAND_ACK_TARGET_SYSTEM_AT = 8,
    COMMAND_ACK_TARGET_COMPONENT_AT = 9,
};

static inline void command_ack_encode(const command_ack_msg *m, uint8_t payload[COMMAND_ACK_LENGTH])
{
    _Static_assert(offsetof(command_ack_msg, target_component) == COMMAND_ACK_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, COMMAND_ACK_LENGTH);
}

static inline void command_ack_decode(command_ack_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < COMMAND_ACK_LENGTH ? length : COMMAND_ACK_LENGTH);
}

/* Clock comparison. A request has tc1 = 0; the answer carries the answerer's time there. */
#define TIMESYNC_ID 111u
#define TIMESYNC_LENGTH 18u
#define TIMESYNC_CRC_EXTRA 34u
typedef struct {
    int64_t tc1; /* Answerer's time, ns. */
    int64_t ts1; /* Asker's time, ns, returned as sent. */
    uint8_t target_system; /* System asked; 0 all. */
    uint8_t target_component; /* Component asked; 0 all. */
} timesync_msg;
enum {
    TIMESYNC_TC1_AT = 0,
    TIMESYNC_TS1_AT = 8,
    TIMESYNC_TARGET_SYSTEM_AT = 16,
    TIMESYNC_TARGET_COMPONENT_AT = 17,
};

static inline void timesync_encode(const timesync_msg *m, uint8_t payload[TIMESYNC_LENGTH])
{
    _Static_assert(offsetof(timesync_msg, target_component) == TIMESYNC_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, TIMESYNC_LENGTH);
}

static inline void timesync_decode(timesync_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < TIMESYNC_LENGTH ? length : TIMESYNC_LENGTH);
}

/* Height. There is no sea level here: heights count from where the vehicle last stood. */
#define ALTITUDE_ID 141u
#define ALTITUDE_LENGTH 32u
#define ALTITUDE_CRC_EXTRA 47u
typedef struct {
    uint64_t time_usec; /* Vehicle time. */
    float altitude_monotonic; /* World z, m. */
    float altitude_amsl; /* Above where it last stood, m. */
    float altitude_local; /* World z, m. */
    float altitude_relative; /* Above where it last stood, m. */
    float altitude_terrain; /* NaN, unknown. */
    float bottom_clearance; /* NaN, unknown. */
} altitude_msg;
enum {
    ALTITUDE_TIME_USEC_AT = 0,
    ALTITUDE_ALTITUDE_MONOTONIC_AT = 8,
    ALTITUDE_ALTITUDE_AMSL_AT = 12,
    ALTITUDE_ALTITUDE_LOCAL_AT = 16,
    ALTITUDE_ALTITUDE_RELATIVE_AT = 20,
    ALTITUDE_ALTITUDE_TERRAIN_AT = 24,
    ALTITUDE_BOTTOM_CLEARANCE_AT = 28,
};

static inline void altitude_encode(const altitude_msg *m, uint8_t payload[ALTITUDE_LENGTH])
{
    _Static_assert(offsetof(altitude_msg, bottom_clearance) == ALTITUDE_BOTTOM_CLEARANCE_AT, "no gaps");
    memcpy(payload, m, ALTITUDE_LENGTH);
}

static inline void altitude_decode(altitude_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < ALTITUDE_LENGTH ? length : ALTITUDE_LENGTH);
}

/* Battery. */
#define BATTERY_STATUS_ID 147u
#define BATTERY_STATUS_LENGTH 54u
#define BATTERY_STATUS_CRC_EXTRA 154u
typedef struct {
    int32_t current_consumed; /* -1, unknown. */
    int32_t energy_consumed; /* -1, unknown. */
    int16_t temperature; /* INT16_MAX, unknown. */
    uint16_t voltages[10]; /* mV; UINT16_MAX where unused. */
    int16_t current_battery; /* -1, unknown. */
    uint8_t id; /* 0. */
    uint8_t battery_function; /* 0. */
    uint8_t type; /* 1, lithium polymer. */
    int8_t battery_remaining; /* -1, unknown. */
    int32_t time_remaining; /* 0, unknown. */
    uint8_t charge_state; /* 0, unknown. */
    uint16_t voltages_ext[4]; /* Unused. */
    uint8_t mode; /* 0. */
    uint32_t fault_bitmask; /* 0. */
} battery_status_msg;
enum {
    BATTERY_STATUS_CURRENT_CONSUMED_AT = 0,
    BATTERY_STATUS_ENERGY_CONSUMED_AT = 4,
    BATTERY_STATUS_TEMPERATURE_AT = 8,
    BATTERY_STATUS_VOLTAGES_AT = 10,
    BATTERY_STATUS_CURRENT_BATTERY_AT = 30,
    BATTERY_STATUS_ID_AT = 32,
    BATTERY_STATUS_BATTERY_FUNCTION_AT = 33,
    BATTERY_STATUS_TYPE_AT = 34,
    BATTERY_STATUS_BATTERY_REMAINING_AT = 35,
    BATTERY_STATUS_TIME_REMAINING_AT = 36,
    BATTERY_STATUS_CHARGE_STATE_AT = 40,
    BATTERY_STATUS_VOLTAGES_EXT_AT = 41,
    BATTERY_STATUS_MODE_AT = 49,
    BATTERY_STATUS_FAULT_BITMASK_AT = 50,
};

static inline void battery_status_encode(const battery_status_msg *m, uint8_t payload[BATTERY_STATUS_LENGTH])
{
    memcpy(payload + BATTERY_STATUS_CURRENT_CONSUMED_AT, &m->current_consumed, 4u);
    memcpy(payload + BATTERY_STATUS_ENERGY_CONSUMED_AT, &m->energy_consumed, 4u);
    memcpy(payload + BATTERY_STATUS_TEMPERATURE_AT, &m->temperature, 2u);
    memcpy(payload + BATTERY_STATUS_VOLTAGES_AT, m->voltages, 20u);
    memcpy(payload + BATTERY_STATUS_CURRENT_BATTERY_AT, &m->current_battery, 2u);
    memcpy(payload + BATTERY_STATUS_ID_AT, &m->id, 1u);
    memcpy(payload + BATTERY_STATUS_BATTERY_FUNCTION_AT, &m->battery_function, 1u);
    memcpy(payload + BATTERY_STATUS_TYPE_AT, &m->type, 1u);
    memcpy(payload + BATTERY_STATUS_BATTERY_REMAINING_AT, &m->battery_remaining, 1u);
    memcpy(payload + BATTERY_STATUS_TIME_REMAINING_AT, &m->time_remaining, 4u);
    memcpy(payload + BATTERY_STATUS_CHARGE_STATE_AT, &m->charge_state, 1u);
    memcpy(payload + BATTERY_STATUS_VOLTAGES_EXT_AT, m->voltages_ext, 8u);
    memcpy(payload + BATTERY_STATUS_MODE_AT, &m->mode, 1u);
    memcpy(payload + BATTERY_STATUS_FAULT_BITMASK_AT, &m->fault_bitmask, 4u);
}

static inline void battery_status_decode(battery_status_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[BATTERY_STATUS_LENGTH] = {0};
    memcpy(whole, payload, length < BATTERY_STATUS_LENGTH ? length : BATTERY_STATUS_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->current_consumed, whole + BATTERY_STATUS_CURRENT_CONSUMED_AT, 4u);
    memcpy(&m->energy_consumed, whole + BATTERY_STATUS_ENERGY_CONSUMED_AT, 4u);
    memcpy(&m->temperature, whole + BATTERY_STATUS_TEMPERATURE_AT, 2u);
    memcpy(m->voltages, whole + BATTERY_STATUS_VOLTAGES_AT, 20u);
    memcpy(&m->current_battery, whole + BATTERY_STATUS_CURRENT_BATTERY_AT, 2u);
    memcpy(&m->id, whole + BATTERY_STATUS_ID_AT, 1u);
    memcpy(&m->battery_function, whole + BATTERY_STATUS_BATTERY_FUNCTION_AT, 1u);
    memcpy(&m->type, whole + BATTERY_STATUS_TYPE_AT, 1u);
    memcpy(&m->battery_remaining, whole + BATTERY_STATUS_BATTERY_REMAINING_AT, 1u);
    memcpy(&m->time_remaining, whole + BATTERY_STATUS_TIME_REMAINING_AT, 4u);
    memcpy(&m->charge_state, whole + BATTERY_STATUS_CHARGE_STATE_AT, 1u);
    memcpy(m->voltages_ext, whole + BATTERY_STATUS_VOLTAGES_EXT_AT, 8u);
    memcpy(&m->mode, whole + BATTERY_STATUS_MODE_AT, 1u);
    memcpy(&m->fault_bitmask, whole + BATTERY_STATUS_FAULT_BITMASK_AT, 4u);
}

/* Who the vehicle is. */
#define AUTOPILOT_VERSION_ID 148u
#define AUTOPILOT_VERSION_LENGTH 78u
#define AUTOPILOT_VERSION_CRC_EXTRA 178u
typedef struct {
    uint64_t capabilities; /* MAV_PROTOCOL_CAPABILITY: 2 float parameters, 8 COMMAND_INT, 2048 termination, 8192 MAVLink 2. */
    uint64_t uid; /* Unique id of the vehicle. */
    uint32_t flight_sw_version; /* Version of the controller. */
    uint32_t middleware_sw_version; /* 0. */
    uint32_t os_sw_version; /* 0. */
    uint32_t board_version; /* 0. */
    uint16_t vendor_id; /* 0. */
    uint16_t product_id; /* 0. */
    uint8_t flight_custom_version[8]; /* 0. */
    uint8_t middleware_custom_version[8]; /* 0. */
    uint8_t os_custom_version[8]; /* 0. */
    uint8_t uid2[18]; /* 0. */
} autopilot_version_msg;
enum {
    AUTOPILOT_VERSION_CAPABILITIES_AT = 0,
    AUTOPILOT_VERSION_UID_AT = 8,
    AUTOPILOT_VERSION_FLIGHT_SW_VERSION_AT = 16,
    AUTOPILOT_VERSION_MIDDLEWARE_SW_VERSION_AT = 20,
    AUTOPILOT_VERSION_OS_SW_VERSION_AT = 24,
    AUTOPILOT_VERSION_BOARD_VERSION_AT = 28,
    AUTOPILOT_VERSION_VENDOR_ID_AT = 32,
    AUTOPILOT_VERSION_PRODUCT_ID_AT = 34,
    AUTOPILOT_VERSION_FLIGHT_CUSTOM_VERSION_AT = 36,
    AUTOPILOT_VERSION_MIDDLEWARE_CUSTOM_VERSION_AT = 44,
    AUTOPILOT_VERSION_OS_CUSTOM_VERSION_AT = 52,
    AUTOPILOT_VERSION_UID2_AT = 60,
};

static inline void autopilot_version_encode(const autopilot_version_msg *m, uint8_t payload[AUTOPILOT_VERSION_LENGTH])
{
    _Static_assert(offsetof(autopilot_version_msg, uid2) == AUTOPILOT_VERSION_UID2_AT, "no gaps");
    memcpy(payload, m, AUTOPILOT_VERSION_LENGTH);
}

static inline void autopilot_version_decode(autopilot_version_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < AUTOPILOT_VERSION_LENGTH ? length : AUTOPILOT_VERSION_LENGTH);
}

/* Where the vehicle last stood on the ground with its rotors idle or off. */
#define HOME_POSITION_ID 242u
#define HOME_POSITION_LENGTH 60u
#define HOME_POSITION_CRC_EXTRA 104u
typedef struct {
    int32_t latitude; /* 0: there is no global position. */
    int32_t longitude; /* 0: there is no global position. */
    int32_t altitude; /* 0: there is no global position. */
    float x; /* North, m. */
    float y; /* East, m. */
    float z; /* Down, m. */
    float q[4]; /* Of the ground: level. */
    float approach_x; /* 0. */
    float approach_y; /* 0. */
    float approach_z; /* 0. */
    uint64_t time_usec; /* Vehicle time. */
} home_position_msg;
enum {
    HOME_POSITION_LATITUDE_AT = 0,
    HOME_POSITION_LONGITUDE_AT = 4,
    HOME_POSITION_ALTITUDE_AT = 8,
    HOME_POSITION_X_AT = 12,
    HOME_POSITION_Y_AT = 16,
    HOME_POSITION_Z_AT = 20,
    HOME_POSITION_Q_AT = 24,
    HOME_POSITION_APPROACH_X_AT = 40,
    HOME_POSITION_APPROACH_Y_AT = 44,
    HOME_POSITION_APPROACH_Z_AT = 48,
    HOME_POSITION_TIME_USEC_AT = 52,
};

static inline void home_position_encode(const home_position_msg *m, uint8_t payload[HOME_POSITION_LENGTH])
{
    memcpy(payload + HOME_POSITION_LATITUDE_AT, &m->latitude, 4u);
    memcpy(payload + HOME_POSITION_LONGITUDE_AT, &m->longitude, 4u);
    memcpy(payload + HOME_POSITION_ALTITUDE_AT, &m->altitude, 4u);
    memcpy(payload + HOME_POSITION_X_AT, &m->x, 4u);
    memcpy(payload + HOME_POSITION_Y_AT, &m->y, 4u);
    memcpy(payload + HOME_POSITION_Z_AT, &m->z, 4u);
    memcpy(payload + HOME_POSITION_Q_AT, m->q, 16u);
    memcpy(payload + HOME_POSITION_APPROACH_X_AT, &m->approach_x, 4u);
    memcpy(payload + HOME_POSITION_APPROACH_Y_AT, &m->approach_y, 4u);
    memcpy(payload + HOME_POSITION_APPROACH_Z_AT, &m->approach_z, 4u);
    memcpy(payload + HOME_POSITION_TIME_USEC_AT, &m->time_usec, 8u);
}

static inline void home_position_decode(home_position_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[HOME_POSITION_LENGTH] = {0};
    memcpy(whole, payload, length < HOME_POSITION_LENGTH ? length : HOME_POSITION_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->latitude, whole + HOME_POSITION_LATITUDE_AT, 4u);
    memcpy(&m->longitude, whole + HOME_POSITION_LONGITUDE_AT, 4u);
    memcpy(&m->altitude, whole + HOME_POSITION_ALTITUDE_AT, 4u);
    memcpy(&m->x, whole + HOME_POSITION_X_AT, 4u);
    memcpy(&m->y, whole + HOME_POSITION_Y_AT, 4u);
    memcpy(&m->z, whole + HOME_POSITION_Z_AT, 4u);
    memcpy(m->q, whole + HOME_POSITION_Q_AT, 16u);
    memcpy(&m->approach_x, whole + HOME_POSITION_APPROACH_X_AT, 4u);
    memcpy(&m->approach_y, whole + HOME_POSITION_APPROACH_Y_AT, 4u);
    memcpy(&m->approach_z, whole + HOME_POSITION_APPROACH_Z_AT, 4u);
    memcpy(&m->time_usec, whole + HOME_POSITION_TIME_USEC_AT, 8u);
}

/* Whether the vehicle is on the ground. */
#define EXTENDED_SYS_STATE_ID 245u
#define EXTENDED_SYS_STATE_LENGTH 2u
#define EXTENDED_SYS_STATE_CRC_EXTRA 130u
typedef struct {
    uint8_t vtol_state; /* 0. */
    uint8_t landed_state; /* MAV_LANDED_STATE: 0 not known, 1 on the ground, 2 in the air, 3 taking off, 4 landing. */
} extended_sys_state_msg;
enum {
    EXTENDED_SYS_STATE_VTOL_STATE_AT = 0,
    EXTENDED_SYS_STATE_LANDED_STATE_AT = 1,
};

static inline void extended_sys_state_encode(const extended_sys_state_msg *m, uint8_t payload[EXTENDED_SYS_STATE_LENGTH])
{
    _Static_assert(offsetof(extended_sys_state_msg, landed_state) == EXTENDED_SYS_STATE_LANDED_STATE_AT, "no gaps");
    memcpy(payload, m, EXTENDED_SYS_STATE_LENGTH);
}

static inline void extended_sys_state_decode(extended_sys_state_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < EXTENDED_SYS_STATE_LENGTH ? length : EXTENDED_SYS_STATE_LENGTH);
}

/* A sentence for the pilot. */
#define STATUSTEXT_ID 253u
#define STATUSTEXT_LENGTH 54u
#define STATUSTEXT_CRC_EXTRA 83u
typedef struct {
    uint8_t severity; /* MAV_SEVERITY: 3 error, 4 warning, 6 info. */
    char text[50]; /* Zero-terminated unless 50 long. */
    uint16_t id; /* 0: the text is whole; else the same for all chunks of one text. */
    uint8_t chunk_seq; /* Which chunk. */
} statustext_msg;
enum {
    STATUSTEXT_SEVERITY_AT = 0,
    STATUSTEXT_TEXT_AT = 1,
    STATUSTEXT_ID_AT = 51,
    STATUSTEXT_CHUNK_SEQ_AT = 53,
};

static inline void statustext_encode(const statustext_msg *m, uint8_t payload[STATUSTEXT_LENGTH])
{
    memcpy(payload + STATUSTEXT_SEVERITY_AT, &m->severity, 1u);
    memcpy(payload + STATUSTEXT_TEXT_AT, m->text, 50u);
    memcpy(payload + STATUSTEXT_ID_AT, &m->id, 2u);
    memcpy(payload + STATUSTEXT_CHUNK_SEQ_AT, &m->chunk_seq, 1u);
}

static inline void statustext_decode(statustext_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[STATUSTEXT_LENGTH] = {0};
    memcpy(whole, payload, length < STATUSTEXT_LENGTH ? length : STATUSTEXT_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->severity, whole + STATUSTEXT_SEVERITY_AT, 1u);
    memcpy(m->text, whole + STATUSTEXT_TEXT_AT, 50u);
    memcpy(&m->id, whole + STATUSTEXT_ID_AT, 2u);
    memcpy(&m->chunk_seq, whole + STATUSTEXT_CHUNK_SEQ_AT, 1u);
}

/* Rotor speeds. */
#define ESC_STATUS_ID 291u
#define ESC_STATUS_LENGTH 57u
#define ESC_STATUS_CRC_EXTRA 10u
typedef struct {
    uint64_t time_usec; /* Vehicle time. */
    int32_t rpm[4]; /* Speed, rev/min. */
    float voltage[4]; /* V. */
    float current[4]; /* A; 0, unknown. */
    uint8_t index; /* First rotor of this message: 0. */
} esc_status_msg;
enum {
    ESC_STATUS_TIME_USEC_AT = 0,
    ESC_STATUS_RPM_AT = 8,
    ESC_STATUS_VOLTAGE_AT = 24,
    ESC_STATUS_CURRENT_AT = 40,
    ESC_STATUS_INDEX_AT = 56,
};

static inline void esc_status_encode(const esc_status_msg *m, uint8_t payload[ESC_STATUS_LENGTH])
{
    _Static_assert(offsetof(esc_status_msg, index) == ESC_STATUS_INDEX_AT, "no gaps");
    memcpy(payload, m, ESC_STATUS_LENGTH);
}

static inline void esc_status_decode(esc_status_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < ESC_STATUS_LENGTH ? length : ESC_STATUS_LENGTH);
}

/* Which MAVLink is spoken: 2 only. */
#define PROTOCOL_VERSION_ID 300u
#define PROTOCOL_VERSION_LENGTH 22u
#define PROTOCOL_VERSION_CRC_EXTRA 217u
typedef struct {
    uint16_t version; /* 200. */
    uint16_t min_version; /* 200. */
    uint16_t max_version; /* 200. */
    uint8_t spec_version_hash[8]; /* 0. */
    uint8_t library_version_hash[8]; /* 0. */
} protocol_version_msg;
enum {
    PROTOCOL_VERSION_VERSION_AT = 0,
    PROTOCOL_VERSION_MIN_VERSION_AT = 2,
    PROTOCOL_VERSION_MAX_VERSION_AT = 4,
    PROTOCOL_VERSION_SPEC_VERSION_HASH_AT = 6,
    PROTOCOL_VERSION_LIBRARY_VERSION_HASH_AT = 14,
};

static inline void protocol_version_encode(const protocol_version_msg *m, uint8_t payload[PROTOCOL_VERSION_LENGTH])
{
    _Static_assert(offsetof(protocol_version_msg, library_version_hash) == PROTOCOL_VERSION_LIBRARY_VERSION_HASH_AT, "no gaps");
    memcpy(payload, m, PROTOCOL_VERSION_LENGTH);
}

static inline void protocol_version_decode(protocol_version_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < PROTOCOL_VERSION_LENGTH ? length : PROTOCOL_VERSION_LENGTH);
}

/* Pose, velocity and rate in one message. */
#define ODOMETRY_ID 331u
#define ODOMETRY_LENGTH 233u
#define ODOMETRY_CRC_EXTRA 91u
typedef struct {
    uint64_t time_usec; /* Vehicle time. */
    float x; /* m. */
    float y; /* m. */
    float z; /* m. */
    float q[4]; /* w x y z, frame from child frame. */
    float vx; /* In the child frame, m/s. */
    float vy; /* In the child frame, m/s. */
    float vz; /* In the child frame, m/s. */
    float rollspeed; /* rad/s. */
    float pitchspeed; /* rad/s. */
    float yawspeed; /* rad/s. */
    float pose_covariance[21]; /* NaN first: unknown. */
    float velocity_covariance[21]; /* NaN first: unknown. */
    uint8_t frame_id; /* MAV_FRAME: 20, local FRD (any heading). */
    uint8_t child_frame_id; /* MAV_FRAME: 12, body FRD. */
    uint8_t reset_counter; /* 0. */
    uint8_t estimator_type; /* 0, unknown. */
    int8_t quality; /* 0, unknown. */
} odometry_msg;
enum {
    ODOMETRY_TIME_USEC_AT = 0,
    ODOMETRY_X_AT = 8,
    ODOMETRY_Y_AT = 12,
    ODOMETRY_Z_AT = 16,
    ODOMETRY_Q_AT = 20,
    ODOMETRY_VX_AT = 36,
    ODOMETRY_VY_AT = 40,
    ODOMETRY_VZ_AT = 44,
    ODOMETRY_ROLLSPEED_AT = 48,
    ODOMETRY_PITCHSPEED_AT = 52,
    ODOMETRY_YAWSPEED_AT = 56,
    ODOMETRY_POSE_COVARIANCE_AT = 60,
    ODOMETRY_VELOCITY_COVARIANCE_AT = 144,
    ODOMETRY_FRAME_ID_AT = 228,
    ODOMETRY_CHILD_FRAME_ID_AT = 229,
    ODOMETRY_RESET_COUNTER_AT = 230,
    ODOMETRY_ESTIMATOR_TYPE_AT = 231,
    ODOMETRY_QUALITY_AT = 232,
};

static inline void odometry_encode(const odometry_msg *m, uint8_t payload[ODOMETRY_LENGTH])
{
    _Static_assert(offsetof(odometry_msg, quality) == ODOMETRY_QUALITY_AT, "no gaps");
    memcpy(payload, m, ODOMETRY_LENGTH);
}

static inline void odometry_decode(odometry_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < ODOMETRY_LENGTH ? length : ODOMETRY_LENGTH);
}

/* All a flight log needs of one instant; also the record of the on-board log. */
#define GOSHAWK_STATE_ID 54000u
#define GOSHAWK_STATE_LENGTH 227u
#define GOSHAWK_STATE_CRC_EXTRA 231u
typedef struct {
    uint64_t time_us; /* Vehicle time. */
    float position_world_m[3]; /* Estimate. */
    float velocity_world_m_s[3]; /* Estimate. */
    float q_world_body[4]; /* Estimate. */
    float rate_body_rad_s[3]; /* Gyroscope. */
    float specific_force_body_m_s2[3]; /* Accelerometer. */
    float rotor_speed_rad_s[4]; /* Measured. */
    float rotor_speed_command_rad_s[4]; /* Asked of the motors. */
    float setpoint_position_world_m[3]; /* Reference. */
    float setpoint_velocity_world_m_s[3]; /* Reference. */
    float setpoint_q_world_body[4]; /* Attitude the controller steers to. */
    float battery_v; /* Measured. */
    float trajectory_time_s; /* Time along the active trajectory; negative when none is being flown. */
    float path_rate; /* 1 as planned, 0 standing on the path. */
    float path_limit; /* What the supervisor leaves of the rate asked for, 0 to 1. */
    float reckoning_s; /* How long position has been dead reckoned; 0 measured. */
    float reckoning_std_m; /* Standard deviation that the horizontal position has grown to by that. */
    uint16_t sequence; /* Counts these messages, so that a receiver knows what it missed. */
    uint8_t mission_state; /* State of the mission. */
    uint8_t reason; /* tc_reason: why it is in that state. */
    uint8_t limit_reason; /* tc_reason: why path_limit is less than 1; 0 it is not. */
    uint8_t warnings; /* TC_WARNING_ bits. */
    uint8_t landing_stage; /* tc_landing_stage. */
    uint8_t estimate_valid; /* TC_VALID_ bits of the estimate. */
    uint8_t estimate_faults; /* What the controller found wrong with it: bits of tc_telemetry.estimate_faults. */
    uint8_t saturation; /* Bits of the mixer's saturation report. */
    float disturbance_force_world_n[3]; /* Of everything that is not modelled; zero where the observer does not run. */
    float disturbance_torque_body_n_m[3]; /* The same. */
    float disturbance_torque_std_n_m[3]; /* Standard deviation by the gyroscope's noise. */
    float disturbance_force_std_n; /* Standard deviation of one axis by the noise of accelerometer and pose. */
    float pose_delay_s[2]; /* Of position and attitude beyond their stamps. */
    uint8_t observer_state; /* tc_observer_state. */
} goshawk_state_msg;
enum {
    GOSHAWK_STATE_TIME_US_AT = 0,
    GOSHAWK_STATE_POSITION_WORLD_M_AT = 8,
    GOSHAWK_STATE_VELOCITY_WORLD_M_S_AT = 20,
    GOSHAWK_STATE_Q_WORLD_BODY_AT = 32,
    GOSHAWK_STATE_RATE_BODY_RAD_S_AT = 48,
    GOSHAWK_STATE_SPECIFIC_FORCE_BODY_M_S2_AT = 60,
    GOSHAWK_STATE_ROTOR_SPEED_RAD_S_AT = 72,
    GOSHAWK_STATE_ROTOR_SPEED_COMMAND_RAD_S_AT = 88,
    GOSHAWK_STATE_SETPOINT_POSITION_WORLD_M_AT = 104,
    GOSHAWK_STATE_SETPOINT_VELOCITY_WORLD_M_S_AT = 116,
    GOSHAWK_STATE_SETPOINT_Q_WORLD_BODY_AT = 128,
    GOSHAWK_STATE_BATTERY_V_AT = 144,
    GOSHAWK_STATE_TRAJECTORY_TIME_S_AT = 148,
    GOSHAWK_STATE_PATH_RATE_AT = 152,
    GOSHAWK_STATE_PATH_LIMIT_AT = 156,
    GOSHAWK_STATE_RECKONING_S_AT = 160,
    GOSHAWK_STATE_RECKONING_STD_M_AT = 164,
    GOSHAWK_STATE_SEQUENCE_AT = 168,
    GOSHAWK_STATE_MISSION_STATE_AT = 170,
    GOSHAWK_STATE_REASON_AT = 171,
    GOSHAWK_STATE_LIMIT_REASON_AT = 172,
    GOSHAWK_STATE_WARNINGS_AT = 173,
    GOSHAWK_STATE_LANDING_STAGE_AT = 174,
    GOSHAWK_STATE_ESTIMATE_VALID_AT = 175,
    GOSHAWK_STATE_ESTIMATE_FAULTS_AT = 176,
    GOSHAWK_STATE_SATURATION_AT = 177,
    GOSHAWK_STATE_DISTURBANCE_FORCE_WORLD_N_AT = 178,
    GOSHAWK_STATE_DISTURBANCE_TORQUE_BODY_N_M_AT = 190,
    GOSHAWK_STATE_DISTURBANCE_TORQUE_STD_N_M_AT = 202,
    GOSHAWK_STATE_DISTURBANCE_FORCE_STD_N_AT = 214,
    GOSHAWK_STATE_POSE_DELAY_S_AT = 218,
    GOSHAWK_STATE_OBSERVER_STATE_AT = 226,
};

static inline void goshawk_state_encode(const goshawk_state_msg *m, uint8_t payload[GOSHAWK_STATE_LENGTH])
{
    memcpy(payload + GOSHAWK_STATE_TIME_US_AT, &m->time_us, 8u);
    memcpy(payload + GOSHAWK_STATE_POSITION_WORLD_M_AT, m->position_world_m, 12u);
    memcpy(payload + GOSHAWK_STATE_VELOCITY_WORLD_M_S_AT, m->velocity_world_m_s, 12u);
    memcpy(payload + GOSHAWK_STATE_Q_WORLD_BODY_AT, m->q_world_body, 16u);
    memcpy(payload + GOSHAWK_STATE_RATE_BODY_RAD_S_AT, m->rate_body_rad_s, 12u);
    memcpy(payload + GOSHAWK_STATE_SPECIFIC_FORCE_BODY_M_S2_AT, m->specific_force_body_m_s2, 12u);
    memcpy(payload + GOSHAWK_STATE_ROTOR_SPEED_RAD_S_AT, m->rotor_speed_rad_s, 16u);
    memcpy(payload + GOSHAWK_STATE_ROTOR_SPEED_COMMAND_RAD_S_AT, m->rotor_speed_command_rad_s, 16u);
    memcpy(payload + GOSHAWK_STATE_SETPOINT_POSITION_WORLD_M_AT, m->setpoint_position_world_m, 12u);
    memcpy(payload + GOSHAWK_STATE_SETPOINT_VELOCITY_WORLD_M_S_AT, m->setpoint_velocity_world_m_s, 12u);
    memcpy(payload + GOSHAWK_STATE_SETPOINT_Q_WORLD_BODY_AT, m->setpoint_q_world_body, 16u);
    memcpy(payload + GOSHAWK_STATE_BATTERY_V_AT, &m->battery_v, 4u);
    memcpy(payload + GOSHAWK_STATE_TRAJECTORY_TIME_S_AT, &m->trajectory_time_s, 4u);
    memcpy(payload + GOSHAWK_STATE_PATH_RATE_AT, &m->path_rate, 4u);
    memcpy(payload + GOSHAWK_STATE_PATH_LIMIT_AT, &m->path_limit, 4u);
    memcpy(payload + GOSHAWK_STATE_RECKONING_S_AT, &m->reckoning_s, 4u);
    memcpy(payload + GOSHAWK_STATE_RECKONING_STD_M_AT, &m->reckoning_std_m, 4u);
    memcpy(payload + GOSHAWK_STATE_SEQUENCE_AT, &m->sequence, 2u);
    memcpy(payload + GOSHAWK_STATE_MISSION_STATE_AT, &m->mission_state, 1u);
    memcpy(payload + GOSHAWK_STATE_REASON_AT, &m->reason, 1u);
    memcpy(payload + GOSHAWK_STATE_LIMIT_REASON_AT, &m->limit_reason, 1u);
    memcpy(payload + GOSHAWK_STATE_WARNINGS_AT, &m->warnings, 1u);
    memcpy(payload + GOSHAWK_STATE_LANDING_STAGE_AT, &m->landing_stage, 1u);
    memcpy(payload + GOSHAWK_STATE_ESTIMATE_VALID_AT, &m->estimate_valid, 1u);
    memcpy(payload + GOSHAWK_STATE_ESTIMATE_FAULTS_AT, &m->estimate_faults, 1u);
    memcpy(payload + GOSHAWK_STATE_SATURATION_AT, &m->saturation, 1u);
    memcpy(payload + GOSHAWK_STATE_DISTURBANCE_FORCE_WORLD_N_AT, m->disturbance_force_world_n, 12u);
    memcpy(payload + GOSHAWK_STATE_DISTURBANCE_TORQUE_BODY_N_M_AT, m->disturbance_torque_body_n_m, 12u);
    memcpy(payload + GOSHAWK_STATE_DISTURBANCE_TORQUE_STD_N_M_AT, m->disturbance_torque_std_n_m, 12u);
    memcpy(payload + GOSHAWK_STATE_DISTURBANCE_FORCE_STD_N_AT, &m->disturbance_force_std_n, 4u);
    memcpy(payload + GOSHAWK_STATE_POSE_DELAY_S_AT, m->pose_delay_s, 8u);
    memcpy(payload + GOSHAWK_STATE_OBSERVER_STATE_AT, &m->observer_state, 1u);
}

static inline void goshawk_state_decode(goshawk_state_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_STATE_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_STATE_LENGTH ? length : GOSHAWK_STATE_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->time_us, whole + GOSHAWK_STATE_TIME_US_AT, 8u);
    memcpy(m->position_world_m, whole + GOSHAWK_STATE_POSITION_WORLD_M_AT, 12u);
    memcpy(m->velocity_world_m_s, whole + GOSHAWK_STATE_VELOCITY_WORLD_M_S_AT, 12u);
    memcpy(m->q_world_body, whole + GOSHAWK_STATE_Q_WORLD_BODY_AT, 16u);
    memcpy(m->rate_body_rad_s, whole + GOSHAWK_STATE_RATE_BODY_RAD_S_AT, 12u);
    memcpy(m->specific_force_body_m_s2, whole + GOSHAWK_STATE_SPECIFIC_FORCE_BODY_M_S2_AT, 12u);
    memcpy(m->rotor_speed_rad_s, whole + GOSHAWK_STATE_ROTOR_SPEED_RAD_S_AT, 16u);
    memcpy(m->rotor_speed_command_rad_s, whole + GOSHAWK_STATE_ROTOR_SPEED_COMMAND_RAD_S_AT, 16u);
    memcpy(m->setpoint_position_world_m, whole + GOSHAWK_STATE_SETPOINT_POSITION_WORLD_M_AT, 12u);
    memcpy(m->setpoint_velocity_world_m_s, whole + GOSHAWK_STATE_SETPOINT_VELOCITY_WORLD_M_S_AT, 12u);
    memcpy(m->setpoint_q_world_body, whole + GOSHAWK_STATE_SETPOINT_Q_WORLD_BODY_AT, 16u);
    memcpy(&m->battery_v, whole + GOSHAWK_STATE_BATTERY_V_AT, 4u);
    memcpy(&m->trajectory_time_s, whole + GOSHAWK_STATE_TRAJECTORY_TIME_S_AT, 4u);
    memcpy(&m->path_rate, whole + GOSHAWK_STATE_PATH_RATE_AT, 4u);
    memcpy(&m->path_limit, whole + GOSHAWK_STATE_PATH_LIMIT_AT, 4u);
    memcpy(&m->reckoning_s, whole + GOSHAWK_STATE_RECKONING_S_AT, 4u);
    memcpy(&m->reckoning_std_m, whole + GOSHAWK_STATE_RECKONING_STD_M_AT, 4u);
    memcpy(&m->sequence, whole + GOSHAWK_STATE_SEQUENCE_AT, 2u);
    memcpy(&m->mission_state, whole + GOSHAWK_STATE_MISSION_STATE_AT, 1u);
    memcpy(&m->reason, whole + GOSHAWK_STATE_REASON_AT, 1u);
    memcpy(&m->limit_reason, whole + GOSHAWK_STATE_LIMIT_REASON_AT, 1u);
    memcpy(&m->warnings, whole + GOSHAWK_STATE_WARNINGS_AT, 1u);
    memcpy(&m->landing_stage, whole + GOSHAWK_STATE_LANDING_STAGE_AT, 1u);
    memcpy(&m->estimate_valid, whole + GOSHAWK_STATE_ESTIMATE_VALID_AT, 1u);
    memcpy(&m->estimate_faults, whole + GOSHAWK_STATE_ESTIMATE_FAULTS_AT, 1u);
    memcpy(&m->saturation, whole + GOSHAWK_STATE_SATURATION_AT, 1u);
    memcpy(m->disturbance_force_world_n, whole + GOSHAWK_STATE_DISTURBANCE_FORCE_WORLD_N_AT, 12u);
    memcpy(m->disturbance_torque_body_n_m, whole + GOSHAWK_STATE_DISTURBANCE_TORQUE_BODY_N_M_AT, 12u);
    memcpy(m->disturbance_torque_std_n_m, whole + GOSHAWK_STATE_DISTURBANCE_TORQUE_STD_N_M_AT, 12u);
    memcpy(&m->disturbance_force_std_n, whole + GOSHAWK_STATE_DISTURBANCE_FORCE_STD_N_AT, 4u);
    memcpy(m->pose_delay_s, whole + GOSHAWK_STATE_POSE_DELAY_S_AT, 8u);
    memcpy(&m->observer_state, whole + GOSHAWK_STATE_OBSERVER_STATE_AT, 1u);
}

/* Ask for records of the on-board log; nothing wanted asks for GOSHAWK_LOG_INFO. */
#define GOSHAWK_LOG_REQUEST_ID 54001u
#define GOSHAWK_LOG_REQUEST_LENGTH 70u
#define GOSHAWK_LOG_REQUEST_CRC_EXTRA 126u
typedef struct {
    uint32_t first; /* Index of the first. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t wanted[64]; /* Bit i % 8 of byte i / 8: record first + i is wanted. */
} goshawk_log_request_msg;
enum {
    GOSHAWK_LOG_REQUEST_FIRST_AT = 0,
    GOSHAWK_LOG_REQUEST_TARGET_SYSTEM_AT = 4,
    GOSHAWK_LOG_REQUEST_TARGET_COMPONENT_AT = 5,
    GOSHAWK_LOG_REQUEST_WANTED_AT = 6,
};

static inline void goshawk_log_request_encode(const goshawk_log_request_msg *m, uint8_t payload[GOSHAWK_LOG_REQUEST_LENGTH])
{
    _Static_assert(offsetof(goshawk_log_request_msg, wanted) == GOSHAWK_LOG_REQUEST_WANTED_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_LOG_REQUEST_LENGTH);
}

static inline void goshawk_log_request_decode(goshawk_log_request_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_LOG_REQUEST_LENGTH ? length : GOSHAWK_LOG_REQUEST_LENGTH);
}

/* What the on-board log holds. */
#define GOSHAWK_LOG_INFO_ID 54002u
#define GOSHAWK_LOG_INFO_LENGTH 21u
#define GOSHAWK_LOG_INFO_CRC_EXTRA 114u
typedef struct {
    uint32_t log_id; /* Changes with every LOG_START. */
    uint32_t records; /* How many there are. */
    uint32_t capacity; /* How many fit. */
    uint32_t not_stored; /* Records that no longer fitted. */
    uint32_t period_us; /* Time between records. */
    uint8_t running; /* 1 while recording. */
} goshawk_log_info_msg;
enum {
    GOSHAWK_LOG_INFO_LOG_ID_AT = 0,
    GOSHAWK_LOG_INFO_RECORDS_AT = 4,
    GOSHAWK_LOG_INFO_CAPACITY_AT = 8,
    GOSHAWK_LOG_INFO_NOT_STORED_AT = 12,
    GOSHAWK_LOG_INFO_PERIOD_US_AT = 16,
    GOSHAWK_LOG_INFO_RUNNING_AT = 20,
};

static inline void goshawk_log_info_encode(const goshawk_log_info_msg *m, uint8_t payload[GOSHAWK_LOG_INFO_LENGTH])
{
    _Static_assert(offsetof(goshawk_log_info_msg, running) == GOSHAWK_LOG_INFO_RUNNING_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_LOG_INFO_LENGTH);
}

static inline void goshawk_log_info_decode(goshawk_log_info_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_LOG_INFO_LENGTH ? length : GOSHAWK_LOG_INFO_LENGTH);
}

/* One record. */
#define GOSHAWK_LOG_RECORD_ID 54003u
#define GOSHAWK_LOG_RECORD_LENGTH 235u
#define GOSHAWK_LOG_RECORD_CRC_EXTRA 137u
typedef struct {
    uint32_t log_id; /* Of GOSHAWK_LOG_INFO. */
    uint32_t index; /* Which record. */
    uint8_t record[227]; /* Payload of a GOSHAWK_STATE. */
} goshawk_log_record_msg;
enum {
    GOSHAWK_LOG_RECORD_LOG_ID_AT = 0,
    GOSHAWK_LOG_RECORD_INDEX_AT = 4,
    GOSHAWK_LOG_RECORD_RECORD_AT = 8,
};

static inline void goshawk_log_record_encode(const goshawk_log_record_msg *m, uint8_t payload[GOSHAWK_LOG_RECORD_LENGTH])
{
    _Static_assert(offsetof(goshawk_log_record_msg, record) == GOSHAWK_LOG_RECORD_RECORD_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_LOG_RECORD_LENGTH);
}

static inline void goshawk_log_record_decode(goshawk_log_record_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_LOG_RECORD_LENGTH ? length : GOSHAWK_LOG_RECORD_LENGTH);
}

/* Opens (or re-opens) a transfer into the staging slot; also the header sent on read-back. */
#define GOSHAWK_TRAJECTORY_BEGIN_ID 54010u
#define GOSHAWK_TRAJECTORY_BEGIN_LENGTH 67u
#define GOSHAWK_TRAJECTORY_BEGIN_CRC_EXTRA 54u
typedef struct {
    uint32_t transfer_id; /* Chosen by the sender, new for every upload; never 0. */
    uint32_t trajectory_id; /* Identity of the trajectory. */
    uint32_t crc32; /* tc_trajectory_crc32 (trajectory.h). */
    float clearance_m; /* Proved by the planner: the tracking error at which the vehicle gives up; 0 not stated. */
    uint16_t segments; /* How many. */
    uint8_t target_system; /* Receiver. */
    uint8_t target_component; /* Receiver. */
    uint8_t coefficient_count; /* Per axis, at most 12; the others are zero. */
    uint8_t link_loss_policy; /* tc_link_loss_policy: 0 finish then hold, 1 hold, 2 land. */
    uint8_t samples; /* How many check samples come with it, at most 8. */
    uint8_t map_hash[8]; /* First bytes of the map's hash. */
    uint8_t vehicle_hash[8]; /* First bytes of the vehicle's hash. */
    char name[24]; /* Zero-padded. */
    uint32_t session; /* Of the sender, as in its request for control. */
} goshawk_trajectory_begin_msg;
enum {
    GOSHAWK_TRAJECTORY_BEGIN_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_BEGIN_TRAJECTORY_ID_AT = 4,
    GOSHAWK_TRAJECTORY_BEGIN_CRC32_AT = 8,
    GOSHAWK_TRAJECTORY_BEGIN_CLEARANCE_M_AT = 12,
    GOSHAWK_TRAJECTORY_BEGIN_SEGMENTS_AT = 16,
    GOSHAWK_TRAJECTORY_BEGIN_TARGET_SYSTEM_AT = 18,
    GOSHAWK_TRAJECTORY_BEGIN_TARGET_COMPONENT_AT = 19,
    GOSHAWK_TRAJECTORY_BEGIN_COEFFICIENT_COUNT_AT = 20,
    GOSHAWK_TRAJECTORY_BEGIN_LINK_LOSS_POLICY_AT = 21,
    GOSHAWK_TRAJECTORY_BEGIN_SAMPLES_AT = 22,
    GOSHAWK_TRAJECTORY_BEGIN_MAP_HASH_AT = 23,
    GOSHAWK_TRAJECTORY_BEGIN_VEHICLE_HASH_AT = 31,
    GOSHAWK_TRAJECTORY_BEGIN_NAME_AT = 39,
    GOSHAWK_TRAJECTORY_BEGIN_SESSION_AT = 63,
};

static inline void goshawk_trajectory_begin_encode(const goshawk_trajectory_begin_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_BEGIN_LENGTH])
{
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_TRANSFER_ID_AT, &m->transfer_id, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_TRAJECTORY_ID_AT, &m->trajectory_id, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_CRC32_AT, &m->crc32, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_CLEARANCE_M_AT, &m->clearance_m, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_SEGMENTS_AT, &m->segments, 2u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_COEFFICIENT_COUNT_AT, &m->coefficient_count, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_LINK_LOSS_POLICY_AT, &m->link_loss_policy, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_SAMPLES_AT, &m->samples, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_MAP_HASH_AT, m->map_hash, 8u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_VEHICLE_HASH_AT, m->vehicle_hash, 8u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_NAME_AT, m->name, 24u);
    memcpy(payload + GOSHAWK_TRAJECTORY_BEGIN_SESSION_AT, &m->session, 4u);
}

static inline void goshawk_trajectory_begin_decode(goshawk_trajectory_begin_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_TRAJECTORY_BEGIN_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_TRAJECTORY_BEGIN_LENGTH ? length : GOSHAWK_TRAJECTORY_BEGIN_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->transfer_id, whole + GOSHAWK_TRAJECTORY_BEGIN_TRANSFER_ID_AT, 4u);
    memcpy(&m->trajectory_id, whole + GOSHAWK_TRAJECTORY_BEGIN_TRAJECTORY_ID_AT, 4u);
    memcpy(&m->crc32, whole + GOSHAWK_TRAJECTORY_BEGIN_CRC32_AT, 4u);
    memcpy(&m->clearance_m, whole + GOSHAWK_TRAJECTORY_BEGIN_CLEARANCE_M_AT, 4u);
    memcpy(&m->segments, whole + GOSHAWK_TRAJECTORY_BEGIN_SEGMENTS_AT, 2u);
    memcpy(&m->target_system, whole + GOSHAWK_TRAJECTORY_BEGIN_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + GOSHAWK_TRAJECTORY_BEGIN_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->coefficient_count, whole + GOSHAWK_TRAJECTORY_BEGIN_COEFFICIENT_COUNT_AT, 1u);
    memcpy(&m->link_loss_policy, whole + GOSHAWK_TRAJECTORY_BEGIN_LINK_LOSS_POLICY_AT, 1u);
    memcpy(&m->samples, whole + GOSHAWK_TRAJECTORY_BEGIN_SAMPLES_AT, 1u);
    memcpy(m->map_hash, whole + GOSHAWK_TRAJECTORY_BEGIN_MAP_HASH_AT, 8u);
    memcpy(m->vehicle_hash, whole + GOSHAWK_TRAJECTORY_BEGIN_VEHICLE_HASH_AT, 8u);
    memcpy(m->name, whole + GOSHAWK_TRAJECTORY_BEGIN_NAME_AT, 24u);
    memcpy(&m->session, whole + GOSHAWK_TRAJECTORY_BEGIN_SESSION_AT, 4u);
}

/* One polynomial segment in the centred variable s = 2 t / T - 1. */
#define GOSHAWK_TRAJECTORY_SEGMENT_ID 54011u
#define GOSHAWK_TRAJECTORY_SEGMENT_LENGTH 204u
#define GOSHAWK_TRAJECTORY_SEGMENT_CRC_EXTRA 103u
typedef struct {
    uint32_t transfer_id; /* Of the transfer, or of the read-back. */
    uint32_t duration_us; /* T. */
    uint16_t index; /* Which segment. */
    uint8_t target_system; /* Receiver. */
    uint8_t target_component; /* Receiver. */
    float coefficients[48]; /* x, y, z (m), yaw (rad) of s^0, then of s^1, ... s^11. Last, so that zero ones are not sent. */
} goshawk_trajectory_segment_msg;
enum {
    GOSHAWK_TRAJECTORY_SEGMENT_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_SEGMENT_DURATION_US_AT = 4,
    GOSHAWK_TRAJECTORY_SEGMENT_INDEX_AT = 8,
    GOSHAWK_TRAJECTORY_SEGMENT_TARGET_SYSTEM_AT = 10,
    GOSHAWK_TRAJECTORY_SEGMENT_TARGET_COMPONENT_AT = 11,
    GOSHAWK_TRAJECTORY_SEGMENT_COEFFICIENTS_AT = 12,
};

static inline void goshawk_trajectory_segment_encode(const goshawk_trajectory_segment_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_SEGMENT_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_segment_msg, coefficients) == GOSHAWK_TRAJECTORY_SEGMENT_COEFFICIENTS_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH);
}

static inline void goshawk_trajectory_segment_decode(goshawk_trajectory_segment_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_TRAJECTORY_SEGMENT_LENGTH ? length : GOSHAWK_TRAJECTORY_SEGMENT_LENGTH);
}

/* Which segments of the transfer have arrived. */
#define GOSHAWK_TRAJECTORY_STATUS_ID 54012u
#define GOSHAWK_TRAJECTORY_STATUS_LENGTH 144u
#define GOSHAWK_TRAJECTORY_STATUS_CRC_EXTRA 86u
typedef struct {
    uint32_t transfer_id; /* 0: none is open. */
    uint32_t frames; /* How many frames of this transfer have arrived, repeats included. */
    uint16_t received; /* How many segments have arrived. */
    uint16_t segments; /* Of how many. */
    uint16_t last_index; /* Segment that arrived last. */
    uint8_t reason; /* 0 done, else tc_reason or GOSHAWK_LINK_REASON. */
    uint8_t samples; /* 1 when the check samples have arrived. */
    uint8_t bitmap[128]; /* Bit i % 8 of byte i / 8: segment i has arrived. Last, so that its zero end is not sent. */
} goshawk_trajectory_status_msg;
enum {
    GOSHAWK_TRAJECTORY_STATUS_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_STATUS_FRAMES_AT = 4,
    GOSHAWK_TRAJECTORY_STATUS_RECEIVED_AT = 8,
    GOSHAWK_TRAJECTORY_STATUS_SEGMENTS_AT = 10,
    GOSHAWK_TRAJECTORY_STATUS_LAST_INDEX_AT = 12,
    GOSHAWK_TRAJECTORY_STATUS_REASON_AT = 14,
    GOSHAWK_TRAJECTORY_STATUS_SAMPLES_AT = 15,
    GOSHAWK_TRAJECTORY_STATUS_BITMAP_AT = 16,
};

static inline void goshawk_trajectory_status_encode(const goshawk_trajectory_status_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_STATUS_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_status_msg, bitmap) == GOSHAWK_TRAJECTORY_STATUS_BITMAP_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_STATUS_LENGTH);
}

static inline void goshawk_trajectory_status_decode(goshawk_trajectory_status_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_TRAJECTORY_STATUS_LENGTH ? length : GOSHAWK_TRAJECTORY_STATUS_LENGTH);
}

/* Check the staged trajectory and make it the active one. */
#define GOSHAWK_TRAJECTORY_COMMIT_ID 54013u
#define GOSHAWK_TRAJECTORY_COMMIT_LENGTH 18u
#define GOSHAWK_TRAJECTORY_COMMIT_CRC_EXTRA 180u
typedef struct {
    uint32_t transfer_id; /* Of the transfer. */
    uint32_t trajectory_id; /* As in the beginning. */
    uint32_t crc32; /* As in the beginning. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint32_t session; /* Of the sender, as in its request for control. */
} goshawk_trajectory_commit_msg;
enum {
    GOSHAWK_TRAJECTORY_COMMIT_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_COMMIT_TRAJECTORY_ID_AT = 4,
    GOSHAWK_TRAJECTORY_COMMIT_CRC32_AT = 8,
    GOSHAWK_TRAJECTORY_COMMIT_TARGET_SYSTEM_AT = 12,
    GOSHAWK_TRAJECTORY_COMMIT_TARGET_COMPONENT_AT = 13,
    GOSHAWK_TRAJECTORY_COMMIT_SESSION_AT = 14,
};

static inline void goshawk_trajectory_commit_encode(const goshawk_trajectory_commit_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_COMMIT_LENGTH])
{
    memcpy(payload + GOSHAWK_TRAJECTORY_COMMIT_TRANSFER_ID_AT, &m->transfer_id, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_COMMIT_TRAJECTORY_ID_AT, &m->trajectory_id, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_COMMIT_CRC32_AT, &m->crc32, 4u);
    memcpy(payload + GOSHAWK_TRAJECTORY_COMMIT_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_COMMIT_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + GOSHAWK_TRAJECTORY_COMMIT_SESSION_AT, &m->session, 4u);
}

static inline void goshawk_trajectory_commit_decode(goshawk_trajectory_commit_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_TRAJECTORY_COMMIT_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_TRAJECTORY_COMMIT_LENGTH ? length : GOSHAWK_TRAJECTORY_COMMIT_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->transfer_id, whole + GOSHAWK_TRAJECTORY_COMMIT_TRANSFER_ID_AT, 4u);
    memcpy(&m->trajectory_id, whole + GOSHAWK_TRAJECTORY_COMMIT_TRAJECTORY_ID_AT, 4u);
    memcpy(&m->crc32, whole + GOSHAWK_TRAJECTORY_COMMIT_CRC32_AT, 4u);
    memcpy(&m->target_system, whole + GOSHAWK_TRAJECTORY_COMMIT_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + GOSHAWK_TRAJECTORY_COMMIT_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->session, whole + GOSHAWK_TRAJECTORY_COMMIT_SESSION_AT, 4u);
}

/* Answer to a commit; whatever the answer, what is active now. */
#define GOSHAWK_TRAJECTORY_RESULT_ID 54014u
#define GOSHAWK_TRAJECTORY_RESULT_LENGTH 15u
#define GOSHAWK_TRAJECTORY_RESULT_CRC_EXTRA 100u
typedef struct {
    uint32_t transfer_id; /* Of the commit. */
    uint32_t active_id; /* Trajectory now active; 0 none. */
    uint32_t active_crc32; /* Its CRC. */
    uint16_t segment; /* Where the check failed. */
    uint8_t reason; /* 0 done, else tc_reason or GOSHAWK_LINK_REASON. */
} goshawk_trajectory_result_msg;
enum {
    GOSHAWK_TRAJECTORY_RESULT_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_RESULT_ACTIVE_ID_AT = 4,
    GOSHAWK_TRAJECTORY_RESULT_ACTIVE_CRC32_AT = 8,
    GOSHAWK_TRAJECTORY_RESULT_SEGMENT_AT = 12,
    GOSHAWK_TRAJECTORY_RESULT_REASON_AT = 14,
};

static inline void goshawk_trajectory_result_encode(const goshawk_trajectory_result_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_RESULT_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_result_msg, reason) == GOSHAWK_TRAJECTORY_RESULT_REASON_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_RESULT_LENGTH);
}

static inline void goshawk_trajectory_result_decode(goshawk_trajectory_result_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_TRAJECTORY_RESULT_LENGTH ? length : GOSHAWK_TRAJECTORY_RESULT_LENGTH);
}

/* Ask for segments of the active trajectory; nothing wanted asks for its header. */
#define GOSHAWK_TRAJECTORY_READ_ID 54015u
#define GOSHAWK_TRAJECTORY_READ_LENGTH 72u
#define GOSHAWK_TRAJECTORY_READ_CRC_EXTRA 243u
typedef struct {
    uint32_t transfer_id; /* Chosen by the asker; the answers carry it. */
    uint16_t first; /* Index of the first. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t wanted[64]; /* Bit i % 8 of byte i / 8: segment first + i is wanted. */
} goshawk_trajectory_read_msg;
enum {
    GOSHAWK_TRAJECTORY_READ_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_READ_FIRST_AT = 4,
    GOSHAWK_TRAJECTORY_READ_TARGET_SYSTEM_AT = 6,
    GOSHAWK_TRAJECTORY_READ_TARGET_COMPONENT_AT = 7,
    GOSHAWK_TRAJECTORY_READ_WANTED_AT = 8,
};

static inline void goshawk_trajectory_read_encode(const goshawk_trajectory_read_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_READ_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_read_msg, wanted) == GOSHAWK_TRAJECTORY_READ_WANTED_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_READ_LENGTH);
}

static inline void goshawk_trajectory_read_decode(goshawk_trajectory_read_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_TRAJECTORY_READ_LENGTH ? length : GOSHAWK_TRAJECTORY_READ_LENGTH);
}

/* Points of the curve as the planner evaluates it; the vehicle compares at the commit. */
#define GOSHAWK_TRAJECTORY_SAMPLES_ID 54016u
#define GOSHAWK_TRAJECTORY_SAMPLES_LENGTH 166u
#define GOSHAWK_TRAJECTORY_SAMPLES_CRC_EXTRA 180u
typedef struct {
    uint32_t transfer_id; /* Of the transfer. */
    uint32_t sample_us[8]; /* Time from the trajectory's start. */
    float values[32]; /* x, y, z (m), yaw (rad) of each. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
} goshawk_trajectory_samples_msg;
enum {
    GOSHAWK_TRAJECTORY_SAMPLES_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_SAMPLES_SAMPLE_US_AT = 4,
    GOSHAWK_TRAJECTORY_SAMPLES_VALUES_AT = 36,
    GOSHAWK_TRAJECTORY_SAMPLES_TARGET_SYSTEM_AT = 164,
    GOSHAWK_TRAJECTORY_SAMPLES_TARGET_COMPONENT_AT = 165,
};

static inline void goshawk_trajectory_samples_encode(const goshawk_trajectory_samples_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_SAMPLES_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_samples_msg, target_component) == GOSHAWK_TRAJECTORY_SAMPLES_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_SAMPLES_LENGTH);
}

static inline void goshawk_trajectory_samples_decode(goshawk_trajectory_samples_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_TRAJECTORY_SAMPLES_LENGTH ? length : GOSHAWK_TRAJECTORY_SAMPLES_LENGTH);
}

/* An order to the mission. A repeated request_id is answered again and not carried out again. */
#define GOSHAWK_MISSION_COMMAND_ID 54020u
#define GOSHAWK_MISSION_COMMAND_LENGTH 23u
#define GOSHAWK_MISSION_COMMAND_CRC_EXTRA 90u
typedef struct {
    uint32_t request_id; /* New for every order; never 0. */
    uint32_t trajectory_id; /* For START. */
    uint32_t crc32; /* For START. */
    float value; /* See GOSHAWK_COMMAND. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t command; /* GOSHAWK_COMMAND. */
    uint32_t session; /* Of the sender, as in its request for control. */
} goshawk_mission_command_msg;
enum {
    GOSHAWK_MISSION_COMMAND_REQUEST_ID_AT = 0,
    GOSHAWK_MISSION_COMMAND_TRAJECTORY_ID_AT = 4,
    GOSHAWK_MISSION_COMMAND_CRC32_AT = 8,
    GOSHAWK_MISSION_COMMAND_VALUE_AT = 12,
    GOSHAWK_MISSION_COMMAND_TARGET_SYSTEM_AT = 16,
    GOSHAWK_MISSION_COMMAND_TARGET_COMPONENT_AT = 17,
    GOSHAWK_MISSION_COMMAND_COMMAND_AT = 18,
    GOSHAWK_MISSION_COMMAND_SESSION_AT = 19,
};

static inline void goshawk_mission_command_encode(const goshawk_mission_command_msg *m, uint8_t payload[GOSHAWK_MISSION_COMMAND_LENGTH])
{
    memcpy(payload + GOSHAWK_MISSION_COMMAND_REQUEST_ID_AT, &m->request_id, 4u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_TRAJECTORY_ID_AT, &m->trajectory_id, 4u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_CRC32_AT, &m->crc32, 4u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_VALUE_AT, &m->value, 4u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_COMMAND_AT, &m->command, 1u);
    memcpy(payload + GOSHAWK_MISSION_COMMAND_SESSION_AT, &m->session, 4u);
}

static inline void goshawk_mission_command_decode(goshawk_mission_command_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_MISSION_COMMAND_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_MISSION_COMMAND_LENGTH ? length : GOSHAWK_MISSION_COMMAND_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->request_id, whole + GOSHAWK_MISSION_COMMAND_REQUEST_ID_AT, 4u);
    memcpy(&m->trajectory_id, whole + GOSHAWK_MISSION_COMMAND_TRAJECTORY_ID_AT, 4u);
    memcpy(&m->crc32, whole + GOSHAWK_MISSION_COMMAND_CRC32_AT, 4u);
    memcpy(&m->value, whole + GOSHAWK_MISSION_COMMAND_VALUE_AT, 4u);
    memcpy(&m->target_system, whole + GOSHAWK_MISSION_COMMAND_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + GOSHAWK_MISSION_COMMAND_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->command, whole + GOSHAWK_MISSION_COMMAND_COMMAND_AT, 1u);
    memcpy(&m->session, whole + GOSHAWK_MISSION_COMMAND_SESSION_AT, 4u);
}

/* Answer to an order. */
#define GOSHAWK_MISSION_RESULT_ID 54021u
#define GOSHAWK_MISSION_RESULT_LENGTH 7u
#define GOSHAWK_MISSION_RESULT_CRC_EXTRA 206u
typedef struct {
    uint32_t request_id; /* Of the order. */
    uint8_t command; /* Of the order. */
    uint8_t reason; /* 0 done, else tc_reason or GOSHAWK_LINK_REASON. */
    uint8_t mission_state; /* After it. */
} goshawk_mission_result_msg;
enum {
    GOSHAWK_MISSION_RESULT_REQUEST_ID_AT = 0,
    GOSHAWK_MISSION_RESULT_COMMAND_AT = 4,
    GOSHAWK_MISSION_RESULT_REASON_AT = 5,
    GOSHAWK_MISSION_RESULT_MISSION_STATE_AT = 6,
};

static inline void goshawk_mission_result_encode(const goshawk_mission_result_msg *m, uint8_t payload[GOSHAWK_MISSION_RESULT_LENGTH])
{
    _Static_assert(offsetof(goshawk_mission_result_msg, mission_state) == GOSHAWK_MISSION_RESULT_MISSION_STATE_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_MISSION_RESULT_LENGTH);
}

static inline void goshawk_mission_result_decode(goshawk_mission_result_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_MISSION_RESULT_LENGTH ? length : GOSHAWK_MISSION_RESULT_LENGTH);
}

/* Where the mission stands; sent at 5 Hz and on every change. */
#define GOSHAWK_MISSION_STATUS_ID 54022u
#define GOSHAWK_MISSION_STATUS_LENGTH 84u
#define GOSHAWK_MISSION_STATUS_CRC_EXTRA 71u
typedef struct {
    uint64_t time_us; /* Vehicle time. */
    uint32_t boot_id; /* Changes with every restart. */
    uint32_t active_id; /* Trajectory now active; 0 none. */
    uint32_t active_crc32; /* Its CRC. */
    float trajectory_time_s; /* Negative when none is being flown. */
    float trajectory_duration_s; /* Of the active one. */
    uint32_t frames_refused; /* Since the start: unsigned, wrongly signed, replayed, from a stream not opened, beyond the budget, or damaged. */
    uint32_t parameters_crc32; /* Of the parameters in force. */
    float path_rate; /* 1 as planned, 0 standing on the path. */
    uint8_t mission_state; /* State. */
    uint8_t reason; /* Why it is in that state. */
    uint8_t operator_system; /* Who holds the lease; 0 nobody. */
    uint8_t operator_component; /* Who holds the lease. */
    uint8_t map_hash[8]; /* Of the active trajectory. */
    uint8_t vehicle_hash[8]; /* Of the active trajectory. */
    char name[24]; /* Of the active trajectory. */
} goshawk_mission_status_msg;
enum {
    GOSHAWK_MISSION_STATUS_TIME_US_AT = 0,
    GOSHAWK_MISSION_STATUS_BOOT_ID_AT = 8,
    GOSHAWK_MISSION_STATUS_ACTIVE_ID_AT = 12,
    GOSHAWK_MISSION_STATUS_ACTIVE_CRC32_AT = 16,
    GOSHAWK_MISSION_STATUS_TRAJECTORY_TIME_S_AT = 20,
    GOSHAWK_MISSION_STATUS_TRAJECTORY_DURATION_S_AT = 24,
    GOSHAWK_MISSION_STATUS_FRAMES_REFUSED_AT = 28,
    GOSHAWK_MISSION_STATUS_PARAMETERS_CRC32_AT = 32,
    GOSHAWK_MISSION_STATUS_PATH_RATE_AT = 36,
    GOSHAWK_MISSION_STATUS_MISSION_STATE_AT = 40,
    GOSHAWK_MISSION_STATUS_REASON_AT = 41,
    GOSHAWK_MISSION_STATUS_OPERATOR_SYSTEM_AT = 42,
    GOSHAWK_MISSION_STATUS_OPERATOR_COMPONENT_AT = 43,
    GOSHAWK_MISSION_STATUS_MAP_HASH_AT = 44,
    GOSHAWK_MISSION_STATUS_VEHICLE_HASH_AT = 52,
    GOSHAWK_MISSION_STATUS_NAME_AT = 60,
};

static inline void goshawk_mission_status_encode(const goshawk_mission_status_msg *m, uint8_t payload[GOSHAWK_MISSION_STATUS_LENGTH])
{
    _Static_assert(offsetof(goshawk_mission_status_msg, name) == GOSHAWK_MISSION_STATUS_NAME_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_MISSION_STATUS_LENGTH);
}

static inline void goshawk_mission_status_decode(goshawk_mission_status_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_MISSION_STATUS_LENGTH ? length : GOSHAWK_MISSION_STATUS_LENGTH);
}

/* Take (or keep, or give back) control. The holder renews it; it ends 3 s after the last renewal. */
#define GOSHAWK_LEASE_REQUEST_ID 54030u
#define GOSHAWK_LEASE_REQUEST_LENGTH 39u
#define GOSHAWK_LEASE_REQUEST_CRC_EXTRA 167u
typedef struct {
    uint32_t nonce; /* Returned in the answer. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t action; /* 0 give back, 1 take if free or renew, 2 take over, 3 only ask and report. */
    uint32_t session; /* Drawn at random by every start of a station: the operator is known by it. 0: a standard station, known by its ids. */
    uint32_t line_bytes_per_s; /* What the line to this station was measured to carry; 0 no limit found. */
    char name[24]; /* Of the station, for people; when it takes control. */
} goshawk_lease_request_msg;
enum {
    GOSHAWK_LEASE_REQUEST_NONCE_AT = 0,
    GOSHAWK_LEASE_REQUEST_TARGET_SYSTEM_AT = 4,
    GOSHAWK_LEASE_REQUEST_TARGET_COMPONENT_AT = 5,
    GOSHAWK_LEASE_REQUEST_ACTION_AT = 6,
    GOSHAWK_LEASE_REQUEST_SESSION_AT = 7,
    GOSHAWK_LEASE_REQUEST_LINE_BYTES_PER_S_AT = 11,
    GOSHAWK_LEASE_REQUEST_NAME_AT = 15,
};

static inline void goshawk_lease_request_encode(const goshawk_lease_request_msg *m, uint8_t payload[GOSHAWK_LEASE_REQUEST_LENGTH])
{
    memcpy(payload + GOSHAWK_LEASE_REQUEST_NONCE_AT, &m->nonce, 4u);
    memcpy(payload + GOSHAWK_LEASE_REQUEST_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + GOSHAWK_LEASE_REQUEST_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + GOSHAWK_LEASE_REQUEST_ACTION_AT, &m->action, 1u);
    memcpy(payload + GOSHAWK_LEASE_REQUEST_SESSION_AT, &m->session, 4u);
    memcpy(payload + GOSHAWK_LEASE_REQUEST_LINE_BYTES_PER_S_AT, &m->line_bytes_per_s, 4u);
    memcpy(payload + GOSHAWK_LEASE_REQUEST_NAME_AT, m->name, 24u);
}

static inline void goshawk_lease_request_decode(goshawk_lease_request_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_LEASE_REQUEST_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_LEASE_REQUEST_LENGTH ? length : GOSHAWK_LEASE_REQUEST_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->nonce, whole + GOSHAWK_LEASE_REQUEST_NONCE_AT, 4u);
    memcpy(&m->target_system, whole + GOSHAWK_LEASE_REQUEST_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + GOSHAWK_LEASE_REQUEST_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->action, whole + GOSHAWK_LEASE_REQUEST_ACTION_AT, 1u);
    memcpy(&m->session, whole + GOSHAWK_LEASE_REQUEST_SESSION_AT, 4u);
    memcpy(&m->line_bytes_per_s, whole + GOSHAWK_LEASE_REQUEST_LINE_BYTES_PER_S_AT, 4u);
    memcpy(m->name, whole + GOSHAWK_LEASE_REQUEST_NAME_AT, 24u);
}

/* Answer to a request. */
#define GOSHAWK_LEASE_STATUS_ID 54031u
#define GOSHAWK_LEASE_STATUS_LENGTH 39u
#define GOSHAWK_LEASE_STATUS_CRC_EXTRA 34u
typedef struct {
    uint32_t nonce; /* Of the request. */
    uint32_t left_ms; /* Until it ends. */
    uint8_t operator_system; /* Holder; 0 nobody. */
    uint8_t operator_component; /* Holder. */
    uint32_t operator_session; /* Holder. */
    uint8_t operator_link; /* Link id of the holder's signatures; 0 unsigned. */
    char operator_name[24]; /* Holder; sent when somebody else asks. */
} goshawk_lease_status_msg;
enum {
    GOSHAWK_LEASE_STATUS_NONCE_AT = 0,
    GOSHAWK_LEASE_STATUS_LEFT_MS_AT = 4,
    GOSHAWK_LEASE_STATUS_OPERATOR_SYSTEM_AT = 8,
    GOSHAWK_LEASE_STATUS_OPERATOR_COMPONENT_AT = 9,
    GOSHAWK_LEASE_STATUS_OPERATOR_SESSION_AT = 10,
    GOSHAWK_LEASE_STATUS_OPERATOR_LINK_AT = 14,
    GOSHAWK_LEASE_STATUS_OPERATOR_NAME_AT = 15,
};

static inline void goshawk_lease_status_encode(const goshawk_lease_status_msg *m, uint8_t payload[GOSHAWK_LEASE_STATUS_LENGTH])
{
    memcpy(payload + GOSHAWK_LEASE_STATUS_NONCE_AT, &m->nonce, 4u);
    memcpy(payload + GOSHAWK_LEASE_STATUS_LEFT_MS_AT, &m->left_ms, 4u);
    memcpy(payload + GOSHAWK_LEASE_STATUS_OPERATOR_SYSTEM_AT, &m->operator_system, 1u);
    memcpy(payload + GOSHAWK_LEASE_STATUS_OPERATOR_COMPONENT_AT, &m->operator_component, 1u);
    memcpy(payload + GOSHAWK_LEASE_STATUS_OPERATOR_SESSION_AT, &m->operator_session, 4u);
    memcpy(payload + GOSHAWK_LEASE_STATUS_OPERATOR_LINK_AT, &m->operator_link, 1u);
    memcpy(payload + GOSHAWK_LEASE_STATUS_OPERATOR_NAME_AT, m->operator_name, 24u);
}

static inline void goshawk_lease_status_decode(goshawk_lease_status_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_LEASE_STATUS_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_LEASE_STATUS_LENGTH ? length : GOSHAWK_LEASE_STATUS_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->nonce, whole + GOSHAWK_LEASE_STATUS_NONCE_AT, 4u);
    memcpy(&m->left_ms, whole + GOSHAWK_LEASE_STATUS_LEFT_MS_AT, 4u);
    memcpy(&m->operator_system, whole + GOSHAWK_LEASE_STATUS_OPERATOR_SYSTEM_AT, 1u);
    memcpy(&m->operator_component, whole + GOSHAWK_LEASE_STATUS_OPERATOR_COMPONENT_AT, 1u);
    memcpy(&m->operator_session, whole + GOSHAWK_LEASE_STATUS_OPERATOR_SESSION_AT, 4u);
    memcpy(&m->operator_link, whole + GOSHAWK_LEASE_STATUS_OPERATOR_LINK_AT, 1u);
    memcpy(m->operator_name, whole + GOSHAWK_LEASE_STATUS_OPERATOR_NAME_AT, 24u);
}

/* Some values of a set that is to be applied as a whole; every value has to be sent. */
#define GOSHAWK_PARAMETERS_STAGE_ID 54040u
#define GOSHAWK_PARAMETERS_STAGE_LENGTH 203u
#define GOSHAWK_PARAMETERS_STAGE_CRC_EXTRA 78u
typedef struct {
    uint32_t transfer_id; /* New for every set; never 0. */
    float values[48]; /* In the order of the vehicle's table; behind its end ignored. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t group; /* Values 48 group to 48 group + 47. */
    uint32_t session; /* Of the sender, as in its request for control. */
} goshawk_parameters_stage_msg;
enum {
    GOSHAWK_PARAMETERS_STAGE_TRANSFER_ID_AT = 0,
    GOSHAWK_PARAMETERS_STAGE_VALUES_AT = 4,
    GOSHAWK_PARAMETERS_STAGE_TARGET_SYSTEM_AT = 196,
    GOSHAWK_PARAMETERS_STAGE_TARGET_COMPONENT_AT = 197,
    GOSHAWK_PARAMETERS_STAGE_GROUP_AT = 198,
    GOSHAWK_PARAMETERS_STAGE_SESSION_AT = 199,
};

static inline void goshawk_parameters_stage_encode(const goshawk_parameters_stage_msg *m, uint8_t payload[GOSHAWK_PARAMETERS_STAGE_LENGTH])
{
    memcpy(payload + GOSHAWK_PARAMETERS_STAGE_TRANSFER_ID_AT, &m->transfer_id, 4u);
    memcpy(payload + GOSHAWK_PARAMETERS_STAGE_VALUES_AT, m->values, 192u);
    memcpy(payload + GOSHAWK_PARAMETERS_STAGE_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + GOSHAWK_PARAMETERS_STAGE_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + GOSHAWK_PARAMETERS_STAGE_GROUP_AT, &m->group, 1u);
    memcpy(payload + GOSHAWK_PARAMETERS_STAGE_SESSION_AT, &m->session, 4u);
}

static inline void goshawk_parameters_stage_decode(goshawk_parameters_stage_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_PARAMETERS_STAGE_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_PARAMETERS_STAGE_LENGTH ? length : GOSHAWK_PARAMETERS_STAGE_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->transfer_id, whole + GOSHAWK_PARAMETERS_STAGE_TRANSFER_ID_AT, 4u);
    memcpy(m->values, whole + GOSHAWK_PARAMETERS_STAGE_VALUES_AT, 192u);
    memcpy(&m->target_system, whole + GOSHAWK_PARAMETERS_STAGE_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + GOSHAWK_PARAMETERS_STAGE_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->group, whole + GOSHAWK_PARAMETERS_STAGE_GROUP_AT, 1u);
    memcpy(&m->session, whole + GOSHAWK_PARAMETERS_STAGE_SESSION_AT, 4u);
}

/* Apply the staged set if it is whole, its CRC fits and the controller accepts it. */
#define GOSHAWK_PARAMETERS_COMMIT_ID 54041u
#define GOSHAWK_PARAMETERS_COMMIT_LENGTH 14u
#define GOSHAWK_PARAMETERS_COMMIT_CRC_EXTRA 168u
typedef struct {
    uint32_t transfer_id; /* Of the set. */
    uint32_t crc32; /* CRC-32 of all values, little-endian float32 in table order. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint32_t session; /* Of the sender, as in its request for control. */
} goshawk_parameters_commit_msg;
enum {
    GOSHAWK_PARAMETERS_COMMIT_TRANSFER_ID_AT = 0,
    GOSHAWK_PARAMETERS_COMMIT_CRC32_AT = 4,
    GOSHAWK_PARAMETERS_COMMIT_TARGET_SYSTEM_AT = 8,
    GOSHAWK_PARAMETERS_COMMIT_TARGET_COMPONENT_AT = 9,
    GOSHAWK_PARAMETERS_COMMIT_SESSION_AT = 10,
};

static inline void goshawk_parameters_commit_encode(const goshawk_parameters_commit_msg *m, uint8_t payload[GOSHAWK_PARAMETERS_COMMIT_LENGTH])
{
    memcpy(payload + GOSHAWK_PARAMETERS_COMMIT_TRANSFER_ID_AT, &m->transfer_id, 4u);
    memcpy(payload + GOSHAWK_PARAMETERS_COMMIT_CRC32_AT, &m->crc32, 4u);
    memcpy(payload + GOSHAWK_PARAMETERS_COMMIT_TARGET_SYSTEM_AT, &m->target_system, 1u);
    memcpy(payload + GOSHAWK_PARAMETERS_COMMIT_TARGET_COMPONENT_AT, &m->target_component, 1u);
    memcpy(payload + GOSHAWK_PARAMETERS_COMMIT_SESSION_AT, &m->session, 4u);
}

static inline void goshawk_parameters_commit_decode(goshawk_parameters_commit_msg *m, const uint8_t *payload, size_t length)
{
    uint8_t whole[GOSHAWK_PARAMETERS_COMMIT_LENGTH] = {0};
    memcpy(whole, payload, length < GOSHAWK_PARAMETERS_COMMIT_LENGTH ? length : GOSHAWK_PARAMETERS_COMMIT_LENGTH);
    memset(m, 0, sizeof *m);
    memcpy(&m->transfer_id, whole + GOSHAWK_PARAMETERS_COMMIT_TRANSFER_ID_AT, 4u);
    memcpy(&m->crc32, whole + GOSHAWK_PARAMETERS_COMMIT_CRC32_AT, 4u);
    memcpy(&m->target_system, whole + GOSHAWK_PARAMETERS_COMMIT_TARGET_SYSTEM_AT, 1u);
    memcpy(&m->target_component, whole + GOSHAWK_PARAMETERS_COMMIT_TARGET_COMPONENT_AT, 1u);
    memcpy(&m->session, whole + GOSHAWK_PARAMETERS_COMMIT_SESSION_AT, 4u);
}

/* Answer to a stage or a commit. */
#define GOSHAWK_PARAMETERS_RESULT_ID 54042u
#define GOSHAWK_PARAMETERS_RESULT_LENGTH 13u
#define GOSHAWK_PARAMETERS_RESULT_CRC_EXTRA 13u
typedef struct {
    uint32_t transfer_id; /* Of the set. */
    uint32_t active_crc32; /* Of the values now in force. */
    uint16_t index; /* Parameter that was refused. */
    uint8_t staged; /* Bit i: group i has arrived. */
    uint8_t committed; /* 1 when this answers a commit. */
    uint8_t reason; /* 0 done, else tc_reason or GOSHAWK_LINK_REASON. */
} goshawk_parameters_result_msg;
enum {
    GOSHAWK_PARAMETERS_RESULT_TRANSFER_ID_AT = 0,
    GOSHAWK_PARAMETERS_RESULT_ACTIVE_CRC32_AT = 4,
    GOSHAWK_PARAMETERS_RESULT_INDEX_AT = 8,
    GOSHAWK_PARAMETERS_RESULT_STAGED_AT = 10,
    GOSHAWK_PARAMETERS_RESULT_COMMITTED_AT = 11,
    GOSHAWK_PARAMETERS_RESULT_REASON_AT = 12,
};

static inline void goshawk_parameters_result_encode(const goshawk_parameters_result_msg *m, uint8_t payload[GOSHAWK_PARAMETERS_RESULT_LENGTH])
{
    _Static_assert(offsetof(goshawk_parameters_result_msg, reason) == GOSHAWK_PARAMETERS_RESULT_REASON_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_PARAMETERS_RESULT_LENGTH);
}

static inline void goshawk_parameters_result_decode(goshawk_parameters_result_msg *m, const uint8_t *payload, size_t length)
{
    memset(m, 0, sizeof *m);
    memcpy(m, payload, length < GOSHAWK_PARAMETERS_RESULT_LENGTH ? length : GOSHAWK_PARAMETERS_RESULT_LENGTH);
}

#define GOSHAWK_NO_TARGET 255u

/* Which row of the table below a message is. */
enum {
    HEARTBEAT_ROW,
    SYS_STATUS_ROW,
    PING_ROW,
    SET_MODE_ROW,
    PARAM_REQUEST_READ_ROW,
    PARAM_REQUEST_LIST_ROW,
    PARAM_VALUE_ROW,
    PARAM_SET_ROW,
    ATTITUDE_QUATERNION_ROW,
    LOCAL_POSITION_NED_ROW,
    MISSION_REQUEST_LIST_ROW,
    MISSION_COUNT_ROW,
    MISSION_ACK_ROW,
    COMMAND_INT_ROW,
    COMMAND_LONG_ROW,
    COMMAND_ACK_ROW,
    TIMESYNC_ROW,
    ALTITUDE_ROW,
    BATTERY_STATUS_ROW,
    AUTOPILOT_VERSION_ROW,
    HOME_POSITION_ROW,
    EXTENDED_SYS_STATE_ROW,
    STATUSTEXT_ROW,
    ESC_STATUS_ROW,
    PROTOCOL_VERSION_ROW,
    ODOMETRY_ROW,
    GOSHAWK_STATE_ROW,
    GOSHAWK_LOG_REQUEST_ROW,
    GOSHAWK_LOG_INFO_ROW,
    GOSHAWK_LOG_RECORD_ROW,
    GOSHAWK_TRAJECTORY_BEGIN_ROW,
    GOSHAWK_TRAJECTORY_SEGMENT_ROW,
    GOSHAWK_TRAJECTORY_STATUS_ROW,
    GOSHAWK_TRAJECTORY_COMMIT_ROW,
    GOSHAWK_TRAJECTORY_RESULT_ROW,
    GOSHAWK_TRAJECTORY_READ_ROW,
    GOSHAWK_TRAJECTORY_SAMPLES_ROW,
    GOSHAWK_MISSION_COMMAND_ROW,
    GOSHAWK_MISSION_RESULT_ROW,
    GOSHAWK_MISSION_STATUS_ROW,
    GOSHAWK_LEASE_REQUEST_ROW,
    GOSHAWK_LEASE_STATUS_ROW,
    GOSHAWK_PARAMETERS_STAGE_ROW,
    GOSHAWK_PARAMETERS_COMMIT_ROW,
    GOSHAWK_PARAMETERS_RESULT_ROW,
    GOSHAWK_DIALECT_ROWS
};

typedef struct {
    uint16_t id;
    uint8_t crc_extra;
    uint8_t length; /* of the whole payload, before zeros at its end are cut off */
    uint8_t target;  /* where target_system lies in the payload (target_component follows), or GOSHAWK_NO_TARGET */
    uint8_t session; /* where the sender's session lies, or GOSHAWK_NO_TARGET */
} goshawk_dialect_row;

/* All messages. For one file of a program: every file that calls this has the table. */
static inline const goshawk_dialect_row *goshawk_dialect(void)
{
    static const goshawk_dialect_row rows[GOSHAWK_DIALECT_ROWS] = {
    {HEARTBEAT_ID, HEARTBEAT_CRC_EXTRA, HEARTBEAT_LENGTH, 255u, 255u},
    {SYS_STATUS_ID, SYS_STATUS_CRC_EXTRA, SYS_STATUS_LENGTH, 255u, 255u},
    {PING_ID, PING_CRC_EXTRA, PING_LENGTH, 12u, 255u},
    {SET_MODE_ID, SET_MODE_CRC_EXTRA, SET_MODE_LENGTH, 4u, 255u},
    {PARAM_REQUEST_READ_ID, PARAM_REQUEST_READ_CRC_EXTRA, PARAM_REQUEST_READ_LENGTH, 2u, 255u},
    {PARAM_REQUEST_LIST_ID, PARAM_REQUEST_LIST_CRC_EXTRA, PARAM_REQUEST_LIST_LENGTH, 0u, 255u},
    {PARAM_VALUE_ID, PARAM_VALUE_CRC_EXTRA, PARAM_VALUE_LENGTH, 255u, 255u},
    {PARAM_SET_ID, PARAM_SET_CRC_EXTRA, PARAM_SET_LENGTH, 4u, 255u},
    {ATTITUDE_QUATERNION_ID, ATTITUDE_QUATERNION_CRC_EXTRA, ATTITUDE_QUATERNION_LENGTH, 255u, 255u},
    {LOCAL_POSITION_NED_ID, LOCAL_POSITION_NED_CRC_EXTRA, LOCAL_POSITION_NED_LENGTH, 255u, 255u},
    {MISSION_REQUEST_LIST_ID, MISSION_REQUEST_LIST_CRC_EXTRA, MISSION_REQUEST_LIST_LENGTH, 0u, 255u},
    {MISSION_COUNT_ID, MISSION_COUNT_CRC_EXTRA, MISSION_COUNT_LENGTH, 2u, 255u},
    {MISSION_ACK_ID, MISSION_ACK_CRC_EXTRA, MISSION_ACK_LENGTH, 0u, 255u},
    {COMMAND_INT_ID, COMMAND_INT_CRC_EXTRA, COMMAND_INT_LENGTH, 30u, 255u},
    {COMMAND_LONG_ID, COMMAND_LONG_CRC_EXTRA, COMMAND_LONG_LENGTH, 30u, 255u},
    {COMMAND_ACK_ID, COMMAND_ACK_CRC_EXTRA, COMMAND_ACK_LENGTH, 8u, 255u},
    {TIMESYNC_ID, TIMESYNC_CRC_EXTRA, TIMESYNC_LENGTH, 16u, 255u},
    {ALTITUDE_ID, ALTITUDE_CRC_EXTRA, ALTITUDE_LENGTH, 255u, 255u},
    {BATTERY_STATUS_ID, BATTERY_STATUS_CRC_EXTRA, BATTERY_STATUS_LENGTH, 255u, 255u},
    {AUTOPILOT_VERSION_ID, AUTOPILOT_VERSION_CRC_EXTRA, AUTOPILOT_VERSION_LENGTH, 255u, 255u},
    {HOME_POSITION_ID, HOME_POSITION_CRC_EXTRA, HOME_POSITION_LENGTH, 255u, 255u},
    {EXTENDED_SYS_STATE_ID, EXTENDED_SYS_STATE_CRC_EXTRA, EXTENDED_SYS_STATE_LENGTH, 255u, 255u},
    {STATUSTEXT_ID, STATUSTEXT_CRC_EXTRA, STATUSTEXT_LENGTH, 255u, 255u},
    {ESC_STATUS_ID, ESC_STATUS_CRC_EXTRA, ESC_STATUS_LENGTH, 255u, 255u},
    {PROTOCOL_VERSION_ID, PROTOCOL_VERSION_CRC_EXTRA, PROTOCOL_VERSION_LENGTH, 255u, 255u},
    {ODOMETRY_ID, ODOMETRY_CRC_EXTRA, ODOMETRY_LENGTH, 255u, 255u},
    {GOSHAWK_STATE_ID, GOSHAWK_STATE_CRC_EXTRA, GOSHAWK_STATE_LENGTH, 255u, 255u},
    {GOSHAWK_LOG_REQUEST_ID, GOSHAWK_LOG_REQUEST_CRC_EXTRA, GOSHAWK_LOG_REQUEST_LENGTH, 4u, 255u},
    {GOSHAWK_LOG_INFO_ID, GOSHAWK_LOG_INFO_CRC_EXTRA, GOSHAWK_LOG_INFO_LENGTH, 255u, 255u},
    {GOSHAWK_LOG_RECORD_ID, GOSHAWK_LOG_RECORD_CRC_EXTRA, GOSHAWK_LOG_RECORD_LENGTH, 255u, 255u},
    {GOSHAWK_TRAJECTORY_BEGIN_ID, GOSHAWK_TRAJECTORY_BEGIN_CRC_EXTRA, GOSHAWK_TRAJECTORY_BEGIN_LENGTH, 18u, 63u},
    {GOSHAWK_TRAJECTORY_SEGMENT_ID, GOSHAWK_TRAJECTORY_SEGMENT_CRC_EXTRA, GOSHAWK_TRAJECTORY_SEGMENT_LENGTH, 10u, 255u},
    {GOSHAWK_TRAJECTORY_STATUS_ID, GOSHAWK_TRAJECTORY_STATUS_CRC_EXTRA, GOSHAWK_TRAJECTORY_STATUS_LENGTH, 255u, 255u},
    {GOSHAWK_TRAJECTORY_COMMIT_ID, GOSHAWK_TRAJECTORY_COMMIT_CRC_EXTRA, GOSHAWK_TRAJECTORY_COMMIT_LENGTH, 12u, 14u},
    {GOSHAWK_TRAJECTORY_RESULT_ID, GOSHAWK_TRAJECTORY_RESULT_CRC_EXTRA, GOSHAWK_TRAJECTORY_RESULT_LENGTH, 255u, 255u},
    {GOSHAWK_TRAJECTORY_READ_ID, GOSHAWK_TRAJECTORY_READ_CRC_EXTRA, GOSHAWK_TRAJECTORY_READ_LENGTH, 6u, 255u},
    {GOSHAWK_TRAJECTORY_SAMPLES_ID, GOSHAWK_TRAJECTORY_SAMPLES_CRC_EXTRA, GOSHAWK_TRAJECTORY_SAMPLES_LENGTH, 164u, 255u},
    {GOSHAWK_MISSION_COMMAND_ID, GOSHAWK_MISSION_COMMAND_CRC_EXTRA, GOSHAWK_MISSION_COMMAND_LENGTH, 16u, 19u},
    {GOSHAWK_MISSION_RESULT_ID, GOSHAWK_MISSION_RESULT_CRC_EXTRA, GOSHAWK_MISSION_RESULT_LENGTH, 255u, 255u},
    {GOSHAWK_MISSION_STATUS_ID, GOSHAWK_MISSION_STATUS_CRC_EXTRA, GOSHAWK_MISSION_STATUS_LENGTH, 255u, 255u},
    {GOSHAWK_LEASE_REQUEST_ID, GOSHAWK_LEASE_REQUEST_CRC_EXTRA, GOSHAWK_LEASE_REQUEST_LENGTH, 4u, 7u},
    {GOSHAWK_LEASE_STATUS_ID, GOSHAWK_LEASE_STATUS_CRC_EXTRA, GOSHAWK_LEASE_STATUS_LENGTH, 255u, 255u},
    {GOSHAWK_PARAMETERS_STAGE_ID, GOSHAWK_PARAMETERS_STAGE_CRC_EXTRA, GOSHAWK_PARAMETERS_STAGE_LENGTH, 196u, 199u},
    {GOSHAWK_PARAMETERS_COMMIT_ID, GOSHAWK_PARAMETERS_COMMIT_CRC_EXTRA, GOSHAWK_PARAMETERS_COMMIT_LENGTH, 8u, 10u},
    {GOSHAWK_PARAMETERS_RESULT_ID, GOSHAWK_PARAMETERS_RESULT_CRC_EXTRA, GOSHAWK_PARAMETERS_RESULT_LENGTH, 255u, 255u},
    };
    return rows;
}

#endif
