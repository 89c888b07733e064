/* Exact inverse of eqs. (1)-(3), with desaturation.

   One form covers all three thrust laws, T = a n^2 + (c v_z - k v) n, with v from eq. (2); its root is
   2 a n = sqrt(b^2 + 4 a T) - b, b = c v_z - k v. Air speeds are kept times k, rotor speeds times 2 a, and thrusts as
   "load" T k^2 / (2 rho A), so that eq. (2) reads v sqrt((v_z + v)^2 + v_xy^2) = load and b = drag - v. */
#include "goshawk_controller/mixer.h"

#include "maths.h"

#define SHORTEST_ARM_M 0.01f
/* Rounds of Newton's method on induced velocities and yaw together. Three leave less than 1e-5 of full speed over the
   envelope, see tests/firmware_bridge/test_controller_numbers.py; desaturation, where needed, comes before the last. */
#define ROUNDS 3
/* The free direction starts this share inside the range that keeps all thrusts positive, and a step goes at most this
   share of the way to the range's ends: a rotor that is asked for next to nothing must not be driven below. */
#define INSIDE 0.05f
#define TOWARDS_END 0.9f
/* Speeds this far outside the limits, of the fastest speed, still count as inside: what the last round may change. */
#define TOLERANCE 2e-3f
#define NO_END 1e9f

/* The air at one hub, and the operating point found there. */
typedef struct {
    float base;     /* load asked for, without the free direction; of a healthy rotor without translational lift */
    float axial;    /* v_z */
    float lateral2; /* v_xy^2 */
    float drag;     /* what v_z adds to the linear term of the thrust law */
    float induced;  /* v */
    float induced_per_free; /* d / d multiple of the free direction */
    float speed;
    float speed_per_free;
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

/* Inverse of a symmetric 3x3 matrix by cross products of its rows. */
static void invert_symmetric(float m[3][3], float out[3][3]) {
    tc_cross(m[1], m[2], out[0]);
    tc_cross(m[2], m[0], out[1]);
    tc_cross(m[0], m[1], out[2]);
    const float det = tc_dot(m[0], out[0]);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) out[i][j] /= det;
    }
}

/* `yaw_per_free`: sum spin_i free_i. */
static tc_reason lay_out(tc_mixer* mixer, const tc_parameters* p, float arm_m, float load_per_n, float* yaw_per_free) {
    float column[TC_ROTORS][3]; /* collective, torque x, torque y per newton, arms scaled to about 1 */
    float gram[3][3] = {{0.0f}}, inverse[3][3], free[TC_ROTORS];
    for (int i = 0; i < TC_ROTORS; i++) {
        column[i][0] = 1.0f;
        column[i][1] = mixer->rotor[i].arm_y_m / arm_m;
        column[i][2] = -mixer->rotor[i].arm_x_m / arm_m;
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) gram[r][c] += column[i][r] * column[i][c];
        }
    }
    if (!(determinant(gram[0], gram[1], gram[2]) > 0.5f)) return TC_SINGULAR_GEOMETRY; /* 64 for a square */
    invert_symmetric(gram, inverse);
    null_vector(column, free);
    float largest = 0.0f, spin_sum = 0.0f, size_sum = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) largest = tc_max(largest, tc_abs(free[i]));
    if (!(largest > 1e-3f)) return TC_SINGULAR_GEOMETRY;
    for (int i = 0; i < TC_ROTORS; i++) {
        tc_mixer_rotor* m = &mixer->rotor[i];
        free[i] /= largest;
        spin_sum += p->rotor_spin[i] * free[i];
        size_sum += tc_abs(free[i]);
        const float per_collective = tc_dot(inverse[0], column[i]);
        /* Every rotor must lift and take part in yaw. */
        if (!(per_collective > 0.05f && tc_abs(free[i]) > 0.05f)) return TC_SINGULAR_GEOMETRY;
        const float unit = load_per_n / p->rotor_gain[i];
        m->per_collective = unit * per_collective;
        m->per_torque_x = unit * tc_dot(inverse[1], column[i]) / arm_m;
        m->per_torque_y = unit * tc_dot(inverse[2], column[i]) / arm_m;
        m->free = unit * free[i];
        m->per_free = 1.0f / m->free;
        m->free_slope = 0.5f * mixer->load_factor * m->free;
        m->spin = p->rotor_spin[i];
    }
    *yaw_per_free = spin_sum;
    return tc_abs(spin_sum) > 0.25f * size_sum ? TC_OK : TC_SINGULAR_GEOMETRY;
}

