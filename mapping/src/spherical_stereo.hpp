// Two views of a moving fisheye camera as a stereo pair: columns are the angle from the baseline, rows the angle round
// it, so that a point lies in the same row of both and its shift along the row is the angle at which it sees the
// baseline. No direction is singular except the baseline itself.
#pragma once
#include <cstdint>
#include <vector>

#include "lens.hpp"

namespace goshawk {

// Column c looks at angle from_baseline - (c + 0.5) * column_step, row r at from_axis + (r + 0.5) * row_step.
struct SphericalGrid {
    double from_baseline, column_step, from_axis, row_step;
    int rows, columns;
};

// `R_camera_grid` (row major 3x3): its first column is the direction of the baseline in the camera frame.
// Bilinear sampling of the image; 0 where the lens shows nothing.
void rectify(const std::uint8_t* image, const Lens& lens, const double* R_camera_grid, const SphericalGrid& grid,
             std::uint8_t* out);

struct StereoPair {
    double baseline_m;
    const double* T_partner_camera;  // row major 4x4
    double disparity_std_px;
    double largest_relative_std;  // of the inverse range; measurements worse than this are dropped
    double deviations;            // how much nearer than measured, in standard deviations, a surface may be
};

// For every ray of the camera (unit vectors) the inverse range (1/m along the ray, 0 = none), its standard deviation,
// and the largest inverse range that the match allows: whatever the ray meets is at least that far away. Near the
// baseline, where parallax is too small for a depth, this bound is still useful. Disparities are in 1/16 of a column:
// `disparity` is the match, at most 0 where there is none; `nearest` the largest that is possible, negative where that
// is not known.
void inverse_range(const std::int16_t* disparity, const std::int16_t* nearest, const SphericalGrid& grid,
                   const double* R_camera_grid, const StereoPair& pair, const Lens& partner, const double* rays,
                   int count, float* inverse_range, float* standard_deviation, float* bound);

// Several measurements of each pixel to one: the mean of the largest group that agrees within `tolerance` standard
// deviations, if it has at least `least` members. `values`, `deviations`: (layers, count), 0 = none.
void fuse(const float* values, const float* deviations, int layers, int count, double tolerance, int least,
          float* value, float* deviation);

}  // namespace goshawk
