// Degree-7 Hermite segments and the minimum-snap spline through knots: block tridiagonal, one 3 x 3 block per knot.
// The plain forms are in planner/curve/minimum_snap.py and planner/curve/minimum_snap.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace goshawk {

constexpr int kStates = 8, kOrders = 4;

// Ascending coefficients in u = t / T from the scaled states (p, v T, a T^2, j T^3) of both ends.
constexpr double kMonomials[kStates][kStates] = {{1, 0, 0, 0, 0, 0, 0, 0},
                                                 {0, 1, 0, 0, 0, 0, 0, 0},
                                                 {0, 0, 1.0 / 2, 0, 0, 0, 0, 0},
                                                 {0, 0, 0, 1.0 / 6, 0, 0, 0, 0},
                                                 {-35, -20, -5, -2.0 / 3, 35, -15, 5.0 / 2, -1.0 / 6},
                                                 {84, 45, 10, 1, -84, 39, -7, 1.0 / 2},
                                                 {-70, -36, -15.0 / 2, -2.0 / 3, 70, -34, 13.0 / 2, -1.0 / 2},
                                                 {20, 10, 2, 1.0 / 6, -20, 10, -2, 1.0 / 6}};

// Integral of the squared fourth derivative as a form in scaled states, to be divided by T^7.
inline const double (&snap_form()) [kStates][kStates] {
    struct Form {
        double entry[kStates][kStates] = {};
        Form() {
            double monomial[kStates][kStates] = {};
            for (int i = 4; i < kStates; ++i)
                for (int j = 4; j < kStates; ++j)
                    monomial[i][j] = i * (i - 1.0) * (i - 2) * (i - 3) * j * (j - 1) * (j - 2) * (j - 3) / (i + j - 7);
            for (int a = 0; a < kStates; ++a)
                for (int b = 0; b < kStates; ++b)
                    for (int i = 4; i < kStates; ++i)
                        for (int j = 4; j < kStates; ++j)
                            entry[a][b] += kMonomials[i][a] * monomial[i][j] * kMonomials[j][b];
        }
    };
    static const Form form;
    return form.entry;
}

inline double seventh_power(double T) {
    const double cube = T * T * T;
    return cube * cube * T;
}

// Scaled states of a segment, or anything of that shape, for a number of axes known when compiled.
template <int A>
struct Ends {
    double row[kStates][A];
};

template <int A>
inline Ends<A> scaled_ends(const double* states, std::size_t segment, double T) {
    Ends<A> ends;
    const double* from = states + segment * kOrders * A;
    double power = 1.0;
    for (int r = 0; r < kOrders; ++r, power *= T)
        for (int x = 0; x < A; ++x) {
            ends.row[r][x] = from[r * A + x] * power;
            ends.row[kOrders + r][x] = from[(kOrders + r) * A + x] * power;
        }
    return ends;
}

template <int A>
inline Ends<A> times_form(const Ends<A>& ends) {
    const double (&form)[kStates][kStates] = snap_form();
    Ends<A> out{};
    for (int a = 0; a < kStates; ++a)
        for (int b = 0; b < kStates; ++b)
            for (int x = 0; x < A; ++x) out.row[a][x] += form[a][b] * ends.row[b][x];
    return out;
}