/* Units and thrust law; returns the load per newton. */
static float choose_law(tc_mixer* mixer, const tc_parameters* p) {
    const bool quadratic = p->thrust_model < 0.5f;
    const float square = quadratic ? p->quad_n_s2 : p->k1_n_s2;
    const float per_disk = 1.0f / (2.0f * p->air_density_kg_m3 * p->disk_area_m2);
    const float hover_n = 0.25f * p->mass_kg * p->gravity_m_s2;
    /* Without induced velocity in the law any small unit will do: a millionth of what the square law gives at hover. */
    const float none = 1e-6f * sqrtf(square * hover_n) / sqrtf(hover_n * per_disk);
    const float unit = quadratic ? none : tc_max(-p->k2_n_s2_m, none);
    const float load_per_n = unit * unit * per_disk;
    mixer->unit_m_s = unit;
    mixer->axial = (quadratic ? -p->inflow_kg : p->k2_n_s2_m) / unit;
    mixer->lateral = p->thrust_model > 1.5f ? 1.0f : 0.0f;
    mixer->lift = p->lift_kg_m * per_disk;
    mixer->guard = 1e-3f * unit * unit;
    mixer->load_factor = 4.0f * square / load_per_n;
    mixer->speed_unit = 2.0f * square;
    mixer->per_speed = 1.0f / mixer->speed_unit;
    mixer->turn_per_yaw = mixer->speed_unit * mixer->speed_unit / p->cq_n_m_s2;
    return load_per_n;
}

/* Thrust over n^2 in still air, where it is the same for every thrust: from the hover. */
static float still_air_factor(const tc_mixer* mixer, float each_n, float load_per_n) {
    const float load = each_n * load_per_n;
    const float b = -sqrtf(load);
    const float n = mixer->per_speed * (sqrtf(b * b + mixer->load_factor * load) - b);
    return each_n / (n * n);
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
    const tc_reason reason = lay_out(mixer, p, arm_m, load_per_n, &yaw_per_free);
    if (reason != TC_OK) return reason;
    /* Enough to hover with a tenth to spare? */
    const float each_n = p->mass_kg * p->gravity_m_s2 * 1.1f * 0.25f;
    const float per_square = still_air_factor(mixer, each_n, load_per_n);
    const float thrust_n = per_square * p->rotor_max_rad_s * p->rotor_max_rad_s;
    mixer->free_per_yaw = per_square / (p->cq_n_m_s2 * yaw_per_free);
    mixer->largest_thrust_n = 4.0f * thrust_n;
    return thrust_n >= each_n ? TC_OK : TC_CANNOT_HOVER;
}

/* Where the free direction may go: within it all thrusts are positive. */
typedef struct {
    float low, high;
} range;

