// What it costs to pass the opening of a gate at a slant, against its direction or not at all.
#pragma once

#include <algorithm>
#include <cmath>

namespace goshawk {

// Unit normal of a gate's opening (centre, left and upper half edge), the way it is flown; false where there is none.
inline bool gate_normal(const double* gate, double normal[3]) {
    const double *left = gate + 3, *up = left + 3;
    normal[0] = left[1] * up[2] - left[2] * up[1];
    normal[1] = left[2] * up[0] - left[0] * up[2];
    normal[2] = left[0] * up[1] - left[1] * up[0];
    const double size = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (!(size > 0.0)) return false;
    for (int x = 0; x < 3; ++x) normal[x] /= size;
    return true;
}

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
