// The cost of a minimum-snap spline by its durations and knots, with the exact gradient, and its minimum.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "costs.hpp"
#include "lbfgs.hpp"
#include "snap.hpp"

namespace goshawk {

constexpr int kAxes = 4;  // x, y, z, yaw

struct Prices {
    double snap, limits, clearance, heading, turning;
};

// Distances (count) and their gradients (count, 3) at points (count, 3).
using Distances = std::function<void(const double* points, std::size_t count, double* distance, double* gradient)>;

class Problem {
  public:
    Problem(std::size_t segments, std::size_t samples, const Airframe& airframe, const Prices& prices,
            double clearance_m, Distances distances);

    std::vector<double>& offsets() { return offsets_; }

    // Velocity, acceleration and jerk at both ends (zero unless set), and the velocity of knots that are held: numbers
    // of states (k + 1, 4, 4), and held (k + 1).
    std::vector<double>& given() { return given_; }
    std::vector<unsigned char>& held() { return held_; }

    // Balls round knots that may move, (k + 1, 4) centre and radius; leaving one is charged, a radius of 0 is none.
    std::vector<double>& balls() { return balls_; }

    // The vehicle looks at this point instead of along its path.
    void look_at(const Vec& target) { target_ = target; }

    // knots (k + 1, 4), durations (k,); fills the gradients of the same shapes.
    double evaluate(const double* knots, const double* durations, double* by_knots, double* by_durations);

    // Excess over each limit at each sample, (k, samples, limits), without the offsets.
    void excess(const double* knots, const double* durations, double* out);

    // From knots and durations to those of least cost, in place; only numbers marked free (k + 1, 4) move.
    Descent minimise(double* knots, double* durations, const unsigned char* free, Lbfgs& method);

  private:
    struct SafeBall {
        Vec centre;
        double radius = -1.0;
    };
    struct Instant {
        double derivative[5][kAxes];
        Motion motion() const;
    };
    static Instant instant(const std::vector<double>& basis, const Ends<kAxes>& scaled, double T);
    void start(const double* knots, const double* durations);
    void ask_distances(const double* durations);
    double segment_cost(std::size_t i, double T, double& by_T);
    double snap_cost(std::size_t i, double T, double& by_T);
    double ball_cost(const double* knots, double* by_knots) const;
    void adjoint(const double* durations, double* by_knots, double* by_durations);

    std::size_t segments_, samples_;
    Airframe airframe_;
    Prices prices_;
    double clearance_m_;
    Distances distances_;
    std::vector<std::vector<double>> basis_;  // per sample (5, 8): derivatives by u from scaled states
    std::vector<double> share_;               // of the segment's time that each sample answers for
    std::vector<double> offsets_, states_, by_states_, given_, balls_;
    std::vector<unsigned char> held_;
    std::optional<Vec> target_;
    std::vector<double> points_, distance_, gradient_, asked_distance_, asked_gradient_;
    std::vector<std::size_t> asked_;
    std::vector<SafeBall> safe_;
    SnapSystem system_;
};

}  // namespace goshawk