/* What each rotor is asked for, the air at its hub, and the range of the free direction. */
static inline range start(const tc_mixer* mixer, const tc_wrench* wrench, const float air_m_s[3],
                          const float rate_rad_s[3], rotor r[TC_ROTORS]) {
    range free = {-NO_END, NO_END};
    float air[3], rate[3];
    for (int i = 0; i < 3; i++) {
        air[i] = mixer->unit_m_s * air_m_s[i];
        rate[i] = mixer->unit_m_s * rate_rad_s[i];
    }
    const float smallest = 1e-6f * mixer->guard; /* a load of exactly nothing has no slope */
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        const float x = m->arm_x_m, y = m->arm_y_m;
        const float vx = air[0] - rate[2] * y, vy = air[1] + rate[2] * x;
        const float vz = air[2] + rate[0] * y - rate[1] * x;
        const float lateral2 = vx * vx + vy * vy;
        const float base = m->per_collective * wrench->thrust_n + m->per_torque_x * wrench->torque_n_m[0] +
                           m->per_torque_y * wrench->torque_n_m[1] - mixer->lift * lateral2 + smallest;
        const float end = -base * m->per_free;
        if (m->free > 0.0f) {
            free.low = tc_max(free.low, end);
        } else {
            free.high = tc_min(free.high, end);
        }
        r[i].base = base;
        r[i].axial = vz;
        r[i].lateral2 = mixer->lateral * lateral2;
        r[i].drag = mixer->axial * vz;
    }
    return free;
}

/* The induced velocity for v_xy = 0, where eq. (2) is a quadratic. */
static inline void guess(const tc_mixer* mixer, float free, rotor r[TC_ROTORS]) {
    for (int i = 0; i < TC_ROTORS; i++) {
        const float half = 0.5f * r[i].axial;
        r[i].induced = sqrtf(half * half + tc_abs(r[i].base + free * mixer->rotor[i].free)) - half;
        r[i].induced_per_free = 0.0f;
    }
}

/* One round at the multiple `free`, which has moved by `step` since the last one: one Newton step on eq. (2) from the
   induced velocity carried along; then eq. (1). Returns the Newton step of the multiple towards the wanted sum of spin
   times squared speed. Absolute values stand where a demand that cannot be met would leave the law's domain. */
static inline float solve_round(const tc_mixer* mixer, float free, float step, float turn, rotor r[TC_ROTORS]) {
    float slope = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        const float load = tc_abs(r[i].base + free * m->free);
        const float v = r[i].induced + r[i].induced_per_free * step;
        const float w = r[i].axial + v;
        const float q = w * w + r[i].lateral2;
        const float root = sqrtf(q);
        const float inverse = 1.0f / (tc_abs(q + v * w) + mixer->guard); /* over the derivative times root */
        const float induced = tc_abs(v - (v * q - load * root) * inverse);
        const float induced_per_free = root * inverse * m->free;
        const float b = r[i].drag - induced;
        const float steep = sqrtf(b * b + mixer->load_factor * load);
        const float n = steep - b;
        const float speed_per_free = (m->free_slope + n * induced_per_free) / steep;
        const float turned = m->spin * n;
        turn -= turned * n;
        slope += turned * speed_per_free;
        r[i].induced = induced;
        r[i].induced_per_free = induced_per_free;
        r[i].speed = n;
        r[i].speed_per_free = speed_per_free;
    }
    return 0.5f * turn / slope;
}

/* What the rotors can give at these air speeds, and what is asked of them, all as loads. */
typedef struct {
    float low[TC_ROTORS], high[TC_ROTORS]; /* at the speed limits */
    float tilt[TC_ROTORS];                 /* of the roll and pitch torque */
    float other[TC_ROTORS];                /* of neither tilt, collective nor free direction: the lift */
} limits;

/* Load at a speed: the induced velocity for v_xy = 0 from a quadratic, then one Newton step with v_xy. */
static float load_at(const tc_mixer* mixer, const rotor* r, float speed) {
    const float per_factor = 1.0f / mixer->load_factor;
    const float slope = 2.0f * speed * per_factor; /* load lost per induced velocity */
    const float still = tc_max(speed * (speed + 2.0f * r->drag) * per_factor, 0.0f);
    const float half = 0.5f * (r->axial + slope);
    float v = sqrtf(half * half + still) - half;
    const float w = r->axial + v;
    const float root = sqrtf(w * w + r->lateral2);
    v -= (v * root - still + slope * v) * root / (tc_abs(root * (root + slope) + v * w) + mixer->guard);
    return tc_max(still - slope * v, 0.0f);
}

