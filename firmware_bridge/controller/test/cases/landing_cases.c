/* The stages of the land detector and the tracking supervisor by their numbers, called step by step: what begins a
   stage, what ends it, and after how long. */
#include <math.h>
#include <string.h>

#include "../../src/mission/internal.h"
#include "cases.h"

#define STEP_US 2000u
#define STEP_S 0.002f

static tc_controller c;
static bool stuck; /* the position does not follow the velocity: that is biased */

static bool near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

/* -- landing ---------------------------------------------------------------------------------------------------- */

/* A vehicle that comes down as commanded, with or without an accelerometer. */
static void begin(uint8_t state, bool accelerometer) {
    tc_parameters p;
    stuck = false;
    tc_init(&c);
    tc_parameters_default(&p);
    must(tc_parameters_set(&c, &p) == TC_OK, "presets are accepted");
    c.mission.state = state;
    c.telemetry.time_us = 3000000u;
    c.telemetry.setpoint.position_world_m[2] = 5.0f;
    c.telemetry.estimate.position_world_m[2] = 5.0f;
    c.telemetry.estimate.q_world_body[0] = 1.0f;
    c.telemetry.estimate.valid = accelerometer ? TC_VALID_ALL : TC_VALID_POSE;
    c.telemetry.estimate.specific_force_body_m_s2[2] = p.gravity_m_s2;
    c.axes[0][0] = c.axes[1][1] = c.axes[2][2] = 1.0f;
    c.vertical_velocity = true;
    c.hover_thrust_n = c.telemetry.wrench.thrust_n = p.mass_kg * p.gravity_m_s2;
    c.step_us = STEP_US;
    tc_landing_begin(&c);
    c.landing.force_m_s2 = p.gravity_m_s2;
}

static float weight(void) { return c.parameters.mass_kg * c.parameters.gravity_m_s2; }

static void step(void) {
    tc_estimate* e = &c.telemetry.estimate;
    c.telemetry.time_us += STEP_US;
    if (!stuck) e->position_world_m[2] += e->velocity_world_m_s[2] * STEP_S;
    if (c.mission.state == TC_LANDING) tc_landing_setpoint(&c, STEP_S);
    if (tc_landing_observe(&c, STEP_S)) (void)tc_post(&c, TC_EVENT_TOUCHDOWN, TC_TOUCHDOWN); /* as tc_observe does */
}

/* Steps until the stage, at most so long; how long it took, or 1e9. */
static float reaches(uint8_t stage, float most_s) {
    for (float s = 0.0f; s < most_s; s += STEP_S) {
        if (c.landing.stage == stage) return s;
        step();
    }
    return 1e9f;
}

static bool within(float value, float first, float last) { return value >= first - 1e-4f && value <= last + 1e-4f; }

/* The estimate follows the command for so long. */
static void come_down(float seconds) {
    for (float s = 0.0f; s < seconds; s += STEP_S) {
        c.telemetry.estimate.velocity_world_m_s[2] = -c.landing.speed_m_s;
        step();
    }
}

/* Stands on something from now on: no vertical speed, and what the floor gives. */
static void touch(void) {
    c.telemetry.estimate.velocity_world_m_s[2] = 0.0f;
    c.telemetry.estimate.specific_force_body_m_s2[2] = c.parameters.gravity_m_s2;
}

