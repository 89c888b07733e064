// Integral of the penalties along a spline, with its gradient; the plain twin is in planner/time_allocation.py.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "penalty.hpp"

namespace nb = nanobind;
using goshawk::Bounds;
using goshawk::Motion;
using goshawk::Vec;
using In = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

namespace {

constexpr int kStates = 8, kOrders = 5;

Vec load(const double* p) { return {p[0], p[1], p[2]}; }

// states (k, 8, 3), durations (k,), basis (5, s, 8) from scaled states to derivatives by u, near (k, s) and by_position
// (k, s, 3): price of the position at each sample and its gradient. Fills by_states (k, 8, 3) and by_durations (k,).
double running_cost(In states, In durations, In basis, In bounds, double price, In near, In by_position, Out by_states,
                    Out by_durations) {
    const int64_t segments = static_cast<int64_t>(durations.shape(0)), samples = static_cast<int64_t>(basis.shape(1));
    const double* b = bounds.data();
    const Bounds limits{b[0], b[1], b[2], b[3], b[4], b[5], b[6]};
    double total = 0.0;
    for (int64_t i = 0; i < segments; ++i) {
        const double T = durations.data()[i], step = T / static_cast<double>(samples);
        const double* d = states.data() + i * kStates * 3;
        double power[kOrders] = {1.0, T, T * T, T * T * T, T * T * T * T};
        Vec scaled[kStates], by_scaled[kStates] = {};
        for (int a = 0; a < kStates; ++a) scaled[a] = load(d + 3 * a) * power[a % 4];
        double density = 0.0, stretch = 0.0;
        for (int64_t s = 0; s < samples; ++s) {
            Vec motion[kOrders] = {};
            for (int r = 1; r < kOrders; ++r) {
                const double* row = basis.data() + (r * samples + s) * kStates;
                for (int a = 0; a < kStates; ++a) motion[r] = motion[r] + scaled[a] * row[a];
                motion[r] = motion[r] * (1.0 / power[r]);
            }
            Motion by;
            const double limit = goshawk::dynamics({motion[1], motion[2], motion[3], motion[4]}, limits, by);
            density += price * limit + near.data()[i * samples + s];
            const Vec gradient[kOrders] = {load(by_position.data() + 3 * (i * samples + s)), by.velocity * price,
                                           by.acceleration * price, by.jerk * price, by.snap * price};
            for (int r = 0; r < kOrders; ++r) {
                const double* row = basis.data() + (r * samples + s) * kStates;
                const Vec g = gradient[r] * (step / power[r]);
                for (int a = 0; a < kStates; ++a) by_scaled[a] = by_scaled[a] + g * row[a];
                stretch -= step * r / T * gradient[r].dot(motion[r]);
            }
        }
        total += step * density;
        double* out = by_states.data() + i * kStates * 3;
        for (int a = 0; a < kStates; ++a) {
            const Vec g = by_scaled[a] * power[a % 4];
            out[3 * a] = g.x, out[3 * a + 1] = g.y, out[3 * a + 2] = g.z;
            stretch += (a % 4) / T * g.dot(load(d + 3 * a));
        }
        by_durations.data()[i] = density / static_cast<double>(samples) + stretch;
    }
    return total;
}

}  // namespace

void bind_running_cost(nb::module_& m) {
    m.def("running_cost", &running_cost, nb::arg("states"), nb::arg("durations"), nb::arg("basis"), nb::arg("bounds"),
          nb::arg("price"), nb::arg("near"), nb::arg("by_position"), nb::arg("by_states"), nb::arg("by_durations"),
          "Integral of the penalties; fills its gradients by the segments' states and durations.");
}
