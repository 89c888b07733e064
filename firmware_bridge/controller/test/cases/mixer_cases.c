/* The mixer against two references in double precision that share no code with it: the thrust law solved by bisection,
   and desaturation as the header words it (tilt, then collective, then yaw with its guaranteed share), searched by
   bisection over the shares. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "cases.h"
#include "goshawk_controller/mixer.h"

#define FLAG_BAND 4e-3 /* so close to the mixer's own threshold a flag may be set or not */

static uint32_t state = 1u;

static double draw(double low, double high) {
    state = state * 1664525u + 1013904223u;
    return low + (high - low) * (double)(state >> 8) / 16777216.0;
}

typedef struct {
    double x[4], y[4], pinv[4][3], free[4]; /* thrusts of least norm for collective, torque x, torque y; null vector */
} geometry;

/* Thrusts that are orthogonal to the null vector and produce the wrench: Cramer's rule on a 4x4 system. */
static double determinant(double m[4][4]) {
    double a[4][4], product = 1.0;
    memcpy(a, m, sizeof a);
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int i = k + 1; i < 4; i++) {
            if (fabs(a[i][k]) > fabs(a[pivot][k])) pivot = i;
        }
        if (fabs(a[pivot][k]) < 1e-15) return 0.0;
        for (int j = 0; j < 4; j++) {
            const double swap = a[k][j];
            a[k][j] = a[pivot][j];
            a[pivot][j] = swap;
        }
        product *= pivot == k ? a[k][k] : -a[k][k];
        for (int i = k + 1; i < 4; i++) {
            const double factor = a[i][k] / a[k][k];
            for (int j = k; j < 4; j++) a[i][j] -= factor * a[k][j];
        }
    }
    return product;
}

static void solve(double m[4][4], const double right[4], double out[4]) {
    const double whole = determinant(m);
    for (int k = 0; k < 4; k++) {
        double a[4][4];
        memcpy(a, m, sizeof a);
        for (int i = 0; i < 4; i++) a[i][k] = right[i];
        out[k] = determinant(a) / whole;
    }
}

static geometry geometry_of(const tc_parameters* p) {
    geometry g;
    double m[4][4], largest = 0.0;
    for (int i = 0; i < 4; i++) {
        g.x[i] = (double)p->rotor_x_m[i] - (double)p->centre_of_mass_m[0];
        g.y[i] = (double)p->rotor_y_m[i] - (double)p->centre_of_mass_m[1];
        m[0][i] = 1.0;
        m[1][i] = g.y[i];
        m[2][i] = -g.x[i];
        m[3][i] = (i & 1) == 0 ? 1.0 : 0.0; /* any row that is not a combination of the others */
    }
    const double last[4] = {0.0, 0.0, 0.0, 1.0};
    solve(m, last, g.free);
    for (int i = 0; i < 4; i++) largest = fmax(largest, fabs(g.free[i]));
    for (int i = 0; i < 4; i++) m[3][i] = g.free[i] /= largest;
    for (int k = 0; k < 3; k++) {
        double right[4] = {0.0, 0.0, 0.0, 0.0}, column[4];
        right[k] = 1.0;
        solve(m, right, column);
        for (int i = 0; i < 4; i++) g.pinv[i][k] = column[i];
    }
    return g;
}

static tc_parameters vehicle(float thrust_model) {
    tc_parameters p;
    tc_parameters_default(&p);
    p.thrust_model = thrust_model;
    return p;
}

/* A geometry, and rotors, that nothing is symmetrical about. */
static void disturb(tc_parameters* p) {
    for (int i = 0; i < 4; i++) {
        p->rotor_x_m[i] += (float)draw(-0.015, 0.015);
        p->rotor_y_m[i] += (float)draw(-0.015, 0.015);
        p->rotor_gain[i] = (float)draw(0.8, 1.2);
    }
    p->centre_of_mass_m[0] = (float)draw(-0.01, 0.01);
    p->centre_of_mass_m[1] = (float)draw(-0.01, 0.01);
}

