/* The ground where the estimate does not show it, and sensors that lie: what is certain, after how long, and what
   takes it back. */
#include <math.h>
#include <string.h>

#include "safety_rig.h"

static bool near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

/* -- landing, step by step ----------------------------------------------------------------------------------------- */

static float force_m_s2; /* of the accelerometer, and what its low-pass has come to */

static float weight(void) { return g.c.parameters.mass_kg * g.c.parameters.gravity_m_s2; }

/* Comes down at 0.8 m/s by an estimate that goes on sinking, or not. */
static void begin(uint8_t state, float velocity_m_s) {
    tc_controller* c = &g.c;
    start_in(TC_DISARMED, 0);
    c->mission.state = state;
    c->telemetry.estimate.position_world_m[2] = 5.0f;
    c->telemetry.setpoint.position_world_m[2] = 5.0f;
    c->telemetry.estimate.velocity_world_m_s[2] = velocity_m_s;
    c->telemetry.wrench.thrust_n = c->hover_thrust_n = weight();
    c->vertical_velocity = true;
    c->support_m_s2 = 0.0f;
    tc_landing_begin(c);
    force_m_s2 = c->landing.force_m_s2 = c->parameters.gravity_m_s2;
}

static bool step(void) {
    tc_controller* c = &g.c;
    c->telemetry.time_us += TICK_US;
    c->telemetry.estimate.specific_force_body_m_s2[2] = force_m_s2;
    if (c->mission.state == TC_LANDING) tc_landing_setpoint(c, TICK_S);
    return tc_landing_observe(c, TICK_S);
}

/* Seconds until it is down; 1e9 if not within so long. */
static float down(float most_s) {
    for (float s = 0.0f; s < most_s; s += TICK_S) {
        if (step()) return s;
    }
    return 1e9f;
}

static float reaches(uint8_t stage, float most_s) {
    for (float s = 0.0f; s < most_s; s += TICK_S) {
        if (g.c.landing.stage == stage) return s;
        (void)step();
    }
    return 1e9f;
}

/* Into the UNLOAD that follows two seconds without sinking. */
static void begin_sure(void) {
    begin(TC_LANDING, -0.8f);
    g.c.telemetry.estimate.rate_body_rad_s[0] = 0.55f; /* turns: no contact that is felt */
    g.c.landing.speed_m_s = 0.8f;
    const float after_s = reaches(TC_LANDING_UNLOAD, 5.0f);
    must(after_s >= 2.0f && after_s < 2.02f && g.c.landing.sure, "two seconds without coming lower");
}

static void sure_ground(void) {
    begin_sure();
    must(near(down(1.0f), 0.5f, 0.02f), "is the ground once the rotors give a tenth");
    begin_sure();
    g.c.telemetry.estimate.position_world_m[2] -= 0.14f;
    must(near(down(1.0f), 0.5f, 0.02f), "wherever the estimate drifts");
    begin_sure();
    g.c.telemetry.estimate.position_world_m[2] -= 0.16f;
    (void)step();
    must(g.c.landing.stage == TC_LANDING_DESCEND, "it has fallen");
    begin_sure();
    force_m_s2 = 0.0f;
    must(reaches(TC_LANDING_DESCEND, 0.3f) < 0.3f, "it falls, by the accelerometer");
    begin_sure();
    g.c.telemetry.estimate.valid = TC_VALID_POSE;
    force_m_s2 = 0.0f;
    must(near(down(1.0f), 0.5f, 0.02f), "where there is one");
}

static void hit_while_unloading(void) {
    begin_sure();
    force_m_s2 = 30.0f;
    const float early_s = down(1.0f);
    must(early_s > 0.15f && early_s < 0.2f, "a hit is the ground below 0.7 of the weight");
    begin_sure();
    force_m_s2 = 30.0f;
    g.c.monitor.shake_m2_s4 = 1e5f;
    must(near(down(1.0f), 0.5f, 0.02f), "what vibration may be is no hit");
}

