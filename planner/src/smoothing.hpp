// What the minimiser takes for the size of a step: smooth ones are small. A descent in this metric (a Sobolev gradient,
// as in CHOMP, Ratliff et al. 2009) moves the path as a whole where one in plain coordinates goes knot by knot: through
// a maze 100 iterations come as far as 3,000 did.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "banded.hpp"
#include "samples.hpp"
#include "snap.hpp"

namespace goshawk {

// Of log durations: their size and their second differences. Of knots: their size and the snap of the spline that they
// displace, at the durations to start from. Dearer second differences suit routes of many short segments, cheaper ones
// long legs; a factor of ten costs 1 to 3 % of the flight time at as many iterations.
class Smoothing {
  public:
    Smoothing(const double* durations, std::size_t segments, const unsigned char* free, const unsigned char* held)
        : times_(segments, 2), positions_(kOrders * (segments + 1), kStates - 1), yaw_(positions_) {
        for (std::size_t i = 0; i < segments; ++i) times_.at(i, i) = kTimes;
        for (std::size_t i = 2; i < segments; ++i) {  // (x_i - 2 x_i-1 + x_i-2)^2
            const double row[3] = {1.0, -2.0, 1.0};
            for (std::size_t a = 0; a < 3; ++a)
                for (std::size_t b = 0; b <= a; ++b) times_.at(i - 2 + a, i - 2 + b) += kBends * row[a] * row[b];
        }
        times_.factor();
        for (std::size_t i = 0; i <= segments; ++i) positions_.at(kOrders * i, kOrders * i) = 1.0;
        for (std::size_t i = 0; i < segments; ++i) {
            double power[kStates - 1];  // of the duration, from -7 to -1
            const double square = durations[i] * durations[i];
            power[0] = 1.0 / (square * square * square * durations[i]);
            for (std::size_t k = 1; k < kStates - 1; ++k) power[k] = power[k - 1] * durations[i];
            for (std::size_t a = 0; a < kStates; ++a)
                for (std::size_t b = 0; b <= a; ++b)
                    positions_.at(kOrders * i + a, kOrders * i + b) +=
                        kSnap * snap_form()[a][b] * power[a % kOrders + b % kOrders];
        }
        for (std::size_t i = 0; i <= segments; ++i)
            for (std::size_t r = 1; r < kOrders; ++r)
                if (i == 0 || i == segments || (r == 1 && held[i])) positions_.pin(kOrders * i + r);
        yaw_ = positions_;
        for (std::size_t i = 0; i <= segments; ++i) {
            const unsigned char* marks = free + i * kAxes;
            if (!(marks[0] || marks[1] || marks[2])) positions_.pin(kOrders * i);
            if (!marks[3]) yaw_.pin(kOrders * i);
        }
        positions_.factor();
        yaw_.factor();
        column_.resize(3 * kOrders * (segments + 1));
    }

    // From a gradient by log durations and along the directions in which knots move to the step that it asks for, in
    // place. A direction has a `knot` and how far it goes `along` each axis.
    template <typename Direction>
    void apply(std::vector<double>& x, const std::vector<Direction>& moving) {
        times_.solve<1>(x.data());
        double* steps = x.data() + (x.size() - moving.size());
        found_.assign(moving.size(), 0.0);
        apply<3>(positions_, 0, steps, moving);
        apply<1>(yaw_, 3, steps, moving);
        std::copy(found_.begin(), found_.end(), steps);
    }

  private:
    static constexpr double kTimes = 10.0, kBends = 10.0, kSnap = 1e-4;

    // Adds to `found_` what the steps along so many axes, from `axis` on, become.
    template <int kColumns, typename Direction>
    void apply(const Banded& metric, int axis, const double* steps, const std::vector<Direction>& moving) {
        std::fill(column_.begin(), column_.end(), 0.0);
        for (std::size_t n = 0; n < moving.size(); ++n)
            for (int c = 0; c < kColumns; ++c)
                column_[moving[n].knot * kOrders * kColumns + c] += moving[n].along[axis + c] * steps[n];
        metric.solve<kColumns>(column_.data());
        for (std::size_t n = 0; n < moving.size(); ++n)
            for (int c = 0; c < kColumns; ++c)
                found_[n] += moving[n].along[axis + c] * column_[moving[n].knot * kOrders * kColumns + c];
    }

    Banded times_, positions_, yaw_;
    std::vector<double> column_, found_;
};

}  // namespace goshawk
