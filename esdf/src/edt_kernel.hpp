// Exact separable squared distance transform, signed and capped. Included by edt_*.cpp with GOSHAWK_ISA and
// VECTOR_BYTES set.
//
//   1. along z: distance to the nearest voxel of the other class on the same line, by runs
//   2. along y, 3. along x: out[i] = min over k of in[i +- k] + table[k], for a cache line of neighbouring z at once;
//      the search for one i stops at the first k whose table[k] alone is no improvement.
//
// Every value is the minimum over sites of one fixed sum (rounding is monotone), so it does not depend on the window,
// the tiling, the instruction set or the number of threads: a recomputed window is bit-equal to a full rebuild. The
// including file has included the standard headers, edt.hpp and parallel.hpp.

namespace goshawk {
namespace GOSHAWK_ISA {
namespace {

constexpr Index LINE_BYTES = 64;
constexpr Index TILE_LINES = 4;  // neighbouring cache lines fetched together, so that each page is visited less often

template <class T>
struct Lanes {
    typedef T Vector __attribute__((vector_size(VECTOR_BYTES)));
    static constexpr Index per_vector = VECTOR_BYTES / sizeof(T);
    static constexpr Index per_line = LINE_BYTES / sizeof(T);
};

template <class T>
inline typename Lanes<T>::Vector load(const T* p) {
    typename Lanes<T>::Vector v;
    std::memcpy(&v, p, sizeof v);
    return v;
}

template <class T>
inline void store(T* p, const typename Lanes<T>::Vector& v) {
    std::memcpy(p, &v, sizeof v);
}

template <class V>
inline V smaller(const V& a, const V& b) {
    return a < b ? a : b;
}

template <class Mask>
inline bool any(const Mask& mask) {
    std::uint64_t words[VECTOR_BYTES / 8], all = 0;
    std::memcpy(words, &mask, sizeof mask);
    for (std::uint64_t w : words) all |= w;
    return all != 0;
}

template <class T>
struct Window {  // the voxels that can affect the requested box
    Index lo[3], hi[3];
    explicit Window(const Request<T>& r) {
        for (int a = 0; a < 3; ++a) {
            const Index halo = r.reach[a] - 1;
            lo[a] = r.lo[a] > halo ? r.lo[a] - halo : 0;
            hi[a] = r.hi[a] < r.n[a] - halo ? r.hi[a] + halo : r.n[a];
        }
    }
    Index size(int a) const { return hi[a] - lo[a]; }
    bool solid_before(const Request<T>& r, int a) const { return lo[a] == 0 && r.face_is_solid[a][0]; }
    bool solid_after(const Request<T>& r, int a) const { return hi[a] == r.n[a] && r.face_is_solid[a][1]; }
};

// One run [a, b) of voxels of one class, `other[0/1]`: whether a voxel of the other class ends it before/after.
template <class T>
void fill_run(T* out, Index a, Index b, const T* table, T sign, T cap, bool before, bool after) {
    const Index middle = before && after ? a + (b - a + 1) / 2 : before ? b : a;
    const T nothing = static_cast<T>(sign * cap);
    if (!before && !after) {
        for (Index z = a; z < b; ++z) out[z] = nothing;
        return;
    }
    for (Index z = a; z < middle; ++z) out[z] = static_cast<T>(sign * table[z - a + 1]);
    for (Index z = middle; z < b; ++z) out[z] = static_cast<T>(sign * table[b - z]);
}

inline Index run_end(const std::uint8_t* solid, Index from, Index n) {
    const std::uint8_t kind = solid[from];
    const std::uint64_t eight = 0x0101010101010101ull * kind;
    Index i = from + 1;
    for (std::uint64_t word; i + 8 <= n; i += 8) {
        std::memcpy(&word, solid + i, 8);
        if (word != eight) break;
    }
    while (i < n && solid[i] == kind) ++i;
    return i;
}

// Step 1 on one line; `solid` is 1 for solid voxels.
template <class T>
void scan_line(const std::uint8_t* solid, Index n, const T* table, T cap, bool solid_before, bool solid_after, T* out) {
    for (Index a = 0; a < n;) {
        const Index b = run_end(solid, a, n);
        const bool free = !solid[a];
        fill_run<T>(out, a, b, table, free ? T(1) : T(-1), cap, a > 0 || (free && solid_before),
                    b < n || (free && solid_after));
        a = b;
    }
}

// A column of cache lines, one per row: the unsigned distances of one sign, and how many rows hold any news.
template <class T>
struct Column {
    std::vector<T> value;   // (rows, per_line)
    std::vector<int> news;  // news[i]: rows before i with a value below cap
    bool needed = false;    // some value is above zero, so there is something to minimise
    explicit Column(Index rows) : value(rows * Lanes<T>::per_line), news(rows + 1) {}
};

template <class T>
void split_signs(const T* in, Index rows, T cap, Column<T>& free, Column<T>& solid) {
    using V = typename Lanes<T>::Vector;
    const V zero{};
    bool any_free = false, any_solid = false;
    for (Index i = 0; i < rows; ++i) {
        bool news_free = false, news_solid = false;
        for (Index j = 0; j < Lanes<T>::per_line; j += Lanes<T>::per_vector) {
            const Index at = i * Lanes<T>::per_line + j;
            const V v = load(in + at), f = v > zero ? v : zero, s = v < zero ? -v : zero;
            store(&free.value[at], f);
            store(&solid.value[at], s);
            news_free |= any(v < cap);
            news_solid |= any(v > static_cast<T>(-cap));
            any_free |= any(v > zero);
            any_solid |= any(v < zero);
        }
        free.news[i + 1] = free.news[i] + news_free;
        solid.news[i + 1] = solid.news[i] + news_solid;
    }
    free.needed = any_free;
    solid.needed = any_solid;
}

template <class T>
struct Pass {  // how steps 2 and 3 combine rows; rows [first, last) are computed
    Index rows, first, last, reach;
    const T* table;
    T cap;
    bool solid_before, solid_after;
};

// Steps 2 and 3 on row i, lanes from j: the minimum over k. `faces` is where the outside is of the other class.
template <class T>
inline typename Lanes<T>::Vector min_plus(const T* value, Index i, const Pass<T>& p, bool faces) {
    using V = typename Lanes<T>::Vector;
    constexpr Index L = Lanes<T>::per_line;
    const T* here = value + i * L;
    V best = load(here);
    const Index before = i, after = p.rows - 1 - i, both = before < after ? before : after;
    if (faces && p.solid_before) best = smaller(best, V{} + p.table[before + 1]);
    if (faces && p.solid_after) best = smaller(best, V{} + p.table[after + 1]);
    Index k = 1;
    const Index end_both = both < p.reach - 1 ? both : p.reach - 1;
    for (; k <= end_both; ++k) {
        if ((k < 4 || k % 4 == 0) && !any(best > V{} + p.table[k])) return best;
        best = smaller(best, smaller(load(here - k * L), load(here + k * L)) + p.table[k]);
    }
    const T* side = before > after ? here - k * L : here + k * L;
    const Index step = before > after ? -L : L;
    const Index end = (before > after ? before : after) < p.reach - 1 ? (before > after ? before : after) : p.reach - 1;
    for (; k <= end; ++k, side += step) {
        if (k % 4 == 0 && !any(best > V{} + p.table[k])) return best;
        best = smaller(best, load(side) + p.table[k]);
    }
    return best;
}

template <class T>
inline bool has_news(const Column<T>& c, const Pass<T>& p, Index i, bool faces) {
    if (faces && ((p.solid_before && i + 1 < p.reach) || (p.solid_after && p.rows - i < p.reach))) return true;
    const Index from = i < p.reach ? 0 : i - p.reach + 1, to = i + p.reach < p.rows ? i + p.reach : p.rows;
    return c.news[to] > c.news[from];
}

// Both signs of one column; writes (last - first, per_line) signed values to `out`.
template <class T>
void combine(const Column<T>& free, const Column<T>& solid, const Pass<T>& p, T* out) {
    using V = typename Lanes<T>::Vector;
    constexpr Index L = Lanes<T>::per_line;
    for (Index i = p.first; i < p.last; ++i) {
        const bool search_free = free.needed && has_news(free, p, i, true);
        const bool search_solid = solid.needed && has_news(solid, p, i, false);
        for (Index j = 0; j < L; j += Lanes<T>::per_vector) {
            const V f = search_free ? min_plus<T>(free.value.data() + j, i, p, true) : load(&free.value[i * L + j]);
            const V s = search_solid ? min_plus<T>(solid.value.data() + j, i, p, false) : load(&solid.value[i * L + j]);
            store(out + (i - p.first) * L + j, V(f - s));
        }
    }
}

// All columns of a (rows, width) sheet of signed values; `emit(row, lane, count, values)` takes the results.
template <class T>
struct Sheet {
    Column<T> free, solid;
    std::vector<T> gathered, result;
    Sheet(Index rows, Index wanted)
        : free(rows),
          solid(rows),
          gathered(rows * Lanes<T>::per_line * TILE_LINES),
          result(wanted * Lanes<T>::per_line) {}

