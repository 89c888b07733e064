// The Cholesky factor of a banded matrix. Without a name outside of the file that includes it, like `vec.hpp`.
#pragma once

#include <cmath>
#include <cstddef>

namespace {

constexpr std::size_t kPanel = 4;  // columns that are taken off the later ones together: a quarter of the passes

// later[i] -= the sum over `width` columns of factor * column[i]. The order of the differences is that of single
// columns.
inline void take_off(double* __restrict later, const double* const* columns, const double* factors, std::size_t width,
                     std::size_t count) {
    if (width == kPanel) {
        const double *a = columns[0], *b = columns[1], *c = columns[2], *d = columns[3];
        for (std::size_t i = 0; i < count; ++i)
            later[i] = later[i] - factors[0] * a[i] - factors[1] * b[i] - factors[2] * c[i] - factors[3] * d[i];
        return;
    }
    for (std::size_t p = 0; p < width; ++p)
        for (std::size_t i = 0; i < count; ++i) later[i] -= factors[p] * columns[p][i];
}

// See `Kernels`; column j holds rows j to j + below, zero from row end[j] on.
bool factor(double* entries, std::size_t size, std::size_t below, const std::size_t* end) {
    const auto at = [&](std::size_t i, std::size_t j) { return entries + j * (below + 1) + (i - j); };
    for (std::size_t first = 0, width; first < size; first += width) {
        const std::size_t last = end[first];
        for (width = 1; width < kPanel && first + width < size && end[first + width] == last;) ++width;
        const double* columns[kPanel];
        double factors[kPanel];
        for (std::size_t p = 0; p < width; ++p) {  // the panel's own columns, each with those before it taken off
            const std::size_t j = first + p;
            double* column = at(j, j);
            if (!(column[0] > 0.0)) return false;
            column[0] = 1.0 / std::sqrt(column[0]);
            for (std::size_t k = 1; k < last - j; ++k) column[k] *= column[0];
            for (std::size_t later = j + 1; later < first + width; ++later) {
                columns[0] = at(later, j);
                factors[0] = *columns[0];
                take_off(at(later, later), columns, factors, 1, last - later);
            }
        }
        for (std::size_t later = first + width; later < last; ++later) {
            for (std::size_t p = 0; p < width; ++p) {
                columns[p] = at(later, first + p);
                factors[p] = *columns[p];
            }
            take_off(at(later, later), columns, factors, width, last - later);
        }
    }
    return true;
}

}  // namespace
