/* The flight: orders and faults on their time line, one tick after the other. */
#include "body_flight.h"

#include <math.h>
#include <string.h>

#include "body_lies.h"
#include "body_pilot.h"

#define NEVER (-1.0) /* a state that has not been entered */
#define SETTLE_S 0.3 /* standing before the first tick, longer on a floor that rings */
#define LINK_S 0.1
#define LOGGED_LIMIT 0.99f       /* above, what a low-pass has left of a limit is no reaction */
#define FIRST_CLOCK_US 20000000u /* the controller has not booted this moment */

typedef struct {
    const body_scenario* scenario;
    body_result* result;
    tc_controller controller;
    body b;
    body_sensors sensors;
    body_random random;
    tc_estimate estimate;
    tc_output output;
    tc_reason tick_reason;
    double time_s; /* true, since the first tick */
    double entered_s[TC_MISSION_STATE_COUNT];
    bool fault_on[BODY_MOST_FAULTS], fault_over[BODY_MOST_FAULTS], order_done[BODY_MOST_ORDERS];
    double clock_offset_s, clock_jitter_s, link_s;
    uint64_t clock_us; /* as read last */
    bool clock_stuck, link_lost, hanging, flying;
    const body_fault* carried; /* a hand moves it */
    double command_rad_s[BODY_ROTORS];
    uint8_t state;
} flight;

void body_scenario_default(body_scenario* s) {
    memset(s, 0, sizeof *s);
    s->seed = 1;
    s->tick_s = 0.002;
    s->limit_s = 60.0;
    s->has_link = 1;
    body_vehicle_default(&s->vehicle);
    body_sensors_default(&s->sensors);
    s->world.bump_length_m = 1.0;
    s->world.gust_time_s = 1.0;
}

/* True time at which something is due, or NEVER. */
static double due_s(const flight* f, int32_t from_state, double after_s) {
    if (from_state == BODY_FROM_START) return after_s;
    if (from_state < 0 || from_state >= TC_MISSION_STATE_COUNT || f->entered_s[from_state] < 0.0) return NEVER;
    return f->entered_s[from_state] + after_s;
}

static tc_reason set_parameter(flight* f, double index, double value) {
    tc_parameters next = *tc_parameters_now(&f->controller);
    const tc_reason reason = tc_parameters_put(&next, (uint16_t)index, (float)value);
    return reason != TC_OK ? reason : tc_parameters_set(&f->controller, &next);
}

/* Which losses hold now: faults may overlap. */
static void lose(flight* f) {
    body_sensors* s = &f->sensors;
    s->position = s->attitude = s->rate = BODY_GOOD;
    for (int i = 0; i < f->scenario->fault_count; i++) {
        const body_fault* fault = &f->scenario->fault[i];
        if (!f->fault_on[i] || f->fault_over[i]) continue;
        const body_loss loss = (body_loss)(int)fault->value[0];
        if (fault->kind == BODY_POSITION_LOST || fault->kind == BODY_ALL_LOST) s->position = loss;
        if (fault->kind == BODY_ATTITUDE_LOST || fault->kind == BODY_ALL_LOST) s->attitude = loss;
        if (fault->kind == BODY_ALL_LOST) s->rate = loss;
    }
}

