// The kernels for the instruction set that this file is compiled for.
#pragma once

#include <algorithm>

#include "costs.hpp"
#include "factor.hpp"

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

// A cost's slopes by a motion, in the order of `Instants`.
struct Slopes {
    Real order[kOrders][kAxes];

    explicit Slopes(const Motion<Real>& by)
        : order{{by.position.x, by.position.y, by.position.z, by.yaw},
                {by.velocity.x, by.velocity.y, by.velocity.z, by.yaw_rate},
                {by.acceleration.x, by.acceleration.y, by.acceleration.z, by.yaw_acceleration},
                {by.jerk.x, by.jerk.y, by.jerk.z, {}},
                {by.snap.x, by.snap.y, by.snap.z, {}}} {}
};

// With the bits of `sine_cosine`, angle by angle, which is left to larger angles.
inline void turn(Real angle, Real& cosine, Real& sine) {
    const Real size = angle < Real{} ? -angle : angle;
    if (!(size[0] < 1e6 && size[1] < 1e6 && size[2] < 1e6 && size[3] < 1e6)) {
        for (int l = 0; l < kLanes; ++l) {
            const goshawk::SineCosine both = goshawk::sine_cosine(angle[l]);
            cosine[l] = both.cosine;
            sine[l] = both.sine;
        }
        return;
    }
    Real along, across;
    const Real turns = goshawk::quarter_turns(angle, across, along);
    const Whole quarter = (Whole)(turns + goshawk::kShift);  // its last bits are those of the whole number
    const Whole odd = (quarter & 1) != 0;
    cosine = odd ? across : along;
    sine = odd ? along : across;
    cosine = ((quarter + 1) & 2) != 0 ? -cosine : cosine;
    sine = (quarter & 2) != 0 ? -sine : sine;
}

inline Vec<Real> uphill_at(const Samples& samples, std::size_t pack) {
    const double* g = samples.uphill + pack * 3 * kLanes;
    return {four(g), four(g + kLanes), four(g + 2 * kLanes)};
}

template <bool kSlopes, int kRotors>
inline double cost_of(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                      const double (*scaled)[kAxes], double T, double (*by_scaled)[kAxes], double* by_T) {
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
        const Demand<Real, kRotors> demand(airframe, motion, c, s);
        const Real exceeded = limits.density(demand, samples.offsets + p * limits_of(kRotors) * kLanes, by);
        if (samples.reference > 0.0) by_weight -= share * exceeded;  // what is charged does not grow with the time
        Real density = exceeded;
        density += heading.density(motion, c, s, by);
        if (prices.clearance > 0.0)
            density += clearance.density(four(samples.distance + p * kLanes), uphill_at(samples, p), by);
        mean += share * density;
        if constexpr (!kSlopes) continue;
        const Slopes pull(by);
        Real weight = share * T;
        for (int r = 0; r < kOrders; ++r, weight = weight / T) {
            Real moved{};
            for (int x = 0; x < kAxes; ++x) moved += pull.order[r][x] * at.derivative[r][x];
            stretch -= share * static_cast<double>(r) * moved;
            for (int a = 0; a < kEnds; ++a)
                for (int x = 0; x < kAxes; ++x)
                    by_ends[a][x] += four(basis + (r * kEnds + a) * kLanes) * (weight * pull.order[r][x]);
        }
    }
    if constexpr (kSlopes) {
        for (int a = 0; a < kEnds; ++a)
            for (int x = 0; x < kAxes; ++x) by_scaled[a][x] = sum(by_ends[a][x]);
        *by_T = sum(mean) + sum(stretch) + sum(by_weight);
    }
    return T * sum(mean);
}

[[gnu::flatten]] double cost_alone(const Samples& samples, const Airframe& airframe, const Prices& prices,
                                   double clearance_m, const double (*scaled)[kAxes], double T) {
    return airframe.rotors == 4
               ? cost_of<false, 4>(samples, airframe, prices, clearance_m, scaled, T, nullptr, nullptr)
               : cost_of<false, 8>(samples, airframe, prices, clearance_m, scaled, T, nullptr, nullptr);
}

[[gnu::flatten]] double cost(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                             const double (*scaled)[kAxes], double T, double (*by_scaled)[kAxes], double& by_T) {
    return airframe.rotors == 4 ? cost_of<true, 4>(samples, airframe, prices, clearance_m, scaled, T, by_scaled, &by_T)
                                : cost_of<true, 8>(samples, airframe, prices, clearance_m, scaled, T, by_scaled, &by_T);
}

template <int kRotors>
inline void excess_of(const Samples& samples, const Airframe& airframe, const double (*scaled)[kAxes], double T,
                      double* out) {
    constexpr int kLimits = limits_of(kRotors);
    for (std::size_t p = 0; p < samples.packs; ++p) {
        const Motion<Real> motion = Instants(samples.basis + p * kOrders * kEnds * kLanes, scaled, T).motion();
        Real over[kLimits], c, s;
        turn(motion.yaw, c, s);
        Demand<Real, kRotors>(airframe, motion, c, s).excess(over);
        for (int limit = 0; limit < kLimits; ++limit)
            for (int l = 0; l < kLanes; ++l) *out++ = over[limit][l];
    }
}

