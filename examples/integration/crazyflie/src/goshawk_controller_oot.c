/* Goshawk as the Crazyflie's out-of-tree controller. `goshawk.engage` = 0: the firmware's PID controller flies and ours
   computes in its shadow; 1: ours flies. The ground link's bytes go through the app channel.

   The stabilizer task (1 kHz) calls controllerOutOfTree; the app task serves the link and watches the stabilizer task.
   One mutex guards the controller. Written for one commit of crazyflie-firmware: see README.md. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "FreeRTOS.h"
#include "app.h"
#include "app_channel.h"
#include "commander.h"
#include "controller.h"
#include "controller_pid.h"
#include "motors.h"
#include "param.h"
#include "platform_defaults.h"
#include "pm.h"
#include "semphr.h"
#include "storage.h"
#include "task.h"
#include "usec_time.h"
#define DEBUG_MODULE "GOSHAWK"
#include "debug.h"
#include "goshawk_controller/goshawk_controller.h"
#include "goshawk_controller/link.h"
#include "goshawk_key.h" /* yours: #define GOSHAWK_KEY {0x.., ...} with 32 random bytes; keep it out of version control */

#define RAD_PER_DEG 0.0174532925f
#define GRAVITY_M_S2 9.80665f

/* Thrust is what this firmware commands, so the rotor speed of full thrust is a scale that cancels. This one gives a
   thrust coefficient like that of a 5-inch rotor, in the middle of what float32 takes in the mixer. */
#define FULL_RAD_S 200.0f

/* The supervisor takes specific force along body z below 0.5 g for 1 s for a tumbled vehicle and stops the motors. A
   path may come as close to that as: */
#define TUMBLE_FORCE_M_S2 (0.55f * GRAVITY_M_S2)
#define TUMBLE_TIME_US 800000u
#define TUMBLE_STEP_US 20000u

#define SETPOINT_PERIOD_STEPS 20u /* the supervisor levels out after 500 ms without, and stops the motors after 2 s */
#define WATCHDOG_MS 50u
#define APP_PERIOD_MS 5u
#define PACKETS_AT_ONCE 8
#define MUTEX_WAIT_MS 1

static tc_controller controller_state;
static tc_link ground_link;
static tc_parser stream;
static tc_estimate estimate;
static tc_output output;
static tc_link_config link_config = {
    .system_id = 1, .component_id = 1, .sign = true, .key = GOSHAWK_KEY, .bytes_per_s = 2000};
static volatile bool link_ready;

static SemaphoreHandle_t mutex;
static StaticSemaphore_t mutex_memory;
static uint8_t engage;           /* parameter: requested state */
static bool ours;                /* we fly, the PID controller does not */
static bool ready;               /* parameters were taken */
static uint32_t fed;             /* set-points given to the commander since we fly */
static volatile uint32_t passes; /* of controllerOutOfTree, for the watchdog */
static volatile bool in_command; /* our rotors turn */
static volatile bool tripped;    /* by the watchdog; until the next restart */
static volatile uint32_t checked_id, checked_crc32;
static volatile bool tumbles; /* the path at hand would make the supervisor stop the motors */

/* Motors 1 to 4: front right, rear right, rear left, front left. */
static void vehicle_parameters(tc_parameters* p) {
    static const float x[TC_ROTORS] = {1.0f, -1.0f, -1.0f, 1.0f}, y[TC_ROTORS] = {-1.0f, -1.0f, 1.0f, 1.0f};
    static const float spin[TC_ROTORS] = {-1.0f, 1.0f, -1.0f, 1.0f};
    static const float inertia_kg_m2[3] = {1.657e-5f, 1.666e-5f, 2.926e-5f}; /* of a Crazyflie 2.1; yours differs */
    const float arm_m = 0.70710678f * (float)ARM_LENGTH;
    tc_parameters_default(p);
    p->mass_kg = (float)CF_MASS;
    memcpy(p->inertia_kg_m2, inertia_kg_m2, sizeof inertia_kg_m2);
    memset(p->centre_of_mass_m, 0, sizeof p->centre_of_mass_m);
    for (int i = 0; i < TC_ROTORS; i++) {
        p->rotor_x_m[i] = arm_m * x[i];
        p->rotor_y_m[i] = arm_m * y[i];
        p->rotor_spin[i] = spin[i];
    }
    p->thrust_model = (float)TC_THRUST_QUADRATIC;
    p->quad_n_s2 = (float)THRUST_MAX / (FULL_RAD_S * FULL_RAD_S);
    p->cq_n_m_s2 = (float)THRUST2TORQUE * p->quad_n_s2;
    p->rotor_max_rad_s = FULL_RAD_S;
    p->rotor_min_rad_s = 0.2f * FULL_RAD_S;
    p->rotor_idle_rad_s = 0.2f * FULL_RAD_S;
    p->rotor_drag_s_m = 0.0f;
    memset(p->parasitic_kg_m, 0, sizeof p->parasitic_kg_m);
    p->predict_extra_s = 0.005f; /* the Kalman filter predicts every 10 ms without a time stamp */
    p->battery_warn_v = 3.4f;
    p->battery_land_v = 3.2f;
}

