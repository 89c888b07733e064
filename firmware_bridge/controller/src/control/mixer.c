/* Exact inverse of eqs. (1)-(3), with desaturation. Derivation, accuracy and the origin of each constant:
   docs/evidence/studies/mixer.md.

   One form covers all three thrust laws, T = a n^2 + (c v_z - k v) n, with v from eq. (2); its root is
   2 a n = sqrt(b^2 + 4 a T) - b, b = c v_z - k v. Air speeds are kept times k, rotor speeds times 2 a, and thrusts as
   "load" T k^2 / (2 rho A), so that eq. (2) reads v sqrt((v_z + v)^2 + v_xy^2) = load and b = drag - v.

   What couples the rotors is yaw: the sum of spin times squared speed. The square is nearly a straight line over the
   load. So the operating points are solved once, by one Chebyshev step (third order) on eq. (2) from a close initial
   value, at the loads that a hovering vehicle would need; from there the free direction is moved along a parabola. */
#include "goshawk_controller/mixer.h"

#include "../base/maths.h"
#include "mixer_parts.h"

/* Squared speeds outside the limits by less than this share of the highest still count as inside at first. */
static const float TOLERANCE = 0.01f;
static const float TINY = 1e-30f; /* not zero, but positive */
static const float GUARD = 1e3f;  /* times `still` */
/* Squared speeds beyond the limits by this share, a few roundings of float32, still count as inside. */
static const float ROUNDINGS = 3e-7f;
/* Less than this share of collective or cut counts as given in full. */
static const float SMALL = 1e-3f;

/* One rotor: its demand, the air at its hub, and the operating point solved last. */
typedef struct {
    float load;        /* where the operating point was solved; of a healthy rotor without translational lift */
    float axial;       /* v_z */
    float lateral2;    /* v_xy^2 */
    float drag;        /* what v_z adds to the linear term of the thrust law */
    float square;      /* squared speed, along the parabola through the operating point */
    float square_rise; /* its slope over the load */
    float square_bend; /* half of its second derivative */
} rotor;

void tc_mixer_flow_at(const tc_mixer* mixer, const float air_velocity_body_m_s[3], const float rate_body_rad_s[3],
                      tc_mixer_flow* flow) {
    float air[3], rate[3];
    for (int i = 0; i < 3; i++) {
        air[i] = mixer->unit_m_s * air_velocity_body_m_s[i];
        rate[i] = mixer->unit_m_s * rate_body_rad_s[i];
    }
    for (int i = 0; i < TC_ROTORS; i++) {
        const float x = mixer->rotor[i].arm_x_m, y = mixer->rotor[i].arm_y_m;
        const float vx = air[0] - rate[2] * y, vy = air[1] + rate[2] * x;
        flow->axial[i] = air[2] + rate[0] * y - rate[1] * x;
        flow->lateral2[i] = vx * vx + vy * vy;
    }
}

/* The load demanded of a rotor if thrust goes with n^2 as it does in hover. */
static inline void set_demand(const tc_mixer* mixer, const tc_mixer_rotor* m, const tc_wrench* wrench, float axial,
                              float lateral2, float free, rotor* r) {
    r->load = m->per_collective * wrench->thrust_n + m->per_torque_x * wrench->torque_n_m[0] +
              m->per_torque_y * wrench->torque_n_m[1] + m->free * free - mixer->lift * lateral2;
    r->axial = axial;
    r->lateral2 = mixer->lateral * lateral2 + mixer->still;
    r->drag = mixer->axial * axial;
}

/* Initial value of the induced velocity for a load, within 1.4 % for v_z > -sqrt(load): with v_xy = 0, eq. (2) is a
   quadratic for w = v_z + v; one rational step, a minimax fit, corrects w for v_xy, and eq. (2) then gives v. */
