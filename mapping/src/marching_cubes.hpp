// The surface where a sampled function is zero, as triangles.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "tsdf.hpp"

namespace goshawk {

struct Mesh {
    std::vector<Vec3> vertices;                      // world, metres
    std::vector<std::array<std::int32_t, 3>> faces;  // counter-clockwise seen from free space
    std::vector<float> colours;                      // `channels` values a vertex
    std::vector<float> weights, scatters;            // of the distance volume
    std::vector<std::uint8_t> images;                // that measured the nearer voxel
};

// Only cells whose eight corners all have at least `least_weight` make triangles: a surface is never drawn where one
// side of it was not seen.
Mesh marching_cubes(const Volume& volume, double least_weight);

}  // namespace goshawk
