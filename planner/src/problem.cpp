#include "problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "passing.hpp"
#include "portable.hpp"
#include "smoothing.hpp"

namespace goshawk {

namespace {

constexpr int kKnot = kOrders * kAxes;

// (5, 8): the derivatives by u of a segment at u, from its scaled states.
std::vector<double> basis_at(double u) {
    std::vector<double> rows(5 * kStates);
    for (int r = 0; r < 5; ++r) {
        double monomial[kStates] = {};
        for (int i = r; i < kStates; ++i) {
            monomial[i] = 1.0;
            for (int k = r; k < i; ++k) monomial[i] *= u;
            for (int k = 0; k < r; ++k) monomial[i] *= i - k;
        }
        for (int a = 0; a < kStates; ++a)
            for (int i = 0; i < kStates; ++i) rows[r * kStates + a] += monomial[i] * kMonomials[i][a];
    }
    return rows;
}

}  // namespace

const Kernels& kernels() {
#if defined(__x86_64__)
    if (kernels_avx2 && __builtin_cpu_supports("avx2")) return *kernels_avx2;
#endif
    return *kernels_plain;
}

Problem::Problem(std::size_t segments, std::size_t samples, const Airframe& airframe, const Prices& prices,
                 const double* clearances, Distances distances)
    : segments_(segments),
      samples_(samples),
      packs_((samples + kLanes - 1) / kLanes),
      limits_(static_cast<std::size_t>(limits_of(airframe.rotors))),
      airframe_(airframe),
      prices_(prices),
      distances_(std::move(distances)),
      kernels_(kernels()),
      basis_(packs_ * 5 * kStates * kLanes),
      share_(packs_ * kLanes),
      offsets_(segments * packs_ * limits_ * kLanes),
      distance_(segments * packs_ * kLanes),
      uphill_(segments * packs_ * 3 * kLanes),
      scaled_(segments),
      force_(segments),
      states_((segments + 1) * kKnot),
      by_states_((segments + 1) * kKnot),
      given_((segments + 1) * kKnot),
      reference_(segments),
      speeds_(segments, airframe.speed),
      jerks_(segments, airframe.jerk),
      clearances_(clearances, clearances + segments),
      balls_((segments + 1) * 4),
      gates_((segments + 1) * 9),
      held_(segments + 1),
      points_(3 * segments * samples),
      safe_(segments * samples) {
    const double spacing = 1.0 / static_cast<double>(samples - 1);  // both ends are samples, at half the weight
    for (std::size_t s = 0; s < packs_ * kLanes; ++s) {
        const std::vector<double> rows = basis_at(static_cast<double>(std::min(s, samples - 1)) * spacing);
        for (std::size_t n = 0; n < rows.size(); ++n) basis_[place(0, s, rows.size(), n)] = rows[n];
        share_[s] = s >= samples ? 0.0 : s == 0 || s + 1 == samples ? 0.5 * spacing : spacing;
    }
}

void Problem::set_offsets(const double* offsets) {
    for (std::size_t i = 0; i < segments_; ++i)
        for (std::size_t s = 0; s < packs_ * kLanes; ++s) {
            const double* row = offsets + (i * samples_ + std::min(s, samples_ - 1)) * limits_;
            for (std::size_t l = 0; l < limits_; ++l) offsets_[place(i, s, limits_, l)] = row[l];
        }
}

void Problem::set_reference(const double* durations) { reference_.assign(durations, durations + segments_); }

Airframe Problem::airframe_of(std::size_t segment) const {
    Airframe here = airframe_;
    here.speed = speeds_[segment];
    here.jerk = jerks_[segment];
    return here;
}

Samples Problem::samples_of(std::size_t segment, double T) const {
    return {packs_,
            basis_.data(),
            share_.data(),
            &offsets_[place(segment, 0, limits_)],
            &distance_[place(segment, 0)],
            &uphill_[place(segment, 0, 3)],
            T,
            reference_[segment],
            target_.empty() ? nullptr : target_.data()};
}

void Problem::start(const double* knots, const double* durations) {
    std::copy(given_.begin(), given_.end(), states_.begin());
    for (std::size_t i = 0; i <= segments_; ++i) std::copy_n(knots + i * kAxes, kAxes, &states_[i * kKnot]);
    fill_states<kAxes>(system_, states_.data(), durations, segments_, held_.data());
    for (std::size_t i = 0; i < segments_; ++i) {
        scaled_[i] = scaled_ends<kAxes>(states_.data(), i, durations[i]);
        force_[i] = times_form(scaled_[i]);
    }
}

// A distance holds for a ball: samples that have not left theirs need not be asked again.
void Problem::ask_distances() {
    asked_.clear();
    for (std::size_t i = 0; i < segments_; ++i) {
        const Ends<kAxes>& scaled = scaled_[i];
        for (std::size_t s = 0; s < samples_; ++s) {
            double point[3] = {};
            for (std::size_t a = 0; a < kStates; ++a)
                for (int x = 0; x < 3; ++x) point[x] += basis_[place(0, s, 5 * kStates, a)] * scaled.row[a][x];
            const std::size_t n = i * samples_ + s;
            const SafeBall& ball = safe_[n];
            double away = 0.0;
            for (int x = 0; x < 3; ++x) away += (point[x] - ball.centre[x]) * (point[x] - ball.centre[x]);
            if (ball.radius > 0.0 && away < ball.radius * ball.radius) continue;
            std::copy_n(point, 3, &points_[3 * asked_.size()]);
            asked_.push_back(n);
        }
    }
    asked_distance_.resize(asked_.size());
    asked_gradient_.resize(3 * asked_.size());
    if (!asked_.empty()) distances_(points_.data(), asked_.size(), asked_distance_.data(), asked_gradient_.data());
    for (std::size_t k = 0; k < asked_.size(); ++k) {
        const std::size_t i = asked_[k] / samples_, s = asked_[k] % samples_;
        const double* p = &points_[3 * k];
        distance_[place(i, s)] = asked_distance_[k];
        for (std::size_t x = 0; x < 3; ++x) uphill_[place(i, s, 3, x)] = asked_gradient_[3 * k + x];
        safe_[asked_[k]] = {{p[0], p[1], p[2]}, asked_distance_[k] - clearances_[i]};
    }
}

// Everything that is charged along one segment; its gradient goes to the states of both ends and to T.
double Problem::segment_cost(std::size_t i, double T, double& by_T) {
    const Ends<kAxes>& scaled = scaled_[i];
    double by_scaled[kStates][kAxes], longer;
    const double cost =
        kernels_.cost(samples_of(i, T), airframe_of(i), prices_, clearances_[i], scaled.row, T, by_scaled, longer);
    double* out = &by_states_[i * kKnot];
    double power = 1.0;
    for (int r = 0; r < kOrders; ++r, power *= T)
        for (int a = r; a < kStates; a += kOrders)
            for (int x = 0; x < kAxes; ++x) {
                out[a * kAxes + x] += by_scaled[a][x] * power;
                longer += r / T * by_scaled[a][x] * scaled.row[a][x];
            }
    by_T += longer;
    return cost;
}

// Price of the snap of x, y, z along one segment.
double Problem::snap_alone(std::size_t i, double T) const {
    const double scale = prices_.snap / seventh_power(T);
    double cost = 0.0;
    for (int r = 0; r < kOrders; ++r)
        for (int a = r; a < kStates; a += kOrders)
            for (int x = 0; x < 3; ++x) cost += scale * scaled_[i].row[a][x] * force_[i].row[a][x];
    return cost;
}

// The same; its gradient goes to the states of both ends and to T.
double Problem::snap_cost(std::size_t i, double T, double& by_T) {
    const Ends<kAxes>&scaled = scaled_[i], &force = force_[i];
    const double scale = prices_.snap / seventh_power(T);
    double power = scale;
    double* out = &by_states_[i * kKnot];
    for (int r = 0; r < kOrders; ++r, power *= T)
        for (int a = r; a < kStates; a += kOrders)
            for (int x = 0; x < 3; ++x) {
                by_T += scale * (2.0 * r - 7.0) / T * scaled.row[a][x] * force.row[a][x];
                out[a * kAxes + x] += 2.0 * power * force.row[a][x];
            }
    return snap_alone(i, T);
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
        const double T = durations[i], scale = 1.0 / seventh_power(T);
        const Ends<kAxes>&scaled = scaled_[i], &force = force_[i];
        const Ends<kAxes> multiplier = scaled_ends<kAxes>(multipliers.data(), i, T);
        const Ends<kAxes> pull = times_form(multiplier);
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
        double distance = 0.0;
        for (int x = 0; x < 3; ++x) distance += (p[x] - ball[x]) * (p[x] - ball[x]);
        const double over = std::max(distance / square - 1.0, 0.0);
        cost += prices_.limits * over * over;
        for (int x = 0; x < 3; ++x) by_knots[i * kAxes + x] += 4.0 * prices_.limits * over * (p[x] - ball[x]) / square;
    }
    return cost;
}

