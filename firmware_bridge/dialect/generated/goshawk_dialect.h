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
    uint32_t custom_mode; /* Mission state of the controller. */
    uint8_t type; /* MAV_TYPE: 2 quadrotor, 6 ground station. */
    uint8_t autopilot; /* MAV_AUTOPILOT: 0 generic, 8 none (a ground station). */
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
    uint8_t confirmation; /* Repeat count. */
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

/* Answer to COMMAND_LONG. */
#define COMMAND_ACK_ID 77u
#define COMMAND_ACK_LENGTH 10u
#define COMMAND_ACK_CRC_EXTRA 143u
typedef struct {
    uint16_t command; /* MAV_CMD. */
    uint8_t result; /* MAV_RESULT: 0 accepted, 3 unsupported. */
    uint8_t progress; /* Unused. */
    int32_t result_param2; /* Unused. */
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
    memcpy(payload + 0, &m->current_consumed, 4u);
    memcpy(payload + 4, &m->energy_consumed, 4u);
    memcpy(payload + 8, &m->temperature, 2u);
    memcpy(payload + 10, m->voltages, 20u);
    memcpy(payload + 30, &m->current_battery, 2u);
    memcpy(payload + 32, &m->id, 1u);
    memcpy(payload + 33, &m->battery_function, 1u);
    memcpy(payload + 34, &m->type, 1u);
    memcpy(payload + 35, &m->battery_remaining, 1u);
    memcpy(payload + 36, &m->time_remaining, 4u);
    memcpy(payload + 40, &m->charge_state, 1u);
    memcpy(payload + 41, m->voltages_ext, 8u);
    memcpy(payload + 49, &m->mode, 1u);
    memcpy(payload + 50, &m->fault_bitmask, 4u);
}

/* Who the vehicle is. */
#define AUTOPILOT_VERSION_ID 148u
#define AUTOPILOT_VERSION_LENGTH 78u
#define AUTOPILOT_VERSION_CRC_EXTRA 178u
typedef struct {
    uint64_t capabilities; /* MAV_PROTOCOL_CAPABILITY: 8192, MAVLink 2. */
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
    memcpy(payload + 0, &m->latitude, 4u);
    memcpy(payload + 4, &m->longitude, 4u);
    memcpy(payload + 8, &m->altitude, 4u);
    memcpy(payload + 12, &m->x, 4u);
    memcpy(payload + 16, &m->y, 4u);
    memcpy(payload + 20, &m->z, 4u);
    memcpy(payload + 24, m->q, 16u);
    memcpy(payload + 40, &m->approach_x, 4u);
    memcpy(payload + 44, &m->approach_y, 4u);
    memcpy(payload + 48, &m->approach_z, 4u);
    memcpy(payload + 52, &m->time_usec, 8u);
}

/* A sentence for the pilot. */
#define STATUSTEXT_ID 253u
#define STATUSTEXT_LENGTH 54u
#define STATUSTEXT_CRC_EXTRA 83u
typedef struct {
    uint8_t severity; /* MAV_SEVERITY: 3 error, 4 warning, 6 info. */
    char text[50]; /* Zero-terminated unless 50 long. */
    uint16_t id; /* 0: the text is whole. */
    uint8_t chunk_seq; /* 0. */
} statustext_msg;
enum {
    STATUSTEXT_SEVERITY_AT = 0,
    STATUSTEXT_TEXT_AT = 1,
    STATUSTEXT_ID_AT = 51,
    STATUSTEXT_CHUNK_SEQ_AT = 53,
};

static inline void statustext_encode(const statustext_msg *m, uint8_t payload[STATUSTEXT_LENGTH])
{
    memcpy(payload + 0, &m->severity, 1u);
    memcpy(payload + 1, m->text, 50u);
    memcpy(payload + 51, &m->id, 2u);
    memcpy(payload + 53, &m->chunk_seq, 1u);
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

/* All a flight log needs of one instant; also the record of the on-board log. */
#define GOSHAWK_STATE_ID 54000u
#define GOSHAWK_STATE_LENGTH 156u
#define GOSHAWK_STATE_CRC_EXTRA 172u
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
    uint16_t sequence; /* Counts these messages, so that a receiver knows what it missed. */
    uint8_t mission_state; /* State of the mission. */
    uint8_t saturation; /* Bits of the mixer's saturation report. */
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
    GOSHAWK_STATE_SEQUENCE_AT = 152,
    GOSHAWK_STATE_MISSION_STATE_AT = 154,
    GOSHAWK_STATE_SATURATION_AT = 155,
};

