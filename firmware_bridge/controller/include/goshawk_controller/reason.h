/* Why something was refused, or why the mission changed its state. One list for the whole module, so that a single
   byte on the link says it all. 0 means "done" / "fine". Numbers are part of the link protocol: only append. */
#ifndef GOSHAWK_CONTROLLER_REASON_H
#define GOSHAWK_CONTROLLER_REASON_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    TC_OK = 0,

    /* Input validation. */
    TC_NOT_FINITE = 1,
    TC_OUT_OF_RANGE = 2,
    TC_UNKNOWN_PARAMETER = 3,
    TC_SINGULAR_GEOMETRY = 4,
    TC_ONLY_WHEN_DISARMED = 5,
    TC_TIME_WENT_BACK = 6,
    TC_CANNOT_HOVER = 7,

    /* The trajectory store. */
    TC_NO_UPLOAD = 10,
    TC_WRONG_ID = 11,
    TC_SEGMENT_COUNT = 12,
    TC_COEFFICIENT_COUNT = 13,
    TC_SEGMENT_INDEX = 14,
    TC_SEGMENTS_MISSING = 15,
    TC_SEGMENT_DURATION = 16,
    TC_CRC_MISMATCH = 17,
    TC_JUMP_AT_JOIN = 18,
    TC_PATH_LEAVES_FENCE = 19,
    TC_PATH_TOO_FAST = 20,
    TC_PATH_ACCELERATION = 21,
    TC_PATH_YAW_RATE = 22,
    TC_NOT_AT_REST = 23,
    TC_SAMPLE_MISMATCH = 24,
    TC_NOT_STAGED = 25,
    TC_SLOT_IN_USE = 26,
    TC_PATH_JERK = 27,
    TC_UPLOAD_OPEN = 28,

    /* The mission. */
    TC_WRONG_STATE = 40,
    TC_NO_TRAJECTORY = 41,
    TC_START_TOO_FAR = 42,
    TC_ESTIMATE_STALE = 43,
    TC_ESTIMATE_NOT_FINITE = 44,
    TC_ATTITUDE_STALE = 45,
    TC_TILT_ERROR = 46,
    TC_FENCE_BREACH = 47,
    TC_LINK_LOST = 48,
    TC_COMMANDED = 49,
    TC_REACHED = 50,
    TC_FINISHED = 51,
    TC_STANDING_STILL = 52,
    TC_TOUCHDOWN = 53,
    TC_ESTIMATE_BACK = 54,
    TC_NOT_CONFIGURED = 55,
    TC_TIMEOUT = 56,
    TC_TRACKING_LOST = 57,
    TC_RELOCALIZED = 58,
    TC_BATTERY_LOW = 59,
    TC_RELEASED = 60,
    TC_ENGAGED = 61,
    TC_BUSY = 62,
    TC_NOT_ENGAGEABLE = 63,
    TC_DEAD_RECKONING = 64,
    TC_CHANGE_TOO_LARGE = 65,
    TC_GYRO_ONLY = 66,
    TC_TRACKING_ERROR = 67,
    TC_MOVING = 68,
    TC_POSE_VELOCITY = 69,
    TC_POSE_POSITION = 70,
    TC_POSE_HEADING = 71,
    TC_POSE_FROZEN = 72,
    TC_POSE_DRIFTS = 73,
    TC_GYRO_AXIS = 74,
    TC_FALLING = 75,
    TC_CRASHED = 76,
    TC_GROUNDED = 77
} tc_reason;

/* At most 50 characters, so that it fits a MAVLink STATUSTEXT; never NULL, "unknown reason" for a number not above. */
const char* tc_reason_text(tc_reason reason);

#ifdef __cplusplus
}
#endif

#endif
