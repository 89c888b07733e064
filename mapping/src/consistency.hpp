// How near a surface could be without the two images of a rectified pair contradicting it.
#pragma once
#include <cstdint>

namespace goshawk {

struct Agreement {
    double noise;       // standard deviation of the difference of two grey values that show the same thing
    double deviations;  // how many of them one pixel may differ by
    double mean;        // how many of them a block of 5x5 may differ by in the mean
};

// `disparity` and `nearest`: 1/16 of a column, below 0 where nothing is known. The claimed disparity is refused where
// the pixel itself differs from its match: block matching gives the pixels of a thin object the disparity of what lies
// behind it. Else `nearest` is the largest disparity up to which, from the claimed one on, the block looks alike: in a
// plain region all of them do. The images are equally bright.
void nearest_disparity(const std::uint8_t* left, const std::uint8_t* right, const std::int16_t* disparity, int rows,
                       int columns, int disparities, const Agreement& agreement, std::int16_t* nearest);

}  // namespace goshawk
