// Effects on the thrust of each rotor; each is the compiled form of vehicle/effects/<room>/<name>.py, which has sources
// and units.
#pragma once

#include "state.hpp"

namespace goshawk {
namespace effects {

// How far v_ind misses 2 rho A v_ind sqrt((v_z + v_ind)^2 + v_xy^2) = k1 n^2 + k2 n (v_z + v_ind), and the slope.
template <class T>
void induced_defect(const T& induced, const T& n, const T& axial, const T& lateral_squared, const T& k1, const T& k2,
                    const T& two_rho_area, T& defect, T& slope) {
    const T through = axial + induced;
    const T speed = sqrt(through * through + lateral_squared + 1e-12);
    defect = two_rho_area * induced * speed - k1 * n * n - k2 * n * through;
    slope = two_rho_area * (speed + induced * through / speed) - k2 * n + 1e-12;
}

// Newton between 0 and the root of axial flow, with bisection where it would leave the bracket; all four rotors at
// once, so that none waits for another's divisions.
inline void induced_roots(const double n[4], const double axial[4], const double lateral_squared[4], const double k1[4],
                          const double k2[4], double two_rho_area, double induced[4]) {
    double low[4], high[4];
    for (int i = 0; i < 4; ++i) {
        const double b = two_rho_area * axial[i] - k2[i] * n[i];
        const double c = k1[i] * n[i] * n[i] + k2[i] * n[i] * axial[i];
        induced[i] = (std::sqrt(b * b + 4.0 * two_rho_area * c) - b) / (2.0 * two_rho_area);  // exact when v_xy = 0
        low[i] = induced[i] < 0.0 ? induced[i] : 0.0;
        high[i] = induced[i] < 0.0 ? 0.0 : induced[i];
    }
    for (int step = 0; step < 60; ++step) {
        double change[4];
        for (int i = 0; i < 4; ++i) {
            const double v = induced[i];
            double defect, slope;
            induced_defect(v, n[i], axial[i], lateral_squared[i], k1[i], k2[i], two_rho_area, defect, slope);
            high[i] = defect > 0.0 ? v : high[i];
            low[i] = defect > 0.0 ? low[i] : v;
            const double moved = v - defect / slope;
            const bool inside = (slope > 0.0) & (moved >= low[i]) & (moved <= high[i]);
            induced[i] = inside ? moved : 0.5 * (low[i] + high[i]);
            change[i] = std::fabs(induced[i] - v);
        }
        // Newton squares the error: what is left is rounding
        if ((change[0] < 1e-8) & (change[1] < 1e-8) & (change[2] < 1e-8) & (change[3] < 1e-8)) break;
    }
}

// The roots are found in doubles; one more step in the caller's number type adds their derivatives.
template <class T>
void induced_velocities(const T n[4], const T axial[4], const T lateral_squared[4], const T k1[4], const T k2[4],
                        const T& two_rho_area, T induced[4]) {
    double values[5][4], roots[4];
    for (int i = 0; i < 4; ++i) {
        const T* const arguments[5] = {n, axial, lateral_squared, k1, k2};
        for (int k = 0; k < 5; ++k) values[k][i] = real(arguments[k][i]);
    }
    induced_roots(values[0], values[1], values[2], values[3], values[4], real(two_rho_area), roots);
    for (int i = 0; i < 4; ++i) {
        T defect, slope;
        induced_defect(T(roots[i]), n[i], axial[i], lateral_squared[i], k1[i], k2[i], two_rho_area, defect, slope);
        induced[i] = roots[i] - defect / real(slope);  // the defect is nothing but rounding: its slope's does not count
    }
}

// Of each hub through the air: along the thrust axis, and across it, squared.
template <class T>
void hub_flow(const Flow<T>& flow, T axial[4], T edgewise_squared[4]) {
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        axial[i] = a[2];
        edgewise_squared[i] = a[0] * a[0] + a[1] * a[1];
    }
}

template <class T>
T two_rho_area(const Flow<T>& flow) {
    return 2.0 * kPi * flow.air_density * flow.radius * flow.radius;
}

template <class T>
void thrust_bem(Flow<T>& flow, const T* p) {
    const T k1[4] = {p[0], p[0], p[0], p[0]}, k2[4] = {p[1], p[1], p[1], p[1]}, *n = flow.rotor_speed;
    T axial[4], edgewise_squared[4], induced[4];
    hub_flow(flow, axial, edgewise_squared);
    induced_velocities(n, axial, edgewise_squared, k1, k2, two_rho_area(flow), induced);
    for (int i = 0; i < 4; ++i) flow.thrust[i] += p[0] * n[i] * n[i] + p[1] * n[i] * (axial[i] + induced[i]);
}

template <class T>
void thrust_blade_element(Flow<T>& flow, const T* p) {
    const T one[4] = {1.0, 1.0, 1.0, 1.0}, *n = flow.rotor_speed;
    T axial[4], edgewise_squared[4], collective[4], slope[4], induced[4];
    hub_flow(flow, axial, edgewise_squared);
    for (int i = 0; i < 4; ++i) {
        collective[i] = p[0] * (n[i] * n[i] + 1.5 * edgewise_squared[i] / (flow.radius * flow.radius));
        slope[i] = p[1] * n[i];
    }
    induced_velocities(one, axial, edgewise_squared, collective, slope, two_rho_area(flow), induced);
    for (int i = 0; i < 4; ++i) flow.thrust[i] += collective[i] + slope[i] * (axial[i] + induced[i]);
}

template <class T>
void thrust_quadratic(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) flow.thrust[i] += p[0] * flow.rotor_speed[i] * flow.rotor_speed[i];
}

