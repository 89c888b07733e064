// What it costs to pass the opening of a gate at a slant, against its direction or not at all.
#pragma once

#include <algorithm>
#include <cmath>

namespace goshawk {

// Price times the squared lack of velocity along the gate's normal, as a share of the speed: the path then crosses the
// gate's plane at a good angle and does not come back through it.
struct PassingCost {
    double price;
    static constexpr double kLeast = 0.35;  // cosine of 70 degrees
    static constexpr double kSlow = 0.5;    // m/s; the share fades where there is hardly any speed

    double value(const double* velocity, const double* normal, double* by_velocity) const {
        double square = kSlow * kSlow, ahead = 0.0;
        for (int x = 0; x < 3; ++x) square += velocity[x] * velocity[x];
        for (int x = 0; x < 3; ++x) ahead += velocity[x] * normal[x];
        const double pace = std::sqrt(square), share = ahead / pace, lack = std::max(kLeast - share, 0.0);
        for (int x = 0; x < 3; ++x)
            by_velocity[x] -= 2.0 * price * lack * (normal[x] - share * velocity[x] / pace) / pace;
        return price * lack * lack;
    }
};

}  // namespace goshawk
