#include <nanobind/nanobind.h>

void bind_search(nanobind::module_& m);
void bind_running_cost(nanobind::module_& m);

NB_MODULE(_planner, m) {
    bind_search(m);
    bind_running_cost(m);
}
