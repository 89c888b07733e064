/* The table of transitions: next[state][event]. What is not listed is refused in that state. Entering an event twice
   does not compile (-Woverride-init is an error in our build). */
#include "goshawk_controller/mission.h"

#include <string.h>

#define TO(state) ((uint8_t)((state) + 1u)) /* 0 is left for "refused" */

/* What every flying state shares: the operator's cut-off, the other controller's call, lost attitude or position. */
#define IN_FLIGHT                                                                                                  \
    [TC_COMMAND_KILL] = TO(TC_FAULT), [TC_EVENT_RELEASE] = TO(TC_SHADOW), [TC_EVENT_ATTITUDE_LOST] = TO(TC_FAULT), \
    [TC_EVENT_POSITION_LOST] = TO(TC_EMERGENCY), [TC_EVENT_CRASHED] = TO(TC_FAULT)

/* What states that hover or move from point to point share: stay, or go straight down. */
#define OFF_PATH                                                                                            \
    [TC_COMMAND_HOLD] = TO(TC_HOLD), [TC_COMMAND_LAND] = TO(TC_LANDING), [TC_EVENT_FENCE] = TO(TC_LANDING), \
    [TC_EVENT_BATTERY_LOW] = TO(TC_LANDING), [TC_EVENT_LINK_LOST_HOLD] = TO(TC_HOLD),                       \
    [TC_EVENT_LINK_LOST_LAND] = TO(TC_LANDING)

/* What states on the path share: they leave it by slowing down along it, at its end, or from where the vehicle is when
   it has lost the path. */
#define ON_PATH                                                                                                   \
    [TC_COMMAND_HOLD] = TO(TC_STOPPING), [TC_COMMAND_LAND] = TO(TC_ABORTING), [TC_EVENT_FENCE] = TO(TC_ABORTING), \
    [TC_EVENT_BATTERY_LOW] = TO(TC_ABORTING), [TC_EVENT_RELOCALIZED] = TO(TC_STOPPING),                           \
    [TC_EVENT_TRACKING_LOST] = TO(TC_LANDING), [TC_EVENT_LINK_LOST_LAND] = TO(TC_ABORTING),                       \
    [TC_EVENT_TILT] = TO(TC_EMERGENCY), [TC_EVENT_FINISHED] = TO(TC_HOLD)

/* clang-format off: a row per state reads as the table it is */
static const uint8_t next[TC_MISSION_STATE_COUNT][TC_EVENT_COUNT] = {
    [TC_DISARMED] =
        {
            [TC_COMMAND_ARM] = TO(TC_ARMED),
            [TC_COMMAND_DISARM] = TO(TC_DISARMED),
            [TC_COMMAND_KILL] = TO(TC_DISARMED),
            [TC_EVENT_SHADOW] = TO(TC_SHADOW),
            [TC_EVENT_ENGAGE] = TO(TC_HOLD),
        },
    [TC_ARMED] =
        {
            [TC_COMMAND_ARM] = TO(TC_ARMED),
            [TC_COMMAND_DISARM] = TO(TC_DISARMED),
            [TC_COMMAND_TAKE_OFF] = TO(TC_TAKE_OFF),
            [TC_COMMAND_KILL] = TO(TC_DISARMED),
            [TC_EVENT_RELEASE] = TO(TC_DISARMED),
            [TC_EVENT_POSITION_LOST] = TO(TC_DISARMED),
            [TC_EVENT_ATTITUDE_LOST] = TO(TC_DISARMED),
            [TC_EVENT_BATTERY_LOW] = TO(TC_DISARMED),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_DISARMED),
            [TC_EVENT_LINK_LOST_LAND] = TO(TC_DISARMED),
        },
    [TC_TAKE_OFF] =
        {
            IN_FLIGHT,
            OFF_PATH,
            [TC_EVENT_TILT] = TO(TC_FAULT), /* a tip-over: stop, do not fight */
            [TC_EVENT_TRACKING_LOST] = TO(TC_LANDING),
            [TC_EVENT_REACHED] = TO(TC_HOLD),
        },
    [TC_HOLD] =
        {
            IN_FLIGHT,
            OFF_PATH,
            [TC_EVENT_TILT] = TO(TC_EMERGENCY),
            [TC_EVENT_TRACKING_LOST] = TO(TC_LANDING),
            [TC_COMMAND_START] = TO(TC_APPROACH),
        },
    [TC_APPROACH] =
        {
            IN_FLIGHT,
            OFF_PATH,
            [TC_EVENT_TILT] = TO(TC_EMERGENCY),
            [TC_EVENT_RELOCALIZED] = TO(TC_HOLD),
            [TC_EVENT_TRACKING_LOST] = TO(TC_LANDING),
            [TC_EVENT_REACHED] = TO(TC_TRAJECTORY),
        },
    [TC_TRAJECTORY] =
        {
            IN_FLIGHT,
            ON_PATH,
            [TC_COMMAND_PAUSE] = TO(TC_PAUSING),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_STOPPING),
        },
    [TC_PAUSING] =
        {
            IN_FLIGHT,
            ON_PATH,
            [TC_COMMAND_PAUSE] = TO(TC_PAUSING),
            [TC_COMMAND_RESUME] = TO(TC_TRAJECTORY),
            [TC_EVENT_STANDING_STILL] = TO(TC_PAUSED),
            [TC_EVENT_LINK_LOST_HOLD] = TO(TC_STOPPING),
        },
    [TC_PAUSED] =
        {
            IN_FLIGHT,
            OFF_PATH,
            [TC_EVENT_TILT] = TO(TC_EMERGENCY),
            [TC_EVENT_RELOCALIZED] = TO(TC_HOLD),
            [TC_EVENT_TRACKING_LOST] = TO(TC_LANDING),
            [TC_COMMAND_PAUSE] = TO(TC_PAUSED),
            [TC_COMMAND_RESUME] = TO(TC_TRAJECTORY),
        },
    [TC_STOPPING] =
        {
            IN_FLIGHT,
            ON_PATH,
            [TC_EVENT_STANDING_STILL] = TO(TC_HOLD),
        },
    [TC_ABORTING] =
        {
            IN_FLIGHT,
            [TC_EVENT_TILT] = TO(TC_EMERGENCY),
            [TC_EVENT_TRACKING_LOST] = TO(TC_LANDING),
            [TC_COMMAND_LAND] = TO(TC_ABORTING),
            [TC_EVENT_STANDING_STILL] = TO(TC_LANDING),
            [TC_EVENT_FINISHED] = TO(TC_LANDING),
        },
    [TC_LANDING] =
        {
            IN_FLIGHT,
            [TC_EVENT_TILT] = TO(TC_EMERGENCY),
            [TC_EVENT_TRACKING_LOST] = TO(TC_EMERGENCY),
            [TC_COMMAND_HOLD] = TO(TC_HOLD),
            [TC_COMMAND_LAND] = TO(TC_LANDING),
            [TC_EVENT_TOUCHDOWN] = TO(TC_DISARMED),
        },
    [TC_EMERGENCY] =
        {
            [TC_COMMAND_KILL] = TO(TC_FAULT),
            [TC_COMMAND_LAND] = TO(TC_EMERGENCY),
            [TC_EVENT_RELEASE] = TO(TC_SHADOW),
            [TC_EVENT_ATTITUDE_LOST] = TO(TC_FAULT),
            [TC_EVENT_TILT] = TO(TC_FAULT),
            [TC_EVENT_TIMEOUT] = TO(TC_FAULT),
            [TC_EVENT_CRASHED] = TO(TC_FAULT),
            [TC_EVENT_TOUCHDOWN] = TO(TC_DISARMED),
            [TC_EVENT_POSITION_BACK] = TO(TC_LANDING),
        },
    [TC_FAULT] =
        {
            [TC_COMMAND_DISARM] = TO(TC_DISARMED),
            [TC_COMMAND_KILL] = TO(TC_FAULT),
        },
    [TC_SHADOW] =
        {
            [TC_COMMAND_KILL] = TO(TC_DISARMED),
            [TC_EVENT_SHADOW] = TO(TC_SHADOW),
            [TC_EVENT_SHADOW_END] = TO(TC_DISARMED),
            [TC_EVENT_ENGAGE] = TO(TC_HOLD),
            [TC_EVENT_RELEASE] = TO(TC_SHADOW),
        },
};
/* clang-format on */

