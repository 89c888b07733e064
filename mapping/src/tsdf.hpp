// Truncated signed distance at the voxels near surfaces, averaged over range images. A voxel with weight 0 was never
// observed.
#pragma once
#include <cstddef>
#include <cstdint>

#include "bricks.hpp"
#include "lens.hpp"

namespace goshawk {

struct Volume {
    VoxelGrid grid;
    int count;                  // of the bricks near surfaces
    const std::int32_t* place;  // x, y, z of each among all bricks, in their order
    float* distance;            // of the voxels of each: metres, within +-truncation, positive in front of the surface
    float* weight;
    float* scatter;        // weighted sum of the squared differences of the measured distances from their mean
    std::uint8_t* images;  // that measured a surface within the truncation, at most 255
    float* colour;         // `channels` values a voxel
    float* colour_weight;
    int channels;

    Brick brick(int n) const { return {grid, place[3 * n], place[3 * n + 1], place[3 * n + 2]}; }
};

// Beyond this ratio of two ranges side by side they are not of one surface, and nothing is interpolated.
constexpr float largest_jump = 1.1f;

struct RangeImage {
    const float* inverse_range;  // 1/m along the ray, 0 = none
    const float* deviation;      // of the inverse range
    const float* facing;         // cosine between the ray and the surface normal, 0 to 1
    const std::uint8_t* colour;  // channels a pixel, same size
    Lens lens;
};

struct Fusion {
    double truncation;
    double farthest;  // ranges beyond this are not used
};

// How squarely each ray meets the surface: the cosine between the ray and the normal of the plane through the points
// `step` pixels around. Without it, distance along the ray overstates distance to a slanted surface, and a floor seen
// at a grazing angle looks free. `unsure` where the neighbours do not lie on one surface.
void facing(const float* inverse_range, const double* rays, int height, int width, int step, float unsure,
            float* cosine);

// Counts, for each voxel, the images that saw through it, over its whole width: it is nearer than anything can be on
// any of its rays (`bound`, 1/m, the largest inverse range that is possible; 0 = not known) by more than `margin`. A
// voxel with `enough` of them, at most 255, is not examined any more.
void carve(const VoxelGrid& grid, const float* bound, const Lens& lens, const double* T_camera_world, double margin,
           double farthest, int enough, int threads, std::uint8_t* seen_through);

void integrate(const Volume& volume, const RangeImage& image, const double* T_camera_world, const Fusion& fusion,
               int threads);

}  // namespace goshawk
