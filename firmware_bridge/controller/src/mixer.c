/* Exact inverse of eqs. (1)-(3), with desaturation. */
#include "goshawk_controller/mixer.h"

#include "maths.h"

#define SHORTEST_ARM_M 0.01f
/* Newton steps for the first guess; then rounds of one step each, until the last changes were so small that what is
   left is second order: the error against eqs. (1)-(3) stays below 1e-5 of full speed over the envelope, see
   tests/firmware_bridge/test_controller_numbers.py. A flight needs one or two rounds. */
#define FIRST_STEPS 2
#define MOST_ROUNDS 5
#define SETTLED_M_S 2e-3f
#define SETTLED_N 1e-3f

/* The air at one hub, and the operating point found there. Thrusts are those of the healthy rotor without translational
   lift: what eqs. (1)-(2) must give. */
typedef struct {
    float axial_m_s;      /* v_z */
    float lateral2_m2_s2; /* v_xy^2 */
    float lift_n;
    float thrust_n;
    float induced_m_s;
    float induced_per_n; /* d induced / d thrust */
    float last_step_m_s; /* of the Newton iteration on the induced velocity */
    float speed_rad_s;
    float speed_per_n; /* d speed / d thrust */
} rotor;

static float determinant(const float a[3], const float b[3], const float c[3]) {
    float bc[3];
    tc_cross(b, c, bc);
    return tc_dot(a, bc);
}

/* Null vector of a 3x4 matrix given by its columns: the signed minors. */
static void null_vector(float column[TC_ROTORS][3], float out[TC_ROTORS]) {
    out[0] = determinant(column[1], column[2], column[3]);
    out[1] = -determinant(column[0], column[2], column[3]);
    out[2] = determinant(column[0], column[1], column[3]);
    out[3] = -determinant(column[0], column[1], column[2]);
}

/* Inverse of a symmetric 3x3 matrix by cross products of its rows; returns the determinant. */
static float invert_symmetric(float m[3][3], float out[3][3]) {
    tc_cross(m[1], m[2], out[0]);
    tc_cross(m[2], m[0], out[1]);
    tc_cross(m[0], m[1], out[2]);
    const float det = tc_dot(m[0], out[0]);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) out[i][j] /= det;
    }
    return det;
}

static tc_reason lay_out(tc_mixer* mixer, const tc_parameters* p, float arm_m) {
    float column[TC_ROTORS][3]; /* collective, torque x, torque y per newton, arms scaled to about 1 */
    float gram[3][3] = {{0.0f}}, inverse[3][3];
    for (int i = 0; i < TC_ROTORS; i++) {
        column[i][0] = 1.0f;
        column[i][1] = mixer->arm_y_m[i] / arm_m;
        column[i][2] = -mixer->arm_x_m[i] / arm_m;
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) gram[r][c] += column[i][r] * column[i][c];
        }
    }
    if (!(determinant(gram[0], gram[1], gram[2]) > 0.5f)) return TC_SINGULAR_GEOMETRY; /* 64 for a square */
    (void)invert_symmetric(gram, inverse);
    null_vector(column, mixer->free);
    float largest = 0.0f, spin_sum = 0.0f, size_sum = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) largest = tc_max(largest, tc_abs(mixer->free[i]));
    if (!(largest > 1e-3f)) return TC_SINGULAR_GEOMETRY;
    for (int i = 0; i < TC_ROTORS; i++) {
        mixer->free[i] /= largest;
        spin_sum += p->rotor_spin[i] * mixer->free[i];
        size_sum += tc_abs(mixer->free[i]);
        for (int r = 0; r < 3; r++) {
            const float value = tc_dot(inverse[r], column[i]);
            mixer->from_wrench[i][r] = r == 0 ? value : value / arm_m;
        }
        /* Every rotor must lift and take part in yaw. */
        if (!(mixer->from_wrench[i][0] > 0.05f && tc_abs(mixer->free[i]) > 0.05f)) return TC_SINGULAR_GEOMETRY;
        mixer->per_lift[i] = 1.0f / mixer->from_wrench[i][0];
        mixer->per_free[i] = 1.0f / mixer->free[i];
        mixer->per_gain[i] = 1.0f / p->rotor_gain[i];
        mixer->free_gain[i] = 2.0f * mixer->free[i] * mixer->per_gain[i];
    }
    mixer->yaw_per_free = spin_sum;
    mixer->yaw_sign = spin_sum < 0.0f ? -1.0f : 1.0f;
    return tc_abs(spin_sum) > 0.25f * size_sum ? TC_OK : TC_SINGULAR_GEOMETRY;
}

