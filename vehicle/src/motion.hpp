// Rigid-body motion of one vehicle: derivative of the state, and fixed-step Runge-Kutta of fourth order.
#pragma once

#include <cmath>

#include "model.hpp"

namespace goshawk {

// Row of a state: position world 0-2, velocity world 3-5, q_world_body 6-9, rate body 10-12, rotor speed 13-16.
constexpr int kState = 17;

struct World {
    double wind[3];
    double gravity;
    double ground;   // height of the floor, -inf for none
    double ceiling;  // height of the ceiling, +inf for none
};

struct Derivative {
    double state[kState];
    double specific_force[3];  // body axes, at the centre of mass
    double rotor_power;        // watts the air takes from the rotors' yaw torque; for the battery
};

inline void rotate(const double q[4], const double v[3], double out[3]) {
    const double t[3] = {2.0 * (q[2] * v[2] - q[3] * v[1]), 2.0 * (q[3] * v[0] - q[1] * v[2]),
                         2.0 * (q[1] * v[1] - q[2] * v[0])};
    out[0] = v[0] + q[0] * t[0] + q[2] * t[2] - q[3] * t[1];
    out[1] = v[1] + q[0] * t[1] + q[3] * t[0] - q[1] * t[2];
    out[2] = v[2] + q[0] * t[2] + q[1] * t[1] - q[2] * t[0];
}

// Solves I x = b for a symmetric 3 x 3 matrix by cofactors.
template <class T>
void solve3(const T I[3][3], const T b[3], T x[3]) {
    const T c00 = I[1][1] * I[2][2] - I[1][2] * I[1][2], c01 = I[0][2] * I[1][2] - I[0][1] * I[2][2];
    const T c02 = I[0][1] * I[1][2] - I[0][2] * I[1][1], c11 = I[0][0] * I[2][2] - I[0][2] * I[0][2];
    const T c12 = I[0][1] * I[0][2] - I[0][0] * I[1][2], c22 = I[0][0] * I[1][1] - I[0][1] * I[0][1];
    const T inverse = 1.0 / (I[0][0] * c00 + I[0][1] * c01 + I[0][2] * c02);
    x[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) * inverse;
    x[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) * inverse;
    x[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) * inverse;
}

// Euler's equation: I dw/dt = torque - w x I w.
template <class T>
void angular_acceleration(const Body<T>& body, const T w[3], const T torque[3], T out[3]) {
    T L[3], b[3];
    for (int k = 0; k < 3; ++k)
        L[k] = body.inertia[k][0] * w[0] + body.inertia[k][1] * w[1] + body.inertia[k][2] * w[2];
    b[0] = torque[0] - (w[1] * L[2] - w[2] * L[1]);
    b[1] = torque[1] - (w[2] * L[0] - w[0] * L[2]);
    b[2] = torque[2] - (w[0] * L[1] - w[1] * L[0]);
    solve3(body.inertia, b, out);
}

inline void derive(const Model& model, const double* values, const Body<double>& body, const World& world,
                   const double* command, double battery_v, const double* x, Derivative& out) {
    const double* q = x + 6;
    const double* w = x + 10;
    const double back[4] = {q[0], -q[1], -q[2], -q[3]};
    const double relative[3] = {x[3] - world.wind[0], x[4] - world.wind[1], x[5] - world.wind[2]};

    Drive<double> d{};
    d.battery_v = battery_v;
    for (int i = 0; i < 4; ++i) {
        d.command[i] = command[i];
        d.speed[i] = x[13 + i];
    }
    const bool lagging = drive(model, values, d);

    Flow<double> flow{};
    rotate(back, relative, flow.velocity);
    for (int k = 0; k < 3; ++k) flow.rate[k] = w[k];
    for (int i = 0; i < 4; ++i) {
        flow.q[i] = q[i];
        flow.rotor_speed[i] = lagging ? x[13 + i] : d.command[i];
        flow.rotor_acceleration[i] = lagging ? d.acceleration[i] : 0.0;
    }
    flow.height = x[2] - world.ground;
    flow.ceiling_gap = world.ceiling - x[2];
    wrench(model, values, body, flow);

    double acceleration[3];
    for (int k = 0; k < 3; ++k) out.specific_force[k] = flow.force[k] / body.mass;
    rotate(q, out.specific_force, acceleration);
    acceleration[2] -= world.gravity;
    for (int k = 0; k < 3; ++k) {
        out.state[k] = x[3 + k];
        out.state[3 + k] = acceleration[k];
    }
    out.state[6] = 0.5 * (-q[1] * w[0] - q[2] * w[1] - q[3] * w[2]);
    out.state[7] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]);
    out.state[8] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]);
    out.state[9] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
    angular_acceleration(body, w, flow.torque, out.state + 10);
    for (int i = 0; i < 4; ++i) out.state[13 + i] = lagging ? d.acceleration[i] : 0.0;
    out.rotor_power = 0.0;
    for (int i = 0; i < 4; ++i) {
        // momentum theory: lifting takes at least thrust times the air's speed through the disk
        const double disk = kPi * flow.radius * flow.radius * flow.air_density;
        const double thrust = flow.thrust[i] > 0.0 ? flow.thrust[i] : 0.0;
        out.rotor_power += disk > 0.0 ? thrust * std::sqrt(thrust / (2.0 * disk)) : 0.0;
    }
}

