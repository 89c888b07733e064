/* The table of transitions. Rows are states, columns events; 0 means "not in this state", else one less is the next. */
#include "goshawk_controller/mission.h"

#include <string.h>

#include "copy.h"

/* What a transition adds to one byte of its state's row: two events a byte, four bits each. They
   are added up: no event may stand twice in a row. */
#define TO(byte, event, state) \
    +(((unsigned)(event) / 2u == (byte)) ? ((unsigned)(state) + 1u) << (4u * ((event) & 1u)) : 0u)

/* What every flying state shares: the operator's cut-off, and losing attitude or position. */
#define IN_FLIGHT(ON, byte)                        \
    ON(byte, TC_COMMAND_KILL, TC_FAULT)            \
    ON(byte, TC_EVENT_ATTITUDE_LOST, TC_FAULT)     \
    ON(byte, TC_EVENT_POSITION_LOST, TC_EMERGENCY) \
    ON(byte, TC_EVENT_TILT, TC_EMERGENCY)

/* What states that hover or move from point to point share: stay, or go straight down. */
#define OFF_PATH(ON, byte)                     \
    ON(byte, TC_COMMAND_HOLD, TC_HOLD)         \
    ON(byte, TC_COMMAND_LAND, TC_LANDING)      \
    ON(byte, TC_EVENT_FENCE, TC_LANDING)       \
    ON(byte, TC_EVENT_LINK_LOST_HOLD, TC_HOLD) \
    ON(byte, TC_EVENT_LINK_LOST_LAND, TC_LANDING)

/* What states on the path share: they leave it by slowing down along it, or at its end. */
#define ON_PATH(ON, byte)                  \
    ON(byte, TC_COMMAND_HOLD, TC_STOPPING) \
    ON(byte, TC_COMMAND_LAND, TC_ABORTING) \
    ON(byte, TC_EVENT_FENCE, TC_ABORTING)  \
    ON(byte, TC_EVENT_FINISHED, TC_HOLD)   \
    ON(byte, TC_EVENT_LINK_LOST_LAND, TC_ABORTING)

#define FROM_DISARMED(ON, byte)              \
    ON(byte, TC_COMMAND_ARM, TC_ARMED)       \
    ON(byte, TC_COMMAND_DISARM, TC_DISARMED) \
    ON(byte, TC_COMMAND_KILL, TC_DISARMED)
#define FROM_ARMED(ON, byte)                       \
    ON(byte, TC_COMMAND_ARM, TC_ARMED)             \
    ON(byte, TC_COMMAND_DISARM, TC_DISARMED)       \
    ON(byte, TC_COMMAND_TAKE_OFF, TC_TAKE_OFF)     \
    ON(byte, TC_COMMAND_KILL, TC_DISARMED)         \
    ON(byte, TC_EVENT_POSITION_LOST, TC_DISARMED)  \
    ON(byte, TC_EVENT_ATTITUDE_LOST, TC_DISARMED)  \
    ON(byte, TC_EVENT_LINK_LOST_HOLD, TC_DISARMED) \
    ON(byte, TC_EVENT_LINK_LOST_LAND, TC_DISARMED)
/* A large tilt error while leaving the ground is a tip-over: stop, do not fight. */
#define FROM_TAKE_OFF(ON, byte)                    \
    OFF_PATH(ON, byte)                             \
    ON(byte, TC_COMMAND_KILL, TC_FAULT)            \
    ON(byte, TC_EVENT_ATTITUDE_LOST, TC_FAULT)     \
    ON(byte, TC_EVENT_TILT, TC_FAULT)              \
    ON(byte, TC_EVENT_POSITION_LOST, TC_EMERGENCY) \
    ON(byte, TC_EVENT_REACHED, TC_HOLD)
#define FROM_HOLD(ON, byte) \
    IN_FLIGHT(ON, byte)     \
    OFF_PATH(ON, byte)      \
    ON(byte, TC_COMMAND_START, TC_APPROACH)
#define FROM_APPROACH(ON, byte) \
    IN_FLIGHT(ON, byte)         \
    OFF_PATH(ON, byte)          \
    ON(byte, TC_EVENT_REACHED, TC_TRAJECTORY)
#define FROM_TRAJECTORY(ON, byte)          \
    IN_FLIGHT(ON, byte)                    \
    ON_PATH(ON, byte)                      \
    ON(byte, TC_COMMAND_PAUSE, TC_PAUSING) \
    ON(byte, TC_EVENT_LINK_LOST_HOLD, TC_STOPPING)
#define FROM_PAUSING(ON, byte)                   \
    IN_FLIGHT(ON, byte)                          \
    ON_PATH(ON, byte)                            \
    ON(byte, TC_COMMAND_PAUSE, TC_PAUSING)       \
    ON(byte, TC_COMMAND_RESUME, TC_TRAJECTORY)   \
    ON(byte, TC_EVENT_STANDING_STILL, TC_PAUSED) \
    ON(byte, TC_EVENT_LINK_LOST_HOLD, TC_STOPPING)
#define FROM_PAUSED(ON, byte)             \
    IN_FLIGHT(ON, byte)                   \
    OFF_PATH(ON, byte)                    \
    ON(byte, TC_COMMAND_PAUSE, TC_PAUSED) \
    ON(byte, TC_COMMAND_RESUME, TC_TRAJECTORY)
#define FROM_STOPPING(ON, byte) \
    IN_FLIGHT(ON, byte)         \
    ON_PATH(ON, byte)           \
    ON(byte, TC_EVENT_STANDING_STILL, TC_HOLD)
