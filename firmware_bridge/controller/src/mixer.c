/* Exact inverse of eqs. (1)-(3), with desaturation. */
#include "goshawk_controller/mixer.h"

#include "maths.h"

#define SHORTEST_ARM_M 0.01f

/* What the air does at one hub, and the operating point found there. */
typedef struct {
    float axial_m_s;      /* v_z */
    float lateral2_m2_s2; /* v_xy^2 */
    float lift_n;         /* translational lift, of the healthy rotor */
    float bem_thrust_n;   /* of the healthy rotor, without translational lift: what (1)-(2) must give */
    float induced_m_s;
    float induced_per_n; /* d induced / d thrust */
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

static tc_reason lay_out(tc_mixer *mixer, const tc_parameters *p, float arm_m) {
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
    }
    mixer->yaw_per_free = spin_sum;
    return tc_abs(spin_sum) > 0.25f * size_sum ? TC_OK : TC_SINGULAR_GEOMETRY;
}

tc_reason tc_mixer_configure(tc_mixer *mixer, const tc_parameters *p) {
    float arm_m = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        mixer->arm_x_m[i] = p->rotor_x_m[i] - p->centre_of_mass_m[0];
        mixer->arm_y_m[i] = p->rotor_y_m[i] - p->centre_of_mass_m[1];
        arm_m = tc_max(arm_m, tc_max(tc_abs(mixer->arm_x_m[i]), tc_abs(mixer->arm_y_m[i])));
        if (!(tc_abs(p->rotor_spin[i]) > 0.5f)) return TC_SINGULAR_GEOMETRY;
    }
    if (!(arm_m > SHORTEST_ARM_M)) return TC_SINGULAR_GEOMETRY;
    if (!(p->rotor_max_rad_s > p->rotor_min_rad_s)) return TC_OUT_OF_RANGE;
    mixer->inverse_two_rho_area = 1.0f / (2.0f * p->air_density_kg_m3 * p->disk_area_m2);
    const tc_reason reason = lay_out(mixer, p, arm_m);
    if (reason != TC_OK) return reason;
    /* Enough thrust to hover with a tenth to spare, in still air. */
    const float each_n = p->mass_kg * p->gravity_m_s2 * 1.1f * 0.25f;
    const float induced = sqrtf(each_n * mixer->inverse_two_rho_area);
    const float n = p->rotor_max_rad_s;
    const bool quadratic = p->thrust_model < 0.5f;
    const float thrust_n = quadratic ? p->quad_n_s2 * n * n : p->k1_n_s2 * n * n + p->k2_n_s2_m * n * induced;
    mixer->free_per_yaw = thrust_n / (n * n * p->cq_n_m_s2 * mixer->yaw_per_free);
    mixer->largest_thrust_n = 4.0f * thrust_n;
    return thrust_n >= each_n ? TC_OK : TC_CANNOT_HOVER;
}

/* Newton on eq. (2), v sqrt((v_z + v)^2 + v_xy^2) = T / (2 rho A), from `induced_m_s`. */
static void solve_induced(rotor *r, float load, int steps) {
    float v = r->induced_m_s;
    float slope = 1.0f, root = 1.0f;
    for (int i = 0; i < steps; i++) {
        const float w = r->axial_m_s + v;
        const float q = w * w + r->lateral2_m2_s2;
        root = sqrtf(q);
        slope = tc_max(q + v * w, 1e-6f); /* root times the derivative */
        v = tc_max(v - (v * q - load * root) / slope, 0.0f);
    }
    r->induced_m_s = v;
    r->induced_per_n = root / slope;
}

/* a n^2 + b n = T for the speed: larger root, without cancellation for either sign of b. Returns 2 a n + b. */
static float larger_root(float a, float b, float thrust_n, float *speed_rad_s) {
    const float root = sqrtf(tc_max(b * b + 4.0f * a * thrust_n, 1e-12f));
    *speed_rad_s = b > 0.0f ? 2.0f * thrust_n / (b + root) : 0.5f * (root - b) / a;
    return root;
}

/* Eq. (1): k1 n^2 + k2 (v_z + v_ind) n = T; the slope takes along that the induced velocity grows with thrust. */
static void solve_blade_element(const tc_mixer *mixer, const tc_parameters *p, rotor *r) {
    const float b = p->k2_n_s2_m * (r->axial_m_s + r->induced_m_s);
    const float root = larger_root(p->k1_n_s2, b, r->bem_thrust_n, &r->speed_rad_s);
    const float loss = p->k2_n_s2_m * r->speed_rad_s * r->induced_per_n * mixer->inverse_two_rho_area;
    r->speed_per_n = (1.0f - loss) / root;
}

static void solve_rotor(const tc_mixer *mixer, const tc_parameters *p, rotor *r, int steps) {
    if (p->thrust_model < 0.5f) { /* k n^2 - k_z v_z n = T */
        const float b = -p->inflow_kg * r->axial_m_s;
        r->speed_per_n = 1.0f / larger_root(p->quad_n_s2, b, r->bem_thrust_n, &r->speed_rad_s);
        return;
    }
    solve_induced(r, r->bem_thrust_n * mixer->inverse_two_rho_area, steps);
    solve_blade_element(mixer, p, r);
}

