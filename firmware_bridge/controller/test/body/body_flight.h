/* One flight, start to end: the real controller library round the simulated body. Plain structs of doubles and 32-bit
   integers, so that Python's ctypes can fill them (tests/firmware_bridge/failsafe/harness.py). SI units, radians. */
#ifndef BODY_FLIGHT_H
#define BODY_FLIGHT_H

#include "body_sensors.h"

#define BODY_MOST_FAULTS 8
#define BODY_MOST_ORDERS 16
#define BODY_MOST_VALUES 24
#define BODY_MOST_CHANGES 48

/* Faults and orders are counted from when a mission state was first entered, or from the start of the flight. */
#define BODY_FROM_START 100

typedef enum {
    BODY_POSITION_LOST = 0, /* value[0]: body_loss */
    BODY_ATTITUDE_LOST = 1, /* value[0]: body_loss; the gyro goes on */
    BODY_ALL_LOST = 2,      /* value[0]: body_loss */
    BODY_JUMP = 3,          /* value[0..2]: metres, value[3]: yaw; the estimator does not know */
    BODY_RELOCALIZED = 4,   /* the same, counted and told */
    BODY_RESET_MISSED = 5,  /* the same, counter + 2 */
    BODY_DRIFT = 6,         /* value[0..2]: m/s */
    BODY_LARGE_STD = 7,     /* value[0]: position, value[1]: velocity */
    BODY_CLOCK_STEP = 8,    /* value[0]: seconds; stays */
    BODY_CLOCK_JITTER = 9,  /* value[0]: seconds, uniform in +- */
    BODY_CLOCK_STUCK = 10,  /* the clock reads the same at every tick */
    BODY_STAMP_OFFSET = 11, /* value[0]: seconds by which the pose's stamps differ */
    BODY_ROTOR_HEALTH = 12, /* value[0]: rotor, value[1]: health, 0 = dead */
    BODY_GUST = 13,         /* value[0..2]: peak, m/s; (1 - cos) over the duration */
    BODY_LINK_LOST = 14,
    BODY_BATTERY = 15,   /* value[0]: volts */
    BODY_PARAMETER = 16, /* value[0]: index, value[1]: value */
    BODY_FLOOR = 17,     /* value[0]: new height of the floor; it rises to the feet at most */
    BODY_NO_SPECIFIC_FORCE = 18,
    BODY_NO_VERTICAL_VELOCITY = 19,
    BODY_KICK = 20,          /* value[0..2]: m/s, value[3]: rad/s about body x */
    BODY_BLOCKED = 21,       /* held horizontally where it is */
    BODY_HANG = 22,          /* the controller is not called; the rotors hold their last speeds */
    BODY_VELOCITY_BIAS = 23, /* value[0]: vertical, m/s */
    BODY_POSE_AGE = 24,      /* value[0]: seconds by which position and velocity are stamped earlier than they are */
    BODY_HEADING_JUMP = 25,  /* value[0]: rad, of the attitude alone; the estimator does not know */
    BODY_GYRO_AXIS = 26,     /* value[0]: axis that is not a number */
    BODY_ROTOR_SPEED = 27,   /* value[0]: rotor, value[1]: what its measured speed is replaced by */
    BODY_STUCK = 28,         /* position and velocity repeat their last values under fresh stamps */
    BODY_CARRIED = 29,       /* value[0..2]: m/s at which a hand moves it, value[3]: rad/s about body x */
    BODY_VIBRATION = 30,     /* value[0]: m/s2, of the accelerometer */
    BODY_SPEED_WRONG = 31,   /* value[0..2]: m/s, added to the estimated velocity */
    BODY_FAULT_COUNT = 32
} body_fault_kind;

typedef struct {
    int32_t kind, from_state;   /* from_state: tc_mission_state, or BODY_FROM_START */
    double after_s, duration_s; /* duration 0: for good */
    double value[4];
} body_fault;

/* Orders: tc_command, or one of these calls. */
enum { BODY_SHADOW = 100, BODY_ENGAGE = 101, BODY_RELEASE = 102 };

typedef struct {
    int32_t command, from_state;
    double after_s, value;
} body_order;

typedef struct {
    int32_t index;
    int32_t reserved;
    double value;
} body_value;

typedef struct {
    uint64_t seed;
    double tick_s, tick_jitter; /* the true step varies by this share */
    double limit_s;
    int32_t has_link; /* ground messages ten times a second */
    /* 1: starts hovering in the air at `start_m`, another controller flying; 2: falls there, rotors stopped. */
    int32_t in_air;
    double start_m[3], start_m_s[3];
    double pilot_m_s[3]; /* what the other controller flies while the output is not in command */
    body_vehicle vehicle;
    body_world world;
    body_sensors_config sensors;
    int32_t fault_count, order_count, value_count, segment_count;
    body_fault fault[BODY_MOST_FAULTS];
    body_order order[BODY_MOST_ORDERS];
    body_value value[BODY_MOST_VALUES]; /* parameters that differ from their defaults */
    tc_trajectory_header header;        /* of the trajectory to upload before take-off */
    const tc_segment* segment;
} body_scenario;

typedef struct {
    double time_s;
    int32_t from, to, reason, reserved;
} body_change;

typedef struct {
    body_record body;
    double end_s, end_position_m[3], end_tilt_rad;
    int32_t at_rest; /* rotors stopped and lying still for 2 s at the end */
    int32_t flew;    /* it has been in the air */
    int32_t final_state, final_reason;
    int32_t bad_outputs; /* ticks with speeds that are not finite or out of range */
    int32_t upload_reason;
    /* A rotor was commanded below its idle in flight, before that it was not: highest such moment. */
    double stop_clearance_m, stop_s, stop_tilt_rad;
    int32_t stop_state, stop_reason;
    double unlogged_slow_s; /* path limit below 0.99 without a limit reason */
    double largest_error_m; /* true position to set-point while on the path; in a frame that was not moved */
    double path_end_s;      /* path time reached */
    uint64_t limit_reasons; /* bit per tc_reason below 64 */
    uint64_t limit_reasons_high;
    uint32_t warnings, states;
    uint32_t ticks, refused_ticks, out_of_command_ticks;
    int32_t change_count;
    body_change change[BODY_MOST_CHANGES];
    int32_t order_reason[BODY_MOST_ORDERS];
    double order_s[BODY_MOST_ORDERS];
    int32_t fault_reason[BODY_MOST_FAULTS]; /* of a parameter that was set */
    double fault_s[BODY_MOST_FAULTS];       /* when it began; 0 = never */
} body_result;

#define BODY_TRACE_COLUMNS 62

void body_scenario_default(body_scenario* scenario);

/* Flies it. `trace`, which may be NULL, takes at most `rows` rows of BODY_TRACE_COLUMNS, one every `every` ticks;
   returns how many. */
int32_t body_fly(const body_scenario* scenario, body_result* result, double* trace, int32_t rows, int32_t every);

/* Names of the trace's columns, separated by blanks. */
const char* body_trace_names(void);
/* Sizes of body_scenario and body_result, for the other side to compare. */
void body_sizes(int32_t sizes[2]);

#endif
