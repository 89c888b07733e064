// Three doubles with the few operations the kernels need.
#pragma once
#include <cmath>

namespace goshawk {

struct Vec3 {
    double x = 0.0, y = 0.0, z = 0.0;
    double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double norm(Vec3 a) { return std::sqrt(dot(a, a)); }
inline Vec3 normalised(Vec3 a) { return (1.0 / norm(a)) * a; }

// A rigid transform stored as the upper three rows of a row-major 4x4 matrix.
struct Pose {
    double m[12];
    explicit Pose(const double* row_major_4x4) {
        for (int i = 0; i < 12; ++i) m[i] = row_major_4x4[i];
    }
    Vec3 rotate(Vec3 v) const {
        return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
                m[8] * v.x + m[9] * v.y + m[10] * v.z};
    }
    Vec3 rotate_back(Vec3 v) const {
        return {m[0] * v.x + m[4] * v.y + m[8] * v.z, m[1] * v.x + m[5] * v.y + m[9] * v.z,
                m[2] * v.x + m[6] * v.y + m[10] * v.z};
    }
    Vec3 translation() const { return {m[3], m[7], m[11]}; }
    Vec3 apply(Vec3 p) const { return rotate(p) + translation(); }
};

}  // namespace goshawk
