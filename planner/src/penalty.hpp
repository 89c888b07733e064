// What planner/penalty.py says, compiled: squared excesses over the limits of a point mass, with their gradients.
#pragma once

#include <algorithm>
#include <cmath>

namespace goshawk {

constexpr double kGravity = 9.80665;  // flight.frames.GRAVITY_M_S2

struct Vec {
    double x, y, z;
    Vec operator+(const Vec& o) const { return {x + o.x, y + o.y, z + o.z}; }
    Vec operator-(const Vec& o) const { return {x - o.x, y - o.y, z - o.z}; }
    Vec operator*(double s) const { return {x * s, y * s, z * s}; }
    double dot(const Vec& o) const { return x * o.x + y * o.y + z * o.z; }
};

struct Bounds {
    double speed, acceleration, tilt, rate, thrust_min, thrust_max, turn_per_thrust;
};

// Gradients of the penalty by velocity, acceleration, jerk and snap.
struct Motion {
    Vec velocity{}, acceleration{}, jerk{}, snap{};
};

struct Across {  // |m x t|^2 and its gradients by m and t
    double value;
    Vec by_motion, by_thrust;
};

inline Across across(const Vec& m, const Vec& t, double square) {
    const double along = m.dot(t), size = m.dot(m);
    return {std::max(size * square - along * along, 0.0), (m * square - t * along) * 2.0, (t * size - m * along) * 2.0};
}

// Adds the squared excess to `value` and twice the excess times its gradient to the targets.
inline double charge(double excess, double& value) {
    if (!(excess > 0.0)) return 0.0;
    value += excess * excess;
    return 2.0 * excess;
}

inline double dynamics(const Motion& at, const Bounds& b, Motion& by) {
    double value = 0.0;
    const double speed2 = b.speed * b.speed, push2 = b.acceleration * b.acceleration;
    if (const double c = charge(at.velocity.dot(at.velocity) / speed2 - 1.0, value))
        by.velocity = by.velocity + at.velocity * (c * 2.0 / speed2);
    if (const double c = charge(at.acceleration.dot(at.acceleration) / push2 - 1.0, value))
        by.acceleration = by.acceleration + at.acceleration * (c * 2.0 / push2);

    const Vec thrust = at.acceleration + Vec{0.0, 0.0, kGravity};
    const double square = std::max(thrust.dot(thrust), 0.04 * kGravity * kGravity);
    const double size = std::sqrt(square), cosine = std::cos(b.tilt);
    if (const double c = charge((cosine * size - thrust.z) / kGravity, value))
        by.acceleration = by.acceleration + (thrust * (cosine / size) - Vec{0.0, 0.0, 1.0}) * (c / kGravity);

    const Across turning = across(at.jerk, thrust, square);
    const double scale = 1.0 / (b.rate * b.rate * square * square);
    if (const double c = charge(turning.value * scale - 1.0, value)) {
        const Vec by_thrust = turning.by_thrust * scale - thrust * (4.0 * turning.value * scale / square);
        by.acceleration = by.acceleration + by_thrust * c;
        by.jerk = by.jerk + turning.by_motion * (c * scale);
    }

    const Across spin = across(at.snap, thrust, square);
    const double root = std::sqrt(spin.value + 1e-6), gain = 1.0 / (b.turn_per_thrust * square * kGravity);
    const double spread = root * gain, half = 0.5 * gain / root;
    const Vec direction = thrust * (1.0 / (size * kGravity));
    const Vec by_thrust = spin.by_thrust * half - thrust * (2.0 * spread / square);
    if (const double c = charge(spread + (b.thrust_min - size) / kGravity, value)) {
        by.acceleration = by.acceleration + (by_thrust - direction) * c;
        by.snap = by.snap + spin.by_motion * (c * half);
    }
    if (const double c = charge(spread + (size - b.thrust_max) / kGravity, value)) {
        by.acceleration = by.acceleration + (by_thrust + direction) * c;
        by.snap = by.snap + spin.by_motion * (c * half);
    }
    return value;
}

}  // namespace goshawk