static void reach(const tc_mixer* mixer, const tc_parameters* p, const tc_wrench* wrench, const rotor r[TC_ROTORS],
                  limits* l) {
    const float slowest = p->rotor_min_rad_s * mixer->speed_unit, fastest = p->rotor_max_rad_s * mixer->speed_unit;
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        l->low[i] = load_at(mixer, &r[i], slowest);
        l->high[i] = tc_max(load_at(mixer, &r[i], fastest), l->low[i]);
        l->tilt[i] = m->per_torque_x * wrench->torque_n_m[0] + m->per_torque_y * wrench->torque_n_m[1];
        l->other[i] = r[i].base - l->tilt[i] - m->per_collective * wrench->thrust_n;
    }
}

/* The largest share of the tilt torque, up to 1, for which some collective keeps every rotor within its limits. For
   each pair: what raises rotor i to its lower limit must not lift rotor j over its upper one. */
static float tilt_share(const tc_mixer* mixer, const limits* l, float kept) {
    float share = 1.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* a = &mixer->rotor[i];
        const float needs = (l->low[i] - l->other[i] - kept * a->free) / a->per_collective;
        const float needs_less = l->tilt[i] / a->per_collective;
        for (int j = 0; j < TC_ROTORS; j++) {
            const tc_mixer_rotor* b = &mixer->rotor[j];
            const float room = (l->high[j] - l->other[j] - kept * b->free) / b->per_collective - needs;
            const float spread = l->tilt[j] / b->per_collective - needs_less;
            if (spread * share > room) share = tc_max(room, 0.0f) / spread;
        }
    }
    return share;
}

/* How far the free direction may go either way from nothing with the rotors' limits alone, at its share. */
static float own_yaw(const tc_mixer* mixer, const tc_parameters* p, const limits* l) {
    float own = NO_END;
    for (int i = 0; i < TC_ROTORS; i++) {
        own = tc_min(own, tc_abs((l->high[i] - l->low[i]) * mixer->rotor[i].per_free));
    }
    return 0.5f * p->yaw_share * own;
}

static float keep_collective(const tc_mixer* mixer, const limits* l, float share, float kept, float wanted_n) {
    float least = 0.0f, most = NO_END;
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        const float taken = l->other[i] + share * l->tilt[i] + kept * m->free;
        least = tc_max(least, (l->low[i] - taken) / m->per_collective);
        most = tc_min(most, (l->high[i] - taken) / m->per_collective);
    }
    return tc_clamp(wanted_n, least, most);
}

/* Priority: tilt torque, then collective, then yaw, which keeps `yaw_share` of its authority throughout. Changes what
   each rotor is asked for, moves `*free` and returns its range. */
static __attribute__((noinline)) range desaturate(const tc_mixer* mixer, const tc_parameters* p,
                                                  const tc_wrench* wrench, rotor r[TC_ROTORS], float* free,
                                                  uint8_t* saturation) {
    limits l;
    reach(mixer, p, wrench, r, &l);
    const float own = own_yaw(mixer, p, &l), wanted = *free;
    const float kept = tc_clamp(wanted, -own, own);
    const float share = tilt_share(mixer, &l, kept);
    const float collective = keep_collective(mixer, &l, share, kept, wrench->thrust_n);
    range yaw = {-NO_END, NO_END};
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        const float base = l.other[i] + share * l.tilt[i] + collective * m->per_collective;
        const float a = (l.low[i] - base) * m->per_free, b = (l.high[i] - base) * m->per_free;
        yaw.low = tc_max(yaw.low, tc_min(a, b));
        yaw.high = tc_min(yaw.high, tc_max(a, b));
        r[i].induced += (base - r[i].base) * m->per_free * r[i].induced_per_free;
        r[i].base = base;
    }
    yaw.low = tc_min(yaw.low, kept);
    yaw.high = tc_max(yaw.high, kept);
    const float small_n = 1e-3f * (wrench->thrust_n + 1.0f);
    *free = tc_clamp(wanted, yaw.low, yaw.high);
    if (share < 0.999f) *saturation |= TC_SATURATED_TILT;
    if (tc_abs(collective - wrench->thrust_n) > small_n) *saturation |= TC_SATURATED_COLLECTIVE;
    if (tc_abs(*free - wanted) > small_n) *saturation |= TC_SATURATED_YAW;
    return yaw;
}

