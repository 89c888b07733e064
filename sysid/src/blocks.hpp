// Blocks of a chain: Cholesky factor of one block, its solves, and products, on tiles of a few columns at a time.
// Blocks are 12 x 12, or 18 x 18 with disturbances among the states, row-major.
// Compiled once per instruction set (kernels_*.cpp), hence the unnamed namespace.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>

namespace {

// Columns that one instruction works on.
#if defined(__AVX512F__)
constexpr int kLanes = 8;
#elif defined(__AVX__)
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif
typedef double Lanes __attribute__((vector_size(kLanes * sizeof(double)), aligned(8), may_alias));

constexpr std::size_t padded(std::size_t width) { return (width + kLanes - 1) / kLanes * kLanes; }

// Copies fewer than eight numbers; a plain memcpy of unknown length would be a call.
inline void copy_part(const double* from, double* to, std::size_t count) {
    if (count & 4) std::memcpy(to, from, 4 * sizeof(double)), from += 4, to += 4;
    if (count & 2) std::memcpy(to, from, 2 * sizeof(double)), from += 2, to += 2;
    if (count & 1) *to = *from;
}

// Up to `kLanes` columns of rows that are `stride` apart, missing ones as zeros.
template <int n>
inline void load(const double* from, std::size_t stride, std::size_t columns, Lanes* tile) {
    for (int i = 0; i < n; ++i) {
        if (columns == kLanes) {
            tile[i] = *reinterpret_cast<const Lanes*>(from + i * stride);
        } else {
            tile[i] = Lanes{};
            copy_part(from + i * stride, reinterpret_cast<double*>(&tile[i]), columns);
        }
    }
}

template <int n>
inline void store(const Lanes* tile, double* to, std::size_t stride, std::size_t columns) {
    for (int i = 0; i < n; ++i) {
        if (columns == kLanes) {
            *reinterpret_cast<Lanes*>(to + i * stride) = tile[i];
        } else {
            copy_part(reinterpret_cast<const double*>(&tile[i]), to + i * stride, columns);
        }
    }
}

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

// X <- L^-1 X and X <- L^-T X.
template <int n>
inline void lower_solve(const double* l, Lanes* x) {
    for (int i = 0; i < n; ++i) {
        Lanes sum = x[i];
        for (int k = 0; k < i; ++k) sum -= l[i * n + k] * x[k];
        x[i] = sum * l[i * n + i];
    }
}

template <int n>
inline void upper_solve(const double* l, Lanes* x) {
    for (int i = n - 1; i >= 0; --i) {
        Lanes sum = x[i];
        for (int k = i + 1; k < n; ++k) sum -= l[k * n + i] * x[k];
        x[i] = sum * l[i * n + i];
    }
}

// Y <- Y - W X (transposed: Y <- Y - W^T X).
template <int n, bool transposed>
inline void subtract_product(const double* w, const Lanes* x, Lanes* y) {
    for (int i = 0; i < n; ++i) {
        Lanes sum = y[i];
        for (int k = 0; k < n; ++k) sum -= (transposed ? w[k * n + i] : w[i * n + k]) * x[k];
        y[i] = sum;
    }
}

// E <- W = E L^-T, and the next diagonal block D <- D - W W^T.
template <int n>
inline void pass_on(const double* l, double* e, double* d) {
    double transposed[n * n];
    Lanes w[n], y[n];
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) transposed[j * n + i] = e[i * n + j];
    for (int c = 0; c < n; c += kLanes) {  // L^-1 E^T = W^T
        const std::size_t columns = n - c < kLanes ? n - c : kLanes;
        load<n>(transposed + c, n, columns, w);
        lower_solve<n>(l, w);
        store<n>(w, transposed + c, n, columns);
    }
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) e[i * n + j] = transposed[j * n + i];
    for (int c = 0; c < n; c += kLanes) {
        const std::size_t columns = n - c < kLanes ? n - c : kLanes;
        load<n>(transposed + c, n, columns, w);
        load<n>(d + c, n, columns, y);
        subtract_product<n, false>(e, w, y);
        store<n>(y, d + c, n, columns);
    }
}

// Columns X of node k, of which the node before has been done: X(k) <- L(k)^-1 (X(k) - W(k - 1) X(k - 1)).
template <int n>
inline void forward(const double* l, const double* w, double* x, std::size_t k, std::size_t m) {
    Lanes before[n], own[n];
    for (std::size_t c = 0; c < m; c += kLanes) {
        const std::size_t columns = m - c < kLanes ? m - c : kLanes;
        load<n>(x + k * n * m + c, m, columns, own);
        if (k > 0) {
            load<n>(x + (k - 1) * n * m + c, m, columns, before);
            subtract_product<n, false>(w + (k - 1) * n * n, before, own);
        }
        lower_solve<n>(l + k * n * n, own);
        store<n>(own, x + k * n * m + c, m, columns);
    }
}

// The way back: X(k) <- L(k)^-T (X(k) - W(k)^T X(k + 1)).
template <int n>
inline void backward(const double* l, const double* w, double* x, std::size_t k, std::size_t nodes, std::size_t m) {
    Lanes after[n], own[n];
    for (std::size_t c = 0; c < m; c += kLanes) {
        const std::size_t columns = m - c < kLanes ? m - c : kLanes;
        load<n>(x + k * n * m + c, m, columns, own);
        if (k + 1 < nodes) {
            load<n>(x + (k + 1) * n * m + c, m, columns, after);
            subtract_product<n, true>(w + k * n * n, after, own);
        }
        upper_solve<n>(l + k * n * n, own);
        store<n>(own, x + k * n * m + c, m, columns);
    }
}

}  // namespace