/* Air speed at the hub and the thrust that momentum theory is asked for; the first guess is the answer for v_xy = 0. */
static void start_rotor(const tc_mixer *mixer, const tc_parameters *p, int i, const float air[3], const float rate[3],
                        float thrust_n, rotor *r) {
    const float x = mixer->arm_x_m[i], y = mixer->arm_y_m[i];
    const float vx = air[0] - rate[2] * y, vy = air[1] + rate[2] * x;
    const float lateral2 = vx * vx + vy * vy;
    r->axial_m_s = air[2] + rate[0] * y - rate[1] * x;
    r->lateral2_m2_s2 = p->thrust_model > 1.5f ? lateral2 : 0.0f;
    r->lift_n = p->lift_kg_m * lateral2;
    r->bem_thrust_n = tc_max(thrust_n / p->rotor_gain[i] - r->lift_n, 0.0f);
    const float half = 0.5f * r->axial_m_s;
    r->induced_m_s = sqrtf(half * half + r->bem_thrust_n * mixer->inverse_two_rho_area) - half;
    r->induced_per_n = 0.0f;
}

/* A new thrust for a rotor that has been solved: carry the induced velocity along, then polish. */
static void move_rotor(const tc_mixer *mixer, const tc_parameters *p, int i, float thrust_n, int steps, rotor *r) {
    const float before = r->bem_thrust_n;
    r->bem_thrust_n = tc_max(thrust_n / p->rotor_gain[i] - r->lift_n, 0.0f);
    const float slope = r->induced_per_n * mixer->inverse_two_rho_area;
    r->induced_m_s = tc_max(r->induced_m_s + slope * (r->bem_thrust_n - before), 0.0f);
    solve_rotor(mixer, p, r, steps);
}

/* Thrust at a speed limit, from T = a n^2 + b n through the operating point with its slope. */
static float thrust_at(const rotor *r, float n, float thrust_n, float gain) {
    const float n0 = tc_max(r->speed_rad_s, 1.0f);
    const float mean = r->bem_thrust_n / n0;
    const float slope = 1.0f / tc_max(r->speed_per_n, 1e-6f);
    const float change = ((slope - mean) / n0) * (n * n - n0 * n0) + (2.0f * mean - slope) * (n - n0);
    return thrust_n + gain * change;
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

/* How far tilt torque can be kept so that one collective still satisfies every rotor: largest scale in [0, 1]. */
static float tilt_scale(const tc_mixer *mixer, const demand *d, float yaw) {
    float high[TC_ROTORS], low[TC_ROTORS], tilt[TC_ROTORS];
    for (int i = 0; i < TC_ROTORS; i++) {
        const float per = 1.0f / mixer->from_wrench[i][0];
        high[i] = (d->high_n[i] - yaw * mixer->free[i]) * per;
        low[i] = (d->low_n[i] - yaw * mixer->free[i]) * per;
        tilt[i] = d->tilt_n[i] * per;
    }
    float scale = 1.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        for (int j = 0; j < TC_ROTORS; j++) {
            const float spread = tilt[j] - tilt[i];
            const float room = tc_max(high[j] - low[i], 0.0f);
            if (spread * scale > room) scale = room / spread;
        }
    }
    return scale;
}

/* The range of `x` for which base + x * per stays within [low, high] for every rotor. */
static void common_range(const float base[TC_ROTORS], const float per[TC_ROTORS], const demand *d, float range[2]) {
    range[0] = -1e9f;
    range[1] = 1e9f;
    for (int i = 0; i < TC_ROTORS; i++) {
        if (tc_abs(per[i]) < 1e-6f) continue;
        const float inverse = 1.0f / per[i];
        const float a = (d->low_n[i] - base[i]) * inverse, b = (d->high_n[i] - base[i]) * inverse;
        range[0] = tc_max(range[0], tc_min(a, b));
        range[1] = tc_min(range[1], tc_max(a, b));
    }
}

