// The vehicle as the optimiser sees it: how far a motion exceeds each limit, and the exact adjoint of that.
// The NumPy reference is in planner/optimise/airframe.py. What this leaves out comes in as offsets, measured with the
// full model.
#pragma once

#include "samples.hpp"
#include "vec.hpp"

namespace {

// Path and yaw at four instants, as numbers or with their derivatives along one direction.
template <class Number>
struct Motion {
    Vec<Number> position, velocity, acceleration, jerk, snap;
    Number yaw{}, yaw_rate{}, yaw_acceleration{};
};

using namespace goshawk;

// What a motion asks of the airframe; yaw turns first, then the body tilts the shortest way (vehicle/flatness.py).
template <class Number, int kRotors>
class Demand {
    static constexpr int kLimits = limits_of(kRotors), kSlowest = kFastest + kRotors;
    using Vec = ::Vec<Number>;
    using Motion = ::Motion<Number>;

  public:
    Demand(const Airframe& airframe, const Motion& motion, Number cos_yaw, Number sin_yaw)
        : w(airframe), m(motion), c(cos_yaw), s(sin_yaw) {
        f = m.acceleration;
        f.z += w.gravity;
        force = root(f.dot(f) + 1e-6);
        pace = root(m.velocity.dot(m.velocity) + 1e-2);
        drag = w.drag_per_thrust * force / w.gravity + w.drag_per_speed * pace;
        t0 = f + m.velocity * drag;
        t1 = m.jerk + m.acceleration * drag;
        t2 = m.snap + m.jerk * drag;
        const Number square = t0.dot(t0), floor = all(0.04 * w.gravity * w.gravity);
        steady = value(square) < value(floor)
                     ? all(0.0)
                     : all(1.0);             // the axis is undefined in free fall; the slowest rotor keeps
        size = root(larger(square, floor));  // the path away from it
        z = t0 * (1.0 / size);
        y1 = z.dot(t1);
        zd = (t1 - z * y1) * (1.0 / size);
        y2 = z.dot(t2);
        zdd = (t2 - z * y2 - zd * (2.0 * y1)) * (1.0 / size);
        upright = value(1.0 + z.z) < all(0.1) ? all(0.0) : all(1.0);
        h = 1.0 / larger(1.0 + z.z, Number(all(0.1)));
        const Number p1x = zd.x - z.x * zd.z * h, p1y = zd.y - z.y * zd.z * h;
        const Number p2x = zdd.x - z.x * zdd.z * h, p2y = zdd.y - z.y * zdd.z * h;
        rate_x = s * p1x - c * p1y, rate_y = c * p1x + s * p1y;
        bend_x = s * p2x - c * p2y, bend_y = c * p2x + s * p2y;
        n1 = z.x * zd.y - z.y * zd.x, n2 = z.x * zdd.y - z.y * zdd.x;
        rate_z = m.yaw_rate - n1 * h;
        const Number turn_z = m.yaw_acceleration - n2 * h + n1 * zd.z * h * h;
        const double* I = w.inertia;
        const Number torque[3] = {I[0] * bend_x + (I[0] + I[2] - I[1]) * rate_y * rate_z,
                                  I[1] * bend_y + (I[0] - I[2] - I[1]) * rate_x * rate_z,
                                  I[2] * turn_z + (I[1] - I[0]) * rate_x * rate_y};
        climb = m.velocity.dot(z);
        const Number lift = w.lift_axial * climb + w.lift_lateral * (m.velocity.dot(m.velocity) - climb * climb);
        for (int i = 0; i < kRotors; ++i) {
            effort[i] = w.effort_hover[i] + w.mix[i][0] * (f.dot(z) - lift - w.gravity);
            for (int k = 0; k < 3; ++k) effort[i] += w.mix[i][1 + k] * torque[k];
        }
    }

    // Relative excess over each limit, negative within it.
    void excess(Number out[kLimits]) const {
        out[kSpeed] = m.velocity.dot(m.velocity) / (w.speed * w.speed) - 1.0;
        out[kAcceleration] = m.acceleration.dot(m.acceleration) / (w.acceleration * w.acceleration) - 1.0;
        out[kJerk] = m.jerk.dot(m.jerk) / (w.jerk * w.jerk) - 1.0;
        out[kTilt] = (w.cos_tilt - z.z) / (1.0 - w.cos_tilt);
        out[kRate] = zd.dot(zd) / (w.rate * w.rate) - 1.0;
        out[kYawRate] = rate_z * rate_z / (w.yaw_rate * w.yaw_rate) - 1.0;
        for (int i = 0; i < kRotors; ++i) {
            out[kFastest + i] = effort[i] - w.effort_most[i];
            out[kSlowest + i] = w.effort_least[i] - effort[i];
        }
    }

    // Adds the slope of one excess by the motion; of speed, acceleration and jerk without the way through the attitude.
    void slope_of(int limit, Motion& by) const {
        if (limit == kSpeed) {
            by.velocity += m.velocity * (2.0 / (w.speed * w.speed));
        } else if (limit == kAcceleration) {
            by.acceleration += m.acceleration * (2.0 / (w.acceleration * w.acceleration));
        } else if (limit == kJerk) {
            by.jerk += m.jerk * (2.0 / (w.jerk * w.jerk));
        } else {
            Number alone[kLimits] = {};
            alone[limit] = all(1.0);
            pull_back(alone, by);
        }
    }

