/* Coming down and touchdown, in stages. */
#include "../base/maths.h"
#include "internal.h"

static const float LEAD_M = 0.25f;             /* the set-point is at most so far below the vehicle */
static const float LEAD_NEAR_M = 0.05f;        /* of that, for the noise of the estimate */
static const float SPEED_UP_M_S2 = 0.02f;      /* a biased vertical velocity must not keep it up for ever */
static const float FASTEST_M_S = 1.0f;         /* that far, unless the parameter asks for more */
static const float VERTICAL_BRAKE_M_S2 = 2.0f; /* towards the descent's speed; out of a fall brake_m_s2, if more */
static const float BRAKING_M_S = 1.0f;         /* horizontal: it keeps its height until it is slower */
static const float CONTACT_S = 0.12f;          /* it must seem to be on something for this long */
static const float CONTACT_SPEED_M_S = 0.5f;   /* horizontal */
static const float CONTACT_RATE_RAD_S = 0.52f; /* 30 degrees a second: it turns freely */
static const float REPEATS_S = 0.05f;          /* a pose that has brought nothing new for so long may be frozen */
static const float RETRY_S = 0.3f;             /* after a stage that found the vehicle flying */
static const float UNLOAD_S = 0.5f;            /* the collective falls to UNLOADED */
static const float UNLOADED = 0.1f;            /* of the weight */
static const float GAINED_M_S = 0.35f;         /* downwards since UNLOAD began: it flies */
static const float SUPPORT_S = 1.0f;           /* support is averaged over so long (0.15 g in 550 flights of gusts), */
static const float SUPPORTED_M_S = 1.0f;       /* where it sinks slower than this: a fast fall's drag carries, too */
static const float LACKS_G = 0.3f;             /* of the weight: where less is missing, noise decides */
static const float FORCE_FILTER_S = 0.02f;     /* of the accelerometer, whose noise the tests must not see */
static const float FELT_GAINED_M_S = 0.7f;  /* the same by the accelerometer, whose noise of 10 m/s2 makes 0.3 of it */
static const float BLIND_GAINED_M_S = 0.5f; /* ... before anything has been hit, as each try makes the touch harder */
static const float SURE_GAINED_M_S = 1.5f;  /* ... and where only the height has a say: more than a bounce */
static const float SUNK_M = 0.1f;           /* lower by this, it still comes down */
static const float NO_LOWER_S = 2.0f;       /* so long without: the ground is there, whatever else is felt */
static const float FALLEN_M = 0.15f;        /* ... unless it then falls by this, unloaded: 0.4 m within 0.5 s */
static const float HIT_THRUST = 0.7f;       /* ... or is hit while it gives less than this share of the weight */
static const float IDLE_S = 0.3f;           /* of stillness, then the rotors stop */
static const float STILL_RATE_RAD_S = 0.5f; /* beyond, it moves */
static const float STILL_M_S = 0.5f;
static const float IMPACT_SIGMAS2 = 9.0f; /* three standard deviations of what vibration leaves of the filter */
static const uint8_t MOST_IMPACTS = 3u;   /* of a bounce */
static const float IMPACT_G = 0.4f;       /* above 1 g, in an emergency without vertical velocity */
/* Such a descent loses thrust with time, for ground effect must not keep it floating. Slowly: after 15 s (20 m) it is
   4 + 1 % short, and with 1.9 % of error still settles below 2.5 m/s, as inflow damps by 0.32/s; once late (below) up
   to 0.6 m/s faster, if the floor is that far down. */
static const float SINK_MORE_1_S = 0.0007f;
static const float SINK_MOST = 0.08f; /* never beyond this */
static const float LATE_S = 5.0f;     /* after the time in which 1 m/s leads to the height of the take-off, */
static const float LATE_1_S = 0.004f; /* ... it loses as much more: the wind takes a slow one far away */
static const float LATE_MOST = 0.02f;
static const float PROBE_S = 1.0f;         /* ... where UNLOAD is tried this often */
static const float TOUCHED_PROBE_S = 0.4f; /* ... once something has been hit */
static const float FALLS_AGAIN_S = 2.5f;   /* ... and not again for so long: it was an edge */
static const float AFTER_IMPACT = 0.8f;    /* of that thrust, so that ground effect does not keep it floating */
static const float INVERTED = 0.5f; /* cosine of the tilt beyond which a vehicle at rest lies on its side or back */
static const float INVERTED_REST_S = 0.3f;         /* it has lain like this, then the rotors stop */
static const float EMERGENCY_FEEDBACK_M_S2 = 3.0f; /* what vertical feedback may ask for, up or down */
/* A fall that only the accelerometer tells of, by the velocity reckoned from it: */
static const float FALL_M_S = 1.0f;        /* it counts beyond this, */
static const float FALL_DRIFT_M_S2 = 0.1f; /* more the longer the reckoning has gone on, */
static const float FALL_SIGMAS2 = 9.0f;    /* and by three standard deviations of what vibration adds up to, */
static const float FALL_KNOWN_S = 10.0f;   /* and no longer than this */

