/* Reference shaping: how fast the path is flown, and moves from point to point.

   The path clock maps time to path time with a rate between 0 (standing) and 1 (as planned). Changing the rate follows
   a quintic, so that path velocity, acceleration and jerk stay continuous and every derivative of the set-point is
   consistent with it: p' = p_theta theta', p'' = p_theta_theta theta'^2 + p_theta theta'', and so on. */
#ifndef GOSHAWK_CONTROLLER_SHAPING_H
#define GOSHAWK_CONTROLLER_SHAPING_H

#include "goshawk_controller/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint32_t path_us;   /* whole microseconds of path time */
    float path_part_us; /* [0, 1) on top */
    float rate[4];      /* d path time / d time, and its first three derivatives */
    float target_rate;
    float ramp_s;      /* duration of the last change of rate */
    float ramp_left_s; /* of it; 0 = the rate stands */
    float ramp[3];     /* rate - target_rate over x = left / ramp_s is x^3 times this parabola: it ends flat */
    float flown[4];    /* rate and derivatives with the supervisor's limit: what the path is flown at */
    uint16_t segment;  /* cursor: the segment that holds path_us */
} tc_clock;

void tc_clock_start(tc_clock* clock, float rate);
/* Changes to `target_rate` within `ramp_s` (> 0), continuing from the present rate and its derivatives. */
void tc_clock_retarget(tc_clock* clock, float target_rate, float ramp_s);
/* Advances by at most 20 ms at the rate times `limit` (a factor and its first three time derivatives), and moves the
   cursor. */
void tc_clock_advance(tc_clock* clock, const tc_trajectory* trajectory, const float limit[4], float step_s);
bool tc_clock_standing(const tc_clock* clock);
bool tc_clock_finished(const tc_clock* clock, const tc_trajectory* trajectory);
/* The set-point on the path with derivatives with respect to true time. */
void tc_clock_setpoint(const tc_clock* clock, const tc_trajectory* trajectory, tc_setpoint* out);

/* A move to rest at a point: a septic per axis that goes on from any set-point with position, velocity, acceleration
   and jerk unbroken. Take-off, landing, hovering and the way to a trajectory's start are all moves. */
typedef struct {
    float septic[TC_AXES][TC_MAX_COEFFICIENTS]; /* x, y, z, yaw over left / duration; where it has no term: zeros */
    float duration_s;
    float left_s;
} tc_move;

/* To a point; from rest the peak speed is `speed_m_s` (> 0), peak yaw rate 1 rad/s, peak acceleration 2 m/s^2. */
void tc_move_start(tc_move* move, const tc_setpoint* from, const float to_world_m[3], float to_yaw_rad,
                   float speed_m_s);
/* To rest as soon as `brake_m_s2` (> 0) allows, straight ahead. */
void tc_move_stop(tc_move* move, const tc_setpoint* from, float brake_m_s2);
/* Moves the whole of it: after a relocalization. */
void tc_move_shift(tc_move* move, const float position_m[3], float yaw_rad);
void tc_move_advance(tc_move* move, float step_s);
bool tc_move_done(const tc_move* move);
void tc_move_setpoint(const tc_move* move, tc_setpoint* out);

#ifdef __cplusplus
}
#endif

#endif
