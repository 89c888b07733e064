/* Failsafes by their numbers: which event, after how long, to which state, with which reason. The vehicle follows its
   set-point exactly; each case spoils one thing. What a real body makes of it is tested in the simulated body. */
#include <math.h>
#include <string.h>

#include "safety_rig.h"

static bool near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

/* States in the order of tc_mission_state, as the table's columns and entries. */
static const char letters[] = "dathpfbsoxle!w";

/* Rows in the order of the events; columns and entries: d disarmed, a armed, t take-off, h hold, p approach,
   f trajectory, b pausing, s paused, o stopping, x aborting, l landing, e emergency, ! fault, w shadow; . refused. */
static const char* const table[TC_EVENT_COUNT] = {
    "aa............", /* arm */
    "dd..........d.", /* disarm */
    ".t............", /* take off */
    "...p..........", /* start */
    ".....bbs......", /* pause */
    "......ff......", /* resume */
    "..hhhooho.h...", /* hold */
    "..lllxxlxxle..", /* land */
    "dd!!!!!!!!!!!d", /* kill */
    "..............", /* time scale: no event of its own */
    "..h.f.........", /* reached */
    ".....hh.hl....", /* finished */
    "......s.hl....", /* standing still */
    "..........dd..", /* touchdown */
    ".deeeeeeeee...", /* position lost */
    "...........l..", /* position back */
    ".d!!!!!!!!!!..", /* attitude lost */
    "..!eeeeeeee!..", /* tilt */
    "..lllxxlx.....", /* fence */
    ".dhhhooh......", /* link lost: hold */
    ".dlllxxlx.....", /* link lost: land */
    "...........!..", /* timeout */
    "..lllllllle...", /* tracking lost */
    "....hooho.....", /* relocalized */
    ".dlllxxlx.....", /* battery low */
    "w............w", /* shadow */
    "h............h", /* engage */
    ".dwwwwwwwwww.w", /* release */
    ".............d", /* shadow's end */
    "..!!!!!!!!!!..", /* crashed */
};

static void transitions_are_those_of_the_table(void) {
    for (uint8_t event = 0; event < TC_EVENT_COUNT; event++) {
        for (uint8_t state = 0; state < TC_MISSION_STATE_COUNT; state++) {
            tc_mission mission;
            tc_mission_init(&mission);
            mission.state = state;
            const tc_reason reason = tc_mission_post(&mission, event, TC_COMMANDED, 5);
            const char entry = reason == TC_OK ? letters[mission.state] : '.';
            must(entry == table[event][state], "the transition of the table");
        }
    }
    for (uint8_t state = 0; state < TC_MISSION_STATE_COUNT; state++) {
        const bool flies = strchr("thpfbsoxle", letters[state]) != NULL;
        must(tc_mission_in_air(state) == flies, "in the air");
        must(tc_mission_rotors_on(state) == (flies || letters[state] == 'a'), "rotors on");
        must(tc_mission_on_path(state) == (strchr("fbsox", letters[state]) != NULL), "on the path");
    }
}

/* -- the link: what is counted from when -- */

static void hold_5_s(tc_parameters* p) { p->link_hold_s = 5.0f; }

