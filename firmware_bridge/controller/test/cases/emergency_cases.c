/* The ground in an emergency without vertical velocity: by impacts, by what the rotors no longer give, or, without an
   accelerometer, by the answer to a roll torque. */
#include <math.h>
#include <string.h>

#include "safety_rig.h"

static const float G = 9.81f;
static float force_m_s2; /* of the accelerometer */

static bool near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

static float weight(void) { return g.c.parameters.mass_kg * g.c.parameters.gravity_m_s2; }

/* A descent at rest 5 m up, with these fields of the estimate. */
static void begin(uint8_t state, uint8_t valid) {
    tc_controller* c = &g.c;
    start_in(TC_DISARMED, 0);
    c->mission.state = state;
    c->vertical_velocity = false;
    c->telemetry.estimate.valid = valid;
    c->telemetry.estimate.position_world_m[2] = c->telemetry.setpoint.position_world_m[2] = 5.0f;
    c->telemetry.wrench.thrust_n = c->hover_thrust_n = weight();
    c->monitor.shake_m2_s4 = 0.0f;
    c->step_us = TICK_US;
    tc_landing_begin(c);
    force_m_s2 = c->landing.force_m_s2 = G;
}

/* Whether it is down. */
static bool step(void) {
    tc_controller* c = &g.c;
    c->telemetry.time_us += TICK_US;
    c->telemetry.estimate.specific_force_body_m_s2[2] = force_m_s2;
    return tc_landing_observe(c, TICK_S);
}

/* Whether it is down within so long. */
static bool steps(float seconds) {
    for (float s = 0.5f * TICK_S; s < seconds; s += TICK_S) {
        if (step()) return true;
    }
    return false;
}

/* Hit for 20 ms, then falling; whether it is down. */
static bool hit(void) {
    force_m_s2 = 8.0f * G;
    bool is_down = steps(0.02f);
    force_m_s2 = 0.0f;
    g.c.landing.force_m_s2 = 0.0f;
    return step() || is_down;
}

/* -- an impact is more than vibration ------------------------------------------------------------------------------ */

static bool counts(float over_m_s2, float shake_m2_s4) {
    begin(TC_EMERGENCY, TC_VALID_ALL);
    (void)steps(0.5f);
    g.c.monitor.shake_m2_s4 = shake_m2_s4;
    force_m_s2 = g.c.landing.force_m_s2 = 1.4f * g.c.parameters.gravity_m_s2 + over_m_s2;
    (void)step();
    return g.c.landing.touched;
}

static void impacts_beside_vibration(void) {
    const float filtered2 = TICK_S / 0.02f / 2.0f; /* of a variance, what the low-pass leaves */
    const float shake_m2_s4 = 3.0f / filtered2;    /* of all axes: 1 m/s^2 on this one, filtered */
    must(!counts(2.9f, shake_m2_s4), "below three standard deviations it may be vibration");
    must(counts(3.1f, shake_m2_s4), "above it is an impact");
    must(!counts(5.8f, 4.0f * shake_m2_s4), "twice the vibration, twice the impact");
    must(counts(6.2f, 4.0f * shake_m2_s4), "and no more");
    must(counts(0.1f, 0.0f), "without vibration all above 1.4 g");
    must(!counts(-0.1f, 0.0f), "and nothing below");
}

/* -- bounces ------------------------------------------------------------------------------------------------------- */

static void bouncing(void) {
    begin(TC_EMERGENCY, TC_VALID_ALL);
    (void)steps(0.5f);
    must(!hit() && g.c.landing.touched, "an impact");
    must(!steps(2.4f) && g.c.landing.touched, "2.5 s are not over");
    must(!steps(0.2f) && !g.c.landing.touched, "then it was an edge");
    must(!hit() && g.c.landing.touched, "and all begins anew:");
    must(!steps(2.1f) && !hit(), "two impacts are not enough, the first one does not count any more");
    must(!steps(0.1f) && hit(), "three are, 2 s after the first");
    begin(TC_EMERGENCY, TC_VALID_ALL);
    (void)steps(0.5f);
    for (int i = 0; i < 6; i++) must(!hit() && !steps(0.25f), "not within 2 s");
    begin(TC_EMERGENCY, TC_VALID_ALL);
    (void)steps(0.5f);
    force_m_s2 = g.c.landing.force_m_s2 = 8.0f * G;
    for (int i = 0; i < 4; i++) (void)step();
    must(g.c.landing.impacts == 1u, "one that lasts is one");
}

/* -- what is gained ------------------------------------------------------------------------------------------------ */