// The factored conditions for the interior velocities, accelerations and jerks.
class SnapSystem {
  public:
    // held (segments + 1): whether the velocity of a knot is given instead of chosen; null for none.
    void factor(const double* durations, std::size_t segments, const unsigned char* held = nullptr) {
        const double (&form)[kStates][kStates] = snap_form();
        knots_ = segments - 1;
        lower_.resize(knots_ * 6);
        ahead_.resize(knots_ * 9);
        if (knots_ == 0) return;
        double weight[7], next[7];
        powers(durations[0], weight);
        for (std::size_t i = 0; i < knots_; ++i) {
            powers(durations[i + 1], next);
            double D[3][3], E[3][3];
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b) {
                    D[a][b] = form[5 + a][5 + b] * weight[a + b] + form[1 + a][1 + b] * next[a + b];
                    E[a][b] = form[1 + a][5 + b] * next[a + b];
                }
            for (int k = 0; held && k < 3; ++k) {  // a velocity that is held drops out: its step is zero
                if (held[i + 1]) D[0][k] = D[k][0] = k == 0 ? 1.0 : 0.0;
                if (held[i + 1]) E[0][k] = 0.0;
                if (held[i + 2]) E[k][0] = 0.0;
            }
            if (i > 0) {  // D -= E_before' S^-1 E_before
                const double* W = &ahead_[(i - 1) * 9];
                for (int a = 0; a < 3; ++a)
                    for (int b = 0; b < 3; ++b)
                        for (int k = 0; k < 3; ++k) D[a][b] -= before_[k][a] * W[3 * k + b];
            }
            double* L = &lower_[i * 6];  // L00 L10 L11 L20 L21 L22, diagonal inverted
            L[0] = 1.0 / std::sqrt(D[0][0]);
            L[1] = D[1][0] * L[0];
            L[2] = 1.0 / std::sqrt(D[1][1] - L[1] * L[1]);
            L[3] = D[2][0] * L[0];
            L[4] = (D[2][1] - L[3] * L[1]) * L[2];
            L[5] = 1.0 / std::sqrt(D[2][2] - L[3] * L[3] - L[4] * L[4]);
            double* W = &ahead_[i * 9];
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b) W[3 * a + b] = before_[a][b] = E[a][b];
            solve_block<3>(L, W);
            for (int k = 0; k < 7; ++k) weight[k] = next[k];
        }
    }

    // Solves in place for right-hand sides (interior knots, 3, axes); rows begin `stride` numbers apart per knot.
    template <int A>
    void solve(double* x, std::size_t stride) const {
        for (std::size_t i = 0; i < knots_; ++i) {
            double* here = x + i * stride;
            if (i > 0) {  // r -= E' S^-1 r_before = W' r_before
                const double *W = &ahead_[(i - 1) * 9], *last = here - stride;
                for (int a = 0; a < 3; ++a)
                    for (int k = 0; k < 3; ++k)
                        for (int n = 0; n < A; ++n) here[a * A + n] -= W[3 * k + a] * last[k * A + n];
            }
        }
        for (std::size_t i = knots_; i-- > 0;) {
            double* here = x + i * stride;
            solve_block<A>(&lower_[i * 6], here);
            if (i + 1 < knots_) {
                const double *W = &ahead_[i * 9], *next = here + stride;
                for (int a = 0; a < 3; ++a)
                    for (int k = 0; k < 3; ++k)
                        for (int n = 0; n < A; ++n) here[a * A + n] -= W[3 * a + k] * next[k * A + n];
            }
        }
    }

  private:
    // T^-5 ... T^1: what multiplies the form at orders that add up to 2 ... 6.
    static void powers(double T, double out[7]) {
        const double back = 1.0 / T;
        double power = back * back * back * back * back;
        for (int k = 0; k < 7; ++k, power *= T) out[k] = power;
    }

    // b := S^-1 b with S = L L'.
    template <int A>
    static void solve_block(const double* L, double* b) {
        for (int n = 0; n < A; ++n) {
            const double x = b[n] * L[0];
            const double y = (b[A + n] - L[1] * x) * L[2];
            const double z = (b[2 * A + n] - L[3] * x - L[4] * y) * L[5] * L[5];
            const double v = (y - L[4] * z) * L[2];
            b[2 * A + n] = z;
            b[A + n] = v;
            b[n] = (x - L[1] * v - L[3] * z) * L[0];
        }
    }

    std::size_t knots_ = 0;
    std::vector<double> lower_, ahead_;
    double before_[3][3] = {};
};

// Fills in the interior velocities, accelerations and jerks of states (segments + 1, 4, axes); velocities that are held
// stay as they are.
template <int A>
void fill_states(SnapSystem& system, double* states, const double* durations, std::size_t segments,
                 const unsigned char* held = nullptr) {
    constexpr int kKnot = kOrders * A;
    system.factor(durations, segments, held);
    for (std::size_t i = 1; i < segments; ++i)
        for (int n = held && held[i] ? 2 * A : A; n < kKnot; ++n) states[i * kKnot + n] = 0.0;
    Ends<A> before{};
    double from = 0.0;
    std::vector<double> right((segments - 1) * 3 * A);
    for (std::size_t i = 0; i < segments; ++i) {
        const double T = durations[i];
        const Ends<A> force = times_form(scaled_ends<A>(states, i, T));
        const double scale = 1.0 / seventh_power(T);
        if (i > 0) {
            double* r = &right[(i - 1) * 3 * A];
            double then = from, now = scale;
            for (int a = 0; a < 3; ++a) {
                then *= durations[i - 1], now *= T;
                for (int n = 0; n < A; ++n) r[a * A + n] = -(then * before.row[5 + a][n] + now * force.row[1 + a][n]);
            }
            if (held && held[i]) std::fill_n(r, A, 0.0);
        }
        before = force, from = scale;
    }
    system.solve<A>(right.data(), 3 * A);
    for (std::size_t i = 1; i < segments; ++i)
        for (int n = 0; n < 3 * A; ++n) states[i * kKnot + A + n] += right[(i - 1) * 3 * A + n];
}

}  // namespace goshawk