    template <class Emit>
    void run(const T* in, Index stride, Index width, const Pass<T>& p, const Emit& emit) {
        constexpr Index L = Lanes<T>::per_line;
        for (Index tile = 0; tile < width; tile += L * TILE_LINES) {
            const Index lines = std::min(TILE_LINES, (width - tile + L - 1) / L);
            gather(in + tile, stride, p.rows, std::min(L * TILE_LINES, width - tile), lines);
            for (Index line = 0; line < lines; ++line) {
                split_signs(&gathered[line * p.rows * L], p.rows, p.cap, free, solid);
                combine(free, solid, p, result.data());
                const Index z = tile + line * L, count = std::min(L, width - z);
                for (Index i = p.first; i < p.last; ++i) emit(i - p.first, z, count, &result[(i - p.first) * L]);
            }
        }
    }

    void gather(const T* in, Index stride, Index rows, Index width, Index lines) {
        constexpr Index L = Lanes<T>::per_line;
        for (Index i = 0; i < rows; ++i)
            for (Index line = 0; line < lines; ++line) {
                T* to = &gathered[(line * rows + i) * L];
                const T* from = in + i * stride + line * L;
                const Index count = std::min(L, width - line * L);
                if (count == L) {
                    std::memcpy(to, from, LINE_BYTES);
                } else {  // spare lanes repeat the last voxel, so that they never prolong a search
                    for (Index j = 0; j < L; ++j) to[j] = from[std::min(j, count - 1)];
                }
            }
    }
};

template <class T>
Pass<T> make_pass(const Request<T>& r, const Window<T>& w, int axis) {
    return {w.size(axis), r.lo[axis] - w.lo[axis], r.hi[axis] - w.lo[axis], r.reach[axis], r.table[axis],
            r.cap,        w.solid_before(r, axis), w.solid_after(r, axis)};
}

// Steps 1 and 2 for one x, while its plane is in cache.
template <class T>
struct PlaneWorker {
    const Request<T>& r;
    const Window<T>& w;
    Pass<T> pass;
    std::vector<std::uint8_t> solid;
    std::vector<T> line, plane;
    Sheet<T> sheet;
    PlaneWorker(const Request<T>& request, const Window<T>& window)
        : r(request),
          w(window),
          pass(make_pass(request, window, 1)),
          solid(window.size(2)),
          line(window.size(2)),
          plane(window.size(1) * (request.hi[2] - request.lo[2])),
          sheet(window.size(1), request.hi[1] - request.lo[1]) {}