/* Without vertical velocity and accelerometer: roll torque to and fro. In the air the body turns as the torque says; on
   its feet, where something loads them, it does not. Ground effect (7 % at the feet) carries more than the descent
   lacks: the vehicle floats a hand above the floor. So it is pressed down now and then, and judged by what it answers
   once pressed: in the air that costs 0.7 m/s, which inflow takes back. */
static const float TEST_RAD_S2 =
    8.0f; /* of the torque, over the inertia: 12 still rocks a body that stands on little */
static const uint32_t TEST_HALF_US = 120000u;
static const float TEST_PERIOD_S = 0.24f;
static const float TEST_LEAK_S = 0.2f;      /* of the rate that the torque predicts: what is slower is no answer */
static const float TEST_ANSWER = 0.6f;      /* of what is predicted: less is the ground's doing */
static const float PRESS = 0.12f;           /* of the hover thrust, */
static const float PRESS_EVERY_S = 1.5f;    /* so long after the last time, */
static const float PRESS_SETTLE_S = 0.36f;  /* and judged after this: until then it falls, and bounces */
static const float PRESS_LESS_SINK = 0.01f; /* between: what they add to the descent, by a third */
static const float UNKNOWN_LAG_S = 0.025f;  /* of rotors whose lag nobody has learnt */

static float weight_n(const tc_controller* c) { return c->parameters.mass_kg * c->parameters.gravity_m_s2; }

static bool force_given(const tc_controller* c) {
    return (c->telemetry.estimate.valid & (uint8_t)TC_VALID_SPECIFIC_FORCE) != 0u;
}

static void enter_stage(tc_controller* c, tc_landing_stage stage) {
    c->landing.stage = (uint8_t)stage;
    c->landing.stage_us = c->telemetry.time_us;
    c->landing.airborne_us = c->telemetry.time_us;
}

void tc_landing_begin(tc_controller* c) {
    const tc_telemetry* t = &c->telemetry;
    memset(&c->landing, 0, sizeof c->landing);
    c->landing.began_us = t->time_us;
    c->landing.upright_us = t->time_us;
    c->landing.z_m = t->setpoint.position_world_m[2];
    c->landing.speed_m_s = -t->setpoint.velocity_world_m_s[2];
    c->landing.lowest_m = t->estimate.position_world_m[2];
    c->landing.sunk_us = t->time_us;
    c->landing.pressed_us = t->time_us;
    enter_stage(c, TC_LANDING_DESCEND);
}

/* The descent's speed changes gently to what is asked for, which grows with time. */
static void command_speed(tc_controller* c, float step_s) {
    tc_landing* landing = &c->landing;
    const float since_s = tc_seconds(c->telemetry.time_us - landing->began_us);
    const float asked = c->parameters.landing_m_s;
    const float* along = c->telemetry.setpoint.velocity_world_m_s;
    const bool braking = along[0] * along[0] + along[1] * along[1] > BRAKING_M_S * BRAKING_M_S;
    const float most = tc_max(asked, FASTEST_M_S);
    const float wanted = braking ? 0.0f : tc_min(asked + SPEED_UP_M_S2 * since_s, most);
    const float fall_m_s2 = landing->speed_m_s > most ? c->parameters.brake_m_s2 : 0.0f;
    const float change = tc_max(fall_m_s2, VERTICAL_BRAKE_M_S2) * step_s;
    landing->speed_m_s += tc_clamp(wanted - landing->speed_m_s, -change, change);
}

