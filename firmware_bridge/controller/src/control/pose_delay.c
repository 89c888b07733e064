/* Two delays by normalised gradients. */
#include "goshawk_controller/pose_delay.h"

#include "../base/maths.h"

/* Below, the pose is right and the IMU drifts. */
static const float SLOW_VELOCITY_RAD_S = 4.0f;
static const float SLOW_ATTITUDE_RAD_S = 1.0f;
/* Time over which motion is remembered, and the prior: as much motion must be seen before half a delay is believed. The
   accelerometer's noise adds up to 5 ms in a second, the gyro's to a fraction of one. */
static const float VELOCITY_MEMORY_S = 30.0f, VELOCITY_PRIOR_M2_S3 = 200.0f;
static const float ATTITUDE_MEMORY_S = 4.0f, ATTITUDE_PRIOR_RAD2_S = 0.1f;
/* Of a step: its rate and acceleration are means of the ends of its two ticks, which are half a tick ahead. */
static const float LEAD = 0.25f;
static const float LEAST_S = -0.02f;       /* stamps that say too much, */
static const float MOST_S = 0.08f;         /* ... or too little */
static const float LARGEST_MISSING = 0.4f; /* m/s or rad: more is no delay but a jump, and the comparison begins anew */

void tc_pose_delay_reset(tc_pose_delay* d) { memset(d, 0, sizeof *d); }

/* Recursive least squares: `missing` is -delay times `motion` where some delay is left. */
static void follow(tc_delay_fit* fit, const float missing[3], const float motion[3], float memory_s, float prior,
                   float time_s) {
    fit->motion += time_s * (tc_dot(motion, motion) - fit->motion / memory_s);
    const float step = -time_s * tc_dot(missing, motion) / (fit->motion + prior);
    fit->delay_s = tc_clamp(fit->delay_s + step, LEAST_S, MOST_S);
}

static bool jumped(const float missing[3]) { return !(tc_dot(missing, missing) < LARGEST_MISSING * LARGEST_MISSING); }

/* Integrals of acceleration with the corrections of a slow filter of second order; the motion takes the same one. */
static void compare_velocity(tc_pose_delay* d, const tc_pose_compared* now, float lead_s) {
    const float slow = tc_min(SLOW_VELOCITY_RAD_S * d->velocity_s, 0.5f);
    const float slower = 0.25f * SLOW_VELOCITY_RAD_S * slow;
    float missing[3], motion[3];
    for (int i = 0; i < 3; i++) {
        d->velocity_world_m_s[i] += d->gained_m_s[i] + d->velocity_s * d->bias_m_s2[i];
        d->slow_m_s2[i] += d->velocity_s * d->slower_m_s3[i];
        motion[i] = now->planned_world_m_s2[i] - d->slow_m_s2[i];
        missing[i] = now->velocity_world_m_s[i] - d->velocity_world_m_s[i];
        d->velocity_world_m_s[i] += slow * missing[i];
        d->bias_m_s2[i] += slower * missing[i];
        d->slow_m_s2[i] += slow * motion[i];
        d->slower_m_s3[i] += slower * motion[i];
        d->gained_m_s[i] = 0.0f;
        missing[i] += lead_s * motion[i];
    }
    const float prior = VELOCITY_PRIOR_M2_S3 * tc_max(now->noise_m2_s4, 1.0f);
    if (jumped(missing)) d->started = false;
    if (d->started) follow(&d->velocity, missing, motion, VELOCITY_MEMORY_S, prior, d->velocity_s);
    d->velocity_s = 0.0f;
}

static void compare_attitude(tc_pose_delay* d, const float q[4], const float rate[3], float lead_s) {
    const float back[4] = {d->q_world_body[0], -d->q_world_body[1], -d->q_world_body[2], -d->q_world_body[3]};
    const float slow = tc_min(SLOW_ATTITUDE_RAD_S * d->attitude_s, 1.0f);
    float turn[4], motion[3];
    tc_q_multiply(back, q, turn);
    const float twice = turn[0] < 0.0f ? -2.0f : 2.0f;
    for (int i = 0; i < 3; i++) {
        const float ahead = lead_s * rate[i];
        d->missing_rad[i] += twice * turn[i + 1] - d->turned_rad[i] + ahead - slow * d->missing_rad[i];
        d->slow_rad_s[i] += slow * (rate[i] - d->slow_rad_s[i]);
        motion[i] = rate[i] - d->slow_rad_s[i];
        d->turned_rad[i] = ahead;
    }
    tc_copy4(d->q_world_body, q);
    if (jumped(d->missing_rad)) d->started = false;
    if (d->started)
        follow(&d->attitude, d->missing_rad, motion, ATTITUDE_MEMORY_S, ATTITUDE_PRIOR_RAD2_S, d->attitude_s);
}

static void start(tc_pose_delay* d, const tc_pose_compared* now, float lead_s) {
    const tc_delay_fit attitude = d->attitude, velocity = d->velocity;
    memset(d, 0, sizeof *d);
    d->attitude = attitude;
    d->velocity = velocity;
    tc_copy(d->velocity_world_m_s, now->velocity_world_m_s);
    tc_copy4(d->q_world_body, now->q_world_body);
    tc_copy(d->slow_m_s2, now->planned_world_m_s2);
    tc_copy(d->slow_rad_s, now->rate_body_rad_s);
    for (int i = 0; i < 3; i++) d->turned_rad[i] = lead_s * now->rate_body_rad_s[i];
    d->started = true;
}

bool tc_pose_delay_step(tc_pose_delay* d, const tc_pose_compared* now, float step_s) {
    const float lead_s = LEAD * step_s;
    if (!d->started) {
        if (now->may_compare) start(d, now, lead_s);
        return now->may_compare;
    }
    d->velocity_s += step_s;
    d->attitude_s += step_s;
    for (int i = 0; i < 3; i++) {
        d->turned_rad[i] += step_s * now->rate_body_rad_s[i];
        d->gained_m_s[i] += step_s * now->acceleration_world_m_s2[i];
    }
    if (!now->may_compare || !(d->attitude_due || now->fresh)) return false;
    if (d->attitude_due) {
        compare_attitude(d, now->q_world_body, now->rate_body_rad_s, lead_s);
        d->attitude_due = false;
        d->attitude_s = 0.0f;
    } else {
        compare_velocity(d, now, lead_s);
        d->attitude_due = true;
    }
    return true;
}
