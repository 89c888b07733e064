// Flatness of one instant: from five neighbouring points of the path to attitude, rates, torque and rotor speeds.
// The NumPy reference of the same iteration is in vehicle/flatness.py.
#pragma once

#include <cmath>

#include "motion.hpp"
#include "portable.hpp"

namespace goshawk {

struct PathPoint {
    double velocity[3], acceleration[3], height, yaw;
};

struct Flat {
    double q[4], rate[3], turn[3], thrust, torque[3], rotor_speed[4];
};

// Half of a heading.
struct HalfTurn {
    double c, s;
    explicit HalfTurn(double yaw) {
        const SineCosine both = sine_cosine(0.5 * yaw);
        c = both.cosine;
        s = both.sine;
    }
};

// Body z along `axis` (any length), turned by yaw before tilting the shortest way.
inline void hopf(const double axis[3], const HalfTurn& yaw, double q[4]) {
    const double size = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    const double x = axis[0] / size, y = axis[1] / size, z = axis[2] / size;
    const double up = 1.0 + z > 1e-15 ? 1.0 + z : 1e-15;
    const double scale = 1.0 / std::sqrt(2.0 * up);
    const double w = (1.0 + z) * scale, a = -y * scale, b = x * scale;
    q[0] = w * yaw.c;
    q[1] = a * yaw.c + b * yaw.s;
    q[2] = b * yaw.c - a * yaw.s;
    q[3] = w * yaw.s;
}

struct Alignment {
    const Model& model;
    const double* values;
    const Body<double>& body;
    double gravity;

    void required_force(const PathPoint& p, double f[3]) const {
        for (int k = 0; k < 3; ++k) f[k] = body.mass * (p.acceleration[k] + (k == 2 ? gravity : 0.0));
    }

    void air(const PathPoint& p, const double q[4], const double rate[3], Flow<double>& flow) const {
        const double back[4] = {q[0], -q[1], -q[2], -q[3]};
        double v[3];
        rotate(back, p.velocity, v);
        for (int k = 0; k < 3; ++k) {
            flow.velocity[k] = v[k];
            flow.rate[k] = rate[k];
        }
        for (int k = 0; k < 4; ++k) {
            flow.q[k] = q[k];
            flow.rotor_acceleration[k] = 0.0;
        }
        flow.height = p.height;
        flow.ceiling_gap = INFINITY;
    }

    // Aligns thrust with the required force less drag at the old attitude. With drag -c v the axis is required + c v
    // whatever the attitude (Faessler et al. 2018); only what is not of that form has to be iterated. Returns the
    // thrust along the new axis; `force_z` is the model's at the old attitude.
    double line_up(const PathPoint& p, const HalfTurn& yaw, const double rate[3], const double n[4], double q[4],
                   double& force_z) const {
        Flow<double> flow{};
        air(p, q, rate, flow);
        for (int i = 0; i < 4; ++i) flow.rotor_speed[i] = n[i];
        const double vx = flow.velocity[0], vy = flow.velocity[1];
        wrench(model, values, body, flow);
        const double square = vx * vx + vy * vy;
        const double c = square > 1e-6 ? -(flow.force[0] * vx + flow.force[1] * vy) / square : 0.0;
        const double rest[3] = {flow.force[0] + c * vx, flow.force[1] + c * vy, 0.0};
        double required[3], turned[3], axis[3];
        required_force(p, required);
        rotate(q, rest, turned);
        for (int k = 0; k < 3; ++k) axis[k] = required[k] - turned[k] + c * p.velocity[k];
        hopf(axis, yaw, q);
        force_z = flow.force[2];
        const double size = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
        return (required[0] * axis[0] + required[1] * axis[1] + required[2] * axis[2]) / size;
    }

