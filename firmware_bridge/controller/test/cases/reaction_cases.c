/* What states begin from, and what the path, the clock and another controller lead to. */
#include <math.h>
#include <string.h>

#include "safety_rig.h"

static bool near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

/* -- tracking and relocalization -- */

static void upload_turned(float clearance_m, float yaw_rad) {
    static tc_trajectory plan;
    short_plan(&plan, 0);
    for (int i = 0; i < 2; i++) plan.segment[i].coefficient[3][0] = yaw_rad;
    plan.header.id = clearance_m > 0.0f ? 6u : 7u;
    plan.header.clearance_m = clearance_m;
    plan.header.crc32 = tc_trajectory_crc32(&plan);
    must(tc_upload_begin(&g.c, &plan.header) == TC_OK, "opened");
    for (uint16_t i = 0; i < 2u; i++) must(tc_upload_segment(&g.c, i, &plan.segment[i]) == TC_OK, "a segment");
    tc_reason reason = TC_BUSY;
    while (reason == TC_BUSY) reason = tc_upload_finish(&g.c);
    must(reason == TC_OK && tc_upload_activate(&g.c, plan.header.id, plan.header.crc32) == TC_OK, "active");
}

static void upload_with_clearance(float clearance_m) { upload_turned(clearance_m, 0.0f); }

static void tracking_lost(void) {
    static const uint8_t watched[] = {TC_TAKE_OFF, TC_APPROACH, TC_TRAJECTORY};
    for (unsigned i = 0; i < 3u; i++) {
        start_in(watched[i], 0);
        g.offset_m[0] = 0.52f;
        enters(TC_LANDING, 0.3f, 0.32f, TC_TRACKING_LOST, "beyond the clearance for 0.3 s");
        start_in(watched[i], 0);
        g.offset_m[0] = 0.48f;
        ticks(0.5f);
        must(g.c.mission.state == watched[i], "within it");
    }
    start_in(TC_HOLD, 0);
    g.offset_m[0] = 1.02f;
    ticks(1.0f);
    must(g.c.mission.state == TC_HOLD, "a hovering vehicle has a limit of its own");
    g.offset_m[0] = 1.52f;
    enters(TC_LANDING, 0.3f, 0.32f, TC_TRACKING_LOST, "beyond that it lands");
    start_in(TC_HOLD, 0);
    upload_with_clearance(0.8f);
    must(near(tc_clearance(&g.c), 1.5f, 0.0f), "the hover's own");
    g.c.mission.state = TC_APPROACH;
    must(near(tc_clearance(&g.c), 0.8f, 0.0f), "the plan's clearance");
    g.c.mission.state = TC_HOLD;
    upload_with_clearance(0.0f);
    g.c.mission.state = TC_APPROACH;
    must(near(tc_clearance(&g.c), 0.5f, 0.0f), "or the parameter's");
    tc_store_discard(&g.c.store);
    g.c.store.has_active = false;
    must(near(tc_clearance(&g.c), 0.5f, 0.0f), "without a plan, too");
}

static void relocalization(void) {
    start_in(TC_TRAJECTORY, 0);
    g.e.reset_counter++;
    g.e.reset_position_world_m[1] = 0.49f;
    ticks(0.02f);
    must(g.c.mission.state == TC_TRAJECTORY, "within the clearance");
    start_in(TC_TRAJECTORY, 0);
    g.e.reset_counter++;
    g.e.reset_position_world_m[1] = 0.53f;
    enters(TC_STOPPING, 0.0f, 0.02f, TC_RELOCALIZED, "beyond it");
    start_in(TC_TRAJECTORY, 0);
    g.e.reset_counter = (uint8_t)(g.e.reset_counter + 2u);
    enters(TC_STOPPING, 0.0f, 0.02f, TC_RELOCALIZED, "an unknown one");
    for (int number = 0; number < 7; number++) { /* finite, but no amount that a frame moves by */
        start_in(TC_TRAJECTORY, 0);
        const tc_setpoint before = g.c.telemetry.setpoint;
        float* const amounts[] = {&g.e.reset_position_world_m[0], &g.e.reset_velocity_world_m_s[0], &g.e.reset_yaw_rad};
        g.e.reset_counter++;
        amounts[number / 3][number % 3] = number < 3 ? 30001.0f : number < 6 ? -151.0f : 6.4f;
        enters(TC_STOPPING, 0.0f, 0.02f, TC_RELOCALIZED, "one that cannot be");
        must(near(g.c.telemetry.setpoint.yaw_rad, before.yaw_rad, 0.1f), "nothing follows it");
        must(near(g.c.telemetry.setpoint.position_world_m[0], before.position_world_m[0], 0.1f), "nothing at all");
    }
}

