#include "consistency.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace goshawk {
namespace {

constexpr int reach = 2;  // of a block, from its middle

// Value of a row between two columns; negative beside the row.
double between(const std::uint8_t* row, int columns, double column) {
    const int c = static_cast<int>(std::floor(column));
    if (c < 0 || c + 1 >= columns) return -1.0;
    return row[c] + (column - c) * (row[c + 1] - row[c]);
}

// What half a pixel of displacement may change at a pixel.
double half_step(const std::uint8_t* p, int columns) {
    const int here = p[0];
    return 0.5 * std::max({std::abs(here - p[-1]), std::abs(here - p[1]), std::abs(here - p[-columns]),
                           std::abs(here - p[columns])});
}

constexpr int width = 2 * reach + 1;

// Sum of the absolute differences of the first `columns` values.
int difference(const std::uint8_t* a, const std::uint8_t* b, int columns) {
    int sum = 0;
    for (int c = 0; c < columns; ++c) sum += std::abs(a[c] - b[c]);
    return sum;
}

// Whether the blocks round a pixel and round its match differ by at most `most` in all, as far as both are in the
// images.
bool alike(const std::uint8_t* left, const std::uint8_t* right, int row, int column, int disparity, int rows,
           int columns, int most) {
    const int first = std::max(column - reach, disparity), last = std::min(column + reach, columns - 1);
    int sum = 0;
    for (int r = std::max(row - reach, 0); r <= std::min(row + reach, rows - 1) && sum <= most; ++r) {
        const std::uint8_t* here = left + static_cast<std::size_t>(r) * columns + first;
        const std::uint8_t* there = right + static_cast<std::size_t>(r) * columns + first - disparity;
        // a whole row is by far the most frequent, and twice as fast when its width is a constant
        sum += last - first + 1 == width ? difference(here, there, width) : difference(here, there, last - first + 1);
    }
    return sum <= most;
}

}  // namespace

void nearest_disparity(const std::uint8_t* left, const std::uint8_t* right, const std::int16_t* disparity, int rows,
                       int columns, int disparities, const Agreement& agreement, std::int16_t* nearest) {
    const int most = static_cast<int>(width * width * agreement.mean * agreement.noise);
    for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) {
            const std::size_t i = static_cast<std::size_t>(r) * columns + c;
            nearest[i] = -16;
            if (disparity[i] < 0 || left[i] == 0 || r == 0 || c == 0 || r + 1 == rows || c + 1 == columns) continue;
            const double claimed = disparity[i] / 16.0;
            const double found = between(right + static_cast<std::size_t>(r) * columns, columns, c - claimed);
            const double allowed = agreement.deviations * agreement.noise + half_step(left + i, columns);
            if (found < 0.0 || std::abs(left[i] - found) > allowed) continue;
            int last = disparity[i];
            for (int next = last / 16 + 1; next < disparities && alike(left, right, r, c, next, rows, columns, most);
                 ++next)
                last = 16 * next;
            nearest[i] = static_cast<std::int16_t>(last);
        }
    }
}

}  // namespace goshawk
