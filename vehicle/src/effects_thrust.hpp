// Effects on the thrust of each rotor; each is the compiled form of vehicle/effects/<name>.py, which has sources and
// units.
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

// Newton between 0 and the root of axial flow, with bisection where it would leave the bracket.
inline double induced_root(double n, double axial, double lateral_squared, double k1, double k2, double two_rho_area) {
    const double b = two_rho_area * axial - k2 * n;
    const double c = k1 * n * n + k2 * n * axial;
    double induced = (std::sqrt(b * b + 4.0 * two_rho_area * c) - b) / (2.0 * two_rho_area);  // exact when v_xy = 0
    double low = induced < 0.0 ? induced : 0.0, high = induced < 0.0 ? 0.0 : induced;
    for (int step = 0; step < 60; ++step) {
        double defect, slope;
        induced_defect(induced, n, axial, lateral_squared, k1, k2, two_rho_area, defect, slope);
        (defect > 0.0 ? high : low) = induced;
        double moved = induced - defect / slope;
        if (!(slope > 0.0 && moved >= low && moved <= high)) moved = 0.5 * (low + high);
        const double change = moved - induced;
        induced = moved;
        if (std::fabs(change) < 1e-8) break;  // Newton squares the error: what is left is rounding
    }
    return induced;
}

// The root is found in doubles; one more step in the caller's number type adds its derivative.
template <class T>
T induced_velocity(const T& n, const T& axial, const T& lateral_squared, const T& k1, const T& k2,
                   const T& two_rho_area) {
    const T root(induced_root(real(n), real(axial), real(lateral_squared), real(k1), real(k2), real(two_rho_area)));
    T defect, slope;
    induced_defect(root, n, axial, lateral_squared, k1, k2, two_rho_area, defect, slope);
    return root - defect / slope;
}

template <class T>
void thrust_bem(Flow<T>& flow, const T* p) {
    const T two_rho_area = 2.0 * kPi * flow.air_density * flow.radius * flow.radius;
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        const T& n = flow.rotor_speed[i];
        const T induced = induced_velocity(n, a[2], T(a[0] * a[0] + a[1] * a[1]), p[0], p[1], two_rho_area);
        flow.thrust[i] += p[0] * n * n + p[1] * n * (a[2] + induced);
    }
}

template <class T>
void thrust_blade_element(Flow<T>& flow, const T* p) {
    const T two_rho_area = 2.0 * kPi * flow.air_density * flow.radius * flow.radius;
    for (int i = 0; i < 4; ++i) {
        T a[3];
        flow.hub_velocity(i, a);
        const T& n = flow.rotor_speed[i];
        const T edgewise_squared = a[0] * a[0] + a[1] * a[1];
        const T collective = p[0] * (n * n + 1.5 * edgewise_squared / (flow.radius * flow.radius));
        const T induced = induced_velocity(T(1.0), a[2], edgewise_squared, collective, T(p[1] * n), two_rho_area);
        flow.thrust[i] += collective + p[1] * n * (a[2] + induced);
    }
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
        const T behind = -(r[0] * flow.velocity[0] + r[1] * flow.velocity[1]) / sqrt(r[0] * r[0] + r[1] * r[1]);
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
