// The cost of a minimum-snap spline by its durations and knots, with the exact gradient, and its minimum.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "lbfgs.hpp"
#include "newton.hpp"
#include "samples.hpp"
#include "snap.hpp"

namespace goshawk {

// Distances (count) and their gradients (count, 3) at points (count, 3).
using Distances = std::function<void(const double* points, std::size_t count, double* distance, double* gradient)>;

class Problem {
  public:
    // clearances (k): what each segment aims at.
    Problem(std::size_t segments, std::size_t samples, const Airframe& airframe, const Prices& prices,
            const double* clearances, Distances distances);

    // Added to each excess: (k, samples, limits).
    void set_offsets(const double* offsets);

    // The time (k) over which each segment's excess is charged, whatever its own becomes. With multipliers among the
    // offsets, which are charged within the limits too, a segment would else cost less the shorter it is.
    void set_reference(const double* durations);

    // The speed limit of each segment (k); the airframe's own unless set.
    std::vector<double>& speeds() { return speeds_; }

    // The same of jerk.
    std::vector<double>& jerks() { return jerks_; }

    // Velocity, acceleration and jerk at both ends (zero unless set), and the velocity of knots that are held: numbers
    // of states (k + 1, 4, 4), and held (k + 1).
    std::vector<double>& given() { return given_; }
    std::vector<unsigned char>& held() { return held_; }

    // Balls round knots that may move, (k + 1, 4) centre and radius; leaving one is charged, a radius of 0 is none.
    std::vector<double>& balls() { return balls_; }

    // Openings of gates at knots that then move in their planes only, (k + 1, 3, 3): centre, and from there to the
    // middle of the left and of the upper edge; leaving one is charged, zero edges are none.
    std::vector<double>& gates() { return gates_; }

    // The vehicle looks at this point instead of along its path.
    void look_at(double x, double y) { target_ = {x, y}; }

    // knots (k + 1, 4), durations (k,); fills the gradients of the same shapes.
    double evaluate(const double* knots, const double* durations, double* by_knots, double* by_durations);

    // Excess over each limit at each sample, (k, samples, limits), without the offsets; of any spline, given by its
    // knot states (k + 1, 4, 4).
    void excess(const double* states, const double* durations, double* out) const;

    // From knots and durations to those of least cost, in place; only numbers marked free (k + 1, 4) move.
    Descent minimise(double* knots, double* durations, const unsigned char* free, Lbfgs& method);

    // The cost of knot states (k + 1, 4, 4) and durations, and its gradient by them, the durations' by their
    // logarithms.
    double slopes(const double* states, const double* durations, double* by_states, double* by_log_durations);

    // From knot states and durations to those of least cost, in place; only numbers marked free (k + 1, 4, 4) move.
    Refined refine(double* states, double* durations, const unsigned char* free, const Newton& method);

  private:
    // One way in which a knot may move.
    struct Direction {
        std::size_t knot;
        double along[kAxes];

        double dot(const double* rows) const {
            double sum = 0.0;
            for (int x = 0; x < kAxes; ++x) sum += along[x] * rows[knot * kAxes + x];
            return sum;
        }
        void add(double length, double* rows) const {
            for (int x = 0; x < kAxes; ++x) rows[knot * kAxes + x] += length * along[x];
        }
    };
    struct SafeBall {
        double centre[3] = {}, radius = -1.0;
    };
    void start(const double* knots, const double* durations);
    void ask_distances();
    double segment_cost(std::size_t i, double T, double& by_T);
    Airframe airframe_of(std::size_t segment) const;
    Samples samples_of(std::size_t segment, double T) const;
    double snap_alone(std::size_t i, double T) const;
    double snap_cost(std::size_t i, double T, double& by_T);
    double ball_cost(const double* knots, double* by_knots) const;
    double gate_cost(const double* knots, double* by_knots) const;
    double passing_cost();
    std::vector<Direction> directions(const unsigned char* free) const;
    double cost_of_states(const double* durations, const std::vector<double>& knots);
    Banded banded() const;
    void curvature(std::size_t i, double T, const double* units, std::vector<double>& gradient, Banded& second) const;
    void knot_curvature(const std::vector<double>& knots, const double* units, std::vector<double>& gradient,
                        Banded& second) const;
    void adjoint(const double* durations, double* by_knots, double* by_durations);

    // Place of a number in arrays (segments, packs, rows, lanes).
    std::size_t place(std::size_t segment, std::size_t sample, std::size_t rows = 1, std::size_t row = 0) const {
        return ((segment * packs_ + sample / kLanes) * rows + row) * kLanes + sample % kLanes;
    }

    std::size_t segments_, samples_, packs_, limits_;
    Airframe airframe_;
    Prices prices_;
    Distances distances_;
    const Kernels& kernels_;
    std::vector<double> basis_, share_, offsets_, distance_, uphill_;  // see Samples
    std::vector<Ends<kAxes>> scaled_, force_;  // scaled states of each segment, and what its snap grows by with each
    std::vector<double> states_, by_states_, given_, reference_, speeds_, jerks_, clearances_, balls_, gates_;
    std::vector<unsigned char> held_;
    std::vector<double> target_;  // x, y; empty if the vehicle looks along its path
    std::vector<double> points_, asked_distance_, asked_gradient_;
    std::vector<std::size_t> asked_;
    std::vector<SafeBall> safe_;
    SnapSystem system_;
};

}  // namespace goshawk
