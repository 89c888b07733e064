// Python bindings of the kernels: arrays in, arrays out. Names, checks and documentation are in the Python modules.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "edt.hpp"
#include "query.hpp"
#include "raster.hpp"

namespace nb = nanobind;
using namespace goshawk;

namespace {

template <class T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T, int N>
using Out = nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T>
using OutBox = nb::ndarray<T, nb::ndim<3>, nb::device::cpu>;

struct Shape {  // of an array with three axes
    Index size[3];
    template <class Array>
    explicit Shape(const Array& a)
        : size{static_cast<Index>(a.shape(0)), static_cast<Index>(a.shape(1)), static_cast<Index>(a.shape(2))} {}
    Index operator[](int axis) const { return size[axis]; }
};

enum class Isa { portable, avx2, avx512 };

Isa best_isa() {
#if GOSHAWK_X86_VARIANTS
    if (__builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return Isa::avx512;
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
void transform(In<std::uint8_t, 3> state, OutBox<float> out, nb::tuple lo, In<T, 1> table_x, In<T, 1> table_y,
               In<T, 1> table_z, T cap, float scale, float cap_m, bool unknown_is_solid, bool unknown_is_nan, int faces,
               OutBox<T> scratch, int threads, const std::string& isa) {
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
    for (int a = 0; a < 2; ++a) {
        r.scratch_stride[a] = scratch.stride(a);
        r.out_stride[a] = out.stride(a);
    }
    r.threads = threads;
    const Isa chosen = isa_named(isa);
    nb::gil_scoped_release release;
    dispatch(r, chosen);
}

Point point_of(const In<double, 2>& points, std::size_t i) {
    return {points.data()[3 * i], points.data()[3 * i + 1], points.data()[3 * i + 2]};
}

Index voxel_of(double coordinate) { return static_cast<Index>(std::floor(coordinate)); }

Lattice lattice_of(nb::tuple origin, nb::tuple voxel, nb::tuple shape) {
    Lattice lattice;
    for (int a = 0; a < 3; ++a) {
        lattice.origin[a] = nb::cast<double>(origin[a]);
        lattice.per_voxel[a] = 1.0 / nb::cast<double>(voxel[a]);
        lattice.n[a] = nb::cast<Index>(shape[a]);
    }
    return lattice;
}

template <class Store>
void answer(const Store& store, const Lattice& lattice, const In<double, 2>& points, Out<double, 1>& out,
            Out<double, 2>* gradient, const std::string& isa) {
    const Isa chosen = isa_named(isa);
    nb::gil_scoped_release release;
    const Index count = static_cast<Index>(points.shape(0));
    double* slopes = gradient ? gradient->data() : nullptr;
#if GOSHAWK_X86_VARIANTS
    if (chosen == Isa::avx512) return avx512::query(store, lattice, points.data(), count, out.data(), slopes);
    if (chosen == Isa::avx2) return avx2::query(store, lattice, points.data(), count, out.data(), slopes);
#endif
    (void)chosen;
    portable::query(store, lattice, points.data(), count, out.data(), slopes);
}

void query_dense(In<float, 3> values, nb::tuple origin, nb::tuple voxel, In<double, 2> points, Out<double, 1> out,
                 std::optional<Out<double, 2>> gradient, const std::string& isa) {
    const Lattice lattice =
        lattice_of(origin, voxel, nb::make_tuple(values.shape(0), values.shape(1), values.shape(2)));
    answer(Dense(values.data(), lattice.n), lattice, points, out, gradient ? &*gradient : nullptr, isa);
}

// `addresses` (bricks along x, y, z): where each brick's values begin; the caller keeps them alive.
void query_bricks(In<std::uint64_t, 3> addresses, nb::tuple shape, nb::tuple origin, nb::tuple voxel,
                  In<double, 2> points, Out<double, 1> out, std::optional<Out<double, 2>> gradient,
                  const std::string& isa) {
    const Lattice lattice = lattice_of(origin, voxel, shape);
    answer(Bricks(addresses.data(), Shape(addresses).size, lattice.n), lattice, points, out,
           gradient ? &*gradient : nullptr, isa);
}

// Cut an array into bricks (edge + overlap values a side; beyond the array its last value is repeated). index gets the
// brick's number in `out`, or -1 - k if all of it is uniform[k]. Returns how many bricks were written.
template <class T>
Index cut_bricks(In<T, 3> values, Index overlap, In<T, 1> uniform, Out<T, 4> out, Out<std::int32_t, 3> index) {
    nb::gil_scoped_release release;
    const Shape n(values);
    const Index size = BRICK, edge = size + overlap;
    Index written = 0;
    std::int32_t* number = index.data();
    for (Index bx = 0; bx < static_cast<Index>(index.shape(0)); ++bx)
        for (Index by = 0; by < static_cast<Index>(index.shape(1)); ++by)
            for (Index bz = 0; bz < static_cast<Index>(index.shape(2)); ++bz, ++number) {
                T* brick = out.data() + written * edge * edge * edge;
                for (Index x = 0, to = 0; x < edge; ++x)
                    for (Index y = 0; y < edge; ++y, to += edge) {
                        const Index ix = std::min(bx * size + x, n[0] - 1), iy = std::min(by * size + y, n[1] - 1);
                        const T* line = values.data() + (ix * n[1] + iy) * n[2];
                        const Index real = std::min(edge, n[2] - bz * size);
                        std::memcpy(brick + to, line + bz * size, real * sizeof(T));
                        std::fill(brick + to + real, brick + to + edge, line[n[2] - 1]);
                    }
                // All equal if the brick equals itself shifted by one.
                const bool same = !std::memcmp(brick, brick + 1, (edge * edge * edge - 1) * sizeof(T));
                std::int32_t code = static_cast<std::int32_t>(written);
                for (std::size_t k = 0; same && k < uniform.shape(0); ++k)
                    if (!std::memcmp(brick, uniform.data() + k, sizeof(T))) code = -1 - static_cast<std::int32_t>(k);
                *number = code;
                written += code >= 0;
            }
    return written;
}

// The functions below take coordinates in voxels (see raster.hpp).

// Every voxel between origins[i] and ends[i] gets `value`, the last one excepted; occupied voxels stay.
void carve(Out<std::uint8_t, 3> state, In<double, 2> origins, In<double, 2> ends, std::uint8_t value) {
    nb::gil_scoped_release release;
    const Shape n(state);
    for (std::size_t i = 0; i < origins.shape(0); ++i) {
        const Point start = point_of(origins, i), end = point_of(ends, i);
        const Index last[3] = {voxel_of(end[0]), voxel_of(end[1]), voxel_of(end[2])};
        walk(start, end, n.size, [&](Index x, Index y, Index z) {
            if (x == last[0] && y == last[1] && z == last[2]) return false;
            std::uint8_t& voxel = state.data()[(x * n[1] + y) * n[2] + z];
            if (voxel != OCCUPIED) voxel = value;
            return true;
        });
    }
}

// As `carve`, but each line ends before the first occupied voxel. reached[i]: the distance from its origin to the
// centre of that voxel, in voxels; infinite where there is none before that of ends[i].
void carve_visible(Out<std::uint8_t, 3> state, In<double, 2> origins, In<double, 2> ends, std::uint8_t value,
                   Out<double, 1> reached) {
    nb::gil_scoped_release release;
    const Shape n(state);
    for (std::size_t i = 0; i < origins.shape(0); ++i) {
        const Point start = point_of(origins, i), end = point_of(ends, i);
        const Index last[3] = {voxel_of(end[0]), voxel_of(end[1]), voxel_of(end[2])};
        double& met = reached.data()[i] = std::numeric_limits<double>::infinity();
        walk(start, end, n.size, [&](Index x, Index y, Index z) {
            if (x == last[0] && y == last[1] && z == last[2]) return false;
            std::uint8_t& voxel = state.data()[(x * n[1] + y) * n[2] + z];
            if (voxel == OCCUPIED) {
                met = std::hypot(x + 0.5 - start[0], y + 0.5 - start[1], z + 0.5 - start[2]);
                return false;
            }
            voxel = value;
            return true;
        });
    }
}

// Whether nothing occupied lies between the eye and each target (the target's own voxel may be).
void line_of_sight(In<std::uint8_t, 3> state, nb::tuple eye, In<double, 2> targets, Out<bool, 1> visible) {
    const Point start = {nb::cast<double>(eye[0]), nb::cast<double>(eye[1]), nb::cast<double>(eye[2])};
    nb::gil_scoped_release release;
    const Shape n(state);
    for (std::size_t i = 0; i < targets.shape(0); ++i) {
        const Point end = point_of(targets, i);
        const Index last[3] = {voxel_of(end[0]), voxel_of(end[1]), voxel_of(end[2])};
        bool clear = true;
        walk(start, end, n.size, [&](Index x, Index y, Index z) {
            if (x == last[0] && y == last[1] && z == last[2]) return false;
            return clear = state.data()[(x * n[1] + y) * n[2] + z] != OCCUPIED;
        });
        visible.data()[i] = clear;
    }
}

// Every voxel a triangle touches gets `value`.
void mark_triangles(Out<std::uint8_t, 3> state, In<double, 2> vertices, In<std::int64_t, 2> faces, std::uint8_t value) {
    nb::gil_scoped_release release;
    constexpr double half = 0.5 + 1e-9;  // touching counts however it is rounded
    const Shape n(state);
    for (std::size_t f = 0; f < faces.shape(0); ++f) {
        Point corner[3];
        for (int c = 0; c < 3; ++c) corner[c] = point_of(vertices, static_cast<std::size_t>(faces.data()[3 * f + c]));
        Index lo[3], hi[3];
        for (int a = 0; a < 3; ++a) {
            lo[a] = std::max<Index>(voxel_of(std::min({corner[0][a], corner[1][a], corner[2][a]}) - 1e-9), 0);
            hi[a] = std::min<Index>(voxel_of(std::max({corner[0][a], corner[1][a], corner[2][a]}) + 1e-9), n[a] - 1);
        }
        for (Index x = lo[0]; x <= hi[0]; ++x)
            for (Index y = lo[1]; y <= hi[1]; ++y)
                for (Index z = lo[2]; z <= hi[2]; ++z)
                    if (touches(corner, {x + 0.5, y + 0.5, z + 0.5}, half))
                        state.data()[(x * n[1] + y) * n[2] + z] = value;
    }
}

}  // namespace

NB_MODULE(_esdf, m) {
    m.def("transform_int16", &transform<std::int16_t>);
    m.def("transform_int32", &transform<std::int32_t>);
    m.def("transform_float", &transform<float>);
    m.def("query_dense", &query_dense, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(),
          nb::arg());
    m.def("query_bricks", &query_bricks, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
          nb::arg().none(), nb::arg());
    m.def("cut_distance_bricks", &cut_bricks<float>);
    m.def("cut_state_bricks", &cut_bricks<std::uint8_t>);
    m.def("carve", &carve);
    m.def("carve_visible", &carve_visible);
    m.def("line_of_sight", &line_of_sight);
    m.def("mark_triangles", &mark_triangles);
    m.def("instruction_sets", [] {
        nb::list names;
        names.append("portable");
        if (best_isa() >= Isa::avx2) names.append("avx2");
        if (best_isa() >= Isa::avx512) names.append("avx512");
        return names;
    });
}