static inline float initial_induced_velocity(const rotor* r, float load) {
    const float half = 0.5f * r->axial, lateral2 = r->lateral2;
    const float middle = sqrtf(half * half + load);
    const float w = middle + half;
    const float through = w - 0.4614f * lateral2 * (middle - half) / (w * w + 0.668f * load + 0.395f * lateral2);
    return load / sqrtf(through * through + lateral2);
}

/* The operating point for the demand: one Chebyshev step on eq. (2) (the induced velocity as a parabola over the load),
   then eq. (1), with two derivatives. A negative load has no operating point; it gets the tangent at that of the
   opposite one, which lies below the slowest speed, and one near zero the tangent at the least load. Absolute values
   stand where an infeasible demand would leave the law's domain. */
static inline void solve_operating_point(const tc_mixer* mixer, rotor* r) {
    const float load = tc_max(tc_abs(r->load), mixer->least_load), guard = GUARD * mixer->still;
    const float v = initial_induced_velocity(r, load);
    const float w = r->axial + v;
    const float q = w * w + r->lateral2;
    const float root = sqrtf(q);
    const float inverse = 1.0f / (tc_abs(q + v * w) + guard); /* over the derivative times root */
    const float rise = root * inverse;
    const float v2 = -rise * rise * inverse * (w + w + v * r->lateral2 / q);
    const float missing = load - v * root;
    const float bent = v2 * missing;
    const float v1 = mixer->induced * (rise + bent);
    const float b = r->drag - mixer->induced * tc_abs(v + (rise + 0.5f * bent) * missing);
    const float steep = sqrtf(b * b + mixer->load_factor * load);
    const float n = steep - b;
    const float n1 = (0.5f * mixer->load_factor + n * v1) / steep;
    const float n2 = (mixer->induced * n * v2 + n1 * (v1 + v1 - n1)) / steep;
    r->square_rise = (n + n) * n1;
    r->square = n * n + r->square_rise * (r->load - load);
    r->square_bend = n1 * n1 + n * n2;
}

/* The sum of spin times squared speed that is still missing, its slope along the free direction, and half of its
   second derivative. */
typedef struct {
    float missing, slope, bend;
} yaw_balance;

static inline void add_yaw_terms(const tc_mixer_rotor* m, const rotor* r, yaw_balance* yaw) {
    yaw->missing -= m->spin * r->square;
    const float spin_free = m->spin * m->free;
    yaw->slope += spin_free * r->square_rise;
    yaw->bend += spin_free * m->free * r->square_bend;
}

/* Moves the squared speeds along the free direction to where the yaw torque is met; returns how far. */
static inline float meet_yaw(const tc_mixer* mixer, const yaw_balance* yaw, rotor r[TC_ROTORS]) {
    const float straight = yaw->missing / yaw->slope;
    const float step = straight - yaw->bend * straight * straight / yaw->slope;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float more = step * mixer->rotor[i].free;
        r[i].square += (r[i].square_rise + r[i].square_bend * more) * more;
    }
    return step;
}

/* Whether that step changed a load so much that the operating points should be solved once more. */
static bool goes_far(const tc_mixer* mixer, const rotor r[TC_ROTORS], float step) {
    for (int i = 0; i < TC_ROTORS; i++) {
        if (tc_abs(step * mixer->rotor[i].free) > mixer->near + TC_MIXER_FAR * tc_abs(r[i].load)) return true;
    }
    return false;
}

/* Desaturation works with changes of the demand, in newtons of collective: what one rotor gets when the collective
   changes by as much. Squared speeds follow linearly. */
typedef struct {
    float rise[TC_ROTORS];                /* of the squared speed */
    float down[TC_ROTORS], up[TC_ROTORS]; /* changes that lead to the limits */
} margins;

typedef struct {
    float low, high;
} range;

/* Of a rotor that pulls air down the slope is at least that of still air; a parabola followed too far gives no bound.
 */
