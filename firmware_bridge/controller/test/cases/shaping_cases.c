/* Laws of the path clock, of moves and of the tracking supervisor's limit: what is said to be a derivative is one, what
   is said to be continuous is, and durations, limits and ends are those that the headers promise. */
#include <math.h>
#include <string.h>

#include "cases.h"
#include "goshawk_controller/shaping.h"

#define SEGMENTS 4
#define AXES 4

static const float full_rate[4] = {1.0f, 0.0f, 0.0f, 0.0f};
static tc_trajectory path;

static bool near(double a, double b, double tolerance) { return fabs(a - b) <= tolerance; }

/* Derivative `order` of an axis. */
static double number(const tc_setpoint* setpoint, int order, int axis) {
    float all[5 * AXES];
    memcpy(all, setpoint, sizeof all);
    return (double)all[AXES * order + axis];
}

static void put(tc_setpoint* setpoint, int order, int axis, float value) {
    float all[5 * AXES];
    memcpy(all, setpoint, sizeof all);
    all[AXES * order + axis] = value;
    memcpy(setpoint, all, sizeof all);
}

/* Four segments of different lengths along which every axis runs at a speed of its own: position is linear in time. */
static void make_path(void) {
    static const uint32_t duration_us[SEGMENTS] = {300000u, 100000u, 700000u, 250000u};
    static const float speed[AXES] = {2.0f, -1.0f, 0.5f, 0.7f};
    memset(&path, 0, sizeof path);
    path.header.segment_count = SEGMENTS;
    path.header.coefficient_count = 2;
    float now_s = 0.0f;
    for (int i = 0; i < SEGMENTS; i++) {
        const float duration_s = (float)duration_us[i] * 1e-6f;
        path.segment[i].duration_us = duration_us[i];
        path.start_us[i + 1] = path.start_us[i] + duration_us[i];
        for (int axis = 0; axis < AXES; axis++) { /* over x in [-1, 1] */
            path.segment[i].coefficient[axis][0] = speed[axis] * (now_s + 0.5f * duration_s);
            path.segment[i].coefficient[axis][1] = speed[axis] * 0.5f * duration_s;
        }
        now_s += duration_s;
    }
}

static double path_us(const tc_clock* clock) { return (double)clock->path_us + (double)clock->path_part_us; }

static void clock_at_a_steady_rate(void) {
    tc_clock clock;
    memset(&clock, 0xff, sizeof clock);
    tc_clock_start(&clock, 0.5f);
    must(clock.path_us == 0u && clock.segment == 0u && near((double)clock.path_part_us, 0.0, 0.0), "starts at zero");
    must(!tc_clock_standing(&clock) && !tc_clock_finished(&clock, &path), "runs");
    for (int i = 1; i <= 100; i++) {
        tc_clock_advance(&clock, &path, full_rate, 0.003f);
        must(near(path_us(&clock), 1500.0 * i, 0.5), "half as fast as time");
        for (int k = 1; k < 4; k++) must(near((double)clock.rate[k], 0.0, 0.0), "and steady");
    }
    tc_clock_start(&clock, 1.0f);
    tc_clock_advance(&clock, &path, full_rate, 5.0f);
    must(clock.path_us == 20000u, "20 ms are the longest step");
    tc_clock_advance(&clock, &path, full_rate, -5.0f);
    must(clock.path_us == 20000u, "none leads back");
    tc_clock_start(&clock, 2e-6f);
    must(!tc_clock_standing(&clock), "creeps");
    tc_clock_start(&clock, 0.8e-6f);
    must(tc_clock_standing(&clock), "stands");
}

static void the_cursor_follows(void) {
    tc_clock clock;
    tc_clock_start(&clock, 1.0f);
    const uint32_t end_us = path.start_us[SEGMENTS];
    while (!tc_clock_finished(&clock, &path)) {
        must(clock.path_us < end_us, "not finished before the end");
        must(path.start_us[clock.segment] <= clock.path_us && clock.path_us < path.start_us[clock.segment + 1],
             "the cursor's segment holds the path time");
        tc_clock_advance(&clock, &path, full_rate, 0.0125f);
    }
    must(clock.path_us == end_us && near((double)clock.path_part_us, 0.0, 0.0), "ends exactly at the end");
    tc_clock_advance(&clock, &path, full_rate, 0.02f);
    must(clock.path_us == end_us && clock.segment == SEGMENTS - 1, "and stays there");
    clock.path_us = path.start_us[2] - 10000u; /* the cursor one too far: goes back */
    clock.segment = 2u;
    tc_clock_advance(&clock, &path, full_rate, 0.001f);
    must(clock.segment == 1u, "one back");
    clock.path_us = 0u;
    clock.segment = 0u;
    tc_clock_advance(&clock, &path, full_rate, 0.001f);
    must(clock.segment == 0u, "not before the first");
}