[[gnu::flatten]] void excess(const Samples& samples, const Airframe& airframe, const double (*scaled)[kAxes], double T,
                             double* out) {
    if (airframe.rotors == 4)
        excess_of<4>(samples, airframe, scaled, T, out);
    else
        excess_of<8>(samples, airframe, scaled, T, out);
}

inline bool any(Real a) { return sum(a) > 0.0; }

// Whether any of the numbers is not zero.
inline bool nonzero(Real a) { return (a[0] != 0.0) | (a[1] != 0.0) | (a[2] != 0.0) | (a[3] != 0.0); }

// Gauss and Newton's sums over the squares in a segment's cost: its gradient, and products of slopes in place of second
// derivatives, by the segment's unknowns. How the motion bends with the time is kept, as far from the minimum the steps
// would else be short.
class Squares {
  public:
    // unit (32): each state's unit, times T to the power of its order.
    Squares(const double (*scaled)[kAxes], double T, const double* unit, double* gradient, double (*second)[kPadded])
        : scaled_(scaled), T_(T), unit_(unit), gradient_(gradient), second_(second) {}

    // Samples with their basis (5, 8, 4) follow.
    void begin(const double* basis, const Instants& path) {
        basis_ = basis;
        path_ = &path;
        pull_ = grown_ = Slopes(Motion<Real>());
        bend_ = Real{};
    }

    // Adds weight times the square of `value` at four samples, from the slopes of the value by the motion. Where the
    // weight `grows` with the time, the value does with its root.
    void add(Real weight, Real value, const Motion<Real>& slope, bool grows) {
        const Slopes by(slope);
        const Real force = 2.0 * weight * value;
        Real rows[kEnds][kAxes] = {}, by_time{};
        double rate = 1.0;
        for (int r = 0; r < kOrders; ++r, rate /= T_)
            for (int x = 0; x < kAxes; ++x) {
                if (!nonzero(by.order[r][x])) continue;
                pull_.order[r][x] += force * by.order[r][x];
                if (grows) grown_.order[r][x] += force * by.order[r][x];
                by_time -= static_cast<double>(r) * by.order[r][x] * path_->derivative[r][x];
                const Real slope_of_basis = rate * by.order[r][x];
                for (int a = 0; a < kEnds; ++a) rows[a][x] += four(basis_ + (r * kEnds + a) * kLanes) * slope_of_basis;
            }
        for (int a = 0; a < kEnds; ++a)  // scaled states grow with T to the power of their order
            for (int x = 0; x < kAxes; ++x) by_time += static_cast<double>(a % 4) * scaled_[a][x] * rows[a][x];
        if (grows) {
            bend_ += force * (by_time + 0.25 * value);
            by_time += 0.5 * value;
        }
        for (int l = 0; l < kLanes; ++l) {
            if (!(weight[l] > 0.0)) continue;
            double row[kPadded] = {};
            for (int a = 0; a < kEnds; ++a)
                for (int x = 0; x < kAxes; ++x) row[a * kAxes + x] = unit_[a * kAxes + x] * rows[a][x][l];
            row[kUnknowns - 1] = by_time[l];
            keep(2.0 * weight[l], value[l], row);
        }
    }

    // Adds how the motion bends with the time, under what the squares at these samples pull.
    void end() {
        add_products();
        Real cross[kEnds][kAxes] = {};
        double rate = 1.0;
        for (int r = 0; r < kOrders; ++r, rate /= T_) {
            for (int x = 0; x < kAxes; ++x) {
                if (!nonzero(pull_.order[r][x])) continue;
                const Real pull = pull_.order[r][x] * rate, grown = grown_.order[r][x] * (0.5 * rate);
                Real bent{};
                for (int a = 0; a < kEnds; ++a) {
                    const Real row = four(basis_ + (r * kEnds + a) * kLanes);
                    const double power = a % 4 - r;
                    cross[a][x] += row * (power * pull + grown);
                    bent += row * (power * power * scaled_[a][x]);
                }
                bend_ += bent * pull;
            }
        }
        double* by_time = second_[kUnknowns - 1];
        for (int a = 0; a < kEnds; ++a)
            for (int x = 0; x < kAxes; ++x) by_time[a * kAxes + x] += unit_[a * kAxes + x] * sum(cross[a][x]);
        by_time[kUnknowns - 1] += sum(bend_);
    }

  private:
    static constexpr std::size_t kMost =
        kLanes * (limits_of(kMostRotors) + 3);  // rows of four samples: limits, headings, clearance