    // Attitude and rotor speeds (their proportions kept) that give the path's acceleration.
    void attitude(const PathPoint& p, const double rate[3], double tolerance, double n[4], double q[4]) const {
        const HalfTurn yaw(p.yaw);
        double power = 0.5, last = 0.0, last_log = 0.0;
        for (int step = 0; step < 60; ++step) {
            const double before[4] = {q[0], q[1], q[2], q[3]};
            double force_z;
            const double along = line_up(p, yaw, rate, n, q, force_z);
            if (std::fabs(last_log) > 1e-5 && last > 0.0 && force_z > 0.0) {
                const double gain = logarithm(force_z / last) / last_log;  // dlog T / dlog n, about 2
                if (gain > 1.0 && gain < 6.0) power = 1.0 / gain;
            }
            const double log_ratio = power * logarithm(std::fmax(along, 0.0) / std::fmax(force_z, 1e-12));
            last_log = std::fmin(std::fmax(log_ratio, -kLog2), kLog2);
            const double ratio = exponential(last_log);
            double change = std::fabs(ratio - 1.0);
            for (int k = 0; k < 4; ++k) {
                change = std::fmax(change, std::fabs(q[k] - before[k]));
                n[k] *= ratio;
            }
            last = force_z;
            if (change < tolerance) break;
        }
    }
};

// Solves A x = b by Gauss-Jordan with row exchange, b in the fifth column; false when A is singular.
inline bool solve4(double A[4][5], double x[4]) {
    for (int c = 0; c < 4; ++c) {
        int best = c;
        for (int r = c + 1; r < 4; ++r) {
            if (std::fabs(A[r][c]) > std::fabs(A[best][c])) best = r;
        }
        if (!(std::fabs(A[best][c]) > 0.0)) return false;
        for (int k = 0; k < 5; ++k) std::swap(A[c][k], A[best][k]);
        for (int r = 0; r < 4; ++r) {
            if (r == c) continue;
            const double factor = A[r][c] / A[c][c];
            for (int k = c; k < 5; ++k) A[r][k] -= factor * A[c][k];
        }
    }
    for (int i = 0; i < 4; ++i) x[i] = A[i][4] / A[i][i];
    return true;
}

// The flow of a motion with these rotor speeds, before any effect.
template <class T>
Flow<T> turning(const Flow<double>& motion, const double n[4]) {
    Flow<T> flow{};
    for (int k = 0; k < 3; ++k) {
        flow.velocity[k] = motion.velocity[k];
        flow.rate[k] = motion.rate[k];
    }
    for (int k = 0; k < 4; ++k) {
        flow.q[k] = motion.q[k];
        flow.rotor_acceleration[k] = motion.rotor_acceleration[k];
        flow.rotor_speed[k] = n[k];
    }
    flow.height = motion.height;
    flow.ceiling_gap = motion.ceiling_gap;
    return flow;
}

// Newton on force along body z and torque by the four rotor speeds n, which are the start as well; `motion` holds all
// else. False when it does not converge: there are no such speeds.
inline bool invert_rotors(const Model& model, const double* values, const Flow<double>& motion,
                          const double required[4], double n[4]) {
    using Number = Dual<4>;
    const std::vector<Number> numbers(values, values + model.width);
    const Body<Number> body_numbers = rigid_body(model, numbers.data());
    const Body<double> body = rigid_body(model, values);
    double slope[4][4] = {};
    bool near = false;
    for (int step = 0; step < 25; ++step) {
        double A[4][5], move[4], value[4], change = 0.0, largest = 0.0;
        if (near) {
            Flow<double> flow = turning<double>(motion, n);
            wrench(model, values, body, flow);
            for (int r = 0; r < 4; ++r) value[r] = r == 0 ? flow.force[2] : flow.torque[r - 1];
        } else {
            Flow<Number> flow = turning<Number>(motion, n);
            for (int i = 0; i < 4; ++i) flow.rotor_speed[i].d[i] = 1.0;
            wrench(model, numbers.data(), body_numbers, flow);
            for (int r = 0; r < 4; ++r) {
                const Number& f = r == 0 ? flow.force[2] : flow.torque[r - 1];
                value[r] = f.v;
                for (int c = 0; c < 4; ++c) slope[r][c] = f.d[c];
            }
        }
        for (int r = 0; r < 4; ++r) {
            for (int c = 0; c < 4; ++c) A[r][c] = slope[r][c];
            A[r][4] = required[r] - value[r];
        }
        if (!solve4(A, move)) return false;
        for (int i = 0; i < 4; ++i) {
            // an overshoot below zero would find the root -n of n^2: stop at a tenth of the speed
            n[i] = std::fmax(n[i] + move[i], 0.1 * n[i]);
            change = std::fmax(change, std::fabs(move[i]));
            largest = std::fmax(largest, n[i]);
        }
        if (change < 1e-5) return true;  // what is left is a hundredth of it: 1e-10 of some 1,000 rad/s
        near = change < 0.01 * largest;  // so near the slopes hardly change: the last ones do
    }
    return false;
}

inline void flatten(const Model& model, const double* values, double gravity, const double hover[4], double spacing,
                    const PathPoint path[5], Flat& out) {
    static const double first[5] = {1.0 / 12, -8.0 / 12, 0.0, 8.0 / 12, -1.0 / 12};
    static const double second[5] = {-1.0 / 12, 16.0 / 12, -30.0 / 12, 16.0 / 12, -1.0 / 12};
    const Body<double> body = rigid_body(model, values);
    const Alignment l{model, values, body, gravity};
    double q[5][4], n[5][4];
    for (int s = 0; s < 5; ++s) {
        double required[3];
        l.required_force(path[s], required);
        hopf(required, HalfTurn(path[s].yaw), q[s]);
        for (int i = 0; i < 4; ++i) n[s][i] = hover[i];
    }
    for (int k = 0; k < 3; ++k) out.rate[k] = out.turn[k] = 0.0;
    for (int round = 0; round < 2; ++round) {  // forces depend a little on the rates: two iterations suffice
        // the last change is some ten times the error left; rates divide it by 2 ms, their derivatives by that squared
        const double tolerance = round == 0 ? 1e-7 : 1e-11;
        double slope[4] = {}, bend[4] = {}, moved[4] = {};
        for (int s = 0; s < 5; ++s) {
            double rate[3];
            for (int k = 0; k < 3; ++k) rate[k] = out.rate[k] + (s - 2) * spacing * out.turn[k];
            const double before[4] = {q[s][0], q[s][1], q[s][2], q[s][3]};
            for (int k = 0; k < 4; ++k) {  // start from the neighbours' values
                if (round == 0 && s > 0) n[s][k] = s == 1 ? n[0][k] : 2.0 * n[s - 1][k] - n[s - 2][k];
                if (round == 0 && s > 1)
                    q[s][k] = s == 2 ? 2.0 * q[1][k] - q[0][k] : 3.0 * (q[s - 1][k] - q[s - 2][k]) + q[s - 3][k];
                if (round == 1) q[s][k] += moved[k];
            }
            l.attitude(path[s], rate, tolerance, n[s], q[s]);
            for (int k = 0; k < 4; ++k) moved[k] = q[s][k] - before[k];
            for (int k = 0; k < 4; ++k) {
                slope[k] += first[s] / spacing * q[s][k];
                bend[k] += second[s] / (spacing * spacing) * q[s][k];
            }
        }
        const double* c = q[2];
        const double* const both[2] = {slope, bend};
        double* const result[2] = {out.rate, out.turn};
        for (int d = 0; d < 2; ++d) {  // vector part of 2 conj(q) dq
            const double* x = both[d];
            result[d][0] = 2.0 * (c[0] * x[1] - c[1] * x[0] - c[2] * x[3] + c[3] * x[2]);
            result[d][1] = 2.0 * (c[0] * x[2] - c[2] * x[0] - c[3] * x[1] + c[1] * x[3]);
            result[d][2] = 2.0 * (c[0] * x[3] - c[3] * x[0] - c[1] * x[2] + c[2] * x[1]);
        }
    }
    const double* w = out.rate;
    double L[3], A[3];
    for (int k = 0; k < 3; ++k) {
        const double* row = body.inertia[k];
        L[k] = row[0] * w[0] + row[1] * w[1] + row[2] * w[2];
        A[k] = row[0] * out.turn[0] + row[1] * out.turn[1] + row[2] * out.turn[2];
    }
    out.torque[0] = A[0] + w[1] * L[2] - w[2] * L[1];
    out.torque[1] = A[1] + w[2] * L[0] - w[0] * L[2];
    out.torque[2] = A[2] + w[0] * L[1] - w[1] * L[0];
    for (int k = 0; k < 4; ++k) {
        out.q[k] = q[2][k];
        out.rotor_speed[k] = n[2][k];
    }
    double force[3], body_force[3];
    l.required_force(path[2], force);
    bool found = false;
    for (int step = 0; step < 20; ++step) {  // where drag depends on each rotor, align the thrust once more
        const double back[4] = {out.q[0], -out.q[1], -out.q[2], -out.q[3]};
        rotate(back, force, body_force);
        out.thrust = body_force[2];
        const double required[4] = {out.thrust, out.torque[0], out.torque[1], out.torque[2]};
        Flow<double> flow{};
        l.air(path[2], out.q, out.rate, flow);
        found = invert_rotors(model, values, flow, required, out.rotor_speed);
        if (!found) break;
        const double before[4] = {out.q[0], out.q[1], out.q[2], out.q[3]};
        double force_z, change = 0.0;
        l.line_up(path[2], HalfTurn(path[2].yaw), out.rate, out.rotor_speed, out.q, force_z);
        for (int k = 0; k < 4; ++k) change = std::fmax(change, std::fabs(out.q[k] - before[k]));
        if (change < 1e-12) break;
    }
    if (!found) {
        for (double& speed : out.rotor_speed) speed = NAN;
    }
}

}  // namespace goshawk