/* The rate's derivatives are its derivatives, the path time its integral, whatever is retargeted when. */
static void rates_and_derivatives_agree(void) {
    static const struct {
        float target, ramp_s;
        int ticks;
    } script[] = {{0.3f, 0.5f, 500}, {1.0f, 0.4f, 150}, {0.1f, 0.6f, 200}, {0.0f, 0.5f, 600}, {0.6f, 0.3f, 400}};
    tc_clock clock;
    const float step = 0.001f;
    tc_clock_start(&clock, 1.0f);
    double integral_us = 0.0;
    for (unsigned s = 0; s < sizeof script / sizeof script[0]; s++) {
        double before[4];
        for (int k = 0; k < 4; k++) before[k] = (double)clock.rate[k];
        tc_clock_retarget(&clock, script[s].target, script[s].ramp_s);
        must(!tc_clock_standing(&clock), "a rate that changes does not stand");
        for (int i = 0; i < script[s].ticks; i++) {
            float old[4], old_flown = clock.flown[0];
            memcpy(old, clock.rate, sizeof old);
            tc_clock_advance(&clock, &path, full_rate, step);
            integral_us += 500.0 * ((double)old_flown + (double)clock.flown[0]);
            must(near(path_us(&clock), fmin(integral_us, 1350000.0), 3.0), "path time is the integral of the rate");
            if (i == 0) {
                for (int k = 0; k < 3; k++) {
                    must(near((double)clock.rate[k], before[k] + 1e-3 * before[k + 1], k == 2 ? 2.0 : 3e-3),
                         "goes on from rate, slope and bend");
                }
            } else if (i < 0.9 * (double)(script[s].ramp_s / step)) {
                for (int k = 0; k < 3; k++) { /* over one step the mean of the derivatives is the slope */
                    const double slope = ((double)clock.rate[k] - (double)old[k]) / (double)step;
                    const double mean = 0.5 * ((double)clock.rate[k + 1] + (double)old[k + 1]);
                    must(near(slope, mean, 2e-3 * pow(10.0, k)), "derivatives are derivatives");
                }
            } else {
                /* near the end of the ramp, a step may hold its end */
            }
            must((double)clock.rate[0] > -1e-5, "and no rate leads back");
        }
        if ((float)script[s].ticks * step > script[s].ramp_s + 0.01f) {
            must(near((double)clock.rate[0], (double)script[s].target, 1e-7), "arrives");
            for (int k = 1; k < 4; k++) must(near((double)clock.rate[k], 0.0, 0.0), "and is steady");
            must(tc_clock_standing(&clock) == (script[s].target < 1e-6f), "stands when the target is zero");
        }
    }
    /* From one steady rate to another: the quintic smooth step, at a half, a quarter of its time, and at its end. */
    tc_clock_start(&clock, 1.0f);
    tc_clock_retarget(&clock, 0.5f, 0.4f);
    for (int i = 0; i < 10; i++) tc_clock_advance(&clock, &path, full_rate, 0.01f);
    must(near((double)clock.rate[0], 1.0 - 0.5 * 0.103515625, 2e-5), "a quarter of the way");
    for (int i = 0; i < 10; i++) tc_clock_advance(&clock, &path, full_rate, 0.01f);
    must(near((double)clock.rate[0], 0.75, 2e-5) && near((double)clock.rate[1], -1.875 * 0.5 / 0.4, 2e-4), "half way");
    must(near((double)clock.rate[2], 0.0, 2e-3) && near((double)clock.rate[3], 30.0 * 0.5 / (0.4 * 0.4 * 0.4), 0.05),
         "where it is steepest");
    for (int i = 0; i < 19; i++) tc_clock_advance(&clock, &path, full_rate, 0.01f);
    must(clock.ramp_left_s > 0.0f, "not yet");
    for (int i = 0; i < 2; i++) tc_clock_advance(&clock, &path, full_rate, 0.01f);
    must(near((double)clock.ramp_left_s, 0.0, 0.0) && near((double)clock.rate[0], 0.5, 0.0), "over");
}

