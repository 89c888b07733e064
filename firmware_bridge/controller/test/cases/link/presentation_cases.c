/* What standard ground stations are shown, one law each: parameters, missions, health, mode, heights. */
#include <math.h>
#include <string.h>

#include "link_cases.h"
#include "standard_cases.h"

/* The value in the answer to a PARAM_SET; NaN when there is none. */
static float set_parameter(uint8_t system, const char* name, float value, uint8_t type) {
    param_set_msg m = {TO_VEHICLE, .param_value = value, .param_type = type};
    param_value_msg answered;
    uint8_t payload[TC_PAYLOAD_MAX];
    memcpy(m.param_id, name, strlen(name));
    (void)answer(0);
    param_set_encode(&m, payload);
    deliver(system, 190, PARAM_SET_ROW, payload, PARAM_SET_LENGTH);
    const uint8_t* found = answer(PARAM_VALUE_ID);
    if (found == NULL) return NAN;
    param_value_decode(&answered, found, PARAM_VALUE_LENGTH);
    must(strncmp(answered.param_id, name, 16) == 0 && answered.param_type == 9u, "the parameter that was set");
    must(answered.param_count == tc_parameters_count(), "of so many");
    return answered.param_value;
}

static void parameters(void) {
    standard_begin();
    must(fabsf(set_parameter(PILOT, "mass_kg", 0.71f, 9) - 0.71f) < 1e-6f, "set");
    must(fabsf(tc_parameters_now(&controller)->mass_kg - 0.71f) < 1e-6f, "in force");
    must(fabsf(set_parameter(OTHER, "mass_kg", 0.9f, 9) - 0.71f) < 1e-6f, "not by another: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", -1.0f, 9) - 0.71f) < 1e-6f, "out of range: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", NAN, 9) - 0.71f) < 1e-6f, "not finite: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", 5.0f, 9) - 0.71f) < 1e-6f, "cannot hover: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", 0.72f, 6) - 0.71f) < 1e-6f, "another type: the old value");
    must(isnan(set_parameter(PILOT, "MIS_TAKEOFF_ALT", 2.0f, 9)), "unknown: nothing to answer with");
    must(fabsf(tc_parameters_now(&controller)->mass_kg - 0.71f) < 1e-6f, "nothing of that in force");
    must(stage_parameters(PILOT, 77) == TC_OK, "a set is open");
    must(fabsf(set_parameter(PILOT, "mass_kg", 0.7f, 9) - 0.7f) < 1e-6f, "a single one goes before");
    must(commit_parameters(PILOT, 77, 0) != TC_OK, "and the set has to be opened anew");
    standard_hovering();
    must(set_parameter(PILOT, "rotor0_x_m", 0.2f, 9) < 0.19f, "not in the air: the old value");
    SEND(PILOT, PARAM_SET, param_set, TO_VEHICLE, .param_id = "rotor0_x_m", .param_value = 0.2f, .param_type = 9);
    const uint8_t* payload = answer(STATUSTEXT_ID);
    statustext_msg text;
    must(payload != NULL, "with a sentence");
    statustext_decode(&text, payload, STATUSTEXT_LENGTH);
    must(strncmp(text.text, "rotor0_x_m: ", 12) == 0, "that names it");
}

static void missions(void) {
    standard_begin();
    for (uint8_t type = 0; type < 4u; type++) {
        mission_count_msg m;
        SEND(OTHER, MISSION_REQUEST_LIST, mission_request_list, TO_VEHICLE, .mission_type = type);
        const uint8_t* payload = answer(MISSION_COUNT_ID);
        must((payload != NULL) == (type < 3u), "mission, fence, rally points");
        if (payload != NULL) {
            mission_count_decode(&m, payload, MISSION_COUNT_LENGTH);
            must(m.count == 0u && m.mission_type == type && m.target_system == OTHER, "none, of this type, to it");
        }
    }
    for (uint8_t type = 0; type < 3u; type++) {
        SEND(OTHER, MISSION_REQUEST_LIST, mission_request_list, TO_VEHICLE, .mission_type = type);
    }
    unsigned counts = 0;
    uint8_t frame[TC_FRAME_MAX];
    for (size_t n = 1; n != 0u;) {
        clock_us++;
        n = tc_link_transmit(&ln, frame, clock_us);
        counts += n != 0u && frame[7] == MISSION_COUNT_ID && frame[8] == 0u && frame[9] == 0u ? 1u : 0u;
    }
    must(counts == 3u, "asked at once, answered one by one");
    mission_ack_msg refused;
    SEND(OTHER, MISSION_COUNT, mission_count, TO_VEHICLE, .count = 5, .mission_type = 1);
    const uint8_t* payload = answer(MISSION_ACK_ID);
    must(payload != NULL, "a mission is refused");
    mission_ack_decode(&refused, payload, MISSION_ACK_LENGTH);
    must(refused.type == 3u && refused.mission_type == 1u && refused.target_system == OTHER, "as not supported");
}

