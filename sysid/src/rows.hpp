// What residual rows make of a chain: normal equations and elimination in one pass, and the leverage of each row.
#pragma once

#include "blocks.hpp"
#include "kernels.hpp"

namespace {

// Border and residual side by side, (rows, width) with zeros at the end; returns how many rows have any border, and
// puts those into `busy`, too.
inline std::size_t gather(const double* border, const double* residual, std::size_t rows, std::size_t p,
                          std::size_t width, double* right, double* busy) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < rows; ++i) {
        double* line = right + i * width;
        bool any = false;
        for (std::size_t j = 0; j < p; ++j) {
            line[j] = border[i * p + j];
            any |= line[j] != 0.0;
        }
        line[p] = residual[i];
        if (any) std::memcpy(busy + count++ * width, line, width * sizeof(double));
    }
    return count;
}

// S <- S + sign X^T X for X (rows, width); only the tiles on and above the diagonal.
inline void add_square(const double* x, std::size_t rows, std::size_t width, double sign, double* s) {
    for (std::size_t a = 0; a < width; ++a)
        for (std::size_t c = a / kLanes * kLanes; c < width; c += kLanes) {
            Lanes sum{};
            for (std::size_t i = 0; i < rows; ++i)
                sum += x[i * width + a] * *reinterpret_cast<const Lanes*>(x + i * width + c);
            Lanes& place = *reinterpret_cast<Lanes*>(s + a * width + c);
            place += sign * sum;
        }
}

// Y <- Y + J^T X for J (rows, n) and X (rows, `stride` apart); `columns` of Y (n, to_stride).
template <int n>
inline void add_transposed(const double* j, std::size_t rows, const double* x, std::size_t stride, std::size_t columns,
                           double* y, std::size_t to_stride) {
    for (std::size_t c = 0; c < columns; c += kLanes) {
        const std::size_t width = columns - c < kLanes ? columns - c : kLanes;
        Lanes sum[n];
        load<n>(y + c, to_stride, width, sum);
        for (std::size_t i = 0; i < rows; ++i) {
            Lanes right;
            load<1>(x + i * stride + c, stride, width, &right);
#pragma GCC unroll 18
            for (int a = 0; a < n; ++a) sum[a] += j[i * n + a] * right;
        }
        store<n>(sum, y + c, to_stride, width);
    }
}

// Numbers that `eliminate` works on besides its results.
inline std::size_t workspace(const goshawk::Rows& rows) {
    const std::size_t width = padded(rows.p + 1), lines = rows.d > 18 ? rows.d : 18;
    return (width + 2 * (lines > rows.m ? lines : rows.m)) * width;
}

// Normal equations of the chain, its factor L (diagonal) and W (coupling), the columns border and gradient taken
// forward, L^-1 [J^T B, J^T r], and what is left of border and gradient with the states eliminated, (p + 1, p + 1).
// Returns the first node that is not determined, or -1.
template <int n>
inline std::ptrdiff_t eliminate(const goshawk::Rows& rows, double* diagonal, double* coupling, double* columns,
                                double* reduced, double* work) {
    const std::size_t q = rows.p + 1, width = padded(q), numbers = workspace(rows);
    double *square = work, *right = work + width * width, *busy = right + (numbers - width * width) / 2;
    std::memset(work, 0, sizeof(double) * numbers);
    std::memset(diagonal, 0, sizeof(double) * rows.nodes * n * n);
    std::memset(columns, 0, sizeof(double) * rows.nodes * n * q);
    for (std::size_t k = 0; k < rows.nodes; ++k) {
        double *dk = diagonal + k * n * n, *xk = columns + k * n * q;
        const double* seen = rows.sensor_state + k * rows.m * n;
        std::size_t count = gather(rows.sensor_border + k * rows.m * rows.p, rows.sensor + k * rows.m, rows.m, rows.p,
                                   width, right, busy);
        add_square(busy, count, width, 1.0, square);
        add_transposed<n>(seen, rows.m, seen, n, n, dk, n);
        add_transposed<n>(seen, rows.m, right, width, q, xk, q);
        if (k + 1 < rows.nodes) {
            const double *before = rows.before + k * rows.d * n, *after = rows.after + k * rows.d * n;
            double* ek = coupling + k * n * n;
            count =
                gather(rows.border + k * rows.d * rows.p, rows.defect + k * rows.d, rows.d, rows.p, width, right, busy);
            add_square(busy, count, width, 1.0, square);
            std::memset(ek, 0, sizeof(double) * n * n);
            add_transposed<n>(before, rows.d, before, n, n, dk, n);
            add_transposed<n>(after, rows.d, after, n, n, dk + n * n, n);
            add_transposed<n>(after, rows.d, before, n, n, ek, n);
            add_transposed<n>(before, rows.d, right, width, q, xk, q);
            add_transposed<n>(after, rows.d, right, width, q, xk + n * q, q);
        }
        if (!factor_block<n>(dk)) return static_cast<std::ptrdiff_t>(k);
        if (k + 1 < rows.nodes) pass_on<n>(dk, coupling + k * n * n, dk + n * n);
        forward<n>(diagonal, coupling, columns, k, q);
        for (int i = 0; i < n; ++i) std::memcpy(busy + i * width, xk + i * q, q * sizeof(double));
        add_square(busy, n, width, -1.0, square);
    }
    for (std::size_t i = 0; i < q; ++i)
        for (std::size_t j = 0; j < q; ++j) reduced[i * q + j] = i <= j ? square[i * width + j] : square[j * width + i];
    return -1;
}