static void link_times(void) {
    start_in(TC_HOLD, 1); /* long hovering with a link does not count */
    set(hold_5_s);
    ticks(8.0f);
    g.silent = 1u;
    enters(TC_LANDING, 5.0f, 5.02f, TC_LINK_LOST, "lands so long after the silence began");
    start_in(TC_TRAJECTORY, 1); /* nor does silence before it hovers */
    set(hold_5_s);
    g.silent = 1u;
    enters(TC_STOPPING, 2.0f, 2.02f, TC_LINK_LOST, "stops on the path");
    must(until(TC_HOLD, 5.0f) < 5.0f, "hovers");
    enters(TC_LANDING, 5.0f, 5.02f, TC_LINK_LOST, "lands so long after hovering began");
    start_in(TC_PAUSED, 0);
    set(hold_5_s);
    ticks(8.0f);
    g.silent = 1u;
    enters(TC_HOLD, 2.0f, 2.02f, TC_LINK_LOST, "paused, too");
    start_in(TC_PAUSED, 2);
    g.silent = 1u;
    enters(TC_LANDING, 2.0f, 2.02f, TC_LINK_LOST, "as the plan asks for");
    start_in(TC_TRAJECTORY, 2);
    g.silent = 1u;
    enters(TC_ABORTING, 2.0f, 2.02f, TC_LINK_LOST, "as the plan asks for");
    start_in(TC_TRAJECTORY, 0);
    g.silent = 1u;
    enters(TC_HOLD, 2.5f, 3.1f, TC_FINISHED, "flies to the end");
    start_in(TC_TRAJECTORY, 0);
    g.silent = 1u;
    ticks(2.5f);
    order(TC_COMMAND_PAUSE, 0.0f);
    enters(TC_STOPPING, 0.0f, 0.01f, TC_LINK_LOST, "only while it flies to the end");
    start_in(TC_ARMED, 0);
    g.silent = 1u;
    enters(TC_DISARMED, 2.0f, 2.02f, TC_LINK_LOST, "disarms on the ground");
    start_in(TC_HOLD, 1);
    ticks(3.0f);
    g.silent = 1u;
    ticks(1.9f);
    g.silent = 0u;
    ticks(1.0f);
    g.silent = 1u;
    const uint32_t before = g.c.mission.transitions;
    ticks(1.9f);
    must(g.c.mission.transitions == before, "a message in time starts the count anew");
    start_in(TC_DISARMED, 0);
    tc_init(&g.c); /* never a ground station: nothing to lose */
    tc_parameters p;
    tc_parameters_default(&p);
    must(tc_parameters_set(&g.c, &p) == TC_OK, "presets are accepted");
    g.silent = 1u;
    ticks(0.1f);
    order(TC_COMMAND_ARM, 0.0f);
    ticks(5.0f);
    must(g.c.mission.state == TC_ARMED, "without a ground station from the start, none is missed");
}

/* -- attitude -- */

static void tilt_times(void) {
    start_in(TC_HOLD, 0);
    g.tilt_rad = 1.25f;
    g.e.rate_body_rad_s[0] = 0.6f; /* or it would be taken to lie there */
    enters(TC_EMERGENCY, 0.3f, 0.32f, TC_TILT_ERROR, "beyond 1.2 rad for 0.3 s");
    enters(TC_FAULT, 0.3f, 0.32f, TC_TILT_ERROR, "and once more");
    start_in(TC_HOLD, 0);
    g.tilt_rad = 1.15f;
    g.e.rate_body_rad_s[0] = 1.2f; /* or it would be taken to have crashed */
    ticks(0.5f);
    g.e.rate_body_rad_s[0] = 0.0f;
    must(g.c.mission.state == TC_HOLD, "within 1.2 rad nothing happens");
    for (int i = 0; i < 5; i++) {
        g.tilt_rad = 1.25f;
        g.c.support_m_s2 = 0.0f; /* or it would be taken to stand there */
        ticks(0.28f);
        g.tilt_rad = 0.0f;
        ticks(0.01f);
    }
    must(g.c.mission.state == TC_HOLD, "nor when it passes");
    start_in(TC_TAKE_OFF, 0);
    g.tilt_rad = 1.25f;
    enters(TC_FAULT, 0.29f, 0.32f, TC_TILT_ERROR, "a tip-over at take-off");
    start_in(TC_ARMED, 0);
    g.tilt_rad = 1.25f;
    ticks(2.0f);
    must(g.c.mission.state == TC_ARMED, "on the ground tilt is not watched");
    must(tc_do(&g.c, TC_COMMAND_TAKE_OFF, 1.0f) == TC_TILT_ERROR, "but it does not take off");
    g.tilt_rad = 0.0f;
    g.e.q_world_body[0] = 1.0f;
    g.e.q_world_body[1] = 0.0f;
    ticks(0.3f);
    order(TC_COMMAND_TAKE_OFF, 1.0f);
    ticks(0.1f);
    must(g.c.mission.state == TC_TAKE_OFF, "and what was before take-off does not count");
}