static void descent(void) {
    begin(TC_LANDING, true);
    must(c.landing.stage == TC_LANDING_DESCEND && near(c.landing.speed_m_s, 0.0f, 0.0f), "begins at rest");
    come_down(0.2f);
    must(near(c.landing.speed_m_s, 0.4f, 0.01f), "speeds up by 2 m/s^2");
    must(near(c.telemetry.setpoint.velocity_world_m_s[2], -0.4f, 0.01f), "downwards");
    come_down(1.8f);
    must(near(c.landing.speed_m_s, 0.8f + 0.02f * 2.0f, 0.003f), "the speed asked for, and a little more with time");
    must(near(c.telemetry.setpoint.position_world_m[2], c.telemetry.estimate.position_world_m[2], 0.02f), "no lead");
    must(!c.landing.lead_limited, "none to limit");
    come_down(20.0f);
    must(near(c.landing.speed_m_s, 1.0f, 1e-4f), "up to 1 m/s");
    c.parameters.landing_m_s = 1.5f;
    come_down(3.0f);
    must(near(c.landing.speed_m_s, 1.5f, 1e-4f), "unless more is asked for");
    must(c.landing.stage == TC_LANDING_DESCEND, "a vehicle that follows is not on the ground");
    static const struct {
        float brake_m_s2, after_m_s;
    } falls[] = {{4.0f, 4.0f}, {0.5f, 5.0f}}; /* from 6 m/s, in half a second */
    for (unsigned i = 0; i < 2u; i++) {
        begin(TC_LANDING, true);
        c.landing.speed_m_s = 6.0f;
        c.parameters.brake_m_s2 = falls[i].brake_m_s2;
        come_down(0.5f);
        must(near(c.landing.speed_m_s, falls[i].after_m_s, 0.03f), "a fall is braked as a path is, or by 2 m/s^2");
    }
    begin(TC_LANDING, true);
    c.telemetry.setpoint.velocity_world_m_s[2] = -3.0f;
    c.telemetry.setpoint.acceleration_world_m_s2[2] = c.telemetry.setpoint.jerk_world_m_s3[2] = 9.0f;
    c.telemetry.setpoint.snap_world_m_s4[2] = 9.0f;
    memset(&c.landing, 0x55, sizeof c.landing);
    tc_landing_begin(&c);
    must(!c.landing.touched && !c.landing.lead_limited && near(c.landing.force_m_s2, 0.0f, 0.0f) &&
             near(c.landing.thrust_n, 0.0f, 0.0f),
         "nothing is left of the last descent");
    must(near(c.landing.speed_m_s, 3.0f, 0.0f) && near(c.landing.z_m, 5.0f, 0.0f), "goes on from what it flies");
    must(c.landing.began_us == 3000000u && c.landing.upright_us == 3000000u && c.landing.stage_us == 3000000u &&
             c.landing.airborne_us == 3000000u,
         "all times from now");
    step();
    must(near(c.landing.speed_m_s, 3.0f - c.parameters.brake_m_s2 * STEP_S, 1e-4f), "and brakes as a path does");
    must(near(c.telemetry.setpoint.acceleration_world_m_s2[2], 0.0f, 0.0f) &&
             near(c.telemetry.setpoint.jerk_world_m_s3[2], 0.0f, 0.0f) &&
             near(c.telemetry.setpoint.snap_world_m_s4[2], 0.0f, 0.0f),
         "a velocity, nothing higher");
}