/* An UNLOAD that is sure, in which the height sinks by so much, while the accelerometer shows so much of the weight. */
static uint8_t after_sinking(float sunk_m, float felt, uint8_t valid) {
    begin_sure();
    g.c.telemetry.estimate.valid = valid;
    for (float s = 0.0f; s < 0.3f; s += TICK_S) (void)step();
    force_m_s2 = g.c.landing.force_m_s2 = felt * g.c.parameters.gravity_m_s2;
    g.c.telemetry.estimate.position_world_m[2] -= sunk_m;
    (void)step();
    return g.c.landing.stage;
}

static void sinks_while_carried(void) {
    must(after_sinking(0.14f, 0.4f, TC_VALID_ALL) == (uint8_t)TC_LANDING_UNLOAD, "0.14 m are no fall");
    must(after_sinking(0.16f, 0.4f, TC_VALID_ALL) == (uint8_t)TC_LANDING_DESCEND, "0.16 m are, where nothing carries");
    must(after_sinking(0.16f, 1.0f, TC_VALID_ALL) == (uint8_t)TC_LANDING_UNLOAD, "but not where something does");
    must(after_sinking(0.38f, 1.0f, TC_VALID_POSE) == (uint8_t)TC_LANDING_UNLOAD, "untold, 0.24 m are its 0.8 m/s");
    must(after_sinking(0.40f, 1.0f, TC_VALID_POSE) == (uint8_t)TC_LANDING_DESCEND, "more are a fall");
}

static void stands(void) {
    begin(TC_LANDING, -0.8f);
    g.c.support_m_s2 = 2.35f;
    (void)reaches(TC_LANDING_UNLOAD, 0.5f);
    must(g.c.landing.stage == TC_LANDING_DESCEND && !tc_stands(&g.c), "less than a quarter of the weight");
    begin(TC_LANDING, -0.8f);
    g.c.support_m_s2 = 2.55f;
    must(near(reaches(TC_LANDING_UNLOAD, 0.5f), 0.3f, 0.02f) && g.c.landing.sure, "something else carries it");
    static const struct {
        float thrust, velocity;
        bool felt, known, counts;
    } cases[] = {{0.65f, -0.9f, true, true, true},  {0.75f, -0.9f, true, true, false},
                 {0.65f, -1.1f, true, true, false}, {0.65f, 1.1f, true, true, false},
                 {0.65f, -0.9f, false, true, true}, {0.65f, -0.9f, true, false, false}};
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        begin(TC_LANDING, cases[i].velocity);
        g.c.rise_m_s = cases[i].velocity;
        g.c.telemetry.wrench.thrust_n = cases[i].thrust * weight();
        g.c.telemetry.estimate.valid = cases[i].felt ? TC_VALID_ALL : TC_VALID_POSE;
        g.c.vertical_velocity = cases[i].known;
        for (int k = 0; k < 2000; k++) tc_measure_support(&g.c, TICK_S);
        must(tc_stands(&g.c) == cases[i].counts,
             "measured where it neither falls nor climbs fast, accelerometer or not");
    }
}

/* What carries it beside the thrust asked for, low-passed over a second. */
static void support(void) {
    begin(TC_LANDING, -0.2f);
    g.c.rise_m_s = -0.2f;
    g.c.telemetry.wrench.thrust_n = 0.2f * weight();
    const float missing = 0.8f * g.c.parameters.gravity_m_s2;
    tc_measure_support(&g.c, TICK_S);
    must(near(g.c.support_m_s2, TICK_S / (1.0f + TICK_S) * missing, 1e-4f), "the fall that is missing");
    begin(TC_LANDING, -0.2f);
    g.c.rise_m_s = -0.2f + TICK_S * missing;
    g.c.telemetry.wrench.thrust_n = 0.2f * weight();
    tc_measure_support(&g.c, TICK_S);
    must(near(g.c.support_m_s2, 0.0f, 1e-4f), "none where it falls as its thrust says");
    g.c.telemetry.wrench.thrust_n = weight();
    g.c.support_m_s2 = 5.0f;
    tc_measure_support(&g.c, TICK_S);
    must(near(g.c.support_m_s2, 5.0f / (1.0f + TICK_S), 1e-4f), "is forgotten in flight");
}

