// Queries for every processor; see query_kernel.hpp.
#include <cstring>
#include <limits>

#include "edt.hpp"
#include "query.hpp"

#pragma GCC diagnostic ignored "-Wpsabi"  // vectors wider than this processor has stay inside the file
#define GOSHAWK_ISA portable
#define LANES 4
#include "query_kernel.hpp"