static void reasons_on_the_way(void) {
    start_in(TC_TAKE_OFF, 0);
    must(until(TC_HOLD, 10.0f) < 10.0f && g.c.mission.reason == TC_REACHED, "reached");
    start_in(TC_APPROACH, 0);
    must(until(TC_TRAJECTORY, 10.0f) < 10.0f && g.c.mission.reason == TC_REACHED, "reached");
    start_in(TC_PAUSED, 0);
    must(g.c.mission.reason == TC_STANDING_STILL, "stands");
}

static void hold_1_s(tc_parameters* p) { p->link_hold_s = 1.0f; }

static void short_link_hold(void) {
    start_in(TC_PAUSED, 0);
    set(hold_1_s);
    ticks(2.0f);
    g.silent = 1u;
    enters(TC_LANDING, 2.0f, 2.02f, TC_LINK_LOST, "paused for long enough, and silent for long enough");
    start_in(TC_TAKE_OFF, 0);
    set(hold_1_s);
    ticks(0.1f);
    g.silent = 1u;
    must(until(TC_HOLD, 3.0f) < 3.0f, "a take-off is no hovering");
}

static void clock_warning(void) {
    start_in(TC_HOLD, 0);
    g.now_us += 3600u * 1000000u;
    tick();
    must(g.c.telemetry.refused_ticks == 1u && g.c.telemetry.warnings == TC_WARNING_CLOCK, "a step of the clock");
    ticks(4.9f);
    must(g.c.telemetry.warnings == TC_WARNING_CLOCK, "is warned of for 5 s");
    ticks(0.2f);
    must(g.c.telemetry.warnings == 0u && g.c.mission.state == TC_HOLD, "and no longer");
}

/* -- what is prepared on entering a state -- */