    // Adds a square's gradient, and keeps its slopes (36) for the matrix.
    void keep(double weight, double value, const double* row) {
        double* factor = factors_[kept_];
        std::copy_n(row, kPadded, rows_[kept_++]);
        for (int i = 0; i < kUnknowns; ++i) {
            factor[i] = weight * row[i];
            gradient_[i] += factor[i] * value;
        }
    }

    // Adds the products of all slopes kept to the lower triangle, one block after the other so that each is read once.
    void add_products() {
        for (int j = 0; j < kUnknowns; j += kLanes) {
            int i = j;
            for (; i + kLanes <= kUnknowns; i += kLanes) add_block<kLanes>(i, j);
            for (; i < kUnknowns; ++i) add_block<1>(i, j);
        }
        kept_ = 0;
    }

    template <int kRows>
    void add_block(int i, int j) {
        Real sums[kRows];
        for (int q = 0; q < kRows; ++q) sums[q] = four(second_[i + q] + j);
        for (std::size_t n = 0; n < kept_; ++n) {
            const Real row = four(rows_[n] + j);
            for (int q = 0; q < kRows; ++q) sums[q] += factors_[n][i + q] * row;
        }
        for (int q = 0; q < kRows; ++q)
            for (int l = 0; l < kLanes; ++l) second_[i + q][j + l] = sums[q][l];
    }

    const double (*scaled_)[kAxes], T_, *unit_;
    double *gradient_, (*second_)[kPadded];
    const double* basis_ = nullptr;
    const Instants* path_ = nullptr;
    Slopes pull_{Motion<Real>()}, grown_{Motion<Real>()};  // sums over the squares: all, and those that grow
    Real bend_{};
    double rows_[kMost][kPadded], factors_[kMost][kPadded];
    std::size_t kept_ = 0;
};

template <int kRotors>
inline void square_limits(const Samples& samples, std::size_t p, const Airframe& airframe, Real price,
                          const Motion<Real>& motion, Real c, Real s, Squares& squares) {
    const bool fixed = samples.reference > 0.0;
    const Real weight = price * (fixed ? samples.reference : samples.duration);
    constexpr int kLimits = limits_of(kRotors);
    const Demand<Real, kRotors> demand(airframe, motion, c, s);
    Real excess[kLimits];
    demand.excess(excess);
    for (int l = 0; l < kLimits; ++l) {
        const Real over = excess[l] + four(samples.offsets + (p * kLimits + l) * kLanes);
        const Real exceeded = over > Real{} ? weight : Real{};
        if (!any(exceeded)) continue;
        Motion<Real> slope;
        demand.slope_of(l, slope);
        squares.add(exceeded, over, slope, !fixed);
    }
}

// Gradient and Gauss-Newton matrix of a segment's cost, see `Kernels`.
[[gnu::flatten]] void curvature(const Samples& samples, const Airframe& airframe, const Prices& prices,
                                double clearance_m, const double (*scaled)[kAxes], double T, const double* unit,
                                double* gradient, double (*second)[kPadded]) {
    constexpr double kFlat = 1e-8;  // squared heading error, as a share, below which its curvature fades
    const HeadingCost heading{prices.heading, 0.0, samples.target};
    Squares squares(scaled, T, unit, gradient, second);
    std::fill_n(gradient, kUnknowns, 0.0);
    std::fill_n(second[0], kUnknowns * kPadded, 0.0);
    for (std::size_t p = 0; p < samples.packs; ++p) {
        const double* basis = samples.basis + p * kOrders * kEnds * kLanes;
        const Instants path(basis, scaled, T);
        const Motion<Real> motion = path.motion();
        const Real share = four(samples.share + p * kLanes), whole = share * samples.duration;
        Real c, s;
        turn(motion.yaw, c, s);
        squares.begin(basis, path);
        if (airframe.rotors == 4)
            square_limits<4>(samples, p, airframe, share * prices.limits, motion, c, s, squares);
        else
            square_limits<8>(samples, p, airframe, share * prices.limits, motion, c, s, squares);
        if (prices.heading > 0.0) {
            Motion<Real> slope;
            const Real value = root(heading.density(motion, c, s, slope) + kFlat * prices.heading);
            const Real half = 0.5 / value;
            slope.position = slope.position * half, slope.velocity = slope.velocity * half, slope.yaw *= half;
            squares.add(whole, value, slope, true);
        }
        if (prices.turning > 0.0) {
            Motion<Real> slope;
            slope.yaw_rate = all(1.0);
            squares.add(whole * prices.turning, motion.yaw_rate, slope, true);
        }
        if (prices.clearance > 0.0) {
            const Real lack = clearance_m - four(samples.distance + p * kLanes);
            const Real close = lack > Real{} ? whole * prices.clearance : Real{};
            Motion<Real> slope;
            slope.position -= uphill_at(samples, p);
            if (any(close)) squares.add(close, lack, slope, true);
        }
        squares.end();
    }
}

constexpr Kernels kAll = {cost_alone, cost, excess, curvature, factor};

}  // namespace
