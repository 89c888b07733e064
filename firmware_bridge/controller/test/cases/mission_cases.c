/* Every transition that the controller makes by itself, and every guard of an order. */
#include <math.h>
#include <string.h>

#include "cases.h"
#include "goshawk_controller/goshawk_controller.h"

static const trouble none = {0};

void short_plan(tc_trajectory* plan, uint8_t link_loss_policy) {
    static const float step[8] = {0.5f, 1.09375f, 0.0f, -1.09375f, 0.0f, 0.65625f, 0.0f, -0.15625f};
    memset(plan, 0, sizeof *plan);
    plan->header.id = 5;
    plan->header.segment_count = 2;
    plan->header.coefficient_count = 8;
    plan->header.link_loss_policy = link_loss_policy;
    for (unsigned i = 0; i < 2u; i++) {
        plan->segment[i].duration_us = 1500000u;
        for (unsigned k = 0; k < 8u; k++) plan->segment[i].coefficient[2][k] = i == 0u ? step[k] : -step[k];
        plan->segment[i].coefficient[2][0] = 1.5f;
    }
    plan->header.crc32 = tc_trajectory_crc32(plan);
}

static tc_reason upload(tc_controller* c, const tc_trajectory* plan) {
    tc_reason reason = tc_upload_begin(c, &plan->header);
    for (uint16_t i = 0; i < 2u && reason == TC_OK; i++) reason = tc_upload_segment(c, i, &plan->segment[i]);
    if (reason == TC_OK) reason = TC_BUSY;
    while (reason == TC_BUSY) reason = tc_upload_finish(c);
    return reason == TC_OK ? tc_upload_activate(c, plan->header.id, plan->header.crc32) : reason;
}

uint8_t run(tc_controller* c, uint64_t* time_us, float seconds, const trouble* t) {
    const unsigned ticks = (unsigned)(seconds * 100.0f);
    tc_output output;
    for (unsigned i = 0; i < ticks; i++) {
        const bool up = tc_mission_in_air(c->mission.state);
        tc_estimate e;
        memset(&e, 0, sizeof e);
        *time_us += 10000u;
        e.position_time_us = t->no_position ? 1u : *time_us;
        e.attitude_time_us = t->no_attitude ? 1u : *time_us;
        e.rate_time_us = t->no_gyro ? 1u : *time_us;
        e.valid = TC_VALID_POSE;
        e.q_world_body[0] = 1.0f;
        if (up) memcpy(e.position_world_m, c->telemetry.setpoint.position_world_m, sizeof e.position_world_m);
        if (up && c->mission.state != TC_EMERGENCY)
            memcpy(e.q_world_body, c->telemetry.flatness.q_reference, sizeof(float[4]));
        if (up) e.velocity_world_m_s[2] = c->telemetry.setpoint.velocity_world_m_s[2];
        if (e.position_world_m[2] < t->floor_m) {
            e.position_world_m[2] = t->floor_m;
            e.velocity_world_m_s[2] = 0.0f;
        }
        e.velocity_world_m_s[0] = t->drift_m_s;
        e.position_world_m[0] += t->offset_m;
        if (t->bad_position) e.position_world_m[1] = 1e30f;
        if (t->tilt > 0.0f) {
            e.q_world_body[0] = 0.0f;
            e.q_world_body[1] = 1.0f;
            e.q_world_body[2] = e.q_world_body[3] = 0.0f;
        }
        (void)tc_tick(c, *time_us, &e, &output);
    }
    return c->mission.state;
}

