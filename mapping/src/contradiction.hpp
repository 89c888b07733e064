// Which pixels other images do not explain by the reconstructed surface, and which free voxels such pixels look
// through.
#pragma once
#include <algorithm>
#include <cstdint>

#include "bricks.hpp"
#include "lens.hpp"

namespace goshawk {

// The surface as one plane in each voxel that it passes through.
struct Planes {
    static constexpr std::int32_t blocked = -2;  // something is there, though no plane

    VoxelGrid grid;
    const std::int32_t* number;  // of the plane in each voxel, `blocked`, or another below 0
    const std::uint8_t* filled;  // 0 for each brick without planes, in which nothing blocks a ray
    const double* plane;         // point and unit normal, six values each
};

// Range along each ray to the first plane; 0 where there is none within `farthest`, or something blocks the ray before.
void surface_ranges(const Planes& planes, const double* rays, int count, const double* T_world_camera, double farthest,
                    float* range);

// An image with the range image of the surface, whose size divides the image's.
struct ShownSurface {
    const std::uint8_t* grey;
    const float* range;  // 0 = not known
    int range_width, range_height;
    Lens lens;

    // Nearest pixel's range at a place of the image.
    double range_at(double u, double v) const {
        const int row = static_cast<int>(v * range_height / lens.height);
        const int column = static_cast<int>(u * range_width / lens.width);
        return range[std::min(row, range_height - 1) * range_width + std::min(column, range_width - 1)];
    }
};

// Grey value and place of each pixel's surface point in another image: `matched` is 0 where that does not see it. Only
// every `step`th pixel of each `step`th row, from the middle of the first `step` on.
void match_through_surface(const ShownSurface& image, const double* rays, const ShownSurface& partner,
                           const double* T_partner_camera, int step, float* matched);

// What another image shows of the surface points, and how much it may differ.
struct Comparison {
    const std::uint8_t* least;  // of the partner's grey values round each of its pixels
    const std::uint8_t* most;
    const float* gain;  // brightness of the image as the partner shows it, for each `step`th pixel and row
    int step;
    double allowed;  // grey levels below the least and above the most
    int enough;      // partners that agree; more are not asked
};

// Adds one to the first count of each pixel if the partner shows the surface there alike, to the second if the pixel is
// lighter, to the third if it is darker; to none if the partner does not see the surface there. Only every second pixel
// is asked, as on a chessboard.
void compare_through_surface(const ShownSurface& image, const double* rays, const ShownSurface& partner,
                             const double* T_partner_camera, const Comparison& comparison, std::uint8_t* counts);

struct LookOptions {
    double nearest, farthest;  // range of the voxels that are looked at
    double margin;             // how far the surface lies behind them
    double least_tested;       // share of a voxel's pixels that are tested
    int least_pixels;          // that are not explained, for a contradiction
    double least_share;        // as a share of the pixels across the voxel
    double least_rate;         // and as a share of its tested pixels
};

// Counts, for each marked voxel, one look of an image in which its pixels are tested and show what lies behind it; and
// one contradiction if enough of these pixels are not explained. A voxel with 255 looks is not examined any more.
void count_looks(const VoxelGrid& grid, const std::uint8_t* marked, const std::uint8_t* verdict,
                 const ShownSurface& image, const double* T_camera_world, const LookOptions& options, int threads,
                 std::uint8_t* looks, std::uint8_t* contradictions);

}  // namespace goshawk