void controllerOutOfTreeInit(void) {
    tc_parameters parameters;
    controllerPidInit();
    if (mutex == NULL) mutex = xSemaphoreCreateMutexStatic(&mutex_memory);
    tc_init(&controller_state);
    vehicle_parameters(&parameters);
    const tc_reason reason = tc_parameters_set(&controller_state, &parameters);
    ready = reason == TC_OK;
    if (!ready) DEBUG_PRINT("parameters refused: %s\n", tc_reason_text(reason));
}

bool controllerOutOfTreeTest(void) { return ready && controllerPidTest(); }

/* The firmware's state: world z up, body x forward y left z up as ours; quaternion x y z w; degrees; g; ms. */
static void read_state(const sensorData_t* sensors, const state_t* state, uint64_t now_us) {
    const uint32_t age_ms = xTaskGetTickCount() - state->position.timestamp;
    const quaternion_t* q = &state->attitudeQuaternion;
    const float position[3] = {state->position.x, state->position.y, state->position.z};
    const float velocity[3] = {state->velocity.x, state->velocity.y, state->velocity.z};
    const float attitude[4] = {q->w, q->x, q->y, q->z};
    const float rate[3] = {sensors->gyro.x, sensors->gyro.y, sensors->gyro.z};
    const float force[3] = {sensors->acc.x, sensors->acc.y, sensors->acc.z};
    estimate.position_time_us = now_us > 1000u * (uint64_t)age_ms ? now_us - 1000u * (uint64_t)age_ms : 0u;
    estimate.attitude_time_us = estimate.position_time_us; /* the same filter */
    estimate.rate_time_us = sensors->interruptTimestamp;
    memcpy(estimate.position_world_m, position, sizeof position);
    memcpy(estimate.velocity_world_m_s, velocity, sizeof velocity);
    memcpy(estimate.q_world_body, attitude, sizeof attitude);
    for (int i = 0; i < 3; i++) {
        estimate.rate_body_rad_s[i] = RAD_PER_DEG * rate[i];
        estimate.specific_force_body_m_s2[i] = GRAVITY_M_S2 * force[i];
    }
    estimate.battery_v = pmGetBatteryVoltage();
    estimate.valid = TC_VALID_ALL; /* this estimator has neither validity nor reset counter */
}

/* Who flies: a change of the parameter, or a controller that is done. */
static void follow_engage(void) {
    const uint8_t state = controller_state.mission.state;
    if (engage == 0u || tripped || !ready) {
        if (ours) commanderRelaxPriority(); /* other set-points count again */
        if (tc_mission_in_air(state) || state == TC_ARMED) (void)tc_release(&controller_state);
        if (state == TC_FAULT) (void)tc_do(&controller_state, TC_COMMAND_DISARM, 0.0f);
        if (controller_state.mission.state == TC_DISARMED) (void)tc_shadow(&controller_state);
        ours = false;
    } else if (!ours) {
        float rotor_speed_rad_s[TC_ROTORS];
        for (int i = 0; i < TC_ROTORS; i++) {
            rotor_speed_rad_s[i] = FULL_RAD_S * sqrtf((float)motorsGetRatio((uint32_t)i) / 65535.0f);
        }
        const bool standing = rotor_speed_rad_s[0] <= 0.0f;
        const tc_reason reason =
            standing ? tc_shadow_end(&controller_state) : tc_engage(&controller_state, rotor_speed_rad_s);
        ours = reason == TC_OK;
        fed = 0u;
        if (!ours) engage = 0u; /* the PID controller flies on; ask again */
    }
}

static bool is_null(const setpoint_t* s) {
    return s->mode.x == modeDisable && s->mode.y == modeDisable && s->mode.z == modeDisable &&
           s->mode.roll == modeDisable && s->mode.pitch == modeDisable && s->mode.yaw == modeDisable &&
           s->thrust <= 0.0f;
}