static inline void rotor_margins(const tc_mixer* mixer, const rotor r[TC_ROTORS], margins* l) {
    for (int i = 0; i < TC_ROTORS; i++) {
        const float rise = tc_max(r[i].square_rise, mixer->load_factor) * mixer->rotor[i].per_collective;
        l->rise[i] = rise;
        l->down[i] = (mixer->slowest2 - r[i].square) / rise;
        l->up[i] = (mixer->fastest2 - r[i].square) / rise;
    }
}

/* Changes of the collective that bring every rotor within its limits. */
static inline range collective_range(const margins* l) {
    range collective = {l->down[0], l->up[0]};
    for (int i = 1; i < TC_ROTORS; i++) {
        collective.low = tc_max(collective.low, l->down[i]);
        collective.high = tc_min(collective.high, l->up[i]);
    }
    return collective;
}

/* Adds a multiple of these changes of demand, rotor by rotor. */
static void change_demand(margins* l, float times, const float each_n[TC_ROTORS], rotor r[TC_ROTORS]) {
    for (int i = 0; i < TC_ROTORS; i++) {
        const float more_n = times * each_n[i];
        r[i].square += l->rise[i] * more_n;
        l->down[i] -= more_n;
        l->up[i] -= more_n;
    }
}

/* Takes as little of the tilt torque away as leaves a collective that keeps every rotor within its limits; returns the
   share that stays. For each pair: what raises rotor i to its lower limit must not lift rotor j over its upper one. */
static float cut_tilt(const tc_mixer* mixer, const tc_wrench* wrench, margins* l, rotor r[TC_ROTORS]) {
    float tilt_n[TC_ROTORS], share = 1.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        tilt_n[i] =
            (m->per_torque_x * wrench->torque_n_m[0] + m->per_torque_y * wrench->torque_n_m[1]) / m->per_collective;
    }
    for (int i = 0; i < TC_ROTORS; i++) {
        for (int j = 0; j < TC_ROTORS; j++) {
            const float spread = tilt_n[j] - tilt_n[i], room = l->up[j] - l->down[i] + spread;
            if (spread * share > room) share = tc_max(room, 0.0f) / spread;
        }
    }
    change_demand(l, share - 1.0f, tilt_n, r);
    return share;
}

/* The part, up to 1, of a change that the rotors' limits leave room for. */
static inline float part_of(float times, const float each_n[TC_ROTORS], const margins* l) {
    float part = 1.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float more_n = times * each_n[i], room_n = more_n > 0.0f ? l->up[i] : l->down[i];
        if (tc_abs(more_n) * part > tc_abs(room_n)) part = tc_abs(room_n / more_n);
    }
    return part;
}

/* Priority: tilt torque, then collective, then yaw, which keeps a share of its authority throughout: `yaw` is what it
   has beyond. */
static uint8_t desaturate(const tc_mixer* mixer, const tc_wrench* wrench, float yaw, margins* l, rotor r[TC_ROTORS]) {
    static const float all[TC_ROTORS] = {1.0f, 1.0f, 1.0f, 1.0f};
    float yaw_n[TC_ROTORS];
    uint8_t saturation = 0u;
    for (int i = 0; i < TC_ROTORS; i++) yaw_n[i] = mixer->rotor[i].yaw_n;
    change_demand(l, -yaw, yaw_n, r);
    range collective = collective_range(l);
    if (collective.low > collective.high) {
        if (cut_tilt(mixer, wrench, l, r) < 1.0f - SMALL) saturation |= TC_SATURATED_TILT;
        collective = collective_range(l);
    }
    const float more_n = tc_clamp(0.0f, collective.low, collective.high);
    if (tc_abs(more_n) > SMALL * wrench->thrust_n) saturation |= TC_SATURATED_COLLECTIVE;
    change_demand(l, more_n, all, r);
    const float part = part_of(yaw, yaw_n, l);
    if (part < 1.0f - SMALL) saturation |= TC_SATURATED_YAW;
    for (int i = 0; i < TC_ROTORS; i++) r[i].square += l->rise[i] * (part * yaw * yaw_n[i]); /* the margins are done */
    return saturation;
}

