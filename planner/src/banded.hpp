// Symmetric matrices whose entries lie near the diagonal, and their Cholesky factors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "samples.hpp"

namespace goshawk {

// A symmetric positive definite matrix with so many diagonals below its main one, and its Cholesky factor. Each column
// has a last row, below which it is zero. Columns are contiguous.
class Banded {
  public:
    Banded(std::size_t size, std::size_t below) : size_(size), below_(below), columns_(size * (below + 1)), end_(size) {
        for (std::size_t j = 0; j < size; ++j) end_[j] = std::min(size, j + below + 1);
    }

    // Where a column ends: one row beyond its last, at most `below` rows under the diagonal, and not before the column
    // to the left of it ends.
    void set_end(std::size_t column, std::size_t row) { end_[column] = row; }

    // Entry (i, j) with j <= i <= j + below.
    double& at(std::size_t i, std::size_t j) { return columns_[j * (below_ + 1) + i - j]; }
    const double& at(std::size_t i, std::size_t j) const { return columns_[j * (below_ + 1) + i - j]; }

    // Takes an unknown out: its solution is its right-hand side.
    void pin(std::size_t n) {
        for (std::size_t j = n > below_ ? n - below_ : 0; j < n; ++j) at(n, j) = 0.0;
        std::fill(&at(n, n), &at(n, n) + (end_[n] - n), 0.0);
        at(n, n) = 1.0;
    }

    void clear() { std::fill(columns_.begin(), columns_.end(), 0.0); }

    // In place; false where the matrix is not positive definite.
    bool factor() { return kernels().factor(columns_.data(), size_, below_, end_.data()); }

    // In place for columns x (size, columns).
    template <int kColumns>
    void solve(double* x) const {
        const auto subtract = [&](std::size_t to, std::size_t from, double factor) {
            for (int c = 0; c < kColumns; ++c) x[to * kColumns + c] -= factor * x[from * kColumns + c];
        };
        const auto scale = [&](std::size_t i) {
            for (int c = 0; c < kColumns; ++c) x[i * kColumns + c] *= at(i, i);
        };
        for (std::size_t j = 0; j < size_; ++j) {
            scale(j);
            for (std::size_t i = j + 1; i < end_[j]; ++i) subtract(i, j, at(i, j));
        }
        for (std::size_t j = size_; j-- > 0;) {
            for (std::size_t i = j + 1; i < end_[j]; ++i) subtract(j, i, at(i, j));
            scale(j);
        }
    }

  private:
    std::size_t size_, below_;
    std::vector<double> columns_;
    std::vector<std::size_t> end_;
};

}  // namespace goshawk
