// Elementary functions whose result has the same bits on every processor: a fixed order of IEEE operations, no fused
// multiply-add (the build says -ffp-contract=off) and no call of the C library, whose variants differ in the last bit.
// Errors are below 2 units in the last place (tests/flight/test_portable.py).
//
// Ranges are reduced as in Cody, Waite, Software Manual for the Elementary Functions, 1980; the rest are Taylor series.
// Functions are static: files that are compiled for other instruction sets must not share one copy.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

namespace goshawk {

struct SineCosine {
    double sine, cosine;
};

constexpr double kPi = 3.14159265358979323846, kPiRest = 1.2246467991473532e-16;  // their sum is pi to 107 bits

constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: has no room for a fraction

// Nearest whole number, |x| < 2^51.
template <class Number>
static inline Number nearest_whole(Number x) {
    return (x + kShift) - kShift;
}

// c[0] + c[1] x + ..., in four sums by x^4 that need not wait for each other.
template <int N, class Number>
static inline Number series(const double (&c)[N], Number x) {
    const Number x2 = x * x, x4 = x2 * x2;
    Number sum[4] = {};
    for (int i = N - 1; i >= 0; --i) sum[i % 4] = sum[i % 4] * x4 + c[i];
    return (sum[0] + x * sum[1]) + x2 * (sum[2] + x * sum[3]);
}

// The nearest number of quarter turns to an angle below 1e6, with sine and cosine of the rest; also of several angles
// in a vector of the compiler's.
template <class Number>
static inline Number quarter_turns(Number x, Number& sine, Number& cosine) {
    constexpr double kSine[] = {-1.0 / 6.0,        1.0 / 120.0,        -1.0 / 5040.0,          1.0 / 362880.0,
                                -1.0 / 39916800.0, 1.0 / 6227020800.0, -1.0 / 1307674368000.0, 1.0 / 355687428096000.0};
    constexpr double kCosine[] = {1.0 / 24.0,        -1.0 / 720.0,         1.0 / 40320.0,         -1.0 / 3628800.0,
                                  1.0 / 479001600.0, -1.0 / 87178291200.0, 1.0 / 20922789888000.0};
    // pi / 2 in three parts; a whole number of 20 bits times either of the first two is exact
    constexpr double kFirst = 0x1.921fb544p+0, kSecond = 0x1.0b4611a6p-34, kThird = 0x1.3198a2e037073p-69;
    const Number turns = nearest_whole(x * (2.0 / kPi));
    const Number a = x - turns * kFirst, b = turns * kSecond, c = turns * kThird;
    const Number near = a - b, back = near - a, lost = (a - (near - back)) - (b + back);  // near + lost = a - b exactly
    const Number y = near - c, rest = ((near - y) - c) + lost;
    const Number square = y * y;
    sine = y + (y * square * series(kSine, square) + rest * (1.0 - 0.5 * square));
    const Number half = 0.5 * square, large = 1.0 - half;
    cosine = large + (((1.0 - large) - half) + (square * square * series(kCosine, square) - y * rest));
    return turns;
}

// Accurate for |x| below 1e6; beyond, x is first reduced by the double nearest to 2 pi.
static inline SineCosine sine_cosine(double x) {
    double sine, cosine;
    if (!(std::fabs(x) < 1e6)) x = std::fmod(x, 2.0 * kPi);  // NaN for infinity
    const double turns = quarter_turns(x, sine, cosine);
    switch (std::isfinite(turns) ? static_cast<std::int64_t>(turns) & 3 : 0) {
        case 0:
            return {sine, cosine};
        case 1:
            return {cosine, -sine};
        case 2:
            return {-sine, -cosine};
        default:
            return {-cosine, sine};
    }
}

// 2^n of a whole number from -1022 to 1023.
static inline double power_of_two(std::int64_t n) {
    const std::uint64_t bits = static_cast<std::uint64_t>(n + 1023) << 52;
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

constexpr double kLog2 = 0.693147180559945309417, kLog2First = 0x1.62e42feep-1, kLog2Rest = 0x1.a39ef35793c76p-33;

static inline double exponential(double x) {
    constexpr double kTaylor[] = {1.0 / 2.0,       1.0 / 6.0,        1.0 / 24.0,        1.0 / 120.0,
                                  1.0 / 720.0,     1.0 / 5040.0,     1.0 / 40320.0,     1.0 / 362880.0,
                                  1.0 / 3628800.0, 1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0};
    if (!(x < 710.0)) return x > 0.0 ? std::numeric_limits<double>::infinity() : x;  // NaN stays NaN
    if (x < -746.0) return 0.0;
    const double n = nearest_whole(x / kLog2);
    const double high = x - n * kLog2First, low = n * kLog2Rest, r = high - low;
    const double rest = (high - r) - low;
    const double value = 1.0 + (r + (r * r * series(kTaylor, r) + rest));
    const std::int64_t whole = static_cast<std::int64_t>(n), half = whole / 2;  // in two steps, for subnormal results
    return value * power_of_two(half) * power_of_two(whole - half);
}

static inline double logarithm(double x) {
    constexpr double kSeries[] = {2.0 / 3.0,  2.0 / 5.0,  2.0 / 7.0,  2.0 / 9.0,  2.0 / 11.0, 2.0 / 13.0,
                                  2.0 / 15.0, 2.0 / 17.0, 2.0 / 19.0, 2.0 / 21.0, 2.0 / 23.0};
    if (!(x > 0.0) || !std::isfinite(x)) {
        if (x == 0.0) return -std::numeric_limits<double>::infinity();
        return x > 0.0 ? x : std::numeric_limits<double>::quiet_NaN();
    }
    std::int64_t exponent = 0;
    if (x < std::numeric_limits<double>::min()) x *= power_of_two(54), exponent = -54;
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    exponent += static_cast<std::int64_t>(bits >> 52) - 1023;
    double m = x * 1.0;
    bits = (bits & 0xfffffffffffffULL) | 0x3ff0000000000000ULL;
    std::memcpy(&m, &bits, sizeof m);
    if (m > 1.41421356237309504880) m *= 0.5, ++exponent;
    // log(1 + f) = f - f^2 / 2 + s (f^2 / 2 + 2 s^2 / 3 + 2 s^4 / 5 + ...) with s = f / (2 + f)
    const double f = m - 1.0, s = f / (2.0 + f), square = s * s, half = 0.5 * f * f;
    const double e = static_cast<double>(exponent),
                 tail = s * (half + square * series(kSeries, square)) + e * kLog2Rest;
    return e * kLog2First - ((half - tail) - f);
}

// Angle of (x, y) in [-pi, pi].
static inline double arctangent2(double y, double x) {
    constexpr double kSeries[] = {-1.0 / 3.0,  1.0 / 5.0,  -1.0 / 7.0,  1.0 / 9.0,  -1.0 / 11.0, 1.0 / 13.0,
                                  -1.0 / 15.0, 1.0 / 17.0, -1.0 / 19.0, 1.0 / 21.0, -1.0 / 23.0, 1.0 / 25.0,
                                  -1.0 / 27.0, 1.0 / 29.0, -1.0 / 31.0, 1.0 / 33.0, -1.0 / 35.0, 1.0 / 37.0,
                                  -1.0 / 39.0, 1.0 / 41.0, -1.0 / 43.0};
    if (std::isnan(x) || std::isnan(y)) return x + y;
    double across = std::fabs(y), along = std::fabs(x);
    if (std::isinf(across) || std::isinf(along)) {
        across = std::isinf(across) ? 1.0 : 0.0;
        along = std::isinf(along) ? 1.0 : 0.0;
    }
    if (across < 1e-290 && along < 1e-290) {  // halves of the smallest numbers would be zero
        across *= 0x1p100;
        along *= 0x1p100;
    }
    const bool steep = across > along;
    const double small = steep ? along : across, large = steep ? across : along;
    double angle = 0.0, rest = 0.0;  // of (large, small): from 0 to pi / 4
    if (large > 0.0) {
        const bool far = small > 0.41421356237309504880 * large;  // beyond pi / 8: as a turn back from pi / 4
        const double u = far ? (small - large) / (0.5 * small + 0.5 * large) * 0.5 : small / large;
        const double bend = u * (u * u) * series(kSeries, u * u);
        angle = far ? 0.25 * kPi : u;
        rest = far ? u + (bend + 0.25 * kPiRest) : bend;
    }
    if (steep) {
        rest = (0.5 * kPiRest - rest) - (angle < 0.5 ? angle : 0.0);
        angle = angle < 0.5 ? 0.5 * kPi : 0.25 * kPi;
    }
    double found = angle + rest;
    if (std::signbit(x)) found = (kPi - angle) + (kPiRest - rest);
    return std::copysign(found, y);
}

static inline double arcsine(double x) { return arctangent2(x, std::sqrt((1.0 - x) * (1.0 + x))); }
static inline double arccosine(double x) { return 2.0 * arctangent2(std::sqrt(1.0 - x), std::sqrt(1.0 + x)); }

}  // namespace goshawk
