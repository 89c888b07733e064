/* Rigid body, rotors, air, floor. */
#include "body.h"

#include <math.h>
#include <string.h>

#define LONGEST_SUBSTEP_S 0.5e-3
#define CONTACT_SUBSTEP_S 0.25e-3
#define CLEAR_M 0.05
#define CLEAR_S 0.1
#define FRICTION_N_S_M 200.0 /* slope of the friction force at the smallest slip */
#define BLOCK_N_M 60.0
#define BLOCK_N_S_M 8.0

static uint64_t next(body_random* random) { /* SplitMix64 */
    random->state += 0x9e3779b97f4a7c15u;
    uint64_t z = random->state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double body_uniform(body_random* random) { return (double)(next(random) >> 11) * 0x1p-53; }

void body_seed(body_random* random, uint64_t seed, uint64_t stream) {
    random->state = seed;
    random->state = next(random) + stream;
    random->state = next(random);
}

double body_normal(body_random* random) { /* sum of twelve uniform numbers: tails end at 6, which is enough here */
    double sum = -6.0;
    for (int i = 0; i < 12; i++) sum += body_uniform(random);
    return sum;
}

void body_vehicle_default(body_vehicle* v) {
    static const double x[BODY_ROTORS] = {0.0885, -0.0885, -0.0885, 0.0885};
    static const double y[BODY_ROTORS] = {0.0885, 0.0885, -0.0885, -0.0885};
    static const double spin[BODY_ROTORS] = {1.0, -1.0, 1.0, -1.0};
    memset(v, 0, sizeof *v);
    memcpy(v->rotor_x_m, x, sizeof x);
    memcpy(v->rotor_y_m, y, sizeof y);
    memcpy(v->spin, spin, sizeof spin);
    v->mass_kg = 0.7;
    v->gravity_m_s2 = 9.80665;
    v->inertia_kg_m2[0] = 0.00306;
    v->inertia_kg_m2[1] = 0.00442;
    v->inertia_kg_m2[2] = 0.00441;
    v->centre_of_mass_m[0] = 0.0014;
    v->centre_of_mass_m[1] = 0.00018;
    v->k1_n_s2 = 3.119e-6;
    v->k2_n_s2_m = -1.547e-4;
    v->cq_n_m_s2 = 3.1e-8;
    v->air_density_kg_m3 = 1.2;
    v->disk_area_m2 = 0.0126677;
    v->rotor_drag_s_m = 0.0175;
    v->parasitic_kg_m[0] = v->parasitic_kg_m[1] = 0.0055;
    v->parasitic_kg_m[2] = 0.0185;
    v->rotor_lag_s = 0.03;
    v->rotor_max_rad_s = 1800.0;
    v->ground_effect = 1.0;
    v->foot_m[0] = v->foot_m[1] = 0.10;
    v->foot_m[2] = 0.06;
    v->top_m[0] = v->top_m[1] = 0.12;
    v->top_m[2] = 0.04;
    v->contact_n_m = 1200.0; /* four feet: 1.4 mm at rest, 1.2 cm after 1 m/s */
    v->contact_n_s_m = 10.0; /* a third of critical: it bounces once */
    v->friction = 0.7;
}

void body_to_world(const double q[4], const double a[3], double out[3]) {
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double tx = 2.0 * (y * a[2] - z * a[1]), ty = 2.0 * (z * a[0] - x * a[2]), tz = 2.0 * (x * a[1] - y * a[0]);
    out[0] = a[0] + w * tx + y * tz - z * ty;
    out[1] = a[1] + w * ty + z * tx - x * tz;
    out[2] = a[2] + w * tz + x * ty - y * tx;
}

void body_to_body(const double q[4], const double a[3], double out[3]) {
    const double back[4] = {q[0], -q[1], -q[2], -q[3]};
    body_to_world(back, a, out);
}

void body_turn(const double q[4], const double turn_rad[3], double out[4]) {
    const double angle = sqrt(turn_rad[0] * turn_rad[0] + turn_rad[1] * turn_rad[1] + turn_rad[2] * turn_rad[2]);
    const double s = angle > 1e-9 ? sin(0.5 * angle) / angle : 0.5, c = cos(0.5 * angle);
    const double a = s * turn_rad[0], b = s * turn_rad[1], d = s * turn_rad[2];
    const double r[4] = {q[0] * c - q[1] * a - q[2] * b - q[3] * d, q[1] * c + q[0] * a + q[2] * d - q[3] * b,
                         q[2] * c + q[0] * b + q[3] * a - q[1] * d, q[3] * c + q[0] * d + q[1] * b - q[2] * a};
    const double size = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
    for (int i = 0; i < 4; i++) out[i] = r[i] / size;
}

/* Blade element minus momentum theory, as functions of the induced velocity. */
static double thrust_gap(double k1n2, double k2n, double two_rho_area, double axial, double lateral, double induced,
                         double* slope) {
    const double through = axial + induced, speed = sqrt(through * through + lateral * lateral);
    *slope = k2n - two_rho_area * (speed + (speed > 0.0 ? induced * through / speed : 0.0));
    return k1n2 + k2n * through - two_rho_area * induced * speed;
}

double body_rotor_thrust_n(const body_vehicle* v, double n, double axial, double lateral) {
    const double k1n2 = v->k1_n_s2 * n * n, k2n = v->k2_n_s2_m * n;
    const double two_rho_area = 2.0 * v->air_density_kg_m3 * v->disk_area_m2;
    double slope, low = 0.0, high = fabs(axial) + sqrt(k1n2 / two_rho_area) + 1e-3;
    if (thrust_gap(k1n2, k2n, two_rho_area, axial, lateral, 0.0, &slope) <= 0.0) return k1n2 + k2n * axial;
    /* Sinking: the branch on which the air still passes downwards through the disk, unless the side wind leaves none.
     */
    if (axial < 0.0) {
        if (thrust_gap(k1n2, k2n, two_rho_area, axial, lateral, -axial, &slope) > 0.0) {
            low = -axial;
        } else {
            high = -axial;
        }
    }
    double induced = high;
    for (int i = 0; i < 60 && high - low > 1e-7; i++) {
        const double gap = thrust_gap(k1n2, k2n, two_rho_area, axial, lateral, induced, &slope);
        if (gap > 0.0) {
            low = induced;
        } else {
            high = induced;
        }
        const double next = induced - gap / slope;
        if (fabs(next - induced) < 1e-7) break;
        induced = next > low && next < high ? next : 0.5 * (low + high);
    }
    return k1n2 + k2n * (axial + induced);
}

/* How far a point is inside the sides of the plate, and which is the nearest; not positive outside. */
static double inside_plate(const body_world* w, double x, double y, int* nearest) {
    const double away[4] = {x - w->plate_min_m[0], y - w->plate_min_m[1], w->plate_max_m[0] - x, w->plate_max_m[1] - y};
    *nearest = 0;
    for (int side = 1; side < 4; side++) {
        if (away[side] < away[*nearest]) *nearest = side;
    }
    return away[*nearest];
}

/* What is under a point, and its normal. */
typedef struct {
    double height_m, normal[3];
} surface;

static double plate_height_m(const body* b) { return b->world.plate_m - b->vehicle.foot_m[2]; }

static surface surface_under(const body* b, double x, double y, double z) {
    const body_world* w = &b->world;
    int side;
    const double inside = inside_plate(w, x, y, &side);
    surface s = {plate_height_m(b), {0.0, 0.0, 1.0}};
    if (inside > 0.0 && s.height_m - z < inside) return s;
    double rise_x = w->slope[0], rise_y = w->slope[1];
    s.height_m = w->floor_m - b->vehicle.foot_m[2] + rise_x * x + rise_y * y;
    if (w->bump_m > 0.0) {
        const double k = 6.283185307179586 / w->bump_length_m, half = 0.5 * w->bump_m;
        s.height_m += half * (sin(k * x) + sin(k * y));
        rise_x += half * k * cos(k * x);
        rise_y += half * k * cos(k * y);
    }
    const double up = 1.0 / sqrt(1.0 + rise_x * rise_x + rise_y * rise_y);
    s.normal[0] = -rise_x * up;
    s.normal[1] = -rise_y * up;
    s.normal[2] = up;
    return s;
}

static void point(const body_vehicle* v, int i, double out[3]) {
    const double* size = i < 4 ? v->foot_m : v->top_m;
    out[0] = (i & 1) != 0 ? size[0] : -size[0];
    out[1] = (i & 2) != 0 ? size[1] : -size[1];
    out[2] = i < 4 ? -size[2] : size[2];
}

double body_clearance_m(const body* b) {
    double least = INFINITY;
    for (int i = 0; i < BODY_POINTS; i++) {
        double in_body[3], at[3];
        point(&b->vehicle, i, in_body);
        body_to_world(b->q, in_body, at);
        for (int k = 0; k < 3; k++) at[k] += b->position_m[k];
        least = fmin(least, at[2] - surface_under(b, at[0], at[1], at[2]).height_m);
    }
    return least;
}

double body_tilt_rad(const body* b) {
    const double up = 1.0 - 2.0 * (b->q[1] * b->q[1] + b->q[2] * b->q[2]);
    return acos(fmax(-1.0, fmin(1.0, up)));
}

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Force and torque, body axes. */
typedef struct {
    double force_n[3], torque_n_m[3];
} load;

static void add_rotors(const body* b, const double air_m_s[3], load* l) {
    const body_vehicle* v = &b->vehicle;
    const double radius2 = v->disk_area_m2 / 3.141592653589793;
    double total_n = 0.0;
    for (int i = 0; i < BODY_ROTORS; i++) {
        const double n = b->rotor_rad_s[i];
        const double arm[3] = {v->rotor_x_m[i] - v->centre_of_mass_m[0], v->rotor_y_m[i] - v->centre_of_mass_m[1], 0.0};
        double turning[3], hub[3];
        cross(b->rate_rad_s, arm, turning);
        double thrust_n =
            body_rotor_thrust_n(v, n, air_m_s[2] + turning[2], hypot(air_m_s[0] + turning[0], air_m_s[1] + turning[1]));
        body_to_world(b->q, arm, hub);
        for (int k = 0; k < 3; k++) hub[k] += b->position_m[k];
        const double above = fmax(hub[2] - surface_under(b, hub[0], hub[1], hub[2]).height_m, sqrt(radius2));
        if (above < 1.0) thrust_n /= 1.0 - fmin(v->ground_effect * radius2 / (16.0 * above * above), 0.5);
        thrust_n *= b->health[i];
        total_n += thrust_n;
        l->torque_n_m[0] += arm[1] * thrust_n;
        l->torque_n_m[1] -= arm[0] * thrust_n;
        l->torque_n_m[2] += b->health[i] * v->spin[i] * v->cq_n_m_s2 * n * n;
    }
    l->force_n[0] -= total_n * v->rotor_drag_s_m * air_m_s[0];
    l->force_n[1] -= total_n * v->rotor_drag_s_m * air_m_s[1];
    l->force_n[2] += total_n;
}

/* How deep a point is in what it touches, not positive if in nothing, and the way out: what comes into the plate
   through a side is not lifted onto it. */
static double depth_at(const body* b, const double at[3], double normal[3]) {
    const surface s = surface_under(b, at[0], at[1], at[2]);
    const double depth = (s.height_m - at[2]) * s.normal[2];
    memcpy(normal, s.normal, sizeof s.normal);
    if (depth > 0.0 || at[2] >= plate_height_m(b)) return depth;
    int side;
    const double inside = inside_plate(&b->world, at[0], at[1], &side);
    normal[0] = normal[1] = normal[2] = 0.0;
    normal[side % 2] = side < 2 ? -1.0 : 1.0;
    return inside;
}

/* Springs, dampers and friction at the points; returns whether any stands on something. */
static bool add_contact(const body* b, load* l) {
    const body_vehicle* v = &b->vehicle;
    bool touching = false;
    for (int i = 0; i < BODY_POINTS; i++) {
        double in_body[3], at[3], moving[3], speed[3], normal[3];
        point(v, i, in_body);
        body_to_world(b->q, in_body, at);
        for (int k = 0; k < 3; k++) at[k] += b->position_m[k];
        const double depth = depth_at(b, at, normal);
        if (depth <= 0.0) continue;
        if (normal[2] > 0.0) touching = true;
        cross(b->rate_rad_s, in_body, moving);
        body_to_world(b->q, moving, speed);
        double into = 0.0, slip2 = 0.0, slip[3];
        for (int k = 0; k < 3; k++) {
            speed[k] += b->velocity_m_s[k];
            into -= speed[k] * normal[k];
        }
        for (int k = 0; k < 3; k++) {
            slip[k] = speed[k] + into * normal[k];
            slip2 += slip[k] * slip[k];
        }
        const double push_n = fmax(v->contact_n_m * depth + v->contact_n_s_m * into, 0.0);
        const double drag_n_s_m = fmin(FRICTION_N_S_M, v->friction * push_n / fmax(sqrt(slip2), 1e-6));
        double force[3], force_body[3], torque[3];
        for (int k = 0; k < 3; k++) force[k] = push_n * normal[k] - drag_n_s_m * slip[k];
        body_to_body(b->q, force, force_body);
        cross(in_body, force_body, torque);
        for (int k = 0; k < 3; k++) {
            l->force_n[k] += force_body[k];
            l->torque_n_m[k] += torque[k];
        }
    }
    return touching;
}

static void add_block(const body* b, load* l) {
    double force[3] = {0.0, 0.0, 0.0}, force_body[3];
    for (int k = 0; k < 2; k++) {
        force[k] = -BLOCK_N_M * (b->position_m[k] - b->block_m[k]) - BLOCK_N_S_M * b->velocity_m_s[k];
    }
    body_to_body(b->q, force, force_body);
    for (int k = 0; k < 3; k++) l->force_n[k] += force_body[k];
}

static void note_contact(body* b, bool touching) {
    body_record* r = &b->record;
    if (touching && b->airborne) {
        const double sink = -b->velocity_m_s[2];
        if (r->touchdowns == 0) {
            r->first_touchdown_m_s = sink;
            r->first_touchdown_s = r->time_s;
        }
        if (r->touchdowns == 0 || sink > r->hardest_touchdown_m_s) {
            r->hardest_touchdown_m_s = sink;
            r->hardest_touchdown_s = r->time_s;
        }
        r->touchdowns++;
    }
    if (touching) b->airborne = false;
    b->touching = touching;
}

static void substep(body* b, const double command_rad_s[BODY_ROTORS], double h) {
    const body_vehicle* v = &b->vehicle;
    double wind[3], air_world[3], air[3];
    for (int k = 0; k < 3; k++) {
        wind[k] = b->wind_m_s[k] + b->gust_m_s[k];
        air_world[k] = b->velocity_m_s[k] - wind[k];
    }
    body_to_body(b->q, air_world, air);
    load l = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    add_rotors(b, air, &l);
    for (int k = 0; k < 3; k++) l.force_n[k] -= v->parasitic_kg_m[k] * fabs(air[k]) * air[k];
    note_contact(b, add_contact(b, &l));
    if (b->blocked) add_block(b, &l);

    double force[3], spin[3], momentum[3], gyroscopic[3];
    body_to_world(b->q, l.force_n, force);
    for (int k = 0; k < 3; k++) momentum[k] = v->inertia_kg_m2[k] * b->rate_rad_s[k];
    cross(b->rate_rad_s, momentum, gyroscopic);
    for (int k = 0; k < 3; k++) {
        b->velocity_m_s[k] += h * (force[k] / v->mass_kg - (k == 2 ? v->gravity_m_s2 : 0.0));
        b->position_m[k] += h * b->velocity_m_s[k];
        b->rate_rad_s[k] += h * (l.torque_n_m[k] - gyroscopic[k]) / v->inertia_kg_m2[k];
        spin[k] = h * b->rate_rad_s[k];
    }
    body_turn(b->q, spin, b->q);
    for (int i = 0; i < BODY_ROTORS; i++) {
        const double wanted = b->health[i] > 0.0 ? fmin(fmax(command_rad_s[i], 0.0), v->rotor_max_rad_s) : 0.0;
        b->rotor_rad_s[i] += (1.0 - exp(-h / v->rotor_lag_s)) * (wanted - b->rotor_rad_s[i]);
    }
    b->record.time_s += h;
}

static double size(const double a[3]) { return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }

static void note_step(body* b, const double command_rad_s[BODY_ROTORS], double step_s) {
    body_record* r = &b->record;
    double fastest = 0.0;
    for (int i = 0; i < BODY_ROTORS; i++) fastest = fmax(fastest, fmax(command_rad_s[i], b->rotor_rad_s[i]));
    const double speed = size(b->velocity_m_s);
    r->largest_speed_m_s = fmax(r->largest_speed_m_s, speed);
    r->largest_tilt_rad = fmax(r->largest_tilt_rad, body_tilt_rad(b));
    b->clear_s = !b->touching && body_clearance_m(b) > CLEAR_M ? b->clear_s + step_s : 0.0;
    if (b->clear_s > CLEAR_S) {
        b->airborne = true;
        r->last_airborne_s = r->time_s;
    }
    const bool still = b->touching && fastest < 5.0 && speed < 0.05 && size(b->rate_rad_s) < 0.3;
    r->rest_s = still ? r->rest_s + step_s : 0.0;
}

static void blow(body* b, double step_s) {
    const body_world* w = &b->world;
    const double keep = w->gust_time_s > 0.0 ? exp(-step_s / w->gust_time_s) : 0.0;
    const double fresh = w->gust_std_m_s * sqrt(1.0 - keep * keep);
    for (int k = 0; k < 3; k++) {
        const double noise = w->gust_std_m_s > 0.0 ? fresh * body_normal(&b->random) : 0.0;
        b->wind_m_s[k] = w->wind_m_s[k] + keep * (b->wind_m_s[k] - w->wind_m_s[k]) + noise;
    }
}

void body_init(body* b, const body_vehicle* vehicle, const body_world* world, uint64_t seed) {
    memset(b, 0, sizeof *b);
    b->vehicle = *vehicle;
    b->world = *world;
    body_seed(&b->random, seed, 0u);
    b->q[0] = 1.0;
    for (int i = 0; i < BODY_ROTORS; i++) b->health[i] = 1.0;
    memcpy(b->wind_m_s, world->wind_m_s, sizeof b->wind_m_s);
    b->position_m[2] = surface_under(b, 0.0, 0.0, INFINITY).height_m + vehicle->foot_m[2];
    b->position_m[2] -= fmin(body_clearance_m(b), 0.0); /* a slope is higher under some of the feet */
}

void body_place(body* b, const double position_m[3], const double velocity_m_s[3]) {
    const body_vehicle* v = &b->vehicle;
    double n = 100.0;
    while (n < v->rotor_max_rad_s && 4.0 * body_rotor_thrust_n(v, n, 0.0, 0.0) < v->mass_kg * v->gravity_m_s2) n += 1.0;
    for (int i = 0; i < BODY_ROTORS; i++) b->rotor_rad_s[i] = n;
    memcpy(b->position_m, position_m, sizeof b->position_m);
    memcpy(b->velocity_m_s, velocity_m_s, sizeof b->velocity_m_s);
}

void body_step(body* b, const double command_rad_s[BODY_ROTORS], double step_s) {
    double before[3], change[3];
    memcpy(before, b->velocity_m_s, sizeof before);
    blow(b, step_s);
    const double longest = body_clearance_m(b) < 0.1 ? CONTACT_SUBSTEP_S : LONGEST_SUBSTEP_S;
    const int count = (int)ceil(step_s / longest - 1e-9);
    for (int i = 0; i < count; i++) substep(b, command_rad_s, step_s / count);
    for (int k = 0; k < 3; k++) {
        change[k] = (b->velocity_m_s[k] - before[k]) / step_s + (k == 2 ? b->vehicle.gravity_m_s2 : 0.0);
    }
    body_to_body(b->q, change, b->specific_force_m_s2);
    note_step(b, command_rad_s, step_s);
}