/* A frozen pose seems to stand, for 0.05 s of new stamps without new numbers. */
static void frozen(void) {
    for (int running = 0; running < 2; running++) {
        for (int old = 0; old < 2; old++) {
            begin(TC_LANDING, -0.1f);
            g.c.landing.speed_m_s = 0.8f;
            float s = 0.0f;
            while (s < 0.6f && g.c.landing.stage == TC_LANDING_DESCEND) {
                g.c.monitor.running = running == 1;
                g.c.monitor.changed_us = g.c.telemetry.time_us - (old == 1 ? 55000u : 40000u);
                (void)step();
                s += TICK_S;
            }
            const bool stands = g.c.landing.stage == TC_LANDING_UNLOAD;
            must(stands == (running == 0 || old == 0), "what may be frozen tells nothing of the ground");
        }
    }
}

static void sliding(void) {
    static const float along[4][2] = {{0.4f, 0.4f}, {0.55f, 0.1f}, {-0.1f, 0.55f}, {0.4f, -0.2f}};
    for (int i = 0; i < 4; i++) {
        begin(TC_LANDING, -0.8f);
        g.c.telemetry.estimate.rate_body_rad_s[0] = 0.55f;
        memcpy(g.c.telemetry.estimate.velocity_world_m_s, along[i], sizeof along[i]);
        const bool taken = reaches(TC_LANDING_UNLOAD, 4.0f) < 4.0f;
        must(taken == (i == 3), "what flies along comes no lower, either");
        begin(TC_LANDING, -0.8f);
        g.c.support_m_s2 = 5.0f;
        memcpy(g.c.telemetry.estimate.velocity_world_m_s, along[i], sizeof along[i]);
        must((reaches(TC_LANDING_UNLOAD, 0.4f) < 0.4f) == (i == 3), "nor has it landed on what it slides along");
        begin(TC_EMERGENCY, -0.8f);
        g.c.telemetry.estimate.rate_body_rad_s[0] = 0.55f;
        memcpy(g.c.telemetry.estimate.velocity_world_m_s, along[i], sizeof along[i]);
        must(reaches(TC_LANDING_UNLOAD, 5.0f) < 5.0f, "but by a speed that is dead reckoned");
    }
}

static void slowly_lower(void) {
    begin(TC_LANDING, -0.8f);
    g.c.telemetry.estimate.rate_body_rad_s[0] = 0.55f;
    for (int i = 0; i < 4; i++) { /* 0.11 m in 1.9 s */
        for (float s = 0.0f; s < 1.9f; s += TICK_S) (void)step();
        g.c.telemetry.estimate.position_world_m[2] -= 0.11f;
        (void)step();
        must(g.c.landing.stage == TC_LANDING_DESCEND, "a tenth of a metre in two seconds is a descent");
    }
    for (float s = 0.0f; s < 1.9f; s += TICK_S) (void)step();
    g.c.telemetry.estimate.position_world_m[2] -= 0.09f;
    must(reaches(TC_LANDING_UNLOAD, 0.2f) < 0.2f, "less is none");
}

static void unsupported(void) {
    begin(TC_LANDING, 0.0f);
    g.c.landing.speed_m_s = 0.8f;
    must(reaches(TC_LANDING_UNLOAD, 1.0f) < 1.0f && !g.c.landing.sure, "no speed is contact");
    force_m_s2 = 14.0f;
    for (int i = 0; i < 50; i++) (void)step();
    force_m_s2 = 3.0f;
    must(reaches(TC_LANDING_DESCEND, 0.4f) < 0.4f, "neither falls nor is carried: it comes down once more");
}

static void restless_on_the_ground(void) {
    begin(TC_LANDING, 0.0f);
    must(reaches(TC_LANDING_IDLE, 2.0f) < 2.0f, "stands");
    g.c.telemetry.estimate.rate_body_rad_s[0] = 0.6f;
    const float after_s = down(5.0f);
    must(after_s > 1.0f && after_s < 3.0f, "shaken for ever, it is down as it comes no lower");
}

