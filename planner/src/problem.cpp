#include "problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace goshawk {

namespace {

constexpr int kKnot = kOrders * kAxes;

// (5, 8): the derivatives by u of a segment at u, from its scaled states.
std::vector<double> basis_at(double u) {
    std::vector<double> rows(5 * kStates);
    for (int r = 0; r < 5; ++r) {
        double monomial[kStates] = {};
        for (int i = r; i < kStates; ++i) {
            monomial[i] = std::pow(u, i - r);
            for (int k = 0; k < r; ++k) monomial[i] *= i - k;
        }
        for (int a = 0; a < kStates; ++a)
            for (int i = 0; i < kStates; ++i) rows[r * kStates + a] += monomial[i] * kMonomials[i][a];
    }
    return rows;
}

}  // namespace

Problem::Problem(std::size_t segments, std::size_t samples, const Airframe& airframe, const Prices& prices,
                 double clearance_m, Distances distances)
    : segments_(segments),
      samples_(samples),
      airframe_(airframe),
      prices_(prices),
      clearance_m_(clearance_m),
      distances_(std::move(distances)),
      offsets_(segments * samples * kLimits, 0.0),
      states_((segments + 1) * kKnot),
      by_states_((segments + 1) * kKnot),
      given_((segments + 1) * kKnot, 0.0),
      balls_((segments + 1) * 4, 0.0),
      held_(segments + 1, 0),
      points_(segments * samples * 3),
      distance_(segments * samples, std::numeric_limits<double>::infinity()),
      gradient_(segments * samples * 3, 0.0),
      safe_(segments * samples) {
    const double spacing = 1.0 / static_cast<double>(samples - 1);  // both ends are samples, at half the weight
    for (std::size_t s = 0; s < samples; ++s) {
        basis_.push_back(basis_at(static_cast<double>(s) * spacing));
        share_.push_back(s == 0 || s + 1 == samples ? 0.5 * spacing : spacing);
    }
}

Problem::Instant Problem::instant(const std::vector<double>& basis, const Ends<kAxes>& scaled, double T) {
    Instant at{};
    const double rate = 1.0 / T;
    double power = 1.0;
    for (int r = 0; r < 5; ++r, power *= rate) {
        for (int a = 0; a < kStates; ++a)
            for (int x = 0; x < kAxes; ++x) at.derivative[r][x] += basis[r * kStates + a] * scaled.row[a][x];
        for (int x = 0; x < kAxes; ++x) at.derivative[r][x] *= power;
    }
    return at;
}

Motion Problem::Instant::motion() const {
    const auto vec = [this](int r) { return Vec{derivative[r][0], derivative[r][1], derivative[r][2]}; };
    return {vec(0), vec(1), vec(2), vec(3), vec(4), derivative[0][3], derivative[1][3], derivative[2][3]};
}

void Problem::start(const double* knots, const double* durations) {
    std::copy(given_.begin(), given_.end(), states_.begin());
    for (std::size_t i = 0; i <= segments_; ++i) std::copy_n(knots + i * kAxes, kAxes, &states_[i * kKnot]);
    fill_states<kAxes>(system_, states_.data(), durations, segments_, held_.data());
}

// A distance holds for a ball: samples that have not left theirs need not be asked again.
void Problem::ask_distances(const double* durations) {
    asked_.clear();
    for (std::size_t i = 0; i < segments_; ++i) {
        const Ends<kAxes> scaled = scaled_ends<kAxes>(states_.data(), i, durations[i]);
        for (std::size_t s = 0; s < samples_; ++s) {
            const std::size_t n = i * samples_ + s;
            double point[3] = {};
            for (int a = 0; a < kStates; ++a)
                for (int x = 0; x < 3; ++x) point[x] += basis_[s][a] * scaled.row[a][x];
            const SafeBall& ball = safe_[n];
            const Vec away = Vec{point[0], point[1], point[2]} - ball.centre;
            if (ball.radius > 0.0 && away.dot(away) < ball.radius * ball.radius) continue;
            std::copy_n(point, 3, &points_[3 * asked_.size()]);
            asked_.push_back(n);
        }
    }
    asked_distance_.resize(asked_.size());
    asked_gradient_.resize(3 * asked_.size());
    if (!asked_.empty()) distances_(points_.data(), asked_.size(), asked_distance_.data(), asked_gradient_.data());
    for (std::size_t k = 0; k < asked_.size(); ++k) {
        const double* p = &points_[3 * k];
        distance_[asked_[k]] = asked_distance_[k];
        std::copy_n(&asked_gradient_[3 * k], 3, &gradient_[3 * asked_[k]]);
        safe_[asked_[k]] = {{p[0], p[1], p[2]}, asked_distance_[k] - clearance_m_};
    }
}

