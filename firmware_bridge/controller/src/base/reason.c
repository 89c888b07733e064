/* Reasons in words. */
#include "goshawk_controller/reason.h"

#include <stddef.h>

static const char* const texts[] = {
    [TC_OK] = "done",
    [TC_NOT_FINITE] = "a number is not finite",
    [TC_OUT_OF_RANGE] = "a number is out of its range",
    [TC_UNKNOWN_PARAMETER] = "no such parameter",
    [TC_SINGULAR_GEOMETRY] = "rotor geometry cannot give every wrench",
    [TC_ONLY_WHEN_DISARMED] = "may change only when disarmed",
    [TC_TIME_WENT_BACK] = "time went back or jumped",
    [TC_CANNOT_HOVER] = "rotors cannot carry the mass",
    [TC_NO_UPLOAD] = "no upload has been opened",
    [TC_WRONG_ID] = "another trajectory id",
    [TC_SEGMENT_COUNT] = "segment count out of range",
    [TC_COEFFICIENT_COUNT] = "coefficient count out of range",
    [TC_SEGMENT_INDEX] = "segment index out of range",
    [TC_SEGMENTS_MISSING] = "segments are missing",
    [TC_SEGMENT_DURATION] = "segment too short or too long",
    [TC_CRC_MISMATCH] = "CRC does not match",
    [TC_JUMP_AT_JOIN] = "trajectory jumps at a join",
    [TC_PATH_LEAVES_FENCE] = "trajectory leaves the fence",
    [TC_PATH_TOO_FAST] = "trajectory exceeds the speed limit",
    [TC_PATH_ACCELERATION] = "trajectory exceeds the acceleration limit",
    [TC_PATH_YAW_RATE] = "trajectory exceeds the yaw rate limit",
    [TC_NOT_AT_REST] = "trajectory does not start and end at rest",
    [TC_SAMPLE_MISMATCH] = "vehicle evaluates another curve than planner",
    [TC_NOT_STAGED] = "no checked trajectory with this id and CRC",
    [TC_SLOT_IN_USE] = "a trajectory is being flown",
    [TC_PATH_JERK] = "trajectory exceeds the jerk limit",
    [TC_UPLOAD_OPEN] = "an upload is under way",
    [TC_WRONG_STATE] = "not in this state",
    [TC_NO_TRAJECTORY] = "no trajectory is active",
    [TC_START_TOO_FAR] = "trajectory starts too far from the vehicle",
    [TC_ESTIMATE_STALE] = "position is stale",
    [TC_ESTIMATE_NOT_FINITE] = "position is not finite",
    [TC_ATTITUDE_STALE] = "attitude is lost",
    [TC_TILT_ERROR] = "attitude error too large",
    [TC_FENCE_BREACH] = "left the fence",
    [TC_LINK_LOST] = "link is lost",
    [TC_COMMANDED] = "commanded",
    [TC_REACHED] = "reached",
    [TC_FINISHED] = "finished",
    [TC_STANDING_STILL] = "standing still",
    [TC_TOUCHDOWN] = "touched down",
    [TC_ESTIMATE_BACK] = "position is back",
    [TC_NOT_CONFIGURED] = "vehicle parameters were never set",
    [TC_TIMEOUT] = "took too long",
    [TC_TRACKING_LOST] = "tracking error beyond the clearance",
    [TC_RELOCALIZED] = "position estimate jumped beyond the clearance",
    [TC_BATTERY_LOW] = "battery is low",
    [TC_RELEASED] = "given back to another controller",
    [TC_ENGAGED] = "took over in flight",
    [TC_BUSY] = "still being checked",
    [TC_NOT_ENGAGEABLE] = "outside the limits of taking over in flight",
    [TC_DEAD_RECKONING] = "position by dead reckoning",
    [TC_CHANGE_TOO_LARGE] = "too large a change in the air",
    [TC_GYRO_ONLY] = "attitude is lost, level on the gyro",
    [TC_TRACKING_ERROR] = "slowed by its tracking error",
    [TC_MOVING] = "the vehicle moves",
};

const char* tc_reason_text(tc_reason reason) {
    const size_t number = (size_t)reason;
    const char* text = number < sizeof texts / sizeof *texts ? texts[number] : NULL;
    return text != NULL ? text : "unknown reason";
}
