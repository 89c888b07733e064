// Which bricks hold surfaces, by a range image.
#pragma once
#include <cstdint>

#include "tsdf.hpp"

namespace goshawk {

// Marks, in `near` (bricks along x, y, z), every brick with a voxel to which `integrate` adds a distance of less than a
// voxel, and with a voxel beside such a one: in other bricks nothing is occupied and no surface passes. A few more are
// marked, too. `rays` are those of the pixels.
void mark_near_surface(const VoxelGrid& grid, const RangeImage& image, const double* rays, const double* T_world_camera,
                       const Fusion& fusion, std::uint8_t* near);

}  // namespace goshawk
