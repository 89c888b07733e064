/* Reasons in words. */
#include "goshawk_controller/reason.h"

#include "words.h"

#define FIRST ((uint32_t)TC_ESTIMATE_STALE)
#define COUNT ((uint32_t)TC_TIMEOUT + 1u - FIRST)

/* Those of transitions, in the order of their numbers. */
static const char words_of_transitions[] =
    "position is stale\0"
    "position is not finite\0"
    "attitude is lost\0"
    "attitude error too large\0"
    "left the fence\0"
    "link is lost\0"
    "commanded\0"
    "reached\0"
    "finished\0"
    "standing still\0"
    "touched down\0"
    "position is back\0"
    "\0" /* TC_NOT_CONFIGURED */
    "took too long\0";

const char* tc_transition_text(uint8_t reason) {
    const uint32_t number = reason - FIRST;                                /* large for one before the first */
    return tc_word(words_of_transitions, number < COUNT ? number : COUNT); /* behind the last stands an empty one */
}

const char* tc_reason_text(tc_reason reason) {
    switch (reason) {
        case TC_OK:
            return "done";
        case TC_NOT_FINITE:
            return "a number is not finite";
        case TC_OUT_OF_RANGE:
            return "a number is out of its range";
        case TC_UNKNOWN_PARAMETER:
            return "no such parameter";
        case TC_SINGULAR_GEOMETRY:
            return "rotor geometry cannot give every wrench";
        case TC_ONLY_WHEN_DISARMED:
            return "may change only when disarmed";
        case TC_CANNOT_HOVER:
            return "rotors cannot carry the mass";
        case TC_TIME_WENT_BACK:
            return "time went back or jumped";
        case TC_NO_UPLOAD:
            return "no upload has been opened";
        case TC_WRONG_ID:
            return "another trajectory id";
        case TC_SEGMENT_COUNT:
            return "segment count out of range";
        case TC_COEFFICIENT_COUNT:
            return "coefficient count out of range";
        case TC_SEGMENT_INDEX:
            return "segment index out of range";
        case TC_SEGMENTS_MISSING:
            return "segments are missing";
        case TC_SEGMENT_DURATION:
            return "segment too short or too long";
        case TC_CRC_MISMATCH:
            return "CRC does not match";
        case TC_JUMP_AT_JOIN:
            return "trajectory jumps at a join";
        case TC_PATH_LEAVES_FENCE:
            return "trajectory leaves the fence";
        case TC_PATH_TOO_FAST:
            return "trajectory exceeds the speed limit";
        case TC_PATH_ACCELERATION:
            return "trajectory exceeds the acceleration limit";
        case TC_PATH_YAW_RATE:
            return "trajectory exceeds the yaw rate limit";
        case TC_NOT_AT_REST:
            return "trajectory does not start and end at rest";
        case TC_SAMPLE_MISMATCH:
            return "vehicle evaluates another curve than planner";
        case TC_NOT_STAGED:
            return "no checked trajectory with this id and CRC";
        case TC_SLOT_IN_USE:
            return "a trajectory is being flown";
        case TC_PATH_JERK:
            return "trajectory exceeds the jerk limit";
        case TC_UPLOAD_OPEN:
            return "an upload is under way";
        case TC_WRONG_STATE:
            return "not in this state";
        case TC_NO_TRAJECTORY:
            return "no trajectory is active";
        case TC_START_TOO_FAR:
            return "trajectory starts too far from the vehicle";
        case TC_NOT_CONFIGURED:
            return "vehicle parameters were never set";
        default:
            break;
    }
    const char* words = tc_transition_text((uint8_t)reason);
    return *words != '\0' ? words : "unknown reason";
}
