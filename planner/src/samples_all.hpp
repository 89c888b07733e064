// The kernels for the instruction set that this file is compiled for.
#pragma once

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

    Vec vec(int r) const { return {derivative[r][0], derivative[r][1], derivative[r][2]}; }

    Motion motion() const {
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

[[gnu::flatten]] double cost(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                             const double (*scaled)[kAxes], double T, double (*by_scaled)[kAxes], double& by_T) {
    const LimitCost limits{prices.limits * (samples.reference > 0.0 ? samples.reference / T : 1.0)};
    const HeadingCost heading{prices.heading, prices.turning, samples.target};
    const ClearanceCost clearance{prices.clearance, clearance_m};
    Real by_ends[kEnds][kAxes] = {}, mean{}, stretch{}, by_weight{};
    for (std::size_t p = 0; p < samples.packs; ++p) {
        const double *basis = samples.basis + p * kOrders * kEnds * kLanes, *g = samples.uphill + p * 3 * kLanes;
        const Instants at(basis, scaled, T);
        const Motion motion = at.motion();
        const Real share = four(samples.share + p * kLanes);
        Real c, s;
        turn(motion.yaw, c, s);
        Motion by;
        const Demand demand(airframe, motion, c, s);
        const Real exceeded = limits.density(demand, samples.offsets + p * kLimits * kLanes, by);
        if (samples.reference > 0.0) by_weight -= share * exceeded;  // what is charged does not grow with the time
        Real density = exceeded;
        density += heading.density(motion, c, s, by);
        if (prices.clearance > 0.0)
            density += clearance.density(four(samples.distance + p * kLanes),
                                         {four(g), four(g + kLanes), four(g + 2 * kLanes)}, by);
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
        const Motion motion = Instants(samples.basis + p * kOrders * kEnds * kLanes, scaled, T).motion();
        Real over[kLimits], c, s;
        turn(motion.yaw, c, s);
        Demand(airframe, motion, c, s).excess(over);
        for (int limit = 0; limit < kLimits; ++limit)
            for (int l = 0; l < kLanes; ++l) *out++ = over[limit][l];
    }
}

constexpr Kernels kAll = {cost, excess};

}  // namespace
