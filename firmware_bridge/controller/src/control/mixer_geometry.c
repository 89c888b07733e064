/* What the mixer works with that follows from the parameters alone: units, thrust law, limits, and the inverse of the
   rotors' geometry. */
#include "../base/maths.h"
#include "goshawk_controller/mixer.h"
#include "mixer_parts.h"

static const float SHORTEST_ARM_M = 0.01f; /* a shorter one is a mistake in the parameters */
/* Share of the hover load added to a rotor's own when a change of load is called small. */
static const float NEAR = 0.03f;
/* The limits are kept this far inside, so that rounding does not lead beyond them. */
static const float ROUNDING = 2e-6f;
/* Below, a rotor's operating point is extrapolated: at zero its slopes would be infinite. */
static const float LEAST_THRUST_N = 1e-3f;

static float determinant(const float a[3], const float b[3], const float c[3]) {
    float bc[3];
    tc_cross(b, c, bc);
    return tc_dot(a, bc);
}

/* `yaw_per_free`: sum spin_i free_i. */
static tc_reason invert_geometry(tc_mixer* mixer, const tc_parameters* p, float arm_m, float load_per_n,
                                 float* yaw_per_free) {
    float column[TC_ROTORS][3]; /* collective, torque x, torque y per newton, arms scaled to about 1 */
    float gram[3][3], adjugate[3][3], free[TC_ROTORS];
    memset(gram, 0, sizeof gram);
    for (int i = 0; i < TC_ROTORS; i++) {
        column[i][0] = 1.0f;
        column[i][1] = mixer->rotor[i].arm_y_m / arm_m;
        column[i][2] = -mixer->rotor[i].arm_x_m / arm_m;
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) gram[r][c] += column[i][r] * column[i][c];
        }
    }
    tc_cross(gram[1], gram[2], adjugate[0]);
    tc_cross(gram[2], gram[0], adjugate[1]);
    tc_cross(gram[0], gram[1], adjugate[2]);
    const float det = tc_dot(gram[0], adjugate[0]);
    float largest = 0.0f, spin_sum = 0.0f, size_sum = 0.0f, sign = 1.0f;
    for (int i = 0; i < TC_ROTORS; i++) { /* null vector of the columns: the signed minors */
        free[i] = sign * determinant(column[(i + 1) % 4], column[(i + 2) % 4], column[(i + 3) % 4]);
        largest = tc_max(largest, tc_abs(free[i]));
        sign = -sign;
    }
    if (!(det > 0.5f && largest > 1e-3f)) return TC_SINGULAR_GEOMETRY; /* 64 for a square */
    for (int i = 0; i < TC_ROTORS; i++) {
        tc_mixer_rotor* m = &mixer->rotor[i];
        const float share = free[i] / largest;
        spin_sum += p->rotor_spin[i] * share;
        size_sum += tc_abs(share);
        const float per_collective = tc_dot(adjugate[0], column[i]) / det;
        /* Every rotor must lift and take part in yaw. */
        if (!(per_collective > 0.05f && tc_abs(share) > 0.05f)) return TC_SINGULAR_GEOMETRY;
        const float unit = load_per_n / p->rotor_gain[i];
        const float per_torque = unit / (det * arm_m);
        m->per_collective = unit * per_collective;
        m->per_torque_x = per_torque * tc_dot(adjugate[1], column[i]);
        m->per_torque_y = per_torque * tc_dot(adjugate[2], column[i]);
        m->free = unit * share;
        m->thrust_n = p->rotor_gain[i] / load_per_n;
        m->spin = p->rotor_spin[i];
        m->yaw_n = m->free / m->per_collective;
    }
    *yaw_per_free = spin_sum;
    return tc_abs(spin_sum) > 0.25f * size_sum ? TC_OK : TC_SINGULAR_GEOMETRY;
}

