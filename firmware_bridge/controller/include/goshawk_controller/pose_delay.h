/* How much later than its stamps the pose is: found against the IMU, and taken off.

   A pose that is late by d shows the attitude short by d times the body rate, and the velocity by d times the
   acceleration. Both are compared with the integrals of gyro and accelerometer, slow parts taken out on both sides, and
   recursive least squares give d. Only motion shows it: in hover the last value stays. */
#ifndef GOSHAWK_CONTROLLER_POSE_DELAY_H
#define GOSHAWK_CONTROLLER_POSE_DELAY_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float delay_s, motion; /* squared motion, over the time that is remembered */
} tc_delay_fit;

/* What one step works with: the pose carried to now by the delays known, and what moved. */
typedef struct {
    const float* velocity_world_m_s;
    const float* q_world_body;
    const float* acceleration_world_m_s2; /* by the accelerometer */
    const float* planned_world_m_s2;      /* that of the set-point: without noise, which would pass for a delay */
    const float* rate_body_rad_s;
    float noise_m2_s4; /* variance of one axis of the accelerometer */
    bool fresh;        /* with a pose that has not been compared */
    bool may_compare;  /* else this step only sums up what moved, once begun */
} tc_pose_compared;

typedef struct {
    tc_delay_fit attitude; /* beyond its stamp and predict_extra_s */
    tc_delay_fit velocity; /* of position and velocity, beyond that of the attitude */
    /* Velocity: the accelerometer's integral and its slow correction; acceleration through the same filter. */
    float velocity_world_m_s[3], bias_m_s2[3], slow_m_s2[3], slower_m_s3[3];
    /* Attitude: at the last pose, what the gyro has turned since, what is missing, and the rate's slow part. */
    float q_world_body[4], turned_rad[3], missing_rad[3], slow_rad_s[3];
    float gained_m_s[3];          /* by the accelerometer, since the last pose */
    float velocity_s, attitude_s; /* since when each was compared */
    bool attitude_due;            /* after the velocity, so that no tick does both */
    bool started;
} tc_pose_delay;

void tc_pose_delay_reset(tc_pose_delay* delay);

/* Returns whether it compared, or began to: it took its turn. */
bool tc_pose_delay_step(tc_pose_delay* delay, const tc_pose_compared* now, float step_s);

#ifdef __cplusplus
}
#endif

#endif
