/* How the vehicle presents itself to standard ground stations: as which autopilot, in which mode, how it is, where it
   stands, how high it is. docs/how-to/standard_stations.md says what the identity promises. */
#include <math.h>

#include "../../base/maths.h"
#include "services.h"

/* MAV_SYS_STATUS_SENSOR, bits */
static const uint32_t SENSOR_GYRO = 0x1u;
static const uint32_t SENSOR_ACCELEROMETER = 0x2u;
static const uint32_t SENSOR_POSITION = 0x80u; /* by vision: what stations read as "there is a local position" */
static const uint32_t SENSOR_ATTITUDE = 0x200000u;
static const uint32_t SENSOR_BATTERY = 0x2000000u;
static const uint32_t SENSOR_ARMING_CHECK = 0x10000000u;

enum { LANDED_UNKNOWN = 0, LANDED_ON_GROUND = 1, LANDED_IN_AIR = 2, LANDED_TAKING_OFF = 3, LANDED_LANDING = 4 };

enum { AUTOPILOT_GENERIC = 0, AUTOPILOT_PX4 = 12 }; /* MAV_AUTOPILOT */
enum { TYPE_QUADROTOR = 2 };                        /* MAV_TYPE */
static const uint32_t MODE_GUIDED = 8u;
static const uint32_t MODE_ARMED = 128u;
enum { STATE_STANDBY = 3, STATE_ACTIVE = 4, STATE_EMERGENCY = 6 }; /* MAV_STATE */
/* float parameters, COMMAND_INT, termination, MAVLink 2 */
static const uint32_t CAPABILITIES = 2u + 8u + 2048u + 8192u;
static const uint32_t SOFTWARE_VERSION = 0x00010000u; /* 0.1.0, a byte each, as MAVLink packs it */
static const uint16_t MAVLINK_2 = 200u;               /* as PROTOCOL_VERSION states version 2.00 */

/* -- identity --------------------------------------------------------------------------------------------------- */

static uint32_t px4_mode(uint32_t main, uint32_t sub) { return (main << 16) | (sub << 24); }

/* Slowing down to hold is Hold, and to land is Land, as that is what was asked for. On the ground it is Hold, too, or
   Take-off while a take-off waits for arming: QGroundControl asks for the one, then for the other. */
static uint32_t mode_shown(const tc_link* link) {
    switch (link->controller->mission.state) {
        case TC_TAKE_OFF:
            return px4_mode(PX4_AUTO, AUTO_TAKE_OFF);
        case TC_APPROACH:
        case TC_TRAJECTORY:
            return px4_mode(PX4_AUTO, AUTO_MISSION);
        case TC_ABORTING:
        case TC_LANDING:
        case TC_EMERGENCY:
            return px4_mode(PX4_AUTO, AUTO_LAND);
        case TC_SHADOW:
            return px4_mode(PX4_MANUAL, 0u);
        default:
            return px4_mode(PX4_AUTO, link->standard.take_off.waits ? (uint32_t)AUTO_TAKE_OFF : (uint32_t)AUTO_HOLD);
    }
}

static uint8_t system_status(uint8_t state) {
    if (state == (uint8_t)TC_EMERGENCY || state == (uint8_t)TC_FAULT) {
        return STATE_EMERGENCY;
    }
    return tc_mission_in_air(state) ? STATE_ACTIVE : STATE_STANDBY;
}