// Everything that is charged along one segment; its gradient goes to the states of both ends and to T.
double Problem::segment_cost(std::size_t i, double T, double& by_T) {
    const LimitCost limits{airframe_, prices_.limits};
    const HeadingCost heading{prices_.heading, prices_.turning, target_};
    const ClearanceCost clearance{prices_.clearance, clearance_m_};
    const Ends<kAxes> scaled = scaled_ends<kAxes>(states_.data(), i, T);
    Ends<kAxes> by_scaled{};
    double mean = 0.0, stretch = 0.0;
    for (std::size_t s = 0; s < samples_; ++s) {
        const std::size_t n = i * samples_ + s;
        const Instant at = instant(basis_[s], scaled, T);
        const Motion motion = at.motion();
        Motion by;
        double density = limits.density(motion, &offsets_[n * kLimits], by) + heading.density(motion, by);
        if (prices_.clearance > 0.0) {
            const double* g = &gradient_[3 * n];
            density += clearance.density(distance_[n], {g[0], g[1], g[2]}, by);
        }
        mean += share_[s] * density;
        const double pull[5][kAxes] = {{by.position.x, by.position.y, by.position.z, by.yaw},
                                       {by.velocity.x, by.velocity.y, by.velocity.z, by.yaw_rate},
                                       {by.acceleration.x, by.acceleration.y, by.acceleration.z, by.yaw_acceleration},
                                       {by.jerk.x, by.jerk.y, by.jerk.z, 0.0},
                                       {by.snap.x, by.snap.y, by.snap.z, 0.0}};
        double share = share_[s] * T;
        for (int r = 0; r < 5; ++r, share /= T) {
            double moved = 0.0;
            for (int x = 0; x < kAxes; ++x) moved += pull[r][x] * at.derivative[r][x];
            stretch -= share_[s] * r * moved;
            for (int a = 0; a < kStates; ++a)
                for (int x = 0; x < kAxes; ++x)
                    by_scaled.row[a][x] += basis_[s][r * kStates + a] * (share * pull[r][x]);
        }
    }
    double* out = &by_states_[i * kKnot];
    double power = 1.0;
    for (int r = 0; r < kOrders; ++r, power *= T)
        for (int x = 0; x < kAxes; ++x) {
            out[r * kAxes + x] += by_scaled.row[r][x] * power;
            out[(kOrders + r) * kAxes + x] += by_scaled.row[kOrders + r][x] * power;
            stretch +=
                r / T *
                (by_scaled.row[r][x] * scaled.row[r][x] + by_scaled.row[kOrders + r][x] * scaled.row[kOrders + r][x]);
        }
    by_T += mean + stretch;
    return T * mean;
}

// Price of the snap of x, y, z along one segment.
double Problem::snap_cost(std::size_t i, double T, double& by_T) {
    const Ends<kAxes> scaled = scaled_ends<kAxes>(states_.data(), i, T);
    const Ends<kAxes> force = times_form(scaled);
    const double scale = prices_.snap / std::pow(T, 7);
    double cost = 0.0, power = scale;
    double* out = &by_states_[i * kKnot];
    for (int r = 0; r < kOrders; ++r, power *= T)
        for (int end = 0; end < 2; ++end)
            for (int x = 0; x < 3; ++x) {
                const int a = end * kOrders + r;
                cost += scale * scaled.row[a][x] * force.row[a][x];
                by_T += scale * (2.0 * r - 7.0) / T * scaled.row[a][x] * force.row[a][x];
                out[a * kAxes + x] += 2.0 * power * force.row[a][x];
            }
    return cost;
}

