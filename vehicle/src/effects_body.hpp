// Effects on mass, motors, air, force and torque; each is the compiled form of vehicle/effects/<room>/<name>.py.
#pragma once

#include "effects_thrust.hpp"

namespace goshawk {
namespace effects {

// ---- mass -----------------------------------------------------------------------------------------------------

template <class T>
void centre_of_mass(Body<T>& body, const T* p) {
    body.centre[0] += p[0];
    body.centre[1] += p[1];
}

template <class T>
void centre_of_mass_height(Body<T>& body, const T* p) {
    body.centre[2] += p[0];
}

template <class T>
void payload(Body<T>& body, const T* p) {
    const T total = body.mass + p[0];
    const T reduced = body.mass * p[0] / total;
    T arm[3];
    for (int i = 0; i < 3; ++i) arm[i] = p[1 + i] - body.centre[i];
    const T square = arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2];
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) body.inertia[i][j] += reduced * ((i == j ? square : T(0.0)) - arm[i] * arm[j]);
        body.centre[i] += arm[i] * (p[0] / total);
    }
    body.mass = total;
}

template <class T>
void products_of_inertia(Body<T>& body, const T* p) {
    body.inertia[0][1] += p[0];
    body.inertia[1][0] += p[0];
    body.inertia[0][2] += p[1];
    body.inertia[2][0] += p[1];
    body.inertia[1][2] += p[2];
    body.inertia[2][1] += p[2];
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

template <class T>
void battery_sag(Drive<T>& drive, const T* p) {
    for (int i = 0; i < 4; ++i) drive.command[i] *= 1.0 - p[0] * (p[1] - drive.battery_v);
}

// ---- air ------------------------------------------------------------------------------------------------------

template <class T>
void constant_wind(Flow<T>& flow, const T* p) {
    const T* q = flow.q;
    // wind in body axes: rotation by the conjugate
    const T t[3] = {2.0 * (q[3] * p[1] - q[2] * p[2]), 2.0 * (q[1] * p[2] - q[3] * p[0]),
                    2.0 * (q[2] * p[0] - q[1] * p[1])};
    flow.velocity[0] -= p[0] + q[0] * t[0] + q[3] * t[1] - q[2] * t[2];
    flow.velocity[1] -= p[1] + q[0] * t[1] + q[1] * t[2] - q[3] * t[0];
    flow.velocity[2] -= p[2] + q[0] * t[2] + q[2] * t[0] - q[1] * t[1];
}

// ---- force and torque -----------------------------------------------------------------------------------------

template <class T>
void rotor_drag_thrust(Flow<T>& flow, const T* p) {
    const T factor = p[0] * (flow.thrust[0] + flow.thrust[1] + flow.thrust[2] + flow.thrust[3]);
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
void parasitic_drag_linear(Flow<T>& flow, const T* p) {
    for (int k = 0; k < 3; ++k) flow.force[k] -= p[k] * flow.velocity[k];
}

template <class T>
T speed_of(const Flow<T>& flow) {
    const T* v = flow.velocity;
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

template <class T>
void parasitic_drag_speed(Flow<T>& flow, const T* p) {
    const T speed = speed_of(flow);
    for (int k = 0; k < 3; ++k) flow.force[k] -= p[k] * speed * flow.velocity[k];
}

template <class T>
void flapping_moment(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        flow.torque[0] -= p[0] * flow.rotor_speed[i] * a[1];
        flow.torque[1] += p[0] * flow.rotor_speed[i] * a[0];
    }
}

template <class T>
void wake_skew_moment(Flow<T>& flow, const T* p) {
    const T one[4] = {1.0, 1.0, 1.0, 1.0}, none[4] = {0.0, 0.0, 0.0, 0.0};
    T axial[4], edgewise_squared[4], thrust[4], induced[4];
    hub_flow(flow, axial, edgewise_squared);
    for (int i = 0; i < 4; ++i) thrust[i] = real(flow.thrust[i]) > 0.0 ? flow.thrust[i] : T(0.0);
    induced_velocities(one, axial, edgewise_squared, thrust, none, two_rho_area(flow), induced);
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        const T through = axial[i] + induced[i];
        const T strength = flow.rotor_speed[i] * induced[i] / sqrt(edgewise_squared[i] + through * through + 1e-12);
        flow.torque[0] += p[0] * strength * a[1];
        flow.torque[1] -= p[1] * strength * a[0];
    }
}

template <class T>
void airframe_side_moment(Flow<T>& flow, const T* p) {
    const T* v = flow.velocity;
    const T speed = speed_of(flow);
    flow.torque[0] -= speed * (p[1] * v[2] - p[2] * v[1]);
    flow.torque[1] -= speed * (p[2] * v[0] - p[0] * v[2]);
    flow.torque[2] -= speed * (p[0] * v[1] - p[1] * v[0]);
}

template <class T>
void rotor_yaw_torque(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) {
        flow.torque[2] -= p[0] * flow.spin[i] * flow.rotor_speed[i] * flow.rotor_speed[i];
    }
}

template <class T>
void torque_affine(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) flow.torque[2] -= p[0] * flow.spin[i] * flow.rotor_speed[i];
}

template <class T>
void uneven_rotor_torque(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) {
        flow.torque[2] -= p[i] * flow.spin[i] * flow.rotor_speed[i] * flow.rotor_speed[i];
    }
}

template <class T>
void gyroscopic_torque(Flow<T>& flow, const T* p) {
    T momentum(0.0);
    for (int i = 0; i < 4; ++i) momentum += flow.spin[i] * flow.rotor_speed[i];
    momentum *= p[0];
    flow.torque[0] -= flow.rate[1] * momentum;
    flow.torque[1] += flow.rate[0] * momentum;
}

template <class T>
void rotor_acceleration_torque(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) flow.torque[2] -= p[0] * flow.spin[i] * flow.rotor_acceleration[i];
}

template <class T>
void angular_damping(Flow<T>& flow, const T* p) {
    for (int k = 0; k < 3; ++k) flow.torque[k] -= p[k] * flow.rate[k];
}

template <class T>
void angular_damping_quadratic(Flow<T>& flow, const T* p) {
    for (int k = 0; k < 3; ++k) flow.torque[k] -= p[k] * magnitude(flow.rate[k]) * flow.rate[k];
}

}  // namespace effects
}  // namespace goshawk
