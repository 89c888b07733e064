// Least squares on a chain of states with a border of parameters, and the lag of motors: binding of the kernels.
// The callers (estimator/joint_problem/chain.py, estimator/motors/motor.py) own names, shapes and checks.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <vector>

#include "drive.hpp"
#include "kernels.hpp"

namespace nb = nanobind;
using namespace goshawk;

namespace {

const Kernels& pick() {
#if defined(__x86_64__) && defined(__GNUC__)
    if (kernels_avx512 && __builtin_cpu_supports("avx512f")) return *kernels_avx512;
    if (kernels_avx2 && __builtin_cpu_supports("avx2")) return *kernels_avx2;
#endif
    return *kernels_plain;
}

const Kernels& kernels = pick();

// Arrays of some megabytes come and go at every step. Given back to the system each time, they cost as much as the
// arithmetic in them, for the system clears every page anew; so what was freed is kept for the next one.
void keep_freed_memory() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 30);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
}

// Rows 0 to 11 of (intervals, 12, m) in place: integrals of force and torque (0-2, 6-8) times their scale, and rates of
// change (3-5, 9-11) times theirs less the part that the integral foretells. scale: per interval 3 x 6 numbers.
void whiten(const double* scale, std::size_t intervals, std::size_t m, double* rows) {
    for (std::size_t k = 0; k < intervals; ++k, scale += 18, rows += 12 * m)
        for (int i = 0; i < 6; ++i) {
            double* integral = rows + (i < 3 ? i : i + 3) * m;
            double* rate = integral + 3 * m;
            const double first = scale[i], second = scale[6 + i], mixed = scale[12 + i];
            for (std::size_t c = 0; c < m; ++c) {
                integral[c] *= first;
                rate[c] = rate[c] * second - integral[c] * mixed;
            }
        }
}

using Blocks = nb::ndarray<double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using ConstBlocks = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Lines = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using ConstLine = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using ConstLines = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Derivatives by the states alone.
Rows of_states(const ConstBlocks& before, const ConstBlocks& after, const ConstBlocks& sensor_state) {
    return {before.data(),
            after.data(),
            nullptr,
            nullptr,
            sensor_state.data(),
            nullptr,
            nullptr,
            sensor_state.shape(0),
            before.shape(1),
            sensor_state.shape(1),
            0};
}

}  // namespace

NB_MODULE(_sysid, module) {
    keep_freed_memory();
    module.def(
        "factor",
        [](Blocks diagonal, Blocks coupling) {
            nb::gil_scoped_release release;
            return kernels.factor(static_cast<int>(diagonal.shape(1)), diagonal.data(), coupling.data(),
                                  diagonal.shape(0));
        },
        nb::arg("diagonal"), nb::arg("coupling"));
    module.def(
        "solve",
        [](ConstBlocks factor, ConstBlocks coupling, Blocks columns, bool only_back) {
            nb::gil_scoped_release release;
            kernels.solve(static_cast<int>(factor.shape(1)), factor.data(), coupling.data(), columns.data(),
                          columns.shape(0), columns.shape(2), only_back);
        },
        nb::arg("factor"), nb::arg("coupling"), nb::arg("columns"), nb::arg("only_back") = false);
    module.def(
        "eliminate",
        [](ConstBlocks before, ConstBlocks after, ConstBlocks border, ConstLines defect, ConstBlocks sensor_state,
           ConstBlocks sensor_border, ConstLines sensor, Blocks diagonal, Blocks coupling, Blocks columns,
           Lines reduced) {
            const Rows rows{before.data(),       after.data(),          border.data(),  defect.data(),
                            sensor_state.data(), sensor_border.data(),  sensor.data(),  sensor_state.shape(0),
                            before.shape(1),     sensor_state.shape(1), border.shape(2)};
            nb::gil_scoped_release release;
            std::vector<double> work(kernels.workspace(rows));
            return kernels.eliminate(static_cast<int>(diagonal.shape(1)), rows, diagonal.data(), coupling.data(),
                                     columns.data(), reduced.data(), work.data());
        },
        nb::arg("before"), nb::arg("after"), nb::arg("border"), nb::arg("defect"), nb::arg("sensor_state"),
        nb::arg("sensor_border"), nb::arg("sensor"), nb::arg("diagonal"), nb::arg("coupling"), nb::arg("columns"),
        nb::arg("reduced"));
    module.def(
        "leverage",
        [](ConstBlocks before, ConstBlocks after, ConstBlocks sensor_state, ConstBlocks factor, ConstBlocks coupling,
           Lines defect, Lines sensor) {
            const Rows rows = of_states(before, after, sensor_state);
            nb::gil_scoped_release release;
            kernels.leverage(static_cast<int>(factor.shape(1)), rows, factor.data(), coupling.data(), defect.data(),
                             sensor.data());
        },
        nb::arg("before"), nb::arg("after"), nb::arg("sensor_state"), nb::arg("factor"), nb::arg("coupling"),
        nb::arg("defect"), nb::arg("sensor"));
    module.def(
        "add_change",
        [](ConstBlocks before, ConstBlocks after, ConstBlocks sensor_state, ConstBlocks states, Blocks defect,
           Blocks sensor) {
            const Rows rows = of_states(before, after, sensor_state);
            nb::gil_scoped_release release;
            kernels.add_change(static_cast<int>(states.shape(1)), rows, states.data(), states.shape(2), defect.data(),
                               sensor.data());
        },
        nb::arg("before"), nb::arg("after"), nb::arg("sensor_state"), nb::arg("states"), nb::arg("defect"),
        nb::arg("sensor"));
    module.def(
        "whiten",
        [](ConstLines scale, Blocks rows) {
            nb::gil_scoped_release release;
            whiten(scale.data(), rows.shape(0), rows.shape(2), rows.data());
        },
        nb::arg("scale"), nb::arg("rows"));
    module.def(
        "drive",
        [](ConstLine step_s, ConstLines command, ConstBlocks by, double rise_s, double fall_s, Lines mean, Lines change,
           Blocks mean_by, Blocks change_by) {
            nb::gil_scoped_release release;
            std::vector<double> state(by.shape(2) + 2);
            drive(step_s.data(), command.data(), by.data(), command.shape(0), command.shape(1), by.shape(2), rise_s,
                  fall_s, mean.data(), change.data(), mean_by.data(), change_by.data(), state.data());
        },
        nb::arg("step_s"), nb::arg("command"), nb::arg("by"), nb::arg("rise_s"), nb::arg("fall_s"), nb::arg("mean"),
        nb::arg("change"), nb::arg("mean_by"), nb::arg("change_by"));
}
