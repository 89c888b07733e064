// The kernels for the instruction set that this file is compiled for.
#pragma once

#include <algorithm>

#include "costs.hpp"

namespace {

constexpr int kOrders = 5, kEnds = 8;

// A path and its derivatives at four samples of a segment.
struct Instants {
    Real derivative[kOrders][kAxes];

    Instants(const double* basis, const double (*scaled)[kAxes], double T) {
        const double rate = 1.0 / T;
        double power = 1.0;
        for (int r = 0; r < kOrders; ++r, power *= rate)
            for (int x = 0; x < kAxes; ++x) {
                Real value{};
                for (int a = 0; a < kEnds; ++a) value += four(basis + (r * kEnds + a) * kLanes) * scaled[a][x];
                derivative[r][x] = value * power;
            }
    }

    Vec<Real> vec(int r) const { return {derivative[r][0], derivative[r][1], derivative[r][2]}; }

    Motion<Real> motion() const {
        return {vec(0), vec(1), vec(2), vec(3), vec(4), derivative[0][3], derivative[1][3], derivative[2][3]};
    }
};

inline void turn(Real angle, Real& cosine, Real& sine) {
    for (int l = 0; l < kLanes; ++l) {
        const goshawk::SineCosine both = goshawk::sine_cosine(angle[l]);
        cosine[l] = both.cosine;
        sine[l] = both.sine;
    }
}

inline Vec<Real> uphill_at(const Samples& samples, std::size_t pack) {
    const double* g = samples.uphill + pack * 3 * kLanes;
    return {four(g), four(g + kLanes), four(g + 2 * kLanes)};
}

[[gnu::flatten]] double cost(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                             const double (*scaled)[kAxes], double T, double (*by_scaled)[kAxes], double& by_T) {
    const LimitCost limits{prices.limits * (samples.reference > 0.0 ? samples.reference / T : 1.0)};
    const HeadingCost heading{prices.heading, prices.turning, samples.target};
    const ClearanceCost clearance{prices.clearance, clearance_m};
    Real by_ends[kEnds][kAxes] = {}, mean{}, stretch{}, by_weight{};
    for (std::size_t p = 0; p < samples.packs; ++p) {
        const double* basis = samples.basis + p * kOrders * kEnds * kLanes;
        const Instants at(basis, scaled, T);
        const Motion<Real> motion = at.motion();
        const Real share = four(samples.share + p * kLanes);
        Real c, s;
        turn(motion.yaw, c, s);
        Motion<Real> by;
        const Demand<Real> demand(airframe, motion, c, s);
        const Real exceeded = limits.density(demand, samples.offsets + p * kLimits * kLanes, by);
        if (samples.reference > 0.0) by_weight -= share * exceeded;  // what is charged does not grow with the time
        Real density = exceeded;
        density += heading.density(motion, c, s, by);
        if (prices.clearance > 0.0)
            density += clearance.density(four(samples.distance + p * kLanes), uphill_at(samples, p), by);
        mean += share * density;
        const Real pull[kOrders][kAxes] = {
            {by.position.x, by.position.y, by.position.z, by.yaw},
            {by.velocity.x, by.velocity.y, by.velocity.z, by.yaw_rate},
            {by.acceleration.x, by.acceleration.y, by.acceleration.z, by.yaw_acceleration},
            {by.jerk.x, by.jerk.y, by.jerk.z, {}},
            {by.snap.x, by.snap.y, by.snap.z, {}}};
        Real weight = share * T;
        for (int r = 0; r < kOrders; ++r, weight = weight / T) {
            Real moved{};
            for (int x = 0; x < kAxes; ++x) moved += pull[r][x] * at.derivative[r][x];
            stretch -= share * static_cast<double>(r) * moved;
            for (int a = 0; a < kEnds; ++a)
                for (int x = 0; x < kAxes; ++x)
                    by_ends[a][x] += four(basis + (r * kEnds + a) * kLanes) * (weight * pull[r][x]);
        }
    }
    for (int a = 0; a < kEnds; ++a)
        for (int x = 0; x < kAxes; ++x) by_scaled[a][x] = sum(by_ends[a][x]);
    by_T = sum(mean) + sum(stretch) + sum(by_weight);
    return T * sum(mean);
}

[[gnu::flatten]] void excess(const Samples& samples, const Airframe& airframe, const double (*scaled)[kAxes], double T,
                             double* out) {
    for (std::size_t p = 0; p < samples.packs; ++p) {
        const Motion<Real> motion = Instants(samples.basis + p * kOrders * kEnds * kLanes, scaled, T).motion();
        Real over[kLimits], c, s;
        turn(motion.yaw, c, s);
        Demand<Real>(airframe, motion, c, s).excess(over);
        for (int limit = 0; limit < kLimits; ++limit)
            for (int l = 0; l < kLanes; ++l) *out++ = over[limit][l];
    }
}

// The numbers of a motion that a cost depends on, in the order of its second derivatives: position, velocity,
// acceleration, jerk and snap of x, y, z; yaw and two derivatives of it.
constexpr int kNumbers = 18;

template <class Number>
Number* at(Motion<Number>& motion, int n) {
    Vec<Number>* vectors[] = {&motion.position, &motion.velocity, &motion.acceleration, &motion.jerk, &motion.snap};
    if (n >= 15) return n == 15 ? &motion.yaw : n == 16 ? &motion.yaw_rate : &motion.yaw_acceleration;
    Vec<Number>& v = *vectors[n / 3];
    return n % 3 == 0 ? &v.x : n % 3 == 1 ? &v.y : &v.z;
}

// Order and axis of a number of a motion.
constexpr int order_of(int n) { return n < 15 ? n / 3 : n - 15; }
constexpr int axis_of(int n) { return n < 15 ? n % 3 : 3; }

Motion<Dual> seeded(Motion<Real> motion, int direction) {
    Motion<Dual> out;
    for (int n = 0; n < kNumbers; ++n) *at(out, n) = Dual(*at(motion, n), all(n == direction ? 1.0 : 0.0));
    return out;
}

// What the costs at one pack of samples contribute, by the numbers of the motion: gradient and second derivatives,
// both times the time that each sample answers for, and how cost and gradient grow with log T through that time.
struct Local {
    Real gradient[kNumbers], stretched[kNumbers], second[kNumbers][kNumbers], by_time;
};

// The limits by Gauss and Newton: price times the product of the slopes of what is exceeded. How those bend is left
// out, which keeps the matrix positive and the steps long far from the minimum.
[[gnu::flatten]] void curve_limits(const Samples& samples, std::size_t p, const Airframe& airframe, double price,
                                   const Motion<Real>& motion, Real c, Real s, Local& out, Real& density) {
    const Real share = four(samples.share + p * kLanes);
    const bool fixed = samples.reference > 0.0;
    const double whole_s = fixed ? samples.reference : samples.duration;
    const Demand<Real> demand(airframe, motion, c, s);
    Real excess[kLimits], active[kLimits], by_excess[kLimits];
    demand.excess(excess);
    density = Real{};
    for (int l = 0; l < kLimits; ++l) {
        const Real over = larger(excess[l] + four(samples.offsets + (p * kLimits + l) * kLanes), Real{});
        active[l] = over > Real{} ? share * (2.0 * price * whole_s) : Real{};
        by_excess[l] = active[l] * over;
        density += 0.5 * active[l] * over * over;
    }
    if (!(sum(density) > 0.0)) return;
    Motion<Real> by;
    demand.pull_back(by_excess, by);
    for (int n = 0; n < kNumbers; ++n) {
        out.gradient[n] += *at(by, n);
        if (!fixed) out.stretched[n] += *at(by, n);
    }
    for (int n = 3; n < kNumbers; ++n) {  // the limits do not ask where the vehicle is
        Dual slopes[kLimits];
        const Motion<Dual> at_n = seeded(motion, n);
        Demand<Dual>(airframe, at_n, Dual(c, n == 15 ? -s : Real{}), Dual(s, n == 15 ? c : Real{})).excess(slopes);
        for (int l = 0; l < kLimits; ++l) by_excess[l] = active[l] * slopes[l].d;
        Motion<Real> column;
        demand.pull_back(by_excess, column);
        for (int m = 0; m < kNumbers; ++m) out.second[n][m] += *at(column, m);
    }
}

[[gnu::flatten]] void curve(const Samples& samples, std::size_t p, const Airframe& airframe, const Prices& prices,
                            double clearance_m, Motion<Real> motion, Local& out) {
    const HeadingCost heading{prices.heading, prices.turning, samples.target};
    const ClearanceCost clearance{prices.clearance, clearance_m};
    const Real whole = four(samples.share + p * kLanes) * samples.duration;
    Real c, s, exceeded;
    turn(motion.yaw, c, s);
    out = Local{};
    curve_limits(samples, p, airframe, prices.limits, motion, c, s, out, exceeded);
    if (!(samples.reference > 0.0)) out.by_time += exceeded;
    for (int n = 0; n < kNumbers && (prices.heading > 0.0 || prices.turning > 0.0); ++n) {
        Motion<Dual> by;
        const Dual looking =
            heading.density(seeded(motion, n), Dual(c, n == 15 ? -s : Real{}), Dual(s, n == 15 ? c : Real{}), by);
        for (int m = 0; m < kNumbers; ++m) out.second[n][m] += whole * at(by, m)->d;
        if (n > 0) continue;
        out.by_time += whole * looking.v;
        for (int m = 0; m < kNumbers; ++m) {
            out.gradient[m] += whole * at(by, m)->v;
            out.stretched[m] += whole * at(by, m)->v;
        }
    }
    if (prices.clearance > 0.0) {  // the distance taken for flat: only how it grows with the position
        const Vec<Real> uphill = uphill_at(samples, p);
        Motion<Real> by;
        const Real distance = four(samples.distance + p * kLanes);
        out.by_time += whole * clearance.density(distance, uphill, by);
        const Real bend = whole * (distance < all(clearance_m) ? all(2.0 * prices.clearance) : Real{});
        const Real slope[3] = {uphill.x, uphill.y, uphill.z};
        for (int x = 0; x < 3; ++x) {
            out.gradient[x] += whole * *at(by, x);
            out.stretched[x] += whole * *at(by, x);
            for (int y = 0; y < 3; ++y) out.second[x][y] += bend * slope[x] * slope[y];
        }
    }
}

// Gradient and second derivatives of a segment's cost by its 32 scaled states (end, order, axis) and log T, the scaled
// states fixed; see `cost`.
[[gnu::flatten]] void curvature(const Samples& samples, const Airframe& airframe, const Prices& prices,
                                double clearance_m, const double (*scaled)[kAxes], double T, double* gradient,
                                double (*second)[kUnknowns]) {
    constexpr int kEnd = kEnds * kAxes;
    std::fill_n(gradient, kUnknowns, 0.0);
    std::fill_n(second[0], kUnknowns * kUnknowns, 0.0);
    for (std::size_t p = 0; p < samples.packs; ++p) {
        const double* basis = samples.basis + p * kOrders * kEnds * kLanes;
        const Instants instants(basis, scaled, T);
        Local local;
        curve(samples, p, airframe, prices, clearance_m, instants.motion(), local);
        Real by[kNumbers][kEnds];  // how each number of the motion grows with the scaled states of its axis
        Real pull[kNumbers];       // and with log T
        for (int n = 0; n < kNumbers; ++n) {
            const int r = order_of(n);
            double power = 1.0;
            for (int k = 0; k < r; ++k) power /= T;
            for (int a = 0; a < kEnds; ++a) by[n][a] = four(basis + (r * kEnds + a) * kLanes) * power;
            pull[n] = -static_cast<double>(r) * instants.derivative[r][axis_of(n)];
        }
        Real moved[kNumbers][kEnd], turned[kNumbers];  // second derivatives by number and state, by number and log T
        for (int n = 0; n < kNumbers; ++n) {
            for (Real& x : moved[n]) x = Real{};
            turned[n] = Real{};
            for (int m = 0; m < kNumbers; ++m) {
                for (int a = 0; a < kEnds; ++a) moved[n][a * kAxes + axis_of(m)] += local.second[n][m] * by[m][a];
                turned[n] += local.second[n][m] * pull[m];
            }
        }
        Real rows[kUnknowns][kUnknowns] = {}, grows[kUnknowns] = {};
        for (int n = 0; n < kNumbers; ++n) {
            const double r = order_of(n);
            const Real to_time = turned[n] - r * local.gradient[n] + local.stretched[n];
            for (int a = 0; a < kEnds; ++a) {
                const int i = a * kAxes + axis_of(n);
                grows[i] += by[n][a] * local.gradient[n];
                rows[i][kEnd] += by[n][a] * to_time;
                for (int j = 0; j <= i; ++j) rows[i][j] += by[n][a] * moved[n][j];
            }
            grows[kEnd] += pull[n] * local.gradient[n];
            rows[kEnd][kEnd] += pull[n] * (turned[n] + 2.0 * local.stretched[n] - r * local.gradient[n]);
        }
        grows[kEnd] += local.by_time;
        rows[kEnd][kEnd] += local.by_time;
        for (int i = 0; i < kUnknowns; ++i) {
            gradient[i] += sum(grows[i]);
            for (int j = 0; j <= i && i < kEnd; ++j) second[i][j] += sum(rows[i][j]);
            second[kEnd][i] += sum(rows[i][kEnd]);
        }
    }
}

constexpr Kernels kAll = {cost, excess, curvature};

}  // namespace
