/* Whether the pose agrees with the IMU, and with itself. */
#include "../base/maths.h"
#include "internal.h"

static const float WINDOW_S = 0.3f;
static const float VELOCITY_GAP_M_S = 0.8f; /* largest of good flights: 0.34 */
static const float POSITION_GAP_M = 0.25f;  /* ... 0.03 */
static const float SIGMAS2 = 16.0f;         /* four standard deviations of the integrated accelerometer noise */
static const float SHAKE_FILTER_S = 0.3f;
static const float IMPACT_TIMES = 16.0f;  /* an impact is no shaking: beyond four times the noise, */
static const float IMPACT_M2_S4 = 1.0f;   /* ... or 1 m/s2, a jump counts as that */
static const float HEADING_GAP = 0.174f;  /* half of 0.35 rad, its sine */
static const float REPEATED_S = 0.2f;     /* a pose that has repeated itself for so long is frozen */
static const float SHAKES_M2_S4 = 4e-4f;  /* ... if the accelerometer's noise is above 0.02 m/s2 */
static const float TURNS_RAD2_S2 = 4e-4f; /* ... or, without one, it turns by 0.02 rad/s */
static const float DISTRUST_S = 0.5f;     /* after the last alarm */
static const float TOGETHER_S = 10.0f;    /* alarms within are counted */
static const uint8_t MOST_ALARMS = 3u;    /* this one is final */
static const float TOUCH_S = 0.1f;        /* after an impact, as late as a pose may be */
static const float DRIFT_M = 0.4f;        /* of position from its velocity */
static const float DRIFT_S = 3.0f;        /* time constant of forgetting it */

bool tc_monitor_believes(const tc_controller* c) {
    const tc_monitor* m = &c->monitor;
    return !m->final && (m->reason == (uint8_t)TC_OK || tc_lasts(c, m->alarm_us, DISTRUST_S));
}

/* A heading that jumped says nothing of the height. */
bool tc_monitor_believes_height(const tc_controller* c) {
    const tc_monitor* m = &c->monitor;
    if (m->reason != (uint8_t)TC_POSE_HEADING) return tc_monitor_believes(c);
    return tc_lasts(c, m->alarm_us, DISTRUST_S);
}

static void raise_alarm(tc_controller* c, tc_reason reason) {
    tc_monitor* m = &c->monitor;
    if (tc_monitor_believes(c)) {
        if (m->alarms == 0u || tc_lasts(c, m->first_us, TOGETHER_S)) {
            m->first_us = c->telemetry.time_us;
            m->alarms = 0;
        }
        m->alarms++;
        m->final = m->alarms >= MOST_ALARMS;
        m->reason = (uint8_t)reason;
        memset(m->drift_m, 0, sizeof m->drift_m);
    }
    m->alarm_us = c->telemetry.time_us;
}

/* Position and velocity as they were before, carried on by the IMU. */
static void restore(tc_controller* c) {
    const tc_monitor* m = &c->monitor;
    const tc_monitor_window* older = &m->window[m->window[0].age_s > m->window[1].age_s ? 0 : 1];
    tc_estimate* now = &c->telemetry.estimate;
    tc_copy(now->position_world_m, older->forced ? older->reckoned_m : older->position_m);
    if (older->forced) tc_copy(now->velocity_world_m_s, older->velocity_m_s);
}

void tc_monitor_heading(tc_controller* c, const tc_estimate* e, float step_s, float q[4]) {
    tc_monitor* m = &c->monitor;
    const float* old = c->telemetry.estimate.q_world_body;
    const float* rate = c->telemetry.estimate.rate_body_rad_s;
    tc_copy4(q, e->q_world_body);
    if (m->turned) tc_q_multiply(m->turn, e->q_world_body, q);
    const float turned_z = q[3] * old[0] - q[0] * old[3] - q[1] * old[2] + q[2] * old[1]; /* q times conjugate(old) */
    const float gyro = 0.5f * step_s * (tc_abs(rate[0]) + tc_abs(rate[1]) + tc_abs(rate[2]));
    const bool told = e->reset_counter != c->seen_counter;
    const bool known = (c->telemetry.estimate_faults & (uint32_t)TC_FAULT_ATTITUDE_STALE) == 0u;
    if (tc_abs(turned_z) <= HEADING_GAP + gyro || told || !known) return;
    if (!tc_mission_in_air(c->mission.state) || c->parameters.monitor < 0.5f) return;
    const float back[4] = {old[0], -old[1], -old[2], -old[3]};
    float change[4], sine, cosine, turned[4];
    tc_q_multiply(q, back, change);
    tc_sin_cos(-0.5f * tc_q_yaw(change), &sine, &cosine);
    const float turn[4] = {cosine, 0.0f, 0.0f, sine}; /* the heading stays what it was */
    tc_q_multiply(turn, q, turned);
    tc_copy4(q, turned);
    if (m->turned) {
        tc_q_multiply(turn, m->turn, change);
        tc_copy4(m->turn, change);
    } else {
        tc_copy4(m->turn, turn);
    }
    m->turned = true;
    if (m->running && tc_monitor_believes(c)) restore(c);
    raise_alarm(c, TC_POSE_HEADING);
    m->final = true;
}

