// Arguments of the distance transform. The kernel itself is in edt_kernel.hpp, compiled once per instruction
// set.
#pragma once
#include <cstddef>
#include <cstdint>

namespace goshawk {

using Index = std::ptrdiff_t;

constexpr std::uint8_t UNKNOWN = 0;
constexpr std::uint8_t FREE = 1;
constexpr std::uint8_t OCCUPIED = 2;

// Distances are squared and in units of T until the last step. T is a small integer for cubic voxels (exact), float
// otherwise. "Signed" means: positive in free voxels (to the nearest solid one), negative in solid voxels (to the
// nearest free one).
template <class T>
struct Request {
    const std::uint8_t* state;  // (n[0], n[1], n[2]), C order
    Index n[3];
    Index lo[3], hi[3];  // the box of voxels to compute
    const T* table[3];  // table[a][k]: squared separation along axis a of voxels k apart, k = 0 .. n[a]; clipped at cap
    Index reach[3];     // first k at which table[a][k] has reached cap (or n[a] + 1)
    T cap;              // "nothing near"
    bool unknown_is_solid;  // otherwise unknown voxels are transparent
    bool unknown_is_nan;
    bool face_is_solid[3][2];  // whether everything beyond that face of the array is solid; otherwise nothing is known
                               // there
    float scale, cap_m;        // metres = scale * sqrt(value), at most cap_m
    T* scratch;                // (window x, hi[1] - lo[1], hi[2] - lo[2]); its line (x, y) may begin where out's does
    Index scratch_stride[2];   // of x and y; z is contiguous
    float* out;                // metres; voxel lo is out[0]
    Index out_stride[2];       // of x and y, in floats; z is contiguous
    int threads;
};

#define GOSHAWK_DECLARE_EDT(isa)                  \
    namespace isa {                               \
    void transform(const Request<std::int16_t>&); \
    void transform(const Request<std::int32_t>&); \
    void transform(const Request<float>&);        \
    }
GOSHAWK_DECLARE_EDT(portable)
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define GOSHAWK_X86_VARIANTS 1
GOSHAWK_DECLARE_EDT(avx2)
GOSHAWK_DECLARE_EDT(avx512)
#endif

}  // namespace goshawk