/* T = a n^2 + b n with b = through (v_z + v_ind) + axial v_z: one form for all three thrust laws. */
static void choose_law(tc_mixer* mixer, const tc_parameters* p) {
    const bool quadratic = p->thrust_model < 0.5f;
    mixer->square = quadratic ? p->quad_n_s2 : p->k1_n_s2;
    mixer->through = quadratic ? 0.0f : p->k2_n_s2_m;
    mixer->axial = quadratic ? -p->inflow_kg : 0.0f;
    mixer->lateral = p->thrust_model > 1.5f ? 1.0f : 0.0f;
    mixer->half_per_square = 0.5f / mixer->square;
    mixer->four_square = 4.0f * mixer->square;
    mixer->per_load = 1.0f / (2.0f * p->air_density_kg_m3 * p->disk_area_m2);
}

tc_reason tc_mixer_configure(tc_mixer* mixer, const tc_parameters* p) {
    float arm_m = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        mixer->arm_x_m[i] = p->rotor_x_m[i] - p->centre_of_mass_m[0];
        mixer->arm_y_m[i] = p->rotor_y_m[i] - p->centre_of_mass_m[1];
        arm_m = tc_max(arm_m, tc_max(tc_abs(mixer->arm_x_m[i]), tc_abs(mixer->arm_y_m[i])));
        if (!(tc_abs(p->rotor_spin[i]) > 0.5f)) return TC_SINGULAR_GEOMETRY;
    }
    if (!(arm_m > SHORTEST_ARM_M)) return TC_SINGULAR_GEOMETRY;
    if (!(p->rotor_max_rad_s > p->rotor_min_rad_s && p->rotor_max_rad_s >= p->rotor_idle_rad_s)) return TC_OUT_OF_RANGE;
    choose_law(mixer, p);
    const tc_reason reason = lay_out(mixer, p, arm_m);
    if (reason != TC_OK) return reason;
    /* Enough thrust to hover with a tenth to spare, in still air. */
    const float each_n = p->mass_kg * p->gravity_m_s2 * 1.1f * 0.25f;
    const float n = p->rotor_max_rad_s;
    const float thrust_n = mixer->square * n * n + mixer->through * n * sqrtf(each_n * mixer->per_load);
    mixer->free_per_yaw = thrust_n / (n * n * p->cq_n_m_s2 * mixer->yaw_per_free);
    mixer->largest_thrust_n = 4.0f * thrust_n;
    return thrust_n >= each_n ? TC_OK : TC_CANNOT_HOVER;
}

/* The speed for r->thrust_n: Newton on eq. (2), v sqrt((v_z + v)^2 + v_xy^2) = T / (2 rho A), from the induced velocity
   at hand; then eq. (1) as a quadratic in n. The slopes let the next thrust start close. */
static inline void solve_rotor(const tc_mixer* mixer, rotor* r, int steps) {
    const float load = r->thrust_n * mixer->per_load;
    float v = r->induced_m_s, root = 0.0f, inverse = 0.0f, step = 0.0f;
    for (int i = 0; i < steps; i++) {
        const float w = r->axial_m_s + v;
        const float q = w * w + r->lateral2_m2_s2;
        root = sqrtf(q);
        inverse = 1.0f / tc_max(q + v * w, 1e-3f); /* over the derivative times root */
        step = (v * q - load * root) * inverse;
        v -= step;
    }
    v = tc_max(v, 0.0f);
    const float b = mixer->through * (r->axial_m_s + v) + mixer->axial * r->axial_m_s;
    const float slope = sqrtf(b * b + mixer->four_square * r->thrust_n); /* 2 a n + b */
    r->last_step_m_s = step;
    r->induced_m_s = v;
    r->induced_per_n = root * inverse * mixer->per_load;
    r->speed_rad_s = (slope - b) * mixer->half_per_square;
    r->speed_per_n = (1.0f - mixer->through * r->speed_rad_s * r->induced_per_n) / slope;
}

