// What a trajectory costs, in seconds of flight: each term gives its density at one instant and adds its gradient.
#pragma once

#include <cmath>
#include <optional>

#include "airframe.hpp"
#include "vec.hpp"

namespace goshawk {

// Price times the squared excess over every limit; the offsets carry what the model measured beyond `Demand`.
struct LimitCost {
    const Airframe& airframe;
    double price;

    double density(const Motion& at, const double* offsets, Motion& by) const {
        const Demand demand(airframe, at);
        double excess[kLimits], by_excess[kLimits], sum = 0.0;
        demand.excess(excess);
        for (int l = 0; l < kLimits; ++l) {
            const double over = std::max(excess[l] + offsets[l], 0.0);
            sum += over * over;
            by_excess[l] = 2.0 * price * over;
        }
        if (sum > 0.0) demand.pull_back(by_excess, by);
        return price * sum;
    }
};

// Price of not looking where one flies, or at a point, 1 - cos of the angle between them, which fades where there is
// hardly any speed, or the point is near; and of turning at all.
struct HeadingCost {
    double price, turning_price;
    std::optional<Vec> target;
    static constexpr double kSlow = 0.5;  // m/s, or metres, at which it counts half

    double density(const Motion& at, Motion& by) const {
        by.yaw_rate += 2.0 * turning_price * at.yaw_rate;
        const double turning = turning_price * at.yaw_rate * at.yaw_rate;
        if (price == 0.0) return turning;
        const double c = std::cos(at.yaw), s = std::sin(at.yaw),
                     vx = target ? target->x - at.position.x : at.velocity.x,
                     vy = target ? target->y - at.position.y : at.velocity.y;
        const double square = vx * vx + vy * vy, pace = std::sqrt(square + 1e-6), ahead = vx * c + vy * s;
        const double scale = price / (square + kSlow * kSlow), off = pace * (pace - ahead);
        const double by_pace = scale * (2.0 * pace - ahead) / pace,
                     by_scale = -2.0 * scale * off / (square + kSlow * kSlow);
        const Vec by_aim{(by_pace + by_scale) * vx - scale * pace * c, (by_pace + by_scale) * vy - scale * pace * s,
                         0.0};
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

    double density(double distance, const Vec& uphill, Motion& by) const {
        const double lack = required - distance;
        if (!(lack > 0.0)) return 0.0;
        by.position -= uphill * (2.0 * price * lack);
        return price * lack * lack;
    }
};

}  // namespace goshawk
