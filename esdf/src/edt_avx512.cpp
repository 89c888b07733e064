// The distance transform for avx512; see edt_kernel.hpp.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "edt.hpp"
#include "parallel.hpp"

#if GOSHAWK_X86_VARIANTS
#include <immintrin.h>

#pragma GCC push_options
#pragma GCC target("avx512f,avx512bw,avx512dq,avx512vl")
#define GOSHAWK_ISA avx512
#define VECTOR_BYTES 64
#include "edt_kernel.hpp"
#pragma GCC pop_options
#endif
