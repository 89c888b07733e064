// What the minimiser takes for the size of a step: smooth ones are small. A descent in this metric (a Sobolev gradient,
// as in CHOMP, Ratliff et al. 2009) moves the path as a whole where one in plain coordinates goes knot by knot: through
// a maze 100 iterations come as far as 3,000 did.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "samples.hpp"
#include "snap.hpp"

namespace goshawk {

// A symmetric positive definite matrix with so many diagonals below its main one, and its Cholesky factor.
class Banded {
  public:
    Banded(std::size_t size, std::size_t below) : size_(size), below_(below), rows_(size * (below + 1)) {}

    // Entry (i, j) with j <= i <= j + below.
    double& at(std::size_t i, std::size_t j) { return rows_[i * (below_ + 1) + below_ + j - i]; }
    double at(std::size_t i, std::size_t j) const { return rows_[i * (below_ + 1) + below_ + j - i]; }

    // Takes an unknown out: its solution is its right-hand side.
    void pin(std::size_t n) {
        for (std::size_t j = first(n); j < n; ++j) at(n, j) = 0.0;
        for (std::size_t i = n + 1; i < std::min(size_, n + below_ + 1); ++i) at(i, n) = 0.0;
        at(n, n) = 1.0;
    }

    void factor() {
        for (std::size_t i = 0; i < size_; ++i)
            for (std::size_t j = first(i); j <= i; ++j) {
                double sum = at(i, j);
                for (std::size_t k = first(i); k < j; ++k) sum -= at(i, k) * (k < first(j) ? 0.0 : at(j, k));
                at(i, j) = i == j ? 1.0 / std::sqrt(sum) : sum * at(j, j);  // the diagonal is kept inverted
            }
    }

    void solve(double* x) const {
        for (std::size_t i = 0; i < size_; ++i) {
            for (std::size_t j = first(i); j < i; ++j) x[i] -= at(i, j) * x[j];
            x[i] *= at(i, i);
        }
        for (std::size_t i = size_; i-- > 0;) {
            x[i] *= at(i, i);
            for (std::size_t j = first(i); j < i; ++j) x[j] -= at(i, j) * x[i];
        }
    }

  private:
    std::size_t first(std::size_t i) const { return i > below_ ? i - below_ : 0; }

    std::size_t size_, below_;
    std::vector<double> rows_;
};

// Of log durations: their size and their second differences. Of knots: their size and the snap of the spline that they
// displace, at the durations to start from. Dearer second differences suit routes of many short segments, cheaper ones
// long legs; a factor of ten costs 1 to 3 % of the flight time at as many iterations.
class Smoothing {
  public:
    Smoothing(const double* durations, std::size_t segments, const unsigned char* free, const unsigned char* held)
        : times_(segments, 2), column_(kOrders * (segments + 1)) {
        for (std::size_t i = 0; i < segments; ++i) times_.at(i, i) = kTimes;
        for (std::size_t i = 2; i < segments; ++i) {  // (x_i - 2 x_i-1 + x_i-2)^2
            const double row[3] = {1.0, -2.0, 1.0};
            for (std::size_t a = 0; a < 3; ++a)
                for (std::size_t b = 0; b <= a; ++b) times_.at(i - 2 + a, i - 2 + b) += kBends * row[a] * row[b];
        }
        times_.factor();
        Banded snap(column_.size(), kStates - 1);
        for (std::size_t i = 0; i <= segments; ++i) snap.at(kOrders * i, kOrders * i) = 1.0;
        for (std::size_t i = 0; i < segments; ++i)
            for (std::size_t a = 0; a < kStates; ++a)
                for (std::size_t b = 0; b <= a; ++b)
                    snap.at(kOrders * i + a, kOrders * i + b) +=
                        kSnap * snap_form()[a][b] *
                        std::pow(durations[i], static_cast<double>(a % kOrders + b % kOrders) - 7.0);
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
            knots_.push_back(snap);
            for (std::size_t i = 0; i <= segments; ++i) {
                if (!free[i * kAxes + axis]) knots_[axis].pin(kOrders * i);
                if (held[i]) knots_[axis].pin(kOrders * i + 1);
                for (std::size_t r = 1; r < kOrders && (i == 0 || i == segments); ++r)
                    knots_[axis].pin(kOrders * i + r);
            }
            knots_[axis].factor();
        }
    }

    // From a gradient by log durations and by the knots' numbers in `moving` to the step that it asks for, in place.
    void apply(std::vector<double>& x, const std::vector<std::size_t>& moving) {
        const std::size_t segments = x.size() - moving.size();
        times_.solve(x.data());
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
            std::fill(column_.begin(), column_.end(), 0.0);
            for (std::size_t n = 0; n < moving.size(); ++n)
                if (moving[n] % kAxes == axis) column_[moving[n] / kAxes * kOrders] = x[segments + n];
            knots_[axis].solve(column_.data());
            for (std::size_t n = 0; n < moving.size(); ++n)
                if (moving[n] % kAxes == axis) x[segments + n] = column_[moving[n] / kAxes * kOrders];
        }
    }

  private:
    static constexpr double kTimes = 10.0, kBends = 10.0, kSnap = 1e-4;
    Banded times_;
    std::vector<Banded> knots_;
    std::vector<double> column_;
};

}  // namespace goshawk