/* Priority: tilt torque, then collective, then yaw, which keeps `yaw_share` of its authority throughout. */
static void desaturate(const tc_mixer *mixer, const tc_parameters *p, demand *d) {
    float room = 1e9f;
    for (int i = 0; i < TC_ROTORS; i++) room = tc_min(room, d->high_n[i] - d->low_n[i]);
    const float share = 0.5f * p->yaw_share * tc_max(room, 0.0f);
    const float kept_yaw = tc_clamp(d->yaw, -share, share);
    const float scale = tilt_scale(mixer, d, kept_yaw);
    float base[TC_ROTORS], lift[TC_ROTORS], range[2];
    for (int i = 0; i < TC_ROTORS; i++) {
        d->tilt_n[i] *= scale;
        lift[i] = mixer->from_wrench[i][0];
        base[i] = d->tilt_n[i] + kept_yaw * mixer->free[i];
    }
    common_range(base, lift, d, range);
    const float collective = tc_clamp(d->collective_n, range[0], range[1]);
    for (int i = 0; i < TC_ROTORS; i++) base[i] = d->tilt_n[i] + collective * lift[i];
    common_range(base, mixer->free, d, range);
    d->yaw_low = tc_min(range[0], kept_yaw);
    d->yaw_high = tc_max(range[1], kept_yaw);
    const float yaw = tc_clamp(d->yaw, d->yaw_low, d->yaw_high);
    const float small_n = 2e-6f * (tc_abs(d->collective_n) + 1.0f);
    if (scale < 1.0f) d->saturation |= TC_SATURATED_TILT;
    if (tc_abs(collective - d->collective_n) > small_n) d->saturation |= TC_SATURATED_COLLECTIVE;
    if (tc_abs(yaw - d->yaw) > small_n) d->saturation |= TC_SATURATED_YAW;
    d->collective_n = collective;
    d->yaw = yaw;
}

/* One Newton step along the free direction towards the wanted yaw torque. */
static float yaw_step(const tc_mixer *mixer, const tc_parameters *p, const rotor r[TC_ROTORS], float torque_n_m) {
    float torque = 0.0f, slope = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = r[i].speed_rad_s;
        torque += p->rotor_spin[i] * n * n;
        slope += p->rotor_spin[i] * mixer->free[i] * 2.0f * n * r[i].speed_per_n / p->rotor_gain[i];
    }
    const float steepest = tc_abs(slope) > 1e-3f ? slope : (mixer->yaw_per_free > 0.0f ? 1e-3f : -1e-3f);
    return (torque_n_m / p->cq_n_m_s2 - torque) / steepest;
}

/* Air at each hub, the operating point for the demand as it stands, and what the rotors could give there. */
static void start_all(const tc_mixer *mixer, const tc_parameters *p, const tc_wrench *wrench, const float air[3],
                      const float rate[3], rotor r[TC_ROTORS], demand *d) {
    /* Yaw torque as if thrust went with n^2; Newton does the rest. */
    d->yaw = wrench->torque_n_m[2] * mixer->free_per_yaw;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float *row = mixer->from_wrench[i];
        d->tilt_n[i] = row[1] * wrench->torque_n_m[0] + row[2] * wrench->torque_n_m[1];
        const float wanted_n = row[0] * d->collective_n + d->tilt_n[i] + d->yaw * mixer->free[i];
        const float thrust_n = tc_max(wanted_n, 0.02f * d->collective_n);
        start_rotor(mixer, p, i, air, rate, thrust_n, &r[i]);
        solve_rotor(mixer, p, &r[i], 4);
        d->low_n[i] = tc_max(thrust_at(&r[i], p->rotor_min_rad_s, thrust_n, p->rotor_gain[i]), 0.0f);
        d->high_n[i] = tc_max(thrust_at(&r[i], p->rotor_max_rad_s, thrust_n, p->rotor_gain[i]), d->low_n[i]);
    }
}

/* Thrusts of the demand, and the rotors moved there. */
static void move_all(const tc_mixer *mixer, const tc_parameters *p, const demand *d, int steps, rotor r[TC_ROTORS],
                     float thrust_n[TC_ROTORS]) {
    for (int i = 0; i < TC_ROTORS; i++) {
        thrust_n[i] = mixer->from_wrench[i][0] * d->collective_n + d->tilt_n[i] + d->yaw * mixer->free[i];
        move_rotor(mixer, p, i, thrust_n[i], steps, &r[i]);
    }
}

void tc_mixer_solve(const tc_mixer *mixer, const tc_parameters *p, const tc_wrench *wrench,
                    const float air_velocity_body_m_s[3], const float rate_body_rad_s[3], tc_mix *out) {
    rotor r[TC_ROTORS];
    demand d = {.collective_n = tc_max(wrench->thrust_n, 0.0f)};
    start_all(mixer, p, wrench, air_velocity_body_m_s, rate_body_rad_s, r, &d);
    d.yaw += yaw_step(mixer, p, r, wrench->torque_n_m[2]);
    desaturate(mixer, p, &d);
    for (int pass = 0; pass < 2; pass++) {
        move_all(mixer, p, &d, 2, r, out->rotor_thrust_n);
        d.yaw = tc_clamp(d.yaw + yaw_step(mixer, p, r, wrench->torque_n_m[2]), d.yaw_low, d.yaw_high);
    }
    move_all(mixer, p, &d, 1, r, out->rotor_thrust_n);
    out->saturation = d.saturation;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = tc_clamp(r[i].speed_rad_s, p->rotor_min_rad_s, p->rotor_max_rad_s);
        if (tc_abs(n - r[i].speed_rad_s) > 1e-3f * n) out->saturation |= TC_SATURATED_ROTOR;
        out->rotor_speed_rad_s[i] = n;
    }
}