#define FROM_ABORTING(ON, byte)                   \
    IN_FLIGHT(ON, byte)                           \
    ON(byte, TC_COMMAND_LAND, TC_ABORTING)        \
    ON(byte, TC_EVENT_STANDING_STILL, TC_LANDING) \
    ON(byte, TC_EVENT_FINISHED, TC_LANDING)
#define FROM_LANDING(ON, byte)            \
    IN_FLIGHT(ON, byte)                   \
    ON(byte, TC_COMMAND_HOLD, TC_HOLD)    \
    ON(byte, TC_COMMAND_LAND, TC_LANDING) \
    ON(byte, TC_EVENT_TOUCHDOWN, TC_DISARMED)
#define FROM_EMERGENCY(ON, byte)               \
    ON(byte, TC_COMMAND_KILL, TC_FAULT)        \
    ON(byte, TC_COMMAND_LAND, TC_EMERGENCY)    \
    ON(byte, TC_EVENT_ATTITUDE_LOST, TC_FAULT) \
    ON(byte, TC_EVENT_TILT, TC_FAULT)          \
    ON(byte, TC_EVENT_TIMEOUT, TC_FAULT)       \
    ON(byte, TC_EVENT_POSITION_BACK, TC_LANDING)
#define FROM_FAULT(ON, byte)                 \
    ON(byte, TC_COMMAND_DISARM, TC_DISARMED) \
    ON(byte, TC_COMMAND_KILL, TC_FAULT)

#define BYTE(from, byte) (uint8_t)(0u from(TO, byte))
#define ROW(from)                                                                                    \
    {BYTE(from, 0u), BYTE(from, 1u), BYTE(from, 2u), BYTE(from, 3u), BYTE(from, 4u), BYTE(from, 5u), \
     BYTE(from, 6u), BYTE(from, 7u), BYTE(from, 8u), BYTE(from, 9u), BYTE(from, 10u)}
static const uint8_t table[TC_MISSION_STATE_COUNT][TC_EVENT_COUNT / 2] = {
    [TC_DISARMED] = ROW(FROM_DISARMED), [TC_ARMED] = ROW(FROM_ARMED),       [TC_TAKE_OFF] = ROW(FROM_TAKE_OFF),
    [TC_HOLD] = ROW(FROM_HOLD),         [TC_APPROACH] = ROW(FROM_APPROACH), [TC_TRAJECTORY] = ROW(FROM_TRAJECTORY),
    [TC_PAUSING] = ROW(FROM_PAUSING),   [TC_PAUSED] = ROW(FROM_PAUSED),     [TC_STOPPING] = ROW(FROM_STOPPING),
    [TC_ABORTING] = ROW(FROM_ABORTING), [TC_LANDING] = ROW(FROM_LANDING),   [TC_EMERGENCY] = ROW(FROM_EMERGENCY),
    [TC_FAULT] = ROW(FROM_FAULT),
};

_Static_assert(TC_EVENT_COUNT == 22 && TC_MISSION_STATE_COUNT < 16, "rows are whole, states fit into four bits");

void tc_mission_init(tc_mission* mission) { tc_fill(mission, 0, sizeof *mission); }

tc_reason tc_mission_post(tc_mission* mission, uint8_t event, tc_reason reason, uint32_t time_us) {
    if (mission->state >= TC_MISSION_STATE_COUNT || event >= TC_EVENT_COUNT) return TC_WRONG_STATE;
    const uint32_t pair = table[mission->state][event / 2u];
    const uint32_t next = (event & 1u) != 0u ? pair >> 4 : pair & 15u;
    if (next == 0u) return TC_WRONG_STATE;
    const uint8_t state = (uint8_t)(next - 1u);
    if (state == mission->state) return TC_OK;
    mission->previous_state = mission->state;
    mission->state = state;
    mission->reason = (uint8_t)reason;
    mission->since_us = time_us;
    mission->transitions++;
    return TC_OK;
}

bool tc_mission_in_air(uint8_t state) { return state >= TC_TAKE_OFF && state <= TC_EMERGENCY; }

bool tc_mission_on_path(uint8_t state) { return state >= TC_TRAJECTORY && state <= TC_ABORTING; }

bool tc_mission_rotors_on(uint8_t state) { return state >= TC_ARMED && state <= TC_EMERGENCY; }

const char* tc_mission_state_text(uint8_t state) {
    switch (state) {
        case TC_DISARMED:
            return "disarmed";
        case TC_ARMED:
            return "armed";
        case TC_TAKE_OFF:
            return "take-off";
        case TC_HOLD:
            return "hold";
        case TC_APPROACH:
            return "approach";
        case TC_TRAJECTORY:
            return "trajectory";
        case TC_PAUSING:
            return "pausing";
        case TC_PAUSED:
            return "paused";
        case TC_STOPPING:
            return "stopping";
        case TC_ABORTING:
            return "aborting";
        case TC_LANDING:
            return "landing";
        case TC_EMERGENCY:
            return "emergency";
        case TC_FAULT:
            return "fault";
        default:
            return "unknown";
    }
}

const char* tc_command_text(uint8_t command) {
    switch (command) {
        case TC_COMMAND_ARM:
            return "arm";
        case TC_COMMAND_DISARM:
            return "disarm";
        case TC_COMMAND_TAKE_OFF:
            return "take off";
        case TC_COMMAND_START:
            return "start";
        case TC_COMMAND_PAUSE:
            return "pause";
        case TC_COMMAND_RESUME:
            return "resume";
        case TC_COMMAND_HOLD:
            return "hold";
        case TC_COMMAND_LAND:
            return "land";
        case TC_COMMAND_KILL:
            return "kill";
        case TC_COMMAND_TIME_SCALE:
            return "time scale";
        default:
            return "unknown";
    }
}
