// Flatness of one instant: from five neighbouring points of the path to attitude, rates, torque and rotor speeds.
// The NumPy reference of the same iteration is in vehicle/flatness.py.
#pragma once

#include <algorithm>
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

// Anderson's acceleration of a fixed-point iteration, from its last two steps (Walker and Ni, SIAM J. Numer. Anal.
// 2011).
class Anderson {
  public:
    // Replaces x, whose image is given, by the combination of images at which the change would vanish.
    void operator()(const double image[5], double x[5]) {
        double change[5], by[2][5], a[2][2] = {}, b[2] = {}, share[2] = {};
        for (int k = 0; k < 5; ++k) {
            change[k] = image[k] - x[k];
        }
        for (int i = 0; i < known_; ++i) {
            for (int k = 0; k < 5; ++k) by[i][k] = change[k] - change_[i][k];
        }
        for (int i = 0; i < known_; ++i) {
            for (int k = 0; k < 5; ++k) b[i] += by[i][k] * change[k];
            for (int j = 0; j < known_; ++j) {
                for (int k = 0; k < 5; ++k) a[i][j] += by[i][k] * by[j][k];
            }
        }
        const double determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        if (determinant > 1e-9 * a[0][0] * a[1][1]) {
            share[0] = (b[0] * a[1][1] - b[1] * a[0][1]) / determinant;
            share[1] = (b[1] * a[0][0] - b[0] * a[1][0]) / determinant;
        } else if (a[0][0] > 0.0) {
            share[0] = b[0] / a[0][0];
        }
        const bool far = std::fabs(share[0]) + std::fabs(share[1]) > 2.0;  // an extrapolation not to be trusted
        for (int k = 0; k < 5; ++k) {
            x[k] = image[k];
            for (int i = 0; i < known_ && !far; ++i) x[k] -= share[i] * (image[k] - image_[i][k]);
            image_[1][k] = image_[0][k];
            change_[1][k] = change_[0][k];
            image_[0][k] = image[k];
            change_[0][k] = change[k];
        }
        known_ = std::min(known_ + 1, 2);
    }