/* Whether all of them lie between two positive bounds; one unsigned comparison of the bits each, NaN is outside. */
static inline bool all_between(const float speed[TC_ROTORS], float low, float high) {
    const uint32_t first = tc_bits(low), width = tc_bits(high) - first;
    bool between = true;
    for (int i = 0; i < TC_ROTORS; i++) between = between && tc_bits(speed[i]) - first <= width;
    return between;
}

/* Speeds in rad/s once the free direction has moved by `step`. */
static inline void speeds(const tc_mixer* mixer, const rotor r[TC_ROTORS], float step, float speed[TC_ROTORS]) {
    for (int i = 0; i < TC_ROTORS; i++) speed[i] = mixer->per_speed * (r[i].speed + step * r[i].speed_per_free);
}

static __attribute__((noinline)) uint8_t clip(const tc_parameters* p, float speed[TC_ROTORS]) {
    uint8_t saturation = 0u;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = tc_clamp(speed[i], p->rotor_min_rad_s, p->rotor_max_rad_s);
        if (!(tc_abs(n - speed[i]) <= 1e-3f * n)) saturation = TC_SATURATED_ROTOR;
        speed[i] = n;
    }
    return saturation;
}

void tc_mixer_solve(const tc_mixer* mixer, const tc_parameters* p, const tc_wrench* wrench,
                    const float air_velocity_body_m_s[3], const float rate_body_rad_s[3], tc_mix* out) {
    rotor r[TC_ROTORS];
    const float first = wrench->torque_n_m[2] * mixer->free_per_yaw; /* as if thrust went with n^2 */
    const float turn = wrench->torque_n_m[2] * mixer->turn_per_yaw;
    const float least = p->rotor_min_rad_s, most = p->rotor_max_rad_s, over = TOLERANCE * most;
    const range positive = start(mixer, wrench, air_velocity_body_m_s, rate_body_rad_s, r);
    const bool possible = positive.high > positive.low;
    const float inside = INSIDE * (positive.high - positive.low);
    float free = possible ? tc_clamp(first, positive.low + inside, positive.high - inside) : first;
    range end = {-NO_END, NO_END};
    float step = 0.0f;
    out->saturation = 0u;
    guess(mixer, free, r);
    for (int round = 1; round <= ROUNDS; round++) {
        if (round == ROUNDS) {
            speeds(mixer, r, step, out->rotor_speed_rad_s);
            if (!possible || !all_between(out->rotor_speed_rad_s, tc_max(least - over, 0.0f), most + over)) {
                end = desaturate(mixer, p, wrench, r, &free, &out->saturation);
            }
        }
        const float next = solve_round(mixer, free, step, turn, r);
        if (round == ROUNDS) {
            step = tc_clamp(next, end.low - free, end.high - free);
        } else {
            step = possible ? tc_clamp(next, TOWARDS_END * (positive.low - free), TOWARDS_END * (positive.high - free))
                            : 0.0f;
            free += step;
        }
    }
    speeds(mixer, r, step, out->rotor_speed_rad_s);
    if (!all_between(out->rotor_speed_rad_s, least, most)) out->saturation |= clip(p, out->rotor_speed_rad_s);
}
