/* The Crazyflie controller of examples/integration, compiled against its interface headers, on a simulated body. The
   test is stabilizer task, commander, supervisor and motors; one scenario per run, named by the first argument. */
#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app.h"
#include "app_channel.h"
#include "commander.h"
#include "controller.h"
#include "controller_pid.h"
#include "motors.h"
#include "platform_defaults.h"
#include "pm.h"
#include "semphr.h"
#include "simulated_body.h"
#include "task.h"
#include "usec_time.h"

/* The source itself: its controller is static, and the test gives orders as the link would. */
#include "goshawk_controller_oot.c"

#define CHECK(condition)                                                  \
    do {                                                                  \
        if (!(condition)) {                                               \
            printf("%s:%d: CHECK(%s)\n", __FILE__, __LINE__, #condition); \
            exit(1);                                                      \
        }                                                                 \
    } while (0)

static uint64_t clock_us = 1000000;
static simulated_body body;
static bool held;          /* the PID controller holds it where it is */
static bool locked;        /* by the supervisor */
static bool level_out;     /* the supervisor has replaced the set-point */
static bool null_setpoint; /* ... by nothing */
static bool mutex_taken;   /* by the app task */
static int pid_calls, motor_stops;
static setpoint_t commanded;
static int commander_priority;
static stabilizerStep_t step_count;
static control_t control;
static float low_s; /* of the supervisor's tumble rule */

uint64_t usecTimestamp(void) { return clock_us; }
TickType_t xTaskGetTickCount(void) { return (TickType_t)(clock_us / 1000u); }
SemaphoreHandle_t xSemaphoreCreateMutexStatic(StaticSemaphore_t* memory) { return memory; }
BaseType_t xSemaphoreTake(SemaphoreHandle_t semaphore, TickType_t wait) {
    CHECK(semaphore != NULL && wait <= 5u);
    return mutex_taken ? pdFALSE : pdTRUE;
}
BaseType_t xSemaphoreGive(SemaphoreHandle_t semaphore) { return semaphore != NULL; }
int appchannelSendDataPacket(void* data, size_t length) { return data != NULL && length <= APPCHANNEL_MTU; }
size_t appchannelReceiveDataPacket(void* buffer, size_t max_length, int timeout_ms) {
    CHECK(timeout_ms == 0 && max_length == APPCHANNEL_MTU);
    memset(buffer, 0, max_length);
    return 0;
}
void commanderSetSetpoint(setpoint_t* setpoint, int priority) {
    if (priority < commander_priority) return;
    setpoint->timestamp = xTaskGetTickCount();
    commanded = *setpoint;
    commander_priority = priority;
}
void commanderRelaxPriority(void) { commander_priority = 1; }
void controllerPidInit(void) {}
bool controllerPidTest(void) { return true; }
void controllerPid(control_t* c, const setpoint_t* setpoint, const sensorData_t* sensors, const state_t* state,
                   const stabilizerStep_t step) {
    CHECK(setpoint != NULL && sensors != NULL && state != NULL && step > 0u);
    pid_calls++;
    c->controlMode = controlModeForce;
    for (int i = 0; i < 4; i++) c->normalizedForces[i] = body.position_world_m[2] > 0.0f ? 0.59f : 0.0f; /* hover */
}
void motorsStop(void) {
    motor_stops++;
    memset(control.normalizedForces, 0, sizeof control.normalizedForces);
}
uint16_t motorsGetRatio(uint32_t id) {
    const float force = control.normalizedForces[id];
    return (uint16_t)(65535.0f * (force > 1.0f ? 1.0f : force));
}
float pmGetBatteryVoltage(void) { return 4.0f; }
static uint32_t stored_boots = 41u;
static uint64_t stored_stamp = 777000u;
static void* stored(const char* key, size_t length) {
    const bool boots = strcmp(key, "goshawk/boots") == 0;
    CHECK(boots || strcmp(key, "goshawk/stamp") == 0);
    CHECK(length == (boots ? sizeof stored_boots : sizeof stored_stamp));
    return boots ? (void*)&stored_boots : (void*)&stored_stamp;
}
bool storageStore(const char* key, const void* buffer, size_t length) {
    memcpy(stored(key, length), buffer, length);
    return true;
}
size_t storageFetch(const char* key, void* buffer, size_t length) {
    memcpy(buffer, stored(key, length), length);
    return length;
}

/* The app task, one turn of its loop at a time: vTaskDelay jumps back out of the second call. */
static jmp_buf app_returns;
static int app_delays;
static uint32_t app_passes, app_since_ms;
void vTaskDelay(TickType_t ticks) {
    CHECK(ticks == 5u);
    if (++app_delays == 2) longjmp(app_returns, 1);
}
static void app_task(void) {
    watch(&app_passes, &app_since_ms);
    app_delays = 0;
    if (setjmp(app_returns) == 0) appMain();
}

static void supervise(setpoint_t* setpoint, const sensorData_t* sensors) {
    const bool flying = control.normalizedForces[0] > 0.0f;
    const uint32_t age_ms = xTaskGetTickCount() - setpoint->timestamp;
    low_s = sensors->acc.z < 0.5f ? low_s + 0.001f : 0.0f;
    if (flying && (age_ms > 2000u || low_s > 1.0f)) locked = true;
    if (locked || null_setpoint) {
        memset(setpoint, 0, sizeof *setpoint);
    } else if (level_out || (flying && age_ms > 500u)) {
        setpoint->mode.x = setpoint->mode.y = modeDisable;
        setpoint->mode.roll = setpoint->mode.pitch = modeAbs;
        setpoint->mode.yaw = modeVelocity;
        setpoint->attitude.roll = setpoint->attitude.pitch = 0.0f;
    }
}

static void stabilizer(bool controller_runs) {
    sensorData_t sensors;
    state_t state;
    clock_us += 1000u;
    step_count++;
    const float *p = body.position_world_m, *v = body.velocity_world_m_s, *q = body.q_world_body;
    memset(&sensors, 0, sizeof sensors);
    memset(&state, 0, sizeof state);
    state.position = (point_t){xTaskGetTickCount(), p[0], p[1], p[2]};
    state.velocity = (velocity_t){xTaskGetTickCount(), v[0], v[1], v[2]};
    state.attitudeQuaternion = (quaternion_t){q[1], q[2], q[3], q[0]};
    sensors.gyro = (Axis3f){57.29578f * body.rate_body_rad_s[0], 57.29578f * body.rate_body_rad_s[1],
                            57.29578f * body.rate_body_rad_s[2]};
    const float* f = body.specific_force_body_m_s2;
    sensors.acc = (Axis3f){f[0] / 9.80665f, f[1] / 9.80665f, f[2] / 9.80665f};
    sensors.interruptTimestamp = clock_us;
    if (controller_runs) {
        setpoint_t hover;
        memset(&hover, 0, sizeof hover);
        hover.mode.x = hover.mode.y = hover.mode.z = hover.mode.yaw = modeAbs;
        commanderSetSetpoint(&hover, 2); /* a pilot's, all the time */
        setpoint_t setpoint = commanded;
        supervise(&setpoint, &sensors);
        controllerOutOfTree(&control, &setpoint, &sensors, &state, step_count);
    }
    float command[TC_ROTORS];
    for (int i = 0; i < 4; i++) {
        command[i] = locked ? 0.0f : FULL_RAD_S * sqrtf(control.normalizedForces[i]);
    }
    simulated_body next = body;
    simulated_body_step(&next, command, 0.001f);
    if (held) {
        memcpy(body.rotor_speed_rad_s, next.rotor_speed_rad_s, sizeof body.rotor_speed_rad_s);
    } else {
        body = next;
    }
    if (step_count % 5u == 0u) app_task();
}

static void run(float duration_s) {
    for (int i = 0; i < (int)(1000.0f * duration_s); i++) stabilizer(true);
}

static void begin(float height_m) {
    simulated_body_init(&body);
    vehicle_parameters(&body.parameters);
    body.position_world_m[2] = height_m;
    controllerOutOfTreeInit();
    CHECK(controllerOutOfTreeTest());
    held = height_m > 0.0f;
    run(1.5f);
}

static void take_over(void) {
    engage = 1u;
    held = false;
    run(0.002f);
    CHECK(engage == 1u && ours);
}

static void the_pid_controller_flies_until_ours_is_asked_for(void) {
    begin(1.0f);
    CHECK(stored_boots == 42u && link_config.boot_id == 42u && link_config.start_10us == 777000u);
    CHECK(pid_calls == 1500 && controller_state.mission.state == TC_SHADOW && commander_priority == 2);
    take_over();
    run(3.0f);
    CHECK(pid_calls == 1500);
    CHECK(fabsf(body.position_world_m[2] - 1.0f) < 0.1f && fabsf(body.position_world_m[0]) < 0.1f);
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] > 0.3f && control.normalizedForces[i] < 0.9f);
    CHECK(!locked && fabsf(commanded.position.z - 1.0f) < 0.1f && commanded.mode.z == modeAbs);
    engage = 0u;
    held = true;
    run(0.1f);
    CHECK(pid_calls == 1600 && commander_priority == 2 && controller_state.mission.state == TC_SHADOW);
}

