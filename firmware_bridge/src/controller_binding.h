// The controller as Python holds it; the link's binding reaches the same struct.
#pragma once

#include <nanobind/nanobind.h>

#include <memory>

#include "goshawk_controller/goshawk_controller.h"

namespace goshawk {

struct Controller {
    // On the heap because of its size (two trajectory slots); on the vehicle it is a static variable.
    std::unique_ptr<tc_controller> c = std::make_unique<tc_controller>();
    Controller() { tc_init(c.get()); }
};

void bind_controller(nanobind::module_& m);

}  // namespace goshawk