static inline void goshawk_state_encode(const goshawk_state_msg *m, uint8_t payload[GOSHAWK_STATE_LENGTH])
{
    _Static_assert(offsetof(goshawk_state_msg, saturation) == GOSHAWK_STATE_SATURATION_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_STATE_LENGTH);
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

/* One record. */
#define GOSHAWK_LOG_RECORD_ID 54003u
#define GOSHAWK_LOG_RECORD_LENGTH 164u
#define GOSHAWK_LOG_RECORD_CRC_EXTRA 114u
typedef struct {
    uint32_t log_id; /* Of GOSHAWK_LOG_INFO. */
    uint32_t index; /* Which record. */
    uint8_t record[156]; /* Payload of a GOSHAWK_STATE. */
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

/* Opens (or re-opens) a transfer into the staging slot; also the header sent on read-back. */
#define GOSHAWK_TRAJECTORY_BEGIN_ID 54010u
#define GOSHAWK_TRAJECTORY_BEGIN_LENGTH 59u
#define GOSHAWK_TRAJECTORY_BEGIN_CRC_EXTRA 47u
typedef struct {
    uint32_t transfer_id; /* Chosen by the sender, new for every upload; never 0. */
    uint32_t trajectory_id; /* Identity of the trajectory. */
    uint32_t crc32; /* tc_trajectory_crc32 (trajectory.h). */
    uint16_t segments; /* How many. */
    uint8_t target_system; /* Receiver. */
    uint8_t target_component; /* Receiver. */
    uint8_t coefficient_count; /* Per axis, at most 12; the others are zero. */
    uint8_t link_loss_policy; /* tc_link_loss_policy: 0 finish then hold, 1 hold, 2 land. */
    uint8_t samples; /* How many check samples come with it, at most 8. */
    uint8_t map_hash[8]; /* First bytes of the map's hash. */
    uint8_t vehicle_hash[8]; /* First bytes of the vehicle's hash. */
    char name[24]; /* Zero-padded. */
} goshawk_trajectory_begin_msg;
enum {
    GOSHAWK_TRAJECTORY_BEGIN_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_BEGIN_TRAJECTORY_ID_AT = 4,
    GOSHAWK_TRAJECTORY_BEGIN_CRC32_AT = 8,
    GOSHAWK_TRAJECTORY_BEGIN_SEGMENTS_AT = 12,
    GOSHAWK_TRAJECTORY_BEGIN_TARGET_SYSTEM_AT = 14,
    GOSHAWK_TRAJECTORY_BEGIN_TARGET_COMPONENT_AT = 15,
    GOSHAWK_TRAJECTORY_BEGIN_COEFFICIENT_COUNT_AT = 16,
    GOSHAWK_TRAJECTORY_BEGIN_LINK_LOSS_POLICY_AT = 17,
    GOSHAWK_TRAJECTORY_BEGIN_SAMPLES_AT = 18,
    GOSHAWK_TRAJECTORY_BEGIN_MAP_HASH_AT = 19,
    GOSHAWK_TRAJECTORY_BEGIN_VEHICLE_HASH_AT = 27,
    GOSHAWK_TRAJECTORY_BEGIN_NAME_AT = 35,
};

static inline void goshawk_trajectory_begin_encode(const goshawk_trajectory_begin_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_BEGIN_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_begin_msg, name) == GOSHAWK_TRAJECTORY_BEGIN_NAME_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_BEGIN_LENGTH);
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

/* Check the staged trajectory and make it the active one. */
#define GOSHAWK_TRAJECTORY_COMMIT_ID 54013u
#define GOSHAWK_TRAJECTORY_COMMIT_LENGTH 14u
#define GOSHAWK_TRAJECTORY_COMMIT_CRC_EXTRA 180u
typedef struct {
    uint32_t transfer_id; /* Of the transfer. */
    uint32_t trajectory_id; /* As in the beginning. */
    uint32_t crc32; /* As in the beginning. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
} goshawk_trajectory_commit_msg;
enum {
    GOSHAWK_TRAJECTORY_COMMIT_TRANSFER_ID_AT = 0,
    GOSHAWK_TRAJECTORY_COMMIT_TRAJECTORY_ID_AT = 4,
    GOSHAWK_TRAJECTORY_COMMIT_CRC32_AT = 8,
    GOSHAWK_TRAJECTORY_COMMIT_TARGET_SYSTEM_AT = 12,
    GOSHAWK_TRAJECTORY_COMMIT_TARGET_COMPONENT_AT = 13,
};

static inline void goshawk_trajectory_commit_encode(const goshawk_trajectory_commit_msg *m, uint8_t payload[GOSHAWK_TRAJECTORY_COMMIT_LENGTH])
{
    _Static_assert(offsetof(goshawk_trajectory_commit_msg, target_component) == GOSHAWK_TRAJECTORY_COMMIT_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_TRAJECTORY_COMMIT_LENGTH);
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

/* An order to the mission. A repeated request_id is answered again and not carried out again. */
#define GOSHAWK_MISSION_COMMAND_ID 54020u
#define GOSHAWK_MISSION_COMMAND_LENGTH 19u
#define GOSHAWK_MISSION_COMMAND_CRC_EXTRA 90u
typedef struct {
    uint32_t request_id; /* New for every order; never 0. */
    uint32_t trajectory_id; /* For START. */
    uint32_t crc32; /* For START. */
    float value; /* See GOSHAWK_COMMAND. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t command; /* GOSHAWK_COMMAND. */
} goshawk_mission_command_msg;
enum {
    GOSHAWK_MISSION_COMMAND_REQUEST_ID_AT = 0,
    GOSHAWK_MISSION_COMMAND_TRAJECTORY_ID_AT = 4,
    GOSHAWK_MISSION_COMMAND_CRC32_AT = 8,
    GOSHAWK_MISSION_COMMAND_VALUE_AT = 12,
    GOSHAWK_MISSION_COMMAND_TARGET_SYSTEM_AT = 16,
    GOSHAWK_MISSION_COMMAND_TARGET_COMPONENT_AT = 17,
    GOSHAWK_MISSION_COMMAND_COMMAND_AT = 18,
};

static inline void goshawk_mission_command_encode(const goshawk_mission_command_msg *m, uint8_t payload[GOSHAWK_MISSION_COMMAND_LENGTH])
{
    _Static_assert(offsetof(goshawk_mission_command_msg, command) == GOSHAWK_MISSION_COMMAND_COMMAND_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_MISSION_COMMAND_LENGTH);
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
    uint32_t frames_refused; /* Since the start: unsigned, wrongly signed, replayed, damaged, or from a station not in control. */
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

/* Take (or keep, or give back) control. The holder renews it; it ends 3 s after the last renewal. */
#define GOSHAWK_LEASE_REQUEST_ID 54030u
#define GOSHAWK_LEASE_REQUEST_LENGTH 7u
#define GOSHAWK_LEASE_REQUEST_CRC_EXTRA 167u
typedef struct {
    uint32_t nonce; /* Returned in the answer. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t action; /* 0 give back, 1 take if free or renew, 2 take over. */
} goshawk_lease_request_msg;
enum {
    GOSHAWK_LEASE_REQUEST_NONCE_AT = 0,
    GOSHAWK_LEASE_REQUEST_TARGET_SYSTEM_AT = 4,
    GOSHAWK_LEASE_REQUEST_TARGET_COMPONENT_AT = 5,
    GOSHAWK_LEASE_REQUEST_ACTION_AT = 6,
};

static inline void goshawk_lease_request_encode(const goshawk_lease_request_msg *m, uint8_t payload[GOSHAWK_LEASE_REQUEST_LENGTH])
{
    _Static_assert(offsetof(goshawk_lease_request_msg, action) == GOSHAWK_LEASE_REQUEST_ACTION_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_LEASE_REQUEST_LENGTH);
}

/* Answer to a request. */
#define GOSHAWK_LEASE_STATUS_ID 54031u
#define GOSHAWK_LEASE_STATUS_LENGTH 10u
#define GOSHAWK_LEASE_STATUS_CRC_EXTRA 34u
typedef struct {
    uint32_t nonce; /* Of the request. */
    uint32_t left_ms; /* Until it ends. */
    uint8_t operator_system; /* Holder; 0 nobody. */
    uint8_t operator_component; /* Holder. */
} goshawk_lease_status_msg;
enum {
    GOSHAWK_LEASE_STATUS_NONCE_AT = 0,
    GOSHAWK_LEASE_STATUS_LEFT_MS_AT = 4,
    GOSHAWK_LEASE_STATUS_OPERATOR_SYSTEM_AT = 8,
    GOSHAWK_LEASE_STATUS_OPERATOR_COMPONENT_AT = 9,
};

static inline void goshawk_lease_status_encode(const goshawk_lease_status_msg *m, uint8_t payload[GOSHAWK_LEASE_STATUS_LENGTH])
{
    _Static_assert(offsetof(goshawk_lease_status_msg, operator_component) == GOSHAWK_LEASE_STATUS_OPERATOR_COMPONENT_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_LEASE_STATUS_LENGTH);
}

/* Some values of a set that is to be applied as a whole; every value has to be sent. */
#define GOSHAWK_PARAMETERS_STAGE_ID 54040u
#define GOSHAWK_PARAMETERS_STAGE_LENGTH 199u
#define GOSHAWK_PARAMETERS_STAGE_CRC_EXTRA 78u
typedef struct {
    uint32_t transfer_id; /* New for every set; never 0. */
    float values[48]; /* In the order of the vehicle's table; behind its end ignored. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
    uint8_t group; /* Values 48 group to 48 group + 47. */
} goshawk_parameters_stage_msg;
enum {
    GOSHAWK_PARAMETERS_STAGE_TRANSFER_ID_AT = 0,
    GOSHAWK_PARAMETERS_STAGE_VALUES_AT = 4,
    GOSHAWK_PARAMETERS_STAGE_TARGET_SYSTEM_AT = 196,
    GOSHAWK_PARAMETERS_STAGE_TARGET_COMPONENT_AT = 197,
    GOSHAWK_PARAMETERS_STAGE_GROUP_AT = 198,
};

static inline void goshawk_parameters_stage_encode(const goshawk_parameters_stage_msg *m, uint8_t payload[GOSHAWK_PARAMETERS_STAGE_LENGTH])
{
    _Static_assert(offsetof(goshawk_parameters_stage_msg, group) == GOSHAWK_PARAMETERS_STAGE_GROUP_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_PARAMETERS_STAGE_LENGTH);
}

/* Apply the staged set if it is whole, its CRC fits and the controller accepts it. */
#define GOSHAWK_PARAMETERS_COMMIT_ID 54041u
#define GOSHAWK_PARAMETERS_COMMIT_LENGTH 10u
#define GOSHAWK_PARAMETERS_COMMIT_CRC_EXTRA 168u
typedef struct {
    uint32_t transfer_id; /* Of the set. */
    uint32_t crc32; /* CRC-32 of all values, little-endian float32 in table order. */
    uint8_t target_system; /* Vehicle. */
    uint8_t target_component; /* Vehicle. */
} goshawk_parameters_commit_msg;
enum {
    GOSHAWK_PARAMETERS_COMMIT_TRANSFER_ID_AT = 0,
    GOSHAWK_PARAMETERS_COMMIT_CRC32_AT = 4,
    GOSHAWK_PARAMETERS_COMMIT_TARGET_SYSTEM_AT = 8,
    GOSHAWK_PARAMETERS_COMMIT_TARGET_COMPONENT_AT = 9,
};

static inline void goshawk_parameters_commit_encode(const goshawk_parameters_commit_msg *m, uint8_t payload[GOSHAWK_PARAMETERS_COMMIT_LENGTH])
{
    _Static_assert(offsetof(goshawk_parameters_commit_msg, target_component) == GOSHAWK_PARAMETERS_COMMIT_TARGET_COMPONENT_AT, "no gaps");
    memcpy(payload, m, GOSHAWK_PARAMETERS_COMMIT_LENGTH);
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

#define GOSHAWK_NO_TARGET 255u

/* Which row of the table below a message is. */
enum {
    HEARTBEAT_ROW,
    PARAM_REQUEST_READ_ROW,
    PARAM_REQUEST_LIST_ROW,
    PARAM_VALUE_ROW,
    ATTITUDE_QUATERNION_ROW,
    LOCAL_POSITION_NED_ROW,
    COMMAND_LONG_ROW,
    COMMAND_ACK_ROW,
    TIMESYNC_ROW,
    BATTERY_STATUS_ROW,
    AUTOPILOT_VERSION_ROW,
    HOME_POSITION_ROW,
    STATUSTEXT_ROW,
    ESC_STATUS_ROW,
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
    uint8_t target; /* where target_system lies in the payload (target_component follows), or GOSHAWK_NO_TARGET */
} goshawk_dialect_row;

/* All messages. For one file of a program: every file that calls this has the table. */
static inline const goshawk_dialect_row *goshawk_dialect(void)
{
    static const goshawk_dialect_row rows[GOSHAWK_DIALECT_ROWS] = {
    {HEARTBEAT_ID, HEARTBEAT_CRC_EXTRA, 255u},
    {PARAM_REQUEST_READ_ID, PARAM_REQUEST_READ_CRC_EXTRA, 2u},
    {PARAM_REQUEST_LIST_ID, PARAM_REQUEST_LIST_CRC_EXTRA, 0u},
    {PARAM_VALUE_ID, PARAM_VALUE_CRC_EXTRA, 255u},
    {ATTITUDE_QUATERNION_ID, ATTITUDE_QUATERNION_CRC_EXTRA, 255u},
    {LOCAL_POSITION_NED_ID, LOCAL_POSITION_NED_CRC_EXTRA, 255u},
    {COMMAND_LONG_ID, COMMAND_LONG_CRC_EXTRA, 30u},
    {COMMAND_ACK_ID, COMMAND_ACK_CRC_EXTRA, 8u},
    {TIMESYNC_ID, TIMESYNC_CRC_EXTRA, 16u},
    {BATTERY_STATUS_ID, BATTERY_STATUS_CRC_EXTRA, 255u},
    {AUTOPILOT_VERSION_ID, AUTOPILOT_VERSION_CRC_EXTRA, 255u},
    {HOME_POSITION_ID, HOME_POSITION_CRC_EXTRA, 255u},
    {STATUSTEXT_ID, STATUSTEXT_CRC_EXTRA, 255u},
    {ESC_STATUS_ID, ESC_STATUS_CRC_EXTRA, 255u},
    {ODOMETRY_ID, ODOMETRY_CRC_EXTRA, 255u},
    {GOSHAWK_STATE_ID, GOSHAWK_STATE_CRC_EXTRA, 255u},
    {GOSHAWK_LOG_REQUEST_ID, GOSHAWK_LOG_REQUEST_CRC_EXTRA, 4u},
    {GOSHAWK_LOG_INFO_ID, GOSHAWK_LOG_INFO_CRC_EXTRA, 255u},
    {GOSHAWK_LOG_RECORD_ID, GOSHAWK_LOG_RECORD_CRC_EXTRA, 255u},
    {GOSHAWK_TRAJECTORY_BEGIN_ID, GOSHAWK_TRAJECTORY_BEGIN_CRC_EXTRA, 14u},
    {GOSHAWK_TRAJECTORY_SEGMENT_ID, GOSHAWK_TRAJECTORY_SEGMENT_CRC_EXTRA, 10u},
    {GOSHAWK_TRAJECTORY_STATUS_ID, GOSHAWK_TRAJECTORY_STATUS_CRC_EXTRA, 255u},
    {GOSHAWK_TRAJECTORY_COMMIT_ID, GOSHAWK_TRAJECTORY_COMMIT_CRC_EXTRA, 12u},
    {GOSHAWK_TRAJECTORY_RESULT_ID, GOSHAWK_TRAJECTORY_RESULT_CRC_EXTRA, 255u},
    {GOSHAWK_TRAJECTORY_READ_ID, GOSHAWK_TRAJECTORY_READ_CRC_EXTRA, 6u},
    {GOSHAWK_TRAJECTORY_SAMPLES_ID, GOSHAWK_TRAJECTORY_SAMPLES_CRC_EXTRA, 164u},
    {GOSHAWK_MISSION_COMMAND_ID, GOSHAWK_MISSION_COMMAND_CRC_EXTRA, 16u},
    {GOSHAWK_MISSION_RESULT_ID, GOSHAWK_MISSION_RESULT_CRC_EXTRA, 255u},
    {GOSHAWK_MISSION_STATUS_ID, GOSHAWK_MISSION_STATUS_CRC_EXTRA, 255u},
    {GOSHAWK_LEASE_REQUEST_ID, GOSHAWK_LEASE_REQUEST_CRC_EXTRA, 4u},
    {GOSHAWK_LEASE_STATUS_ID, GOSHAWK_LEASE_STATUS_CRC_EXTRA, 255u},
    {GOSHAWK_PARAMETERS_STAGE_ID, GOSHAWK_PARAMETERS_STAGE_CRC_EXTRA, 196u},
    {GOSHAWK_PARAMETERS_COMMIT_ID, GOSHAWK_PARAMETERS_COMMIT_CRC_EXTRA, 8u},
    {GOSHAWK_PARAMETERS_RESULT_ID, GOSHAWK_PARAMETERS_RESULT_CRC_EXTRA, 255u},
    };
    return rows;
}

#endif
