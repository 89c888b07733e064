/* PX4's topics to the controller's estimate, and its output back. NED and FRD on one side, world z up and body x
   forward y left z up on the other: y and z change their signs, for vectors, rates and the quaternion alike. No state
   but the reset counters; no publication; so this file is tested by itself. */
#pragma once

#include <stdint.h>
#include <uORB/topics/actuator_motors.h>
#include <uORB/topics/battery_status.h>
#include <uORB/topics/esc_status.h>
#include <uORB/topics/trajectory_setpoint.h>
#include <uORB/topics/vehicle_acceleration.h>
#include <uORB/topics/vehicle_angular_velocity.h>
#include <uORB/topics/vehicle_attitude.h>
#include <uORB/topics/vehicle_local_position.h>
#include <uORB/topics/vehicle_thrust_setpoint.h>
#include <uORB/topics/vehicle_torque_setpoint.h>

#include "goshawk_controller/goshawk_controller.h"

namespace goshawk {

/* PX4's motor (0 .. 11, "Motor 1" is 0) of each of the controller's rotors. This is PX4's quadrotor X with the
   controller's default geometry: rotors front left, rear left, rear right, front right. */
static constexpr int MOTOR_OF_ROTOR[TC_ROTORS] = {2, 1, 3, 0};

/* Folds PX4's five reset counters into the one of tc_estimate. */
class Resets {
  public:
    void take(const vehicle_local_position_s& position, tc_estimate& estimate);

  private:
    bool _known{false};
    uint8_t _last[5]{}; /* xy, z, vxy, vz, heading */
    uint8_t _counter{0};
    float _position_world_m[3]{};
    float _velocity_world_m_s[3]{};
    float _yaw_rad{0.0f};
};

/* Each fills its part of the estimate, and the bits of `valid` that hold. */
void take_position(const vehicle_local_position_s& from, tc_estimate& estimate);
void take_attitude(const vehicle_attitude_s& from, tc_estimate& estimate);
void take_rate(const vehicle_angular_velocity_s& from, tc_estimate& estimate);
void take_acceleration(const vehicle_acceleration_s& from, tc_estimate& estimate); /* after take_rate */
void take_battery(const battery_status_s& from, tc_estimate& estimate);

/* Rotor speeds as the ESCs report them; false when one of the four does not (or not for 100 ms). */
bool rotor_speeds(const esc_status_s& from, uint64_t now_us, float rotor_speed_rad_s[TC_ROTORS]);
/* ... or what they must be under these outputs. */
void rotor_speeds(const actuator_motors_s& from, float full_rad_s, float rotor_speed_rad_s[TC_ROTORS]);

/* All 12 outputs: normalised thrust, NaN stops. */
void fill_motors(const tc_output& output, float full_rad_s, actuator_motors_s& motors);
void fill_thrust(const actuator_motors_s& motors, vehicle_thrust_setpoint_s& thrust);
void fill_torque(const tc_controller& controller, float full_rad_s, vehicle_torque_setpoint_s& torque);
/* `descend_m_s` > 0 asks for a descent whatever the set-point says: PX4's land detector must see one to find ground. */
void fill_setpoint(const tc_setpoint& from, float descend_m_s, trajectory_setpoint_s& setpoint);

}  // namespace goshawk
