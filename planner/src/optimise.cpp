// Thin Python binding of the spline and the optimiser; names, checks and documentation are in the Python modules.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <atomic>
#include <cstdint>
#include <stdexcept>
#include <type_traits>

#include "problem.hpp"

namespace nb = nanobind;
using namespace goshawk;
using In = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<double, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<nb::numpy, const double>;

namespace {

// Raised by one thread, seen by another within an iteration.
struct StopFlag {
    std::atomic<bool> raised{false};
};

// Ascending coefficients in seconds (segments, axes, 8).
template <int A>
void coefficients(const double* states, const double* durations, std::size_t segments, double* out) {
    constexpr double kFactorial[kOrders] = {1.0, 1.0, 2.0, 6.0};
    for (std::size_t i = 0; i < segments; ++i) {
        const double T = durations[i], rate = 1.0 / T;
        const Ends<A> scaled = scaled_ends<A>(states, i, T);
        for (int x = 0; x < A; ++x, out += kStates) {
            for (int n = 0; n < kOrders; ++n) out[n] = states[(i * kOrders + n) * A + x] / kFactorial[n];
            double power = rate * rate * rate * rate;
            for (int n = kOrders; n < kStates; ++n, power *= rate) {
                out[n] = 0.0;
                for (int a = 0; a < kStates; ++a) out[n] += kMonomials[n][a] * scaled.row[a][x];
                out[n] *= power;
            }
        }
    }
}

// Calls work with a number of axes from 1 to 4 as a constant.
template <class Work>
void for_axes(std::size_t axes, Work&& work) {
    using std::integral_constant;
    switch (axes) {
        case 1:
            return work(integral_constant<int, 1>{});
        case 2:
            return work(integral_constant<int, 2>{});
        case 3:
            return work(integral_constant<int, 3>{});
        case 4:
            return work(integral_constant<int, 4>{});
        default:
            throw std::invalid_argument("a spline has one to four axes");
    }
}

// states (k + 1, 4, axes): fills in the interior derivatives.
// Velocities of knots marked in held (k + 1) stay.
void snap_states(Out states, In durations, Flags held) {
    for_axes(states.shape(2), [&](auto axes) {
        nb::gil_scoped_release release;
        SnapSystem system;
        fill_states<axes()>(system, states.data(), durations.data(), durations.shape(0), held.data());
    });
}

void snap_coefficients(In states, In durations, Out out) {
    for_axes(states.shape(2), [&](auto axes) {
        nb::gil_scoped_release release;
        coefficients<axes()>(states.data(), durations.data(), durations.shape(0), out.data());
    });
}

// In the order of the struct: 14 numbers, and 7 for each of four or eight rotors.
Airframe airframe_from(const In& values) {
    constexpr std::size_t kFirst = offsetof(Airframe, effort_least) / sizeof(double);
    static_assert(kFirst == 14, "planner/optimise/airframe.py packs as many");
    Airframe airframe{};
    airframe.rotors = static_cast<int>((values.size() - kFirst) / 7);
    std::copy_n(values.data(), kFirst, reinterpret_cast<double*>(&airframe));
    const double* from = values.data() + kFirst;
    for (double* to : {airframe.effort_least, airframe.effort_most, airframe.effort_hover}) {
        std::copy_n(from, airframe.rotors, to);
        from += airframe.rotors;
    }
    std::copy_n(from, 4 * airframe.rotors, airframe.mix[0]);
    return airframe;
}

// `distances(points) -> (distance, gradient)` runs with the interpreter's lock held.
Distances called_back(nb::object distances) {
    return [distances](const double* points, std::size_t count, double* distance, double* gradient) {
        nb::gil_scoped_acquire acquire;
        const nb::tuple found = nb::cast<nb::tuple>(distances(Points(points, {count, 3}, nb::none())));
        const In value = nb::cast<In>(found[0]), slope = nb::cast<In>(found[1]);
        std::copy_n(value.data(), count, distance);
        std::copy_n(slope.data(), 3 * count, gradient);
    };
}

Problem* make_problem(std::size_t segments, std::size_t samples, In airframe, In prices, In clearances,
                      nb::object distances) {
    const double* p = prices.data();
    return new Problem(segments, samples, airframe_from(airframe), {p[0], p[1], p[2], p[3], p[4]}, clearances.data(),
                       called_back(std::move(distances)));
}

double evaluate(Problem& problem, In knots, In durations, Out by_knots, Out by_durations) {
    nb::gil_scoped_release release;
    return problem.evaluate(knots.data(), durations.data(), by_knots.data(), by_durations.data());
}

void excess(const Problem& problem, In states, In durations, Out out) {
    nb::gil_scoped_release release;
    problem.excess(states.data(), durations.data(), out.data());
}

void set_offsets(Problem& problem, In offsets) { problem.set_offsets(offsets.data()); }

void set_reference(Problem& problem, In durations) { problem.set_reference(durations.data()); }

void set_speeds(Problem& problem, In speeds) {
    std::copy_n(speeds.data(), problem.speeds().size(), problem.speeds().data());
}

void set_jerks(Problem& problem, In jerks) {
    std::copy_n(jerks.data(), problem.jerks().size(), problem.jerks().data());
}

void set_given(Problem& problem, In states, Flags held) {
    std::copy_n(states.data(), problem.given().size(), problem.given().data());
    std::copy_n(held.data(), problem.held().size(), problem.held().data());
}

void set_balls(Problem& problem, In balls) {
    std::copy_n(balls.data(), problem.balls().size(), problem.balls().data());
}

void set_gates(Problem& problem, In gates) {
    std::copy_n(gates.data(), problem.gates().size(), problem.gates().data());
}

void look_at(Problem& problem, double x, double y) { problem.look_at(x, y); }

nb::tuple minimise(Problem& problem, Out knots, Out durations, Flags free, int iterations, double precision,
                   const StopFlag* stop) {
    Lbfgs method;
    method.iterations = iterations;
    method.precision = precision;
    method.stop = stop ? &stop->raised : nullptr;
    Descent found;
    {
        nb::gil_scoped_release release;
        found = problem.minimise(knots.data(), durations.data(), free.data(), method);
    }
    return nb::make_tuple(found.cost, found.evaluations, found.converged, found.stopped);
}

double slopes(Problem& problem, In states, In durations, Out by_states, Out by_log_durations) {
    nb::gil_scoped_release release;
    return problem.slopes(states.data(), durations.data(), by_states.data(), by_log_durations.data());
}

nb::tuple refine(Problem& problem, Out states, Out durations, Flags free, int iterations, double precision, double hold,
                 const StopFlag* stop) {
    Newton method;
    method.hold = hold;
    method.iterations = iterations;
    method.precision = precision;
    method.stop = stop ? &stop->raised : nullptr;
    Refined found;
    {
        nb::gil_scoped_release release;
        found = problem.refine(states.data(), durations.data(), free.data(), method);
    }
    return nb::make_tuple(found.cost, found.evaluations, found.converged, found.stopped, found.residual);
}

}  // namespace

