// The catalogue's effects; each is the twin of vehicle/effects/<name>.py, where sources and units are.
#pragma once

#include "state.hpp"

namespace goshawk {
namespace effects {

// ---- mass -----------------------------------------------------------------------------------------------------

template <class T>
void centre_of_mass(Body<T>& body, const T* p) {
  body.centre[0] += p[0];
  body.centre[1] += p[1];
}

// ---- drive ----------------------------------------------------------------------------------------------------

template <class T>
void motor_lag(Drive<T>& drive, const T* p) {
  drive.follows_at_once = false;
  for (int i = 0; i < 4; ++i) {
    const T error = drive.command[i] - drive.speed[i];
    drive.acceleration[i] = error / (real(error) > 0.0 ? p[0] : p[1]);
  }
}

// ---- thrust ---------------------------------------------------------------------------------------------------

template <class T>
T induced_velocity(const T& n, const T& axial, const T& lateral_squared, const T& k1, const T& k2,
                   const T& two_rho_area) {
  const T b = two_rho_area * axial - k2 * n;
  const T c = k1 * n * n + k2 * n * axial;
  T induced = (sqrt(b * b + 4.0 * two_rho_area * c) - b) / (2.0 * two_rho_area);  // exact when v_xy = 0
  for (int step = 0; step < 7; ++step) {
    const T through = axial + induced;
    const T speed = sqrt(through * through + lateral_squared + 1e-12);
    const T defect = two_rho_area * induced * speed - c - k2 * n * induced;
    const T change = defect / (two_rho_area * (speed + induced * through / speed) - k2 * n + 1e-12);
    induced -= change;
    // Newton squares the error, in the value and one step later in the derivative
    if (magnitude(real(change)) < 1e-10) break;
  }
  return induced;
}

template <class T>
void thrust_bem(Flow<T>& flow, const T* p) {
  const T two_rho_area = 2.0 * kPi * flow.air_density * flow.radius * flow.radius;
  for (int i = 0; i < 4; ++i) {
    T a[3];
    flow.hub_velocity(i, a);
    const T& n = flow.rotor_speed[i];
    const T induced = induced_velocity(n, a[2], T(a[0] * a[0] + a[1] * a[1]), p[0], p[1], two_rho_area);
    flow.thrust[i] += p[0] * n * n + p[1] * n * (a[2] + induced);
  }
}

template <class T>
void thrust_quadratic(Flow<T>& flow, const T* p) {
  for (int i = 0; i < 4; ++i) flow.thrust[i] += p[0] * flow.rotor_speed[i] * flow.rotor_speed[i];
}

// ---- force and torque -----------------------------------------------------------------------------------------

template <class T>
T total_thrust(const Flow<T>& flow) {
  return flow.thrust[0] + flow.thrust[1] + flow.thrust[2] + flow.thrust[3];
}

template <class T>
void rotor_drag_thrust(Flow<T>& flow, const T* p) {
  const T factor = p[0] * total_thrust(flow);
  flow.force[0] -= factor * flow.velocity[0];
  flow.force[1] -= factor * flow.velocity[1];
}

template <class T>
void rotor_drag_speed(Flow<T>& flow, const T* p) {
  for (int i = 0; i < 4; ++i) {
    T a[3];
    flow.hub_velocity(i, a);
    const T factor = p[0] * flow.rotor_speed[i];
    flow.hub_force[i][0] -= factor * a[0];
    flow.hub_force[i][1] -= factor * a[1];
  }
}

template <class T>
void parasitic_drag(Flow<T>& flow, const T* p) {
  const T* v = flow.velocity;
  flow.force[0] -= p[0] * magnitude(v[0]) * v[0];
  flow.force[1] -= p[0] * magnitude(v[1]) * v[1];
  flow.force[2] -= p[1] * magnitude(v[2]) * v[2];
}

template <class T>
void rotor_yaw_torque(Flow<T>& flow, const T* p) {
  for (int i = 0; i < 4; ++i) {
    flow.torque[2] -= p[0] * flow.spin[i] * flow.rotor_speed[i] * flow.rotor_speed[i];
  }
}

}  // namespace effects
}  // namespace goshawk