/* Hits of 0.1 s, three a second, and a fall between them that is never taken for the ground. */
static float bounce(float seconds, float gap_s) {
    for (float s = 0.0f; s < seconds; s += TICK_S) {
        force_m_s2 = fmodf(s, gap_s) < 0.1f ? 40.0f : -10.0f;
        if (step()) return s;
    }
    return 1e9f;
}

static void bouncing(void) {
    begin(TC_EMERGENCY, 0.0f);
    g.c.vertical_velocity = false;
    const float after_s = bounce(6.0f, 0.33f);
    must(after_s > 2.0f && after_s < 2.8f, "three hits and two seconds end a blind descent");
    must(g.c.landing.impacts == 3u, "no more are counted");
    begin(TC_EMERGENCY, 0.0f);
    g.c.vertical_velocity = true;
    g.c.landing.touched = true;
    must(bounce(2.0f, 0.33f) > 2.0f || g.c.landing.stage != TC_LANDING_DESCEND,
         "one that sees its height goes by that");
}

/* Blind but for the gyro after `felt_s`: seconds from then on until it is down, where the body turns by `share` of what
   the torque says. */
static float answers(float share, float most_s, float lag_s, float felt_s) {
    begin(TC_EMERGENCY, 0.0f);
    tc_controller* c = &g.c;
    c->vertical_velocity = false;
    c->parameters.rotor_lag_s = lag_s;
    c->parameters.lead_filter_s = 0.025f;
    float lagged_n_m = 0.0f;
    for (float s = -felt_s; s < most_s; s += TICK_S) {
        c->telemetry.estimate.valid = s < 0.0f ? TC_VALID_ALL : TC_VALID_POSE;
        const float rate = c->telemetry.estimate.rate_body_rad_s[0];
        const float torque_n_m = tc_landing_test_torque(c) - 28.0f * c->parameters.inertia_kg_m2[0] * rate;
        c->telemetry.wrench.torque_n_m[0] = torque_n_m;
        lagged_n_m += TICK_S / (0.025f + TICK_S) * (torque_n_m - lagged_n_m);
        c->telemetry.estimate.rate_body_rad_s[0] += share * TICK_S * lagged_n_m / c->parameters.inertia_kg_m2[0];
        if (step()) return s;
    }
    return 1e9f;
}

static void answer_to_a_torque(void) {
    must(answers(1.0f, 20.0f, 0.0f, 0.0f) > 20.0f, "what turns as its torque says is in the air");
    must(answers(1.0f, 20.0f, 0.03f, 0.0f) > 20.0f, "also by a lag that is known");
    must(near(answers(0.0f, 20.0f, 0.0f, 0.0f), 2.34f, 0.1f), "what does not turn stands on its feet");
    must(near(answers(0.0f, 20.0f, 0.0f, 0.8f), 2.34f, 0.1f), "counted from the accelerometer's loss");
    begin(TC_EMERGENCY, 0.0f);
    must(near(tc_landing_test_torque(&g.c), 0.0f, 1e-9f), "with vertical velocity there is no test");
    g.c.vertical_velocity = false;
    g.c.telemetry.estimate.valid = TC_VALID_ALL;
    must(near(tc_landing_test_torque(&g.c), 0.0f, 1e-9f), "nor with an accelerometer");
    g.c.telemetry.estimate.valid = TC_VALID_POSE;
    must(tc_landing_test_torque(&g.c) > 0.0f, "first one way");
    g.c.telemetry.time_us += 120000u;
    must(tc_landing_test_torque(&g.c) < 0.0f, "then the other");
    g.c.mission.state = TC_LANDING;
    must(near(tc_landing_test_torque(&g.c), 0.0f, 1e-9f), "in an emergency only");
}

/* -- lies -----------------------------------------------------------------------------------------------------------
 */

static void watch(tc_parameters* p) { p->monitor = 1.0f; }
static void no_margin(tc_parameters* p) { p->plan_margin_m = 0.0f; }
static void small_margin(tc_parameters* p) { p->plan_margin_m = 0.05f; }

