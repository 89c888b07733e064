// Procedural paint: a function of the point in space, so that it has no seams and, unless asked to, does not repeat.
// Details smaller than what a pixel covers are faded out, which keeps distant walls from shimmering.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "vec3.hpp"

namespace goshawk {

struct Material {
    float albedo;
    float patch_size_m, patch_contrast;  // largest patches of the mosaic; three finer levels follow
    float noise_size_m, noise_contrast;  // longest wave of the noise; four finer octaves follow
    std::uint32_t seed;
    double period_m;  // the paint repeats in x, y and z, as tiles and wallpaper do; 0: it does not
};

inline std::uint32_t mix(std::uint32_t h) {
    h ^= h >> 16;
    h *= 0x7feb352dU;
    h ^= h >> 15;
    h *= 0x846ca68bU;
    return h ^ (h >> 16);
}

inline float lattice(int x, int y, int z, std::uint32_t seed) {
    std::uint32_t h = seed;
    h = mix(h ^ static_cast<std::uint32_t>(x) * 0x9e3779b1U);
    h = mix(h ^ static_cast<std::uint32_t>(y) * 0x85ebca77U);
    h = mix(h ^ static_cast<std::uint32_t>(z) * 0xc2b2ae3dU);
    return static_cast<float>(h >> 8) * (1.0f / 16777216.0f);
}

inline int floor_int(float v) {
    const int i = static_cast<int>(v);
    return i - (v < static_cast<float>(i));
}

// How much of a detail of this size survives in a pixel that covers `footprint`.
inline float visible(float size_m, float footprint_m) {
    return std::clamp(2.0f - 2.5f * footprint_m / size_m, 0.0f, 1.0f);
}

inline float value_noise(float x, float y, float z, std::uint32_t seed) {
    const int i = floor_int(x), j = floor_int(y), k = floor_int(z);
    float u = x - i, v = y - j, w = z - k;
    u = u * u * (3.0f - 2.0f * u);
    v = v * v * (3.0f - 2.0f * v);
    w = w * w * (3.0f - 2.0f * w);
    float layers[2];
    for (int c = 0; c < 2; ++c) {
        const float a = lattice(i, j, k + c, seed), b = lattice(i + 1, j, k + c, seed);
        const float d = lattice(i, j + 1, k + c, seed), e = lattice(i + 1, j + 1, k + c, seed);
        const float near = a + u * (b - a), far = d + u * (e - d);
        layers[c] = near + v * (far - near);
    }
    return layers[0] + w * (layers[1] - layers[0]);
}

// A turn between levels: cutting turned cells with a wall gives irregular polygons, corners in all directions.
inline void turn(float& x, float& y, float& z) {
    const float a = 0.36f * x + 0.48f * y - 0.80f * z, b = -0.80f * x + 0.60f * y,
                c = 0.48f * x + 0.64f * y + 0.60f * z;
    x = a + 0.371f;
    y = b + 0.193f;
    z = c + 0.527f;
}

inline Vec3 within_period(Vec3 p, double period_m) {
    if (period_m <= 0.0) return p;
    return {p.x - period_m * std::floor(p.x / period_m), p.y - period_m * std::floor(p.y / period_m),
            p.z - period_m * std::floor(p.z / period_m)};
}

struct PaintPoint {
    float x, y, z;
    explicit PaintPoint(Vec3 p)  // shifted, so that walls at round coordinates do not lie on the edge of a patch
        : x(static_cast<float>(p.x) + 0.0137f),
          y(static_cast<float>(p.y) + 0.0219f),
          z(static_cast<float>(p.z) + 0.0173f) {}
};

// Patches with sharp edges at four scales, about zero.
inline float mosaic(const Material& material, Vec3 point, float footprint_m) {
    auto [x, y, z] = PaintPoint(within_period(point, material.period_m));
    float value = 0.0f, size = material.patch_size_m, contrast = material.patch_contrast;
    for (std::uint32_t level = 0; level < 4; ++level) {
        const float share = visible(size, footprint_m);
        if (share <= 0.0f) break;
        const float scale = 1.0f / size;
        const int row = floor_int(z * scale);  // every other row is shifted by half a patch, as bricks are
        const int i = floor_int(x * scale + 0.5f * (row & 1)), j = floor_int(y * scale + 0.5f * (row & 1));
        const bool shown = level == 0 || lattice(i, j, row, material.seed + level) < 0.45f;
        if (shown) value += share * contrast * (lattice(j, row, i, material.seed + 31 * level) - 0.5f);
        turn(x, y, z);
        size *= 0.42f;
        contrast *= 0.9f;
    }
    return value;
}

// Smooth stains in five octaves, about zero.
inline float stains(const Material& material, Vec3 point, float footprint_m) {
    const auto [x, y, z] = PaintPoint(within_period(point, material.period_m));
    float value = 0.0f, size = material.noise_size_m, contrast = material.noise_contrast;
    for (std::uint32_t octave = 0; octave < 5; ++octave) {
        const float share = visible(size, footprint_m);
        if (share <= 0.0f) break;
        const float scale = 1.0f / size;
        value += share * contrast * (value_noise(x * scale, y * scale, z * scale, material.seed + 101 * octave) - 0.5f);
        size *= 0.5f;
        contrast *= 0.75f;
    }
    return value;
}

}  // namespace goshawk
