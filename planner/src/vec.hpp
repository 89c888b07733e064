// Three numbers with the operations the planner's formulas need.
#pragma once

namespace goshawk {

struct Vec {
    double x = 0.0, y = 0.0, z = 0.0;
    Vec operator+(const Vec& o) const { return {x + o.x, y + o.y, z + o.z}; }
    Vec operator-(const Vec& o) const { return {x - o.x, y - o.y, z - o.z}; }
    Vec operator*(double s) const { return {x * s, y * s, z * s}; }
    Vec& operator+=(const Vec& o) { return *this = *this + o; }
    Vec& operator-=(const Vec& o) { return *this = *this - o; }
    double dot(const Vec& o) const { return x * o.x + y * o.y + z * o.z; }
};

}  // namespace goshawk
