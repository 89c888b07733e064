// Trilinear value and gradient of a field, point by point. Included by query_*.cpp with GOSHAWK_ISA set, after
// query.hpp.

namespace goshawk {
namespace GOSHAWK_ISA {
namespace {

typedef double Doubles __attribute__((vector_size(32)));  // x, y, z and one to spare
typedef float Floats __attribute__((vector_size(16)));
typedef std::int64_t Longs __attribute__((vector_size(32)));
typedef std::int32_t Ints __attribute__((vector_size(16)));

// A point on the outer face stays inside however the division rounds.
constexpr double ROUNDING = 1e-9;

struct Frame {  // a lattice, ready for arithmetic on all axes at once
    Doubles origin, per_voxel, end, last;
    Floats slope;
    Ints last_cell;
    explicit Frame(const Lattice& l)
        : origin{l.origin[0], l.origin[1], l.origin[2], 0.0},
          per_voxel{l.per_voxel[0], l.per_voxel[1], l.per_voxel[2], 0.0},
          end{l.n[0] + ROUNDING, l.n[1] + ROUNDING, l.n[2] + ROUNDING, 1.0},
          last{l.n[0] - 1.0, l.n[1] - 1.0, l.n[2] - 1.0, 0.0},
          slope{float(l.per_voxel[0]), float(l.per_voxel[1]), float(l.per_voxel[2]), 0.0f},
          last_cell{cell(l.n[0]), cell(l.n[1]), cell(l.n[2]), 0} {}
    static std::int32_t cell(std::ptrdiff_t n) { return static_cast<std::int32_t>(n > 1 ? n - 2 : 0); }
};

struct Cell {  // the eight voxel centres round a point
    std::int32_t index[4];
    Floats t;      // where in the cell, 0 to 1
    Floats slope;  // cells per metre; 0 in the outer half voxel, where the field is continued as constant
};

// False if the point is outside the lattice's voxels (or not a number).
inline bool locate(const Frame& f, const double* point, Cell& cell) {
    const Doubles p = {point[0], point[1], point[2], 0.0};
    const Doubles u = (p - f.origin) * f.per_voxel;
    const Longs inside = (u >= -ROUNDING) & (u <= f.end);
    if (!(inside[0] & inside[1] & inside[2])) return false;
    const Doubles zero{}, v = u - 0.5, w = v > zero ? v : zero, c = w < f.last ? w : f.last;
    Ints i = __builtin_convertvector(c, Ints);
    i = i < f.last_cell ? i : f.last_cell;
    std::memcpy(cell.index, &i, sizeof i);
    cell.t = __builtin_convertvector(c - __builtin_convertvector(i, Doubles), Floats);
    cell.slope = __builtin_convertvector(c == v, Ints) != Ints{} ? f.slope : Floats{};
    return true;
}

// a[0], a[1], b[0], b[1]: each pair moves as one double, which the compiler keeps out of memory.
inline Floats two_pairs(const float* a, const float* b) {
    typedef double Pairs __attribute__((vector_size(16)));
    double first, second;
    std::memcpy(&first, a, 8);
    std::memcpy(&second, b, 8);
    return reinterpret_cast<Floats>(Pairs{first, second});
}

#if defined(__clang__)
#define GOSHAWK_SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#define GOSHAWK_SHUFFLE(a, b, i, j, k, l) __builtin_shuffle(a, b, Ints{i, j, k, l})
#endif

// corner: the cell's first value; step: how far it is to the next along each axis (0 where the lattice is one voxel
// thick). One axis after the other, z first; slopes ride along in the spare lanes. Returns the value.
template <bool WANT_GRADIENT>
inline double interpolate(const float* corner, const std::ptrdiff_t* step, const Cell& cell, double* gradient) {
    const float* c[4] = {corner, corner + step[1], corner + step[0], corner + step[0] + step[1]};
    Floats low, high;  // lanes: (x, y) = 00, 01, 10, 11
    if (step[2]) {
        const Floats first = two_pairs(c[0], c[1]), second = two_pairs(c[2], c[3]);
        low = GOSHAWK_SHUFFLE(first, second, 0, 2, 4, 6);
        high = GOSHAWK_SHUFFLE(first, second, 1, 3, 5, 7);
    } else {
        low = high = Floats{*c[0], *c[1], *c[2], *c[3]};
    }
    const Floats dz = high - low, e = low + cell.t[2] * dz;
    const Floats y0 = GOSHAWK_SHUFFLE(e, dz, 0, 2, 4, 6), y1 = GOSHAWK_SHUFFLE(e, dz, 1, 3, 5, 7);
    const Floats dy = y1 - y0, f = y0 + cell.t[1] * dy;  // f: value at x = 0, 1; dz at x = 0, 1
    const Floats x0 = GOSHAWK_SHUFFLE(f, dy, 0, 4, 2, 3), x1 = GOSHAWK_SHUFFLE(f, dy, 1, 5, 3, 3);  // value, dy, dz
    const Floats dx = x1 - x0, g = x0 + cell.t[0] * dx;
    if constexpr (WANT_GRADIENT) {
        const Floats slopes = Floats{dx[0], g[1], g[2], 0.0f} * cell.slope;
        for (int a = 0; a < 3; ++a) gradient[a] = slopes[a];
    }
    return g[0];
}

// All points. They are located in batches and fetched ahead, so that the memory answers many at a time.
template <bool WANT_GRADIENT, class Store>
void answer(const Store& store, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
            double* gradient) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    constexpr std::ptrdiff_t BATCH = 32;
    const Frame frame(lattice);
    Cell cells[BATCH];
    const float* corners[BATCH];
    for (std::ptrdiff_t from = 0; from < count; from += BATCH) {
        const std::ptrdiff_t here = count - from < BATCH ? count - from : BATCH;
        for (std::ptrdiff_t j = 0; j < here; ++j) {
            if (!locate(frame, points + 3 * (from + j), cells[j])) {
                corners[j] = nullptr;
                continue;
            }
            const float* c = corners[j] = store.corner(cells[j].index);
            __builtin_prefetch(c);
            __builtin_prefetch(c + store.step[1]);
            __builtin_prefetch(c + store.step[0]);
            __builtin_prefetch(c + store.step[0] + store.step[1]);
        }
        for (std::ptrdiff_t j = 0; j < here; ++j) {
            double* g = WANT_GRADIENT ? gradient + 3 * (from + j) : nullptr;
            if (corners[j]) {
                distance[from + j] = interpolate<WANT_GRADIENT>(corners[j], store.step, cells[j], g);
            } else {
                distance[from + j] = nan;
                if (WANT_GRADIENT) g[0] = g[1] = g[2] = nan;
            }
        }
    }
}

template <class Store>
void either(const Store& store, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
            double* gradient) {
    if (gradient)
        answer<true>(store, lattice, points, count, distance, gradient);
    else
        answer<false>(store, lattice, points, count, distance, nullptr);
}

}  // namespace

void query(const Dense& store, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
           double* gradient) {
    either(store, lattice, points, count, distance, gradient);
}
void query(const Bricks& store, const Lattice& lattice, const double* points, std::ptrdiff_t count, double* distance,
           double* gradient) {
    either(store, lattice, points, count, distance, gradient);
}

}  // namespace GOSHAWK_ISA
}  // namespace goshawk
