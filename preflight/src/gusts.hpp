// Gusts of Dryden's form (MIL-F-8785C, section 3.7): along the wind a first-order filter of white noise, across it and
// upwards sigma sqrt(L / V) (1 + sqrt(3) L/V s) / (1 + L/V s)^2, for one length L and the vehicle's present air speed
// V.
#pragma once

#include <cmath>

#include "random.hpp"

namespace goshawk {

class Gusts {
  public:
    // `along`: horizontal unit vector of the mean wind. The filters start in their stationary state.
    Gusts(double std_m_s, double length_m, const double along[2], Mixture& random)
        : std_(std_m_s), length_(length_m), along_{along[0], along[1]} {
        if (std_ <= 0.0) return;
        slow_ = std_ * random.normal();
        for (double* two : {across_, up_}) {
            const double a = random.normal(), b = random.normal();
            two[0] = std_ * std::sqrt(0.5) * a;
            two[1] = std_ * (kShared * a + kOwn * b);
        }
    }

    // Advances by a step and writes the gust in world axes; `air_speed` in m/s.
    void step(double step_s, double air_speed, Mixture& random, double out[3]) {
        if (std_ <= 0.0) {
            out[0] = out[1] = out[2] = 0.0;
            return;
        }
        const double speed = air_speed > kSlowest ? air_speed : kSlowest;
        const double share = std::fmin(step_s * speed / length_, 0.5);  // of the filters' time constant L / V
        slow_ += -share * slow_ + std_ * std::sqrt(share * (2.0 - share)) * random.normal();
        const double side = second_order(across_, share, random), lift = second_order(up_, share, random);
        out[0] = along_[0] * slow_ - along_[1] * side;
        out[1] = along_[1] * slow_ + along_[0] * side;
        out[2] = lift;
    }

  private:
    // Cholesky factor of the stationary covariance of a second-order filter's two states
    static constexpr double kShared = 0.9659258262890683, kOwn = 0.2588190451025208;
    static constexpr double kSlowest = 0.5;  // m/s: still air drifts past a hovering vehicle all the same

    double second_order(double two[2], double share, Mixture& random) const {
        const double white = std_ * random.normal() / std::sqrt(share);  // of intensity std^2 L / V
        const double first = two[0];
        two[0] += share * (white - first);
        two[1] += share * (first + std::sqrt(3.0) * (white - first) - two[1]);
        return two[1];
    }

    double std_, length_, along_[2];
    double slow_ = 0.0, across_[2] = {}, up_[2] = {};
};

}  // namespace goshawk
