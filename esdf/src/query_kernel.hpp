// Trilinear value and gradient of a field, LANES points at a time. Included by query_*.cpp with GOSHAWK_ISA and LANES
// set, after query.hpp. Every point goes through the same operations in the same order whatever LANES is, so answers
// are the same bits on every processor.

namespace goshawk {
namespace GOSHAWK_ISA {
namespace {

typedef double Doubles __attribute__((vector_size(8 * LANES)));
typedef std::int64_t Longs __attribute__((vector_size(8 * LANES)));
typedef float Floats __attribute__((vector_size(4 * LANES)));
typedef std::int32_t Ints __attribute__((vector_size(4 * LANES)));

// A point on the outer face stays inside however the division rounds.
constexpr double ROUNDING = 1e-9;
// Points located and fetched ahead while the batch before is answered, so that the memory answers many at a time.
constexpr std::ptrdiff_t BATCH = 32;

template <class Vector, class T>
inline __attribute__((always_inline)) Vector load(const T* from) {
    Vector v;
    std::memcpy(&v, from, sizeof v);
    return v;
}

template <class Vector, class T>
inline void store(T* to, const Vector& v) {
    std::memcpy(to, &v, sizeof v);
}

// One value from each lane's address: at(0), at(1), ...
template <class At>
inline __attribute__((always_inline)) Doubles gather(const At& at) {
#if LANES == 8
    return Doubles{at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7)};
#else
    return Doubles{at(0), at(1), at(2), at(3)};
#endif
}

// The cells of a batch of points: the eight voxel centres round each.
struct Cells {
    const float* corner[BATCH];  // the cell's first value
    std::int64_t inside[BATCH];  // all bits set if the point is in the lattice
    float t[3][BATCH];           // where in the cell, 0 to 1
    float slope[3][BATCH];       // cells per metre; 0 in the outer half voxel, where the field is continued as constant
    std::int32_t index[3][BATCH];
};

// Lanes [from, from + LANES) along one axis. A point outside (or not a number) is given the first cell, so that it can
// be worked on like the others, and is not `inside`.
inline void locate_axis(const Lattice& l, int axis, const double* points, std::ptrdiff_t from, Cells& cells,
                        Longs& inside) {
    const double n = static_cast<double>(l.n[axis]);
    const double* mine = points + 3 * from + axis;
    const Doubles p = gather([&](int lane) { return mine[3 * lane]; });
    const Doubles u = (p - l.origin[axis]) * l.per_voxel[axis];
    inside &= (u >= -ROUNDING) & (u <= n + ROUNDING);
    const Doubles zero{}, end = zero + (n - 1.0), v = u - 0.5, w = v > zero ? v : zero, c = w < end ? w : end;
    const Ints last = Ints{} + static_cast<std::int32_t>(l.n[axis] > 1 ? l.n[axis] - 2 : 0);
    const Ints cell = __builtin_convertvector(c, Ints), i = cell < last ? cell : last;
    const Doubles slope = c == v ? zero + l.per_voxel[axis] : zero;
    store(cells.index[axis] + from, i);
    store(cells.t[axis] + from, __builtin_convertvector(c - __builtin_convertvector(i, Doubles), Floats));
    store(cells.slope[axis] + from, __builtin_convertvector(slope, Floats));
}

// The first `count` points (a multiple of LANES); what they need is on its way from memory afterwards.
template <class Store>
void locate(const Store& store_of, const Lattice& lattice, const double* points, std::ptrdiff_t count, Cells& cells) {
    for (std::ptrdiff_t from = 0; from < count; from += LANES) {
        Longs inside = Longs{} - 1;
        for (int axis = 0; axis < 3; ++axis) locate_axis(lattice, axis, points, from, cells, inside);
        store(cells.inside + from, inside);
    }
    for (std::ptrdiff_t j = 0; j < count; ++j) {
        const float* c = store_of.corner(cells.index[0][j], cells.index[1][j], cells.index[2][j]);
        cells.corner[j] = c;
        const float* edges[] = {c, c + store_of.step[1], c + store_of.step[0], c + store_of.step[0] + store_of.step[1]};
        for (const float* edge : edges) {
            __builtin_prefetch(edge);
            __builtin_prefetch(edge + 1);  // one in 16 lies across two cache lines
        }
    }
}

struct Pair {  // the values at the lower and the upper end of an edge along z
    Floats low, high;
};

// The edges that begin `offset` after each corner. Each edge moves as one double, which the compiler keeps out of
// memory.
inline __attribute__((always_inline)) Pair edges(const float* const* corner, std::ptrdiff_t offset, bool flat) {
    if (flat) {
        const Doubles only = gather([&](int lane) { return static_cast<double>(corner[lane][offset]); });
        const Floats value = __builtin_convertvector(only, Floats);
        return {value, value};
    }
    const Doubles both = gather([&](int lane) {
        double pair;
        std::memcpy(&pair, corner[lane] + offset, sizeof pair);
        return pair;
    });
    const Longs bits = reinterpret_cast<Longs>(both);  // little-endian: the low half is the first float
    return {reinterpret_cast<Floats>(__builtin_convertvector(bits, Ints)),
            reinterpret_cast<Floats>(__builtin_convertvector(bits >> 32, Ints))};
}

inline __attribute__((always_inline)) Floats between(const Floats& low, const Floats& high, const Floats& t) {
    return low + t * (high - low);
}

// The answers to located points; `count` is a multiple of LANES.
template <bool WANT_GRADIENT, class Store>
void interpolate(const Store& store_of, const Cells& cells, std::ptrdiff_t count, double* distance, double* gradient) {
    const std::ptrdiff_t* step = store_of.step;
    const Doubles nan = Doubles{} + std::numeric_limits<double>::quiet_NaN();
    for (std::ptrdiff_t from = 0; from < count; from += LANES) {
        const float* const* corner = cells.corner + from;
        const Floats tx = load<Floats>(cells.t[0] + from), ty = load<Floats>(cells.t[1] + from),
                     tz = load<Floats>(cells.t[2] + from);
        const Longs inside = load<Longs>(cells.inside + from);
        Floats f[2], dy[2], dz[2];  // at x = 0, 1: value and slopes
        for (int x = 0; x < 2; ++x) {
            const Pair a = edges(corner, x * step[0], !step[2]), b = edges(corner, x * step[0] + step[1], !step[2]);
            const Floats e0 = between(a.low, a.high, tz), e1 = between(b.low, b.high, tz);
            dy[x] = e1 - e0;
            dz[x] = between(a.high - a.low, b.high - b.low, ty);
            f[x] = e0 + ty * dy[x];
        }
        const Floats dx = f[1] - f[0], value = f[0] + tx * dx;
        store(distance + from, inside ? __builtin_convertvector(value, Doubles) : nan);
        if constexpr (WANT_GRADIENT) {
            const Floats slopes[3] = {dx, between(dy[0], dy[1], tx), between(dz[0], dz[1], tx)};
            for (int axis = 0; axis < 3; ++axis) {
                const Floats scaled = slopes[axis] * load<Floats>(cells.slope[axis] + from);
                const Doubles along = inside ? __builtin_convertvector(scaled, Doubles) : nan;
                for (int lane = 0; lane < LANES; ++lane) gradient[3 * (from + lane) + axis] = along[lane];
            }
        }
    }
}

// What is left over after the last whole batch, padded with copies of the last point.
template <bool WANT_GRADIENT, class Store>
void answer_rest(const Store& store_of, const Lattice& lattice, const double* points, std::ptrdiff_t count,
                 double* distance, double* gradient) {
    const std::ptrdiff_t padded = (count + LANES - 1) / LANES * LANES;
    double p[3 * BATCH] = {}, d[BATCH], g[3 * BATCH];
    for (std::ptrdiff_t j = 0; j < padded; ++j)
        std::memcpy(p + 3 * j, points + 3 * (j < count ? j : count - 1), 3 * sizeof *p);
    Cells cells;
    locate(store_of, lattice, p, padded, cells);
    interpolate<WANT_GRADIENT>(store_of, cells, padded, d, g);
    std::memcpy(distance, d, count * sizeof *d);
    if (WANT_GRADIENT) std::memcpy(gradient, g, 3 * count * sizeof *g);
}

template <bool WANT_GRADIENT, class Store>
void answer(const Store& store_of, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
            double* gradient) {
    const std::ptrdiff_t whole = count / BATCH;
    Cells cells[2];
    if (whole) locate(store_of, lattice, points, BATCH, cells[0]);
    for (std::ptrdiff_t i = 0; i < whole; ++i) {
        if (i + 1 < whole) locate(store_of, lattice, points + 3 * (i + 1) * BATCH, BATCH, cells[(i + 1) % 2]);
        interpolate<WANT_GRADIENT>(store_of, cells[i % 2], BATCH, distance + i * BATCH,
                                   WANT_GRADIENT ? gradient + 3 * i * BATCH : nullptr);
    }
    const std::ptrdiff_t done = whole * BATCH;
    if (done < count)
        answer_rest<WANT_GRADIENT>(store_of, lattice, points + 3 * done, count - done, distance + done,
                                   WANT_GRADIENT ? gradient + 3 * done : nullptr);
}

template <class Store>
void either(const Store& store_of, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
            double* gradient) {
    if (gradient)
        answer<true>(store_of, lattice, points, count, distance, gradient);
    else
        answer<false>(store_of, lattice, points, count, distance, nullptr);
}

}  // namespace

void query(const Dense& values, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
           double* gradient) {
    either(values, lattice, points, count, distance, gradient);
}
void query(const Bricks& values, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
           double* gradient) {
    either(values, lattice, points, count, distance, gradient);
}

}  // namespace GOSHAWK_ISA
}  // namespace goshawk