void tc_landing_setpoint(tc_controller* c, float step_s) {
    tc_landing* landing = &c->landing;
    tc_setpoint* setpoint = &c->telemetry.setpoint;
    const float lowest_m = c->telemetry.estimate.position_world_m[2] - LEAD_M;
    command_speed(c, step_s);
    landing->z_m -= landing->speed_m_s * step_s;
    landing->lead_limited = landing->z_m <= lowest_m + LEAD_NEAR_M;
    landing->z_m =
        tc_landing_unloads(landing) ? c->telemetry.estimate.position_world_m[2] : tc_max(landing->z_m, lowest_m);
    setpoint->position_world_m[2] = landing->z_m;
    setpoint->velocity_world_m_s[2] = -landing->speed_m_s;
    setpoint->acceleration_world_m_s2[2] = 0.0f;
    setpoint->jerk_world_m_s3[2] = 0.0f;
    setpoint->snap_world_m_s4[2] = 0.0f;
}

static bool only_turns(const tc_controller* c) {
    return c->mission.state == TC_EMERGENCY && !c->vertical_velocity && !force_given(c);
}

/* +1 or -1; `ago_us`: as it was then. */
static float test_sign(const tc_controller* c, uint32_t ago_us) {
    const uint64_t since_us = c->telemetry.time_us - c->landing.began_us;
    const uint64_t then_us = since_us > ago_us ? since_us - ago_us : 0u;
    return ((uint32_t)then_us / TEST_HALF_US) % 2u == 0u ? 1.0f : -1.0f;
}

float tc_landing_test_torque(const tc_controller* c) {
    return only_turns(c) ? test_sign(c, 0u) * TEST_RAD_S2 * c->parameters.inertia_kg_m2[0] : 0.0f;
}

/* The answer is a quarter of a period behind the torque. Whoever turns for another reason turns in no step with it. */
static void measure_answer(tc_controller* c, float step_s) {
    tc_landing* l = &c->landing;
    const tc_parameters* p = &c->parameters;
    const float lag_s = p->rotor_lag_s > 0.0f ? p->lead_filter_s : UNKNOWN_LAG_S;
    const float rate = c->telemetry.estimate.rate_body_rad_s[0], leak = step_s / (TEST_LEAK_S + step_s);
    const float sign = test_sign(c, TEST_HALF_US / 2u + (uint32_t)(1e6f * lag_s));
    l->rolling_n_m += step_s / (lag_s + step_s) * (c->telemetry.wrench.torque_n_m[0] - l->rolling_n_m);
    l->predicted_rad_s += step_s * l->rolling_n_m / p->inertia_kg_m2[0] - leak * l->predicted_rad_s;
    l->slow_rad_s += leak * (rate - l->slow_rad_s);
    l->expected_rad += step_s * sign * l->predicted_rad_s;
    l->found_rad += step_s * sign * (rate - l->slow_rad_s);
}

static void begin_period(tc_landing* l, bool pressing, bool silent) {
    l->pressing = pressing;
    l->silent = silent;
    l->expected_rad = 0.0f;
    l->found_rad = 0.0f;
}

/* Whether it has given no answer for two periods, pressed down. */
static bool stands_by_test(tc_controller* c, float step_s) {
    tc_landing* l = &c->landing;
    if (!only_turns(c)) {
        l->pressing = false;
        l->pressed_us = c->telemetry.time_us;
        return false;
    }
    measure_answer(c, step_s);
    if (!tc_lasts(c, l->pressed_us, l->pressing ? PRESS_SETTLE_S : PRESS_EVERY_S)) {
        begin_period(l, l->pressing, false);
        return false;
    }
    if (!l->pressing) {
        l->pressed_us = c->telemetry.time_us;
        begin_period(l, true, false);
        return false;
    }
    if (!tc_lasts(c, l->pressed_us, PRESS_SETTLE_S + (l->silent ? 2.0f : 1.0f) * TEST_PERIOD_S)) return false;
    const bool answers = l->found_rad >= TEST_ANSWER * l->expected_rad, stands = l->silent && !answers;
    if (answers) l->pressed_us = c->telemetry.time_us;
    begin_period(l, !answers, !answers);
    return stands;
}

/* Against a fall, and nothing upwards. */
static float brake_m_s2(const tc_controller* c, float fall_m_s) {
    return tc_clamp(c->parameters.kd_z_1_s * fall_m_s, 0.0f, EMERGENCY_FEEDBACK_M_S2);
}

