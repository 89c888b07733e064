// The second descent, in which the whole state of every knot is chosen: gradient and second derivatives of the cost by
// all knot states and log durations, banded along the path.
#include <algorithm>
#include <cstddef>
#include <vector>

#include "passing.hpp"
#include "portable.hpp"
#include "problem.hpp"

namespace goshawk {

namespace {

constexpr int kKnot = kOrders * kAxes;
constexpr double kStiff = 1e9;             // across the plane of a gate, in which its knot stays
constexpr std::size_t kBlock = kKnot + 1;  // unknowns of a knot, and the log of the duration after it

}  // namespace

// The cost of states_, with the scaled states and the distances along the path that `curvature` needs.
double Problem::cost_of_states(const double* durations, const std::vector<double>& knots) {
    for (std::size_t i = 0; i < segments_; ++i) {
        scaled_[i] = scaled_ends<kAxes>(states_.data(), i, durations[i]);
        force_[i] = times_form(scaled_[i]);
    }
    if (prices_.clearance > 0.0) ask_distances();
    std::vector<double> unused(knots.size());
    double cost = 0.0;
    for (std::size_t i = 0; i < segments_; ++i) {
        const double T = durations[i];
        cost += T + kernels_.cost_alone(samples_of(i, T), airframe_of(i), prices_, clearances_[i], scaled_[i].row, T) +
                snap_alone(i, T);
    }
    return cost + passing_cost() + ball_cost(knots.data(), unused.data()) + gate_cost(knots.data(), unused.data());
}

// Adds a segment's gradient and Gauss-Newton matrix by the states of both ends, in units (k + 1, 4) of their orders,
// and log T.
void Problem::curvature(std::size_t i, double T, const double* units, std::vector<double>& gradient,
                        Banded& second) const {
    constexpr int kTime = kUnknowns - 1;
    const Ends<kAxes>&scaled = scaled_[i], &force = force_[i];
    double slope[kUnknowns], bend[kUnknowns][kPadded], unit[kTime];
    for (int n = 0; n < kTime; ++n) {
        const int r = n / kAxes % kOrders;
        unit[n] = units[(i + (n < kKnot ? 0 : 1)) * kOrders + r];
        for (int k = 0; k < r; ++k) unit[n] *= T;
    }
    kernels_.curvature(samples_of(i, T), airframe_of(i), prices_, clearances_[i], scaled.row, T, unit, slope, bend);
    slope[kTime] += T;
    bend[kTime][kTime] += T;
    const double snap = 2.0 * prices_.snap / seventh_power(T);
    for (int a = 0; a < kStates; ++a)
        for (int x = 0; x < 3; ++x) {  // log T changes the scaled states, and the power of T that snap is divided by
            const int n = a * kAxes + x;
            double by_time = 0.0;
            for (int b = 0; b < kStates; ++b) {
                by_time += snap_form()[a][b] * (b % kOrders - 3.5) * scaled.row[b][x];
                if (b <= a) bend[n][b * kAxes + x] += snap * unit[n] * unit[b * kAxes + x] * snap_form()[a][b];
            }
            slope[n] += snap * unit[n] * force.row[a][x];
            slope[kTime] += snap * (a % kOrders - 3.5) * scaled.row[a][x] * force.row[a][x];
            bend[kTime][n] += snap * unit[n] * by_time;
            bend[kTime][kTime] += snap * (a % kOrders - 3.5) * scaled.row[a][x] * by_time;
        }
    // Behind the unknowns of the first knot comes log T, then the second knot's.
    const auto at = [&](int n) { return i * kBlock + (n == kTime ? kKnot : n < kKnot ? n : n + 1); };
    for (int n = 0; n < kUnknowns; ++n) gradient[at(n)] += slope[n];
    for (int m = 0; m < kTime; ++m) {
        double* column = &second.at(at(m), at(m));
        for (int n = m; n < kTime; ++n) column[at(n) - at(m)] += bend[n][m];
        if (m < kKnot) column[at(kTime) - at(m)] += bend[kTime][m];
    }
    double* column = &second.at(at(kTime), at(kTime));
    column[0] += bend[kTime][kTime];
    for (int n = kKnot; n < kTime; ++n) column[at(n) - at(kTime)] += bend[kTime][n];
}

// The same of what is charged at single knots: leaving balls and openings, passing openings at a slant.
void Problem::knot_curvature(const std::vector<double>& knots, const double* units, std::vector<double>& gradient,
                             Banded& second) const {
    for (std::size_t i = 0; i <= segments_; ++i) {
        const std::size_t n = i * kBlock;
        const double *ball = &balls_[4 * i], *centre = &gates_[9 * i], *p = &knots[i * kAxes];
        const double price = 2.0 * prices_.limits;
        const auto add = [&](double over, const double slope[3], double bend, const double along[3]) {
            for (int x = 0; x < 3; ++x) {
                gradient[n + x] += price * over * slope[x];
                for (int y = 0; y <= x; ++y)
                    second.at(n + x, n + y) += price * (slope[x] * slope[y] + over * bend * along[x] * along[y]);
            }
        };
        if (ball[3] > 0.0) {
            double slope[3], over = -1.0;
            const double square = ball[3] * ball[3];
            for (int x = 0; x < 3; ++x) {
                over += (p[x] - ball[x]) * (p[x] - ball[x]) / square;
                slope[x] = 2.0 * (p[x] - ball[x]) / square;
            }
            if (over > 0.0) {
                add(over, slope, 0.0, slope);
                for (int x = 0; x < 3; ++x) second.at(n + x, n + x) += price * over * 2.0 / square;
            }
        }
        double normal[3];
        if (!gate_normal(centre, normal)) continue;
        for (const double* edge : {centre + 3, centre + 6}) {
            const double square = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2];
            double share = 0.0, slope[3];
            for (int x = 0; x < 3; ++x) share += (p[x] - centre[x]) * edge[x] / square;
            const double over = share * share - 1.0;
            for (int x = 0; x < 3; ++x) slope[x] = 2.0 * share * edge[x] / square;
            if (over > 0.0) add(over, slope, 2.0 / (square * square), edge);
        }
        const PassingCost passing{prices_.limits};
        const std::size_t v = n + kAxes;
        for (int x = 0; x < 3; ++x) {  // differences of the exact gradient, as only a few knots are in gates
            double ahead[3] = {}, back[3] = {}, velocity[3];
            const double h = 1e-6;
            std::copy_n(&states_[i * kKnot + kAxes], 3, velocity);
            velocity[x] += h;
            passing.value(velocity, normal, ahead);
            velocity[x] -= 2.0 * h;
            passing.value(velocity, normal, back);
            const double unit = units[i * kOrders + 1];
            gradient[v + x] += 0.5 * unit * (ahead[x] + back[x]);
            for (int y = 0; y <= x; ++y) second.at(v + x, v + y) += unit * unit * (ahead[y] - back[y]) / (2.0 * h);
        }
    }
}