static void the_stamp_is_kept_in_time_for_the_next_boot(void) {
    begin(0.0f);
    for (int i = 0; i < 3; i++) {
        run(30.0f);
        CHECK(stored_stamp > ground_link.signing.now_10us + 100000u * TC_LINK_KEEP_PERIOD_S / 2u);
    }
}

static void takes_off_and_lands_without_being_locked(void) {
    begin(0.0f);
    take_over();
    CHECK(tc_do(&controller_state, TC_COMMAND_ARM, 0.0f) == TC_OK);
    run(0.5f);
    CHECK(tc_do(&controller_state, TC_COMMAND_TAKE_OFF, 1.0f) == TC_OK);
    run(4.0f);
    CHECK(controller_state.mission.state == TC_HOLD && fabsf(body.position_world_m[2] - 1.0f) < 0.1f);
    CHECK(tc_do(&controller_state, TC_COMMAND_LAND, 0.0f) == TC_OK);
    run(6.0f);
    CHECK(controller_state.mission.state == TC_DISARMED && body.position_world_m[2] <= 0.0f && !locked);
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] <= 0.0f);
    /* The supervisor takes it for flying for 2 s more; set-points must go on. */
    CHECK(xTaskGetTickCount() - commanded.timestamp <= SETPOINT_PERIOD_STEPS);
}