static void preparations(void) {
    start_in(TC_DISARMED, 0);
    g.e.position_world_m[0] = 2.0f;
    g.e.position_world_m[2] = 0.3f;
    ticks(0.05f);
    g.c.position.integral_m_s2[0] = 1.0f;
    order(TC_COMMAND_ARM, 0.0f);
    g.e.velocity_world_m_s[2] = 0.2f; /* a shaking estimate is no speed to start from */
    ticks(0.02f);
    order(TC_COMMAND_TAKE_OFF, 1.5f);
    must(near(g.c.position.integral_m_s2[0], 0.0f, 0.0f), "the integrator starts from zero");
    must(near(g.c.telemetry.setpoint.velocity_world_m_s[2], 0.0f, 0.0f), "the set-point starts from rest");
    must(near(g.c.move.duration_s, 2.1875f * 1.5f, 0.01f), "as fast as the parameter");
    const float first = until(TC_HOLD, 10.0f);
    must(near(first, 2.1875f * 1.5f, 0.03f), "and that long");
    must(near(g.c.telemetry.setpoint.position_world_m[0], 2.0f, 1e-3f) &&
             near(g.c.telemetry.setpoint.position_world_m[2], 1.8f, 1e-3f),
         "straight up by what was asked for");
    ticks(2.0f);
    must(near(g.c.telemetry.setpoint.position_world_m[0], 2.0f, 1e-3f) &&
             near(g.c.telemetry.setpoint.position_world_m[2], 1.8f, 1e-3f),
         "and stays there");
    start_in(TC_DISARMED, 0);
    g.e.q_world_body[0] = cosf(0.5f);
    g.e.q_world_body[3] = sinf(0.5f);
    ticks(0.05f);
    order(TC_COMMAND_ARM, 0.0f);
    order(TC_COMMAND_TAKE_OFF, 1.0f);
    must(near(g.c.telemetry.setpoint.yaw_rad, 1.0f, 1e-3f), "the heading is kept");
    start_in(TC_HOLD, 0);
    g.c.telemetry.setpoint.yaw_rad = 3.0f * TC_TEST_PI; /* half a turn more than the start's yaw of 0, twice wound */
    order(TC_COMMAND_START, 0.0f);
    must(near(g.c.move.septic[3][0], 2.0f * TC_TEST_PI, 1e-3f) || near(g.c.move.septic[3][0], 4.0f * TC_TEST_PI, 1e-3f),
         "turns the shorter way");
    start_in(TC_APPROACH, 0);
    must(near(g.c.move.septic[2][0], 1.0f, 1e-4f), "to the start of the path");
    order(TC_COMMAND_TIME_SCALE, 0.5f);
    must(until(TC_TRAJECTORY, 5.0f) < 5.0f, "flies");
    must(near(g.c.clock.rate[0], 0.5f, 1e-6f) && g.c.clock.path_us < 20000u, "from the beginning, at the scale asked");
    start_in(TC_TRAJECTORY, 0); /* pausing: the ramp keeps to the brake */
    ticks(0.6f);
    const float speed = fabsf(g.c.telemetry.setpoint.velocity_world_m_s[2]);
    must(speed > 0.5f, "fast enough to matter");
    order(TC_COMMAND_PAUSE, 0.0f);
    must(near(g.c.clock.ramp_s, fmaxf(1.875f * speed / 4.0f, 0.5f), 1e-3f), "as long as the brake asks for");
    const float ramp_left = g.c.clock.ramp_left_s;
    ticks(0.05f);
    order(TC_COMMAND_HOLD, 0.0f);
    must(near(g.c.clock.ramp_left_s, ramp_left - 0.05f, 1e-4f), "braking already: no new ramp");
    start_in(TC_TRAJECTORY, 0);
    ticks(0.6f);
    order(TC_COMMAND_LAND, 0.0f);
    must(near(g.c.clock.target_rate, 0.0f, 0.0f), "aborting brakes");
    start_in(TC_PAUSED, 0);
    order(TC_COMMAND_TIME_SCALE, 0.4f);
    order(TC_COMMAND_RESUME, 0.0f);
    must(near(g.c.clock.target_rate, 0.4f, 1e-6f) && g.c.clock.path_us > 100000u, "resumes where it stood");
    start_in(TC_HOLD, 0);
    g.c.telemetry.setpoint.velocity_world_m_s[0] = 2.0f;
    order(TC_COMMAND_HOLD, 0.0f); /* stays: nothing is begun anew */
    const tc_move move = g.c.move;
    order(TC_COMMAND_LAND, 0.0f);
    must(memcmp(&move, &g.c.move, sizeof move) != 0, "landing brakes first");
    must(near(g.c.move.duration_s, 1.0f, 1e-3f), "with the brake's deceleration");
    must(g.c.landing.stage == TC_LANDING_DESCEND, "and descends");
    order(TC_COMMAND_HOLD, 0.0f);
    must(g.c.landing.stage == TC_LANDING_NONE && near(g.c.move.duration_s, 1.0f, 1e-3f), "holding ends that");
}

