// For any processor.
#include "kernels_all.hpp"

const goshawk::Kernels* const goshawk::kernels_plain = &kAll;