static void lost_attitude_times(void) {
    start_in(TC_HOLD, 0);
    g.no_attitude = true;
    enters(TC_EMERGENCY, 0.1f, 0.11f, TC_GYRO_ONLY, "level on the gyro");
    must(g.c.telemetry.warnings == TC_WARNING_GYRO_ONLY, "which is warned of");
    enters(TC_FAULT, 4.99f, 5.02f, TC_ATTITUDE_STALE, "for gyro_hold_s");
    start_in(TC_HOLD, 0);
    g.no_attitude = true;
    ticks(3.0f);
    g.no_attitude = false;
    enters(TC_LANDING, 0.2f, 0.22f, TC_ESTIMATE_BACK, "lands when it comes back");
    must((g.c.telemetry.warnings & TC_WARNING_GYRO_ONLY) == 0u, "without a warning");
    start_in(TC_HOLD, 0);
    g.no_gyro = true;
    enters(TC_FAULT, 0.1f, 0.11f, TC_ATTITUDE_STALE, "without gyro the rotors stop");
    must((g.c.telemetry.warnings & TC_WARNING_GYRO_ONLY) == 0u, "there is no gyro to fly on");
    start_in(TC_ARMED, 0);
    g.no_gyro = true;
    enters(TC_DISARMED, 0.1f, 0.11f, TC_ATTITUDE_STALE, "on the ground, too");
    start_in(TC_DISARMED, 0);
    g.no_gyro = g.no_attitude = true;
    ticks(0.3f);
    must(g.c.telemetry.warnings == 0u, "without both there is nothing to fly on");
    start_in(TC_ARMED, 0);
    g.no_attitude = true;
    enters(TC_DISARMED, 0.1f, 0.11f, TC_GYRO_ONLY, "on the ground it disarms");
}

/* -- position -- */

static void lost_position_times(void) {
    start_in(TC_HOLD, 0);
    g.no_position = true;
    ticks(0.2f);
    must(g.c.telemetry.warnings == TC_WARNING_DEAD_RECKONING, "dead reckoning is warned of");
    enters(TC_EMERGENCY, 1.89f, 1.92f, TC_ESTIMATE_STALE, "stale_s and reckoning_s");
    g.no_position = false;
    enters(TC_LANDING, 0.2f, 0.22f, TC_ESTIMATE_BACK, "lands when it is back for 0.2 s");
    must(near(g.c.telemetry.setpoint.position_world_m[2], g.e.position_world_m[2], 0.1f), "from where it is");
    must(g.c.telemetry.warnings == 0u, "without a warning");
    start_in(TC_HOLD, 0);
    g.no_position = true;
    ticks(1.9f);
    g.no_position = false;
    ticks(0.5f);
    must(g.c.mission.state == TC_HOLD, "back in time: goes on");
    start_in(TC_HOLD, 0);
    g.e.valid &= (uint8_t)~TC_VALID_POSITION_XY;
    enters(TC_EMERGENCY, 2.09f, 2.12f, TC_ESTIMATE_NOT_FINITE, "not usable");
    g.e.valid = TC_VALID_ALL;
    g.tilt_rad = 0.35f; /* 1 - cos = 0.06 */
    ticks(1.0f);
    must(g.c.mission.state == TC_EMERGENCY, "back, but not level");
    g.tilt_rad = 0.3f; /* 1 - cos = 0.045 */
    enters(TC_LANDING, 0.0f, 0.02f, TC_ESTIMATE_BACK, "level");
    start_in(TC_HOLD, 0);
    g.no_position = true;
    must(until(TC_EMERGENCY, 3.0f) < 3.0f, "lost");
    for (int i = 0; i < 5; i++) {
        g.no_position = false;
        ticks(0.15f);
        g.e.valid = TC_VALID_ALL & ~TC_VALID_POSITION_Z;
        tick();
        g.e.valid = TC_VALID_ALL;
    }
    must(g.c.mission.state == TC_EMERGENCY, "back for too short a time, again and again");
    start_in(TC_ARMED, 0);
    g.no_position = true;
    enters(TC_DISARMED, 0.1f, 0.11f, TC_ESTIMATE_STALE, "on the ground at once");
    start_in(TC_ARMED, 0);
    g.e.valid &= (uint8_t)~TC_VALID_POSITION_XY;
    enters(TC_DISARMED, 0.1f, 0.11f, TC_ESTIMATE_NOT_FINITE, "with the reason");
}