/* Units and thrust law; returns the load per newton. */
static float choose_law(tc_mixer* mixer, const tc_parameters* p) {
    const bool quadratic = p->thrust_model < 0.5f;
    const float square = quadratic ? p->quad_n_s2 : p->k1_n_s2;
    const float per_disk = 1.0f / (2.0f * p->air_density_kg_m3 * p->disk_area_m2);
    /* A smaller coefficient changes speeds by less than 1e-5 of them: then the law is taken to have none. */
    const bool induced = !quadratic && -p->k2_n_s2_m > 1e-5f * sqrtf(square / per_disk);
    const float unit = induced ? -p->k2_n_s2_m : 1.0f;
    const float load_per_n = unit * unit * per_disk;
    mixer->unit_m_s = unit;
    mixer->induced = induced ? 1.0f : 0.0f;
    mixer->least_load = LEAST_THRUST_N * load_per_n;
    mixer->axial = (quadratic ? -p->inflow_kg : p->k2_n_s2_m) / unit;
    mixer->lateral = p->thrust_model > 1.5f ? 1.0f : 0.0f;
    mixer->lift = p->lift_kg_m * per_disk;
    mixer->still = 1e-6f * unit * unit;
    mixer->load_factor = 4.0f * square / load_per_n;
    const float speed_unit = 2.0f * square;
    mixer->per_speed = 1.0f / speed_unit;
    mixer->turn_per_yaw = speed_unit * speed_unit / p->cq_n_m_s2;
    const float slowest = p->rotor_min_rad_s * speed_unit, fastest = p->rotor_max_rad_s * speed_unit;
    mixer->slowest2 = slowest * slowest * (1.0f + ROUNDING);
    mixer->fastest2 = fastest * fastest * (1.0f - ROUNDING);
    return load_per_n;
}

/* Thrust over n^2 in still air, where it is the same for every thrust. */
static float still_air_factor(const tc_mixer* mixer, float load_per_n) {
    const float v = mixer->induced; /* of a load of 1; the speed goes with the root of the load */
    const float per_root = mixer->per_speed * (v + sqrtf(v + mixer->load_factor));
    return 1.0f / (load_per_n * per_root * per_root);
}

tc_reason tc_mixer_configure(tc_mixer* mixer, const tc_parameters* p) {
    float arm_m = 0.0f, yaw_per_free = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        tc_mixer_rotor* m = &mixer->rotor[i];
        m->arm_x_m = p->rotor_x_m[i] - p->centre_of_mass_m[0];
        m->arm_y_m = p->rotor_y_m[i] - p->centre_of_mass_m[1];
        arm_m = tc_max(arm_m, tc_max(tc_abs(m->arm_x_m), tc_abs(m->arm_y_m)));
        if (!(tc_abs(p->rotor_spin[i]) > 0.5f)) return TC_SINGULAR_GEOMETRY;
    }
    if (!(arm_m > SHORTEST_ARM_M)) return TC_SINGULAR_GEOMETRY;
    if (!(p->rotor_max_rad_s > p->rotor_min_rad_s && p->rotor_max_rad_s >= p->rotor_idle_rad_s)) return TC_OUT_OF_RANGE;
    const float load_per_n = choose_law(mixer, p);
    const tc_reason reason = invert_geometry(mixer, p, arm_m, load_per_n, &yaw_per_free);
    if (reason != TC_OK) return reason;
    /* Enough to hover with a tenth to spare? */
    const float each_n = p->mass_kg * p->gravity_m_s2 * 1.1f * 0.25f;
    const float per_square = still_air_factor(mixer, load_per_n);
    const float thrust_n = per_square * p->rotor_max_rad_s * p->rotor_max_rad_s;
    mixer->free_per_yaw = per_square / (p->cq_n_m_s2 * yaw_per_free);
    mixer->largest_thrust_n = 4.0f * thrust_n;
    const float least_n = per_square * p->rotor_min_rad_s * p->rotor_min_rad_s;
    mixer->guaranteed_yaw = 0.5f * p->yaw_share * (thrust_n - least_n);
    mixer->near = TC_MIXER_FAR * NEAR * each_n * load_per_n;
    return thrust_n >= each_n ? TC_OK : TC_CANNOT_HOVER;
}
