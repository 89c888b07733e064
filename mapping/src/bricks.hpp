// A grid of voxels in bricks: cubes of `brick_size` voxels along each side, from the corner of voxel (0, 0, 0) on.
// Voxel (i, j, k) has its centre at origin + (i + 0.5, j + 0.5, k + 0.5) * voxel; k runs fastest.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "vec3.hpp"

namespace goshawk {

constexpr int brick_size = 8;
constexpr std::size_t brick_voxels = brick_size * brick_size * brick_size;

struct VoxelGrid {
    Vec3 origin;
    double voxel;
    int shape[3];

    std::size_t index(int i, int j, int k) const { return (static_cast<std::size_t>(i) * shape[1] + j) * shape[2] + k; }
    int bricks(int axis) const { return (shape[axis] + brick_size - 1) / brick_size; }
    std::size_t brick_index(int x, int y, int z) const {
        return (static_cast<std::size_t>(x) * bricks(1) + y) * bricks(2) + z;
    }
};

// Voxels from `low` to before `high`. Bricks at the upper faces of the grid may reach beyond it; this does not.
struct Brick {
    int low[3], high[3];

    Brick(const VoxelGrid& grid, int x, int y, int z) : low{brick_size * x, brick_size * y, brick_size * z} {
        for (int axis = 0; axis < 3; ++axis) high[axis] = std::min(low[axis] + brick_size, grid.shape[axis]);
    }
};

// Place of a voxel among those of its brick.
inline std::size_t within_brick(int i, int j, int k) {
    return ((i % brick_size) * brick_size + j % brick_size) * brick_size + k % brick_size;
}

}  // namespace goshawk