void bind_optimise(nb::module_& m) {
    m.def("snap_states", &snap_states, nb::arg("states"), nb::arg("durations"), nb::arg("held"));
    m.def("snap_coefficients", &snap_coefficients, nb::arg("states"), nb::arg("durations"), nb::arg("coefficients"));
    nb::class_<StopFlag>(m, "StopFlag", "Set it from any thread to end an optimisation within one iteration.")
        .def(nb::init<>())
        .def("set", [](StopFlag& flag) { flag.raised = true; })
        .def("is_set", [](const StopFlag& flag) { return flag.raised.load(); });
    nb::class_<Problem>(m, "Problem")
        .def(nb::new_(&make_problem), nb::arg("segments"), nb::arg("samples"), nb::arg("airframe"), nb::arg("prices"),
             nb::arg("clearances"), nb::arg("distances"))
        .def("evaluate", &evaluate, nb::arg("knots"), nb::arg("durations"), nb::arg("by_knots"),
             nb::arg("by_durations"))
        .def("excess", &excess, nb::arg("states"), nb::arg("durations"), nb::arg("out"))
        .def("set_offsets", &set_offsets, nb::arg("offsets"))
        .def("set_reference", &set_reference, nb::arg("durations"))
        .def("set_speeds", &set_speeds, nb::arg("speeds"))
        .def("set_jerks", &set_jerks, nb::arg("jerks"))
        .def("set_given", &set_given, nb::arg("states"), nb::arg("held"))
        .def("set_balls", &set_balls, nb::arg("balls"))
        .def("set_gates", &set_gates, nb::arg("gates"))
        .def("look_at", &look_at, nb::arg("x"), nb::arg("y"))
        .def("minimise", &minimise, nb::arg("knots"), nb::arg("durations"), nb::arg("free"), nb::arg("iterations"),
             nb::arg("precision"), nb::arg("stop").none())
        .def("slopes", &slopes, nb::arg("states"), nb::arg("durations"), nb::arg("by_states"),
             nb::arg("by_log_durations"))
        .def("refine", &refine, nb::arg("states"), nb::arg("durations"), nb::arg("free"), nb::arg("iterations"),
             nb::arg("precision"), nb::arg("hold"), nb::arg("stop").none());
}
