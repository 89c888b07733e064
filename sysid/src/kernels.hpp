// The functions that are compiled once per instruction set, and the rows they work on.
#pragma once

#include <cstddef>

namespace goshawk {

// Rows of one flight: d defects per interval between nodes, m sensor rows per node, p border columns.
struct Rows {
    const double *before, *after;  // (nodes - 1, d, n)
    const double* border;          // (nodes - 1, d, p)
    const double* defect;          // (nodes - 1, d)
    const double* sensor_state;    // (nodes, m, n)
    const double* sensor_border;   // (nodes, m, p)
    const double* sensor;          // (nodes, m)
    std::size_t nodes, d, m, p;
};

// `size` is that of a block, 12 or 18; `nodes` that of the chain; m columns.
struct Kernels {
    std::ptrdiff_t (*factor)(int size, double* diagonal, double* coupling, std::size_t nodes);
    void (*solve)(int size, const double* factor, const double* coupling, double* columns, std::size_t nodes,
                  std::size_t m, bool only_back);
    std::size_t (*workspace)(const Rows& rows);
    std::ptrdiff_t (*eliminate)(int size, const Rows& rows, double* diagonal, double* coupling, double* columns,
                                double* reduced, double* work);
    void (*leverage)(int size, const Rows& rows, const double* factor, const double* coupling, double* defect,
                     double* sensor);
    void (*add_change)(int size, const Rows& rows, const double* states, std::size_t m, double* defect, double* sensor);
};

// Null where the compiler does not know the instruction set.
extern const Kernels* const kernels_plain;
extern const Kernels* const kernels_avx2;
extern const Kernels* const kernels_avx512;

}  // namespace goshawk
