// The Python face of the kernels: arrays in, arrays out. Names, checks and documentation are in the Python modules.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <cstring>
#include <stdexcept>
#include <string>

#include "edt.hpp"
#include "query.hpp"

namespace nb = nanobind;
using namespace goshawk;

namespace {

template <class T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T, int N>
using Out = nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
using OutBox = nb::ndarray<float, nb::ndim<3>, nb::device::cpu>;

enum class Isa { portable, avx2, avx512 };

Isa best_isa() {
#if GOSHAWK_X86_VARIANTS
    if (__builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) return Isa::avx512;
    if (__builtin_cpu_supports("avx2")) return Isa::avx2;
#endif
    return Isa::portable;
}

Isa isa_named(const std::string& name) {
    const Isa best = best_isa();
    if (name == "best") return best;
    const Isa wanted = name == "avx512" ? Isa::avx512 : name == "avx2" ? Isa::avx2 : Isa::portable;
    if (wanted > best) throw std::invalid_argument("this processor has no " + name);
    return wanted;
}

template <class T>
void dispatch(const Request<T>& request, Isa isa) {
#if GOSHAWK_X86_VARIANTS
    if (isa == Isa::avx512) return avx512::transform(request);
    if (isa == Isa::avx2) return avx2::transform(request);
#endif
    (void)isa;
    portable::transform(request);
}

// One overload per number type; `faces` has bit 2 * axis + side set where everything beyond that face is solid.
template <class T>
void transform(In<std::uint8_t, 3> state, OutBox out, nb::tuple lo, In<T, 1> table_x, In<T, 1> table_y, In<T, 1> table_z, T cap,
               float scale, float cap_m, bool unknown_is_solid, bool unknown_is_nan, int faces, Out<T, 1> scratch, int threads,
               const std::string& isa) {
    Request<T> r{};
    const In<T, 1>* tables[3] = {&table_x, &table_y, &table_z};
    r.state = state.data();
    for (int a = 0; a < 3; ++a) {
        r.n[a] = static_cast<Index>(state.shape(a));
        r.lo[a] = nb::cast<Index>(lo[a]);
        r.hi[a] = r.lo[a] + static_cast<Index>(out.shape(a));
        r.table[a] = tables[a]->data();
        r.reach[a] = 1;
        while (r.reach[a] <= r.n[a] && r.table[a][r.reach[a]] < cap) ++r.reach[a];
        r.face_is_solid[a][0] = faces >> (2 * a) & 1;
        r.face_is_solid[a][1] = faces >> (2 * a + 1) & 1;
    }
    r.cap = cap;
    r.unknown_is_solid = unknown_is_solid;
    r.unknown_is_nan = unknown_is_nan;
    r.scale = scale;
    r.cap_m = cap_m;
    r.scratch = scratch.data();
    r.out = out.data();
    r.out_stride[0] = out.stride(0);
    r.out_stride[1] = out.stride(1);
    r.threads = threads;
    const Isa chosen = isa_named(isa);
    nb::gil_scoped_release release;
    dispatch(r, chosen);
}

Lattice lattice_of(nb::tuple origin, nb::tuple voxel, const In<float, 3>& values) {
    Lattice lattice;
    for (int a = 0; a < 3; ++a) {
        lattice.origin[a] = nb::cast<double>(origin[a]);
        lattice.per_voxel[a] = 1.0 / nb::cast<double>(voxel[a]);
        lattice.n[a] = static_cast<Index>(values.shape(a));
    }
    return lattice;
}

template <bool WANT_GRADIENT>
void query_dense(const In<float, 3>& values, const Lattice& lattice, const double* points, Index count, double* distance, double* gradient) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const Index sy = lattice.n[2], sx = lattice.n[1] * lattice.n[2];
    const Index step[3] = {lattice.n[0] > 1 ? sx : 0, lattice.n[1] > 1 ? sy : 0, lattice.n[2] > 1 ? 1 : 0};
    for (Index i = 0; i < count; ++i) {
        Cell cell;
        if (locate(lattice, points + 3 * i, cell)) {
            const float* corner = values.data() + cell.index[0] * sx + cell.index[1] * sy + cell.index[2];
            distance[i] = interpolate<WANT_GRADIENT>(corner, step, lattice, cell, WANT_GRADIENT ? gradient + 3 * i : nullptr);
        } else {
            distance[i] = nan;
            if (WANT_GRADIENT) gradient[3 * i] = gradient[3 * i + 1] = gradient[3 * i + 2] = nan;
        }
    }
}

void distance(In<float, 3> values, nb::tuple origin, nb::tuple voxel, In<double, 2> points, Out<double, 1> out) {
    const Lattice lattice = lattice_of(origin, voxel, values);
    nb::gil_scoped_release release;
    query_dense<false>(values, lattice, points.data(), static_cast<Index>(points.shape(0)), out.data(), nullptr);
}

void distance_and_gradient(In<float, 3> values, nb::tuple origin, nb::tuple voxel, In<double, 2> points, Out<double, 1> out,
                           Out<double, 2> gradient) {
    const Lattice lattice = lattice_of(origin, voxel, values);
    nb::gil_scoped_release release;
    query_dense<true>(values, lattice, points.data(), static_cast<Index>(points.shape(0)), out.data(), gradient.data());
}

}  // namespace

NB_MODULE(_esdf, m) {
    m.def("transform_int16", &transform<std::int16_t>);
    m.def("transform_int32", &transform<std::int32_t>);
    m.def("transform_float", &transform<float>);
    m.def("distance", &distance);
    m.def("distance_and_gradient", &distance_and_gradient);
    m.def("instruction_sets", [] {
        nb::list names;
        names.append("portable");
        if (best_isa() >= Isa::avx2) names.append("avx2");
        if (best_isa() >= Isa::avx512) names.append("avx512");
        return names;
    });
}