static void contact_times(void) {
    begin(TC_LANDING, true); /* by speed */
    come_down(2.0f);
    touch();
    must(within(reaches(TC_LANDING_UNLOAD, 1.0f), 0.12f, 0.126f), "0.12 s below half the speed");
    begin(TC_LANDING, true);
    come_down(2.0f);
    c.telemetry.estimate.velocity_world_m_s[2] = -0.45f;
    must(reaches(TC_LANDING_UNLOAD, 0.25f) > 0.25f, "above half of it");
    begin(TC_LANDING, true); /* the other way, too: half the speed is what counts */
    come_down(2.0f);
    c.telemetry.estimate.velocity_world_m_s[2] = -0.39f;
    must(within(reaches(TC_LANDING_UNLOAD, 0.5f), 0.12f, 0.126f), "below");
    begin(TC_LANDING, true); /* by lead: the speed is biased */
    come_down(2.0f);
    stuck = true;
    c.telemetry.estimate.velocity_world_m_s[2] = -0.8f;
    const float lead = c.telemetry.estimate.position_world_m[2] - c.landing.z_m;
    const float took = reaches(TC_LANDING_UNLOAD, 2.0f);
    must(within(took, (0.2f - lead) / 0.85f + 0.119f, (0.2f - lead) / 0.84f + 0.126f), "0.2 m ahead");
    must(c.landing.lead_limited, "which is the limit but for noise");
    begin(TC_LANDING, true);
    stuck = true;
    for (int i = 0; i < 600; i++) { /* the lead is held at the limit */
        c.telemetry.estimate.velocity_world_m_s[2] = -0.8f;
        c.telemetry.estimate.rate_body_rad_s[1] = 0.6f;
        step();
        must(c.telemetry.setpoint.position_world_m[2] > 4.7499f, "no more than 0.25 m below the vehicle");
    }
    must(near(c.telemetry.setpoint.position_world_m[2], 4.75f, 1e-4f), "but that much");
    must(c.landing.stage == TC_LANDING_DESCEND, "a vehicle that turns is not on the ground");
    c.telemetry.estimate.rate_body_rad_s[1] = 0.5f;
    must(within(reaches(TC_LANDING_UNLOAD, 1.0f), 0.12f, 0.126f), "unless slowly");
    begin(TC_LANDING, true);
    come_down(2.0f);
    touch();
    c.telemetry.estimate.velocity_world_m_s[0] = 0.3f;
    c.telemetry.estimate.velocity_world_m_s[1] = 0.41f;
    must(reaches(TC_LANDING_UNLOAD, 0.5f) > 0.5f, "nor is one that drifts at 0.5 m/s");
    c.telemetry.estimate.velocity_world_m_s[1] = 0.39f;
    must(within(reaches(TC_LANDING_UNLOAD, 0.5f), 0.12f, 0.126f), "less is");
    begin(TC_LANDING, true);
    touch();
    must(within(reaches(TC_LANDING_UNLOAD, 1.0f), 0.42f, 0.43f), "not within the first 0.3 s");
    begin(TC_LANDING, true); /* while it brakes it keeps its height */
    static const float fast[3][2] = {{0.8f, 0.7f}, {1.05f, 0.1f}, {0.1f, -1.05f}};
    for (int i = 0; i < 3; i++) {
        memcpy(c.telemetry.setpoint.velocity_world_m_s, fast[i], sizeof fast[i]);
        come_down(1.0f);
        must(near(c.landing.speed_m_s, 0.0f, 0.0f), "beyond 1 m/s");
    }
    c.telemetry.setpoint.velocity_world_m_s[0] = 0.65f;
    c.telemetry.setpoint.velocity_world_m_s[1] = 0.7f;
    come_down(0.1f);
    must(near(c.landing.speed_m_s, 0.2f, 6e-3f), "and comes down below");
    begin(TC_LANDING, true);
    come_down(2.0f);
    for (int i = 0; i < 2; i++) { /* contact that does not last */
        touch();
        must(reaches(TC_LANDING_UNLOAD, 0.1f) > 0.1f, "0.1 s are not enough");
        come_down(0.01f);
    }
}

/* In UNLOAD, standing. */
static void unloading(bool accelerometer) {
    begin(TC_LANDING, accelerometer);
    come_down(2.0f);
    touch();
    must(reaches(TC_LANDING_UNLOAD, 1.0f) < 1.0f, "unloads");
}

static void unload_and_idle(void) {
    unloading(true);
    must(near(c.landing.thrust_n, weight(), 1e-4f), "from the weight");
    must(tc_landing_unloads(&c.landing), "the stage's collective holds");
    for (int i = 0; i < 125; i++) step();
    must(near(c.landing.thrust_n, 0.55f * weight(), 0.01f * weight()), "half way after 0.25 s");
    must(near(c.telemetry.setpoint.position_world_m[2], c.telemetry.estimate.position_world_m[2], 1e-6f),
         "the set-point waits at the vehicle");
    const float rest = reaches(TC_LANDING_IDLE, 1.0f);
    must(within(rest, 0.25f, 0.256f), "0.5 s in all");
    must(near(c.landing.thrust_n, 0.1f * weight(), 0.01f * weight()), "to a tenth");
    must(tc_landing_unloads(&c.landing), "still");
    for (int i = 0; i < 149; i++) step();
    must(c.mission.state == TC_LANDING, "0.3 s of stillness");
    for (int i = 0; i < 4; i++) step();
    must(c.mission.state == TC_DISARMED && c.mission.reason == TC_TOUCHDOWN, "then the rotors stop");
    unloading(true);
    must(reaches(TC_LANDING_IDLE, 1.0f) < 1.0f, "idles");
    c.telemetry.estimate.rate_body_rad_s[2] = 0.6f;
    for (int i = 0; i < 500; i++) step();
    must(c.mission.state == TC_LANDING && c.landing.stage == TC_LANDING_IDLE, "not while it turns");
    c.telemetry.estimate.rate_body_rad_s[2] = 0.4f;
    for (int i = 0; i < 140; i++) step();
    must(c.mission.state == TC_LANDING, "counted from when it is still");
    for (int i = 0; i < 14; i++) step();
    must(c.mission.state == TC_DISARMED, "still enough");
    begin(TC_LANDING, true); /* a collective below the weight is where unloading begins, a larger one is not */
    come_down(2.0f);
    touch();
    c.telemetry.wrench.thrust_n = 0.6f * weight();
    must(reaches(TC_LANDING_UNLOAD, 1.0f) < 1.0f && near(c.landing.thrust_n, 0.6f * weight(), 1e-3f), "from there");
    begin(TC_LANDING, true);
    come_down(2.0f);
    touch();
    c.telemetry.wrench.thrust_n = 1.4f * weight();
    must(reaches(TC_LANDING_UNLOAD, 1.0f) < 1.0f && near(c.landing.thrust_n, weight(), 1e-3f), "at most the weight");
    begin(TC_LANDING, true);
    come_down(2.0f);
    touch();
    c.telemetry.wrench.thrust_n = 0.05f * weight();
    must(reaches(TC_LANDING_IDLE, 2.0f) < 2.0f && near(c.landing.thrust_n, 0.05f * weight(), 1e-3f), "never more");
}