/* Thrust of a rotor at a speed: v from eq. (2) by bisection, then eq. (1). */
static double thrust(const tc_parameters* p, int rotor, double n, const double air[3]) {
    const double lateral2 = air[0] * air[0] + air[1] * air[1], lift = (double)p->lift_kg_m * lateral2;
    if (p->thrust_model < 0.5f) {
        return (double)p->rotor_gain[rotor] * ((double)p->quad_n_s2 * n * n - (double)p->inflow_kg * n * air[2] + lift);
    }
    const double disk = 2.0 * (double)p->air_density_kg_m3 * (double)p->disk_area_m2;
    double low = 0.0, high = 60.0, law = 0.0;
    for (int k = 0; k < 80; k++) {
        const double v = 0.5 * (low + high), through = air[2] + v;
        law = (double)p->k1_n_s2 * n * n + (double)p->k2_n_s2_m * through * n;
        const double flow = disk * v * sqrt(through * through + (p->thrust_model > 1.5f ? lateral2 : 0.0));
        if (flow < law) {
            low = v;
        } else {
            high = v;
        }
    }
    return (double)p->rotor_gain[rotor] * (law + lift);
}

typedef struct {
    float air[3], rate[3];
} flow;

static flow random_flow(void) {
    flow f;
    for (int i = 0; i < 3; i++) f.rate[i] = (float)draw(-4.0, 4.0);
    f.air[0] = (float)draw(-10.0, 10.0);
    f.air[1] = (float)draw(-10.0, 10.0);
    f.air[2] = (float)draw(-2.0, 5.0);
    return f;
}

static uint8_t solve_in(const tc_mixer* mixer, const tc_wrench* demand, const float air[3], const float rate[3],
                        float speed[TC_ROTORS]) {
    tc_mixer_flow at_hubs;
    tc_mixer_flow_at(mixer, air, rate, &at_hubs);
    return tc_mixer_solve(mixer, demand, &at_hubs, speed);
}

/* Force along body z and torques of four speeds, in double; smallest thrust of one rotor. */
static double forward(const tc_parameters* p, const geometry* g, const flow* f, const double n[4], double wrench[4]) {
    double least = DBL_MAX;
    memset(wrench, 0, 4u * sizeof *wrench);
    for (int i = 0; i < 4; i++) {
        const double air[3] = {(double)f->air[0] - (double)f->rate[2] * g->y[i],
                               (double)f->air[1] + (double)f->rate[2] * g->x[i],
                               (double)f->air[2] + (double)f->rate[0] * g->y[i] - (double)f->rate[1] * g->x[i]};
        const double t = thrust(p, i, n[i], air);
        least = fmin(least, t);
        wrench[0] += t;
        wrench[1] += g->y[i] * t;
        wrench[2] -= g->x[i] * t;
        wrench[3] += (double)p->rotor_spin[i] * (double)p->cq_n_m_s2 * n[i] * n[i];
    }
    return least;
}

static tc_wrench demand_of(const double wrench[4]) {
    return (tc_wrench){(float)wrench[0], {(float)wrench[1], (float)wrench[2], (float)wrench[3]}};
}

/* A demand that some speeds produce is met by these speeds, in every law, at any flow, for any geometry. */
static void feasible_demands_are_met(void) {
    for (int k = 0; k < 600; k++) {
        tc_parameters p = vehicle((float)(k % 3));
        if (k >= 200) disturb(&p);
        if (k % 4 == 3) p.lift_kg_m = 1e-4f;
        if (k % 3 == 0) p.inflow_kg = 1e-5f;
        tc_mixer mixer;
        must(tc_mixer_configure(&mixer, &p) == TC_OK, "the mixer takes the geometry");
        const geometry g = geometry_of(&p);
        const flow f = random_flow();
        double n[4], wrench[4];
        for (int i = 0; i < 4; i++) n[i] = draw(500.0, 1700.0);
        if (forward(&p, &g, &f, n, wrench) < 0.02) continue; /* windmilling */
        float speed[TC_ROTORS];
        const tc_wrench demand = demand_of(wrench);
        const uint8_t saturation = solve_in(&mixer, &demand, f.air, f.rate, speed);
        for (int i = 0; i < 4; i++) must(fabs((double)speed[i] - n[i]) < 0.04, "speeds come back");
        must(saturation == 0u, "a feasible demand is not saturated");
    }
}

