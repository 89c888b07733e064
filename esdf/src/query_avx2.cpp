// Queries for AVX2; see query_kernel.hpp.
#include <cstring>
#include <limits>

#include "edt.hpp"
#include "query.hpp"

#if GOSHAWK_X86_VARIANTS
#pragma GCC push_options
#pragma GCC target("avx2")
#define GOSHAWK_ISA avx2
#define LANES 4
#include "query_kernel.hpp"
#pragma GCC pop_options
#endif