    // From the cost's gradient by each excess to its gradient by the motion: the constructor, backwards.
    void pull_back(const Number by_excess[kLimits], Motion& by) const {
        const double* I = w.inertia;
        Vec by_z{{}, {}, -by_excess[kTilt] / (1.0 - w.cos_tilt)};
        Vec by_zd = zd * (2.0 * by_excess[kRate] / (w.rate * w.rate));
        Number by_rate_z = 2.0 * by_excess[kYawRate] * rate_z / (w.yaw_rate * w.yaw_rate);
        Number by_thrust{}, by_torque[3] = {};
        for (int i = 0; i < kRotors; ++i) {
            const Number by_effort = by_excess[kFastest + i] - by_excess[kSlowest + i];
            by_thrust += by_effort * w.mix[i][0];
            for (int k = 0; k < 3; ++k) by_torque[k] += by_effort * w.mix[i][1 + k];
        }
        const double gyro[3] = {I[0] + I[2] - I[1], I[0] - I[2] - I[1], I[1] - I[0]};
        const Number by_bend_x = I[0] * by_torque[0], by_bend_y = I[1] * by_torque[1], by_turn_z = I[2] * by_torque[2];
        const Number by_rate_y = gyro[0] * rate_z * by_torque[0] + gyro[2] * rate_x * by_torque[2];
        const Number by_rate_x = gyro[1] * rate_z * by_torque[1] + gyro[2] * rate_y * by_torque[2];
        by_rate_z += gyro[0] * rate_y * by_torque[0] + gyro[1] * rate_x * by_torque[1];
        const Number by_climb = by_thrust * (2.0 * w.lift_lateral * climb - w.lift_axial);
        Vec by_f = z * by_thrust;
        by_z += f * by_thrust + m.velocity * by_climb;
        by.yaw_acceleration += by_turn_z;
        by.yaw_rate += by_rate_z;
        const Number by_n1 = zd.z * h * h * by_turn_z - h * by_rate_z, by_n2 = -h * by_turn_z;
        Number by_h = (2.0 * n1 * zd.z * h - n2) * by_turn_z - n1 * by_rate_z;
        by_zd.z += n1 * h * h * by_turn_z;
        const Number p1x = c * by_rate_y + s * by_rate_x, p1y = s * by_rate_y - c * by_rate_x;
        const Number p2x = c * by_bend_y + s * by_bend_x, p2y = s * by_bend_y - c * by_bend_x;
        by.yaw += by_rate_x * rate_y - by_rate_y * rate_x + by_bend_x * bend_y - by_bend_y * bend_x;
        const Number in1 = z.x * p1x + z.y * p1y, in2 = z.x * p2x + z.y * p2y;
        by_zd += Vec{p1x - z.y * by_n1, p1y + z.x * by_n1, -h * in1};
        Vec by_zdd{p2x - z.y * by_n2, p2y + z.x * by_n2, -h * in2};
        by_z.x += by_n1 * zd.y + by_n2 * zdd.y - h * (zd.z * p1x + zdd.z * p2x);
        by_z.y -= by_n1 * zd.x + by_n2 * zdd.x + h * (zd.z * p1y + zdd.z * p2y);
        by_h -= zd.z * in1 + zdd.z * in2;
        by_z.z -= upright * h * h * by_h;
        Vec by_t2 = by_zdd * (1.0 / size);
        const Number by_y2 = -z.dot(by_t2);
        Number by_y1 = -2.0 * zd.dot(by_t2), by_size = -zdd.dot(by_t2);
        by_z += t2 * by_y2 - by_t2 * y2;
        by_zd -= by_t2 * (2.0 * y1);
        by_t2 += z * by_y2;
        Vec by_t1 = by_zd * (1.0 / size);
        by_y1 -= z.dot(by_t1);
        by_size -= zd.dot(by_t1);
        by_z += t1 * by_y1 - by_t1 * y1;
        by_t1 += z * by_y1;
        Vec by_t0 = by_z * (1.0 / size);
        by_size -= z.dot(by_t0);
        by_t0 += z * (steady * by_size);
        const Number by_drag = m.jerk.dot(by_t2) + m.acceleration.dot(by_t1) + m.velocity.dot(by_t0);
        by_f += by_t0 + f * (w.drag_per_thrust / (w.gravity * force) * by_drag);
        by.snap += by_t2;
        by.jerk += by_t2 * drag + by_t1 + m.jerk * (2.0 * by_excess[kJerk] / (w.jerk * w.jerk));
        by.acceleration +=
            by_t1 * drag + by_f + m.acceleration * (2.0 * by_excess[kAcceleration] / (w.acceleration * w.acceleration));
        by.velocity += by_t0 * drag + z * by_climb + m.velocity * (-2.0 * w.lift_lateral * by_thrust) +
                       m.velocity * (w.drag_per_speed / pace * by_drag + 2.0 * by_excess[kSpeed] / (w.speed * w.speed));
    }

  private:
    const Airframe& w;
    const Motion& m;
    const Number c, s;              // of the yaw
    Vec f, t0, t1, t2, z, zd, zdd;  // specific force; thrust with two derivatives; its direction with two
    Number force, pace, drag, size, climb, y1, y2, h, n1, n2;
    Number rate_x, rate_y, rate_z, bend_x, bend_y, effort[kRotors];
    Real steady, upright;  // one, or zero in free fall or upside down
};

}  // namespace