/* Ticks with a new velocity alone take turns with ticks whose position is 0.9 s old. */
static void newer_velocities_make_no_old_position_fresh(void) {
    start_in(TC_HOLD, 0);
    g.no_position = true; /* the stamps are set here */
    for (int i = 0; i < 120; i++) {
        const bool old = i % 2 == 1;
        g.e.valid = old ? TC_VALID_ALL : TC_VALID_ALL & ~(uint32_t)(TC_VALID_POSITION_XY | TC_VALID_POSITION_Z);
        g.e.position_time_us = g.now_us + TICK_US - (old ? 900000u : 0u);
        tick();
    }
    must(near(g.c.telemetry.reckoning_s, 0.5f, 0.02f), "dead reckoned for these 0.6 s, less stale_s");
    must(g.c.telemetry.warnings == TC_WARNING_DEAD_RECKONING, "and says so");
}

static void six_seconds(tc_parameters* p) { p->emergency_s = 6.0f; }
static void two_seconds(tc_parameters* p) { p->emergency_s = 2.0f; }

/* Whether time ends an emergency. */
static void emergency_timeout(void) {
    for (unsigned known = 0; known < 3u; known++) {
        start_in(TC_HOLD, 0);
        set(known == 0u ? two_seconds : six_seconds); /* before a torque could tell */
        g.no_position = true;
        must(until(TC_EMERGENCY, 3.0f) < 3.0f, "lost");
        g.detached = true;
        g.e.velocity_world_m_s[2] = -0.8f;
        g.e.rate_body_rad_s[0] = 0.6f; /* nothing that a land detector could take for the ground */
        g.e.valid = TC_VALID_ATTITUDE | TC_VALID_RATE;
        if (known == 1u) g.e.valid |= TC_VALID_SPECIFIC_FORCE;
        if (known == 2u) {
            g.no_position = false;
            g.e.valid |= TC_VALID_VELOCITY_Z;
        }
        g.e.q_world_body[0] = 1.0f;
        g.e.q_world_body[1] = g.e.q_world_body[2] = g.e.q_world_body[3] = 0.0f;
        if (known == 0u) {
            enters(TC_FAULT, 1.99f, 2.02f, TC_TIMEOUT, "where nothing tells of the ground");
        } else {
            ticks(8.0f);
            must(g.c.mission.state == TC_EMERGENCY, "something does");
        }
    }
}

static void small_fence(tc_parameters* p) {
    for (int i = 0; i < 3; i++) {
        p->fence_min_world_m[i] = -4.0f + (float)i;
        p->fence_max_world_m[i] = 5.0f + (float)i;
    }
}

static void fence_faces(void) {
    for (int face = 0; face < 6; face++) {
        start_in(TC_DISARMED, 0);
        set(small_fence);
        order(TC_COMMAND_ARM, 0.0f);
        order(TC_COMMAND_TAKE_OFF, 1.0f);
        must(until(TC_HOLD, 10.0f) < 10.0f, "hovers");
        const tc_parameters* p = tc_parameters_now(&g.c);
        const int axis = face / 2;
        const float edge = face % 2 == 0 ? p->fence_min_world_m[axis] : p->fence_max_world_m[axis];
        const float outwards = face % 2 == 0 ? -0.1f : 0.1f;
        const float stands = g.c.telemetry.setpoint.position_world_m[axis];
        g.offset_m[axis] = edge - outwards - stands;
        ticks(0.1f);
        must(g.c.mission.state == TC_HOLD, "inside");
        g.offset_m[axis] = edge + outwards - stands;
        enters(TC_LANDING, 0.0f, 0.01f, TC_FENCE_BREACH, "outside");
    }
}