void set_out(tc_controller* c, uint64_t* time_us, uint8_t link_loss_policy, uint8_t state) {
    static tc_trajectory plan;
    tc_parameters parameters;
    *time_us = 1000000u;
    tc_init(c);
    tc_parameters_default(&parameters);
    parameters.monitor = 0.0f; /* this body is too simple to have an IMU */
    must(tc_parameters_set(c, &parameters) == TC_OK, "presets are accepted");
    short_plan(&plan, link_loss_policy);
    must(upload(c, &plan) == TC_OK, "the short plan passes");
    (void)run(c, time_us, 0.1f, &none);
    if (state >= TC_ARMED) must(tc_do(c, TC_COMMAND_ARM, 0.0f) == TC_OK, "arms");
    if (state >= TC_TAKE_OFF) must(tc_do(c, TC_COMMAND_TAKE_OFF, 1.0f) == TC_OK, "takes off");
    if (state == TC_TAKE_OFF) (void)run(c, time_us, 0.3f, &none);
    if (state >= TC_HOLD) must(run(c, time_us, 6.0f, &none) == TC_HOLD, "hovers");
    if (state >= TC_TRAJECTORY) {
        must(tc_do(c, TC_COMMAND_START, 0.0f) == TC_OK, "starts");
        for (unsigned i = 0; i < 500u && c->mission.state != TC_TRAJECTORY; i++) (void)run(c, time_us, 0.01f, &none);
        must(run(c, time_us, 0.5f, &none) == TC_TRAJECTORY, "flies");
    }
}

/* Names are kept apart from the rest of the table, in the order of the struct. */
static void parameter_table(void) {
#define STANDS_AT(name, field) \
    must(tc_parameters_find(name) == (int32_t)(offsetof(tc_parameters, field) / sizeof(float)), name)
    STANDS_AT("mass_kg", mass_kg);
    STANDS_AT("inertia_zz", inertia_kg_m2[2]);
    STANDS_AT("rotor3_gain", rotor_gain[3]);
    STANDS_AT("cq_n_m_s2", cq_n_m_s2);
    STANDS_AT("drag_norm_z_kg_m", parasitic_norm_kg_m[2]);
    STANDS_AT("battery_ref_v", battery_reference_v);
    STANDS_AT("kp_z_1_s2", kp_z_1_s2);
    STANDS_AT("predict_extra_s", predict_extra_s);
    STANDS_AT("fence_max_z_m", fence_max_world_m[2]);
    STANDS_AT("emergency_s", emergency_s);
#undef STANDS_AT
    float smallest = 0.0f, largest = 0.0f, preset = 0.0f;
    for (uint16_t i = 0; i < tc_parameters_count(); i++) {
        const char* name = tc_parameters_name(i);
        must(tc_parameters_find(name) == (int32_t)i, "found by its name");
        must(strlen(name) < TC_PARAMETER_NAME_SIZE, "which fits");
        must(tc_parameters_range(i, &smallest, &largest, &preset), "has a range");
        must(smallest < largest && smallest <= preset && preset <= largest, "in which its preset lies");
    }
    must(tc_parameters_name(tc_parameters_count())[0] == '\0', "no name beyond the table");
    must(tc_parameters_name(UINT16_MAX)[0] == '\0', "nor far beyond it");
    must(!tc_parameters_in_flight(tc_parameters_count()), "which cannot change");
    must(!tc_parameters_range(tc_parameters_count(), &smallest, &largest, &preset), "and has no range");
    must(tc_parameters_find("nonsense") == -1, "nor is anything else found");
}

