// Gauss and Newton's method for a cost with a banded matrix of second derivatives, damped where the quadratic model
// does not hold (Levenberg and Marquardt; the damping as in Nielsen 1999). It has converged where the matrix is
// positive definite and the model, hardly damped, promises less than a given share of the cost; or, at a kink of the
// cost, where the matrix is positive definite but the model does not hold, four steps in a row have together gained
// less than that. Steps are cut at kinks: so paths through mazes end 0.6 % sooner after as many evaluations.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "banded.hpp"

namespace goshawk {

struct Refined {
    double cost = 0.0;
    double residual = std::numeric_limits<double>::quiet_NaN();  // gain that the model promises, as a share of the cost
    int evaluations = 0;
    bool converged = false, stopped = false;
};

class Newton {
  public:
    int iterations = 100;
    double precision = 1e-8;
    double longest_step = 0.5;  // of any one unknown
    double hold = 0.0;          // price of the squared distance from where it begins (the proximal point method)
    const std::atomic<bool>* stop = nullptr;

    // Minimises from x, in place: `cost(x)` alone, and `model(gradient, second)`, which fills both where the cost was
    // asked last.
    template <class Cost, class Model>
    Refined minimise(std::vector<double>& x, Banded second, Cost&& cost, Model&& model) const {
        const std::size_t n = x.size();
        std::vector<double> gradient(n), step(n), trial(n), weight(n);
        Banded factor = second;
        const std::vector<double> begun = x;
        const auto held_cost = [&](const std::vector<double>& at) {
            double square = 0.0;
            for (std::size_t i = 0; i < n; ++i) square += (at[i] - begun[i]) * (at[i] - begun[i]);
            return cost(at) + hold * square;
        };
        const auto model_here = [&] {
            model(gradient, second);
            for (std::size_t i = 0; i < n; ++i) {
                gradient[i] += 2.0 * hold * (x[i] - begun[i]);
                second.at(i, i) += 2.0 * hold;
            }
            // Between equal steps (1) and equal shares of the curvature (Marquardt): ends lowest of the three.
            for (std::size_t i = 0; i < n; ++i) weight[i] = std::sqrt(std::max(second.at(i, i), 1e-6));
        };
        const auto solved = [&](double damping) {  // the step; false where the damped matrix is not positive definite
            factor = second;
            for (std::size_t i = 0; i < n; ++i) factor.at(i, i) += damping * weight[i];
            if (!factor.factor()) return false;
            for (std::size_t i = 0; i < n; ++i) step[i] = -gradient[i];
            factor.solve<1>(step.data());
            return true;
        };
        Refined found;
        double damping = kLeast, growth = 2.0;
        int steps = 0;
        found.cost = held_cost(x);
        model_here();
        double earlier = std::numeric_limits<double>::infinity();
        for (int iteration = 0; iteration < iterations && !found.converged && damping <= kMost; ++iteration) {
            if (stop && stop->load(std::memory_order_relaxed)) {
                found.stopped = true;
                return found;
            }
            if (solved(damping)) {
                const double promised = gain(gradient, step, weight, damping);
                found.converged = damping <= kSlight && promised <= precision * std::max(found.cost, 1.0);
                if (found.converged) break;
                double largest = 0.0;
                for (const double s : step) largest = std::max(largest, std::fabs(s));
                double reached = 0.0, length = std::min(1.0, longest_step / largest);
                const auto gained = [&] {  // over what the model says of this share of the step
                    for (std::size_t i = 0; i < n; ++i) trial[i] = x[i] + length * step[i];
                    reached = held_cost(trial);
                    ++found.evaluations;
                    return (found.cost - reached) / (promised * length * (2.0 - length));
                };
                double ratio = gained();
                int cuts = 0;
                bool better = ratio > 1e-4;
                // A step behind a kink is often good up to there, and a cost is had sooner than another step.
                for (; !better && cuts < kCuts; ++cuts) {
                    length *= kCut;
                    ratio = gained();
                    better = ratio > 0.1;
                }
                if (better) {
                    x.swap(trial);
                    found.cost = reached;
                    model_here();
                    const double bend = 2.0 * ratio - 1.0;
                    if (cuts > 0)
                        damping = 2.0 * std::max(damping, kLeast);
                    else if (length ==
                             1.0)  // of a long step, less damping would only turn it to where the cost is flat
                        damping *= std::max(0.1, 1.0 - bend * bend * bend);
                    growth = 2.0;
                    if (++steps % kWindow == 0) {
                        // Where the matrix is indefinite, steps gain little because heavy damping makes them short.
                        found.converged = earlier - found.cost <= precision * found.cost && solved(kSlight);
                        earlier = found.cost;
                    }
                    continue;
                }
            }
            damping = std::max(damping, kLeast) * growth;  // above kMost rounding hides whatever is still downhill
            growth *= 2.0;
        }
        double slight = kLeast;  // as little damping as makes the matrix positive definite
        while (!solved(slight) && slight <= kMost) slight *= 10.0;
        found.residual = gain(gradient, step, weight, slight) / std::max(found.cost, 1.0);
        return found;
    }

  private:
    static constexpr double kLeast = 1e-6, kSlight = 1e-1, kMost = 1e12;
    static constexpr int kWindow = 4;
    static constexpr int kCuts = 2;
    static constexpr double kCut = 0.2;

    static double gain(const std::vector<double>& gradient, const std::vector<double>& step,
                       const std::vector<double>& weight, double damping) {
        double along = 0.0, square = 0.0;
        for (std::size_t i = 0; i < step.size(); ++i) {
            along -= gradient[i] * step[i];
            square += weight[i] * step[i] * step[i];
        }
        return 0.5 * (along + damping * square);
    }
};

}  // namespace goshawk