template <class T>
void thrust_affine(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) flow.thrust[i] += p[0] + p[1] * flow.rotor_speed[i];
}

template <class T>
void inflow_linear(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        flow.thrust[i] -= p[0] * flow.rotor_speed[i] * a[2];
    }
}

template <class T>
void translational_lift(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        flow.thrust[i] += p[0] * (a[0] * a[0] + a[1] * a[1]);
    }
}

template <class T>
void scale_thrust(Flow<T>& flow, const T& factor) {
    for (int i = 0; i < 4; ++i) flow.thrust[i] *= factor;
}

template <class T>
void ground_effect(Flow<T>& flow, const T* p) {
    const T height = clipped(flow.height, T(1e-3), T(kFar));
    const T near = flow.radius / (4.0 * height);
    T ratio = p[0] * near * near;
    if (!(real(ratio) < 0.5)) ratio = T(0.5);
    scale_thrust(flow, T(1.0 / (1.0 - ratio)));
}

template <class T>
void ceiling_effect(Flow<T>& flow, const T* p) {
    const T near = flow.radius / clipped(flow.ceiling_gap, T(0.5 * flow.radius), T(kFar));
    scale_thrust(flow, T(1.0 + p[0] * near * near));
}

template <class T>
void weak_rotor(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) flow.thrust[i] *= 1.0 - p[i];
}

template <class T>
void rotor_interaction(Flow<T>& flow, const T* p) {
    for (int i = 0; i < 4; ++i) {
        const T* r = flow.hub[i];
        const T square = r[0] * r[0] + r[1] * r[1];
        if (!(real(square) > 1e-12)) continue;  // in the middle
        const T behind = -(r[0] * flow.velocity[0] + r[1] * flow.velocity[1]) / sqrt(square);
        flow.thrust[i] *= 1.0 - (real(behind) > 0.0 ? p[0] : p[1]) * behind;
    }
}

template <class T>
void descent_loss(Flow<T>& flow, const T* p) {
    const T disk = 2.0 * kPi * flow.air_density * flow.radius * flow.radius;
    for (int i = 0; i < 4; ++i) {
        if (!(real(flow.thrust[i]) > 1e-9)) continue;
        T a[3];
        flow.hub_velocity(i, a);
        const T off = (a[2] / sqrt(flow.thrust[i] / disk) - p[1]) / p[2];
        if (!(real(off) > -1.0 && real(off) < 1.0)) continue;
        const T root = 1.0 - off * off;
        flow.thrust[i] *= 1.0 - p[0] * root * root;
    }
}

}  // namespace effects
}  // namespace goshawk