static void what_still_flies(void) {
    for (int accelerometer = 0; accelerometer < 2; accelerometer++) { /* by the change of speed, whatever the bias */
        unloading(accelerometer == 1);
        c.telemetry.estimate.velocity_world_m_s[2] = -0.33f;
        for (int i = 0; i < 20; i++) step();
        must(c.landing.stage == TC_LANDING_UNLOAD, "0.33 m/s gained are not enough");
        c.telemetry.estimate.velocity_world_m_s[2] = -0.37f;
        step();
        must(c.landing.stage == TC_LANDING_DESCEND, "0.37 are");
    }
    begin(TC_LANDING, false);
    come_down(2.0f);
    c.telemetry.estimate.velocity_world_m_s[2] = 0.3f; /* biased upwards */
    must(reaches(TC_LANDING_UNLOAD, 1.0f) < 1.0f, "unloads");
    c.telemetry.estimate.velocity_world_m_s[2] = 0.0f;
    step();
    must(c.landing.stage == TC_LANDING_UNLOAD, "gained 0.3");
    c.telemetry.estimate.velocity_world_m_s[2] = -0.06f;
    step();
    must(c.landing.stage == TC_LANDING_DESCEND, "gained 0.36");
    unloading(true); /* by the accelerometer: it falls as the thrust does */
    float when = 0.0f;
    for (int i = 0; i < 250 && c.landing.stage == TC_LANDING_UNLOAD; i++) {
        c.telemetry.estimate.specific_force_body_m_s2[2] = c.landing.thrust_n / c.parameters.mass_kg;
        step();
        when += STEP_S;
    }
    must(c.landing.stage == TC_LANDING_DESCEND && within(when, 0.27f, 0.295f), "after 0.7 m/s of fall");
    unloading(true); /* carried a little */
    for (int i = 0; i < 240 && c.landing.stage == TC_LANDING_UNLOAD; i++) {
        c.telemetry.estimate.specific_force_body_m_s2[2] =
            c.parameters.gravity_m_s2 - 0.6f * (weight() - c.landing.thrust_n) / c.parameters.mass_kg;
        step();
    }
    must(c.landing.stage == TC_LANDING_DESCEND, "more than half of the fall");
    for (int i = 0; i < 4; i++) { /* by the speed where it is measured, in either state */
        unloading(true);
        c.vertical_velocity = i < 2;
        c.mission.state = i % 2 == 0 ? TC_LANDING : TC_EMERGENCY;
        c.telemetry.estimate.velocity_world_m_s[2] = -0.4f;
        step();
        must((c.landing.stage == TC_LANDING_DESCEND) == c.vertical_velocity, "a dead reckoned speed tells nothing");
    }
    unloading(false); /* neither speed nor accelerometer is left to judge by */
    c.vertical_velocity = false;
    c.mission.state = TC_EMERGENCY;
    step();
    must(c.landing.stage == TC_LANDING_DESCEND, "given up");
    begin(TC_LANDING, false); /* so that it does not even try */
    c.vertical_velocity = false;
    must(reaches(TC_LANDING_UNLOAD, 3.0f) > 3.0f, "without any witness");
    unloading(true); /* half carried: it does not fly */
    for (int i = 0; i < 240 && c.landing.stage == TC_LANDING_UNLOAD; i++) {
        c.telemetry.estimate.specific_force_body_m_s2[2] =
            c.parameters.gravity_m_s2 - 0.3f * (weight() - c.landing.thrust_n) / c.parameters.mass_kg;
        step();
    }
    must(c.landing.stage == TC_LANDING_UNLOAD, "a third of the fall");
    unloading(true); /* at the end the floor must have carried it */
    c.telemetry.estimate.specific_force_body_m_s2[2] = c.parameters.gravity_m_s2 - 1.6f; /* gains 0.8 m/s in 0.5 s */
    must(within(reaches(TC_LANDING_DESCEND, 1.0f), 0.42f, 0.46f), "not enough support");
    unloading(true);
    c.telemetry.estimate.specific_force_body_m_s2[2] = c.parameters.gravity_m_s2 - 1.2f; /* 0.6 */
    must(within(reaches(TC_LANDING_IDLE, 1.0f), 0.495f, 0.51f), "enough");
    c.telemetry.estimate.velocity_world_m_s[2] = -0.4f;
    step();
    must(c.landing.stage == TC_LANDING_DESCEND, "what falls now is flying");
    unloading(false);
    must(reaches(TC_LANDING_IDLE, 1.0f) < 0.51f, "without an accelerometer the speed has to do");
    unloading(true); /* the filter of the accelerometer */
    c.landing.force_m_s2 = 0.0f;
    step();
    must(near(c.landing.force_m_s2, c.parameters.gravity_m_s2 * 0.002f / 0.022f, 1e-3f), "20 ms");
    must(reaches(TC_LANDING_DESCEND, 0.3f) < 0.3f || c.landing.stage == TC_LANDING_UNLOAD, "goes on");
    unloading(true); /* then not again at once */
    c.telemetry.estimate.velocity_world_m_s[2] = -0.4f;
    step();
    must(c.landing.stage == TC_LANDING_DESCEND, "flies");
    c.telemetry.estimate.velocity_world_m_s[2] = 0.0f;
    must(within(reaches(TC_LANDING_UNLOAD, 1.0f), 0.42f, 0.43f), "waits 0.3 s");
}