static bool is_level_out(const setpoint_t* s) {
    return s->mode.x == modeDisable && s->mode.y == modeDisable && s->mode.roll == modeAbs && s->mode.pitch == modeAbs;
}

/* The supervisor speaks by changing the set-point: nothing at all is "motors off", level is "stop what you do". It
   counts only when it replaced one of ours. */
static void obey(const setpoint_t* setpoint) {
    if (!in_command || fed < 2u) return;
    if (is_null(setpoint)) {
        (void)tc_do(&controller_state, TC_COMMAND_KILL, 0.0f);
    } else if (is_level_out(setpoint)) {
        (void)tc_do(&controller_state, TC_COMMAND_LAND, 0.0f);
    }
}

/* A path that check_path has not found good is not begun. */
static void guard_path(void) {
    const tc_trajectory* active = tc_store_active(&controller_state.store);
    const bool checked = active != NULL && active->header.id == checked_id && active->header.crc32 == checked_crc32;
    const bool begun = controller_state.mission.state == TC_APPROACH || controller_state.mission.state == TC_TRAJECTORY;
    if (begun && (tumbles || !checked)) (void)tc_do(&controller_state, TC_COMMAND_HOLD, 0.0f);
}

/* What we are after, for the supervisor (it wants set-points that are not old) and for the firmware's log. */
static void feed_commander(stabilizerStep_t step) {
    if (fed > 0u && step % SETPOINT_PERIOD_STEPS != 0u) return;
    const tc_setpoint* from = &controller_state.telemetry.setpoint;
    setpoint_t to;
    memset(&to, 0, sizeof to);
    to.mode.x = to.mode.y = to.mode.z = to.mode.yaw = modeAbs;
    to.position.x = from->position_world_m[0];
    to.position.y = from->position_world_m[1];
    to.position.z = from->position_world_m[2];
    to.velocity.x = from->velocity_world_m_s[0];
    to.velocity.y = from->velocity_world_m_s[1];
    to.velocity.z = from->velocity_world_m_s[2];
    to.attitude.yaw = from->yaw_rad / RAD_PER_DEG;
    commanderSetSetpoint(&to, COMMANDER_PRIORITY_EXTRX);
    fed++;
}

static void write_forces(control_t* control) {
    control->controlMode = controlModeForce;
    for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++) {
        const float ratio = output.rotor_speed_rad_s[i] / FULL_RAD_S;
        control->normalizedForces[i] = tripped ? 0.0f : ratio * ratio;
    }
}

void controllerOutOfTree(control_t* control, const setpoint_t* setpoint, const sensorData_t* sensors,
                         const state_t* state, const stabilizerStep_t stabilizerStep) {
    static uint32_t missed;
    const uint64_t now_us = usecTimestamp();
    missed++;
    if (xSemaphoreTake(mutex, M2T(MUTEX_WAIT_MS)) == pdTRUE) {
        read_state(sensors, state, now_us);
        follow_engage();
        if (ours) obey(setpoint);
        guard_path();
        (void)tc_tick(&controller_state, now_us, &estimate, &output);
        in_command = ours && tc_mission_rotors_on(output.state);
        if (ours) feed_commander(stabilizerStep); /* after landing too: it counts as flying for 2 s more */
        if (link_ready) tc_link_update(&ground_link, now_us);
        (void)xSemaphoreGive(mutex);
        missed = 0u;
    } /* else the app task holds it: the last output is kept for another millisecond */
    if (missed > WATCHDOG_MS && in_command) tripped = true; /* ... but not for ever */
    if (ours || tripped) {
        write_forces(control);
    } else {
        controllerPid(control, setpoint, sensors, state, stabilizerStep);
    }
    passes++;
}

/* Whether the supervisor would take this path for a tumble: little thrust for long. Its own limit is a second below
   0.5 g; free fall below 0.1 g does not count there, here it does. */
static bool path_tumbles(const tc_trajectory* path) {
    uint32_t low_us = 0u, time_us = 0u;
    for (uint16_t i = 0; i < path->header.segment_count; i++) {
        const uint32_t end_us = path->start_us[i + 1u];
        for (; time_us < end_us; time_us += TUMBLE_STEP_US) {
            tc_setpoint s;
            tc_trajectory_evaluate(path, i, time_us, &s);
            const float* a = s.acceleration_world_m_s2;
            const float up = a[2] + GRAVITY_M_S2;
            const bool low = a[0] * a[0] + a[1] * a[1] + up * up < TUMBLE_FORCE_M_S2 * TUMBLE_FORCE_M_S2;
            low_us = low ? low_us + TUMBLE_STEP_US : 0u;
            if (low_us >= TUMBLE_TIME_US) return true;
        }
    }
    return false;
}

