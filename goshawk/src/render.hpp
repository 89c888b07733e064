// The image of one camera in a scene of textured solids.
#pragma once
#include "raycast.hpp"
#include "texture.hpp"

namespace goshawk {

struct Exposure {
    double gain;      // grey levels per unit of light
    double noise;     // standard deviation of the read noise, grey levels
    double vignette;  // share of light lost at 90 degrees from the axis
    std::uint64_t seed;
};

// `rays` are unit directions in the camera frame through the pixel centres, row by row.
void render(const std::vector<Solid>& solids, const std::vector<Material>& materials, const std::vector<Vec3>& lamps,
            const double* rays, int height, int width, const Pose& T_world_camera, const Exposure& exposure,
            int threads, std::uint8_t* image);

}  // namespace goshawk
