/* The tracking supervisor: how much of the rate asked for the path may be flown at.

   With c the clearance that the planner proved, the path clock runs at full rate while the tracking error is below
   0.3 c, slows down linearly to a stop at 0.7 c, and goes on once the error is below 0.35 c again. A vehicle that is
   ahead of its set-point is not slowed. Beyond c for 0.3 s, or 2 s at a stop without coming nearer, the path is given
   up. While position is dead reckoned the path brakes to a stop, too.

   After a relocalization (tc_estimate.reset_counter) the path moves with the estimate, so that nothing jumps, and
   returns to where it was checked within some seconds. The shift counts as tracking error, and beyond c the path is
   stopped: a shifted path is not a checked one. */
#ifndef GOSHAWK_CONTROLLER_SUPERVISOR_H
#define GOSHAWK_CONTROLLER_SUPERVISOR_H

#include "goshawk_controller/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float stage[3];     /* three low-passes in a row: the limit of the rate is the last one, smooth and within [0, 1] */
    float limit[4];     /* that limit and its first three time derivatives */
    float target;       /* what they follow, */
    float ramp_1_s;     /* ... so fast */
    bool stopped;       /* until the error is below 0.35 c */
    uint8_t reason;     /* tc_reason: what limits, TC_OK when nothing does */
    float error_m;      /* tracking error that counts: not ahead, the shift included */
    float tangent[3];   /* of the path, the last one known */
    float nearest_m;    /* smallest error since it stands */
    uint64_t within_us; /* when the error was last within c */
    uint64_t approaching_us;  /* when it last moved, or came nearer */
    float shift[TC_AXES];     /* of the path: x, y, z, yaw; decays */
    float shift_1_s[TC_AXES]; /* how it changes */
} tc_supervisor;

/* Starts anew: full rate, no shift. */
void tc_supervisor_reset(tc_supervisor* supervisor, uint64_t time_us);

/* How fast the path may be flown, from now on. `setpoint` is the last one, flown at `path_rate` (all limits included);
   `tracking` is false while position is dead reckoned; `ramp_1_s` how fast the limit may follow. */
void tc_supervisor_judge(tc_supervisor* supervisor, const tc_setpoint* setpoint, float path_rate,
                         const float position_world_m[3], float clearance_m, bool tracking, float ramp_1_s,
                         uint64_t time_us);

/* A step of the limit and of the shift. */
void tc_supervisor_step(tc_supervisor* supervisor, float step_s);

/* The estimate has moved its frame: the path moves along. */
void tc_supervisor_shift(tc_supervisor* supervisor, const float position_m[3], const float velocity_m_s[3],
                         float yaw_rad);

/* Adds the shift and its derivatives to a set-point of the path. */
void tc_supervisor_apply_shift(const tc_supervisor* supervisor, tc_setpoint* setpoint);

/* Whether the error has been too large for too long. */
bool tc_supervisor_gives_up(const tc_supervisor* supervisor, uint64_t time_us);

#ifdef __cplusplus
}
#endif

#endif