typedef struct {
    double thrust_n[4];
    double tilt, collective_n, yaw; /* share given, change made, share given of what is beyond the guarantee */
} desaturated;

/* Changes of the collective that keep all thrusts within their limits; empty when first > last. */
static void room(const geometry* g, const double t[4], const double least[4], const double most[4], double* first,
                 double* last) {
    *first = -DBL_MAX;
    *last = DBL_MAX;
    for (int i = 0; i < 4; i++) {
        *first = fmax(*first, (least[i] - t[i]) / g->pinv[i][0]);
        *last = fmin(*last, (most[i] - t[i]) / g->pinv[i][0]);
    }
}

/* What the header promises, where thrust is linear in the squared speed. */
static desaturated reference(const tc_parameters* p, const geometry* g, const double wrench[4]) {
    double least[4], most[4], yaw_per_free = 0.0, t[4], first, last;
    const double quad = (double)p->quad_n_s2, low_n = (double)p->rotor_min_rad_s, high_n = (double)p->rotor_max_rad_s;
    desaturated out;
    for (int i = 0; i < 4; i++) {
        least[i] = (double)p->rotor_gain[i] * quad * low_n * low_n;
        most[i] = (double)p->rotor_gain[i] * quad * high_n * high_n;
    }
    double offset = 0.0; /* yaw torque of the thrusts of least norm */
    for (int i = 0; i < 4; i++) {
        const double per_n = (double)p->rotor_spin[i] * (double)p->cq_n_m_s2 / (quad * (double)p->rotor_gain[i]);
        yaw_per_free += per_n * g->free[i];
        for (int k = 0; k < 3; k++) offset += per_n * g->pinv[i][k] * wrench[k];
    }
    const double wanted = (wrench[3] - offset) / yaw_per_free;
    const double guaranteed = 0.5 * (double)p->yaw_share * quad * (high_n * high_n - low_n * low_n);
    const double kept = fmax(fmin(wanted, guaranteed), -guaranteed);
    bool feasible = true; /* as it is: then nothing is given up for anything */
    for (int i = 0; i < 4; i++) {
        t[i] = g->pinv[i][0] * wrench[0] + g->pinv[i][1] * wrench[1] + g->pinv[i][2] * wrench[2] + g->free[i] * wanted;
        feasible = feasible && t[i] >= least[i] && t[i] <= most[i];
    }
    if (feasible) {
        memcpy(out.thrust_n, t, sizeof t);
        out.tilt = out.yaw = 1.0;
        out.collective_n = 0.0;
        return out;
    }
    double share = 0.0;
    for (double step = 1.0; step > 1e-9;
         step *= 0.5) { /* the largest share of tilt that leaves room for a collective */
        if (share + step > 1.0) continue;
        for (int i = 0; i < 4; i++) {
            t[i] = g->pinv[i][0] * wrench[0] + g->free[i] * kept +
                   (share + step) * (g->pinv[i][1] * wrench[1] + g->pinv[i][2] * wrench[2]);
        }
        room(g, t, least, most, &first, &last);
        if (first <= last + 1e-12) share += step;
    }
    for (int i = 0; i < 4; i++) {
        t[i] = g->pinv[i][0] * wrench[0] + g->free[i] * kept +
               share * (g->pinv[i][1] * wrench[1] + g->pinv[i][2] * wrench[2]);
    }
    room(g, t, least, most, &first, &last);
    out.tilt = share;
    out.collective_n = fmin(fmax(0.0, first), last);
    out.yaw = 0.0;
    for (int i = 0; i < 4; i++) t[i] += g->pinv[i][0] * out.collective_n;
    for (double step = 1.0; step > 1e-9; step *= 0.5) {
        bool fits = out.yaw + step <= 1.0;
        for (int i = 0; i < 4; i++) {
            const double with = t[i] + g->free[i] * (wanted - kept) * (out.yaw + step);
            fits = fits && with >= least[i] - 1e-9 && with <= most[i] + 1e-9;
        }
        if (fits) out.yaw += step;
    }
    if (!(fabs(wanted - kept) > 0.0)) out.yaw = 1.0; /* nothing beyond the guarantee is wanted */
    for (int i = 0; i < 4; i++) out.thrust_n[i] = t[i] + g->free[i] * (wanted - kept) * out.yaw;
    return out;
}

