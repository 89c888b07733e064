/* The controller as a whole: three functions to integrate.

       tc_controller controller;                          // yours: static, no heap
       tc_init(&controller);                              // once; then tc_parameters_set(...)
       tc_tick(&controller, now_us, &estimate, &output);  // at the control rate, 200 Hz .. 4 kHz
       tc_link_receive / tc_link_transmit                 // link.h: bytes in, bytes out

   Ground side requests (the link calls these too): tc_do, tc_upload_*, tc_parameters_set, tc_ground_alive.
   All calls on one controller come from one thread, or under one lock. */
#ifndef GOSHAWK_CONTROLLER_CONTROLLER_H
#define GOSHAWK_CONTROLLER_CONTROLLER_H

#include "goshawk_controller/attitude.h"
#include "goshawk_controller/flatness.h"
#include "goshawk_controller/mission.h"
#include "goshawk_controller/mixer.h"
#include "goshawk_controller/parameters.h"
#include "goshawk_controller/position.h"
#include "goshawk_controller/shaping.h"
#include "goshawk_controller/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What the autopilot knows. Position and velocity have their own time stamp: they may stop while attitude goes on. */
typedef struct {
    uint64_t position_time_us; /* when position and velocity were true; same clock as tc_tick */
    uint64_t attitude_time_us;
    float position_world_m[3];
    float velocity_world_m_s[3];
    float q_world_body[4]; /* w x y z */
    float rate_body_rad_s[3];
    float battery_v; /* 0 = not measured */
} tc_estimate;

typedef struct {
    float rotor_speed_rad_s[TC_ROTORS]; /* 0 when stopped, else within [rotor_idle or rotor_min, rotor_max] */
    uint8_t saturation;                 /* TC_SATURATED_ bits */
    uint8_t state;                      /* tc_mission_state */
} tc_output;

/* All of the last tick, for telemetry and the flight log. */
typedef struct {
    uint64_t time_us;
    uint8_t state;  /* tc_mission_state */
    uint8_t reason; /* tc_reason of the last transition */
    uint8_t saturation;
    uint8_t estimate_faults; /* bit 0 position stale, 1 position not finite, 2 attitude stale, 3 attitude not finite */
    tc_estimate estimate; /* as used: carried forward to the tick; its time stamps are those of the last good halves */
    tc_setpoint setpoint;
    tc_flatness_state flatness;    /* the attitude asked for */
    float rate_reference_rad_s[3]; /* how it turns, in the body axes of the estimate */
    tc_wrench wrench;              /* as demanded */
    float rotor_speed_rad_s[TC_ROTORS];
    float path_rate;        /* 1 = as planned, 0 = standing on the path */
    uint32_t path_time_us;  /* since the trajectory's start */
    uint32_t trajectory_id; /* active slot, 0 = none */
    uint32_t trajectory_crc32;
    uint32_t ticks;
    uint32_t refused_ticks; /* time went back, or too long a step */
} tc_telemetry;

typedef struct {
    tc_parameters parameters;
    tc_mixer mixer;
    tc_mission mission;
    tc_clock clock;
    tc_position_state position;
    tc_telemetry telemetry;
    float ground_z_m;                  /* height of the take-off point */
    float time_scale;                  /* path rate asked for */
    float take_off_m;                  /* height asked for */
    float axes[3][3];                  /* of the estimated attitude: body x, y, z in world coordinates */
    float tilt_bound;                  /* 1 - cos(tilt_error_rad) */
    float slow_speed_rad_s[TC_ROTORS]; /* the mixer's, filtered: what the rotors are taken to do */
    uint8_t drag_source;               /* tc_velocity_source, as in the parameters */
    uint8_t airflow_source;
    bool has_moments;  /* of the modelled moments any is not zero */
    bool has_lead;     /* rotor lag, battery or moments: speeds are filtered and corrected */
    bool has_integral; /* of the integrator's gains any is not zero */
    bool was_flying;
    bool busy; /* the set-point of the last tick has led to another state or move: this one begins it */
    bool configured;
    bool ground_ever_seen;
    uint32_t ground_seen_us; /* low words of times: what they are asked about lasts half an hour at the most */
    uint32_t bad_tilt_since_us;
    uint32_t touching_since_us;
    tc_move move;
    tc_store store; /* last, the move before: what every tick touches lies close together in front of them */
} tc_controller;

/* Everything zero, default parameters, disarmed and not configured: arming is refused until tc_parameters_set. */
void tc_init(tc_controller* controller);

/* One control step. `output` is always filled with finite speeds in range, whatever the estimate holds. Returns TC_OK,
   or why the tick could not be a normal one (stale or NaN estimate, time went back: then the last output is repeated).
 */
tc_reason tc_tick(tc_controller* controller, uint64_t time_us, const tc_estimate* estimate, tc_output* output);

/* A command from the ground; refusals leave everything as it was. `value`: see tc_command. */
tc_reason tc_do(tc_controller* controller, tc_command command, float value);

/* All parameters at once, or nothing: range of each, then geometry. Those not marked in_flight only when disarmed.
   New path limits or a new fence make the store forget its trajectories: they were checked against the old ones. */
tc_reason tc_parameters_set(tc_controller* controller, const tc_parameters* parameters);
const tc_parameters* tc_parameters_now(const tc_controller* controller);

/* Memory in which a set of parameters may be put together before tc_parameters_set: the staged slot. It begins as a
   copy of the present ones; NULL while an upload is open. An upload that begins takes it back: ask tc_parameters_staged
   each time (NULL: it is gone, nothing was changed). tc_parameters_drop gives it up. */
tc_parameters* tc_parameters_stage(tc_controller* controller);
tc_parameters* tc_parameters_staged(tc_controller* controller);
void tc_parameters_drop(tc_controller* controller);

/* The upload: as in trajectory.h. Staging works in flight; activation is refused while the active slot is flown. */
tc_reason tc_upload_begin(tc_controller* controller, const tc_trajectory_header* header);
tc_reason tc_upload_origin(tc_controller* controller, const tc_origin* origin);
tc_reason tc_upload_segment(tc_controller* controller, uint16_t index, const tc_segment* segment);
tc_segment* tc_upload_place(tc_controller* controller, uint16_t index);
tc_reason tc_upload_sample(tc_controller* controller, const tc_trajectory_sample* sample);
tc_reason tc_upload_finish(tc_controller* controller);
tc_reason tc_upload_activate(tc_controller* controller, uint32_t id, uint32_t crc32);

/* Call for every accepted message of the operator in control; silence for link_loss_s is a lost link. */
void tc_ground_alive(tc_controller* controller, uint64_t time_us);

const tc_telemetry* tc_telemetry_now(const tc_controller* controller);

#ifdef __cplusplus
}
#endif

#endif