/* The path's reference and the vehicle's: which of them a state begins from. */
static void beginnings(void) {
    start_in(TC_TRAJECTORY, 0); /* tracking lost: from the vehicle's own state */
    g.offset_m[0] = 0.6f;
    must(until(TC_LANDING, 1.0f) < 1.0f, "given up");
    must(near(g.c.telemetry.setpoint.position_world_m[0], 0.6f, 0.02f), "begins where the vehicle is");
    tc_setpoint first;
    tc_move_setpoint(&g.c.move, &first);
    must(near(first.velocity_world_m_s[2], g.e.velocity_world_m_s[2], 0.05f) &&
             near(first.acceleration_world_m_s2[2], 0.0f, 0.05f) && near(first.jerk_world_m_s3[2], 0.0f, 0.5f),
         "as fast as the vehicle is, and nothing of the path");
    start_in(TC_DISARMED, 0); /* an emergency that ends: the same */
    order(TC_COMMAND_ARM, 0.0f);
    order(TC_COMMAND_TAKE_OFF, 1.0f);
    must(until(TC_HOLD, 10.0f) < 10.0f, "hovers");
    g.no_position = true;
    must(until(TC_EMERGENCY, 3.0f) < 3.0f, "lost");
    g.detached = true;
    g.no_position = false;
    g.e.position_world_m[0] = 3.0f;
    g.e.velocity_world_m_s[1] = 0.7f;
    g.e.q_world_body[0] = cosf(0.5f);
    g.e.q_world_body[3] = sinf(0.5f); /* a yaw of 1 rad */
    g.e.q_world_body[1] = g.e.q_world_body[2] = 0.0f;
    g.c.telemetry.setpoint.snap_world_m_s4[0] = 5.0f;
    must(until(TC_LANDING, 1.0f) < 1.0f, "back");
    const tc_setpoint* sp = &g.c.telemetry.setpoint;
    must(near(sp->position_world_m[0], 3.0f, 1e-3f) && near(sp->velocity_world_m_s[1], 0.7f, 1e-3f) &&
             near(sp->yaw_rad, 1.0f, 1e-3f) && near(sp->snap_world_m_s4[0], 0.0f, 0.0f),
         "the vehicle's own position, velocity and heading, nothing higher");
    must(near(g.c.telemetry.flatness.q_reference[3], sinf(0.5f), 1e-2f), "and attitude");
    start_in(TC_HOLD, 0); /* landing by order goes on from the set-point */
    g.offset_m[0] = 0.4f;
    ticks(0.1f);
    order(TC_COMMAND_LAND, 0.0f);
    must(near(g.c.telemetry.setpoint.position_world_m[0], 0.0f, 1e-3f), "unbroken");
    start_in(TC_HOLD, 0); /* the approach: speed, heading */
    g.c.telemetry.setpoint.position_world_m[0] = -0.4f;
    g.e.position_world_m[0] = -0.4f;
    upload_turned(0.9f, 0.4f);
    g.c.telemetry.setpoint.yaw_rad = 0.05f;
    must(tc_do(&g.c, TC_COMMAND_START, 0.0f) == TC_OK, "starts");
    must(near(g.c.move.duration_s, 2.1875f * 0.4f / 0.7f, 1e-3f), "0.7 m/s at the peak");
    must(near(g.c.move.septic[3][0], 0.4f, 1e-5f), "to the heading of the start");
    g.e.reset_counter++; /* relocalized on the way: the path begins with that shift */
    g.e.reset_position_world_m[0] = 0.1f;
    g.e.reset_position_world_m[1] = 0.2f;
    g.e.reset_position_world_m[2] = -0.1f;
    g.e.reset_yaw_rad = 0.3f;
    must(until(TC_TRAJECTORY, 5.0f) < 5.0f, "flies");
    must(near(g.c.supervisor.shift[0], 0.1f, 2e-3f) && near(g.c.supervisor.shift[1], 0.2f, 2e-3f) &&
             near(g.c.supervisor.shift[2], -0.1f, 2e-3f) && near(g.c.supervisor.shift[3], 0.3f, 3e-3f),
         "shifted as a whole");
    ticks(0.5f);
    order(TC_COMMAND_PAUSE, 0.0f);
    must(g.c.landing.stage == TC_LANDING_NONE, "pausing is no landing");
    must(fabsf(g.c.supervisor.shift[1]) > 0.1f, "which pausing keeps");
    order(TC_COMMAND_RESUME, 0.0f);
    must(fabsf(g.c.supervisor.shift[1]) > 0.1f, "and resuming");
    must(until(TC_HOLD, 5.0f) < 5.0f, "ends");
    must(near(g.c.supervisor.shift[1], 0.0f, 0.0f), "and hovering does not need");
    must(near(g.c.move.duration_s, 0.5f, 0.2f), "stops");
}

/* A ramp of the path's rate keeps to the brake whatever the rate is. */
static void ramps(void) {
    start_in(TC_TRAJECTORY, 0);
    order(TC_COMMAND_TIME_SCALE, 0.5f);
    ticks(1.0f);
    g.c.telemetry.setpoint.velocity_world_m_s[2] = 4.0f; /* at half the rate: the path itself is at 8 m/s */
    tc_change_rate(&g.c, 1.0f);
    must(near(g.c.clock.ramp_s, 1.875f * 8.0f * 0.5f / 4.0f, 2e-3f), "path speed times change over brake");
    tc_change_rate(&g.c, 0.0f);
    must(near(g.c.clock.ramp_s, 1.875f * 8.0f * 0.5f / 4.0f, 2e-3f), "in either direction");
    g.c.clock.flown[0] = 0.05f; /* hardly moving: as if at a tenth */
    tc_change_rate(&g.c, 0.0f);
    must(near(g.c.clock.ramp_s, 1.875f * 40.0f * 0.5f / 4.0f, 1e-2f), "within reason");
    g.c.telemetry.setpoint.velocity_world_m_s[2] = 0.0f;
    tc_change_rate(&g.c, 0.0f);
    must(near(g.c.clock.ramp_s, 0.5f, 1e-5f), "never shorter than half a second");
}