/* Keeps every rotor within its limits. Mostly nothing is to be done, or another collective is enough. `free`: where the
   free direction stands. */
static inline uint8_t keep_within_limits(const tc_mixer* mixer, const tc_wrench* wrench, float free,
                                         rotor r[TC_ROTORS]) {
    margins l;
    rotor_margins(mixer, r, &l);
    const range collective = collective_range(&l);
    const float more_n = tc_clamp(0.0f, collective.low, collective.high), size_n = tc_abs(more_n);
    const float yaw = free - tc_clamp(free, -mixer->guaranteed_yaw, mixer->guaranteed_yaw);
    if (collective.low > collective.high || (size_n > 0.0f && tc_abs(yaw) > 0.0f)) {
        return desaturate(mixer, wrench, yaw, &l, r);
    }
    for (int i = 0; i < TC_ROTORS; i++) r[i].square += l.rise[i] * more_n;
    return size_n > SMALL * wrench->thrust_n ? (uint8_t)TC_SATURATED_COLLECTIVE : 0u;
}

/* Whether all squared speeds are positive and within their limits, or outside by what the second round may change; NaN
   is not. */
static bool nearly_within_limits(const tc_mixer* mixer, const rotor r[TC_ROTORS]) {
    const float tolerance = TOLERANCE * mixer->fastest2;
    const float low = tc_max(mixer->slowest2 - tolerance, TINY), high = mixer->fastest2 + tolerance;
    for (int i = 0; i < TC_ROTORS; i++) {
        if (!(r[i].square >= low && r[i].square <= high)) return false;
    }
    return true;
}

/* Speeds, their squares clipped to the limits, NaN to the lower one; reports what is more than rounding. */
static inline uint8_t clip(const tc_mixer* mixer, const rotor r[TC_ROTORS], float rotor_speed_rad_s[TC_ROTORS]) {
    const float low = mixer->slowest2 * (1.0f - ROUNDINGS), high = mixer->fastest2 * (1.0f + ROUNDINGS);
    uint8_t saturation = 0u;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float limited = tc_clamp(r[i].square, low, high);
        if (!(tc_abs(limited - r[i].square) <= 2e-3f * limited)) saturation = TC_SATURATED_ROTOR;
        rotor_speed_rad_s[i] = mixer->per_speed * sqrtf(limited);
    }
    return saturation;
}

uint8_t tc_mixer_solve(const tc_mixer* mixer, const tc_wrench* wrench, const tc_mixer_flow* flow,
                       float rotor_speed_rad_s[TC_ROTORS]) {
    rotor r[TC_ROTORS];
    float free = wrench->torque_n_m[2] * mixer->free_per_yaw;
    for (int i = 0; i < TC_ROTORS; i++) {
        set_demand(mixer, &mixer->rotor[i], wrench, flow->axial[i], flow->lateral2[i], free, &r[i]);
    }
    bool again = false;
    for (;;) {
        yaw_balance yaw = {wrench->torque_n_m[2] * mixer->turn_per_yaw, 0.0f, 0.0f};
        for (int i = 0; i < TC_ROTORS; i++) {
            solve_operating_point(mixer, &r[i]);
            add_yaw_terms(&mixer->rotor[i], &r[i], &yaw);
        }
        const float step = meet_yaw(mixer, &yaw, r);
        free += step;
        if (again || !goes_far(mixer, r, step) || !nearly_within_limits(mixer, r)) break;
        for (int i = 0; i < TC_ROTORS; i++) r[i].load += step * mixer->rotor[i].free;
        again = true;
    }
    const uint8_t saturation = keep_within_limits(mixer, wrench, free, r);
    return saturation | clip(mixer, r, rotor_speed_rad_s);
}