/* A limit multiplies the rate; velocities on the path are those of the product. */
static void a_limit_multiplies(void) {
    tc_clock clock;
    tc_clock_start(&clock, 0.8f);
    tc_clock_retarget(&clock, 0.4f, 1.0f);
    const float step = 0.002f;
    float old[4];
    double integral_us = 0.0;
    for (int i = 0; i < 450; i++) { /* the limit: 0.6 + 0.4 cos(3 t) */
        const double t = 3.0 * (double)step * (i + 1);
        const float limit[4] = {(float)(0.6 + 0.4 * cos(t)), (float)(-1.2 * sin(t)), (float)(-3.6 * cos(t)),
                                (float)(10.8 * sin(t))};
        memcpy(old, clock.flown, sizeof old);
        tc_clock_advance(&clock, &path, limit, step);
        must(near((double)clock.flown[0], (double)clock.rate[0] * (double)limit[0], 1e-6), "the product");
        integral_us += 1e3 * ((double)old[0] + (double)clock.flown[0]);
        if (i == 0) integral_us = 1e6 * (double)step * 0.8;
        must(near(path_us(&clock), integral_us, 6.0), "path time is its integral");
        for (int k = 0; k < 3 && i > 0; k++) {
            const double slope = ((double)clock.flown[k] - (double)old[k]) / (double)step;
            const double mean = 0.5 * ((double)clock.flown[k + 1] + (double)old[k + 1]);
            must(near(slope, mean, 3e-3 * pow(10.0, k)), "derivatives of a product");
        }
        tc_setpoint setpoint;
        tc_clock_setpoint(&clock, &path, &setpoint);
        must(near(number(&setpoint, 0, 0), 2e-6 * path_us(&clock), 2e-6), "on the path");
        must(near(number(&setpoint, 1, 0), 2.0 * (double)clock.flown[0], 1e-5), "as fast as it is flown");
        for (int k = 1; k < 4; k++) {
            must(near(number(&setpoint, k + 1, 1), -(double)clock.flown[k], 1e-3 * pow(10.0, k - 1)), "in every order");
        }
    }
}

/* Anything that moves in every axis and order. */
static tc_setpoint somewhere(float scale) {
    tc_setpoint from;
    memset(&from, 0, sizeof from);
    for (int axis = 0; axis < AXES; axis++) {
        put(&from, 0, axis, 1.0f + (float)axis);
        put(&from, 1, axis, scale * (0.5f - 0.3f * (float)axis));
        put(&from, 2, axis, scale * (0.4f * (float)axis - 0.7f));
        put(&from, 3, axis, scale * (1.0f - 0.8f * (float)axis));
    }
    return from;
}

static void is_at_rest(const tc_move* move, const double at[AXES]) {
    tc_setpoint end;
    tc_move_setpoint(move, &end);
    for (int axis = 0; axis < AXES; axis++) {
        must(near(number(&end, 0, axis), at[axis], 1e-5), "ends where it should");
        for (int order = 1; order < 4; order++) must(near(number(&end, order, axis), 0.0, 1e-4), "at rest");
    }
}

/* The move goes on from `from` without a step in position, velocity, acceleration and jerk, derivatives are
   derivatives, and it ends at rest at `to`. Returns the peaks of speed, acceleration and yaw rate. */
static void flown(tc_move* move, const tc_setpoint* from, const double to[AXES], double peak[3]) {
    tc_setpoint now, next;
    tc_move_setpoint(move, &now);
    for (int order = 0; order < 4; order++) {
        for (int axis = 0; axis < AXES; axis++) {
            must(near(number(&now, order, axis), number(from, order, axis), 2e-4 * pow(8.0, order)),
                 "goes on unbroken");
        }
    }
    must(!tc_move_done(move), "takes its time");
    memset(peak, 0, 3u * sizeof *peak);
    const double step = (double)move->duration_s / 200.0;
    while (!tc_move_done(move)) {
        const bool last = (double)move->left_s <= step;
        tc_move_advance(move, (float)step);
        tc_move_setpoint(move, &next);
        double speed = 0.0, acceleration = 0.0;
        for (int axis = 0; axis < AXES && !last; axis++) {
            for (int order = 0; order < 4; order++) {
                const double slope = (number(&next, order, axis) - number(&now, order, axis)) / step;
                const double mean = 0.5 * (number(&next, order + 1, axis) + number(&now, order + 1, axis));
                const double size = fabs(number(&next, 4, axis)) + (order < 2 ? 3.0 : 30.0);
                must(near(slope, mean, 4e-3 * size), "so they are of a move");
            }
        }
        for (int axis = 0; axis < 3; axis++) {
            speed += number(&next, 1, axis) * number(&next, 1, axis);
            acceleration += number(&next, 2, axis) * number(&next, 2, axis);
        }
        peak[0] = fmax(peak[0], sqrt(speed));
        peak[1] = fmax(peak[1], sqrt(acceleration));
        peak[2] = fmax(peak[2], fabs(number(&next, 1, 3)));
        now = next;
    }
    is_at_rest(move, to);
    tc_move_advance(move, 1.0f);
    must(tc_move_done(move), "stays done");
    is_at_rest(move, to);
}