static void emergency_landing(void) {
    begin(TC_EMERGENCY, true); /* with vertical velocity */
    come_down(2.0f);
    must(near(c.landing.speed_m_s, 0.84f, 0.003f), "the same speed");
    touch();
    c.telemetry.estimate.velocity_world_m_s[0] = 2.0f; /* not known to be true: not asked */
    c.landing.lead_limited = true;                     /* nor is a set-point that is not flown */
    must(within(reaches(TC_LANDING_UNLOAD, 1.0f), 0.12f, 0.126f), "the same contact");
    begin(TC_EMERGENCY, true);
    come_down(2.0f);
    c.landing.lead_limited = true;
    c.telemetry.estimate.velocity_world_m_s[2] = -0.45f;
    must(reaches(TC_LANDING_UNLOAD, 0.5f) > 0.5f, "lead is not asked");
    begin(TC_EMERGENCY, true); /* without it: an impact */
    c.vertical_velocity = false;
    come_down(0.5f);
    c.telemetry.estimate.specific_force_body_m_s2[2] = 1.35f * 9.81f;
    must(reaches(TC_LANDING_UNLOAD, 0.2f) > 0.2f, "0.35 g are no impact");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 1.45f * 9.81f;
    must(reaches(TC_LANDING_UNLOAD, 0.2f) < 0.06f, "0.45 g are");
    begin(TC_EMERGENCY, true);
    c.vertical_velocity = false;
    come_down(0.5f);
    c.telemetry.estimate.specific_force_body_m_s2[2] = 0.6f * 9.81f;
    must(reaches(TC_LANDING_UNLOAD, 0.2f) > 0.2f, "less than the weight is none");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 1.5f * 9.81f;
    must(reaches(TC_LANDING_UNLOAD, 0.2f) < 0.1f, "more is");
    c.telemetry.estimate.velocity_world_m_s[2] = -5.0f; /* not known: not asked */
    c.telemetry.estimate.specific_force_body_m_s2[2] = 9.81f;
    step();
    must(c.landing.stage == TC_LANDING_UNLOAD, "unloads");
    begin(TC_EMERGENCY, true);
    c.vertical_velocity = false;
    must(within(reaches(TC_LANDING_UNLOAD, 3.0f), 1.0f, 1.01f), "or every second");
    must(!c.landing.touched, "without an impact");
    begin(TC_EMERGENCY, true); /* more often once something was hit */
    c.vertical_velocity = false;
    come_down(0.2f);
    c.telemetry.estimate.specific_force_body_m_s2[2] = 2.0f * 9.81f;
    come_down(0.09f);
    must(!c.landing.touched && c.landing.stage == TC_LANDING_DESCEND, "not within the first 0.3 s");
    come_down(0.02f);
    must(c.landing.touched == TC_TOUCHED && c.landing.stage == TC_LANDING_UNLOAD, "an impact");
    c.hover_thrust_n = 10.0f;
    must(near(tc_emergency_thrust(&c), 0.8f * 9.6f, 0.05f), "with a fifth less");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 0.0f; /* bounces: it flies */
    must(reaches(TC_LANDING_DESCEND, 0.5f) < 0.5f, "falls");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 9.81f;
    must(c.landing.touched == TC_FALLS_OFF && tc_emergency_thrust(&c) > 9.5f, "with all of it, off an edge");
    must(within(reaches(TC_LANDING_UNLOAD, 1.0f), 0.4f, 0.41f), "tried again after 0.4 s");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 2.0f * 9.81f;
    come_down(0.02f);
    must(c.landing.touched == TC_TOUCHED, "and hits something again");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 9.81f;
    must(reaches(TC_LANDING_IDLE, 0.6f) < 0.6f, "which carries it");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 0.0f;
    must(reaches(TC_LANDING_DESCEND, 0.2f) < 0.2f && c.landing.touched == TC_FALLS_OFF, "and lets it fall");
    c.telemetry.estimate.specific_force_body_m_s2[2] = 9.81f;
    come_down(2.6f);
    must(c.landing.touched == TC_UNTOUCHED, "or nothing for long");
    begin(TC_EMERGENCY, true); /* with vertical velocity an impact is none of this */
    come_down(1.0f);
    c.telemetry.estimate.specific_force_body_m_s2[2] = 2.0f * 9.81f;
    come_down(0.3f);
    must(!c.landing.touched && c.landing.stage == TC_LANDING_DESCEND, "the speed tells");
    begin(TC_EMERGENCY, false);
    c.vertical_velocity = false;
    must(reaches(TC_LANDING_UNLOAD, 3.0f) > 3.0f, "with nothing to feel the ground by, it is not tried");
    begin(TC_EMERGENCY, true);
    c.hover_thrust_n = 7.0f;
    c.landing.speed_m_s = 0.8f;
    const float feedback = c.parameters.kd_z_1_s * 0.1f;
    c.telemetry.estimate.velocity_world_m_s[2] = -0.9f;
    must(near(tc_emergency_thrust(&c), 7.0f + c.parameters.mass_kg * feedback, 1e-3f), "too fast: more thrust");
    c.telemetry.estimate.velocity_world_m_s[2] = -0.7f;
    must(near(tc_emergency_thrust(&c), 7.0f - c.parameters.mass_kg * feedback, 1e-3f), "too slow: less");
    c.telemetry.estimate.velocity_world_m_s[2] = -9.0f;
    must(near(tc_emergency_thrust(&c), 7.0f + c.parameters.mass_kg * 3.0f, 1e-3f), "within 3 m/s^2");
    c.telemetry.estimate.velocity_world_m_s[2] = 9.0f;
    must(near(tc_emergency_thrust(&c), 7.0f - c.parameters.mass_kg * 3.0f, 1e-3f), "either way");
    c.axes[2][2] = 0.8f;
    must(near(tc_emergency_thrust(&c), (7.0f - c.parameters.mass_kg * 3.0f) / 0.8f, 1e-3f), "the vertical part");
    c.axes[2][2] = 0.1f;
    must(near(tc_emergency_thrust(&c), (7.0f - c.parameters.mass_kg * 3.0f) / 0.5f, 1e-3f), "within reason");
    c.vertical_velocity = false;
    c.hover_thrust_n = 10.0f;
    must(near(tc_emergency_thrust(&c), 9.6f, 1e-4f), "blind: a share of what hovering takes");
    c.telemetry.time_us += 10000000u;
    must(near(tc_emergency_thrust(&c), 9.53f, 1e-4f), "0.07 % less a second");
    c.telemetry.estimate.valid = TC_VALID_POSE;
    must(near(tc_emergency_thrust(&c), 9.63f, 1e-4f), "without accelerometer 1 % more, as it is pressed down in turn");
    c.telemetry.estimate.valid = TC_VALID_ALL;
    c.telemetry.time_us += 200000000u;
    must(near(tc_emergency_thrust(&c), 8.8f, 1e-4f), "down to 8 % less");
}

