/* The mission: one state, one table of transitions, a reason for each of them.

       disarmed -> armed -> take-off -> hold -> approach -> trajectory -> hold -> landing -> armed -> disarmed
                                               trajectory -> pausing -> paused -> trajectory
                                               trajectory -> stopping (hold) / aborting (land)

   The machine itself knows no physics: `controller.c` posts events ("reached", "touchdown", "estimate stale") and
   commands; `tc_mission_post` looks up [state][event]. */
#ifndef GOSHAWK_CONTROLLER_MISSION_H
#define GOSHAWK_CONTROLLER_MISSION_H

#include <stdbool.h>
#include <stdint.h>

#include "goshawk_controller/reason.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The numbers go into the flight log (`mission_state`) and over the link: only append. */
typedef enum {
    TC_DISARMED = 0,   /* rotors stopped */
    TC_ARMED = 1,      /* rotors idle on the ground */
    TC_TAKE_OFF = 2,   /* straight up */
    TC_HOLD = 3,       /* hovers at a point */
    TC_APPROACH = 4,   /* slides from the hover point to the start of the trajectory */
    TC_TRAJECTORY = 5, /* flies the active trajectory */
    TC_PAUSING = 6,    /* slows down along the path to stand on it */
    TC_PAUSED = 7,     /* stands on the path; resumes on command */
    TC_STOPPING = 8,   /* slows down along the path, then holds and gives the trajectory up */
    TC_ABORTING = 9,   /* slows down along the path, then lands */
    TC_LANDING = 10,   /* straight down until touchdown */
    TC_EMERGENCY = 11, /* position lost: level, sinking gently on attitude alone */
    TC_FAULT = 12,     /* rotors stopped; only disarming leads out */
    TC_SHADOW = 13,    /* another controller flies; this one computes and logs, and commands nothing */
    TC_MISSION_STATE_COUNT = 14
} tc_mission_state;

/* Heights of a take-off; others are taken for a mistake. */
#define TC_LOWEST_TAKE_OFF_M 0.1f
#define TC_HIGHEST_TAKE_OFF_M 50.0f

/* What the ground may ask for. */
typedef enum {
    TC_COMMAND_ARM = 0,
    TC_COMMAND_DISARM = 1,     /* refused in the air */
    TC_COMMAND_TAKE_OFF = 2,   /* value: height above the present position, m, within the two above */
    TC_COMMAND_START = 3,      /* fly the active trajectory from its beginning */
    TC_COMMAND_PAUSE = 4,      /* stand still on the path */
    TC_COMMAND_RESUME = 5,     /* go on after a pause */
    TC_COMMAND_HOLD = 6,       /* leave the trajectory and hover */
    TC_COMMAND_LAND = 7,       /* abort: brake along the path, then land straight down */
    TC_COMMAND_KILL = 8,       /* rotors off now, in the air too */
    TC_COMMAND_TIME_SCALE = 9, /* value: path rate 0.1 .. 1 (1 = as planned) */
    TC_COMMAND_COUNT = 10
} tc_command;

/* What happens to the machine: the commands above (same numbers), and what the controller observes. */
typedef enum {
    TC_EVENT_REACHED = 10,        /* take-off height or trajectory start reached */
    TC_EVENT_FINISHED = 11,       /* the trajectory's end */
    TC_EVENT_STANDING_STILL = 12, /* path rate has come to zero */
    TC_EVENT_TOUCHDOWN = 13,
    TC_EVENT_POSITION_LOST = 14, /* stale or not finite, attitude still good */
    TC_EVENT_POSITION_BACK = 15,
    TC_EVENT_ATTITUDE_LOST = 16,
    TC_EVENT_TILT = 17,  /* attitude error beyond tilt_err_max for too long */
    TC_EVENT_FENCE = 18, /* vehicle outside the fence */
    TC_EVENT_LINK_LOST_HOLD = 19,
    TC_EVENT_LINK_LOST_LAND = 20,
    TC_EVENT_TIMEOUT = 21,       /* emergency descent took too long */
    TC_EVENT_TRACKING_LOST = 22, /* tracking error beyond the clearance */
    TC_EVENT_RELOCALIZED = 23,   /* the estimate jumped by more than the clearance, or by an unknown amount */
    TC_EVENT_BATTERY_LOW = 24,
    TC_EVENT_SHADOW = 25,     /* tc_shadow: compute while another controller flies */
    TC_EVENT_ENGAGE = 26,     /* tc_engage: take over in flight */
    TC_EVENT_RELEASE = 27,    /* tc_release: give back in flight */
    TC_EVENT_SHADOW_END = 28, /* tc_shadow_end: on the ground, back in command */
    TC_EVENT_CRASHED = 29,    /* lies on the ground, and not as a landing leaves it */
    TC_EVENT_COUNT = 30
} tc_event;

typedef struct {
    uint8_t state;          /* tc_mission_state */
    uint8_t previous_state; /* before the last transition */
    uint8_t reason;         /* tc_reason of the last transition */
    uint32_t transitions;   /* how many there have been */
    uint64_t since_us;      /* when the state was entered */
} tc_mission;

void tc_mission_init(tc_mission* mission);

/* TC_OK when the event is legal in this state (then the state has changed, or the event says to stay);
   TC_WRONG_STATE otherwise, with nothing changed. `reason` is recorded when the state changes. */
tc_reason tc_mission_post(tc_mission* mission, uint8_t event, tc_reason reason, uint64_t time_us);

/* The position loop or the emergency loop is running. */
static inline bool tc_mission_in_air(uint8_t state) { return state >= TC_TAKE_OFF && state <= TC_EMERGENCY; }
/* The set-point comes from the trajectory. */
static inline bool tc_mission_on_path(uint8_t state) { return state >= TC_TRAJECTORY && state <= TC_ABORTING; }
static inline bool tc_mission_rotors_on(uint8_t state) { return state >= TC_ARMED && state <= TC_EMERGENCY; }

const char* tc_mission_state_text(uint8_t state);
const char* tc_command_text(uint8_t command);

#ifdef __cplusplus
}
#endif

#endif
