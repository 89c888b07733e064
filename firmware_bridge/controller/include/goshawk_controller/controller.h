/* The controller as a whole: three functions to integrate.

       tc_controller controller;                          // yours: static, no heap
       tc_init(&controller);                              // once; then tc_parameters_set(...)
       tc_tick(&controller, now_us, &estimate, &output);  // at the control rate, 200 Hz .. 4 kHz (*)
       tc_link_receive / tc_link_transmit                 // link.h: bytes in, bytes out

   (*) With the disturbance observer 400 Hz and above: at 200 Hz the error of 4.7 mm becomes 9.

   Ground side requests (the link calls these too): tc_do, tc_upload_*, tc_parameters_set, tc_ground_alive.
   All calls on one controller come from one thread, or under one lock. */
#ifndef GOSHAWK_CONTROLLER_CONTROLLER_H
#define GOSHAWK_CONTROLLER_CONTROLLER_H

#include "goshawk_controller/attitude.h"
#include "goshawk_controller/flatness.h"
#include "goshawk_controller/landing.h"
#include "goshawk_controller/mission.h"
#include "goshawk_controller/mixer.h"
#include "goshawk_controller/monitor.h"
#include "goshawk_controller/observer.h"
#include "goshawk_controller/parameters.h"
#include "goshawk_controller/pose_delay.h"
#include "goshawk_controller/position.h"
#include "goshawk_controller/shaping.h"
#include "goshawk_controller/supervisor.h"
#include "goshawk_controller/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What of an estimate holds, bits of tc_estimate.valid. What is not marked is neither looked at nor checked. */
enum {
    TC_VALID_POSITION_XY = 1,
    TC_VALID_POSITION_Z = 2,
    TC_VALID_VELOCITY_XY = 4,
    TC_VALID_VELOCITY_Z = 8,
    TC_VALID_ATTITUDE = 16,
    TC_VALID_RATE = 32,
    TC_VALID_SPECIFIC_FORCE = 64,
    TC_VALID_ROTOR_SPEED = 128,
    TC_VALID_POSE = 63, /* all but the accelerometer and the rotors */
    TC_VALID_ALL = 127  /* all but the rotors, whose speeds few vehicles measure */
};

/* What the autopilot's estimator knows. Three groups, each with the time it was true at, on the clock of tc_tick:
   position and velocity may stop while attitude goes on, and attitude while the gyro does. Zeroed, nothing is valid. */
typedef struct {
    uint64_t position_time_us; /* position and velocity */
    uint64_t attitude_time_us;
    uint64_t rate_time_us; /* gyro and accelerometer */
    float position_world_m[3];
    float velocity_world_m_s[3];
    float q_world_body[4];              /* w x y z */
    float rate_body_rad_s[3];           /* gyro, bias removed */
    float specific_force_body_m_s2[3];  /* accelerometer, bias removed: +9.8 along body z at rest on level ground */
    float rotor_speed_rad_s[TC_ROTORS]; /* measured, as ESCs report them; without them the model's lag is taken */
    /* Standard deviations: horizontal, vertical. 0 = not told; beyond position_std_m, velocity_std_m_s (parameters)
       they make the axis count as not valid. */
    float position_std_m[2];
    float velocity_std_m_s[2];
    float battery_v; /* 0 = not measured */
    uint8_t valid;   /* TC_VALID_ bits */
    /* Relocalization. One more whenever the estimator moved its frame: position, velocity and heading changed by the
       amounts below without the vehicle moving. One that was missed (counter + 2) counts as a jump of unknown size. */
    uint8_t reset_counter;
    float reset_position_world_m[3]; /* new minus old, at the last reset */
    float reset_velocity_world_m_s[3];
    float reset_yaw_rad;
} tc_estimate;

typedef struct {
    float rotor_speed_rad_s[TC_ROTORS]; /* 0 when stopped, else within [rotor_idle or rotor_min, rotor_max] */
    uint8_t saturation;                 /* TC_SATURATED_ bits */
    uint8_t state;                      /* tc_mission_state */
    bool in_command; /* false in TC_SHADOW: another controller flies, these speeds are for the log only */
} tc_output;

/* Bits of tc_telemetry.warnings. */
enum {
    TC_WARNING_BATTERY = 1,
    TC_WARNING_DEAD_RECKONING = 2,
    TC_WARNING_CLOCK = 4,
    TC_WARNING_GYRO_ONLY = 8,
    TC_WARNING_NO_OBSERVER = 64 /* no accelerometer: disturbances are not cancelled */
};

/* Bits of tc_telemetry.estimate_faults: unusable, this tick's sample is not finite, implausible, not valid or too
   uncertain; stale, the last usable one is older than the parameter stale_s. */