    void operator()(Index item) {
        const Index width = r.hi[2] - r.lo[2], depth = w.size(2);
        for (Index y = 0; y < w.size(1); ++y) {
            const std::uint8_t* state = r.state + ((w.lo[0] + item) * r.n[1] + w.lo[1] + y) * r.n[2] + w.lo[2];
            if (r.unknown_is_solid)
                for (Index z = 0; z < depth; ++z) solid[z] = state[z] != FREE;
            else
                for (Index z = 0; z < depth; ++z) solid[z] = state[z] == OCCUPIED;
            scan_line<T>(solid.data(), depth, r.table[2], r.cap, w.solid_before(r, 2), w.solid_after(r, 2),
                         line.data());
            std::memcpy(&plane[y * width], &line[r.lo[2] - w.lo[2]], width * sizeof(T));
        }
        T* out = r.scratch + item * (r.hi[1] - r.lo[1]) * width;
        sheet.run(plane.data(), width, width, pass, [&](Index y, Index z, Index count, const T* values) {
            std::memcpy(out + y * width + z, values, count * sizeof(T));
        });
    }
};

inline float root(float v) { return std::sqrt(v); }
inline float root(std::int16_t v) { return std::sqrt(static_cast<float>(v)); }
inline float root(std::int32_t v) { return static_cast<float>(std::sqrt(static_cast<double>(v))); }

template <class T>
void to_metres(const Request<T>& r, const T* values, const std::uint8_t* state, Index count, float* out) {
    for (Index j = 0; j < count; ++j) {
        const T v = values[j], size = v < T(0) ? T(-v) : v;
        const float exact = root(size) * r.scale;
        const float capped = size < r.cap && exact < r.cap_m ? exact : r.cap_m;
        out[j] = v < T(0) ? -capped : capped;
    }
    if (r.unknown_is_nan)
        for (Index j = 0; j < count; ++j) out[j] = state[j] == UNKNOWN ? __builtin_nanf("") : out[j];
}

// Step 3 for one y, and the conversion to metres.
template <class T>
struct SliceWorker {
    const Request<T>& r;
    Pass<T> pass;
    Sheet<T> sheet;
    SliceWorker(const Request<T>& request, const Window<T>& window)
        : r(request), pass(make_pass(request, window, 0)), sheet(window.size(0), request.hi[0] - request.lo[0]) {}

    void operator()(Index item) {
        const Index width = r.hi[2] - r.lo[2], stride = (r.hi[1] - r.lo[1]) * width;
        sheet.run(r.scratch + item * width, stride, width, pass, [&](Index x, Index z, Index count, const T* values) {
            const std::uint8_t* state = r.state + ((r.lo[0] + x) * r.n[1] + r.lo[1] + item) * r.n[2] + r.lo[2] + z;
            to_metres(r, values, state, count, r.out + x * r.out_stride[0] + item * r.out_stride[1] + z);
        });
    }
};

template <class T>
void run(const Request<T>& r) {
    const Window<T> window(r);
    parallel(window.size(0), r.threads, [&] { return PlaneWorker<T>(r, window); });
    parallel(r.hi[1] - r.lo[1], r.threads, [&] { return SliceWorker<T>(r, window); });
}

}  // namespace

void transform(const Request<std::int16_t>& r) { run(r); }
void transform(const Request<std::int32_t>& r) { run(r); }
void transform(const Request<float>& r) { run(r); }

}  // namespace GOSHAWK_ISA
}  // namespace goshawk
