/* The tracking supervisor by its numbers: limits, smoothness, reasons, giving up, shifts. */
#include <math.h>
#include <string.h>

#include "cases.h"

#define STEP_US 2000u
#define STEP_S 0.002f

static bool near(float a, float b, float tolerance) { return fabsf(a - b) <= tolerance; }

static tc_supervisor s;
static tc_setpoint sp;
static float at[3];
static uint64_t now_us;
static float path_rate;
static bool tracking;

#define CLEARANCE_M 2.0f
#define RAMP_1_S 5.0f

static void supervise(float seconds) {
    for (float t = 0.0f; t < seconds - 0.0005f; t += STEP_S) {
        now_us += STEP_US;
        tc_supervisor_judge(&s, &sp, path_rate, at, CLEARANCE_M, tracking, RAMP_1_S, now_us);
        tc_supervisor_step(&s, STEP_S);
    }
}

/* On a path along x at 3 m/s, this far to its side. */
static void follow_path(float aside_m) {
    now_us = 1000000u;
    tc_supervisor_reset(&s, now_us);
    memset(&sp, 0, sizeof sp);
    sp.velocity_world_m_s[0] = 3.0f;
    at[0] = at[2] = 0.0f;
    at[1] = aside_m;
    path_rate = 1.0f;
    tracking = true;
}

static void starts_anew(void) {
    memset(&s, 0x55, sizeof s);
    tc_supervisor_reset(&s, 5u);
    tc_supervisor expected;
    memset(&expected, 0, sizeof expected);
    expected.stage[0] = expected.stage[1] = expected.stage[2] = expected.limit[0] = expected.target = 1.0f;
    expected.within_us = expected.approaching_us = 5u;
    must(memcmp(&s, &expected, sizeof s) == 0, "full rate, no shift, nothing else");
}

static void limits_by_error(void) {
    static const struct {
        float share, limit;
    } list[] = {{0.0f, 1.0f},  {0.29f, 1.0f},   {0.4f, 0.75f}, {0.5f, 0.5f},
                {0.6f, 0.25f}, {0.69f, 0.025f}, {0.71f, 0.0f}};
    for (unsigned i = 0; i < sizeof list / sizeof list[0]; i++) {
        follow_path(list[i].share * CLEARANCE_M);
        must(near(s.limit[0], 1.0f, 0.0f), "begins at full rate");
        supervise(4.0f);
        must(near(s.limit[0], list[i].limit, 2e-3f), "from 0.3 to 0.7 of the clearance");
        must(s.reason == (list[i].limit < 1.0f ? TC_TRACKING_ERROR : TC_OK), "with its reason");
        must(near(s.error_m, list[i].share * CLEARANCE_M, 1e-5f), "the error is known");
    }
    follow_path(0.71f * CLEARANCE_M); /* stopped: goes on below 0.35 only */
    supervise(1.0f);
    at[1] = 0.36f * CLEARANCE_M;
    supervise(3.0f);
    must(s.limit[0] < 1e-3f && s.stopped, "not yet");
    at[1] = 0.34f * CLEARANCE_M;
    supervise(3.0f);
    must(near(s.limit[0], 0.9f, 2e-3f) && !s.stopped, "goes on");
    at[1] = 0.5f * CLEARANCE_M;
    supervise(3.0f);
    must(near(s.limit[0], 0.5f, 2e-3f), "slowed, not stopped");
    follow_path(0.0f); /* ahead is no error, behind is */
    at[0] = 3.0f;
    supervise(3.0f);
    must(near(s.limit[0], 1.0f, 0.0f) && near(s.error_m, 0.0f, 1e-5f), "ahead");
    at[1] = 0.5f * CLEARANCE_M;
    supervise(3.0f);
    must(near(s.error_m, 1.0f, 1e-4f), "and aside");
    at[0] = -1.0f;
    at[1] = 0.0f;
    supervise(3.0f);
    must(near(s.error_m, 1.0f, 1e-4f) && near(s.limit[0], 0.5f, 2e-3f), "behind");
    sp.velocity_world_m_s[0] = 0.0f; /* standing: the last direction holds */
    path_rate = 0.0f;
    at[0] = 1.0f;
    supervise(0.1f);
    must(near(s.error_m, 0.0f, 1e-4f), "ahead of where it stood");
    path_rate = 0.009f; /* too slow to tell a direction by */
    sp.velocity_world_m_s[1] = 3.0f;
    supervise(0.1f);
    must(near(s.error_m, 0.0f, 1e-4f), "as before");
    path_rate = 0.011f;
    supervise(0.1f);
    must(near(s.error_m, 1.0f, 1e-4f), "another direction");
    sp.velocity_world_m_s[1] = 0.0f;
    sp.velocity_world_m_s[0] = 0.009f;
    path_rate = 1.0f;
    supervise(0.1f);
    must(near(s.error_m, 1.0f, 1e-4f), "too slow, too");
    follow_path(0.0f); /* dead reckoning brakes, and gives up nothing */
    at[1] = 3.0f * CLEARANCE_M;
    tracking = false;
    supervise(5.0f);
    must(s.limit[0] < 1e-3f && s.reason == TC_DEAD_RECKONING, "brakes");
    must(!tc_supervisor_gives_up(&s, now_us), "nothing is given up");
}