inline void after(const double* x, const Derivative& k, double step, double* out) {
    for (int i = 0; i < kState; ++i) out[i] = x[i] + step * k.state[i];
}

// A vehicle on the floor does not sink, slide or turn until the rotors lift it off.
inline void rest_on_ground(const World& world, const double* before, double* x) {
    if (x[2] > world.ground || x[5] > 0.0) return;
    for (int k = 0; k < 10; ++k) x[k] = before[k];
    x[2] = world.ground;
    for (int k = 3; k < 6; ++k) x[k] = 0.0;
    for (int k = 10; k < 13; ++k) x[k] = 0.0;
}

// One step of Runge-Kutta of fourth order; `first` and `last` are the derivatives at its beginning and its end.
inline void runge_kutta(const Model& model, const double* values, const Body<double>& body, const World& world,
                        const double* command, double battery_v, double step, double* x, Derivative& first,
                        Derivative& last) {
    double trial[kState];
    Derivative k2, k3;
    derive(model, values, body, world, command, battery_v, x, first);
    after(x, first, 0.5 * step, trial);
    derive(model, values, body, world, command, battery_v, trial, k2);
    after(x, k2, 0.5 * step, trial);
    derive(model, values, body, world, command, battery_v, trial, k3);
    after(x, k3, step, trial);
    derive(model, values, body, world, command, battery_v, trial, last);
    for (int i = 0; i < kState; ++i) {
        x[i] += step / 6.0 * (first.state[i] + 2.0 * k2.state[i] + 2.0 * k3.state[i] + last.state[i]);
    }
    const double norm = std::sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9]);
    for (int i = 6; i < 10; ++i) x[i] /= norm;
}

// Advances one state by `steps` steps; returns the mechanical rotor energy in joules. `specific_force` is that of the
// end.
inline double integrate(const Model& model, const double* values, const World& world, const double* command,
                        double battery_v, int steps, double step, double* x, double specific_force[3]) {
    const Body<double> body = rigid_body(model, values);
    double energy = 0.0, before[kState];
    Derivative k1, k4;
    for (int s = 0; s < steps; ++s) {
        for (int i = 0; i < kState; ++i) before[i] = x[i];
        runge_kutta(model, values, body, world, command, battery_v, step, x, k1, k4);
        rest_on_ground(world, before, x);
        energy += step * k1.rotor_power;
    }
    Drive<double> d{};
    d.battery_v = battery_v;
    for (int i = 0; i < 4; ++i) {
        d.command[i] = command[i];
        d.speed[i] = x[13 + i];
    }
    if (!drive(model, values, d)) {
        for (int i = 0; i < 4; ++i) x[13 + i] = d.command[i];
    }
    derive(model, values, body, world, command, battery_v, x, k1);
    for (int i = 0; i < 3; ++i) specific_force[i] = k1.specific_force[i];
    if (x[2] <= world.ground && k1.state[5] <= 0.0) {  // the floor carries the rest of the weight
        const double back[4] = {x[6], -x[7], -x[8], -x[9]};
        const double up[3] = {0.0, 0.0, world.gravity};
        rotate(back, up, specific_force);
    }
    return energy;
}

}  // namespace goshawk
