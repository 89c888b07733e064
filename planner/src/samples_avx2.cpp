// For processors with AVX2; CMakeLists.txt says so to the compiler.
#include "samples.hpp"

#ifdef __AVX2__
#include "samples_all.hpp"
const goshawk::Kernels* const goshawk::kernels_avx2 = &kAll;
#else
const goshawk::Kernels* const goshawk::kernels_avx2 = nullptr;
#endif