static void limit_is_smooth(void) {
    follow_path(0.0f);
    float old[4];
    for (int i = 0; i < 1500; i++) {
        if (i == 100) at[1] = 0.8f * CLEARANCE_M;
        if (i == 800) at[1] = 0.0f;
        memcpy(old, s.limit, sizeof old);
        supervise(STEP_S);
        must(s.limit[0] >= -1e-6f && s.limit[0] <= 1.000001f, "within 0 and 1");
        must(near(s.limit[0], old[0], 0.2707f * RAMP_1_S * STEP_S * 1.02f), "no steeper than its ramp");
        for (int k = 0; k < 2 && i != 100 && i != 800; k++) {
            const float slope = (s.limit[k] - old[k]) / STEP_S, size = powf(RAMP_1_S, (float)k + 1.0f);
            must(near(slope, s.limit[k + 1], 0.02f * size), "derivatives are derivatives");
        }
        if (i > 102 && i < 799) {
            const float slope = (s.limit[2] - old[2]) / STEP_S;
            must(near(slope, s.limit[3], 0.04f * powf(RAMP_1_S, 3.0f)), "the third, too");
        }
    }
}

static void one_step_of_the_limit(void) {
    follow_path(0.8f * CLEARANCE_M);
    supervise(STEP_S);
    must(near(s.stage[0], 1.0f / (1.0f + RAMP_1_S * STEP_S), 1e-6f), "a low-pass, by its implicit step");
    follow_path(0.0f);
    tracking = false;
    supervise(5.0f);
    must(s.limit[0] < 1e-3f && s.reason == TC_DEAD_RECKONING, "without position it stands in the end");
}

/* A reason stands until the limit is gone, in each of its low-passes. */
static void reasons_last(void) {
    follow_path(0.5f * CLEARANCE_M);
    supervise(2.0f);
    at[1] = 0.0f;
    for (int i = 0; i < 1500; i++) {
        supervise(STEP_S);
        bool full = true;
        for (int k = 0; k < 3; k++) full = full && s.stage[k] > 0.999f;
        must(s.reason == (full ? TC_OK : TC_TRACKING_ERROR), "until all three are at full rate");
    }
    must(s.reason == TC_OK, "and not for ever");
    for (int k = 0; k < 3; k++) { /* one of them alone is enough to limit */
        follow_path(0.0f);
        s.reason = TC_TRACKING_ERROR;
        s.stage[k] = 0.99f;
        supervise(STEP_S);
        must(s.reason == TC_TRACKING_ERROR, "still shows");
    }
}