/* Without vertical velocity, falling by what the accelerometer's integral says. */
static void fall_that_is_reckoned(void) {
    begin(TC_EMERGENCY, true);
    c.vertical_velocity = false;
    c.hover_thrust_n = 10.0f;
    c.telemetry.reckoning_s = 4.0f;
    c.telemetry.estimate.velocity_world_m_s[2] = -1.39f;
    must(near(tc_emergency_thrust(&c), 9.6f, 1e-4f), "1 m/s, and 0.1 more for each second");
    const float feedback = c.parameters.mass_kg * c.parameters.kd_z_1_s * 0.1f;
    c.telemetry.estimate.velocity_world_m_s[2] = -1.5f;
    must(near(tc_emergency_thrust(&c), 9.6f + feedback, 1e-3f), "a fall is braked");
    c.telemetry.estimate.velocity_world_m_s[2] = -9.0f;
    must(near(tc_emergency_thrust(&c), 9.6f + 3.0f * c.parameters.mass_kg, 1e-3f), "within 3 m/s^2");
    c.telemetry.reckoning_s = 9.9f;
    must(tc_emergency_thrust(&c) > 11.0f, "for 10 s");
    c.telemetry.reckoning_s = 10.0f;
    must(near(tc_emergency_thrust(&c), 9.6f, 1e-4f), "and no longer");
    c.telemetry.reckoning_s = 4.0f;
    c.telemetry.estimate.valid = TC_VALID_POSE;
    must(near(tc_emergency_thrust(&c), 9.7f, 1e-4f), "not without an accelerometer");
    c.telemetry.estimate.valid = TC_VALID_ALL;
    c.landing.touched = true;
    must(near(tc_emergency_thrust(&c), 0.8f * 9.6f + 3.0f * c.parameters.mass_kg, 1e-3f), "after an impact, too");
}