// Y <- Y + J X for J (rows, n), X (n, m) and Y (rows, m).
template <int n>
inline void add_product(const double* j, std::size_t rows, const double* x, double* y, std::size_t m) {
    for (std::size_t c = 0; c < m; c += kLanes) {
        const std::size_t columns = m - c < kLanes ? m - c : kLanes;
        Lanes tile[n], sum;
        load<n>(x + c, m, columns, tile);
        for (std::size_t i = 0; i < rows; ++i) {
            load<1>(y + i * m + c, m, columns, &sum);
            for (int a = 0; a < n; ++a) sum += j[i * n + a] * tile[a];
            store<1>(&sum, y + i * m + c, m, columns);
        }
    }
}

// What changes X of the states (nodes, n, m) add to defects (nodes - 1, d, m) and sensor rows (nodes, rows.m, m).
template <int n>
inline void add_change(const goshawk::Rows& rows, const double* x, std::size_t m, double* defect, double* sensor) {
    for (std::size_t k = 0; k < rows.nodes; ++k) {
        add_product<n>(rows.sensor_state + k * rows.m * n, rows.m, x + k * n * m, sensor + k * rows.m * m, m);
        if (k + 1 == rows.nodes) break;
        add_product<n>(rows.before + k * rows.d * n, rows.d, x + k * n * m, defect + k * rows.d * m, m);
        add_product<n>(rows.after + k * rows.d * n, rows.d, x + (k + 1) * n * m, defect + k * rows.d * m, m);
    }
}

// out += weight a^T S b for each row of A and B (rows, n); S has rows `padded(n)` apart.
template <int n>
inline void add_forms(const double* a, const double* s, const double* b, std::size_t rows, double weight, double* out) {
    constexpr int width = padded(n), tiles = width / kLanes;
    for (std::size_t i = 0; i < rows; ++i, a += n, b += n) {
        Lanes sum[tiles] = {}, right;
        for (int k = 0; k < n; ++k)
            for (int t = 0; t < tiles; ++t)
                sum[t] += a[k] * *reinterpret_cast<const Lanes*>(s + k * width + t * kLanes);
        Lanes total{};
        for (int t = 0; t < tiles; ++t) {
            load<1>(b + t * kLanes, n, n - t * kLanes < kLanes ? n - t * kLanes : kLanes, &right);
            total += sum[t] * right;
        }
        double all = 0.0;
        for (int c = 0; c < kLanes; ++c) all += total[c];
        out[i] += weight * all;
    }
}

// M <- -A B for blocks with rows `padded(n)` apart, of which B's are `n` columns wide.
template <int n>
inline void negative_product(const double* a, const double* b, double* m) {
    constexpr int width = padded(n);
    for (int c = 0; c < width; c += kLanes)
        for (int i = 0; i < n; ++i) {
            Lanes sum{};
            for (int k = 0; k < n; ++k) sum -= a[i * width + k] * *reinterpret_cast<const Lanes*>(b + k * width + c);
            *reinterpret_cast<Lanes*>(m + i * width + c) = sum;
        }
}

// Share of each whitened row that its own fit takes up, from the blocks of the inverse, last node first.
template <int n>
inline void leverage(const goshawk::Rows& rows, const double* l, const double* w, double* defect, double* sensor) {
    constexpr int width = padded(n);
    double own[n * width] = {}, next[n * width], between[n * width], m[n * width] = {}, turned[n * width] = {};
    std::memset(defect, 0, sizeof(double) * (rows.nodes - 1) * rows.d);
    std::memset(sensor, 0, sizeof(double) * rows.nodes * rows.m);
    Lanes tile[n];
    for (std::size_t k = rows.nodes; k-- > 0;) {
        const double* lk = l + k * n * n;
        std::memcpy(next, own, sizeof(own));
        std::memset(own, 0, sizeof(own));
        for (int i = 0; i < n; ++i) own[i * width + i] = 1.0;
        for (int c = 0; c < width; c += kLanes) {
            load<n>(own + c, width, kLanes, tile);
            lower_solve<n>(lk, tile);
            upper_solve<n>(lk, tile);
            store<n>(tile, own + c, width, kLanes);
        }
        if (k + 1 < rows.nodes) {
            const double* wk = w + k * n * n;
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) m[i * width + j] = wk[j * n + i];
            for (int c = 0; c < width; c += kLanes) {  // M = L^-T W^T
                load<n>(m + c, width, kLanes, tile);
                upper_solve<n>(lk, tile);
                store<n>(tile, m + c, width, kLanes);
            }
            negative_product<n>(m, next, between);  // S(k, k + 1) = -M S(k + 1)
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) turned[i * width + j] = m[j * width + i];
            negative_product<n>(between, turned, m);  // S(k) = (L L^T)^-1 + M S(k + 1) M^T
            for (int i = 0; i < n * width; ++i) own[i] += m[i];
            const double *before = rows.before + k * rows.d * n, *after = rows.after + k * rows.d * n;
            add_forms<n>(before, own, before, rows.d, 1.0, defect + k * rows.d);
            add_forms<n>(after, next, after, rows.d, 1.0, defect + k * rows.d);
            add_forms<n>(before, between, after, rows.d, 2.0, defect + k * rows.d);
        }
        const double* seen = rows.sensor_state + k * rows.m * n;
        add_forms<n>(seen, own, seen, rows.m, 1.0, sensor + k * rows.m);
    }
}

}  // namespace