enum {
    TC_FAULT_POSITION_STALE = 1,
    TC_FAULT_POSITION_UNUSABLE = 2,
    TC_FAULT_ATTITUDE_STALE = 4,
    TC_FAULT_ATTITUDE_UNUSABLE = 8,
    TC_FAULT_RATE_STALE = 16,
    TC_FAULT_RATE_UNUSABLE = 32
};

/* All of the last tick, for telemetry and the flight log. */
typedef struct {
    uint64_t time_us;
    uint8_t state;  /* tc_mission_state */
    uint8_t reason; /* tc_reason of the last transition */
    uint8_t saturation;
    uint8_t estimate_faults; /* TC_FAULT_ bits */
    tc_estimate estimate; /* as used: carried forward to the tick; its time stamps are those of the last good halves */
    tc_setpoint setpoint;
    tc_flatness_state flatness;    /* the attitude asked for */
    float rate_reference_rad_s[3]; /* how it turns, in the body axes of the estimate */
    tc_wrench wrench;              /* as demanded */
    float rotor_speed_rad_s[TC_ROTORS];
    float path_rate;       /* 1 = as planned, 0 = standing on the path */
    float path_limit;      /* what the supervisor leaves of the rate asked for, 0 .. 1 */
    uint8_t limit_reason;  /* tc_reason: why that is less than 1, else TC_OK */
    uint8_t warnings;      /* TC_WARNING_ bits */
    uint8_t landing_stage; /* tc_landing_stage */
    float reckoning_s;     /* how long position has been dead reckoned, 0 = measured */
    float reckoning_std_m; /* standard deviation that the horizontal position has grown to by that */
    uint32_t path_time_us; /* since the trajectory's start */
    uint32_t ticks;
    uint32_t refused_ticks; /* time went back, stood still, or jumped by more than 20 ms */
} tc_telemetry;

/* When samples of one kind were true. */
typedef struct {
    uint64_t stamp_us; /* of the newest usable sample, on the caller's clock */
    uint64_t true_us;  /* the same moment in controller time */
    uint64_t age_us;   /* how old it was when it came: what an implausible stamp after a clock step is replaced by */
} tc_sample_time;

/* The horizontal or the vertical part of position and velocity. */
typedef struct {
    tc_sample_time position; /* an old position may come with a stamp before that of a newer velocity */
    tc_sample_time velocity;
} tc_position_time;

/* What is read most often stands first: a Cortex-M reaches a float in one instruction within a kilobyte. */
typedef struct {
    tc_parameters parameters;
    tc_telemetry telemetry; /* its time_us is controller time: accepted steps added up, what all timers run on */

    /* Estimate. */
    float axes[3][3];         /* of the estimated attitude: body x, y, z in world coordinates */
    float felt_m_s2[3];       /* specific force, low-passed over 20 ms */
    float support_m_s2;       /* upward acceleration that the thrust asked for does not explain, low-passed over 1 s */
    float rise_m_s;           /* of the last tick */
    float battery_v;          /* low-passed */
    float hover_thrust_n;     /* averaged: what the vehicle really takes to hover */
    float hover_s;            /* over so long */
    float ground_z_m;         /* where it last stood */
    float mean_rate_rad_s[3]; /* that the attitude is carried by */

    /* Commands to the rotors. */
    float slow_speed_rad_s[TC_ROTORS]; /* the mixer's, filtered: what the rotors are taken to do */
    float drag_world_n[3];             /* of the model, in this tick */
    float cancelled_n_m[3];            /* torque against modelled moments, in this tick */

    /* What was asked for, and what follows from the parameters. */
    float time_scale; /* path rate */
    float take_off_m;
    float tilt_bound; /* 1 - cos(tilt_error_rad) */

    /* Time. */
    uint64_t caller_us;        /* of the last tick, on the caller's clock */
    uint64_t step_us;          /* of this tick */
    uint64_t good_step_us;     /* the last possible one */
    uint64_t clock_fault_us;   /* controller time of the last impossible step */
    uint64_t good_since_us;    /* estimate without any fault since */
    uint64_t position_good_us; /* when position was last not stale */
    uint64_t gyro_good_us;     /* when the gyro last gave all axes */
    uint64_t observed_us;      /* stamp of the pose that was last compared with the IMU */
    uint64_t moved_us;         /* when the vehicle last moved, turned or fell; 0 = never */
    uint64_t uncrashed_us;     /* when it was last upright, or turned */
    uint64_t tilt_good_us;     /* when the attitude error was last small */
    uint64_t ground_seen_us;

    uint8_t stalled_ticks; /* in which the caller's clock has stood, or was behind */
    uint8_t reset_counter; /* of the estimate, as last followed, */
    uint8_t seen_counter;  /* ... and of the last tick */
    uint8_t drag_source;   /* tc_velocity_source */
    uint8_t airflow_source;
    bool had_estimate;
    bool vertical_velocity; /* measured, not dead reckoned */
    bool turning_known;
    bool ground_ever_seen;
    bool battery_low;  /* never taken back in flight */
    bool has_moments;  /* of the modelled moments any is not zero */
    bool has_lead;     /* rotor lag, battery or moments: speeds are filtered and corrected */
    bool has_integral; /* of the integrator's gains any is not zero */
    bool configured;
    bool was_flying;

    tc_position_time horizontal, vertical;
    tc_sample_time attitude, rate;

    tc_observer observer;
    tc_pose_delay delay;
    /* For an axis that the gyro does not give: body rate by torque and attitudes, now and at the last attitude, which
       was stamped so; the rotors' torque as they lag. */
    float turning_rad_s[3], turned_rad_s[3], last_q[4], lagging_n_m[3];
    uint64_t turning_us;

    tc_monitor monitor;
    tc_landing landing;
    tc_position_state position;
    tc_mission mission;
    tc_supervisor supervisor;
    tc_clock clock;
    tc_move move;
    tc_mixer mixer;
    tc_store store;
} tc_controller;

