// Four instants at a time: numbers in fours, and vectors of them, with the operations the planner's formulas need.
// Without a name outside of the file that includes it, as each such file is compiled for a processor of its own.
#pragma once

#include <cmath>

#include "samples.hpp"

namespace {

using goshawk::kLanes;
// The compiler turns + - * / and comparisons into vector instructions; the same sums on every processor.
typedef double Real __attribute__((vector_size(kLanes * sizeof(double))));
typedef long long Whole __attribute__((vector_size(kLanes * sizeof(long long))));

inline Real all(double value) { return Real{} + value; }
inline Real larger(Real a, Real b) { return a > b ? a : b; }

template <class Function>
inline Real each(Real a, Function&& function) {
    Real out{};
    for (int l = 0; l < kLanes; ++l) out[l] = function(a[l]);
    return out;
}

inline Real four(const double* from) {
    Real out{};
    for (int l = 0; l < kLanes; ++l) out[l] = from[l];
    return out;
}

inline Real root(Real a) {
    return each(a, [](double x) { return std::sqrt(x); });
}

inline double sum(Real a) { return a[0] + a[1] + a[2] + a[3]; }

inline Real value(Real a) { return a; }

template <class Number>
struct Vec {
    Number x{}, y{}, z{};
    Vec operator+(const Vec& o) const { return {x + o.x, y + o.y, z + o.z}; }
    Vec operator-(const Vec& o) const { return {x - o.x, y - o.y, z - o.z}; }
    Vec operator*(Number s) const { return {x * s, y * s, z * s}; }
    Vec operator*(double s) const { return {x * s, y * s, z * s}; }
    Vec& operator+=(const Vec& o) { return *this = *this + o; }
    Vec& operator-=(const Vec& o) { return *this = *this - o; }
    Number dot(const Vec& o) const { return x * o.x + y * o.y + z * o.z; }
};

}  // namespace
