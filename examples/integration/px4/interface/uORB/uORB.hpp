#pragma once
#include <drivers/drv_hrt.h>
#include <stdint.h>
#include <string.h>

namespace uORB {
enum class Topic {
    actuator_motors,
    arming_check_reply,
    arming_check_request,
    battery_status,
    config_control_setpoints,
    esc_status,
    parameter_update,
    register_ext_component_reply,
    register_ext_component_request,
    trajectory_setpoint,
    unregister_ext_component,
    vehicle_acceleration,
    vehicle_angular_velocity,
    vehicle_attitude,
    vehicle_command,
    vehicle_land_detected,
    vehicle_local_position,
    vehicle_status,
    vehicle_thrust_setpoint,
    vehicle_torque_setpoint,
    COUNT
};

/* The newest message of each topic. */
struct Slot {
    unsigned generation;
    size_t bytes;
    alignas(8) uint8_t data[1024];
};
inline Slot& slot(Topic topic) {
    static Slot slots[static_cast<int>(Topic::COUNT)];
    return slots[static_cast<int>(topic)];
}
}  // namespace uORB

#define ORB_ID(name) uORB::Topic::name