static void lands_when_the_supervisor_levels_out(void) {
    begin(1.0f);
    take_over();
    run(1.0f);
    level_out = true;
    run(6.0f);
    CHECK(controller_state.mission.state == TC_DISARMED && body.position_world_m[2] <= 0.0f);
}

static void stops_when_the_supervisor_takes_the_setpoint_away(void) {
    begin(1.0f);
    take_over();
    run(1.0f);
    null_setpoint = true;
    run(0.002f);
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] <= 0.0f);
    null_setpoint = false;
    run(0.5f);
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] <= 0.0f);
}

static void a_hanging_stabilizer_task_loses_its_motors_within_60_ms(void) {
    begin(1.0f);
    take_over();
    run(1.0f);
    int waited_ms = 0;
    while (motor_stops == 0) {
        CHECK(++waited_ms <= 60);
        stabilizer(false);
    }
    CHECK(waited_ms > 40);
    run(0.5f); /* it comes back */
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] <= 0.0f);
    engage = 0u;
    run(0.1f);
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] <= 0.0f);
}

static void a_busy_app_task_costs_a_tick_and_nothing_else(void) {
    begin(1.0f);
    take_over();
    for (int i = 0; i < 300; i++) {
        mutex_taken = i % 10 == 0;
        stabilizer(true);
    }
    mutex_taken = false;
    run(2.0f);
    CHECK(controller_state.mission.state == TC_HOLD && fabsf(body.position_world_m[2] - 1.0f) < 0.1f);
}

static void an_app_task_that_never_gives_the_mutex_back_stops_the_motors_within_60_ms(void) {
    begin(1.0f);
    take_over();
    run(1.0f);
    mutex_taken = true;
    run(0.04f);
    CHECK(control.normalizedForces[0] > 0.0f);
    run(0.02f);
    for (int i = 0; i < 4; i++) CHECK(control.normalizedForces[i] <= 0.0f);
}