static void begin_fault(flight* f, int i) {
    const body_fault* fault = &f->scenario->fault[i];
    const double* value = fault->value;
    body_sensors* s = &f->sensors;
    f->fault_on[i] = true;
    f->result->fault_s[i] = fmax(f->time_s, 1e-9);
    switch ((body_fault_kind)fault->kind) {
        case BODY_POSITION_LOST:
        case BODY_ATTITUDE_LOST:
        case BODY_ALL_LOST:
            lose(f);
            break;
        case BODY_JUMP:
            body_sensors_jump(s, &f->b, value, value[3], 0u);
            break;
        case BODY_RELOCALIZED:
            body_sensors_jump(s, &f->b, value, value[3], 1u);
            break;
        case BODY_RESET_MISSED:
            body_sensors_jump(s, &f->b, value, value[3], 2u);
            break;
        case BODY_DRIFT:
            memcpy(s->drift_m_s, value, sizeof s->drift_m_s);
            break;
        case BODY_LARGE_STD:
            s->config.position_std_m = value[0];
            s->config.velocity_std_m_s = value[1];
            break;
        case BODY_CLOCK_STEP:
            f->clock_offset_s += value[0];
            break;
        case BODY_CLOCK_JITTER:
            f->clock_jitter_s = value[0];
            break;
        case BODY_CLOCK_STUCK:
            f->clock_stuck = true;
            break;
        case BODY_STAMP_OFFSET:
            s->pose_stamp_offset_s = value[0];
            break;
        case BODY_ROTOR_HEALTH:
            f->b.health[(int)value[0] & 3] = value[1];
            break;
        case BODY_LINK_LOST:
            f->link_lost = true;
            break;
        case BODY_BATTERY:
            s->config.battery_v = value[0];
            break;
        case BODY_PARAMETER:
            f->result->fault_reason[i] = (int32_t)set_parameter(f, value[0], value[1]);
            break;
        case BODY_FLOOR:
            f->b.world.floor_m = fmin(value[0], f->b.world.floor_m + fmax(body_clearance_m(&f->b), 0.0));
            break;
        case BODY_NO_SPECIFIC_FORCE:
            s->config.has_specific_force = 0;
            break;
        case BODY_NO_VERTICAL_VELOCITY:
            s->config.has_vertical_velocity = 0;
            break;
        case BODY_KICK:
            for (int k = 0; k < 3; k++) f->b.velocity_m_s[k] += value[k];
            f->b.rate_rad_s[0] += value[3];
            break;
        case BODY_BLOCKED:
            f->b.blocked = true;
            memcpy(f->b.block_m, f->b.position_m, sizeof f->b.block_m);
            break;
        case BODY_HANG:
            f->hanging = true;
            break;
        case BODY_VELOCITY_BIAS:
            s->config.vertical_bias_m_s = value[0];
            break;
        case BODY_POSE_AGE:
        case BODY_HEADING_JUMP:
        case BODY_GYRO_AXIS:
        case BODY_ROTOR_SPEED:
        case BODY_STUCK:
        case BODY_VIBRATION:
        case BODY_SPEED_WRONG:
            body_lie(s, fault);
            break;
        case BODY_CARRIED:
            f->carried = fault;
            break;
        case BODY_GUST:
        case BODY_FAULT_COUNT:
            break;
    }
}

/* Back to what the scenario began with. Jumps and clock steps stay. */
static void end_fault(flight* f, int i) {
    const body_fault* fault = &f->scenario->fault[i];
    const body_sensors_config* normal = &f->scenario->sensors;
    body_sensors* s = &f->sensors;
    f->fault_over[i] = true;
    switch ((body_fault_kind)fault->kind) {
        case BODY_POSITION_LOST:
        case BODY_ATTITUDE_LOST:
        case BODY_ALL_LOST:
            lose(f);
            break;
        case BODY_DRIFT:
            memset(s->drift_m_s, 0, sizeof s->drift_m_s);
            break;
        case BODY_LARGE_STD:
            s->config.position_std_m = normal->position_std_m;
            s->config.velocity_std_m_s = normal->velocity_std_m_s;
            break;
        case BODY_CLOCK_JITTER:
            f->clock_jitter_s = 0.0;
            break;
        case BODY_CLOCK_STUCK:
            f->clock_stuck = false;
            break;
        case BODY_STAMP_OFFSET:
            s->pose_stamp_offset_s = 0.0;
            break;
        case BODY_ROTOR_HEALTH:
            f->b.health[(int)fault->value[0] & 3] = 1.0;
            break;
        case BODY_GUST:
            memset(f->b.gust_m_s, 0, sizeof f->b.gust_m_s);
            break;
        case BODY_LINK_LOST:
            f->link_lost = false;
            break;
        case BODY_BATTERY:
            s->config.battery_v = normal->battery_v;
            break;
        case BODY_FLOOR:
            f->b.world.floor_m = f->scenario->world.floor_m;
            break;
        case BODY_NO_SPECIFIC_FORCE:
            s->config.has_specific_force = normal->has_specific_force;
            break;
        case BODY_NO_VERTICAL_VELOCITY:
            s->config.has_vertical_velocity = normal->has_vertical_velocity;
            break;
        case BODY_BLOCKED:
            f->b.blocked = false;
            break;
        case BODY_HANG:
            f->hanging = false;
            break;
        case BODY_VELOCITY_BIAS:
            s->config.vertical_bias_m_s = normal->vertical_bias_m_s;
            break;
        case BODY_CARRIED:
            f->carried = NULL;
            break;
        default:
            body_lie_ends(s, normal, fault->kind);
            break;
    }
}