static sys_status_msg status_now(void) {
    sys_status_msg m;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 1.0f);
    const uint8_t* payload = answer(SYS_STATUS_ID);
    must(payload != NULL, "a status on request");
    sys_status_decode(&m, payload, SYS_STATUS_LENGTH);
    return m;
}

static uint8_t landed_now(uint8_t state) {
    extended_sys_state_msg m;
    controller.mission.state = state;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 245.0f);
    const uint8_t* payload = answer(EXTENDED_SYS_STATE_ID);
    extended_sys_state_decode(&m, payload, EXTENDED_SYS_STATE_LENGTH);
    return m.landed_state;
}

#define ALL_WELL (0x1u | 0x80u | 0x200000u | 0x10000000u)

static void health(void) {
    standard_begin();
    sys_status_msg m = status_now();
    must(m.onboard_control_sensors_health == ALL_WELL, "all is well");
    must(m.voltage_battery == UINT16_MAX, "no battery is measured");
    controller.telemetry.estimate_faults = TC_FAULT_POSITION_STALE;
    must(status_now().onboard_control_sensors_health == (0x1u | 0x200000u), "no position: no arming");
    controller.telemetry.estimate_faults = TC_FAULT_ATTITUDE_UNUSABLE;
    must(status_now().onboard_control_sensors_health == (0x1u | 0x80u), "no attitude");
    controller.telemetry.estimate_faults = TC_FAULT_RATE_STALE;
    must((status_now().onboard_control_sensors_health & 0x1u) == 0u, "no gyro");
    controller.telemetry.estimate_faults = 0;
    controller.telemetry.estimate.battery_v = 15.5f;
    controller.telemetry.estimate.valid |= TC_VALID_SPECIFIC_FORCE;
    m = status_now();
    must(m.voltage_battery == 15500u && (m.onboard_control_sensors_health & 0x2000002u) == 0x2000002u, "as measured");
    controller.telemetry.warnings = TC_WARNING_BATTERY;
    must((status_now().onboard_control_sensors_health & 0x2000000u) == 0u, "low");
    controller.telemetry.estimate.battery_v = 70.0f;
    must(status_now().voltage_battery == UINT16_MAX, "beyond what 16 bits hold");
    controller.telemetry.ticks = 0;
    must(status_now().onboard_control_sensors_health == 0u, "before the first tick nothing is known");
    standard_begin();
    static const struct {
        uint8_t landed, main, sub;
    } shown[TC_MISSION_STATE_COUNT] = {
        [TC_DISARMED] = {1, 4, 3}, [TC_ARMED] = {1, 4, 3},      [TC_TAKE_OFF] = {3, 4, 2}, [TC_HOLD] = {2, 4, 3},
        [TC_APPROACH] = {2, 4, 4}, [TC_TRAJECTORY] = {2, 4, 4}, [TC_PAUSING] = {2, 4, 3},  [TC_PAUSED] = {2, 4, 3},
        [TC_STOPPING] = {2, 4, 3}, [TC_ABORTING] = {2, 4, 6},   [TC_LANDING] = {4, 4, 6},  [TC_EMERGENCY] = {4, 4, 6},
        [TC_FAULT] = {0, 4, 3},    [TC_SHADOW] = {0, 1, 0}};
    for (uint8_t state = 0; state < TC_MISSION_STATE_COUNT; state++) {
        must(landed_now(state) == shown[state].landed, "landed state");
        must(mode_shown() == px4_mode(shown[state].main, shown[state].sub), "mode");
    }
}

static void heights(void) {
    standard_hovering();
    altitude_msg m;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 141.0f);
    const uint8_t* payload = answer(ALTITUDE_ID);
    must(payload != NULL, "a height on request");
    ln.home_world_m[2] = -3.0f;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 141.0f);
    altitude_decode(&m, answer(ALTITUDE_ID), ALTITUDE_LENGTH);
    must(fabsf(m.altitude_local - 1.0f) < 0.01f, "world z");
    must(fabsf(m.altitude_relative - 4.0f) < 0.01f && fabsf(m.altitude_amsl - 4.0f) < 0.01f, "above where it stood");
}

void presentation_cases(void) {
    parameters();
    missions();
    health();
    heights();
}