static void giving_up(void) {
    follow_path(1.02f * CLEARANCE_M);
    supervise(0.3f);
    must(!tc_supervisor_gives_up(&s, now_us), "0.3 s beyond the clearance are borne");
    supervise(STEP_S);
    must(tc_supervisor_gives_up(&s, now_us), "not more");
    follow_path(0.98f * CLEARANCE_M);
    supervise(2.0f);
    must(!tc_supervisor_gives_up(&s, now_us), "within it");
    follow_path(0.9f * CLEARANCE_M);
    supervise(1.9f); /* the limit falls below 1e-3 some time after */
    must(!tc_supervisor_gives_up(&s, now_us), "slows down first");
    float waited = 0.0f;
    while (!tc_supervisor_gives_up(&s, now_us) && waited < 10.0f) {
        const bool was_standing = s.limit[0] < 1e-3f;
        supervise(STEP_S);
        must(was_standing == (s.limit[0] < 1e-3f) || waited < STEP_S, "stands");
        if (was_standing) waited += STEP_S;
    }
    must(near(waited, 2.0f, 0.003f), "then waits 2 s for an approach");
    follow_path(0.95f * CLEARANCE_M);
    supervise(3.0f);
    for (int i = 0; i < 3; i++) {
        at[1] -= 0.06f * CLEARANCE_M;
        supervise(1.9f);
        must(!tc_supervisor_gives_up(&s, now_us), "comes nearer");
    }
    at[1] -= 0.04f * CLEARANCE_M;
    supervise(0.5f);
    must(tc_supervisor_gives_up(&s, now_us), "too little");
    follow_path(1.02f * CLEARANCE_M);
    for (int i = 0; i < 5; i++) {
        at[1] = 1.02f * CLEARANCE_M;
        supervise(0.28f);
        at[1] = 0.99f * CLEARANCE_M;
        supervise(STEP_S);
    }
    must(!tc_supervisor_gives_up(&s, now_us), "beyond it for too short a time");
}

static void shifts(void) {
    static const float by[3] = {0.3f, -0.4f, 0.0f}, faster[3] = {0.0f, 0.2f, -0.1f}, none[3] = {0.0f, 0.0f, 0.0f};
    follow_path(0.0f);
    tc_supervisor_shift(&s, by, none, 0.5f);
    tc_supervisor_shift(&s, none, faster, 0.0f);
    tc_setpoint a;
    memset(&a, 0, sizeof a);
    tc_supervisor_apply_shift(&s, &a);
    must(near(a.position_world_m[0], 0.3f, 1e-6f) && near(a.position_world_m[1], -0.4f, 1e-6f) &&
             near(a.yaw_rad, 0.5f, 1e-6f),
         "moves along");
    must(near(a.velocity_world_m_s[1], 0.2f, 1e-6f) && near(a.velocity_world_m_s[2], -0.1f, 1e-6f), "in velocity, too");
    at[0] = 0.0f;
    supervise(STEP_S);
    must(near(s.error_m, 0.5f, 2e-3f), "counts as error");
    tc_setpoint before, after;
    for (int i = 0; i < 5000; i++) {
        memset(&before, 0, sizeof before);
        memset(&after, 0, sizeof after);
        tc_supervisor_apply_shift(&s, &before);
        supervise(STEP_S);
        tc_supervisor_apply_shift(&s, &after);
        float from[20], to[20];
        memcpy(from, &before, sizeof from);
        memcpy(to, &after, sizeof to);
        for (int k = 0; k < 16; k++) {
            must(near((to[k] - from[k]) / STEP_S, 0.5f * (from[k + 4] + to[k + 4]), 6e-3f), "derivatives");
        }
        if (i == 999) { /* 2 s, critically damped with 1 s: (1 + t) e^-t = 0.406 */
            must(near(to[0], 0.3f * 0.406f, 2e-3f) && near(to[3], 0.5f * 0.406f, 2e-3f), "decays");
        }
    }
    must(near(s.shift[0], 0.0f, 1e-3f) && near(s.shift[1], 0.0f, 1e-3f) && near(s.shift[3], 0.0f, 1e-3f), "to nothing");
    must(near(s.error_m, 0.0f, 2e-3f), "no error is left");
}

void supervisor_cases(void) {
    starts_anew();
    limits_by_error();
    limit_is_smooth();
    one_step_of_the_limit();
    reasons_last();
    giving_up();
    shifts();
}