static void begin_window(tc_monitor_window* w, const float position_m[3], const float velocity_m_s[3], float age_s) {
    tc_copy(w->velocity_m_s, velocity_m_s);
    tc_copy(w->position_m, position_m);
    tc_copy(w->reckoned_m, position_m);
    w->age_s = age_s;
    w->forced = true;
}

static float gap2(const float a[3], const float b[3]) {
    const float gap[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return tc_dot(gap, gap);
}

/* Goes on by a step; what is wrong with the pose as seen from the window's beginning. */
static tc_reason judge(tc_monitor* m, tc_monitor_window* w, const float position_m[3], const float velocity_m_s[3],
                       const float acceleration_m_s2[3], bool forced, float step_s) {
    for (int i = 0; i < 3; i++) {
        w->velocity_m_s[i] += step_s * acceleration_m_s2[i];
        w->reckoned_m[i] += step_s * w->velocity_m_s[i];
        w->position_m[i] += step_s * velocity_m_s[i];
    }
    w->age_s += step_s;
    w->forced = w->forced && forced;
    const float noise2 = SIGMAS2 * m->shake_m2_s4 * step_s * WINDOW_S;
    if (w->forced && gap2(velocity_m_s, w->velocity_m_s) > VELOCITY_GAP_M_S * VELOCITY_GAP_M_S + noise2) {
        return TC_POSE_VELOCITY;
    }
    return gap2(position_m, w->position_m) > POSITION_GAP_M * POSITION_GAP_M ? TC_POSE_POSITION : TC_OK;
}

void tc_monitor_shaking(tc_controller* c, const float force_body_m_s2[3], float step_s) {
    tc_monitor* m = &c->monitor;
    const float pass = step_s / (SHAKE_FILTER_S + step_s);
    const float change2 = gap2(force_body_m_s2, c->telemetry.estimate.specific_force_body_m_s2);
    const float now = tc_min(0.5f * change2, IMPACT_TIMES * m->shake_m2_s4 + IMPACT_M2_S4);
    m->shake_m2_s4 += pass * (now - m->shake_m2_s4);
}

static bool same_bits(const float a[3], const float b[3]) {
    return tc_bits(a[0]) == tc_bits(b[0]) && tc_bits(a[1]) == tc_bits(b[1]) && tc_bits(a[2]) == tc_bits(b[2]);
}

/* Whether poses with new stamps bring the same numbers. */
static bool repeats(tc_controller* c, const tc_estimate* e, bool forced) {
    tc_monitor* m = &c->monitor;
    const float* rate = c->telemetry.estimate.rate_body_rad_s;
    const bool shakes = forced ? m->shake_m2_s4 > SHAKES_M2_S4 : tc_dot(rate, rate) > TURNS_RAD2_S2;
    if (!same_bits(m->last_pose, e->position_world_m) || !same_bits(m->last_pose + 3, e->velocity_world_m_s)) {
        tc_copy(m->last_pose, e->position_world_m);
        tc_copy(m->last_pose + 3, e->velocity_world_m_s);
        m->changed_us = c->telemetry.time_us;
    }
    return tc_lasts(c, m->changed_us, REPEATED_S) && shakes;
}

static void measure_drift(tc_monitor* m, const float position_m[3], const float velocity_m_s[3], float step_s) {
    for (int i = 0; i < 2; i++) {
        const float moved_m = position_m[i] - m->before_m[i] - step_s * velocity_m_s[i];
        m->drift_m[i] += moved_m - step_s * (1.0f / DRIFT_S) * m->drift_m[i];
        m->before_m[i] = position_m[i];
    }
    m->drifts = m->drift_m[0] * m->drift_m[0] + m->drift_m[1] * m->drift_m[1] > DRIFT_M * DRIFT_M;
}

float tc_monitor_speed2(const tc_controller* c) {
    const float* v = c->telemetry.estimate.velocity_world_m_s;
    const float x = v[0] + (1.0f / DRIFT_S) * c->monitor.drift_m[0],
                y = v[1] + (1.0f / DRIFT_S) * c->monitor.drift_m[1];
    return x * x + y * y;
}

static void begin(tc_controller* c, const float position_m[3], const float velocity_m_s[3]) {
    tc_monitor* m = &c->monitor;
    begin_window(&m->window[0], position_m, velocity_m_s, 0.0f);
    begin_window(&m->window[1], position_m, velocity_m_s, 0.5f * WINDOW_S);
    m->before_m[0] = position_m[0];
    m->before_m[1] = position_m[1];
    m->last_step_s = 0.0f;
    if (!m->running) m->changed_us = c->telemetry.time_us;
    m->running = true;
}

/* A pose that is believed again has moved its frame: off the path, what is flown moves with it. */
static void accept(tc_controller* c, const float position_m[3]) {
    tc_monitor* m = &c->monitor;
    float gap_m[3];
    for (int i = 0; i < 3; i++) gap_m[i] = position_m[i] - c->telemetry.estimate.position_world_m[i];
    m->before_m[0] = position_m[0];
    m->before_m[1] = position_m[1];
    if (tc_mission_on_path(c->mission.state) || c->mission.state == TC_EMERGENCY) return;
    tc_move_shift(&c->move, gap_m, 0.0f);
    c->landing.z_m += gap_m[2];
    for (int i = 0; i < 3; i++) c->telemetry.setpoint.position_world_m[i] += gap_m[i];
}

/* What touches the ground proves nothing: a late pose is still falling when the accelerometer has stopped. */
static bool on_ground(const tc_controller* c) {
    const tc_landing* landing = &c->landing;
    const bool lands = c->mission.state == TC_LANDING && landing->impact_us > landing->began_us;
    return tc_landing_unloads(landing) || (lands && !tc_lasts(c, landing->impact_us, TOUCH_S));
}

/* What carries a pose to the tick: one sample of the accelerometer would bring all of its noise at once. */
static void steady_acceleration(tc_controller* c, bool forced, const float acceleration_m_s2[3], float out[3]) {
    if (!forced) {
        tc_copy(out, acceleration_m_s2);
        return;
    }
    tc_to_world(c->axes, c->felt_m_s2, out);
    out[2] -= c->parameters.gravity_m_s2;
}

/* Position and velocity at the tick: the pose this time ahead, and what it lacks a step from the last tick. */
static void carry(const tc_controller* c, const tc_estimate* e, tc_monitored part, const float acceleration_m_s2[3],
                  float ahead_s, float step_s, float position_m[3], float velocity_m_s[3]) {
    for (int i = 0; i < 3; i++) {
        const bool given = i < 2 ? part != TC_MONITORED_HEIGHT : part != TC_MONITORED_LEVEL;
        const tc_estimate* from = given ? e : &c->telemetry.estimate;
        const float time_s = given ? ahead_s : step_s, gain = time_s * acceleration_m_s2[i];
        position_m[i] = from->position_world_m[i] + time_s * (from->velocity_world_m_s[i] + 0.5f * gain);
        velocity_m_s[i] = from->velocity_world_m_s[i] + gain;
    }
}

void tc_monitor_step(tc_controller* c, const tc_estimate* e, tc_monitored part, const float acceleration_m_s2[3],
                     float ahead_s, float step_s) {
    tc_monitor* m = &c->monitor;
    const bool forced = (c->telemetry.estimate.valid & (uint8_t)TC_VALID_SPECIFIC_FORCE) != 0u;
    const bool told = e->reset_counter != c->reset_counter || m->part != (uint8_t)part;
    float position_m[3], velocity_m_s[3], steady_m_s2[3];
    steady_acceleration(c, forced, acceleration_m_s2, steady_m_s2);
    carry(c, e, part, steady_m_s2, ahead_s, step_s, position_m, velocity_m_s);
    m->part = (uint8_t)part;
    const bool believed = tc_monitor_believes(c);
    if (!m->running || told || on_ground(c)) {
        begin(c, position_m, velocity_m_s);
        if (!believed && !m->final) m->alarm_us = c->telemetry.time_us;
        return;
    }
    if (believed && m->doubted) accept(c, position_m);
    m->doubted = !believed;
    const bool even = tc_even_tick(c);
    tc_monitor_window* window = &m->window[even ? 0 : 1];
    const float both_s = step_s + m->last_step_s;
    m->last_step_s = step_s;
    tc_reason reason = judge(m, window, position_m, velocity_m_s, acceleration_m_s2, forced, both_s);
    if (even && repeats(c, e, forced)) reason = TC_POSE_FROZEN;
    if (believed) measure_drift(m, position_m, velocity_m_s, step_s);
    if (reason != TC_OK) {
        if (tc_monitor_believes(c)) restore(c);
        raise_alarm(c, reason);
        begin(c, position_m, velocity_m_s);
        return;
    }
    if (window->age_s >= WINDOW_S) begin_window(window, position_m, velocity_m_s, 0.0f);
}