/* Hovering beside another controller for so long. */
static void hover_in_shadow(float seconds) {
    start_in(TC_DISARMED, 0);
    g.detached = true;
    g.e.position_world_m[2] = 2.0f;
    must(tc_shadow(&g.c) == TC_OK && tc_shadow(&g.c) == TC_OK, "computes beside it");
    ticks(seconds);
    must(!g.output.in_command, "and commands nothing");
}

/* A clock that is behind by a little in every second tick, and a position that is always the same sample. */
static void a_jittering_clock_keeps_no_sample_fresh(void) {
    start_in(TC_HOLD, 0);
    g.detached = g.no_position = true;
    const uint64_t lost_us = g.c.telemetry.time_us;
    for (int i = 0; i < 400 && g.c.mission.state == TC_HOLD; i++) {
        g.now_us += TICK_US;
        tick();
        g.now_us -= TICK_US + 300u;
        tick();
    }
    const tc_parameters* p = tc_parameters_now(&g.c);
    const float after_s = (float)(g.c.telemetry.time_us - lost_us) * 1e-6f;
    must(g.c.telemetry.refused_ticks > 100u && g.c.mission.state == TC_EMERGENCY, "lost");
    must(near(after_s, p->estimate_stale_s + p->reckoning_s, 0.03f), "when it would be by a steady clock");
}

static void shadow_takes_no_commands(void) {
    hover_in_shadow(1.2f);
    for (int command = 0; command < TC_COMMAND_COUNT; command++) {
        if (command == TC_COMMAND_KILL || command == TC_COMMAND_TIME_SCALE) continue; /* the second is no order */
        must(tc_do(&g.c, (tc_command)command, 1.0f) != TC_OK && g.c.mission.state == TC_SHADOW, "refused");
    }
    g.e.velocity_world_m_s[0] = 0.51f;
    tick();
    must(tc_shadow_end(&g.c) == TC_MOVING && g.c.mission.state == TC_SHADOW, "not while it flies along");
    g.e.velocity_world_m_s[0] = 0.49f;
    g.e.rate_body_rad_s[2] = 0.51f;
    tick();
    must(tc_shadow_end(&g.c) == TC_MOVING && g.c.mission.state == TC_SHADOW, "or turns");
    g.e.rate_body_rad_s[2] = 0.49f;
    tick();
    must(tc_shadow_end(&g.c) == TC_OK && g.c.mission.state == TC_DISARMED, "the integrator ends it");
    must(tc_shadow_end(&g.c) == TC_WRONG_STATE, "once");
    must(tc_shadow(&g.c) == TC_OK && tc_do(&g.c, TC_COMMAND_KILL, 0.0f) == TC_OK, "or kills");
    tick();
    must(g.output.in_command && g.output.rotor_speed_rad_s[0] <= 0.0f, "in command of stopped rotors");
}

static bool all_speeds_finite(void) {
    bool finite = true;
    for (int i = 0; i < TC_ROTORS; i++) finite = finite && isfinite(g.c.telemetry.rotor_speed_rad_s[i]);
    return finite;
}

