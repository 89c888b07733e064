// Truncated signed distance on a grid of voxels, averaged over range images. Voxel (i, j, k) has its centre at
// origin + (i + 0.5, j + 0.5, k + 0.5) * voxel; k runs fastest. A voxel with weight 0 was never observed.
#pragma once
#include <cstddef>
#include <cstdint>

#include "lens.hpp"

namespace goshawk {

struct Volume {
    Vec3 origin;
    double voxel;
    int shape[3];
    float* distance;  // metres, within +-truncation, positive in front of the surface
    float* weight;
    float* colour;  // `channels` values a voxel
    float* colour_weight;
    int channels;

    std::size_t index(int i, int j, int k) const { return (static_cast<std::size_t>(i) * shape[1] + j) * shape[2] + k; }
};

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
void facing(const float* inverse_range, const double* rays, int height, int width, int step, float unsure, int threads,
            float* cosine);

// Counts, for each voxel, the images that saw through it, over its whole width: it is nearer than anything can be on
// any of its rays (`bound`, 1/m, the largest inverse range that is possible; 0 = not known) by more than `margin`. A
// voxel with `enough` of them, at most 255, is not examined any more.
void carve(const Volume& volume, const float* bound, const Lens& lens, const double* T_camera_world, double margin,
           double farthest, int enough, int threads, std::uint8_t* seen_through);

void integrate(const Volume& volume, const RangeImage& image, const double* T_camera_world, const Fusion& fusion,
               int threads);

}  // namespace goshawk
