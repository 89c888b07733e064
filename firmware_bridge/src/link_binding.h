// The link endpoint for Python; see link_binding.cpp.
#pragma once

#include <nanobind/nanobind.h>

namespace goshawk {

void bind_link(nanobind::module_& m);

}  // namespace goshawk
