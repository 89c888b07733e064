#include <nanobind/nanobind.h>

void bind_search(nanobind::module_& m);
void bind_optimise(nanobind::module_& m);

NB_MODULE(_planner, m) {
    bind_search(m);
    bind_optimise(m);
}