static void guards(void) {
    static tc_controller c;
    static tc_trajectory plan;
    uint64_t now = 1000000u;
    short_plan(&plan, 0);
    tc_init(&c);
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_NOT_CONFIGURED, "not configured");
    must(tc_upload_begin(&c, &plan.header) == TC_NOT_CONFIGURED, "not configured");
    must(tc_do(&c, TC_COMMAND_START, 0.0f) == TC_NO_TRAJECTORY, "no trajectory");
    must(tc_do(&c, TC_COMMAND_COUNT, 0.0f) == TC_OUT_OF_RANGE, "no such command");
    tc_parameters parameters;
    tc_parameters_default(&parameters);
    parameters.monitor = 0.0f;
    parameters.mass_kg = 40.0f;
    must(tc_parameters_set(&c, &parameters) == TC_CANNOT_HOVER && !c.configured, "too heavy, never configured");
    parameters.mass_kg = 0.7f;
    must(tc_parameters_set(&c, &parameters) == TC_OK, "accepted");
    parameters.mass_kg = 40.0f;
    must(tc_parameters_set(&c, &parameters) == TC_CANNOT_HOVER && c.configured, "too heavy, the old ones stay");
    parameters.mass_kg = 0.7f;
    parameters.ki_xy_1_s3 = 1.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.has_integral, "integrates sideways");
    parameters.ki_xy_1_s3 = 0.0f;
    parameters.ki_z_1_s3 = 1.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.has_integral, "integrates upwards");
    parameters.ki_z_1_s3 = 0.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && !c.has_integral, "does not integrate");
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_ATTITUDE_STALE, "before the first tick");
    (void)run(&c, &now, 0.1f, &(trouble){.tilt = 1.0f});
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_TILT_ERROR, "on its back");
    (void)run(&c, &now, 0.1f, &(trouble){.bad_position = true});
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_ESTIMATE_STALE, "without position");
    (void)run(&c, &now, 2.0f, &(trouble){.no_attitude = true});
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_ATTITUDE_STALE, "without attitude");
    (void)run(&c, &now, 0.1f, &(trouble){.offset_m = 5000.0f});
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_FENCE_BREACH, "outside the fence");
    (void)run(&c, &now, 0.1f, &none);
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_OK && tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_OK, "arms, and again");
    must(tc_do(&c, TC_COMMAND_TAKE_OFF, 0.01f) == TC_OUT_OF_RANGE, "too low");
    must(tc_do(&c, TC_COMMAND_TAKE_OFF, 60.0f) == TC_OUT_OF_RANGE, "too high");
    must(tc_do(&c, TC_COMMAND_TIME_SCALE, 0.05f) == TC_OUT_OF_RANGE, "too slow");
    must(tc_do(&c, TC_COMMAND_TIME_SCALE, 1.5f) == TC_OUT_OF_RANGE, "too fast");
    parameters.mass_kg = 0.7f;
    parameters.fence_max_world_m[2] = 5.0f;
    must(tc_do(&c, TC_COMMAND_DISARM, 0.0f) == TC_OK && tc_parameters_set(&c, &parameters) == TC_OK, "a lower fence");
    must(tc_do(&c, TC_COMMAND_ARM, 0.0f) == TC_OK, "arms");
    must(tc_do(&c, TC_COMMAND_TAKE_OFF, 10.0f) == TC_FENCE_BREACH, "out of the top");
    (void)run(&c, &now, 0.1f, &(trouble){.bad_position = true});
    must(tc_do(&c, TC_COMMAND_TAKE_OFF, 1.0f) == TC_ESTIMATE_STALE, "without position");
    parameters.gravity_m_s2 = NAN;
    must(tc_parameters_set(&c, &parameters) == TC_NOT_FINITE, "no number");
    parameters.gravity_m_s2 = 9.81f;
    must(tc_parameters_set(&c, &parameters) == TC_ONLY_WHEN_DISARMED, "not while armed");
}

/* The filter of the rotors' speeds goes on when its parameters change in flight, and starts anew when it was off. */
static void filter_in_flight(void) {
    static tc_controller c;
    uint64_t now;
    set_out(&c, &now, 0, TC_HOLD);
    tc_parameters parameters = *tc_parameters_now(&c);
    parameters.rotor_lag_s = 0.02f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && run(&c, &now, 0.1f, &none) == TC_HOLD, "on");
    parameters.rotor_lag_s = 0.03f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.was_flying, "goes on");
    parameters.rotor_lag_s = 0.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && !c.was_flying, "off");
}

/* What is in its way is not the ground until the vehicle stands on it. */
static void landing_on_something(void) {
    static tc_controller c;
    uint64_t now;
    set_out(&c, &now, 0, TC_HOLD);
    must(tc_do(&c, TC_COMMAND_LAND, 0.0f) == TC_OK, "lands");
    const trouble sliding = {.floor_m = 0.7f, .drift_m_s = 0.8f}, standing = {.floor_m = 0.7f};
    must(run(&c, &now, 20.0f, &sliding) == TC_LANDING, "slides along it");
    must(run(&c, &now, 1.0f, &standing) == TC_DISARMED, "stands");
}

