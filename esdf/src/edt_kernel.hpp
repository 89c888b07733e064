// Exact separable squared distance transform, signed and capped. Included by edt_*.cpp with GOSHAWK_ISA and
// VECTOR_BYTES set.
//
//   1. along z: distance to the nearest voxel of the other class on the same line, by runs
//   2. along y, 3. along x: out[i] = min over k of in[i +- k] + table[k], for a vector of neighbouring z at once
//
// Every value is the minimum over sites of one fixed sum (rounding is monotone), so it does not depend on the window,
// the tiling, the instruction set or the number of threads: a recomputed window is bit-equal to a full rebuild. The
// including file has included the standard headers, edt.hpp and parallel.hpp.

namespace goshawk {
namespace GOSHAWK_ISA {
namespace {

template <class T>
struct Lanes {
    typedef T Vector __attribute__((vector_size(VECTOR_BYTES)));
    static constexpr Index count = VECTOR_BYTES / sizeof(T);
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
#if VECTOR_BYTES == 64
    const __m512i bits = reinterpret_cast<__m512i>(mask);
    return _mm512_test_epi64_mask(bits, bits) != 0;
#elif VECTOR_BYTES == 32
    const __m256i bits = reinterpret_cast<__m256i>(mask);
    return !_mm256_testz_si256(bits, bits);
#else
    std::uint64_t words[2];
    std::memcpy(words, &mask, sizeof mask);
    return (words[0] | words[1]) != 0;
#endif
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

// 1 for solid voxels, 0 for free ones.
inline void mark_solid(const std::uint8_t* state, Index n, bool unknown_is_solid, std::uint8_t* solid) {
    if (unknown_is_solid)
        for (Index z = 0; z < n; ++z) solid[z] = state[z] != FREE;
    else
        for (Index z = 0; z < n; ++z) solid[z] = state[z] == OCCUPIED;
}

// Whether all of a line is one state.
inline bool is_uniform(const std::uint8_t* state, Index n) {
    using V = Lanes<std::uint8_t>::Vector;
    const V first = V{} + state[0];
    if (n < VECTOR_BYTES) return false;
    for (Index z = 0; z + VECTOR_BYTES < n; z += VECTOR_BYTES)
        if (any(load(state + z) != first)) return false;
    return !any(load(state + n - VECTOR_BYTES) != first);
}

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
    using V = Lanes<std::uint8_t>::Vector;
    const std::uint8_t kind = solid[from];
    Index i = from + 1;
    while (i + VECTOR_BYTES <= n && !any(load(solid + i) != V{} + kind)) i += VECTOR_BYTES;
    const std::uint64_t eight = 0x0101010101010101ull * kind;
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

template <class T>
struct Pass {  // how steps 2 and 3 combine rows; rows [first, last) are computed
    Index rows, first, last, reach;
    const T* table;
    T cap;
    bool solid_before, solid_after;
};

// Sums below this are worth storing. In floating point a sum that is larger by rounding alone is, too: it says nothing
// about the sums farther on. None is at the cap.
template <class T, class V>
inline V improvable(const V& best, T) {
    return best;
}
template <class V>
inline V improvable(const V& best, float cap) {
    return smaller(V(best * 1.000001f), V{} + cap);
}

// Steps 2 and 3 on a sheet of signed values: rows along the axis, z within a row, Lanes::count of them at a time. The
// vectors of one z lie side by side. Spare lanes stay zero, which nothing improves.
template <class T>
class Sheet {
  public:
    using V = typename Lanes<T>::Vector;
    static constexpr Index L = Lanes<T>::count;
    Sheet(const Pass<T>& pass, Index width)
        : p(pass),
          width(width),
          blocks((width + L - 1) / L),
          stride(p.rows + 1),  // odd if rows is a power of two: a row's vectors do not all compete for one cache set
          sheet(stride * blocks),
          inside(p.rows),
          up(p.rows),
          down(p.rows) {}

    void put(Index i, const T* values) {
        each_block(i, values, [](T* lanes, const T* part, std::size_t bytes) { std::memcpy(lanes, part, bytes); });
    }

    void fill(Index i, T value) {
        for (Index block = 0; block < blocks; ++block)
            std::fill_n(sheet[block * stride + i].lane, std::min(L, width - block * L), value);
    }

    void get(Index i, T* values) {
        each_block(i, values, [](const T* lanes, T* part, std::size_t bytes) { std::memcpy(part, lanes, bytes); });
    }

    void run() {  // in place; only rows [first, last) are right afterwards
        for (Index block = 0; block < blocks; ++block) {
            Block* column = &sheet[block * stride];
            const Rows solid = split(column);
            minimise(column, {0, p.rows});
            offer_faces(column);
            if (solid.from < solid.to) {
                minimise(inside.data(), solid);
                join(column, solid);
            }
        }
    }

