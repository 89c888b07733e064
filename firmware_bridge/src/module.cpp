// The extension module _controller: the C controller for Python.
#include <nanobind/nanobind.h>

#include "controller_binding.h"
#include "link_binding.h"

NB_MODULE(_controller, m) {
    m.doc() = "The embedded controller: the very C files that run on the vehicle.";
    goshawk::bind_controller(m);
    goshawk::bind_link(m);
}