static void moves_to_a_point(void) {
    static const float to[3] = {4.0f, -2.0f, 2.5f};
    static const double end[AXES] = {4.0, -2.0, 2.5, 1.2};
    const double length = sqrt(9.0 + 16.0 + 0.25);
    double peak[3];
    tc_move move;
    memset(&move, 0, sizeof move);
    const tc_setpoint rest = somewhere(0.0f), moving = somewhere(1.0f);
    tc_move_start(&move, &moving, to, 1.2f, 1.0f);
    flown(&move, &moving, end, peak);
    tc_move_start(&move, &rest, to, 1.2f, 1.0f); /* slow: the speed decides */
    must(near((double)move.duration_s, 2.1875 * length, 1e-3), "as long as the speed asks for");
    flown(&move, &rest, end, peak);
    must(near(peak[0], 1.0, 2e-3), "and just as fast");
    static const double straight[AXES] = {4.0, -2.0, 2.5, 4.0};
    tc_move_start(&move, &rest, to, 4.0f, 100.0f); /* the acceleration decides */
    must(near((double)move.duration_s, sqrt(7.513 * length / 2.0), 1e-3), "as long as the acceleration asks for");
    flown(&move, &rest, straight, peak);
    must(near(peak[1], 2.0, 5e-3), "and that is the peak");
    const float here[3] = {1.0f, 2.0f, 3.0f};
    const double turned[AXES] = {1.0, 2.0, 3.0, 7.0};
    tc_move_start(&move, &rest, here, 7.0f, 1.0f); /* the turn decides */
    flown(&move, &rest, turned, peak);
    must(near(peak[2], 1.0, 2e-3), "a radian a second");
    tc_move_start(&move, &rest, here, 1.0f, 1.0f);
    const double back[AXES] = {1.0, 2.0, 3.0, 1.0};
    flown(&move, &rest, back, peak);
    must(near(peak[2], 1.0, 2e-3), "the other way, too");
    tc_move_start(&move, &rest, here, 4.0f, 1.0f);
    must(near((double)move.duration_s, 0.5, 0.0), "no move is shorter than half a second");
}

static void stops_straight_ahead(void) {
    double peak[3], end[AXES];
    tc_move move;
    memset(&move, 0, sizeof move);
    tc_setpoint from;
    memset(&from, 0, sizeof from);
    put(&from, 0, 2, 2.0f);
    put(&from, 1, 0, 3.0f);
    put(&from, 1, 1, -4.0f);
    tc_move_stop(&move, &from, 6.0f);
    must(near((double)move.duration_s, 10.0 / 6.0, 1e-5), "half the brake on the mean");
    for (int axis = 0; axis < AXES; axis++) {
        end[axis] = number(&from, 0, axis) + 0.5 * (double)move.duration_s * number(&from, 1, axis);
    }
    flown(&move, &from, end, peak);
    must(peak[1] < 6.0 && peak[1] > 5.0, "and less than the brake at the peak");
    must(peak[0] <= 5.0001, "never faster than it was");
    const tc_setpoint moving = somewhere(1.0f);
    tc_move_stop(&move, &moving, 6.0f);
    must(near((double)move.duration_s, 0.5, 0.0), "not shorter than half a second");
    for (int axis = 0; axis < AXES; axis++) {
        end[axis] = number(&moving, 0, axis) + 0.25 * number(&moving, 1, axis);
    }
    flown(&move, &moving, end, peak);
}

static void moves_are_shifted_as_a_whole(void) {
    static const float to[3] = {4.0f, -2.0f, 2.5f}, by[3] = {0.5f, -0.25f, 1.0f};
    const tc_setpoint from = somewhere(1.0f);
    tc_move plain, shifted;
    memset(&plain, 0, sizeof plain);
    tc_move_start(&plain, &from, to, 1.2f, 1.0f);
    shifted = plain;
    tc_move_shift(&shifted, by, 0.125f);
    for (int i = 0; i < 40; i++) {
        tc_setpoint a, b;
        tc_move_advance(&plain, 0.1f);
        tc_move_advance(&shifted, 0.1f);
        tc_move_setpoint(&plain, &a);
        tc_move_setpoint(&shifted, &b);
        for (int axis = 0; axis < AXES; axis++) {
            const double offset = axis < 3 ? (double)by[axis] : 0.125;
            must(near(number(&b, 0, axis), number(&a, 0, axis) + offset, 1e-5), "shifted");
            for (int order = 1; order < 5; order++) {
                must(near(number(&b, order, axis), number(&a, order, axis), 1e-6), "and nothing else");
            }
        }
    }
}

void shaping_cases(void) {
    make_path();
    clock_at_a_steady_rate();
    the_cursor_follows();
    rates_and_derivatives_agree();
    a_limit_multiplies();
    moves_to_a_point();
    stops_straight_ahead();
    moves_are_shifted_as_a_whole();
}
