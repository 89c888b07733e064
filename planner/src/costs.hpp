// What a trajectory costs, in seconds of flight: each term gives its density at four instants and adds its gradient.
#pragma once

#include "airframe.hpp"
#include "portable.hpp"
#include "vec.hpp"

namespace {

// Price times the squared excess over every limit; the offsets carry what the model measured beyond `Demand`, and
// multipliers.
struct LimitCost {
    double price;

    template <class Number, int kRotors>
    Number density(const Demand<Number, kRotors>& demand, const double* offsets, Motion<Number>& by) const {
        constexpr int kLimits = limits_of(kRotors);
        Number excess[kLimits], by_excess[kLimits], total{};
        demand.excess(excess);
        for (int l = 0; l < kLimits; ++l) {
            const Number over = larger(excess[l] + four(offsets + l * kLanes), Number{});
            total += over * over;
            by_excess[l] = 2.0 * price * over;
        }
        if (sum(value(total)) > 0.0) demand.pull_back(by_excess, by);
        return price * total;
    }
};

// Price of not looking where one flies, or at a point: 1 - cos of the angle between them, which fades where there is
// hardly any speed; and of turning at all.
struct HeadingCost {
    double price, turning_price;
    const double* target;                 // x and y to look at; null: along the path
    static constexpr double kSlow = 0.5;  // m/s at which it counts half

    template <class Number>
    Number density(const Motion<Number>& at, Number c, Number s, Motion<Number>& by) const {
        by.yaw_rate += 2.0 * turning_price * at.yaw_rate;
        const Number turning = turning_price * at.yaw_rate * at.yaw_rate;
        if (price == 0.0) return turning;
        const Number vx = target ? target[0] - at.position.x : at.velocity.x;
        const Number vy = target ? target[1] - at.position.y : at.velocity.y;
        const Number square = vx * vx + vy * vy, pace = root(square + 1e-6), ahead = vx * c + vy * s;
        const Number scale = price / (square + kSlow * kSlow), off = pace * (pace - ahead);
        const Number by_pace = scale * (2.0 * pace - ahead) / pace,
                     by_scale = -2.0 * scale * off / (square + kSlow * kSlow);
        const Vec<Number> by_aim{(by_pace + by_scale) * vx - scale * pace * c,
                                 (by_pace + by_scale) * vy - scale * pace * s};
        if (target)
            by.position -= by_aim;
        else
            by.velocity += by_aim;
        by.yaw -= scale * pace * (vy * c - vx * s);
        return turning + scale * off;
    }
};

// Price times the squared lack of clearance.
struct ClearanceCost {
    double price, required;

    Real density(Real distance, const Vec<Real>& uphill, Motion<Real>& by) const {
        const Real lack = larger(required - distance, Real{});
        by.position -= uphill * (2.0 * price * lack);
        return price * lack * lack;
    }
};

}  // namespace