static void run_faults(flight* f) {
    for (int i = 0; i < f->scenario->fault_count; i++) {
        const body_fault* fault = &f->scenario->fault[i];
        const double start_s = due_s(f, fault->from_state, fault->after_s);
        if (start_s < 0.0 || f->time_s < start_s || f->fault_over[i]) continue;
        if (!f->fault_on[i]) begin_fault(f, i);
        const double into_s = f->time_s - start_s;
        if (fault->kind == BODY_GUST) {
            const double part = 0.5 - 0.5 * cos(6.283185307179586 * into_s / fault->duration_s);
            for (int k = 0; k < 3; k++) f->b.gust_m_s[k] = part * fault->value[k];
        }
        if (fault->duration_s > 0.0 && into_s >= fault->duration_s) end_fault(f, i);
    }
}

static tc_reason give(flight* f, const body_order* order) {
    float speed[TC_ROTORS];
    for (int i = 0; i < TC_ROTORS; i++) speed[i] = (float)f->b.rotor_rad_s[i];
    switch (order->command) {
        case BODY_SHADOW:
            return tc_shadow(&f->controller);
        case BODY_ENGAGE:
            return tc_engage(&f->controller, speed);
        case BODY_RELEASE:
            return tc_release(&f->controller);
        default:
            return tc_do(&f->controller, (tc_command)order->command, (float)order->value);
    }
}

static void run_orders(flight* f) {
    for (int i = 0; i < f->scenario->order_count; i++) {
        const body_order* order = &f->scenario->order[i];
        const double at_s = due_s(f, order->from_state, order->after_s);
        if (f->order_done[i] || at_s < 0.0 || f->time_s < at_s) continue;
        f->order_done[i] = true;
        f->result->order_reason[i] = (int32_t)give(f, order);
        f->result->order_s[i] = f->time_s;
    }
}

static void read_clock(flight* f) {
    if (f->clock_stuck) return;
    const double jitter_s = f->clock_jitter_s > 0.0 ? f->clock_jitter_s * (2.0 * body_uniform(&f->random) - 1.0) : 0.0;
    f->clock_us = FIRST_CLOCK_US + (uint64_t)(int64_t)llround(1e6 * (f->time_s + f->clock_offset_s + jitter_s));
}

static void note_changes(flight* f) {
    body_result* r = f->result;
    const tc_telemetry* t = tc_telemetry_now(&f->controller);
    if (t->state != f->state && r->change_count < BODY_MOST_CHANGES) {
        body_change* change = &r->change[r->change_count++];
        change->time_s = f->time_s;
        change->from = f->state;
        change->to = t->state;
        change->reason = t->reason;
    }
    f->state = t->state;
    if (t->state < TC_MISSION_STATE_COUNT && f->entered_s[t->state] < 0.0) f->entered_s[t->state] = f->time_s;
    r->states |= 1u << t->state;
    r->warnings |= t->warnings;
    if (t->limit_reason < 64u) {
        r->limit_reasons |= (uint64_t)1 << t->limit_reason;
    } else {
        r->limit_reasons_high |= (uint64_t)1 << (t->limit_reason & 63u);
    }
}

/* Whether what the controller commands keeps it in the air; the moment at which that ends is what is judged. */
static void note_output(flight* f) {
    body_result* r = f->result;
    const tc_parameters* p = tc_parameters_now(&f->controller);
    const tc_telemetry* t = tc_telemetry_now(&f->controller);
    bool stopped = false, fine = true;
    for (int i = 0; i < TC_ROTORS; i++) {
        const float n = f->output.rotor_speed_rad_s[i];
        fine = fine && isfinite(n) && n >= 0.0f && n <= p->rotor_max_rad_s * 1.0001f;
        stopped = stopped || !(n >= 0.99f * p->rotor_min_rad_s);
    }
    if (!fine) r->bad_outputs++;
    const bool ours = t->state != TC_SHADOW;
    if (f->flying && stopped && ours) {
        const double clearance_m = body_clearance_m(&f->b);
        if (clearance_m > r->stop_clearance_m || r->stop_s <= 0.0) {
            r->stop_clearance_m = clearance_m;
            r->stop_s = f->time_s;
            r->stop_state = t->state;
            r->stop_reason = t->reason;
            r->stop_tilt_rad = body_tilt_rad(&f->b);
        }
    }
    f->flying = ours && !stopped;
    if (tc_mission_in_air(t->state)) r->flew = 1;
    if (tc_mission_on_path(t->state)) {
        double error2 = 0.0;
        for (int k = 0; k < 3; k++) {
            const double error = (double)t->setpoint.position_world_m[k] - f->b.position_m[k];
            error2 += error * error;
        }
        r->largest_error_m = fmax(r->largest_error_m, sqrt(error2));
        r->path_end_s = 1e-6 * (double)t->path_time_us;
        if (t->path_limit < LOGGED_LIMIT && t->limit_reason == TC_OK) r->unlogged_slow_s += f->scenario->tick_s;
    }
}

