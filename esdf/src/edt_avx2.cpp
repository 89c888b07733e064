// The distance transform for avx2; see edt_kernel.hpp.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "edt.hpp"
#include "parallel.hpp"

#if GOSHAWK_X86_VARIANTS
#include <immintrin.h>

#pragma GCC push_options
#pragma GCC target("avx2")
#define GOSHAWK_ISA avx2
#define VECTOR_BYTES 32
#include "edt_kernel.hpp"
#pragma GCC pop_options
#endif
