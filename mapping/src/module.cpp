// Python bindings of the mapping kernels: contiguous arrays in, new arrays out; the wrappers own names and checks.
#include "bindings.hpp"

NB_MODULE(_mapping, m) {
    bind_rendering(m);
    bind_dense(m);
}
