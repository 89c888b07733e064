/* The table of transitions. Rows are states, columns events; 0 means "not in this state". */
#include "goshawk_controller/mission.h"

#include <string.h>

#define TO(state) ((uint8_t)((state) + 1))

/* What every flying state shares: the operator's cut-off, and losing attitude or position. */
#define IN_FLIGHT                                                              \
    [TC_COMMAND_KILL] = TO(TC_FAULT), [TC_EVENT_ATTITUDE_LOST] = TO(TC_FAULT), \
    [TC_EVENT_POSITION_LOST] = TO(TC_EMERGENCY), [TC_EVENT_TILT] = TO(TC_EMERGENCY)

/* clang-format off: one transition per line reads as the table it is */
static const uint8_t table[TC_MISSION_STATE_COUNT][TC_EVENT_COUNT] = {
    [TC_DISARMED] =
        {
            [TC_COMMAND_ARM] = TO(TC_ARMED),
            [TC_COMMAND_DISARM] = TO(TC_DISARMED),
            [TC_COMMAND_KILL] = TO(TC_DISARMED),
        },
    [TC_ARMED] =
        {
            [TC_COMMAND_ARM] = TO(TC_ARMED),
            [TC_COMMAND_DISARM] = TO(TC_DISARMED),
            [TC_COMMAND_TAKE_OFF] = TO(TC_TAKE_OFF),
            [TC_COMMAND_KILL] = TO(TC_DISARMED),
            [TC_EVENT_POSITION_LOST] = TO(TC_DISARMED),
            [TC_EVENT_ATTITUDE_LOST] = TO(TC_DISARMED),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_DISARMED),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_DISARMED),
        },
    [TC_TAKE_OFF] =
        {
            /* A large tilt error while leaving the ground is a tip-over: stop, do not fight. */
            [TC_COMMAND_KILL] = TO(TC_FAULT),
            [TC_EVENT_ATTITUDE_LOST] = TO(TC_FAULT),
            [TC_EVENT_TILT] = TO(TC_FAULT),
            [TC_EVENT_POSITION_LOST] = TO(TC_EMERGENCY),
            [TC_COMMAND_HOLD] = TO(TC_HOLD),
            [TC_COMMAND_LAND] = TO(TC_LANDING),
            [TC_EVENT_REACHED] = TO(TC_HOLD),
            [TC_EVENT_FENCE] = TO(TC_LANDING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_HOLD),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_LANDING),
        },
    [TC_HOLD] =
        {
            IN_FLIGHT,
            [TC_COMMAND_START] = TO(TC_APPROACH),
            [TC_COMMAND_HOLD] = TO(TC_HOLD),
            [TC_COMMAND_LAND] = TO(TC_LANDING),
            [TC_EVENT_FENCE] = TO(TC_LANDING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_HOLD),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_LANDING),
        },
    [TC_APPROACH] =
        {
            IN_FLIGHT,
            [TC_COMMAND_HOLD] = TO(TC_HOLD),
            [TC_COMMAND_LAND] = TO(TC_LANDING),
            [TC_EVENT_REACHED] = TO(TC_TRAJECTORY),
            [TC_EVENT_FENCE] = TO(TC_LANDING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_HOLD),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_LANDING),
        },
    [TC_TRAJECTORY] =
        {
            IN_FLIGHT,
            [TC_COMMAND_PAUSE] = TO(TC_PAUSING),
            [TC_COMMAND_HOLD] = TO(TC_STOPPING),
            [TC_COMMAND_LAND] = TO(TC_ABORTING),
            [TC_EVENT_FINISHED] = TO(TC_HOLD),
            [TC_EVENT_FENCE] = TO(TC_ABORTING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_STOPPING),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_ABORTING),
        },
    [TC_PAUSING] =
        {
            IN_FLIGHT,
            [TC_COMMAND_PAUSE] = TO(TC_PAUSING),
            [TC_COMMAND_RESUME] = TO(TC_TRAJECTORY),
            [TC_COMMAND_HOLD] = TO(TC_STOPPING),
            [TC_COMMAND_LAND] = TO(TC_ABORTING),
            [TC_EVENT_STANDING_STILL] = TO(TC_PAUSED),
            [TC_EVENT_FINISHED] = TO(TC_HOLD),
            [TC_EVENT_FENCE] = TO(TC_ABORTING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_STOPPING),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_ABORTING),
        },
    [TC_PAUSED] =
        {
            IN_FLIGHT,
            [TC_COMMAND_PAUSE] = TO(TC_PAUSED),
            [TC_COMMAND_RESUME] = TO(TC_TRAJECTORY),
            [TC_COMMAND_HOLD] = TO(TC_HOLD),
            [TC_COMMAND_LAND] = TO(TC_LANDING),
            [TC_EVENT_FENCE] = TO(TC_LANDING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_HOLD),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_LANDING),
        },
    [TC_STOPPING] =
        {
            IN_FLIGHT,
            [TC_COMMAND_HOLD] = TO(TC_STOPPING),
            [TC_COMMAND_LAND] = TO(TC_ABORTING),
            [TC_EVENT_STANDING_STILL] = TO(TC_HOLD),
            [TC_EVENT_FINISHED] = TO(TC_HOLD),
            [TC_EVENT_FENCE] = TO(TC_ABORTING),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_ABORTING),
        },
    [TC_ABORTING] =
        {
            IN_FLIGHT,
            [TC_COMMAND_LAND] = TO(TC_ABORTING),
            [TC_EVENT_STANDING_STILL] = TO(TC_LANDING),
            [TC_EVENT_FINISHED] = TO(TC_LANDING),
        },
    [TC_LANDING] =
        {
            IN_FLIGHT,
            [TC_COMMAND_HOLD] = TO(TC_HOLD),
            [TC_COMMAND_LAND] = TO(TC_LANDING),
            [TC_EVENT_TOUCHDOWN] = TO(TC_DISARMED),
        },
    [TC_EMERGENCY] =
        {
            [TC_COMMAND_KILL] = TO(TC_FAULT),
            [TC_COMMAND_LAND] = TO(TC_EMERGENCY),
            [TC_EVENT_ATTITUDE_LOST] = TO(TC_FAULT),
            [TC_EVENT_TILT] = TO(TC_FAULT),
            [TC_EVENT_TIMEOUT] = TO(TC_FAULT),
            [TC_EVENT_POSITION_BACK] = TO(TC_LANDING),
        },
    [TC_FAULT] =
        {
            [TC_COMMAND_DISARM] = TO(TC_DISARMED),
            [TC_COMMAND_KILL] = TO(TC_FAULT),
        },
};
/* clang-format on */

void tc_mission_init(tc_mission* mission) { memset(mission, 0, sizeof *mission); }

tc_reason tc_mission_post(tc_mission* mission, uint8_t event, tc_reason reason, uint64_t time_us) {
    if (mission->state >= TC_MISSION_STATE_COUNT || event >= TC_EVENT_COUNT) return TC_WRONG_STATE;
    const uint8_t next = table[mission->state][event];
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