link_encoded link_encode_heartbeat(tc_link* link, uint8_t* payload) {
    const uint8_t state = link->controller->mission.state;
    const bool generic = link->config->identity == TC_IDENTITY_GENERIC;
    const unsigned armed = tc_mission_rotors_on(state) ? MODE_ARMED : 0u;
    const heartbeat_msg m = {.custom_mode = generic ? state : mode_shown(link),
                             .type = TYPE_QUADROTOR,
                             .autopilot = generic ? AUTOPILOT_GENERIC : AUTOPILOT_PX4,
                             .base_mode = (uint8_t)(MODE_CUSTOM | MODE_GUIDED | armed),
                             .system_status = system_status(state),
                             .mavlink_version = 3};
    heartbeat_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_version(tc_link* link, uint8_t* payload) {
    const autopilot_version_msg m = {
        .capabilities = CAPABILITIES, .flight_sw_version = SOFTWARE_VERSION, .uid = link->config->system_id};
    autopilot_version_encode(&m, payload);
    return LINK_ENCODED;
}

link_encoded link_encode_protocol(tc_link* link, uint8_t* payload) {
    const protocol_version_msg m = {.version = MAVLINK_2, .min_version = MAVLINK_2, .max_version = MAVLINK_2};
    (void)link;
    protocol_version_encode(&m, payload);
    return LINK_ENCODED;
}

/* -- how the vehicle is ----------------------------------------------------------------------------------------- */

link_encoded link_encode_sys_status(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    const tc_estimate* e = &t->estimate;
    const unsigned faults = t->estimate_faults;
    uint32_t present = SENSOR_GYRO | SENSOR_POSITION | SENSOR_ATTITUDE | SENSOR_ARMING_CHECK;
    uint32_t health = 0;
    sys_status_msg m = {.voltage_battery = link_battery_mv(link), .current_battery = -1, .battery_remaining = -1};
    if ((faults & (unsigned)(TC_FAULT_RATE_STALE | TC_FAULT_RATE_UNUSABLE)) == 0u) {
        health |= SENSOR_GYRO;
    }
    if ((faults & (unsigned)(TC_FAULT_ATTITUDE_STALE | TC_FAULT_ATTITUDE_UNUSABLE)) == 0u) {
        health |= SENSOR_ATTITUDE;
    }
    if ((faults & (unsigned)(TC_FAULT_POSITION_STALE | TC_FAULT_POSITION_UNUSABLE)) == 0u) {
        health |= SENSOR_POSITION;
    }
    if ((e->valid & (unsigned)TC_VALID_SPECIFIC_FORCE) != 0u) {
        present |= SENSOR_ACCELEROMETER;
        health |= SENSOR_ACCELEROMETER;
    }
    if (m.voltage_battery != UINT16_MAX) {
        present |= SENSOR_BATTERY;
        health |= (t->warnings & (unsigned)TC_WARNING_BATTERY) == 0u ? SENSOR_BATTERY : 0u;
    }
    if (t->ticks == 0u) {
        health = 0u; /* nothing was ever received from the estimator */
    }
    if (tc_arming_check(link->controller) == TC_OK) {
        health |= SENSOR_ARMING_CHECK;
    }
    m.onboard_control_sensors_present = present;
    m.onboard_control_sensors_enabled = present;
    m.onboard_control_sensors_health = health;
    sys_status_encode(&m, payload);
    return LINK_ENCODED;
}

/* After a fault, and while another controller flies, nobody here knows. */
static uint8_t landed_state(uint8_t state) {
    switch (state) {
        case TC_DISARMED:
        case TC_ARMED:
            return LANDED_ON_GROUND;
        case TC_TAKE_OFF:
            return LANDED_TAKING_OFF;
        case TC_LANDING:
        case TC_EMERGENCY:
            return LANDED_LANDING;
        case TC_FAULT:
        case TC_SHADOW:
            return LANDED_UNKNOWN;
        default:
            return LANDED_IN_AIR;
    }
}

link_encoded link_encode_extended_state(tc_link* link, uint8_t* payload) {
    const extended_sys_state_msg m = {.landed_state = landed_state(link->controller->mission.state)};
    extended_sys_state_encode(&m, payload);
    return LINK_ENCODED;
}

/* Heights count from where the vehicle last stood. That of the sea is not known; stations that add the height of a
   take-off to the present "sea level" height, as QGroundControl does, so ask for what their user meant. */
link_encoded link_encode_altitude(tc_link* link, uint8_t* payload) {
    const tc_telemetry* t = &link->controller->telemetry;
    const float z_m = t->estimate.position_world_m[2];
    const float height_m = z_m - link->home_world_m[2];
    const altitude_msg m = {.time_usec = t->time_us,
                            .altitude_monotonic = z_m,
                            .altitude_amsl = height_m,
                            .altitude_local = z_m,
                            .altitude_relative = height_m,
                            .altitude_terrain = NAN,
                            .bottom_clearance = NAN};
    altitude_encode(&m, payload);
    return LINK_ENCODED;
}