/* Air speed at the hub; the first guess of the induced velocity is the answer for v_xy = 0. */
static inline void start_rotor(const tc_mixer* mixer, const tc_parameters* p, int i, const float air[3],
                               const float rate[3], float thrust_n, rotor* r) {
    const float x = mixer->arm_x_m[i], y = mixer->arm_y_m[i];
    const float vx = air[0] - rate[2] * y, vy = air[1] + rate[2] * x;
    const float lateral2 = vx * vx + vy * vy;
    r->axial_m_s = air[2] + rate[0] * y - rate[1] * x;
    r->lateral2_m2_s2 = mixer->lateral * lateral2;
    r->lift_n = p->lift_kg_m * lateral2;
    r->thrust_n = tc_max(thrust_n * mixer->per_gain[i] - r->lift_n, 1e-3f);
    const float half = 0.5f * r->axial_m_s;
    r->induced_m_s = sqrtf(half * half + r->thrust_n * mixer->per_load) - half;
    solve_rotor(mixer, r, FIRST_STEPS);
}

/* A new thrust for a rotor that has been solved: carry the induced velocity along, then polish. */
static inline void move_rotor(const tc_mixer* mixer, int i, float thrust_n, rotor* r) {
    const float next_n = tc_max(thrust_n * mixer->per_gain[i] - r->lift_n, 1e-3f);
    r->induced_m_s += r->induced_per_n * (next_n - r->thrust_n);
    r->thrust_n = next_n;
    solve_rotor(mixer, r, 1);
}

/* What the rotors can give at these air speeds, and what is asked of them. */
typedef struct {
    float low_n[TC_ROTORS], high_n[TC_ROTORS];
    float tilt_n[TC_ROTORS]; /* thrusts of the roll and pitch torque */
    float collective_n;
    float yaw; /* multiple of the free direction */
    float yaw_low, yaw_high;
    uint8_t saturation;
} demand;

/* Thrust at the speed limits, from T = a n^2 + b n through the operating point with its slope. */
static inline void reach(const tc_parameters* p, const rotor* r, float gain, float* low_n, float* high_n) {
    const float per_speed = 1.0f / tc_max(r->speed_rad_s, 1.0f);
    const float mean = r->thrust_n * per_speed;
    const float slope = 1.0f / r->speed_per_n;
    const float a = (slope - mean) * per_speed, b = 2.0f * mean - slope;
    const float least = p->rotor_min_rad_s, most = p->rotor_max_rad_s;
    *low_n = tc_max(gain * ((a * least + b) * least + r->lift_n), 0.0f);
    *high_n = tc_max(gain * ((a * most + b) * most + r->lift_n), *low_n);
}

/* Priority: tilt torque, then collective, then yaw, which keeps `yaw_share` of its authority throughout. */
static inline void desaturate(const tc_mixer* mixer, const tc_parameters* p, demand* d) {
    float low = d->low_n[0], high = d->high_n[0], least = d->tilt_n[0], most = d->tilt_n[0];
    for (int i = 1; i < TC_ROTORS; i++) {
        low = tc_max(low, d->low_n[i]);
        high = tc_min(high, d->high_n[i]);
        least = tc_min(least, d->tilt_n[i]);
        most = tc_max(most, d->tilt_n[i]);
    }
    const float room = tc_max(high - low, 0.0f);
    const float share = 0.5f * p->yaw_share * room;
    const float kept = tc_clamp(d->yaw, -share, share);
    const float left = room - 2.0f * tc_abs(kept), spread = most - least;
    const float scale = spread > left ? left / spread : 1.0f;
    float collective_low = 0.0f, collective_high = 1e9f;
    for (int i = 0; i < TC_ROTORS; i++) {
        d->tilt_n[i] *= scale;
        const float base = d->tilt_n[i] + kept * mixer->free[i];
        collective_low = tc_max(collective_low, (d->low_n[i] - base) * mixer->per_lift[i]);
        collective_high = tc_min(collective_high, (d->high_n[i] - base) * mixer->per_lift[i]);
    }
    const float collective = tc_clamp(d->collective_n, collective_low, collective_high);
    float yaw_low = -1e9f, yaw_high = 1e9f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float base = d->tilt_n[i] + collective * mixer->from_wrench[i][0];
        const float a = (d->low_n[i] - base) * mixer->per_free[i], b = (d->high_n[i] - base) * mixer->per_free[i];
        yaw_low = tc_max(yaw_low, tc_min(a, b));
        yaw_high = tc_min(yaw_high, tc_max(a, b));
    }
    d->yaw_low = tc_min(yaw_low, kept);
    d->yaw_high = tc_max(yaw_high, kept);
    const float yaw = tc_clamp(d->yaw, d->yaw_low, d->yaw_high);
    const float small_n = 2e-6f * (d->collective_n + 1.0f);
    if (scale < 1.0f) d->saturation |= TC_SATURATED_TILT;
    if (tc_abs(collective - d->collective_n) > small_n) d->saturation |= TC_SATURATED_COLLECTIVE;
    if (tc_abs(yaw - d->yaw) > small_n) d->saturation |= TC_SATURATED_YAW;
    d->collective_n = collective;
    d->yaw = yaw;
}

