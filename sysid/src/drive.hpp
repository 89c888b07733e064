// Rotor speeds behind a first-order lag, from commands that are held over each interval, with derivatives.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace goshawk {

// Over an interval h the speed s goes to the command c as s(t) = c + (s - c) exp(-t / tau), with one tau for c > s and
// another for c < s; s - c does not change its sign on the way, so this is exact. tau = 0: the rotors follow at once.
//
// command: (k, r); by: (k, r, q) its derivatives by q parameters. Out: mean speed and mean acceleration over each
// interval (k, r), and (k, r, q + 2) their derivatives by the q parameters, rise_s and fall_s. `state` works: q + 2.
inline void drive(const double* step_s, const double* command, const double* by, std::size_t k, std::size_t rotors,
                  std::size_t q, double rise_s, double fall_s, double* mean, double* change, double* mean_by,
                  double* change_by, double* state) {
    const std::size_t p = q + 2;
    for (std::size_t rotor = 0; rotor < rotors; ++rotor) {
        double speed = command[rotor];  // settled before the first interval
        for (std::size_t j = 0; j < p; ++j) state[j] = j < q ? by[rotor * q + j] : 0.0;
        for (std::size_t i = 0; i < k; ++i) {
            const std::size_t at = rotors * i + rotor;
            const double h = step_s[i], c = command[at], off = speed - c;
            const double tau = off < 0.0 ? rise_s : fall_s;
            const double kept = tau > 0.0 ? std::exp(-h / tau) : 0.0;         // share of `off` at the end
            const double average = tau / h * (1.0 - kept);                    // and on average
            const double kept_by = tau > 0.0 ? kept * h / (tau * tau) : 0.0;  // derivatives by tau
            const double average_by = (1.0 - kept) / h - (tau > 0.0 ? kept / tau : 0.0);
            mean[at] = c + average * off;
            change[at] = (kept - 1.0) * off / h;
            for (std::size_t j = 0; j < p; ++j) {
                const double own = j < q ? by[at * q + j] : 0.0, before = state[j];
                const bool its_tau = j == q + (off < 0.0 ? 0 : 1);
                double after = own + kept * (before - own);
                mean_by[at * p + j] = own + average * (before - own);
                if (its_tau) {
                    after += kept_by * off;
                    mean_by[at * p + j] += average_by * off;
                }
                change_by[at * p + j] = (after - before) / h;
                state[j] = after;
            }
            speed = c + kept * off;
        }
    }
}

}  // namespace goshawk
