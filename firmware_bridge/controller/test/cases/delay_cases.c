/* The delay of a pose on a circle, found against an IMU without noise. */
#include <math.h>

#include "cases.h"
#include "goshawk_controller/pose_delay.h"

static const float TURNS_RAD_S = 1.25f; /* of 10 m/s on 8 m */
static const float SPEED_M_S = 10.0f;
static const float YAW_RAD = 0.5f; /* to and fro */

static float phase(float time_s) { return TURNS_RAD_S * time_s; }

/* As the controller does: each other tick the means of two, of acceleration and rate; the pose is carried by what has
   been found so far. */
static tc_pose_delay found(float position_late_s, float attitude_late_s, float tick_s, float flown_s) {
    tc_pose_delay d;
    tc_pose_delay_reset(&d);
    bool compared = false;
    for (int tick = 0; (float)tick * tick_s < flown_s; tick += 2) {
        const float at_s = (float)tick * tick_s;
        float velocity[3] = {0}, planned[3] = {0}, acceleration[3] = {0}, rate[3] = {0};
        const float seen_s = at_s - position_late_s + d.attitude.delay_s + d.velocity.delay_s;
        const float turned_s = at_s - attitude_late_s + d.attitude.delay_s;
        for (int i = 0; i < 2; i++) {
            const float shift = i == 0 ? 0.0f : 1.57079633f;
            velocity[i] = SPEED_M_S * sinf(phase(seen_s) + shift);
            planned[i] = SPEED_M_S * TURNS_RAD_S * cosf(phase(at_s) + shift);
            for (int j = 0; j < 2; j++) {
                acceleration[i] += 0.5f * SPEED_M_S * TURNS_RAD_S * cosf(phase(at_s - (float)j * tick_s) + shift);
            }
        }
        for (int j = 0; j < 2; j++) rate[2] += 0.5f * YAW_RAD * TURNS_RAD_S * cosf(phase(at_s - (float)j * tick_s));
        const float yaw = YAW_RAD * sinf(phase(turned_s));
        const float q[4] = {cosf(0.5f * yaw), 0.0f, 0.0f, sinf(0.5f * yaw)};
        const tc_pose_compared now = {velocity, q, acceleration, planned, rate, 0.0f, true, !compared};
        compared = tc_pose_delay_step(&d, &now, 2.0f * tick_s);
    }
    return d;
}

void delay_cases(void) {
    static const float ticks_s[] = {0.005f, 0.002f, 0.001f};
    static const float late_s[] = {0.0f, 0.02f};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 2; j++) {
            const tc_pose_delay d = found(late_s[j], 0.0f, ticks_s[i], 240.0f);
            must(fabsf(d.velocity.delay_s + d.attitude.delay_s - late_s[j]) < 4e-4f, "as late as the velocity is");
            must(fabsf(d.attitude.delay_s) < 4e-4f, "and no attitude");
            const tc_pose_delay both = found(late_s[j], late_s[j], ticks_s[i], 240.0f);
            must(fabsf(both.attitude.delay_s - late_s[j]) < 4e-4f, "an attitude that is late, too");
            must(fabsf(both.velocity.delay_s) < 4e-4f, "no further delay of the velocity");
        }
    }
}
