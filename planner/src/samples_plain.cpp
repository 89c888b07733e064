// For any processor.
#include "samples_all.hpp"

const goshawk::Kernels* const goshawk::kernels_plain = &kAll;