/* Down by 26 m and up again, at rest at both ends, each within this time; through the upload of the controller. */
static void activate(float height_m, uint32_t duration_us) {
    static const float step[8] = {0.5f, 35.0f / 32.0f, 0.0f, -35.0f / 32.0f, 0.0f, 21.0f / 32.0f, 0.0f, -5.0f / 32.0f};
    static tc_trajectory path;
    memset(&path, 0, sizeof path);
    path.header.id = duration_us;
    path.header.segment_count = 2u;
    path.header.coefficient_count = 8u;
    for (int k = 0; k < 2; k++) {
        path.segment[k].duration_us = duration_us;
        for (int i = 0; i < 8; i++) path.segment[k].coefficient[2][i] = (k == 0 ? -26.0f : 26.0f) * step[i];
        path.segment[k].coefficient[2][0] += k == 0 ? height_m : height_m - 26.0f;
    }
    path.header.crc32 = tc_trajectory_crc32(&path);
    CHECK(tc_upload_begin(&controller_state, &path.header) == TC_OK);
    for (uint16_t k = 0; k < 2u; k++) CHECK(tc_upload_segment(&controller_state, k, &path.segment[k]) == TC_OK);
    tc_reason reason = TC_BUSY;
    while (reason == TC_BUSY) reason = tc_upload_finish(&controller_state);
    CHECK(reason == TC_OK);
    CHECK(tc_upload_activate(&controller_state, path.header.id, path.header.crc32) == TC_OK);
}

static void a_path_that_the_supervisor_would_take_for_a_tumble_is_not_begun(void) {
    begin(40.0f);
    take_over();
    run(0.5f);
    activate(40.0f, 5000000u);
    run(0.02f);
    CHECK(tc_do(&controller_state, TC_COMMAND_START, 0.0f) == TC_OK);
    run(3.0f);
    CHECK(controller_state.mission.state == TC_HOLD && !locked && body.position_world_m[2] > 39.5f);
    activate(40.0f, 10000000u); /* the same, slowly */
    run(0.02f);
    CHECK(tc_do(&controller_state, TC_COMMAND_START, 0.0f) == TC_OK);
    run(6.0f);
    CHECK(controller_state.mission.state == TC_TRAJECTORY && !locked && body.position_world_m[2] < 30.0f);
}

/* What the rule is for: the same path, flown without the check. */
static void that_path_would_have_been_stopped_by_the_supervisor(void) {
    begin(40.0f);
    take_over();
    run(0.5f);
    activate(40.0f, 5000000u);
    run(0.02f);
    tumbles = false;
    CHECK(tc_do(&controller_state, TC_COMMAND_START, 0.0f) == TC_OK);
    run(4.0f);
    CHECK(locked);
}

struct scenario {
    const char* name;
    void (*run)(void);
};
#define SCENARIO(name) {#name, name}
static const struct scenario scenarios[] = {
    SCENARIO(the_pid_controller_flies_until_ours_is_asked_for),
    SCENARIO(the_stamp_is_kept_in_time_for_the_next_boot),
    SCENARIO(takes_off_and_lands_without_being_locked),
    SCENARIO(lands_when_the_supervisor_levels_out),
    SCENARIO(stops_when_the_supervisor_takes_the_setpoint_away),
    SCENARIO(a_hanging_stabilizer_task_loses_its_motors_within_60_ms),
    SCENARIO(a_busy_app_task_costs_a_tick_and_nothing_else),
    SCENARIO(an_app_task_that_never_gives_the_mutex_back_stops_the_motors_within_60_ms),
    SCENARIO(a_path_that_the_supervisor_would_take_for_a_tumble_is_not_begun),
    SCENARIO(that_path_would_have_been_stopped_by_the_supervisor),
};

int main(int argc, char* argv[]) {
    for (size_t i = 0; i < sizeof scenarios / sizeof *scenarios; i++) {
        if (argc == 1) printf("%s\n", scenarios[i].name);
        if (argc == 2 && strcmp(argv[1], scenarios[i].name) == 0) {
            scenarios[i].run();
            return 0;
        }
    }
    return argc == 1 ? 0 : 2;
}