static void engage_limits(void) {
    static const float speeds[TC_ROTORS] = {900.0f, 910.0f, 920.0f, 930.0f};
    static const float no_speeds[TC_ROTORS] = {900.0f, NAN, 920.0f, 930.0f};
    start_in(TC_DISARMED, 0);
    tc_init(&g.c);
    must(tc_shadow(&g.c) == TC_NOT_CONFIGURED && tc_engage(&g.c, NULL) == TC_NOT_CONFIGURED, "not configured");
    tc_parameters p;
    tc_parameters_default(&p);
    must(tc_parameters_set(&g.c, &p) == TC_OK && tc_engage(&g.c, NULL) == TC_ESTIMATE_STALE, "before the first tick");
    start_in(TC_ARMED, 0);
    must(tc_engage(&g.c, NULL) == TC_WRONG_STATE, "on the ground, ours");
    hover_in_shadow(0.8f);
    must(tc_engage(&g.c, NULL) == TC_ESTIMATE_STALE, "good for less than a second");
    ticks(0.3f);
    g.e.velocity_world_m_s[0] = 5.1f;
    tick();
    must(tc_engage(&g.c, NULL) == TC_NOT_ENGAGEABLE, "too fast");
    g.e.velocity_world_m_s[0] = 0.0f;
    g.e.rate_body_rad_s[2] = 2.1f;
    tick();
    must(tc_engage(&g.c, NULL) == TC_NOT_ENGAGEABLE, "turns too fast");
    g.e.rate_body_rad_s[2] = 0.0f;
    g.e.q_world_body[0] = cosf(0.315f);
    g.e.q_world_body[1] = sinf(0.315f);
    tick();
    must(tc_engage(&g.c, NULL) == TC_NOT_ENGAGEABLE, "36 degrees");
    g.e.q_world_body[0] = cosf(0.29f);
    g.e.q_world_body[1] = sinf(0.29f);
    g.e.velocity_world_m_s[1] = -4.9f;
    g.e.rate_body_rad_s[2] = 1.9f;
    tick();
    must(tc_engage(&g.c, speeds) == TC_OK && g.c.mission.state == TC_HOLD && g.c.mission.reason == TC_ENGAGED, "calm");
    must(memcmp(g.c.telemetry.rotor_speed_rad_s, speeds, sizeof speeds) == 0, "from the rotors' own speeds");
    must(near(g.c.telemetry.setpoint.velocity_world_m_s[1], -4.9f, 0.01f), "from the vehicle's own velocity");
    tick();
    must(g.output.in_command, "in command from the next output on");
    must(tc_release(&g.c) == TC_OK && g.c.mission.reason == TC_RELEASED, "gives back");
    tick();
    must(!g.output.in_command, "at once");
    hover_in_shadow(1.2f); /* speeds that are no numbers, and no accelerometer */
    g.e.valid = TC_VALID_POSE;
    tick();
    must(tc_engage(&g.c, no_speeds) == TC_OK, "engages");
    must(all_speeds_finite(), "with speeds of its own");
    must(near(g.c.telemetry.wrench.thrust_n, g.c.parameters.mass_kg * g.c.parameters.gravity_m_s2, 1e-3f), "hovering");
    must(tc_release(&g.c) == TC_OK && tc_engage(&g.c, NULL) == TC_OK, "without knowing what the rotors do");
    must(all_speeds_finite(), "with speeds of its own, too");
}

static void rotor_drag(tc_parameters* p) { p->rotor_drag_kg = 1.0e-5f; }

/* Yaw torque asked of the rotors in the next tick, in a hover that turns. */
static float yaw_torque(void) {
    g.e.rate_body_rad_s[2] = 1.0f;
    tick();
    return g.c.telemetry.wrench.torque_n_m[2];
}

/* The drag of the rotors follows their speeds as measured; what cannot be a speed is not used, and shows as none. */
static void measured_rotors(void) {
    start_in(TC_HOLD, 0);
    set(rotor_drag);
    ticks(1.0f);
    const rig before = g;
    const float by_the_model = yaw_torque();
    const float* told = g.c.telemetry.estimate.rotor_speed_rad_s;
    must(told[0] <= 0.0f && (g.c.telemetry.estimate.valid & TC_VALID_ROTOR_SPEED) == 0u, "none is measured");
    g = before;
    for (unsigned i = 0; i < TC_ROTORS; i++) g.e.rotor_speed_rad_s[i] = g.c.slow_speed_rad_s[i];
    g.e.valid |= TC_VALID_ROTOR_SPEED;
    const rig measured = g;
    must(near(yaw_torque(), by_the_model, 1e-9f), "measured as the model has them: the same");
    must(told[3] > 0.0f && (g.c.telemetry.estimate.valid & TC_VALID_ROTOR_SPEED) != 0u, "and noted");
    g = measured;
    for (unsigned i = 0; i < TC_ROTORS; i++) g.e.rotor_speed_rad_s[i] *= 2.0f;
    must(yaw_torque() > by_the_model + 1e-6f, "faster rotors brake the turn more");
    const float impossible[] = {NAN, INFINITY, -1e4f, 1e4f};
    for (unsigned i = 0; i < sizeof impossible / sizeof impossible[0]; i++) {
        g = measured;
        g.e.rotor_speed_rad_s[2] = impossible[i];
        must(near(yaw_torque(), by_the_model, 1e-9f), "as without");
        must(told[0] <= 0.0f && told[2] <= 0.0f && (g.c.telemetry.estimate.valid & TC_VALID_ROTOR_SPEED) == 0u, "none");
    }
}

void reaction_cases(void) {
    measured_rotors();
    engage_limits();
    a_jittering_clock_keeps_no_sample_fresh();
    shadow_takes_no_commands();
    beginnings();
    ramps();
    tracking_lost();
    relocalization();
    reasons_on_the_way();
    short_link_hold();
    clock_warning();
    preparations();
}