static void lies(void) {
    start_in(TC_HOLD, 0);
    set(watch);
    ticks(0.1f);
    g.c.monitor.final = true;
    g.c.monitor.reason = TC_POSE_VELOCITY;
    enters(TC_EMERGENCY, 2.0f, 2.3f, TC_POSE_VELOCITY, "a lie that lasts");
    start_in(TC_HOLD, 0);
    set(watch);
    ticks(0.1f);
    g.c.monitor.drift_m[0] = 0.45f;
    enters(TC_LANDING, 0.0f, 0.02f, TC_POSE_DRIFTS, "a slow one");
    start_in(TC_HOLD, 0);
    g.e.rate_body_rad_s[1] = NAN;
    enters(TC_LANDING, 0.5f, 0.52f, TC_GYRO_AXIS, "an axis of the gyro");
    ticks(0.2f);
    must(g.c.mission.state == TC_LANDING && near(g.c.telemetry.estimate.rate_body_rad_s[1], 0.0f, 0.3f), "is replaced");
}

static void grounded(void) {
    start_in(TC_HOLD, 0);
    g.c.support_m_s2 = 4.1f;
    enters(TC_LANDING, 0.0f, 0.02f, TC_GROUNDED, "stands on something, and has to notice");
    start_in(TC_TAKE_OFF, 0);
    g.c.support_m_s2 = 4.1f;
    ticks(0.02f);
    must(g.c.mission.state == TC_TAKE_OFF, "but before it has left the ground");
}

static void crash(void) {
    start_in(TC_HOLD, 0);
    g.tilt_rad = 0.51f;
    ticks(1.0f);
    must(g.c.mission.state == TC_HOLD, "less than 30 degrees off");
    g.tilt_rad = 0.54f;
    enters(TC_FAULT, 0.5f, 0.52f, TC_CRASHED, "more, and does not turn");
    start_in(TC_HOLD, 0);
    g.tilt_rad = 0.54f;
    g.e.rate_body_rad_s[0] = 1.1f;
    ticks(1.0f);
    must(g.c.mission.state == TC_HOLD, "it turns");
}

static void box_of_the_plan(void) {
    for (int axis = 0; axis < 3; axis++) {
        for (int side = -1; side <= 1; side += 2) {
            start_in(TC_TRAJECTORY, 0);
            set(small_margin);
            ticks(0.05f);
            must(g.c.mission.state == TC_TRAJECTORY, "within it");
            const tc_trajectory* plan = tc_store_active(&g.c.store);
            const float edge_m = side < 0 ? plan->least_m[axis] - 0.07f : plan->most_m[axis] + 0.07f;
            g.offset_m[axis] = edge_m - g.c.telemetry.setpoint.position_world_m[axis];
            tick();
            must(g.c.mission.reason == (uint8_t)TC_FENCE_BREACH, "beyond the plan's box and its margin");
            start_in(TC_TRAJECTORY, 0);
            set(no_margin);
            g.offset_m[axis] = 0.4f * (float)side;
            ticks(0.05f);
            must(g.c.mission.state == TC_TRAJECTORY, "without a margin there is no box");
        }
    }
}

/* The hover at a path's end is kept in its box, another hover is not: it may be anywhere within the fence. */
static void box_after_the_plan(void) {
    for (int after = 0; after < 2; after++) {
        start_in(TC_TRAJECTORY, 0);
        set(small_margin);
        ticks(0.05f);
        const tc_trajectory* plan = tc_store_active(&g.c.store);
        const float edge_m = plan->most_m[1] + 0.07f;
        g.c.mission.state = TC_HOLD;
        g.c.mission.previous_state = after == 1 ? TC_TRAJECTORY : TC_TAKE_OFF;
        g.offset_m[1] = edge_m - g.c.telemetry.setpoint.position_world_m[1];
        tick();
        const bool breach = g.c.mission.reason == (uint8_t)TC_FENCE_BREACH;
        must(breach == (after == 1), "hovering after the path, and after a take-off");
    }
}

void ground_cases(void) {
    sure_ground();
    hit_while_unloading();
    sinks_while_carried();
    stands();
    support();
    frozen();
    sliding();
    slowly_lower();
    unsupported();
    restless_on_the_ground();
    bouncing();
    answer_to_a_torque();
    lies();
    grounded();
    crash();
    box_of_the_plan();
    box_after_the_plan();
}