// The limits' price times the squared relative excess over half the opening's width, and over half its height.
double Problem::gate_cost(const double* knots, double* by_knots) const {
    double cost = 0.0;
    for (std::size_t i = 0; i <= segments_; ++i) {
        const double *centre = &gates_[9 * i], *p = knots + i * kAxes;
        for (const double* edge : {centre + 3, centre + 6}) {
            const double square = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2];
            if (!(square > 0.0)) continue;
            double share = 0.0;
            for (int x = 0; x < 3; ++x) share += (p[x] - centre[x]) * edge[x] / square;
            const double over = std::max(share * share - 1.0, 0.0);
            cost += prices_.limits * over * over;
            for (int x = 0; x < 3; ++x)
                by_knots[i * kAxes + x] += 4.0 * prices_.limits * over * share * edge[x] / square;
        }
    }
    return cost;
}

// Of the velocity at every gate, along the cross product of its edges; its gradient goes to the states.
double Problem::passing_cost() {
    const PassingCost passing{prices_.limits};
    double cost = 0.0;
    for (std::size_t i = 0; i <= segments_; ++i) {
        double normal[3];
        if (!gate_normal(&gates_[9 * i], normal)) continue;
        cost += passing.value(&states_[i * kKnot + kAxes], normal, &by_states_[i * kKnot + kAxes]);
    }
    return cost;
}