static void flag_agrees(uint8_t saturation, uint8_t bit, double missing, const char* what) {
    if (missing > 1e-3 + FLAG_BAND) must((saturation & bit) != 0u, what);
    if (missing < 1e-3 - 5e-4) must((saturation & bit) == 0u, what);
}

/* Demands from easy to far beyond the rotors: thrusts are those of the reference, and so are the flags. */
static void desaturation_keeps_the_order(void) {
    static const flow still = {{0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}};
    unsigned cut_tilt = 0, changed_collective = 0, cut_yaw = 0, untouched = 0;
    for (int k = 0; k < 4000; k++) {
        tc_parameters p = vehicle(0.0f);
        if (k % 2 == 1) disturb(&p);
        if (k % 5 == 4) p.yaw_share = (float)draw(0.0, 0.5);
        tc_mixer mixer;
        must(tc_mixer_configure(&mixer, &p) == TC_OK, "the mixer takes the geometry");
        const geometry g = geometry_of(&p);
        const double size = draw(0.0, 1.0), arm = fabs(g.y[0]);
        const double most_n = (double)mixer.largest_thrust_n;
        const double wrench[4] = {draw(-0.1, 1.2) * most_n, size * draw(-0.6, 0.6) * most_n * arm,
                                  size * draw(-0.6, 0.6) * most_n * arm,
                                  draw(0.0, 1.0) * draw(-0.6, 0.6) * most_n * (double)(p.cq_n_m_s2 / p.quad_n_s2)};
        const desaturated wanted = reference(&p, &g, wrench);
        float speed[TC_ROTORS];
        const tc_wrench demand = demand_of(wrench);
        const uint8_t saturation = solve_in(&mixer, &demand, still.air, still.rate, speed);
        for (int i = 0; i < 4; i++) {
            const double given = (double)(p.rotor_gain[i] * p.quad_n_s2) * (double)speed[i] * (double)speed[i];
            must(speed[i] >= p.rotor_min_rad_s && speed[i] <= p.rotor_max_rad_s, "speeds are within the limits");
            must(fabs(given - wanted.thrust_n[i]) < 2e-4 * most_n, "thrusts are those of the reference");
        }
        flag_agrees(saturation, TC_SATURATED_TILT, 1.0 - wanted.tilt, "the tilt flag is right");
        flag_agrees(saturation, TC_SATURATED_COLLECTIVE, fabs(wanted.collective_n) / fmax(fabs(wrench[0]), 1e-9),
                    "the collective flag is right");
        flag_agrees(saturation, TC_SATURATED_YAW, 1.0 - wanted.yaw, "the yaw flag is right");
        must((saturation & ~7u) == 0u, "no other flag is set");
        cut_tilt += wanted.tilt < 0.99 ? 1u : 0u;
        changed_collective += fabs(wanted.collective_n) > 0.01 * most_n ? 1u : 0u;
        cut_yaw += wanted.yaw < 0.99 ? 1u : 0u;
        untouched += saturation == 0u ? 1u : 0u;
    }
    must(cut_tilt > 200u && changed_collective > 200u && cut_yaw > 200u && untouched > 200u, "all of them occur");
}

/* With inflow the squared speeds follow the demand only nearly linearly: tilt torque stays within 3 % where the
   collective pays for it, and nothing leaves the limits whatever is asked. */