static void voltages(tc_parameters* p) {
    p->battery_arm_v = 14.5f;
    p->battery_warn_v = 14.0f;
    p->battery_land_v = 13.5f;
}

static void battery_levels(void) {
    start_in(TC_DISARMED, 0);
    set(voltages);
    g.e.battery_v = 14.4f;
    tick();
    must(tc_do(&g.c, TC_COMMAND_ARM, 0.0f) == TC_BATTERY_LOW, "too low to arm");
    must((g.c.telemetry.warnings & TC_WARNING_BATTERY) == 0u, "too high to warn");
    g.e.battery_v = 14.6f;
    ticks(8.0f);
    order(TC_COMMAND_ARM, 0.0f);
    order(TC_COMMAND_TAKE_OFF, 1.0f);
    must(until(TC_HOLD, 10.0f) < 10.0f, "hovers");
    g.e.battery_v = 13.4f; /* from 14.6 with a time constant of 1 s: 14.0 after 0.69 s, 13.5 after 2.48 s */
    ticks(0.65f);
    must(g.c.telemetry.warnings == 0u, "not yet");
    ticks(0.1f);
    must(g.c.telemetry.warnings == TC_WARNING_BATTERY, "warns");
    must(g.c.mission.state == TC_HOLD, "and flies on");
    enters(TC_LANDING, 1.73f, 1.75f, TC_BATTERY_LOW, "lands");
    g.e.battery_v = 16.0f;
    ticks(0.3f);
    order(TC_COMMAND_HOLD, 0.0f);
    enters(TC_LANDING, 0.0f, 0.01f, TC_BATTERY_LOW, "and no recovery takes that back");
    start_in(TC_DISARMED, 0);
    set(voltages);
    g.e.battery_v = 13.0f;
    tick();
    must(g.c.telemetry.warnings == TC_WARNING_BATTERY, "warns on the ground");
    g.e.battery_v = 16.0f;
    ticks(2.0f);
    must(g.c.telemetry.warnings == 0u, "until a full one is there");
    g.e.battery_v = 0.0f;
    ticks(2.0f);
    must(g.c.telemetry.warnings == 0u && near(g.c.battery_v, 15.6f, 0.2f), "no measurement changes nothing");
    start_in(TC_HOLD, 0);
    ticks(1.0f);
    must(g.c.mission.state == TC_HOLD && g.c.telemetry.warnings == 0u, "without a measurement nothing happens");
}

static void single_cell(tc_parameters* p) {
    p->battery_warn_v = 0.95f;
    p->battery_land_v = 0.9f;
}

/* Whatever is measured counts, however small. */
static void battery_of_one_cell(void) {
    start_in(TC_DISARMED, 0);
    set(single_cell);
    g.e.battery_v = 0.98f;
    order(TC_COMMAND_ARM, 0.0f);
    order(TC_COMMAND_TAKE_OFF, 1.0f);
    must(until(TC_HOLD, 10.0f) < 10.0f, "hovers");
    must(g.c.telemetry.warnings == 0u && near(g.c.battery_v, 0.98f, 1e-3f), "is measured");
    g.e.battery_v = 0.93f;
    ticks(5.0f);
    must(g.c.telemetry.warnings == TC_WARNING_BATTERY && g.c.mission.state == TC_HOLD, "warns");
    g.e.battery_v = 0.5f;
    ticks(0.02f);
    must(near(g.c.battery_v, 0.922f, 3e-3f), "low-passed");
    must(until(TC_LANDING, 1.0f) < 1.0f, "lands");
}

void safety_cases(void) {
    transitions_are_those_of_the_table();
    link_times();
    tilt_times();
    lost_attitude_times();
    lost_position_times();
    newer_velocities_make_no_old_position_fresh();
    emergency_timeout();
    fence_faces();
    battery_levels();
    battery_of_one_cell();
}