// Along the axes that are free; of a knot in a gate along the gate's edges, and in yaw.
std::vector<Problem::Direction> Problem::directions(const unsigned char* free) const {
    std::vector<Direction> found;
    for (std::size_t i = 0; i <= segments_; ++i) {
        const double *edges = &gates_[9 * i + 3],
                     *mark = std::find_if(edges, edges + 6, [](double x) { return x != 0.0; });
        const bool in_gate = mark != edges + 6;
        for (int e = 0; in_gate && free[i * kAxes] && e < 2; ++e) {
            const double* edge = edges + 3 * e;
            const double size = std::sqrt(edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]);
            found.push_back({i, {edge[0] / size, edge[1] / size, edge[2] / size, 0.0}});
        }
        for (int x = in_gate ? 3 : 0; x < kAxes; ++x) {
            if (!free[i * kAxes + x]) continue;
            found.push_back({i, {}});
            found.back().along[x] = 1.0;
        }
    }
    return found;
}

double Problem::evaluate(const double* knots, const double* durations, double* by_knots, double* by_durations) {
    start(knots, durations);
    if (prices_.clearance > 0.0) ask_distances();
    std::fill(by_states_.begin(), by_states_.end(), 0.0);
    double cost = 0.0;
    for (std::size_t i = 0; i < segments_; ++i) {
        by_durations[i] = 1.0;
        cost += durations[i] + segment_cost(i, durations[i], by_durations[i]);
        if (prices_.snap > 0.0) cost += snap_cost(i, durations[i], by_durations[i]);
    }
    cost += passing_cost();
    adjoint(durations, by_knots, by_durations);
    return cost + ball_cost(knots, by_knots) + gate_cost(knots, by_knots);
}

void Problem::excess(const double* states, const double* durations, double* out) const {
    std::vector<double> packed(packs_ * limits_ * kLanes);
    for (std::size_t i = 0; i < segments_; ++i) {
        const Ends<kAxes> scaled = scaled_ends<kAxes>(states, i, durations[i]);
        kernels_.excess(samples_of(i, durations[i]), airframe_of(i), scaled.row, durations[i], packed.data());
        for (std::size_t s = 0; s < samples_; ++s)
            for (std::size_t l = 0; l < limits_; ++l) *out++ = packed[place(0, s, limits_, l)];
    }
}

Descent Problem::minimise(double* knots, double* durations, const unsigned char* free, Lbfgs& method) {
    const std::vector<Direction> moving = directions(free);
    std::vector<double> x(segments_ + moving.size()), by_knots((segments_ + 1) * kAxes), by_durations(segments_);
    std::vector<double> held(knots, knots + by_knots.size());  // what no direction moves
    for (std::size_t i = 0; i < segments_; ++i) x[i] = logarithm(durations[i]);
    for (std::size_t n = 0; n < moving.size(); ++n) {
        x[segments_ + n] = moving[n].dot(knots);
        moving[n].add(-x[segments_ + n], held.data());
    }
    const auto unpack = [&](const std::vector<double>& from) {
        for (std::size_t i = 0; i < segments_; ++i) durations[i] = exponential(from[i]);
        std::copy(held.begin(), held.end(), knots);
        for (std::size_t n = 0; n < moving.size(); ++n) moving[n].add(from[segments_ + n], knots);
    };
    const auto function = [&](const std::vector<double>& at, std::vector<double>& gradient) {
        unpack(at);
        const double cost = evaluate(knots, durations, by_knots.data(), by_durations.data());
        for (std::size_t i = 0; i < segments_; ++i) gradient[i] = by_durations[i] * durations[i];
        for (std::size_t n = 0; n < moving.size(); ++n) gradient[segments_ + n] = moving[n].dot(by_knots.data());
        return cost;
    };
    const auto descend = [&](auto&& metric) { return method.minimise(x, function, metric); };
    Descent found;
    if (moving.empty()) {  // times alone bend no path: plain steps come as far in two thirds of the iterations
        found = descend([](std::vector<double>&) {});
    } else {
        Smoothing smoothing(durations, segments_, free, held_.data());
        found = descend([&](std::vector<double>& step) { smoothing.apply(step, moving); });
    }
    unpack(x);
    return found;
}

}  // namespace goshawk
