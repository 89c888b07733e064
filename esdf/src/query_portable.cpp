// Queries for every processor; see query_kernel.hpp.
#include <cstring>
#include <limits>

#include "edt.hpp"
#include "query.hpp"

#define GOSHAWK_ISA portable
#define LANES 4
#include "query_kernel.hpp"