static void saturated_in_fast_air(void) {
    tc_parameters p = vehicle(2.0f);
    tc_mixer mixer;
    must(tc_mixer_configure(&mixer, &p) == TC_OK, "the presets are accepted");
    const geometry g = geometry_of(&p);
    const double most_n = (double)mixer.largest_thrust_n, torque = 0.1 * most_n * fabs(g.y[0]);
    for (int k = 0; k < 400; k++) {
        const flow f = random_flow();
        const double wanted[4] = {(k % 2 == 0 ? 1.1 : 0.0) * most_n, draw(-torque, torque), draw(-torque, torque), 0.0};
        const tc_wrench demand = demand_of(wanted);
        float speed[TC_ROTORS];
        const uint8_t saturation = solve_in(&mixer, &demand, f.air, f.rate, speed);
        double n[4], got[4];
        for (int i = 0; i < 4; i++) n[i] = (double)speed[i];
        (void)forward(&p, &g, &f, n, got);
        must((saturation & TC_SATURATED_COLLECTIVE) != 0u && (saturation & TC_SATURATED_TILT) == 0u, "collective pays");
        must(fabs(got[1] - wanted[1]) < 0.15 * torque && fabs(got[2] - wanted[2]) < 0.15 * torque, "for the tilt");
    }
    for (int k = 0; k < 2000; k++) {
        const flow f = random_flow();
        const double wild = k % 3 == 0 ? 1e3 : 10.0;
        const double wanted[4] = {draw(-wild, wild), draw(-wild, wild), draw(-wild, wild), draw(-wild, wild)};
        const tc_wrench demand = demand_of(wanted);
        float speed[TC_ROTORS];
        (void)solve_in(&mixer, &demand, f.air, f.rate, speed);
        for (int i = 0; i < 4; i++) {
            must(speed[i] >= p.rotor_min_rad_s && speed[i] <= p.rotor_max_rad_s, "whatever is asked for");
        }
    }
}

/* Demands and flows that are no numbers, or beyond all bounds, give speeds within the limits and say so. */
static void nonsense_is_clipped(void) {
    tc_parameters p = vehicle(2.0f);
    tc_mixer mixer;
    must(tc_mixer_configure(&mixer, &p) == TC_OK, "the presets are accepted");
    static const float strange[] = {NAN, INFINITY, -INFINITY, 1e30f, -1e30f};
    for (unsigned k = 0; k < 5u; k++) {
        for (unsigned place = 0; place < 5u; place++) {
            tc_wrench demand = {p.mass_kg * p.gravity_m_s2, {0.0f, 0.0f, 0.0f}};
            float air[3] = {0.0f, 0.0f, 0.0f}, speed[TC_ROTORS];
            const float rate[3] = {0.0f, 0.0f, 0.0f};
            if (place == 0u) demand.thrust_n = strange[k];
            if (place >= 1u && place < 4u) demand.torque_n_m[place - 1u] = strange[k];
            if (place == 4u) air[2] = strange[k];
            const uint8_t saturation = solve_in(&mixer, &demand, air, rate, speed);
            for (int i = 0; i < 4; i++) {
                must(speed[i] >= p.rotor_min_rad_s && speed[i] <= p.rotor_max_rad_s, "numbers within the limits");
            }
            must(saturation != 0u, "and a flag");
            if (k == 0u) must((saturation & TC_SATURATED_ROTOR) != 0u, "NaN is clipped at the end");
        }
    }
}

/* The plain square law from the smallest coefficient that a parameter may have to the largest: no guard against a
   division by zero shows in the speeds. */
static void square_law_of_any_size(void) {
    for (int decade = -10; decade <= -1; decade++) {
        tc_parameters p = vehicle(0.0f);
        tc_mixer mixer;
        p.centre_of_mass_m[0] = p.centre_of_mass_m[1] = 0.0f;
        p.quad_n_s2 = powf(10.0f, (float)decade);
        const double square = (double)p.quad_n_s2;
        const double hover_rad_s = sqrt((double)(p.mass_kg * p.gravity_m_s2) / (4.0 * square));
        p.rotor_min_rad_s = p.rotor_idle_rad_s = (float)(0.2 * hover_rad_s);
        p.rotor_max_rad_s = (float)(2.0 * hover_rad_s);
        must(tc_mixer_configure(&mixer, &p) == TC_OK, "can hover");
        for (int k = 0; k < 200; k++) {
            const float still[3] = {0.0f, 0.0f, 0.0f};
            const double speed = draw(0.3, 1.9) * hover_rad_s;
            const tc_wrench demand = {(float)(4.0 * square * speed * speed), {0.0f, 0.0f, 0.0f}};
            float n[TC_ROTORS];
            must(solve_in(&mixer, &demand, still, still, n) == 0u, "within the limits");
            for (int i = 0; i < 4; i++) must(fabs((double)n[i] - speed) < 1e-5 * speed, "the root of the demand");
        }
    }
}

