// For processors with AVX-512; CMakeLists.txt says so to the compiler.
#include "kernels.hpp"

#ifdef __AVX512F__
#include "kernels_all.hpp"
const goshawk::Kernels* const goshawk::kernels_avx512 = &kAll;
#else
const goshawk::Kernels* const goshawk::kernels_avx512 = nullptr;
#endif