  private:
    struct alignas(VECTOR_BYTES) Block {
        T lane[L];
    };
    struct Rows {
        Index from, to;
    };
    Pass<T> p;
    Index width, blocks, stride;
    std::vector<Block> sheet, inside;  // inside: one column, zero but while that is computed
    std::vector<Index> up, down;       // the rows with something to offer

    template <class Values, class Copy>
    void each_block(Index i, Values* values, Copy copy) {
        const Index whole = width / L;
        for (Index block = 0; block < whole; ++block)
            copy(sheet[block * stride + i].lane, values + block * L, sizeof(Block));
        if (whole < blocks) copy(sheet[whole * stride + i].lane, values + whole * L, (width - whole * L) * sizeof(T));
    }

    // Moves the negative values' sizes from the column to `inside`, leaving zeros; returns their rows and one beyond on
    // either side: of the zeros there only the nearest count.
    Rows split(Block* column) {
        const V zero{};
        Rows solid{p.rows, 0};
        for (Index i = 0; i < p.rows; ++i) {
            const V v = load(column[i].lane);
            if (!any(v < zero)) continue;
            store(column[i].lane, v > zero ? v : zero);
            store(inside[i].lane, v < zero ? -v : zero);
            solid = {std::min(solid.from, i), i + 1};
        }
        if (solid.to == 0) return {0, 0};
        return {std::max<Index>(solid.from - 1, 0), std::min(solid.to + 1, p.rows)};
    }

    // Puts them back.
    void join(Block* column, Rows solid) {
        for (Index i = std::max(solid.from, p.first); i < std::min(solid.to, p.last); ++i) {
            const V depth = load(inside[i].lane);
            store(column[i].lane, depth > V{} ? -depth : load(column[i].lane));
        }
        std::fill(inside.begin() + solid.from, inside.begin() + solid.to, Block{});
    }

    // column[i] = min over j in `rows` of column[j] + table[|i - j|], by offering each row to all above it and then to
    // all below. The table is convex, so a row that loses to one between it and a target loses to it ever after: a row
    // that loses to its neighbour offers nothing, any other stops where it first loses, as the rows between have been
    // offered to the target before. In the second sweep a row may hold an offer of the first: passed on it never wins,
    // as the row it came from was offered there directly.
    void minimise(Block* column, Rows rows) {
        Index ups = 0, downs = 0;
        V before = load(column[rows.from].lane);
        for (Index i = rows.from + 1; i < rows.to; ++i) {
            const V here = load(column[i].lane);
            up[ups] = i - 1;
            ups += any(before + p.table[1] < improvable(here, p.cap));
            down[downs] = i;
            downs += any(here + p.table[1] < improvable(before, p.cap));
            before = here;
        }
        while (ups > 0) {
            const Index i = up[--ups];
            offer(column + i, 1, std::max<Index>(1, p.first - i), std::min(rows.to, p.last) - i);
        }
        for (Index n = 0; n < downs; ++n) {
            const Index i = down[n];
            offer(column + i, -1, std::max<Index>(1, i - p.last + 1), i - std::max(rows.from, p.first) + 1);
        }
    }

    // A row to the rows begin .. end - 1 steps away.
    void offer(Block* row, Index step, Index begin, Index end) {
        const V value = load(row->lane);
        for (Index k = begin; k < std::min(end, p.reach); ++k) {
            T* target = row[k * step].lane;
            const V best = load(target), sum = value + p.table[k];
            if (!any(sum < improvable(best, p.cap))) return;
            store(target, smaller(best, sum));
        }
    }

    // What is solid beyond the ends, to the rows it reaches.
    void offer_faces(Block* column) {
        if (p.solid_before)
            for (Index i = p.first; i < std::min(p.last, p.reach); ++i)
                store(column[i].lane, smaller(load(column[i].lane), V{} + p.table[i + 1]));
        if (p.solid_after)
            for (Index i = std::max(p.first, p.rows - p.reach); i < p.last; ++i)
                store(column[i].lane, smaller(load(column[i].lane), V{} + p.table[p.rows - i]));
    }
};

template <class T>
Pass<T> make_pass(const Request<T>& r, const Window<T>& w, int axis) {
    return {w.size(axis), r.lo[axis] - w.lo[axis], r.hi[axis] - w.lo[axis], r.reach[axis], r.table[axis],
            r.cap,        w.solid_before(r, axis), w.solid_after(r, axis)};
}

// Neighbouring lines of a window are far apart in memory: the processor does not guess the next one.
constexpr Index AHEAD = 6;  // lines

template <class T>
void prefetch(const T* line, Index count) {
    const char* bytes = reinterpret_cast<const char*>(line);
    for (Index b = 0; b < count * static_cast<Index>(sizeof(T)); b += 64) __builtin_prefetch(bytes + b);
}

// Steps 1 and 2 for one x, while its plane is in cache.
template <class T>
struct PlaneWorker {
    const Request<T>& r;
    const Window<T>& w;
    std::vector<std::uint8_t> solid;
    std::vector<T> line;
    Sheet<T> sheet;
    PlaneWorker(const Request<T>& request, const Window<T>& window)
        : r(request),
          w(window),
          solid(window.size(2)),
          line(window.size(2)),
          sheet(make_pass(request, window, 1), request.hi[2] - request.lo[2]) {}