/* One Newton step along the free direction towards the wanted sum of spin n^2. */
static inline float yaw_step(const tc_mixer* mixer, const tc_parameters* p, const rotor r[TC_ROTORS], float wanted) {
    float sum = 0.0f, slope = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float turning = p->rotor_spin[i] * r[i].speed_rad_s;
        sum += turning * r[i].speed_rad_s;
        slope += turning * r[i].speed_per_n * mixer->free_gain[i];
    }
    return mixer->yaw_sign * (wanted - sum) / tc_max(mixer->yaw_sign * slope, 1e-3f);
}

void tc_mixer_solve(const tc_mixer* mixer, const tc_parameters* p, const tc_wrench* wrench,
                    const float air_velocity_body_m_s[3], const float rate_body_rad_s[3], tc_mix* out) {
    rotor r[TC_ROTORS];
    demand d = {.collective_n = tc_max(wrench->thrust_n, 0.0f)};
    const float turning = wrench->torque_n_m[2] / p->cq_n_m_s2;
    const float floor_n = 0.02f * d.collective_n;
    d.yaw = wrench->torque_n_m[2] * mixer->free_per_yaw; /* as if thrust went with n^2; Newton does the rest */
    for (int i = 0; i < TC_ROTORS; i++) {
        const float* row = mixer->from_wrench[i];
        d.tilt_n[i] = row[1] * wrench->torque_n_m[0] + row[2] * wrench->torque_n_m[1];
        const float wanted_n = row[0] * d.collective_n + d.tilt_n[i] + d.yaw * mixer->free[i];
        start_rotor(mixer, p, i, air_velocity_body_m_s, rate_body_rad_s, tc_max(wanted_n, floor_n), &r[i]);
        reach(p, &r[i], p->rotor_gain[i], &d.low_n[i], &d.high_n[i]);
    }
    d.yaw += yaw_step(mixer, p, r, turning);
    desaturate(mixer, p, &d);
    float change = 0.0f;
    for (int round = 0; round < MOST_ROUNDS; round++) {
        float restless = 0.0f;
        for (int i = 0; i < TC_ROTORS; i++) {
            out->rotor_thrust_n[i] = mixer->from_wrench[i][0] * d.collective_n + d.tilt_n[i] + d.yaw * mixer->free[i];
            move_rotor(mixer, i, out->rotor_thrust_n[i], &r[i]);
            restless = tc_max(restless, tc_abs(r[i].last_step_m_s));
        }
        change = tc_clamp(yaw_step(mixer, p, r, turning), d.yaw_low - d.yaw, d.yaw_high - d.yaw);
        if (restless < SETTLED_M_S && tc_abs(change) < SETTLED_N) break;
        d.yaw += change;
        change = 0.0f;
    }
    for (int i = 0; i < TC_ROTORS; i++) {
        const float wanted = r[i].speed_rad_s + 0.5f * change * r[i].speed_per_n * mixer->free_gain[i];
        const float n = tc_clamp(wanted, p->rotor_min_rad_s, p->rotor_max_rad_s);
        if (tc_abs(n - wanted) > 1e-3f * n) d.saturation |= TC_SATURATED_ROTOR;
        out->rotor_speed_rad_s[i] = n;
    }
    out->saturation = d.saturation;
}
