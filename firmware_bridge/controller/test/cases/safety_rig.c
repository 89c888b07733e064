#include "safety_rig.h"

#include <math.h>
#include <string.h>

rig g;

void tick(void) {
    const tc_telemetry* t = &g.c.telemetry;
    tc_estimate* e = &g.e;
    g.now_us += TICK_US;
    if (!g.detached && tc_mission_in_air(g.c.mission.state)) {
        memcpy(e->position_world_m, t->setpoint.position_world_m, sizeof e->position_world_m);
        memcpy(e->velocity_world_m_s, t->setpoint.velocity_world_m_s, sizeof e->velocity_world_m_s);
        memcpy(e->q_world_body, t->flatness.q_reference, sizeof e->q_world_body);
        for (int i = 0; i < 3; i++) e->position_world_m[i] += g.offset_m[i];
        e->velocity_world_m_s[2] += g.climb_m_s;
        e->specific_force_body_m_s2[2] = t->wrench.thrust_n / g.c.parameters.mass_kg;
    }
    if (g.tilt_rad > 0.0f || g.tilt_rad < 0.0f) { /* q times a turn about x */
        const float c = cosf(0.5f * g.tilt_rad), s = sinf(0.5f * g.tilt_rad);
        const float* q = t->flatness.q_reference;
        const float turned[4] = {q[0] * c - q[1] * s, q[1] * c + q[0] * s, q[2] * c + q[3] * s, q[3] * c - q[2] * s};
        memcpy(e->q_world_body, turned, sizeof turned);
    }
    if (!g.no_position) e->position_time_us = g.now_us;
    if (!g.no_attitude) e->attitude_time_us = g.now_us;
    if (!g.no_gyro) e->rate_time_us = g.now_us;
    if (g.silent == 0u) tc_ground_alive(&g.c, 0u);
    (void)tc_tick(&g.c, g.now_us, e, &g.output);
}

void ticks(float seconds) {
    for (float s = 0.0f; s < seconds - 0.5f * TICK_S; s += TICK_S) tick();
}

/* Seconds until the state is entered; 1e9 when that takes longer than `most`. */
float until(uint8_t state, float most) {
    for (unsigned i = 0; (float)i * TICK_S < most; i++) {
        if (g.c.mission.state == state) return (float)i * TICK_S;
        tick();
    }
    return g.c.mission.state == state ? most : 1e9f;
}

/* Enters `state` between these times, with this reason. */
void enters(uint8_t state, float first, float last, tc_reason reason, const char* what) {
    const float after = until(state, last + 1.0f);
    must(after >= first - 0.0001f && after <= last + 0.0001f, what);
    must(g.c.mission.reason == (uint8_t)reason, "with its reason");
}

void order(tc_command command, float value) { must(tc_do(&g.c, command, value) == TC_OK, "the order is taken"); }

void set(void (*change)(tc_parameters*)) {
    tc_parameters p = *tc_parameters_now(&g.c);
    change(&p);
    must(tc_parameters_set(&g.c, &p) == TC_OK, "parameters are taken");
}

void upload_plan(uint8_t link_loss_policy) {
    static tc_trajectory plan;
    short_plan(&plan, link_loss_policy);
    must(tc_upload_begin(&g.c, &plan.header) == TC_OK, "opened");
    for (uint16_t i = 0; i < 2u; i++) must(tc_upload_segment(&g.c, i, &plan.segment[i]) == TC_OK, "a segment");
    tc_reason reason = TC_BUSY;
    while (reason == TC_BUSY) reason = tc_upload_finish(&g.c);
    must(reason == TC_OK, "checked");
    must(tc_upload_activate(&g.c, plan.header.id, plan.header.crc32) == TC_OK, "active");
}

void start_in(uint8_t state, uint8_t link_loss_policy) {
    tc_parameters p;
    memset(&g, 0, sizeof g);
    g.now_us = 1000000u;
    g.e.valid = TC_VALID_ALL;
    g.e.q_world_body[0] = 1.0f;
    g.e.specific_force_body_m_s2[2] = 9.81f;
    tc_init(&g.c);
    tc_parameters_default(&p);
    p.monitor = 0.0f; /* a vehicle that follows its set-point exactly has no IMU to speak of */
    must(tc_parameters_set(&g.c, &p) == TC_OK, "presets are accepted");
    upload_plan(link_loss_policy);
    ticks(0.1f);
    must(g.c.telemetry.warnings == 0u, "nothing to warn of");
    if (state == TC_DISARMED) return;
    order(TC_COMMAND_ARM, 0.0f);
    tick();
    if (state == TC_ARMED) return;
    order(TC_COMMAND_TAKE_OFF, 1.0f);
    tick();
    if (state == TC_TAKE_OFF) return;
    must(until(TC_HOLD, 10.0f) < 10.0f, "hovers");
    ticks(1.0f);
    if (state == TC_HOLD) return;
    order(TC_COMMAND_START, 0.0f);
    if (state == TC_APPROACH) return;
    must(until(TC_TRAJECTORY, 10.0f) < 10.0f, "flies the path");
    if (state == TC_TRAJECTORY) return;
    ticks(0.5f);
    order(TC_COMMAND_PAUSE, 0.0f);
    if (state == TC_PAUSED) must(until(TC_PAUSED, 10.0f) < 10.0f, "paused");
}
