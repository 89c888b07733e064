// A number with its derivatives along N directions: the effects are templates, so the same line gives both.
#pragma once

#include <cmath>

#include "portable.hpp"

namespace goshawk {

template <int N>
struct Dual {
    double v = 0.0;
    double d[N] = {};

    Dual() = default;
    Dual(double value) : v(value) {}  // NOLINT: numbers take part in formulas as constants

    Dual& operator+=(const Dual& b) {
        v += b.v;
        for (int i = 0; i < N; ++i) d[i] += b.d[i];
        return *this;
    }
    Dual& operator-=(const Dual& b) {
        v -= b.v;
        for (int i = 0; i < N; ++i) d[i] -= b.d[i];
        return *this;
    }
    Dual& operator*=(const Dual& b) {
        for (int i = 0; i < N; ++i) d[i] = d[i] * b.v + v * b.d[i];
        v *= b.v;
        return *this;
    }
    Dual& operator/=(const Dual& b) {
        const double inverse = 1.0 / b.v;
        v *= inverse;
        for (int i = 0; i < N; ++i) d[i] = (d[i] - v * b.d[i]) * inverse;
        return *this;
    }
    friend Dual operator+(Dual a, const Dual& b) { return a += b; }
    friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
    friend Dual operator*(Dual a, const Dual& b) { return a *= b; }
    friend Dual operator/(Dual a, const Dual& b) { return a /= b; }
    friend Dual operator-(const Dual& a) { return chain(a, -a.v, -1.0); }

    // f(a) given its value and slope
    friend Dual chain(const Dual& a, double value, double slope) {
        Dual r(value);
        for (int i = 0; i < N; ++i) r.d[i] = slope * a.d[i];
        return r;
    }
    friend Dual sqrt(const Dual& a) {
        const double root = std::sqrt(a.v);
        return chain(a, root, root > 0.0 ? 0.5 / root : 0.0);  // slope 0 at 0: the length of a zero vector
    }
    friend Dual exp(const Dual& a) {
        const double e = exponential(a.v);
        return chain(a, e, e);
    }
};

inline double real(double a) { return a; }
template <int N>
double real(const Dual<N>& a) {
    return a.v;
}

template <class T>
T magnitude(const T& x) {
    return real(x) < 0.0 ? -x : x;
}

template <class T>
T clipped(const T& x, const T& low, const T& high) {
    return real(x) > real(low) ? (real(x) < real(high) ? x : high) : low;
}

constexpr double kFar = 1e6;  // metres; used in place of infinity, which would break derivatives

}  // namespace goshawk