// With K x = r the conditions for minimum snap, dJ = (dJ/dx) dx, and K dx = dr - dK x: one solve with K of dJ/dx gives
// the multipliers of all parameters at once.
void Problem::adjoint(const double* durations, double* by_knots, double* by_durations) {
    for (std::size_t i = 0; i <= segments_; ++i) std::copy_n(&by_states_[i * kKnot], kAxes, by_knots + i * kAxes);
    std::vector<double>& multipliers = by_states_;  // from here on
    for (std::size_t i = 1; i < segments_; ++i)
        if (held_[i]) std::fill_n(&multipliers[i * kKnot + kAxes], kAxes, 0.0);
    if (segments_ > 1) system_.solve<kAxes>(&multipliers[kKnot + kAxes], kKnot);
    for (std::size_t i = 0; i <= segments_; ++i) std::fill_n(&multipliers[i * kKnot], kAxes, 0.0);
    std::fill_n(&multipliers[0], kKnot, 0.0);
    std::fill_n(&multipliers[segments_ * kKnot], kKnot, 0.0);
    for (std::size_t i = 0; i < segments_; ++i) {
        const double T = durations[i], scale = 1.0 / std::pow(T, 7);
        const Ends<kAxes> scaled = scaled_ends<kAxes>(states_.data(), i, T);
        const Ends<kAxes> multiplier = scaled_ends<kAxes>(multipliers.data(), i, T);
        const Ends<kAxes> force = times_form(scaled), pull = times_form(multiplier);
        for (int a = 0; a < kStates; ++a) {
            const int order = a % kOrders;
            for (int x = 0; x < kAxes; ++x)
                by_durations[i] -=
                    scale / T *
                    ((order - 7) * multiplier.row[a][x] * force.row[a][x] + order * scaled.row[a][x] * pull.row[a][x]);
        }
        for (int x = 0; x < kAxes; ++x) {
            by_knots[i * kAxes + x] -= scale * pull.row[0][x];
            by_knots[(i + 1) * kAxes + x] -= scale * pull.row[kOrders][x];
        }
    }
}

// The limits' price times the squared relative excess of the squared distance over that of the ball.
double Problem::ball_cost(const double* knots, double* by_knots) const {
    double cost = 0.0;
    for (std::size_t i = 0; i <= segments_; ++i) {
        const double *ball = &balls_[4 * i], *p = knots + i * kAxes, square = ball[3] * ball[3];
        if (!(square > 0.0)) continue;
        const Vec off = Vec{p[0], p[1], p[2]} - Vec{ball[0], ball[1], ball[2]};
        const double over = off.dot(off) / square - 1.0;
        if (!(over > 0.0)) continue;
        cost += prices_.limits * over * over;
        const Vec by = off * (4.0 * prices_.limits * over / square);
        by_knots[i * kAxes] += by.x, by_knots[i * kAxes + 1] += by.y, by_knots[i * kAxes + 2] += by.z;
    }
    return cost;
}

double Problem::evaluate(const double* knots, const double* durations, double* by_knots, double* by_durations) {
    start(knots, durations);
    if (prices_.clearance > 0.0) ask_distances(durations);
    std::fill(by_states_.begin(), by_states_.end(), 0.0);
    double cost = 0.0;
    for (std::size_t i = 0; i < segments_; ++i) {
        by_durations[i] = 1.0;
        cost += durations[i] + segment_cost(i, durations[i], by_durations[i]);
        if (prices_.snap > 0.0) cost += snap_cost(i, durations[i], by_durations[i]);
    }
    adjoint(durations, by_knots, by_durations);
    return cost + ball_cost(knots, by_knots);
}

void Problem::excess(const double* knots, const double* durations, double* out) {
    start(knots, durations);
    for (std::size_t i = 0; i < segments_; ++i) {
        const Ends<kAxes> scaled = scaled_ends<kAxes>(states_.data(), i, durations[i]);
        for (std::size_t s = 0; s < samples_; ++s, out += kLimits) {
            const Motion motion = instant(basis_[s], scaled, durations[i]).motion();
            Demand(airframe_, motion).excess(out);
        }
    }
}

Descent Problem::minimise(double* knots, double* durations, const unsigned char* free, Lbfgs& method) {
    std::vector<std::size_t> moving;
    for (std::size_t n = 0; n < (segments_ + 1) * kAxes; ++n)
        if (free[n]) moving.push_back(n);
    std::vector<double> x(segments_ + moving.size()), by_knots((segments_ + 1) * kAxes), by_durations(segments_);
    for (std::size_t i = 0; i < segments_; ++i) x[i] = std::log(durations[i]);
    for (std::size_t n = 0; n < moving.size(); ++n) x[segments_ + n] = knots[moving[n]];
    const auto unpack = [&](const std::vector<double>& from) {
        for (std::size_t i = 0; i < segments_; ++i) durations[i] = std::exp(from[i]);
        for (std::size_t n = 0; n < moving.size(); ++n) knots[moving[n]] = from[segments_ + n];
    };
    const Descent found = method.minimise(x, [&](const std::vector<double>& at, std::vector<double>& gradient) {
        unpack(at);
        const double cost = evaluate(knots, durations, by_knots.data(), by_durations.data());
        for (std::size_t i = 0; i < segments_; ++i) gradient[i] = by_durations[i] * durations[i];
        for (std::size_t n = 0; n < moving.size(); ++n) gradient[segments_ + n] = by_knots[moving[n]];
        return cost;
    });
    unpack(x);
    return found;
}

}  // namespace goshawk
