// Symmetric matrices whose entries lie near the diagonal, and their Cholesky factors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

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

    void clear() { std::fill(rows_.begin(), rows_.end(), 0.0); }

    // In place; false where the matrix is not positive definite.
    bool factor() {
        for (std::size_t i = 0; i < size_; ++i)
            for (std::size_t j = first(i); j <= i; ++j) {
                const double *a = &at(i, first(i)), *b = &at(j, first(i));
                double sums[4] = {at(i, j)};  // four at a time: one sum would wait for each subtraction
                std::size_t k = 0, count = j - first(i);
                for (; k + 4 <= count; k += 4)
                    for (std::size_t l = 0; l < 4; ++l) sums[l] -= a[k + l] * b[k + l];
                for (; k < count; ++k) sums[0] -= a[k] * b[k];
                const double sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
                if (i == j && !(sum > 0.0)) return false;
                at(i, j) = i == j ? 1.0 / std::sqrt(sum) : sum * at(j, j);  // the diagonal is kept inverted
            }
        return true;
    }

    // In place for columns x (size, columns).
    template <int kColumns>
    void solve(double* x) const {
        const auto subtract = [&](std::size_t to, std::size_t from, double factor) {
            for (int c = 0; c < kColumns; ++c) x[to * kColumns + c] -= factor * x[from * kColumns + c];
        };
        const auto scale = [&](std::size_t i) {
            for (int c = 0; c < kColumns; ++c) x[i * kColumns + c] *= at(i, i);
        };
        for (std::size_t i = 0; i < size_; ++i) {
            for (std::size_t j = first(i); j < i; ++j) subtract(i, j, at(i, j));
            scale(i);
        }
        for (std::size_t i = size_; i-- > 0;) {
            scale(i);
            for (std::size_t j = first(i); j < i; ++j) subtract(j, i, at(i, j));
        }
    }

  private:
    std::size_t first(std::size_t i) const { return i > below_ ? i - below_ : 0; }

    std::size_t size_, below_;
    std::vector<double> rows_;
};

}  // namespace goshawk
