// Thin Python binding of the vehicle kernel; the caller checks shapes (vehicle/native.py).
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <optional>

#include "flat.hpp"
#include "model.hpp"
#include "motion.hpp"
#include "own_effect.hpp"

namespace nb = nanobind;
using namespace goshawk;

using In = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using InOut = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using InOut3 = nb::ndarray<double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

namespace {

// Row of surroundings: q_world_body 0-3, height 4, ceiling gap 5, rotor acceleration 6-9.
constexpr int kSurroundings = 10;

template <class T>
void fill(Flow<T>& flow, const double* motion, const double* around) {
    for (int k = 0; k < 3; ++k) flow.velocity[k] = T(motion[k]);
    for (int k = 0; k < 3; ++k) flow.rate[k] = T(motion[3 + k]);
    for (int k = 0; k < 4; ++k) flow.rotor_speed[k] = T(motion[6 + k]);
    for (int k = 0; k < 4; ++k) flow.q[k] = T(around[k]);
    flow.height = T(around[4]);
    flow.ceiling_gap = T(around[5]);
    for (int k = 0; k < 4; ++k) flow.rotor_acceleration[k] = T(around[6 + k]);
}

template <class T>
void result(const Model&, const Body<T>& body, const Flow<T>& flow, bool as_acceleration, T out[6]) {
    for (int k = 0; k < 3; ++k) out[k] = as_acceleration ? flow.force[k] / body.mass : flow.force[k];
    if (as_acceleration) {
        angular_acceleration(body, flow.rate, flow.torque, out + 3);
    } else {
        for (int k = 0; k < 3; ++k) out[3 + k] = flow.torque[k];
    }
}

const double* row(const In& array, size_t i) { return array.data() + (array.shape(0) == 1 ? 0 : i) * array.shape(1); }

void evaluate(const Model& model, In values, In motion, In around, bool as_acceleration, InOut out) {
    nb::gil_scoped_release release;
    for (size_t i = 0; i < motion.shape(0); ++i) {
        const double* v = row(values, i);
        const Body<double> body = rigid_body(model, v);
        Flow<double> flow;
        fill(flow, row(motion, i), row(around, i));
        wrench(model, v, body, flow);
        result(model, body, flow, as_acceleration, out.data() + 6 * i);
    }
}

// Directions are numbered: 0-9 motion, 10-19 surroundings (of which 10-12 is a body-axes turn of the attitude,
// 14 height (the gap to the ceiling is not differentiated), 16-19 rotor acceleration), 20 + j value j.
template <class Number>
void seed(Number* const motion[10], Flow<Number>& flow, std::vector<Number>& values, int direction, int slot) {
    if (direction < 10) {
        motion[direction]->d[slot] = 1.0;
    } else if (direction < 13) {
        const double q[4] = {flow.q[0].v, flow.q[1].v, flow.q[2].v, flow.q[3].v};
        const int k = direction - 10;
        const double turn[3][4] = {{-q[1], q[0], q[3], -q[2]}, {-q[2], -q[3], q[0], q[1]}, {-q[3], q[2], -q[1], q[0]}};
        for (int i = 0; i < 4; ++i) flow.q[i].d[slot] = 0.5 * turn[k][i];
    } else if (direction == 14) {
        flow.height.d[slot] = 1.0;
    } else if (direction >= 16 && direction < 20) {
        flow.rotor_acceleration[direction - 16].d[slot] = 1.0;
    } else if (direction >= 20) {
        values[direction - 20].d[slot] = 1.0;
    }
}

// Writes direction j into column slots[j] of slopes (n, 6, columns), kDirections at a time.
template <int kDirections>
void some_at_a_time(const Model& model, In values, In motion, In around, const std::vector<int>& slots,
                    const std::vector<int>& directions, bool as_acceleration, InOut out, InOut3 slopes) {
    using Number = Dual<kDirections>;
    const int total = static_cast<int>(directions.size());
    std::vector<Number> v(model.width);
    for (size_t i = 0; i < motion.shape(0); ++i) {
        for (int first = 0; first < total || first == 0; first += kDirections) {
            const double* numbers = row(values, i);
            for (int j = 0; j < model.width; ++j) v[j] = Number(numbers[j]);
            Flow<Number> flow;
            fill(flow, row(motion, i), row(around, i));
            Number* where[10];
            for (int k = 0; k < 3; ++k) where[k] = &flow.velocity[k], where[3 + k] = &flow.rate[k];
            for (int k = 0; k < 4; ++k) where[6 + k] = &flow.rotor_speed[k];
            const int count = total - first < kDirections ? total - first : kDirections;
            for (int s = 0; s < count; ++s) seed(where, flow, v, directions[first + s], s);
            const Body<Number> body = rigid_body(model, v.data());
            wrench(model, v.data(), body, flow);
            Number six[6];
            result(model, body, flow, as_acceleration, six);
            for (int k = 0; k < 6; ++k) {
                out.data()[6 * i + k] = six[k].v;
                double* line = slopes.data() + (6 * i + k) * slopes.shape(2);
                for (int s = 0; s < count; ++s) line[slots[first + s]] = six[k].d[s];
            }
        }
    }
}

void jacobian(const Model& model, In values, In motion, In around, const std::vector<int>& slots,
              const std::vector<int>& directions, bool as_acceleration, InOut out, InOut3 slopes) {
    nb::gil_scoped_release release;
    const size_t total = directions.size();
    const bool wide = (total + 15) / 16 < (total + 11) / 12;  // fewer rounds, each of which repeats the values
    (wide ? some_at_a_time<16> : some_at_a_time<12>)(model, values, motion, around, slots, directions, as_acceleration,
                                                     out, slopes);
}

// world: one row of wind 0-2, gravity 3, ground 4, ceiling 5 per vehicle
void step(const Model& model, In values, In world, In command, In battery_v, int steps, double step_s, InOut states,
          InOut specific_force, InOut energy_j) {
    nb::gil_scoped_release release;
    for (size_t i = 0; i < states.shape(0); ++i) {
        const double* w = row(world, i);
        const World around = {{w[0], w[1], w[2]}, w[3], w[4], w[5]};
        energy_j.data()[i] = integrate(model, row(values, i), around, row(command, i), row(battery_v, i)[0], steps,
                                       step_s, states.data() + kState * i, specific_force.data() + 3 * i);
    }
}

// required: rows of force along body z, then torque. motion: its rotor speeds are the start. Rows of out are NaN where
// no speeds exist.
void invert(const Model& model, In values, In required, In motion, In around, InOut out) {
    nb::gil_scoped_release release;
    std::optional<Inversion> inversion;
    for (size_t i = 0; i < out.shape(0); ++i) {
        if (i == 0 || values.shape(0) > 1) inversion.emplace(model, row(values, i));
        const double* m = row(motion, i);
        double n[4] = {m[6], m[7], m[8], m[9]};
        Flow<double> flow{};
        fill(flow, m, row(around, i));
        const bool found = (*inversion)(flow, row(required, i), n);
        for (int k = 0; k < 4; ++k) out.data()[4 * i + k] = found ? n[k] : NAN;
    }
}

PathPoint path_point(const double* p) { return {{p[0], p[1], p[2]}, {p[3], p[4], p[5]}, p[6], p[7]}; }

// path: rows of velocity 0-2, acceleration 3-5, height 6, yaw 7, five rows per instant.
// out: rows of q 0-3, rate 4-6, its derivative 7-9, thrust 10, torque 11-13, rotor speed 14-17.
void flatness(const Model& model, In values, double gravity, In hover, double spacing, In path, InOut out) {
    nb::gil_scoped_release release;
    const Body<double> body = rigid_body(model, values.data());
    const Alignment alignment{model, values.data(), body, gravity};
    const Inversion inversion(model, values.data());
    for (size_t i = 0; i < out.shape(0); ++i) {
        PathPoint points[5];
        for (int s = 0; s < 5; ++s) points[s] = path_point(path.data() + (5 * i + s) * 8);
        Flat flat;
        flatten(alignment, inversion, hover.data(), spacing, points, flat);
        double* o = out.data() + 18 * i;
        for (int k = 0; k < 4; ++k) o[k] = flat.q[k], o[14 + k] = flat.rotor_speed[k];
        for (int k = 0; k < 3; ++k) o[4 + k] = flat.rate[k], o[7 + k] = flat.turn[k], o[11 + k] = flat.torque[k];
        o[10] = flat.thrust;
    }
}

// path: rows as for flatness, as many per piece as nodes. first, second: (nodes, nodes); scale: one row per piece.
// out: rows of the cosine of the tilt, body rate 1-3, rotor speed 4-7.
void nodes_of(const Model& model, In values, double gravity, In hover, In first, In second, In scale, In path,
              InOut out) {
    nb::gil_scoped_release release;
    const Body<double> body = rigid_body(model, values.data());
    const Alignment alignment{model, values.data(), body, gravity};
    const Inversion inversion(model, values.data());
    const size_t nodes = first.shape(0);
    std::vector<PathPoint> points(nodes);
    for (size_t i = 0; i < scale.shape(0); ++i) {
        for (size_t j = 0; j < nodes; ++j) points[j] = path_point(path.data() + (nodes * i + j) * 8);
        at_nodes(alignment, inversion, hover.data(), nodes, first.data(), second.data(), scale.data()[i], points.data(),
                 out.data() + nodes * i * 8);
    }
}

}  // namespace

NB_MODULE(_vehicle, m) {
    m.doc() = "Compiled kernel of the vehicle model.";
    nb::class_<Model>(m, "Model")
        .def("__init__",
             [](Model* self, const std::vector<std::string>& names, In hubs, In spins, const OwnEffects& own) {
                 new (self) Model(names, hubs.data(), spins.data(), own_effects(own));
             })
        .def_ro("width", &Model::width)
        .def("evaluate", &evaluate)
        .def("jacobian", &jacobian)
        .def("step", &step)
        .def("invert", &invert)
        .def("flatness", &flatness)
        .def("at_nodes", &nodes_of);
    m.def("effects", [] {
        std::vector<std::pair<std::string, int>> known;
        for (const Entry& e : catalogue()) known.emplace_back(e.name, e.parameters);
        return known;
    });
}