/* Before this controller has been in command for the first time in the air, and whenever it is not: the other's. */
static void choose_command(flight* f) {
    const bool not_yet = f->scenario->in_air == 1 && f->entered_s[TC_HOLD] < 0.0;
    const bool theirs = !f->output.in_command || not_yet;
    if (theirs) {
        body_pilot(&f->b, f->scenario->pilot_m_s, f->command_rad_s);
        f->result->out_of_command_ticks++;
    } else {
        for (int i = 0; i < TC_ROTORS; i++) f->command_rad_s[i] = (double)f->output.rotor_speed_rad_s[i];
    }
}

static void tick(flight* f, double step_s) {
    run_faults(f);
    read_clock(f);
    const uint64_t time_us = (uint64_t)llround(1e6 * f->time_s);
    body_sensors_read(&f->sensors, &f->b, time_us, f->clock_us, step_s, &f->estimate);
    if (f->hanging) return;
    if (f->scenario->has_link != 0 && !f->link_lost && f->time_s >= f->link_s) {
        tc_ground_alive(&f->controller, 0u);
        f->link_s = f->time_s + LINK_S;
    }
    run_orders(f);
    f->tick_reason = tc_tick(&f->controller, f->clock_us, &f->estimate, &f->output);
    note_changes(f);
    note_output(f);
    choose_command(f);
}

const char* body_trace_names(void) {
    return "time_s clock_s x y z vx vy vz qw qx qy qz wx wy wz estimate_x estimate_y estimate_z estimate_vx "
           "estimate_vy estimate_vz setpoint_x setpoint_y setpoint_z setpoint_vx setpoint_vy setpoint_vz clearance_m "
           "tilt_rad specific_force_z command0 command1 command2 command3 rotor0 rotor1 rotor2 rotor3 state reason "
           "tick_reason limit_reason path_rate path_limit landing_stage warnings estimate_faults reckoning_s "
           "reckoning_std_m thrust_n saturation in_command force_x force_y force_z torque_x torque_y torque_z "
           "force_std observer position_delay_s attitude_delay_s";
}

static void write_row(const flight* f, double* row) {
    const body* b = &f->b;
    const tc_telemetry* t = tc_telemetry_now(&f->controller);
    const double start[] = {f->time_s, 1e-6 * (double)f->clock_us};
    memcpy(row, start, sizeof start);
    memcpy(row + 2, b->position_m, sizeof b->position_m);
    memcpy(row + 5, b->velocity_m_s, sizeof b->velocity_m_s);
    memcpy(row + 8, b->q, sizeof b->q);
    memcpy(row + 12, b->rate_rad_s, sizeof b->rate_rad_s);
    for (int k = 0; k < 3; k++) {
        row[15 + k] = (double)f->estimate.position_world_m[k];
        row[18 + k] = (double)f->estimate.velocity_world_m_s[k];
        row[21 + k] = (double)t->setpoint.position_world_m[k];
        row[24 + k] = (double)t->setpoint.velocity_world_m_s[k];
    }
    row[27] = body_clearance_m(b);
    row[28] = body_tilt_rad(b);
    row[29] = b->specific_force_m_s2[2];
    memcpy(row + 30, f->command_rad_s, sizeof f->command_rad_s);
    memcpy(row + 34, b->rotor_rad_s, sizeof b->rotor_rad_s);
    const double end[] = {(double)t->state,           (double)t->reason,
                          (double)f->tick_reason,     (double)t->limit_reason,
                          (double)t->path_rate,       (double)t->path_limit,
                          (double)t->landing_stage,   (double)t->warnings,
                          (double)t->estimate_faults, (double)t->reckoning_s,
                          (double)t->reckoning_std_m, (double)t->wrench.thrust_n,
                          (double)t->saturation,      f->output.in_command ? 1.0 : 0.0};
    memcpy(row + 38, end, sizeof end);
    const tc_observer* o = tc_observer_now(&f->controller);
    for (int k = 0; k < 3; k++) {
        row[52 + k] = (double)o->force_world_n[k];
        row[55 + k] = (double)o->torque_body_n_m[k];
    }
    row[58] = sqrt((double)o->force_variance_n2);
    row[59] = (double)o->state;
    row[60] = (double)(f->controller.delay.velocity.delay_s + f->controller.delay.attitude.delay_s);
    row[61] = (double)f->controller.delay.attitude.delay_s;
}