    void operator()(Index x) {
        const Index depth = w.size(2);
        const bool beside_solid = w.solid_before(r, 2) || w.solid_after(r, 2);
        for (Index y = 0; y < w.size(1); ++y) {
            const std::uint8_t* state = r.state + ((w.lo[0] + x) * r.n[1] + w.lo[1] + y) * r.n[2] + w.lo[2];
            if (y + AHEAD < w.size(1)) prefetch(state + AHEAD * r.n[2], depth);
            const bool is_solid = r.unknown_is_solid ? state[0] != FREE : state[0] == OCCUPIED;
            if ((is_solid || !beside_solid) && is_uniform(state, depth)) {
                sheet.fill(y, is_solid ? T(-r.cap) : r.cap);
                continue;
            }
            mark_solid(state, depth, r.unknown_is_solid, solid.data());
            scan_line<T>(solid.data(), depth, r.table[2], r.cap, w.solid_before(r, 2), w.solid_after(r, 2),
                         line.data());
            sheet.put(y, &line[r.lo[2] - w.lo[2]]);
        }
        sheet.run();
        const Index rows = r.hi[1] - r.lo[1];
        for (Index y = 0; y < rows; ++y) {
            T* squares = r.scratch + x * r.scratch_stride[0] + y * r.scratch_stride[1];
            if (y + AHEAD < rows) prefetch(squares + AHEAD * r.scratch_stride[1], r.hi[2] - r.lo[2]);
            sheet.get(r.lo[1] - w.lo[1] + y, squares);
        }
    }
};

inline float root(float v) { return std::sqrt(v); }
inline float root(std::int16_t v) { return std::sqrt(static_cast<float>(v)); }
inline float root(std::int32_t v) { return static_cast<float>(std::sqrt(static_cast<double>(v))); }

template <class T>
void to_metres(const Request<T>& r, const T* values, const std::uint8_t* state, Index count, float* out) {
    const T cap = r.cap;  // copies, as `out` might overlap the request as far as the compiler knows
    const float scale = r.scale, cap_m = r.cap_m;
    const bool unknown_is_nan = r.unknown_is_nan;
    for (Index j = 0; j < count; ++j) {
        const T v = values[j], size = v < T(0) ? T(-v) : v;
        const float metres = root(size) * scale, nearer = metres < cap_m ? metres : cap_m;
        const float capped = size < cap ? nearer : cap_m, value = v < T(0) ? -capped : capped;
        out[j] = unknown_is_nan && state[j] == UNKNOWN ? __builtin_nanf("") : value;
    }
}

// Step 3 for one y, and the conversion to metres. `out` is written after all of the plane's scratch has been read.
template <class T>
struct SliceWorker {
    const Request<T>& r;
    const Window<T>& w;
    Sheet<T> sheet;
    std::vector<T> line;
    SliceWorker(const Request<T>& request, const Window<T>& window)
        : r(request),
          w(window),
          sheet(make_pass(request, window, 0), request.hi[2] - request.lo[2]),
          line(request.hi[2] - request.lo[2]) {}

    void operator()(Index y) {
        const Index rows = r.hi[0] - r.lo[0], width = r.hi[2] - r.lo[2];
        for (Index x = 0; x < w.size(0); ++x) {
            const T* squares = r.scratch + x * r.scratch_stride[0] + y * r.scratch_stride[1];
            if (x + AHEAD < w.size(0)) prefetch(squares + AHEAD * r.scratch_stride[0], width);
            sheet.put(x, squares);
        }
        sheet.run();
        for (Index x = 0; x < rows; ++x) {
            const std::uint8_t* state = r.state + ((r.lo[0] + x) * r.n[1] + r.lo[1] + y) * r.n[2] + r.lo[2];
            float* out = r.out + x * r.out_stride[0] + y * r.out_stride[1];
            if (x + AHEAD < rows) prefetch(out + AHEAD * r.out_stride[0], width);
            sheet.get(r.lo[0] - w.lo[0] + x, line.data());
            to_metres(r, line.data(), state, width, out);
        }
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
