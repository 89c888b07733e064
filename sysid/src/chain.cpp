// Least squares on a chain: block-tridiagonal Cholesky, its solves, and the blocks of its inverse.
// Blocks are 12 x 12, or 18 x 18 with disturbances among the states, row-major; the caller (sysid/chain.py) owns
// names, shapes and checks.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <cstddef>
#include <cstring>

namespace nb = nanobind;

namespace {

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define GOSHAWK_CLONES __attribute__((target_clones("avx512f", "arch=haswell", "default")))
#else
#define GOSHAWK_CLONES
#endif

// In-place lower Cholesky factor of one block; the diagonal holds 1 / L_ii. False when not positive definite.
template <int n>
inline bool factor_block(double* a) {
    for (int j = 0; j < n; ++j) {
        double d = a[j * n + j];
        for (int k = 0; k < j; ++k) d -= a[j * n + k] * a[j * n + k];
        if (!(d > 0.0)) return false;
        const double inverse = 1.0 / std::sqrt(d);
        a[j * n + j] = inverse;
        for (int i = j + 1; i < n; ++i) {
            double s = a[i * n + j];
            for (int k = 0; k < j; ++k) s -= a[i * n + k] * a[j * n + k];
            a[i * n + j] = s * inverse;
        }
    }
    return true;
}

// X <- L^-1 X and X <- L^-T X for X (n, m).
template <int n>
inline void lower_solve(const double* l, double* x, std::size_t m) {
    for (int i = 0; i < n; ++i) {
        double* xi = x + i * m;
        for (int k = 0; k < i; ++k) {
            const double f = l[i * n + k];
            const double* xk = x + k * m;
            for (std::size_t c = 0; c < m; ++c) xi[c] -= f * xk[c];
        }
        const double inverse = l[i * n + i];
        for (std::size_t c = 0; c < m; ++c) xi[c] *= inverse;
    }
}

template <int n>
inline void upper_solve(const double* l, double* x, std::size_t m) {
    for (int i = n - 1; i >= 0; --i) {
        double* xi = x + i * m;
        for (int k = i + 1; k < n; ++k) {
            const double f = l[k * n + i];
            const double* xk = x + k * m;
            for (std::size_t c = 0; c < m; ++c) xi[c] -= f * xk[c];
        }
        const double inverse = l[i * n + i];
        for (std::size_t c = 0; c < m; ++c) xi[c] *= inverse;
    }
}

// Y <- Y - W X (transposed: Y <- Y - W^T X), W (n, n), X and Y (n, m).
template <int n, bool transposed>
inline void subtract_product(const double* w, const double* x, double* y, std::size_t m) {
    for (int i = 0; i < n; ++i) {
        double* yi = y + i * m;
        for (int k = 0; k < n; ++k) {
            const double f = transposed ? w[k * n + i] : w[i * n + k];
            const double* xk = x + k * m;
            for (std::size_t c = 0; c < m; ++c) yi[c] -= f * xk[c];
        }
    }
}

// Diagonal blocks D become L, coupling blocks E (row k + 1, column k) become W = E L^-T. Returns the first bad node or
// -1.
template <int n>
inline std::ptrdiff_t factor_chain(double* d, double* e, std::size_t nodes) {
    constexpr int block = n * n;
    double wt[block];
    for (std::size_t k = 0; k < nodes; ++k) {
        double* dk = d + k * block;
        if (!factor_block<n>(dk)) return static_cast<std::ptrdiff_t>(k);
        if (k + 1 == nodes) break;
        double* ek = e + k * block;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) wt[j * n + i] = ek[i * n + j];
        lower_solve<n>(dk, wt, n);  // L^-1 E^T = W^T
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) ek[i * n + j] = wt[j * n + i];
        subtract_product<n, false>(ek, wt, dk + block, n);
    }
    return -1;
}