/* Constant thrust at no air speed is constant rotor speed, so that inflow damps the sink; more against a fall. */
static float blind_thrust(const tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    const float reckoned_s = c->telemetry.reckoning_s;
    const float since_s = tc_seconds(c->telemetry.time_us - c->landing.began_us);
    const bool felt = force_given(c), touched = c->landing.touched == (uint8_t)TC_TOUCHED;
    const float pressed = felt ? 0.0f : (c->landing.pressing ? PRESS : 0.0f) - PRESS_LESS_SINK;
    const float late_s = since_s - LATE_S - tc_max(c->landing.z_m - c->ground_z_m, 0.0f);
    const float late = tc_clamp(LATE_1_S * late_s, 0.0f, LATE_MOST);
    const float share = p->emergency_sink - tc_min(SINK_MORE_1_S * since_s + late, SINK_MOST) - pressed;
    float fall_m_s = touched ? 0.0f : c->landing.gained_m_s;
    if (felt && reckoned_s < FALL_KNOWN_S) {
        const float noise2 = FALL_SIGMAS2 / 3.0f * c->monitor.shake_m2_s4 * tc_seconds(c->step_us) * reckoned_s;
        const float certain_m_s = FALL_M_S + FALL_DRIFT_M_S2 * reckoned_s + sqrtf(noise2);
        fall_m_s = tc_max(fall_m_s, -c->telemetry.estimate.velocity_world_m_s[2] - certain_m_s);
    }
    return (touched ? AFTER_IMPACT : 1.0f) * share * c->hover_thrust_n + p->mass_kg * brake_m_s2(c, fall_m_s);
}

float tc_emergency_thrust(const tc_controller* c) {
    const tc_parameters* p = &c->parameters;
    if (!c->vertical_velocity) return blind_thrust(c);
    const float off_m_s = -c->landing.speed_m_s - c->telemetry.estimate.velocity_world_m_s[2];
    const float feedback = tc_clamp(p->kd_z_1_s * off_m_s, -EMERGENCY_FEEDBACK_M_S2, EMERGENCY_FEEDBACK_M_S2);
    return (c->hover_thrust_n + p->mass_kg * feedback) / tc_max(c->axes[2][2], INVERTED);
}

/* The accelerometer shows more than the rotors can give in a descent: it has hit something. */
static bool has_impact(const tc_controller* c) {
    const float over = c->landing.force_m_s2 - (1.0f + IMPACT_G) * c->parameters.gravity_m_s2;
    const float noise2 = c->monitor.shake_m2_s4 * (0.5f / 3.0f) * tc_seconds(c->step_us) / FORCE_FILTER_S;
    return force_given(c) && over > 0.0f && over * over > IMPACT_SIGMAS2 * noise2;
}

static bool has_touched(const tc_landing* landing) { return landing->touched != (uint8_t)TC_UNTOUCHED; }

/* Bouncing without end: it has hit something again and again for longer than an edge would last. */
static bool bounces(tc_controller* c) {
    tc_landing* landing = &c->landing;
    const bool impact = has_impact(c);
    if (impact && !landing->impact && landing->impacts < MOST_IMPACTS) landing->impacts++;
    landing->impact = impact;
    if (impact) landing->impact_us = c->telemetry.time_us;
    if (impact && !c->vertical_velocity && tc_lasts(c, landing->began_us, RETRY_S)) {
        if (!has_touched(landing)) landing->touched_us = c->telemetry.time_us;
        landing->touched = TC_TOUCHED;
    }
    if (tc_lasts(c, landing->impact_us, FALLS_AGAIN_S)) {
        landing->touched = TC_UNTOUCHED;
        landing->impacts = 0;
    }
    return !c->vertical_velocity && impact && has_touched(landing) && landing->impacts >= MOST_IMPACTS &&
           tc_lasts(c, landing->touched_us, NO_LOWER_S);
}

/* Upward acceleration that the thrust asked for does not explain. Velocity adds up to its change, so that its noise and
   a bias average out. */
void tc_measure_support(tc_controller* c, float step_s) {
    const tc_telemetry* t = &c->telemetry;
    const float rise_m_s = t->estimate.velocity_world_m_s[2];
    const float thrust_m_s2 = t->wrench.thrust_n / c->parameters.mass_kg;
    const float given_m_s = rise_m_s - c->rise_m_s + step_s * (c->parameters.gravity_m_s2 - thrust_m_s2);
    const bool slow = c->vertical_velocity && tc_abs(rise_m_s) < SUPPORTED_M_S;
    c->rise_m_s = rise_m_s;
    c->support_m_s2 += ((slow ? given_m_s : 0.0f) - step_s * c->support_m_s2) / (SUPPORT_S + step_s);
}

