// The kernels for the instruction set that this file is compiled for.
#pragma once

#include "rows.hpp"

namespace {

template <int n>
std::ptrdiff_t factor_chain(double* d, double* e, std::size_t nodes) {
    for (std::size_t k = 0; k < nodes; ++k) {
        if (!factor_block<n>(d + k * n * n)) return static_cast<std::ptrdiff_t>(k);
        if (k + 1 < nodes) pass_on<n>(d + k * n * n, e + k * n * n, d + (k + 1) * n * n);
    }
    return -1;
}

template <int n>
void solve_chain(const double* l, const double* w, double* x, std::size_t nodes, std::size_t m, bool only_back) {
    for (std::size_t k = 0; k < nodes && !only_back; ++k) forward<n>(l, w, x, k, m);
    for (std::size_t k = nodes; k-- > 0;) backward<n>(l, w, x, k, nodes, m);
}

std::ptrdiff_t factor_any(int n, double* d, double* e, std::size_t nodes) {
    return n == 12 ? factor_chain<12>(d, e, nodes) : factor_chain<18>(d, e, nodes);
}

void solve_any(int n, const double* l, const double* w, double* x, std::size_t nodes, std::size_t m, bool only_back) {
    n == 12 ? solve_chain<12>(l, w, x, nodes, m, only_back) : solve_chain<18>(l, w, x, nodes, m, only_back);
}

std::ptrdiff_t eliminate_any(int n, const goshawk::Rows& rows, double* diagonal, double* coupling, double* columns,
                             double* reduced, double* work) {
    return n == 12 ? eliminate<12>(rows, diagonal, coupling, columns, reduced, work)
                   : eliminate<18>(rows, diagonal, coupling, columns, reduced, work);
}

void leverage_any(int n, const goshawk::Rows& rows, const double* l, const double* w, double* defect, double* sensor) {
    n == 12 ? leverage<12>(rows, l, w, defect, sensor) : leverage<18>(rows, l, w, defect, sensor);
}

void add_change_any(int n, const goshawk::Rows& rows, const double* x, std::size_t m, double* defect, double* sensor) {
    n == 12 ? add_change<12>(rows, x, m, defect, sensor) : add_change<18>(rows, x, m, defect, sensor);
}

constexpr goshawk::Kernels kAll = {factor_any, solve_any, workspace, eliminate_any, leverage_any, add_change_any};

}  // namespace
