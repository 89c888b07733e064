/* What the case files share: a check that counts, a short plan, a vehicle that does as it is told. */
#ifndef CASES_H
#define CASES_H

#include "goshawk_controller/link.h"

/* Aborts with these words unless it holds. */
void must(bool holds, const char* what);

void mission_cases(void);
void landing_cases(void);
void ground_cases(void);
void emergency_cases(void);
void mixer_cases(void);
void reaction_cases(void);
void safety_cases(void);
void shaping_cases(void);
void supervisor_cases(void);
void delay_cases(void);
void link_cases(void);
void standard_cases(void);
void presentation_cases(void);

/* Two segments: a metre up and back within 3 s, in place. `crc32` of it goes into the header. */
void short_plan(tc_trajectory* plan, uint8_t link_loss_policy);

/* What the estimator says besides the truth. */
typedef struct {
    bool no_position, no_attitude, no_gyro; /* stale */
    bool bad_position;                      /* not finite */
    float tilt;                             /* rotation about x as a quaternion's x */
    float offset_m;                         /* added to world x */
    float floor_m;                          /* it cannot get lower */
    float drift_m_s;                        /* along world x, as estimated */
} trouble;

/* Ticks at 100 Hz with an estimate that follows the set-point; the last state. */
uint8_t run(tc_controller* c, uint64_t* time_us, float seconds, const trouble* t);

/* A configured controller with an active short plan, in `state` (disarmed to hold, or trajectory). */
void set_out(tc_controller* c, uint64_t* time_us, uint8_t link_loss_policy, uint8_t state);

#endif