static const char* const states[TC_MISSION_STATE_COUNT] = {
    [TC_DISARMED] = "disarmed", [TC_ARMED] = "armed",       [TC_TAKE_OFF] = "take-off",
    [TC_HOLD] = "hold",         [TC_APPROACH] = "approach", [TC_TRAJECTORY] = "trajectory",
    [TC_PAUSING] = "pausing",   [TC_PAUSED] = "paused",     [TC_STOPPING] = "stopping",
    [TC_ABORTING] = "aborting", [TC_LANDING] = "landing",   [TC_EMERGENCY] = "emergency",
    [TC_FAULT] = "fault",       [TC_SHADOW] = "shadow",
};

static const char* const commands[TC_COMMAND_COUNT] = {
    [TC_COMMAND_ARM] = "arm",           [TC_COMMAND_DISARM] = "disarm",
    [TC_COMMAND_TAKE_OFF] = "take off", [TC_COMMAND_START] = "start",
    [TC_COMMAND_PAUSE] = "pause",       [TC_COMMAND_RESUME] = "resume",
    [TC_COMMAND_HOLD] = "hold",         [TC_COMMAND_LAND] = "land",
    [TC_COMMAND_KILL] = "kill",         [TC_COMMAND_TIME_SCALE] = "time scale",
};

void tc_mission_init(tc_mission* mission) { memset(mission, 0, sizeof *mission); }

tc_reason tc_mission_post(tc_mission* mission, uint8_t event, tc_reason reason, uint64_t time_us) {
    if (mission->state >= TC_MISSION_STATE_COUNT || event >= TC_EVENT_COUNT) return TC_WRONG_STATE;
    const uint8_t entry = next[mission->state][event];
    if (entry == 0u) return TC_WRONG_STATE;
    const uint8_t state = (uint8_t)(entry - 1u);
    if (state == mission->state) return TC_OK;
    mission->previous_state = mission->state;
    mission->state = state;
    mission->reason = (uint8_t)reason;
    mission->since_us = time_us;
    mission->transitions++;
    return TC_OK;
}

const char* tc_mission_state_text(uint8_t state) { return state < TC_MISSION_STATE_COUNT ? states[state] : "unknown"; }

const char* tc_command_text(uint8_t command) { return command < TC_COMMAND_COUNT ? commands[command] : "unknown"; }
