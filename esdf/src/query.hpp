// Trilinear value and gradient of a field, point by point.
#pragma once
#include <cmath>
#include <cstddef>
#include <limits>

namespace goshawk {

struct Lattice {  // where voxel centres are: world = origin + (index + 0.5) * voxel
    double origin[3], per_voxel[3];
    std::ptrdiff_t n[3];
};

struct Cell {  // the eight voxel centres round a point
    std::ptrdiff_t index[3];
    float t[3];          // where in the cell, 0 to 1
    bool clamped[3];     // the point lies in the outer half voxel, where the field is continued as constant
};

// A point on the outer face stays inside however the division rounds.
constexpr double ROUNDING = 1e-9;

// False if the point is outside the lattice's voxels (or not a number).
inline bool locate(const Lattice& lattice, const double* point, Cell& cell) {
    for (int a = 0; a < 3; ++a) {
        const double n = static_cast<double>(lattice.n[a]);
        const double u = (point[a] - lattice.origin[a]) * lattice.per_voxel[a];
        if (!(u >= -ROUNDING && u <= n + ROUNDING)) return false;
        const double c = u - 0.5 < 0.0 ? 0.0 : u - 0.5 > n - 1.0 ? n - 1.0 : u - 0.5;
        cell.clamped[a] = c != u - 0.5;
        std::ptrdiff_t i = static_cast<std::ptrdiff_t>(c);
        if (i > lattice.n[a] - 2) i = lattice.n[a] > 1 ? lattice.n[a] - 2 : 0;
        cell.index[a] = i;
        cell.t[a] = static_cast<float>(c - static_cast<double>(i));
    }
    return true;
}

// corner: the cell's first voxel; step: distance to the next voxel of each axis (0 where the lattice is one voxel thick).
template <bool WANT_GRADIENT>
inline double interpolate(const float* corner, const std::ptrdiff_t* step, const Lattice& lattice, const Cell& cell, double* gradient) {
    const float* c00 = corner;
    const float* c01 = corner + step[1];
    const float* c10 = corner + step[0];
    const float* c11 = c10 + step[1];
    const std::ptrdiff_t dz = step[2];
    const float tx = cell.t[0], ty = cell.t[1], tz = cell.t[2];
    const float d00 = c00[dz] - c00[0], d01 = c01[dz] - c01[0], d10 = c10[dz] - c10[0], d11 = c11[dz] - c11[0];
    const float e00 = c00[0] + tz * d00, e01 = c01[0] + tz * d01, e10 = c10[0] + tz * d10, e11 = c11[0] + tz * d11;
    const float f0 = e00 + ty * (e01 - e00), f1 = e10 + ty * (e11 - e10);
    if constexpr (WANT_GRADIENT) {
        const float gy0 = e01 - e00, gy1 = e11 - e10, gz0 = d00 + ty * (d01 - d00), gz1 = d10 + ty * (d11 - d10);
        const float g[3] = {f1 - f0, gy0 + tx * (gy1 - gy0), gz0 + tx * (gz1 - gz0)};
        for (int a = 0; a < 3; ++a) gradient[a] = cell.clamped[a] ? 0.0 * g[a] : g[a] * lattice.per_voxel[a];
    }
    return f0 + tx * (f1 - f0);
}

}  // namespace goshawk