// An empty matrix by all unknowns: a knot's couple with those of the knot before, a duration with the knots round it.
Banded Problem::banded() const {
    Banded second(segments_ * kBlock + kKnot, kBlock + kKnot - 1);
    for (std::size_t i = 0; i < segments_; ++i)
        for (std::size_t n = 0; n < kBlock; ++n) second.set_end(i * kBlock + n, (i + 1) * kBlock + kKnot);
    return second;
}

double Problem::slopes(const double* states, const double* durations, double* by_states, double* by_log_durations) {
    const std::vector<double> units((segments_ + 1) * kOrders, 1.0);
    std::vector<double> knots((segments_ + 1) * kAxes), gradient(segments_ * kBlock + kKnot);
    Banded second = banded();
    std::copy_n(states, states_.size(), states_.begin());
    for (std::size_t i = 0; i <= segments_; ++i) std::copy_n(states + i * kKnot, kAxes, &knots[i * kAxes]);
    const double cost = cost_of_states(durations, knots);
    for (std::size_t i = 0; i < segments_; ++i) curvature(i, durations[i], units.data(), gradient, second);
    knot_curvature(knots, units.data(), gradient, second);
    for (std::size_t i = 0; i <= segments_; ++i) {
        std::copy_n(&gradient[i * kBlock], kKnot, by_states + i * kKnot);
        if (i < segments_) by_log_durations[i] = gradient[i * kBlock + kKnot];
    }
    return cost;
}