/* Only this task changes the active path (a commit comes over the link), so it may be read without the mutex. */
static void check_path(void) {
    const tc_trajectory* path = tc_store_active(&controller_state.store);
    if (path == NULL || (path->header.id == checked_id && path->header.crc32 == checked_crc32)) return;
    tumbles = path_tumbles(path);
    checked_id = path->header.id;
    checked_crc32 = path->header.crc32;
    if (tumbles) DEBUG_PRINT("path below 0.55 g for 0.8 s: the supervisor would stop the motors, it is not flown\n");
}

static void serve_link(void) {
    uint8_t packet[APPCHANNEL_MTU], frame[TC_FRAME_MAX];
    for (int i = 0; i < PACKETS_AT_ONCE; i++) {
        const size_t n = appchannelReceiveDataPacket(packet, sizeof packet, 0);
        if (n == 0u) break;
        tc_link_receive(&ground_link, packet, n, &stream, usecTimestamp());
    }
    const size_t n = tc_link_transmit(&ground_link, frame, usecTimestamp());
    for (size_t sent = 0; sent < n; sent += APPCHANNEL_MTU) {
        const size_t rest = n - sent;
        (void)appchannelSendDataPacket(&frame[sent], rest < APPCHANNEL_MTU ? rest : APPCHANNEL_MTU);
    }
}

/* A controller that does not come back leaves the motors at their last thrust; the firmware notices after 2 s. */
static void watch(uint32_t* last_passes, uint32_t* since_ms) {
    const uint32_t now_ms = xTaskGetTickCount();
    if (passes != *last_passes || !in_command) {
        *last_passes = passes;
        *since_ms = now_ms;
    } else if (now_ms - *since_ms > M2T(WATCHDOG_MS)) {
        if (!tripped) DEBUG_PRINT("stabilizer task hangs: motors off\n");
        tripped = true;
        motorsStop();
    }
}

/* The number of this boot, counted in the Crazyflie's storage. The link's challenges follow from it: one that comes a
   second time would let recordings of the first one in. So without a count there is no link. The stamp goes on where
   the last one was kept; without it stations refuse ours until we have followed one of theirs. */
static void start_link(void) {
    uint32_t boot = 0u;
    (void)storageFetch("goshawk/stamp", &link_config.start_10us, sizeof link_config.start_10us);
    (void)storageFetch("goshawk/boots", &boot, sizeof boot); /* nothing there: the first boot */
    boot++;
    if (!storageStore("goshawk/boots", &boot, sizeof boot)) {
        DEBUG_PRINT("the count of boots cannot be kept: no link\n");
        return;
    }
    link_config.boot_id = boot;
    tc_link_init(&ground_link, &controller_state, &link_config, usecTimestamp());
    link_ready = true;
}

/* Writing takes milliseconds, so the mutex is not held meanwhile. */
static void keep_stamp(uint64_t stamp_10us) {
    static uint32_t kept_ms;
    const uint32_t now_ms = xTaskGetTickCount();
    if (now_ms - kept_ms < M2T(1000u * TC_LINK_KEEP_PERIOD_S / 2u)) return;
    kept_ms = now_ms;
    if (!storageStore("goshawk/stamp", &stamp_10us, sizeof stamp_10us)) DEBUG_PRINT("the stamp cannot be kept\n");
}

void appMain(void) {
    uint32_t last_passes = 0u, since_ms = xTaskGetTickCount();
    if (!link_ready) start_link();
    for (;;) {
        uint64_t stamp_10us = 0u;
        vTaskDelay(M2T(APP_PERIOD_MS));
        watch(&last_passes, &since_ms);
        if (mutex != NULL && xSemaphoreTake(mutex, M2T(APP_PERIOD_MS)) == pdTRUE) {
            if (link_ready) {
                serve_link();
                stamp_10us = tc_link_stamp_to_keep(&ground_link);
            }
            (void)xSemaphoreGive(mutex);
        }
        if (stamp_10us > 0u) keep_stamp(stamp_10us);
        check_path();
    }
}

PARAM_GROUP_START(goshawk)
/** 0: the PID controller flies, 1: Goshawk does. Falls back to 0 when it is refused in the air. */
PARAM_ADD(PARAM_UINT8, engage, &engage)
PARAM_GROUP_STOP(goshawk)