bool tc_stands(const tc_controller* c) { return c->support_m_s2 > tc_stands_from(c); }

/* What slides along something has not landed on it, whatever a lying velocity says. In an emergency its speed may be
 * dead reckoned. */
static bool slides(const tc_controller* c) {
    return c->mission.state != TC_EMERGENCY && tc_monitor_speed2(c) > CONTACT_SPEED_M_S * CONTACT_SPEED_M_S;
}

/* A frozen pose seems to stand: nothing is said of the ground before the monitor has had its time to find that. */
static bool repeats(const tc_controller* c) {
    return c->monitor.running && tc_lasts(c, c->monitor.changed_us, REPEATS_S);
}

/* Whether the vehicle seems to be on something. */
static bool seems_in_contact(const tc_controller* c) {
    const tc_landing* landing = &c->landing;
    const tc_estimate* e = &c->telemetry.estimate;
    if (tc_norm(e->rate_body_rad_s) > CONTACT_RATE_RAD_S) return false;
    if (!c->vertical_velocity) {                            /* a dead reckoned one tells nothing */
        if (c->mission.state != TC_EMERGENCY) return false; /* a gap: what shakes the pose would lengthen it */
        const float probe_s = has_touched(landing) ? TOUCHED_PROBE_S : PROBE_S;
        return force_given(c) && (has_impact(c) || tc_lasts(c, landing->stage_us, probe_s));
    }
    const bool slow = tc_abs(e->velocity_world_m_s[2]) < 0.5f * landing->speed_m_s;
    if (c->mission.state == TC_EMERGENCY) return slow;
    return !slides(c) && !repeats(c) && (landing->lead_limited || slow);
}

static void begin_unload(tc_controller* c, bool sure) {
    tc_landing* landing = &c->landing;
    enter_stage(c, TC_LANDING_UNLOAD);
    landing->start_thrust_n = tc_min(c->telemetry.wrench.thrust_n, weight_n(c));
    landing->thrust_n = landing->start_thrust_n;
    landing->start_velocity_m_s = c->telemetry.estimate.velocity_world_m_s[2];
    landing->start_m = c->telemetry.estimate.position_world_m[2];
    landing->gained_m_s = 0.0f;
    landing->sure = sure;
}

/* Whether a descent that is commanded has for long brought it no lower. */
static bool comes_no_lower(tc_controller* c) {
    tc_landing* landing = &c->landing;
    const float z_m = c->telemetry.estimate.position_world_m[2];
    const bool known = c->vertical_velocity && !slides(c) && landing->speed_m_s >= 0.9f * c->parameters.landing_m_s;
    if (!known || z_m < landing->lowest_m - SUNK_M) {
        landing->lowest_m = z_m;
        landing->sunk_us = c->telemetry.time_us;
    }
    return tc_lasts(c, landing->sunk_us, NO_LOWER_S);
}

static void descend(tc_controller* c) {
    tc_landing* landing = &c->landing;
    const bool blind = !c->vertical_velocity;
    const bool settled = tc_lasts(c, landing->stage_us, RETRY_S);
    const bool stays = comes_no_lower(c);
    if (settled && !slides(c) && (stays || tc_stands(c))) {
        begin_unload(c, true);
        return;
    }
    if (!seems_in_contact(c) || !settled) {
        landing->airborne_us = c->telemetry.time_us;
    } else if (blind || tc_lasts(c, landing->airborne_us, CONTACT_S)) {
        begin_unload(c, false);
    } else {
        /* not for long enough yet */
    }
}

/* Whether the accelerometer shows that something carries the vehicle: more than half of what its rotors lack. */
static bool carried(const tc_controller* c) {
    const float rotors = c->landing.thrust_n / c->parameters.mass_kg, lacks = c->parameters.gravity_m_s2 - rotors;
    const bool shows = lacks > LACKS_G * c->parameters.gravity_m_s2;
    return shows && force_given(c) && c->landing.force_m_s2 - rotors > 0.5f * lacks;
}

/* Whether the vehicle falls as its thrust does. A height that sinks while something carries it drifts; where no
   accelerometer tells, what sinks no faster than before does not fall. */