  private:
    double image_[2][5] = {}, change_[2][5] = {};  // of the last step and the one before
    int known_ = 0;
};

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

    // Attitude and rotor speeds without drag, where thrust grows with the square of the speed.
    void begin(const PathPoint& p, const double hover[4], double n[4], double q[4]) const {
        double f[3];
        required_force(p, f);
        hopf(f, HalfTurn(p.yaw), q);
        const double weight = body.mass * gravity, size = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
        const double ratio = std::sqrt(std::fmax(size / weight, 0.1));
        for (int i = 0; i < 4; ++i) n[i] = ratio * hover[i];
    }

    // Attitude and rotor speeds (their proportions kept) that give the path's acceleration; how much the last step
    // changed them.
    double attitude(const PathPoint& p, const double rate[3], double tolerance, double n[4], double q[4]) const {
        const HalfTurn yaw(p.yaw);
        Anderson next;
        double scale = 0.0, change = INFINITY;  // logarithm of what the rotor speeds were multiplied by
        for (int step = 0; step < 60 && !(change < tolerance); ++step) {
            double x[5] = {q[0], q[1], q[2], q[3], scale}, turned[4] = {q[0], q[1], q[2], q[3]}, force_z;
            const double along = line_up(p, yaw, rate, n, turned, force_z);
            // thrust grows about with the square of the speed
            const double faster = 0.5 * logarithm(std::fmax(along, 0.0) / std::fmax(force_z, 1e-12));
            const double bounded = std::fmin(std::fmax(faster, -kLog2), kLog2);
            const double image[5] = {turned[0], turned[1], turned[2], turned[3], scale + bounded};
            change = 0.0;
            for (int k = 0; k < 5; ++k) change = std::fmax(change, std::fabs(image[k] - x[k]));
            if (change < tolerance) {
                for (int k = 0; k < 5; ++k) x[k] = image[k];
            } else {
                next(image, x);
            }
            const double ratio = exponential(x[4] - scale);
            for (int k = 0; k < 4; ++k) {
                n[k] *= ratio;
                q[k] = x[k];
            }
            scale = x[4];
        }
        return change;
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

// The rotor speeds that give one vehicle a force along body z and a torque.
class Inversion {
  public:
    Inversion(const Model& model, const double* values)
        : model_(model),
          values_(values),
          body_(rigid_body(model, values)),
          numbers_(values, values + model.width),
          body_numbers_(rigid_body(model, numbers_.data())) {}

    // Newton on all four by the rotor speeds n, which are the start as well, and Broyden's method (1965) near the
    // answer; `motion` holds all else. False when it does not converge: there are no such speeds.
    bool operator()(const Flow<double>& motion, const double required[4], double n[4]) const;

  private:
    using Number = Dual<4>;
    const Model& model_;
    const double* values_;
    Body<double> body_;
    std::vector<Number> numbers_;
    Body<Number> body_numbers_;
};

inline bool Inversion::operator()(const Flow<double>& motion, const double required[4], double n[4]) const {
    double slope[4][4] = {}, move[4] = {};
    bool near = false;
    for (int step = 0; step < 25; ++step) {
        double A[4][5], value[4], change = 0.0, largest = 0.0, square = 0.0;
        if (near) {
            Flow<double> flow = turning<double>(motion, n);
            wrench(model_, values_, body_, flow);
            for (int i = 0; i < 4; ++i) square += move[i] * move[i];
            for (int r = 0; r < 4; ++r) {
                value[r] = r == 0 ? flow.force[2] : flow.torque[r - 1];
                for (int c = 0; c < 4; ++c) slope[r][c] += (value[r] - required[r]) * move[c] / square;
            }
        } else {
            Flow<Number> flow = turning<Number>(motion, n);
            for (int i = 0; i < 4; ++i) flow.rotor_speed[i].d[i] = 1.0;
            wrench(model_, numbers_.data(), body_numbers_, flow);
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
        near = change < 0.1 * largest;   // so near the slopes hardly change: Broyden's update of the last ones does
    }
    return false;
}

// Body rate 2 conj(q) dq of an attitude's derivative (the vector part), or the same of its second derivative.
inline void turning_of(const double q[4], const double dq[4], double out[3]) {
    out[0] = 2.0 * (q[0] * dq[1] - q[1] * dq[0] - q[2] * dq[3] + q[3] * dq[2]);
    out[1] = 2.0 * (q[0] * dq[2] - q[2] * dq[0] - q[3] * dq[1] + q[1] * dq[3]);
    out[2] = 2.0 * (q[0] * dq[3] - q[3] * dq[0] - q[1] * dq[2] + q[2] * dq[1]);
}

// Euler's equation: the torque that gives a body of this rate its derivative.
inline void torque_of(const Body<double>& body, const double rate[3], const double derivative[3], double torque[3]) {
    double L[3], A[3];
    for (int k = 0; k < 3; ++k) {
        const double* row = body.inertia[k];
        L[k] = row[0] * rate[0] + row[1] * rate[1] + row[2] * rate[2];
        A[k] = row[0] * derivative[0] + row[1] * derivative[1] + row[2] * derivative[2];
    }
    torque[0] = A[0] + rate[1] * L[2] - rate[2] * L[1];
    torque[1] = A[1] + rate[2] * L[0] - rate[0] * L[2];
    torque[2] = A[2] + rate[0] * L[1] - rate[1] * L[0];
}

// Rotor speeds, from a start, that give a point of the path its acceleration and the vehicle this torque; NaN where
// there are none. Returns the force along body z.
inline double rotors_at(const Alignment& l, const Inversion& inversion, const PathPoint& p, const double q[4],
                        const double rate[3], const double torque[3], double speed[4]) {
    const double back[4] = {q[0], -q[1], -q[2], -q[3]};
    double force[3], body_force[3];
    l.required_force(p, force);
    rotate(back, force, body_force);
    const double required[4] = {body_force[2], torque[0], torque[1], torque[2]};
    Flow<double> flow{};
    l.air(p, q, rate, flow);
    if (!inversion(flow, required, speed)) std::fill(speed, speed + 4, NAN);
    return body_force[2];
}

inline void flatten(const Alignment& l, const Inversion& inversion, const double hover[4], double spacing,
                    const PathPoint path[5], Flat& out) {
    static const double first[5] = {1.0 / 12, -8.0 / 12, 0.0, 8.0 / 12, -1.0 / 12};
    static const double second[5] = {-1.0 / 12, 16.0 / 12, -30.0 / 12, 16.0 / 12, -1.0 / 12};
    double q[5][4], n[5][4];
    for (int s = 0; s < 5; ++s) {
        l.begin(path[s], hover, n[s], q[s]);
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
        turning_of(q[2], slope, out.rate);
        turning_of(q[2], bend, out.turn);
    }
    torque_of(l.body, out.rate, out.turn, out.torque);
    for (int k = 0; k < 4; ++k) {
        out.q[k] = q[2][k];
        out.rotor_speed[k] = n[2][k];
    }
    for (int step = 0; step < 20; ++step) {  // where drag depends on each rotor, align the thrust once more
        out.thrust = rotors_at(l, inversion, path[2], out.q, out.rate, out.torque, out.rotor_speed);
        if (std::isnan(out.rotor_speed[0])) break;
        const double before[4] = {out.q[0], out.q[1], out.q[2], out.q[3]};
        double force_z, change = 0.0;
        l.line_up(path[2], HalfTurn(path[2].yaw), out.rate, out.rotor_speed, out.q, force_z);
        for (int k = 0; k < 4; ++k) change = std::fmax(change, std::fabs(out.q[k] - before[k]));
        if (change < 1e-12) break;
    }
}

// A last change of attitude and rotor speeds above this leaves them unknown.
constexpr double kUnsettled = 1e-6;

// A piece of a path at m nodes, by differentiation of the attitudes there. first, second: (m, m) derivatives by the
// piece's own argument, which runs `scale` times as fast as time; path: (m,). out: (m, 8) of the cosine of the tilt,
// body rate and rotor speeds.
inline void at_nodes(const Alignment& l, const Inversion& inversion, const double hover[4], size_t m,
                     const double* first, const double* second, double scale, const PathPoint* path, double* out) {
    struct Node {
        double q[4], speed[4], rate[3], derivative[3], torque[3], change;
    };
    std::vector<Node> nodes(m);
    for (size_t i = 0; i < m; ++i) {
        l.begin(path[i], hover, nodes[i].speed, nodes[i].q);
        std::fill(nodes[i].rate, nodes[i].rate + 3, 0.0);
    }
    for (const double tolerance : {1e-6, 1e-10}) {  // forces depend a little on the rates: two iterations suffice
        for (size_t i = 0; i < m; ++i) {
            Node& n = nodes[i];
            n.change = l.attitude(path[i], n.rate, tolerance, n.speed, n.q);
        }
        for (size_t i = 0; i < m; ++i) {
            double slope[4] = {}, bend[4] = {};
            for (size_t j = 0; j < m; ++j) {
                for (int k = 0; k < 4; ++k) {
                    slope[k] += first[m * i + j] * nodes[j].q[k];
                    bend[k] += second[m * i + j] * nodes[j].q[k];
                }
            }
            for (int k = 0; k < 4; ++k) slope[k] *= scale, bend[k] *= scale * scale;
            turning_of(nodes[i].q, slope, nodes[i].rate);
            turning_of(nodes[i].q, bend, nodes[i].derivative);
        }
    }
    for (size_t i = 0; i < m; ++i) {
        Node& n = nodes[i];
        torque_of(l.body, n.rate, n.derivative, n.torque);
        rotors_at(l, inversion, path[i], n.q, n.rate, n.torque, n.speed);
        if (!(n.change < kUnsettled)) std::fill(n.speed, n.speed + 4, NAN);
        double* o = out + 8 * i;
        o[0] = 1.0 - 2.0 * (n.q[1] * n.q[1] + n.q[2] * n.q[2]);
        std::copy(n.rate, n.rate + 3, o + 1);
        std::copy(n.speed, n.speed + 4, o + 4);
    }
}

}  // namespace goshawk
