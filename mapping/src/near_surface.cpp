#include "near_surface.hpp"

#include <algorithm>
#include <cmath>

namespace goshawk {
namespace {

// What `integrate` samples anywhere within a pixel: ranges from `nearest` to `farthest`, on rays that run at most
// `aside` times the range beside that of the pixel's middle. Taken from the middles of the pixels around, which lie
// twice as far away as the pixel's own border.
struct Samples {
    double nearest, farthest, aside;
};

Samples samples_of_pixel(const RangeImage& image, const double* rays, int row, int column) {
    const int width = image.lens.width, i = row * width + column;
    const float own = image.inverse_range[i];
    float low = own, high = own;
    double squared = 0.0;
    for (int r = std::max(row - 1, 0); r <= std::min(row + 1, image.lens.height - 1); ++r)
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, width - 1); ++c) {
            const int n = r * width + c;
            const Vec3 apart{rays[3 * n] - rays[3 * i], rays[3 * n + 1] - rays[3 * i + 1],
                             rays[3 * n + 2] - rays[3 * i + 2]};
            squared = std::max(squared, dot(apart, apart));
            const float value = image.inverse_range[n];
            if (std::max(own, value) > largest_jump * std::min(own, value)) continue;  // or there is none
            low = std::min(low, value);
            high = std::max(high, value);
        }
    return {1.0 / high, 1.0 / low, std::sqrt(squared)};
}

// Marks the bricks that a box reaches into, from `low` to `high` in voxels.
void mark_box(const VoxelGrid& grid, const double (&low)[3], const double (&high)[3], std::uint8_t* near) {
    int first[3], last[3];
    for (int axis = 0; axis < 3; ++axis) {
        if (high[axis] < 0.0 || low[axis] >= grid.shape[axis]) return;
        first[axis] = static_cast<int>(std::max(low[axis], 0.0)) / brick_size;
        last[axis] = static_cast<int>(std::min(high[axis], grid.shape[axis] - 1.0)) / brick_size;
    }
    for (int x = first[0]; x <= last[0]; ++x)
        for (int y = first[1]; y <= last[1]; ++y)
            for (int z = first[2]; z <= last[2]; ++z) near[grid.brick_index(x, y, z)] = 1;
}

}  // namespace

void mark_near_surface(const VoxelGrid& grid, const RangeImage& image, const double* rays, const double* T_world_camera,
                       const Fusion& fusion, std::uint8_t* near) {
    const Pose pose(T_world_camera);
    const Vec3 camera = (1.0 / grid.voxel) * (pose.translation() - grid.origin);
    const double longest = 0.5 * brick_size * grid.voxel;
    for (int row = 0; row < image.lens.height; ++row)
        for (int column = 0; column < image.lens.width; ++column) {
            const int i = row * image.lens.width + column;
            if (!(image.inverse_range[i] > 0.0f)) continue;
            const Samples samples = samples_of_pixel(image, rays, row, column);
            if (samples.nearest > fusion.farthest) continue;
            // In front as far as a slanted surface is less than a voxel away.
            const double start = std::max(samples.nearest - grid.voxel / image.facing[i], 0.0);
            const double end = samples.farthest + fusion.truncation;
            const Vec3 ray = (1.0 / grid.voxel) * pose.rotate({rays[3 * i], rays[3 * i + 1], rays[3 * i + 2]});
            const int parts = 1 + static_cast<int>((end - start) / longest);
            const double length = (end - start) / parts;
            for (int part = 0; part < parts; ++part) {
                const double from = start + part * length, to = from + length;
                const double around = to * samples.aside / grid.voxel + 1.0;  // and the voxels beside
                double low[3], high[3];
                for (int axis = 0; axis < 3; ++axis) {
                    const double a = camera[axis] + from * ray[axis], b = camera[axis] + to * ray[axis];
                    low[axis] = std::min(a, b) - around;
                    high[axis] = std::max(a, b) + around;
                }
                mark_box(grid, low, high, near);
            }
        }
}

}  // namespace goshawk