static void on_the_path(void) {
    static tc_controller c;
    static tc_trajectory plan;
    uint64_t now;
    set_out(&c, &now, 1, TC_HOLD);
    short_plan(&plan, 2);
    must(tc_do(&c, TC_COMMAND_START, 0.0f) == TC_OK && c.mission.state == TC_APPROACH, "approaches");
    must(upload(&c, &plan) == TC_SLOT_IN_USE, "not on the way to it");
    set_out(&c, &now, 1, TC_TRAJECTORY);
    short_plan(&plan, 2); /* another plan: same id, another policy, so another CRC */
    must(upload(&c, &plan) == TC_SLOT_IN_USE, "not under way");
    short_plan(&plan, 1);
    must(tc_upload_activate(&c, plan.header.id, plan.header.crc32) == TC_OK, "what is flown is active already");
    must(tc_do(&c, TC_COMMAND_START, 0.0f) == TC_WRONG_STATE, "flies already");
    must(tc_do(&c, TC_COMMAND_PAUSE, 0.0f) == TC_OK && run(&c, &now, 3.0f, &none) == TC_PAUSED, "pauses");
    must(tc_do(&c, TC_COMMAND_TIME_SCALE, 0.5f) == TC_OK, "slower from now on");
    must(tc_do(&c, TC_COMMAND_RESUME, 0.0f) == TC_OK && run(&c, &now, 1.0f, &none) == TC_TRAJECTORY, "goes on");
    must(tc_do(&c, TC_COMMAND_TIME_SCALE, 1.0f) == TC_OK, "faster again");
    must(tc_do(&c, TC_COMMAND_PAUSE, 0.0f) == TC_OK && tc_do(&c, TC_COMMAND_HOLD, 0.0f) == TC_OK, "braking: hold");
    must(run(&c, &now, 3.0f, &none) == TC_HOLD, "stands");
    must(run(&c, &now, 0.1f, &(trouble){.offset_m = 3.0f}) == TC_HOLD, "far away");
    must(tc_do(&c, TC_COMMAND_START, 0.0f) == TC_START_TOO_FAR, "too far");
    set_out(&c, &now, 1, TC_TRAJECTORY);
    must(run(&c, &now, 10.0f, &none) == TC_HOLD, "to its end");
    set_out(&c, &now, 1, TC_TRAJECTORY);
    must(tc_do(&c, TC_COMMAND_LAND, 0.0f) == TC_OK && run(&c, &now, 20.0f, &none) == TC_DISARMED, "brakes and lands");
}

/* State to begin in, what goes wrong for how long, state to end in. */
static void misfortunes(void) {
    static const struct {
        uint8_t from;
        trouble t;
        float seconds;
        uint8_t to;
    } list[] = {
        {TC_TAKE_OFF, {.tilt = 1.0f}, 2.0f, TC_FAULT},
        {TC_HOLD, {.tilt = 1.0f}, 0.35f, TC_EMERGENCY},
        {TC_HOLD, {.tilt = 1.0f}, 3.0f, TC_DISARMED},
        {TC_HOLD, {.no_gyro = true}, 0.5f, TC_FAULT},
        {TC_HOLD, {.no_attitude = true}, 0.5f, TC_EMERGENCY},
        {TC_HOLD, {.no_attitude = true, .no_position = true}, 6.0f, TC_DISARMED}, /* nor here */
        {TC_HOLD, {.no_position = true}, 1.0f, TC_HOLD},
        {TC_HOLD, {.no_position = true}, 3.0f, TC_EMERGENCY},
        {TC_HOLD, {.bad_position = true}, 3.0f, TC_EMERGENCY},
        {TC_HOLD, {.no_position = true}, 60.0f, TC_DISARMED}, /* no torque turns this body */
        {TC_HOLD, {.offset_m = 5000.0f}, 0.5f, TC_EMERGENCY},
        {TC_HOLD, {.offset_m = -5000.0f}, 0.5f, TC_EMERGENCY},
        {TC_TRAJECTORY, {.offset_m = 5000.0f}, 0.2f, TC_ABORTING},
        {TC_ARMED, {.no_attitude = true}, 2.0f, TC_DISARMED},
    };
    static tc_controller c;
    for (unsigned i = 0; i < sizeof list / sizeof list[0]; i++) {
        uint64_t now;
        set_out(&c, &now, 1, list[i].from);
        must(run(&c, &now, list[i].seconds, &list[i].t) == list[i].to, "a misfortune ends as the table says");
    }
    uint64_t now;
    set_out(&c, &now, 1, TC_HOLD);
    must(run(&c, &now, 2.5f, &(trouble){.no_position = true}) == TC_EMERGENCY, "position lost");
    must(run(&c, &now, 0.1f, &none) == TC_EMERGENCY, "back, but too early to trust");
    must(run(&c, &now, 0.03f, &(trouble){.bad_position = true}) == TC_EMERGENCY, "there, but no numbers");
    must(run(&c, &now, 0.1f, &(trouble){.no_position = true}) == TC_EMERGENCY, "lost again");
    must(run(&c, &now, 0.25f, &(trouble){.tilt = 1.0f}) == TC_EMERGENCY, "back, but far from level");
    must(run(&c, &now, 0.1f, &none) == TC_LANDING, "back: lands");
}