static bool still_flies(const tc_controller* c) {
    const tc_landing* landing = &c->landing;
    const bool falls = force_given(c) && landing->gained_m_s > SURE_GAINED_M_S;
    const float steady_m_s = force_given(c) ? 0.0f : tc_min(landing->start_velocity_m_s, 0.0f);
    const float steady_m = steady_m_s * tc_seconds(c->telemetry.time_us - landing->stage_us);
    const bool sinks = landing->start_m + steady_m - c->telemetry.estimate.position_world_m[2] > FALLEN_M;
    if (landing->sure) return falls || (sinks && !carried(c));
    const float gained = landing->start_velocity_m_s - c->telemetry.estimate.velocity_world_m_s[2];
    if (c->vertical_velocity && gained > GAINED_M_S) return true;
    const float felt_m_s = c->vertical_velocity || has_touched(landing) ? FELT_GAINED_M_S : BLIND_GAINED_M_S;
    return force_given(c) && landing->gained_m_s > felt_m_s;
}

/* What has been touched was an edge. */
static void fly_on(tc_controller* c) {
    if (has_touched(&c->landing)) c->landing.touched = TC_FALLS_OFF;
    enter_stage(c, TC_LANDING_DESCEND);
}

/* One step of UNLOAD; whether the touchdown is certain already. */
static bool unload(tc_controller* c, float step_s) {
    tc_landing* landing = &c->landing;
    const float weight = weight_n(c);
    const float fall = (1.0f - UNLOADED) * weight / UNLOAD_S * step_s;
    landing->thrust_n = tc_max(landing->thrust_n - fall, tc_min(landing->start_thrust_n, UNLOADED * weight));
    if (landing->sure && landing->impact && landing->thrust_n < HIT_THRUST * weight) return true;
    if (still_flies(c)) {
        fly_on(c);
    } else if (tc_lasts(c, landing->stage_us, UNLOAD_S)) {
        if (landing->sure) return true;
        enter_stage(c, carried(c) || !force_given(c) ? TC_LANDING_IDLE : TC_LANDING_DESCEND);
    } else {
        /* goes on */
    }
    return false;
}

/* Whether the touchdown is certain. */
static bool idle(tc_controller* c) {
    const bool still = tc_norm(c->telemetry.estimate.rate_body_rad_s) < STILL_RATE_RAD_S;
    if (still_flies(c)) {
        fly_on(c);
    } else if (comes_no_lower(c)) {
        return true;
    } else if (!still) {
        c->landing.stage_us = c->telemetry.time_us;
    } else {
        return tc_lasts(c, c->landing.stage_us, IDLE_S);
    }
    return false;
}

bool tc_moves(const tc_controller* c) {
    const tc_estimate* e = &c->telemetry.estimate;
    return tc_norm(e->rate_body_rad_s) > STILL_RATE_RAD_S || tc_norm(e->velocity_world_m_s) > STILL_M_S;
}

/* A vehicle that lies on its side or back and does not move is down, too. */
static bool rests_inverted(tc_controller* c) {
    if (c->axes[2][2] > INVERTED || tc_moves(c)) c->landing.upright_us = c->telemetry.time_us;
    return tc_lasts(c, c->landing.upright_us, INVERTED_REST_S);
}

bool tc_landing_observe(tc_controller* c, float step_s) {
    tc_landing* landing = &c->landing;
    const float force = c->telemetry.estimate.specific_force_body_m_s2[2];
    landing->force_m_s2 += step_s / (FORCE_FILTER_S + step_s) * (force - landing->force_m_s2);
    if (c->mission.state == TC_EMERGENCY) command_speed(c, step_s);
    if (!tc_landing_unloads(landing)) {
        landing->gained_m_s -= step_s * brake_m_s2(c, landing->gained_m_s); /* given back */
    } else if (force_given(c)) {
        landing->gained_m_s +=
            step_s * (c->parameters.gravity_m_s2 - c->telemetry.estimate.specific_force_body_m_s2[2]);
    }
    if (only_turns(c) && tc_landing_unloads(landing)) enter_stage(c, TC_LANDING_DESCEND); /* nothing to judge it by */
    if (rests_inverted(c) || bounces(c) || stands_by_test(c, step_s)) return true;
    switch (landing->stage) {
        case TC_LANDING_DESCEND:
            descend(c);
            break;
        case TC_LANDING_UNLOAD:
            return unload(c, step_s);
        case TC_LANDING_IDLE:
            return idle(c);
        default:
            break;
    }
    return false;
}
