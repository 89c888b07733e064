// Limited-memory BFGS with a bracketing line search (Armijo and weak Wolfe), after Nocedal & Wright, chapter 7.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <vector>

namespace goshawk {

struct Descent {
    double cost = 0.0;
    int evaluations = 0;
    bool converged = false, stopped = false;
};

class Lbfgs {
  public:
    int iterations = 300;
    double precision = 1e-6;    // stops where steps in a row gain less than this share of the cost
    double longest_step = 1.0;  // of any one variable
    const std::atomic<bool>* stop = nullptr;

    // Minimises function(x, gradient) from x, in place. metric(gradient) turns a gradient into the steepest step, in
    // place.
    template <class Function, class Metric>
    Descent minimise(std::vector<double>& x, Function&& function, Metric&& metric) {
        const std::size_t n = x.size();
        std::vector<double> gradient(n), direction(n), x_new(n), gradient_new(n);
        Descent found;
        found.cost = function(x, gradient);
        found.evaluations = 1;
        changes_.clear();
        int small_gains = 0;
        for (int iteration = 0; iteration < iterations; ++iteration) {
            if (stop && stop->load(std::memory_order_relaxed)) {
                found.stopped = true;
                return found;
            }
            precondition(gradient, direction, metric);
            double slope = dot(gradient, direction);
            if (!(slope < 0.0)) {  // the memory misleads: start over downhill
                changes_.clear();
                precondition(gradient, direction, metric);
                slope = dot(gradient, direction);
                if (!(slope < 0.0)) {
                    found.converged = true;
                    return found;
                }
            }
            double cost_new;
            const double step = search(function, x, found, slope, direction, x_new, gradient_new, cost_new);
            if (!(step > 0.0)) {
                if (changes_.empty()) {
                    found.converged = true;  // rounding hides whatever is still downhill
                    return found;
                }
                changes_.clear();
                continue;
            }
            remember(x, x_new, gradient, gradient_new, metric);
            const double gain = found.cost - cost_new;
            x.swap(x_new);
            gradient.swap(gradient_new);
            found.cost = cost_new;
            small_gains = gain <= precision * std::max(std::fabs(cost_new), 1.0) ? small_gains + 1 : 0;
            if (small_gains == kSmallGains) {
                found.converged = true;
                return found;
            }
        }
        return found;
    }

  private:
    struct Change {
        std::vector<double> x, gradient;
        double curvature;
    };
    static constexpr std::size_t kMemory = 60;
    static constexpr int kSmallGains = 3;  // one may be a step that was cut short
    std::vector<Change> changes_;
    double scale_ = 1.0;  // of the metric, so that it fits the last change

    static double dot(const std::vector<double>& a, const std::vector<double>& b) {
        double sums[4] = {};  // four at a time: one sum would wait for each addition
        std::size_t i = 0;
        for (; i + 4 <= a.size(); i += 4)
            for (std::size_t l = 0; l < 4; ++l) sums[l] += a[i + l] * b[i + l];
        for (; i < a.size(); ++i) sums[0] += a[i] * b[i];
        return (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }

    template <class Metric>
    void precondition(const std::vector<double>& gradient, std::vector<double>& direction, Metric&& metric) const {
        for (std::size_t i = 0; i < gradient.size(); ++i) direction[i] = -gradient[i];
        if (changes_.empty()) {
            metric(direction);
            const double size = std::sqrt(dot(direction, direction));
            for (double& d : direction) d *= 0.1 / std::max(size, 1e-12);
            return;
        }
        double weight[kMemory];
        for (std::size_t k = changes_.size(); k-- > 0;) {
            const Change& change = changes_[k];
            weight[k] = dot(change.x, direction) / change.curvature;
            for (std::size_t i = 0; i < direction.size(); ++i) direction[i] -= weight[k] * change.gradient[i];
        }
        metric(direction);
        for (double& d : direction) d *= scale_;
        for (std::size_t k = 0; k < changes_.size(); ++k) {
            const Change& change = changes_[k];
            const double more = weight[k] - dot(change.gradient, direction) / change.curvature;
            for (std::size_t i = 0; i < direction.size(); ++i) direction[i] += more * change.x[i];
        }
    }

    template <class Metric>
    void remember(const std::vector<double>& x, const std::vector<double>& x_new, const std::vector<double>& gradient,
                  const std::vector<double>& gradient_new, Metric&& metric) {
        Change change{x_new, gradient_new, 0.0};
        for (std::size_t i = 0; i < x.size(); ++i) change.x[i] -= x[i], change.gradient[i] -= gradient[i];
        change.curvature = dot(change.x, change.gradient);
        if (!(change.curvature > 1e-12 * std::sqrt(dot(change.x, change.x) * dot(change.gradient, change.gradient))))
            return;
        std::vector<double> step = change.gradient;
        metric(step);
        scale_ = change.curvature / dot(change.gradient, step);
        if (changes_.size() == kMemory) changes_.erase(changes_.begin());
        changes_.push_back(std::move(change));
    }

    // Returns the step taken, 0 where none lowers the cost.
    template <class Function>
    double search(Function&& function, const std::vector<double>& x, Descent& found, double slope,
                  const std::vector<double>& direction, std::vector<double>& x_new, std::vector<double>& gradient_new,
                  double& cost_new) const {
        double largest = 0.0;
        for (const double d : direction) largest = std::max(largest, std::fabs(d));
        const double most = longest_step / std::max(largest, 1e-300);
        double low = 0.0, high = INFINITY, step = std::min(1.0, most);
        for (int trial = 0; trial < 30; ++trial) {
            for (std::size_t i = 0; i < x.size(); ++i) x_new[i] = x[i] + step * direction[i];
            cost_new = function(x_new, gradient_new);
            ++found.evaluations;
            if (!(cost_new <= found.cost + 1e-4 * step * slope)) {
                high = step;
                // The parabola through both values and the first slope, kept inside the bracket.
                const double bent = 2.0 * (cost_new - found.cost - step * slope);
                const double lowest = std::isfinite(cost_new) && low == 0.0 ? -slope * step * step / bent : 0.0;
                step = std::min(std::max(lowest, low + 0.1 * (high - low)), low + 0.6 * (high - low));
            } else if (dot(gradient_new, direction) < 0.9 * slope && step < most) {
                low = step;
                step = std::isinf(high) ? std::min(2.0 * step, most) : 0.5 * (low + high);
            } else {
                return step;
            }
        }
        return 0.0;
    }
};

}  // namespace goshawk
