/* A controller whose vehicle follows its set-point exactly, but for what a case spoils. */
#ifndef SAFETY_RIG_H
#define SAFETY_RIG_H

#include "../../src/mission/internal.h"
#include "cases.h"

#define TICK_US 5000u
#define TICK_S 0.005f
#define TC_TEST_PI 3.14159265f

typedef struct {
    tc_controller c;
    tc_estimate e;
    tc_output output;
    uint64_t now_us;
    bool detached; /* the estimate stays as it is, but for its time stamps */
    bool no_position, no_attitude, no_gyro;
    float offset_m[3]; /* of the position, from the set-point */
    float climb_m_s;   /* added to the vertical velocity */
    float tilt_rad;    /* of the attitude, about x, off the reference */
    uint32_t silent;   /* 0: the operator is heard at every tick */
} rig;

extern rig g;

void tick(void);
void ticks(float seconds);
float until(uint8_t state, float most);
void enters(uint8_t state, float first, float last, tc_reason reason, const char* what);
void order(tc_command command, float value);
void set(void (*change)(tc_parameters*));
void upload_plan(uint8_t link_loss_policy);
void start_in(uint8_t state, uint8_t link_loss_policy);

#endif