/* Where an UNLOAD ends in which it falls with so much. */
static uint8_t after_a_fall(uint8_t state, bool sure, bool touched, float acceleration_m_s2) {
    begin(state, TC_VALID_ALL);
    g.c.vertical_velocity = sure;
    if (sure) {
        g.c.landing.speed_m_s = g.c.parameters.landing_m_s;
        g.c.telemetry.estimate.rate_body_rad_s[0] = 0.55f; /* turns: no contact that is felt */
    }
    while (g.c.landing.stage == (uint8_t)TC_LANDING_DESCEND) must(!step(), "not down yet");
    must(g.c.landing.sure == sure, "two seconds without coming lower, or one that is tried");
    g.c.landing.touched = touched;
    g.c.landing.impact_us = g.c.telemetry.time_us;
    force_m_s2 = g.c.parameters.gravity_m_s2 - acceleration_m_s2;
    while (g.c.landing.stage == (uint8_t)TC_LANDING_UNLOAD) {
        if (step()) return (uint8_t)TC_LANDING_IDLE;
    }
    return g.c.landing.stage;
}

static void speed_gained_in_half_a_second(void) {
    must(after_a_fall(TC_EMERGENCY, false, false, 0.9f) == (uint8_t)TC_LANDING_IDLE, "0.45 m/s: it stands");
    must(after_a_fall(TC_EMERGENCY, false, false, 1.1f) == (uint8_t)TC_LANDING_DESCEND, "0.55: it flies");
    must(after_a_fall(TC_EMERGENCY, false, true, 1.3f) == (uint8_t)TC_LANDING_IDLE, "once touched, 0.65 is no fall");
    must(after_a_fall(TC_EMERGENCY, false, true, 1.5f) == (uint8_t)TC_LANDING_DESCEND, "0.75 is");
    must(after_a_fall(TC_LANDING, true, false, 2.8f) == (uint8_t)TC_LANDING_IDLE, "where it is sure, 1.4 m/s is none");
    must(after_a_fall(TC_LANDING, true, false, 3.2f) == (uint8_t)TC_LANDING_DESCEND, "1.6 is");
}

/* What is felt of a fall in vain is given back in the descent, as thrust, and each try begins at zero. */
static void given_back(void) {
    begin(TC_EMERGENCY, TC_VALID_ALL);
    const float blind_n = tc_emergency_thrust(&g.c), kd_1_s = g.c.parameters.kd_z_1_s;
    g.c.landing.gained_m_s = 0.3f;
    must(near(tc_emergency_thrust(&g.c), blind_n + g.c.parameters.mass_kg * kd_1_s * 0.3f, 1e-4f), "braked");
    g.c.landing.touched = true;
    must(near(tc_emergency_thrust(&g.c), 0.8f * blind_n, 1e-4f), "but on the ground");
    g.c.landing.touched = false;
    (void)step();
    must(near(g.c.landing.gained_m_s, 0.3f * (1.0f - TICK_S * kd_1_s), 1e-5f), "given back as fast as it brakes");
    g.c.landing.gained_m_s = 0.3f;
    while (g.c.landing.stage == (uint8_t)TC_LANDING_DESCEND) {
        (void)step();
        if (g.c.landing.stage == (uint8_t)TC_LANDING_DESCEND) g.c.landing.gained_m_s = 0.3f;
    }
    must(near(g.c.landing.gained_m_s, 0.0f, 1e-6f), "a new try");
}

/* A fall that the accelerometer's integral shows counts beyond what its bias and noise may have added up to. */
static void falls_by_accelerometer(void) {
    begin(TC_EMERGENCY, TC_VALID_ALL);
    const float still_n = tc_emergency_thrust(&g.c);
    g.c.telemetry.reckoning_s = 4.0f;
    g.c.telemetry.estimate.velocity_world_m_s[2] = -1.35f;
    must(near(tc_emergency_thrust(&g.c), still_n, 1e-4f), "up to 1.4 m/s after four seconds may be the bias");
    g.c.telemetry.estimate.velocity_world_m_s[2] = -1.5f;
    must(tc_emergency_thrust(&g.c) > still_n + 0.05f, "more is a fall");
    g.c.monitor.shake_m2_s4 = 3.0f * 25.0f; /* 5 m/s2 on each axis: after four seconds 0.45 m/s, three times */
    g.c.step_us = 2000u;
    g.c.telemetry.estimate.velocity_world_m_s[2] = -2.7f;
    must(near(tc_emergency_thrust(&g.c), still_n, 1e-4f), "but not while it shakes");
    g.c.telemetry.estimate.velocity_world_m_s[2] = -2.8f;
    must(tc_emergency_thrust(&g.c) > still_n + 0.05f, "unless it is more than that");
}