static void on_its_back(void) {
    begin(TC_LANDING, true);
    c.axes[2][2] = 0.45f;
    c.telemetry.estimate.velocity_world_m_s[2] = -0.45f;
    c.telemetry.estimate.rate_body_rad_s[0] = 0.45f;
    for (int i = 0; i < 150; i++) step();
    must(c.mission.state == TC_LANDING, "not yet 0.3 s");
    for (int i = 0; i < 3; i++) step();
    must(c.mission.state == TC_DISARMED && c.mission.reason == TC_TOUCHDOWN, "lies on its side");
    static const struct {
        float up, velocity, rate;
    } not_down[] = {{0.55f, 0.0f, 0.0f}, {0.45f, -0.55f, 0.0f}, {0.45f, 0.0f, 0.55f}};
    for (unsigned i = 0; i < 3u; i++) {
        begin(TC_LANDING, true);
        c.axes[2][2] = not_down[i].up;
        c.telemetry.estimate.velocity_world_m_s[2] = not_down[i].velocity;
        c.telemetry.estimate.rate_body_rad_s[0] = not_down[i].rate;
        for (int k = 0; k < 190; k++) step();
        must(c.mission.state == TC_LANDING, "upright, or moves");
    }
}

void landing_cases(void) {
    descent();
    contact_times();
    unload_and_idle();
    what_still_flies();
    emergency_landing();
    fall_that_is_reckoned();
    on_its_back();
}