template <int n>
inline void solve_chain(const double* l, const double* w, double* x, std::size_t nodes, std::size_t m) {
    constexpr int block = n * n;
    for (std::size_t k = 0; k < nodes; ++k) {
        if (k > 0) subtract_product<n, false>(w + (k - 1) * block, x + (k - 1) * n * m, x + k * n * m, m);
        lower_solve<n>(l + k * block, x + k * n * m, m);
    }
    for (std::size_t k = nodes; k-- > 0;) {
        if (k + 1 < nodes) subtract_product<n, true>(w + k * block, x + (k + 1) * n * m, x + k * n * m, m);
        upper_solve<n>(l + k * block, x + k * n * m, m);
    }
}

// Blocks (k, k) and (k, k + 1) of the inverse, from the last node backwards.
template <int n>
inline void inverse_blocks(const double* l, const double* w, double* diagonal, double* coupling, std::size_t nodes) {
    constexpr int block = n * n;
    double m[block], sm[block];
    for (std::size_t k = nodes; k-- > 0;) {
        double* s = diagonal + k * block;
        std::memset(s, 0, sizeof(double) * block);
        for (int i = 0; i < n; ++i) s[i * n + i] = 1.0;
        lower_solve<n>(l + k * block, s, n);
        upper_solve<n>(l + k * block, s, n);
        if (k + 1 == nodes) continue;
        const double* next = s + block;
        for (int i = 0; i < n; ++i)  // m = L^-T W^T
            for (int j = 0; j < n; ++j) m[i * n + j] = w[k * block + j * n + i];
        upper_solve<n>(l + k * block, m, n);
        std::memset(sm, 0, sizeof(sm));  // -m S(k + 1)
        subtract_product<n, false>(m, next, sm, n);
        std::memcpy(coupling + k * block, sm, sizeof(sm));
        for (int i = 0; i < n; ++i)  // S(k) = (L L^T)^-1 + m S(k + 1) m^T
            for (int j = 0; j < n; ++j) {
                double sum = 0.0;
                for (int q = 0; q < n; ++q) sum += sm[i * n + q] * m[j * n + q];
                s[i * n + j] -= sum;
            }
    }
}

// One compiled copy per instruction set and block size.
GOSHAWK_CLONES
std::ptrdiff_t factor_any(int n, double* d, double* e, std::size_t nodes) {
    return n == 12 ? factor_chain<12>(d, e, nodes) : factor_chain<18>(d, e, nodes);
}

GOSHAWK_CLONES
void solve_any(int n, const double* l, const double* w, double* x, std::size_t nodes, std::size_t m) {
    n == 12 ? solve_chain<12>(l, w, x, nodes, m) : solve_chain<18>(l, w, x, nodes, m);
}

GOSHAWK_CLONES
void inverse_any(int n, const double* l, const double* w, double* diagonal, double* coupling, std::size_t nodes) {
    n == 12 ? inverse_blocks<12>(l, w, diagonal, coupling, nodes) : inverse_blocks<18>(l, w, diagonal, coupling, nodes);
}

using Blocks = nb::ndarray<double, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using ConstBlocks = nb::ndarray<const double, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using Columns = nb::ndarray<double, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;

}  // namespace

NB_MODULE(_sysid, module) {
    module.def(
        "factor",
        [](Blocks diagonal, Blocks coupling) {
            nb::gil_scoped_release release;
            return factor_any(static_cast<int>(diagonal.shape(1)), diagonal.data(), coupling.data(), diagonal.shape(0));
        },
        nb::arg("diagonal"), nb::arg("coupling"));
    module.def(
        "solve",
        [](ConstBlocks factor, ConstBlocks coupling, Columns columns) {
            nb::gil_scoped_release release;
            solve_any(static_cast<int>(factor.shape(1)), factor.data(), coupling.data(), columns.data(),
                      columns.shape(0), columns.shape(2));
        },
        nb::arg("factor"), nb::arg("coupling"), nb::arg("columns"));
    module.def(
        "inverse_blocks",
        [](ConstBlocks factor, ConstBlocks coupling, Blocks diagonal, Blocks off_diagonal) {
            nb::gil_scoped_release release;
            inverse_any(static_cast<int>(factor.shape(1)), factor.data(), coupling.data(), diagonal.data(),
                        off_diagonal.data(), factor.shape(0));
        },
        nb::arg("factor"), nb::arg("coupling"), nb::arg("diagonal"), nb::arg("off_diagonal"));
}