/* Five seconds after 1 m/s would have led down from 5 m, it descends faster. */
static void late(void) {
    begin(TC_EMERGENCY, TC_VALID_ALL);
    const float first_n = tc_emergency_thrust(&g.c);
    static const struct {
        uint32_t after_s;
        float less;
    } cases[] = {{9u, 0.0063f}, {12u, 0.0164f}, {15u, 0.0305f}, {20u, 0.034f}};
    const uint64_t began_us = g.c.telemetry.time_us;
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        g.c.telemetry.time_us = began_us + 1000000u * (uint64_t)cases[i].after_s;
        must(near(first_n - tc_emergency_thrust(&g.c), cases[i].less * weight(), 2e-4f * weight()), "loses thrust");
    }
}

/* At the end of UNLOAD the floor must carry half of what the rotors, at a tenth, lack. */
static uint8_t after_support_of(float share) {
    begin(TC_EMERGENCY, TC_VALID_ALL);
    while (g.c.landing.stage == (uint8_t)TC_LANDING_DESCEND) (void)step();
    (void)steps(0.4f);
    force_m_s2 = share * g.c.parameters.gravity_m_s2;
    while (g.c.landing.stage == (uint8_t)TC_LANDING_UNLOAD) (void)step();
    return g.c.landing.stage;
}

static void carried(void) {
    must(after_support_of(0.53f) == (uint8_t)TC_LANDING_DESCEND, "0.43 beside the rotors are too little");
    must(after_support_of(0.57f) == (uint8_t)TC_LANDING_IDLE, "0.47 are enough");
}

/* A descent that comes lower is never taken for ground, however long it takes. */
static void comes_lower(void) {
    begin(TC_LANDING, TC_VALID_ALL);
    g.c.vertical_velocity = true;
    for (int i = 0; i < 1600; i++) {
        tc_landing_setpoint(&g.c, TICK_S);
        g.c.telemetry.estimate.velocity_world_m_s[2] = -g.c.landing.speed_m_s;
        g.c.telemetry.estimate.position_world_m[2] -= TICK_S * g.c.landing.speed_m_s;
        must(!step() && g.c.landing.stage == (uint8_t)TC_LANDING_DESCEND, "comes down");
    }
}

/* -- the roll test ------------------------------------------------------------------------------------------------- */

static float body_torque_n_m, body_rate_rad_s; /* as the rotors lag, and what they have made of it */

static void begin_roll(void) {
    begin(TC_EMERGENCY, TC_VALID_POSE);
    g.c.parameters.inertia_kg_m2[0] = 0.003f;
    g.c.parameters.inertia_kg_m2[1] = 0.006f;
    g.c.parameters.rotor_lag_s = 0.0f;
    body_torque_n_m = body_rate_rad_s = 0.0f;
}

static void torque_to_and_fro(void) {
    begin_roll();
    for (unsigned half = 0; half < 6u; half++) {
        const float sign = half % 2u == 0u ? 1.0f : -1.0f;
        g.c.telemetry.time_us = g.c.landing.began_us + half * 120000u + 1000u;
        must(near(tc_landing_test_torque(&g.c), sign * 8.0f * 0.003f, 1e-6f), "8 rad/s^2, turned every 0.12 s");
        g.c.telemetry.time_us += 118000u;
        must(near(tc_landing_test_torque(&g.c), sign * 8.0f * 0.003f, 1e-6f), "until then");
    }
    g.c.telemetry.estimate.valid = TC_VALID_ALL;
    must(near(tc_landing_test_torque(&g.c), 0.0f, 0.0f), "an accelerometer does without");
    g.c.telemetry.estimate.valid = TC_VALID_POSE;
    g.c.vertical_velocity = true;
    must(near(tc_landing_test_torque(&g.c), 0.0f, 0.0f), "a vertical velocity, too");
    g.c.vertical_velocity = false;
    g.c.mission.state = TC_LANDING;
    must(near(tc_landing_test_torque(&g.c), 0.0f, 0.0f), "and a landing with a position");
}

/* Turns with this share of what the torque asks for, at 100 us, for so long; whether the test takes it for standing. */
static bool stands_within(float share, float steady_rad_s, float most_s) {
    const float lag_s = g.c.parameters.rotor_lag_s > 0.0f ? g.c.parameters.lead_filter_s : 0.025f;
    for (float s = 0.5f * TICK_S; s < most_s; s += TICK_S) {
        const float asked_n_m = tc_landing_test_torque(&g.c);
        for (int i = 0; i < 50; i++) {
            body_torque_n_m += 1e-4f / lag_s * (asked_n_m - body_torque_n_m);
            body_rate_rad_s += 1e-4f * body_torque_n_m / g.c.parameters.inertia_kg_m2[0];
        }
        g.c.telemetry.wrench.torque_n_m[0] = asked_n_m;
        g.c.telemetry.estimate.rate_body_rad_s[0] = share * (body_rate_rad_s + steady_rad_s);
        if (step()) return true;
    }
    return false;
}