static tc_reason upload(flight* f) {
    const body_scenario* s = f->scenario;
    if (s->segment_count == 0) return TC_OK;
    tc_controller* c = &f->controller;
    tc_reason reason = tc_upload_begin(c, &s->header);
    for (int i = 0; i < s->segment_count && reason == TC_OK; i++) {
        reason = tc_upload_segment(c, (uint16_t)i, &s->segment[i]);
    }
    if (reason == TC_OK) reason = TC_BUSY;
    while (reason == TC_BUSY) reason = tc_upload_finish(c);
    return reason == TC_OK ? tc_upload_activate(c, s->header.id, s->header.crc32) : reason;
}

static void prepare(flight* f) {
    const body_scenario* s = f->scenario;
    static const double still[BODY_ROTORS] = {0.0, 0.0, 0.0, 0.0};
    tc_parameters parameters;
    body_init(&f->b, &s->vehicle, &s->world, s->seed);
    body_sensors_init(&f->sensors, &s->sensors, s->seed);
    body_seed(&f->random, s->seed, 2u);
    for (int i = 0; i < TC_MISSION_STATE_COUNT; i++) f->entered_s[i] = NEVER;
    if (s->in_air != 0) {
        body_place(&f->b, s->start_m, s->start_m_s);
        if (s->in_air == 2) memcpy(f->b.rotor_rad_s, still, sizeof f->b.rotor_rad_s);
        memcpy(f->command_rad_s, f->b.rotor_rad_s, sizeof f->command_rad_s);
    } else {
        for (double t = 0.0; t < SETTLE_S || (t < 10.0 && f->b.record.rest_s <= 0.0); t += s->tick_s) {
            body_step(&f->b, still, s->tick_s);
        }
    }
    memset(&f->b.record, 0, sizeof f->b.record);
    tc_init(&f->controller);
    tc_parameters_default(&parameters);
    for (int i = 0; i < s->value_count; i++) {
        (void)tc_parameters_put(&parameters, (uint16_t)s->value[i].index, (float)s->value[i].value);
    }
    f->result->upload_reason = (int32_t)tc_parameters_set(&f->controller, &parameters);
    if (f->result->upload_reason == TC_OK) f->result->upload_reason = (int32_t)upload(f);
}

static bool over(const flight* f) {
    const bool idle = f->state == TC_DISARMED || f->state == TC_FAULT;
    return f->result->flew != 0 && idle && f->b.record.rest_s >= 2.0;
}

int32_t body_fly(const body_scenario* scenario, body_result* result, double* trace, int32_t rows, int32_t every) {
    static _Thread_local flight f;
    int32_t written = 0;
    memset(&f, 0, sizeof f);
    memset(result, 0, sizeof *result);
    f.scenario = scenario;
    f.result = result;
    prepare(&f);
    for (uint32_t i = 0; f.time_s < scenario->limit_s && !over(&f); i++) {
        const double step_s = scenario->tick_s * (1.0 + scenario->tick_jitter * (2.0 * body_uniform(&f.random) - 1.0));
        tick(&f, step_s);
        if (trace != NULL && written < rows && i % (uint32_t)every == 0u) {
            write_row(&f, trace + (size_t)written++ * BODY_TRACE_COLUMNS);
        }
        if (f.carried != NULL) {
            body_carry(&f.b, f.carried->value, step_s);
        } else {
            body_step(&f.b, f.command_rad_s, step_s);
        }
        f.time_s += step_s;
    }
    const tc_telemetry* t = tc_telemetry_now(&f.controller);
    result->body = f.b.record;
    result->end_s = f.time_s;
    memcpy(result->end_position_m, f.b.position_m, sizeof f.b.position_m);
    result->end_tilt_rad = body_tilt_rad(&f.b);
    result->at_rest = f.b.record.rest_s >= 2.0 ? 1 : 0;
    result->final_state = t->state;
    result->final_reason = t->reason;
    result->ticks = t->ticks;
    result->refused_ticks = t->refused_ticks;
    return written;
}

void body_sizes(int32_t sizes[2]) {
    sizes[0] = (int32_t)sizeof(body_scenario);
    sizes[1] = (int32_t)sizeof(body_result);
}
