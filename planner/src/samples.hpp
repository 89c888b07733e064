// What is worked out at the samples of a segment, compiled once per instruction set, and the numbers it works on.
#pragma once

#include <cstddef>

namespace goshawk {

constexpr int kAxes = 4;       // x, y, z, yaw
constexpr int kLanes = 4;      // samples are taken four at a time
constexpr int kUnknowns = 33;  // of a segment: the states of both its ends (end, order, axis), and log T
constexpr int kPadded = 36;    // the same in whole packs

enum Limit { kSpeed, kAcceleration, kJerk, kTilt, kRate, kYawRate, kFastest };

// A fastest and a slowest speed of each rotor. Compiled for four and for eight; of fewer than eight the rest rest.
constexpr int kMostRotors = 8;
constexpr int limits_of(int rotors) { return kFastest + 2 * rotors; }

// In the order of planner/optimise/airframe.py. Effort is a rotor's speed squared, in units of its mean at hover.
struct Airframe {
    double speed, acceleration, jerk, cos_tilt, rate, yaw_rate, gravity;  // infinite jerk: no limit
    double drag_per_thrust, drag_per_speed;  // lateral drag per mass over velocity: c |f| / g + c' |v|
    double lift_axial, lift_lateral;  // thrust per mass at steady rotor speeds: by climb rate, by lateral speed^2
    double inertia[3];
    double effort_least[kMostRotors], effort_most[kMostRotors], effort_hover[kMostRotors];
    double mix[kMostRotors][4];  // effort of each rotor by thrust per mass and by the three torques
    int rotors;                  // 4 or 8
};

struct Prices {
    double snap, limits, clearance, heading, turning;
};

// Samples in packs of four; what is left over in the last pack repeats the last sample and has no share.
struct Samples {
    std::size_t packs;
    const double* basis;     // (packs, 5, 8, 4) derivatives by u from the scaled states of both ends
    const double* share;     // (packs, 4) of the segment's time that each answers for
    const double* offsets;   // (packs, limits, 4) added to each excess
    const double* distance;  // (packs, 4) to obstacles
    const double* uphill;    // (packs, 3, 4) its gradient
    double duration;         // of the segment
    double reference;        // time over which the limits are charged; 0: the segment's own
    const double* target;    // (2,) x and y of the point that the vehicle looks at; null if along its path
};

struct Kernels {
    // Cost of a segment alone, and
    double (*cost_alone)(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                         const double (*scaled)[kAxes], double T);
    // cost of a segment, over its time T; its gradient by the scaled states (8, 4), and by T at fixed scaled states.
    double (*cost)(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                   const double (*scaled)[kAxes], double T, double (*by_scaled)[kAxes], double& by_T);
    // Excess over each limit, (packs, limits, 4), without the offsets.
    void (*excess)(const Samples& samples, const Airframe& airframe, const double (*scaled)[kAxes], double T,
                   double* out);
    // Gradient (33) and Gauss-Newton matrix (33, 36), of which the lower triangle counts, of the same cost by the
    // states of both ends in units of their own, and log T. unit (32): each state's, times T to the power of its order.
    void (*curvature)(const Samples& samples, const Airframe& airframe, const Prices& prices, double clearance_m,
                      const double (*scaled)[kAxes], double T, const double* unit, double* gradient,
                      double (*second)[kPadded]);
    // Cholesky factor of a banded matrix in place, as in `Banded`, with its diagonal inverted; false where it is not
    // positive definite.
    bool (*factor)(double* columns, std::size_t size, std::size_t below, const std::size_t* end);
};

extern const Kernels* const kernels_plain;
extern const Kernels* const kernels_avx2;  // null where it was not compiled

// Those for the processor at hand.
const Kernels& kernels();

}  // namespace goshawk
