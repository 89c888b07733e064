// Walking rays and triangles through a lattice of voxels. All coordinates here are in voxels: voxel (i, j, k) is the
// box from (i, j, k) to (i + 1, j + 1, k + 1).
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace goshawk {

struct Point {
    double v[3];
    double operator[](int a) const { return v[a]; }
    double& operator[](int a) { return v[a]; }
};

inline Point operator-(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Point cross(const Point& a, const Point& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Visit every voxel of the segment from `start` to `end`, in order, until visit(i, j, k) returns false (Amanatides and
// Woo). Voxels outside the lattice are skipped without being visited.
template <class Visit>
void walk(const Point& start, const Point& end, const std::ptrdiff_t* n, const Visit& visit) {
    const Point way = end - start;
    double enter = 0.0, leave = 1.0;  // where the segment is inside the lattice
    for (int a = 0; a < 3; ++a) {
        if (way[a] == 0.0) {
            if (start[a] < 0.0 || start[a] >= n[a]) return;
            continue;
        }
        const double t0 = -start[a] / way[a], t1 = (n[a] - start[a]) / way[a];
        enter = std::max(enter, std::min(t0, t1));
        leave = std::min(leave, std::max(t0, t1));
    }
    if (enter > leave) return;
    std::ptrdiff_t at[3], step[3];
    double next[3], per_voxel[3];
    for (int a = 0; a < 3; ++a) {
        const double p = start[a] + enter * way[a];
        at[a] = std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(std::floor(p)), 0, n[a] - 1);
        step[a] = way[a] > 0.0 ? 1 : -1;
        per_voxel[a] = way[a] == 0.0 ? std::numeric_limits<double>::infinity() : std::abs(1.0 / way[a]);
        const double face = way[a] > 0.0 ? at[a] + 1.0 : static_cast<double>(at[a]);
        next[a] = way[a] == 0.0 ? std::numeric_limits<double>::infinity() : (face - start[a]) / way[a];
    }
    while (visit(at[0], at[1], at[2])) {
        const int a = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
        if (next[a] > leave) return;
        at[a] += step[a];
        if (at[a] < 0 || at[a] >= n[a]) return;
        next[a] += per_voxel[a];
    }
}

// Whether a triangle touches the box of half extents `half` round `centre`: no axis separates them (Akenine-Moller).
inline bool touches(const Point* triangle, const Point& centre, double half) {
    const Point v[3] = {triangle[0] - centre, triangle[1] - centre, triangle[2] - centre};
    const Point edge[3] = {v[1] - v[0], v[2] - v[1], v[0] - v[2]};
    for (int a = 0; a < 3; ++a) {
        if (std::min({v[0][a], v[1][a], v[2][a]}) > half || std::max({v[0][a], v[1][a], v[2][a]}) < -half) return false;
    }
    const Point normal = cross(edge[0], edge[1]);
    const double reach = half * (std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]));
    if (std::abs(dot(normal, v[0])) > reach) return false;
    for (const Point& e : edge)
        for (int a = 0; a < 3; ++a) {
            Point unit{};
            unit[a] = 1.0;
            const Point axis = cross(unit, e);
            const double p0 = dot(axis, v[0]), p1 = dot(axis, v[1]), p2 = dot(axis, v[2]);
            const double r = half * (std::abs(axis[0]) + std::abs(axis[1]) + std::abs(axis[2]));
            if (std::min({p0, p1, p2}) > r || std::max({p0, p1, p2}) < -r) return false;
        }
    return true;
}

}  // namespace goshawk