/* Everything zero, default parameters, disarmed and not configured: arming is refused until tc_parameters_set. */
void tc_init(tc_controller* controller);

/* One control step. `time_us` is the caller's clock. `output` is always filled with finite speeds in range, whatever
   the estimate or the clock hold. Returns TC_OK, or what was wrong with the call: a stale or unusable estimate, or
   TC_TIME_WENT_BACK for a step that is not within (0, 20 ms]: a clock that is up to 20 ms behind is waited for during
   at most eight ticks of no length, and any other step is taken to be as long as the last good one. */
tc_reason tc_tick(tc_controller* controller, uint64_t time_us, const tc_estimate* estimate, tc_output* output);

/* A command from the ground; refusals leave everything as it was. `value`: see tc_command. */
tc_reason tc_do(tc_controller* controller, tc_command command, float value);

/* In flight, beside another controller (calls of the integrator, not of the ground):
   shadow: from disarmed, compute and log every tick, command nothing (output.in_command is false). No command but KILL
     is taken there, and KILL puts this controller in command of stopped rotors;
   shadow_end: back to disarmed, which is in command of stopped rotors: only while the vehicle stands. Refused above
     0.5 m/s and 0.5 rad/s; a hover looks like standing, so that the caller must know;
   engage: from shadow or disarmed, take over a flying vehicle. Needs an estimate that has been good for a second, tilt
     below 35 degrees, body rate below 2 rad/s, speed below 5 m/s; the set-point starts at the vehicle's own state,
   brakes and holds. `rotor_speed_rad_s`: what the rotors do now, where the first command starts from (NULL: not known);
   release: from any flying state back to shadow: the other controller flies from the next output on, e.g. because the
     pilot moved the sticks. */
tc_reason tc_shadow(tc_controller* controller);
tc_reason tc_shadow_end(tc_controller* controller);
tc_reason tc_engage(tc_controller* controller, const float rotor_speed_rad_s[TC_ROTORS]);
tc_reason tc_release(tc_controller* controller);

/* Whether the vehicle may be armed now: TC_OK, or the first thing in the way. */
tc_reason tc_arming_check(const tc_controller* controller);

/* All parameters at once, or nothing: range of each, then geometry. Those not marked in_flight only when disarmed.
   New path limits or a new fence make the store forget its trajectories: they were checked against the old ones. In the
   air a mass that the rotors cannot hover with, or that differs by more than a fifth, is refused. */
tc_reason tc_parameters_set(tc_controller* controller, const tc_parameters* parameters);
const tc_parameters* tc_parameters_now(const tc_controller* controller);

/* The upload: as in trajectory.h. Staging works in flight; activation is refused while the active slot is flown. */
tc_reason tc_upload_begin(tc_controller* controller, const tc_trajectory_header* header);
tc_reason tc_upload_origin(tc_controller* controller, const tc_origin* origin);
tc_reason tc_upload_segment(tc_controller* controller, uint16_t index, const tc_segment* segment);
tc_reason tc_upload_sample(tc_controller* controller, const tc_trajectory_sample* sample);
void tc_upload_check_ahead(tc_controller* controller);
tc_reason tc_upload_finish(tc_controller* controller); /* TC_BUSY: call again */
/* TC_SLOT_IN_USE while another trajectory than this one is flown: known before any work. */
tc_reason tc_upload_may_activate(const tc_controller* controller, uint32_t id, uint32_t crc32);
tc_reason tc_upload_activate(tc_controller* controller, uint32_t id, uint32_t crc32);

/* The operator in control was last received so long ago (0: just now): call for every accepted message, or in every
   tick; silence for link_loss_s is a lost link. */
void tc_ground_alive(tc_controller* controller, uint64_t ago_us);

const tc_telemetry* tc_telemetry_now(const tc_controller* controller);
/* What it finds of forces and torques that are not modelled. */
const tc_observer* tc_observer_now(const tc_controller* controller);

#ifdef __cplusplus
}
#endif

#endif