Refined Problem::refine(double* states, double* durations, const unsigned char* free, const Newton& method) {
    const std::size_t size = segments_ * kBlock + kKnot;
    // Each order of a knot's state in units of the mean duration round it, so that all unknowns are about metres.
    std::vector<double> units((segments_ + 1) * kOrders), x(size), knots((segments_ + 1) * kAxes), began(knots);
    std::vector<unsigned char> open(size, 1);
    for (std::size_t i = 0; i <= segments_; ++i) {
        const double before = durations[i > 0 ? i - 1 : 0], after = durations[i < segments_ ? i : segments_ - 1];
        for (std::size_t r = 0; r < kOrders; ++r) {
            units[i * kOrders + r] = r == 0 ? 1.0 : units[i * kOrders + r - 1] * 2.0 / (before + after);
            for (std::size_t a = 0; a < kAxes; ++a) {
                const std::size_t n = i * kBlock + r * kAxes + a;
                x[n] = states[i * kKnot + r * kAxes + a] / units[i * kOrders + r];
                open[n] = free[i * kKnot + r * kAxes + a];
            }
        }
        std::copy_n(states + i * kKnot, kAxes, &began[i * kAxes]);
        if (i < segments_) x[i * kBlock + kKnot] = logarithm(durations[i]);
    }
    const auto unpack = [&](const std::vector<double>& from) {
        for (std::size_t i = 0; i <= segments_; ++i) {
            for (std::size_t n = 0; n < kKnot; ++n)
                states_[i * kKnot + n] = from[i * kBlock + n] * units[i * kOrders + n / kAxes];
            double normal[3], off = 0.0;
            double* p = &states_[i * kKnot];
            if (gate_normal(&gates_[9 * i], normal)) {  // stays in the opening's plane
                for (int a = 0; a < 3; ++a) off += normal[a] * (p[a] - began[i * kAxes + a]);
                for (int a = 0; a < 3; ++a) p[a] -= off * normal[a];
            }
            std::copy_n(p, kAxes, &knots[i * kAxes]);
            if (i < segments_) durations[i] = exponential(from[i * kBlock + kKnot]);
        }
    };
    const auto cost = [&](const std::vector<double>& from) {
        unpack(from);
        return cost_of_states(durations, knots);
    };
    const auto model = [&](std::vector<double>& gradient, Banded& second) {
        std::fill(gradient.begin(), gradient.end(), 0.0);
        second.clear();
        for (std::size_t i = 0; i < segments_; ++i) curvature(i, durations[i], units.data(), gradient, second);
        knot_curvature(knots, units.data(), gradient, second);
        for (std::size_t n = 0; n < size; ++n)
            if (!open[n]) {
                gradient[n] = 0.0;
                second.pin(n);
            }
        for (std::size_t i = 0; i <= segments_; ++i) {
            double normal[3], along = 0.0;
            const std::size_t n = i * kBlock;
            if (!free[i * kKnot] || !gate_normal(&gates_[9 * i], normal)) continue;
            for (int a = 0; a < 3; ++a) along += normal[a] * gradient[n + a];
            for (int a = 0; a < 3; ++a) {
                gradient[n + a] -= along * normal[a];
                for (int b = 0; b <= a; ++b) second.at(n + a, n + b) += kStiff * normal[a] * normal[b];
            }
        }
    };
    const Refined found = method.minimise(x, banded(), cost, model);
    unpack(x);
    std::copy(states_.begin(), states_.end(), states);
    return found;
}

}  // namespace goshawk