/* The wrench of the speeds that the mixer finds is the demand, under every thrust law and for rotors of unlike gains.
 */
static void forwards_and_back(void) {
    for (int k = 0; k < 3000; k++) {
        tc_parameters p = vehicle((float)(k % 3));
        tc_mixer mixer;
        for (int i = 0; i < 4; i++) p.rotor_gain[i] = (float)draw(0.8, 1.2);
        p.lift_kg_m = k % 2 == 0 ? 0.002f : 0.0f;
        must(tc_mixer_configure(&mixer, &p) == TC_OK, "accepted");
        const tc_wrench demand = {
            p.mass_kg * p.gravity_m_s2 * (float)draw(0.7, 1.8),
            {(float)draw(-0.05, 0.05), (float)draw(-0.05, 0.05), (float)draw(-0.005, 0.005)},
        };
        const float air[3] = {(float)draw(-8.0, 8.0), (float)draw(-8.0, 8.0), (float)draw(-2.0, 4.0)};
        const float rate[3] = {(float)draw(-4.0, 4.0), (float)draw(-4.0, 4.0), (float)draw(-2.0, 2.0)};
        float speed[TC_ROTORS], induced[TC_ROTORS] = {0.0f, 0.0f, 0.0f, 0.0f};
        if (solve_in(&mixer, &demand, air, rate, speed) != 0u) continue;
        tc_wrench found;
        tc_mixer_flow flow;
        tc_mixer_flow_at(&mixer, air, rate, &flow);
        for (int round = 0; round < 12; round++) tc_mixer_wrench(&mixer, speed, &flow, induced, &found);
        must(fabsf(found.thrust_n - demand.thrust_n) < 1e-3f * demand.thrust_n, "the collective");
        for (int i = 0; i < 3; i++) must(fabsf(found.torque_n_m[i] - demand.torque_n_m[i]) < 1e-3f, "the torque");
    }
}

/* What cannot produce an arbitrary wrench, or cannot hover, is refused. */
static void configurations_refused(void) {
    tc_mixer mixer;
    tc_parameters p = vehicle(2.0f);
    p.mass_kg = 40.0f;
    must(tc_mixer_configure(&mixer, &p) == TC_CANNOT_HOVER, "too heavy");
    p = vehicle(2.0f);
    for (int i = 0; i < 4; i++) p.rotor_y_m[i] = 0.0f;
    must(tc_mixer_configure(&mixer, &p) == TC_SINGULAR_GEOMETRY, "in a line");
    p = vehicle(2.0f);
    for (int i = 0; i < 4; i++) p.rotor_x_m[i] = p.rotor_y_m[i] = 0.0f;
    must(tc_mixer_configure(&mixer, &p) == TC_SINGULAR_GEOMETRY, "in a point");
    p = vehicle(2.0f);
    for (int i = 0; i < 4; i++) p.rotor_spin[i] = 1.0f;
    must(tc_mixer_configure(&mixer, &p) == TC_SINGULAR_GEOMETRY, "all turn one way");
    p = vehicle(2.0f);
    p.rotor_spin[2] = 0.0f;
    must(tc_mixer_configure(&mixer, &p) == TC_SINGULAR_GEOMETRY, "one has no direction");
    p = vehicle(2.0f);
    p.rotor_max_rad_s = p.rotor_min_rad_s;
    must(tc_mixer_configure(&mixer, &p) == TC_OUT_OF_RANGE, "no room between the limits");
}

void mixer_cases(void) {
    feasible_demands_are_met();
    desaturation_keeps_the_order();
    saturated_in_fast_air();
    nonsense_is_clipped();
    square_law_of_any_size();
    forwards_and_back();
    configurations_refused();
}
