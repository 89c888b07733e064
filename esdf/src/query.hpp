// The lattices that a query reads. The kernel itself is in query_kernel.hpp, compiled once per instruction set.
#pragma once
#include <cstddef>
#include <cstdint>

namespace goshawk {

struct Lattice {  // where voxel centres are: world = origin + (index + 0.5) * voxel
    double origin[3], per_voxel[3];
    std::ptrdiff_t n[3];
};

// Values in one C-ordered array.
struct Dense {
    const float* values;
    std::ptrdiff_t step[3];
    Dense(const float* v, const std::ptrdiff_t* n)
        : values(v), step{n[0] > 1 ? n[1] * n[2] : 0, n[1] > 1 ? n[2] : 0, n[2] > 1 ? 1 : 0} {}
    const float* corner(std::int32_t x, std::int32_t y, std::int32_t z) const {
        return values + x * step[0] + y * step[1] + z * step[2];
    }
};

// Values in bricks of BRICK^3 voxels, each stored with one more layer on its upper sides, so that no cell spans two.
constexpr std::uint32_t BRICK = 16, STORED = BRICK + 1;
struct Bricks {
    const std::uint64_t* address;  // of each brick's first value; bricks of one value everywhere share one
    std::ptrdiff_t count[3], step[3];
    Bricks(const std::uint64_t* table, const std::ptrdiff_t* bricks, const std::ptrdiff_t* n)
        : address(table),
          count{bricks[0], bricks[1], bricks[2]},
          step{n[0] > 1 ? STORED * STORED : 0, n[1] > 1 ? STORED : 0, n[2] > 1 ? 1 : 0} {}
    const float* corner(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
        const std::ptrdiff_t brick = (std::ptrdiff_t(x / BRICK) * count[1] + y / BRICK) * count[2] + z / BRICK;
        const std::ptrdiff_t within = x % BRICK * step[0] + y % BRICK * step[1] + z % BRICK * step[2];
        return reinterpret_cast<const float*>(address[brick]) + within;
    }
};

#define GOSHAWK_DECLARE_QUERY(isa)                                                                          \
    namespace isa { /* gradient may be null */                                                              \
    void query(const Dense&, const Lattice&, const double* points, std::ptrdiff_t count, double* distance,  \
               double* gradient);                                                                           \
    void query(const Bricks&, const Lattice&, const double* points, std::ptrdiff_t count, double* distance, \
               double* gradient);                                                                           \
    }
GOSHAWK_DECLARE_QUERY(portable)
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
GOSHAWK_DECLARE_QUERY(avx2)
GOSHAWK_DECLARE_QUERY(avx512)
#endif

}  // namespace goshawk