/* The operator falls silent: what each policy does, in the states where it matters. */
static void silence(void) {
    static const struct {
        uint8_t policy, from;
        float seconds;
        uint8_t to;
    } list[] = {
        {0, TC_TRAJECTORY, 2.3f, TC_TRAJECTORY}, {1, TC_TRAJECTORY, 2.4f, TC_STOPPING},
        {2, TC_TRAJECTORY, 2.4f, TC_ABORTING},   {1, TC_HOLD, 3.0f, TC_HOLD},
        {1, TC_HOLD, 120.0f, TC_DISARMED},       {1, TC_ARMED, 10.0f, TC_DISARMED},
    };
    static tc_controller c;
    for (unsigned i = 0; i < sizeof list / sizeof list[0]; i++) {
        uint64_t now;
        set_out(&c, &now, list[i].policy, list[i].from);
        tc_ground_alive(&c, 0u);
        const bool stays = list[i].from == list[i].to;
        for (float s = 0.0f; s < list[i].seconds && (stays || c.mission.state != list[i].to); s += 0.1f) {
            (void)run(&c, &now, 0.1f, &none);
        }
        must(c.mission.state == list[i].to, "a silent ground ends as was agreed");
    }
    uint64_t now; /* paused for long without anybody: lands */
    set_out(&c, &now, 0, TC_TRAJECTORY);
    must(tc_do(&c, TC_COMMAND_PAUSE, 0.0f) == TC_OK && run(&c, &now, 3.0f, &none) == TC_PAUSED, "pauses");
    tc_ground_alive(&c, 0u);
    must(run(&c, &now, 120.0f, &none) == TC_DISARMED, "and lands in the end");
}

/* What the parameters do not need is not done; changing them in the air starts and ends it without a jump. */
static void needs(void) {
    static tc_controller c;
    uint64_t time_us = 0;
    set_out(&c, &time_us, TC_LINK_LOSS_FINISH, TC_HOLD);
    must(!c.has_lead && !c.has_integral && !c.was_flying, "the preset vehicle needs neither lead nor integrator");
    must(tc_store_active(&c.store) != NULL, "a plan is active");
    tc_parameters parameters = *tc_parameters_now(&c);
    parameters.rotor_lag_s = 0.03f;
    parameters.ki_z_1_s3 = 1.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.has_lead && c.has_integral, "lag and one gain");
    (void)run(&c, &time_us, 0.5f, &none);
    must(c.was_flying, "the filter runs");
    parameters.ki_xy_1_s3 = 1.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.was_flying, "and runs on");
    parameters.rotor_lag_s = 0.0f;
    parameters.battery_gain_1_v = 0.02f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.has_lead, "battery");
    parameters.battery_gain_1_v = 0.0f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && !c.has_lead && !c.was_flying, "no more");
    parameters.flapping_kg_m = 1e-6f;
    must(tc_parameters_set(&c, &parameters) == TC_OK && c.has_moments && c.has_lead, "moments");
    must(run(&c, &time_us, 0.5f, &none) == TC_HOLD, "still there");
}

void mission_cases(void) {
    parameter_table();
    landing_on_something();
    filter_in_flight();
    guards();
    on_the_path();
    misfortunes();
    silence();
    needs();
}
