// Python bindings of portable.hpp; shapes and names are the business of flight/portable.py.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "portable.hpp"

namespace nb = nanobind;
using namespace goshawk;
using In = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using In3 = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Out3 = nb::ndarray<double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <double (*function)(double)>
void each(In x, Out out) {
    for (std::size_t i = 0; i < x.size(); ++i) out.data()[i] = function(x.data()[i]);
}

// (p, m, n): products of (p, m, k) and (p, k, n), each sum in order of k; a single matrix is shared.
void product(In3 a, In3 b, Out3 out) {
    const std::size_t m = out.shape(1), n = out.shape(2), size = a.shape(2);
    for (std::size_t p = 0; p < out.shape(0); ++p) {
        const double* left = a.data() + (a.shape(0) == 1 ? 0 : p * m * size);
        const double* right = b.data() + (b.shape(0) == 1 ? 0 : p * size * n);
        for (std::size_t i = 0; i < m; ++i) {
            double* row = out.data() + (p * m + i) * n;
            for (std::size_t j = 0; j < n; ++j) row[j] = 0.0;
            for (std::size_t k = 0; k < size; ++k)
                for (std::size_t j = 0; j < n; ++j) row[j] += left[i * size + k] * right[k * n + j];
        }
    }
}

// Solves A x = b for symmetric, positive definite A by Cholesky's method; band[i - j, j] holds A[i, j], i >= j, and is
// overwritten, as is b by x. False when A is not positive definite.
bool solve_banded(Matrix band, Out right) {
    const std::size_t width = band.shape(0), n = band.shape(1);
    double *L = band.data(), *x = right.data();
    const auto at = [&](std::size_t i, std::size_t j) -> double& { return L[(i - j) * n + j]; };
    for (std::size_t j = 0; j < n; ++j) {
        const std::size_t first = j + 1 > width ? j + 1 - width : 0;
        for (std::size_t i = j; i < n && i < j + width; ++i) {
            double value = at(i, j);
            for (std::size_t k = i + 1 > width ? i + 1 - width : 0; k < j; ++k) {
                if (k >= first) value -= at(i, k) * at(j, k);
            }
            if (i == j && !(value > 0.0)) return false;
            at(i, j) = i == j ? std::sqrt(value) : value / at(j, j);
        }
        for (std::size_t k = first; k < j; ++k) x[j] -= at(j, k) * x[k];
        x[j] /= at(j, j);
    }
    for (std::size_t j = n; j-- > 0;) {
        for (std::size_t i = j + 1; i < n && i < j + width; ++i) x[j] -= at(i, j) * x[i];
        x[j] /= at(j, j);
    }
    return true;
}

NB_MODULE(_portable, module) {
    module.def("sine_cosine", [](In x, Out sine, Out cosine) {
        for (std::size_t i = 0; i < x.size(); ++i) {
            const SineCosine both = sine_cosine(x.data()[i]);
            sine.data()[i] = both.sine;
            cosine.data()[i] = both.cosine;
        }
    });
    module.def("arctangent2", [](In y, In x, Out out) {
        for (std::size_t i = 0; i < x.size(); ++i) out.data()[i] = arctangent2(y.data()[i], x.data()[i]);
    });
    module.def("exponential", &each<exponential>);
    module.def("logarithm", &each<logarithm>);
    module.def("arcsine", &each<arcsine>);
    module.def("arccosine", &each<arccosine>);
    module.def("product", &product);
    module.def("solve_banded", &solve_banded);
}
