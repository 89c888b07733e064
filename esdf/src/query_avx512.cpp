// Queries for AVX-512; see query_kernel.hpp.
#include <cstring>
#include <limits>

#include "edt.hpp"
#include "query.hpp"

#if GOSHAWK_X86_VARIANTS
#pragma GCC push_options
#pragma GCC target("avx512f,avx512bw,avx512dq,avx512vl")
#define GOSHAWK_ISA avx512
#define LANES 8
#include "query_kernel.hpp"
#pragma GCC pop_options
#endif