/* Where the press began and ended first. */
static float until_pressing(bool pressing, float share) {
    float s = 0.0f;
    while (g.c.landing.pressing != pressing && s < 5.0f) {
        must(!stands_within(share, 0.0f, TICK_S), "not yet");
        s += TICK_S;
    }
    return s;
}

static void pressed_down(void) {
    begin_roll();
    const float gentle_n = tc_emergency_thrust(&g.c);
    must(near(gentle_n, 0.97f * weight(), 1e-3f), "0.01 gentler than elsewhere");
    must(near(until_pressing(true, 1.0f), 1.5f, 0.01f), "after 1.5 s");
    must(near(tc_emergency_thrust(&g.c), 0.849f * weight(), 2e-3f * weight()), "by 0.12, and what 1.5 s have lost");
    must(near(until_pressing(false, 1.0f), 0.6f, 0.01f), "0.36 s to fall, and one period that answers");
    must(near(until_pressing(true, 1.0f), 1.5f, 0.01f), "and again");
    g.c.telemetry.estimate.valid = TC_VALID_ALL;
    (void)step();
    must(!g.c.landing.pressing, "an accelerometer does without");
    must(near(tc_emergency_thrust(&g.c), 0.96f * weight(), 3e-3f * weight()), "and descends as ever");
    g.c.telemetry.estimate.valid = TC_VALID_POSE;
    must(near(until_pressing(true, 1.0f), 1.5f, 0.01f), "its loss begins anew");
}

static void answer(void) {
    static const float lags_s[] = {0.0f, 0.05f}; /* not known; known, and led up to a filter */
    for (unsigned i = 0; i < 2u; i++) {
        begin_roll();
        g.c.parameters.rotor_lag_s = lags_s[i];
        must(!stands_within(1.0f, 0.0f, 8.0f), "in the air it answers");
        begin_roll();
        g.c.parameters.rotor_lag_s = lags_s[i];
        must(!stands_within(0.68f, 0.0f, 8.0f), "heavier than believed");
        begin_roll();
        g.c.parameters.rotor_lag_s = lags_s[i];
        must(!stands_within(0.5f, 0.0f, 2.33f) && stands_within(0.5f, 0.0f, 0.03f), "held: two periods of the press");
        begin_roll();
        g.c.parameters.rotor_lag_s = lags_s[i];
        must(!stands_within(0.0f, 0.0f, 2.33f) && stands_within(0.0f, 0.0f, 0.03f), "as is what does not turn at all");
    }
    begin_roll();
    must(!stands_within(1.0f, 0.2f, 8.0f), "turning otherwise besides is not seen");
}

/* A bounce is silent for less than two periods; what answers between presses may touch the ground all the same. */
static void bounce_of_a_press(void) {
    begin_roll();
    (void)until_pressing(true, 1.0f);
    must(!stands_within(1.0f, 0.0f, 0.36f) && !stands_within(0.0f, 0.0f, 0.25f), "one period is silent");
    must(g.c.landing.pressing && g.c.landing.silent, "it goes on");
    must(!stands_within(1.0f, 0.0f, 0.24f) && !g.c.landing.pressing, "the next one answers: it flies");
    (void)until_pressing(true, 1.0f);
    must(!stands_within(1.0f, 0.0f, 0.36f) && !stands_within(0.0f, 0.0f, 0.25f), "one period, later");
    must(stands_within(0.0f, 0.0f, 0.25f), "and a second one: it stands");
}

/* The torque as the rotors lag: what comes of a step after one time constant. */
static void lagging_torque(void) {
    for (int known = 0; known < 2; known++) {
        begin_roll();
        g.c.parameters.rotor_lag_s = known == 1 ? 0.05f : 0.0f;
        g.c.parameters.lead_filter_s = 0.05f;
        g.c.telemetry.wrench.torque_n_m[0] = 1.0f;
        (void)steps(0.05f);
        must(near(g.c.landing.rolling_n_m, known == 1 ? 0.62f : 0.84f, 0.03f), "the rotors lag by 25 ms, or as known");
    }
}

void emergency_cases(void) {
    impacts_beside_vibration();
    bouncing();
    speed_gained_in_half_a_second();
    given_back();
    falls_by_accelerometer();
    late();
    carried();
    comes_lower();
    torque_to_and_fro();
    pressed_down();
    answer();
    bounce_of_a_press();
    lagging_torque();
}
