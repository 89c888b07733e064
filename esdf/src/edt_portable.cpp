// The distance transform for every processor; see edt_kernel.hpp.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "edt.hpp"
#include "parallel.hpp"

#define GOSHAWK_ISA portable
#define VECTOR_BYTES 16
#include "edt_kernel.hpp"
