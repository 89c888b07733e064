// A vehicle compiled to a list of functions and one flat row of values per vehicle: body values, then each effect's.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "effects_body.hpp"
#include "effects_thrust.hpp"

namespace goshawk {

enum BodyValue { kMass, kIxx, kIyy, kIzz, kRadius, kDensity, kBodyValues = 12 };

template <class T>
struct Functions {
    void (*mass)(Body<T>&, const T*) = nullptr;
    void (*drive)(Drive<T>&, const T*) = nullptr;
    void (*flow)(Flow<T>&, const T*) = nullptr;
};

struct Entry {
    const char* name;
    int parameters;
};

// One line per effect: name, where it acts, number of parameters.
#define GOSHAWK_EFFECTS(X)                \
    X(centre_of_mass, mass, 2)            \
    X(centre_of_mass_height, mass, 1)     \
    X(payload, mass, 4)                   \
    X(products_of_inertia, mass, 3)       \
    X(motor_lag, drive, 2)                \
    X(battery_sag, drive, 2)              \
    X(constant_wind, flow, 3)             \
    X(thrust_bem, flow, 2)                \
    X(thrust_blade_element, flow, 2)      \
    X(thrust_quadratic, flow, 1)          \
    X(thrust_affine, flow, 2)             \
    X(inflow_linear, flow, 1)             \
    X(translational_lift, flow, 1)        \
    X(ground_effect, flow, 1)             \
    X(ceiling_effect, flow, 1)            \
    X(weak_rotor, flow, 4)                \
    X(rotor_interaction, flow, 2)         \
    X(descent_loss, flow, 3)              \
    X(rotor_drag_thrust, flow, 1)         \
    X(rotor_drag_speed, flow, 1)          \
    X(parasitic_drag, flow, 2)            \
    X(parasitic_drag_linear, flow, 3)     \
    X(parasitic_drag_speed, flow, 3)      \
    X(flapping_moment, flow, 1)           \
    X(wake_skew_moment, flow, 2)          \
    X(airframe_side_moment, flow, 3)      \
    X(rotor_yaw_torque, flow, 1)          \
    X(torque_affine, flow, 1)             \
    X(uneven_rotor_torque, flow, 4)       \
    X(gyroscopic_torque, flow, 1)         \
    X(rotor_acceleration_torque, flow, 1) \
    X(angular_damping, flow, 3)           \
    X(angular_damping_quadratic, flow, 3)

inline const std::vector<Entry>& catalogue() {
#define GOSHAWK_ENTRY(name, where, count) {#name, count},
    static const std::vector<Entry> entries = {GOSHAWK_EFFECTS(GOSHAWK_ENTRY)};
#undef GOSHAWK_ENTRY
    return entries;
}

template <class T>
const std::vector<Functions<T>>& functions() {
    static const std::vector<Functions<T>> table = [] {
        std::vector<Functions<T>> t;
#define GOSHAWK_FUNCTION(name, where, count) \
    t.emplace_back();                        \
    t.back().where = effects::name<T>;
        GOSHAWK_EFFECTS(GOSHAWK_FUNCTION)
#undef GOSHAWK_FUNCTION
        return t;
    }();
    return table;
}

// An effect of the user's own, in Python: it changes the flow through the caller's copy of it.
using OwnEffect = std::function<void(Flow<double>&)>;

struct Active {
    int id;      // in the catalogue; -1 - k for the k-th own effect
    int offset;  // of its first value in the row
};

struct Model {
    double hub[4][3];
    double spin[4];
    std::vector<Active> active;
    std::vector<OwnEffect> own;
    int width = kBodyValues;

    // An empty name means the next of the user's own effects.
    Model(const std::vector<std::string>& names, const double* hubs, const double* spins,
          std::vector<OwnEffect> own_effects)
        : own(std::move(own_effects)) {
        int next_own = 0;
        for (int i = 0; i < 12; ++i) hub[i / 3][i % 3] = hubs[i];
        for (int i = 0; i < 4; ++i) spin[i] = spins[i];
        for (const std::string& name : names) {
            if (name.empty()) {
                active.push_back({-1 - next_own++, width});
                continue;
            }
            int id = -1;
            for (size_t k = 0; k < catalogue().size(); ++k) {
                if (name == catalogue()[k].name) id = static_cast<int>(k);
            }
            if (id < 0) throw std::invalid_argument("no compiled effect " + name);
            active.push_back({id, width});
            width += catalogue()[id].parameters;
        }
    }
};

template <class T>
Body<T> rigid_body(const Model& model, const T* values) {
    Body<T> body{};
    body.mass = values[kMass];
    for (int i = 0; i < 3; ++i) body.inertia[i][i] = values[kIxx + i];
    for (const Active& a : model.active) {
        if (a.id < 0) continue;
        if (auto f = functions<T>()[a.id].mass) f(body, values + a.offset);
    }
    return body;
}

// Rotor acceleration for a command; returns false when no effect models it (the rotors follow at once).
template <class T>
bool drive(const Model& model, const T* values, Drive<T>& d) {
    for (const Active& a : model.active) {
        if (a.id < 0) continue;
        if (auto f = functions<T>()[a.id].drive) f(d, values + a.offset);
    }
    return !d.follows_at_once;
}

inline void run_own(const Model& model, int k, Flow<double>& flow) { model.own[k](flow); }

template <int N>
void run_own(const Model&, int, Flow<Dual<N>>&) {
    throw std::logic_error("effects of the user's own have no derivatives in the kernel");
}

// Expects velocity, rate, rotor_speed, q, height, ceiling_gap and rotor_acceleration; fills force and torque.
template <class T>
void wrench(const Model& model, const T* values, const Body<T>& body, Flow<T>& flow) {
    flow.radius = values[kRadius];
    flow.air_density = values[kDensity];
    for (int i = 0; i < 4; ++i) {
        flow.spin[i] = model.spin[i];
        flow.thrust[i] = T(0.0);
        for (int k = 0; k < 3; ++k) {
            flow.hub[i][k] = model.hub[i][k] - body.centre[k];
            flow.hub_force[i][k] = T(0.0);
        }
    }
    for (int k = 0; k < 3; ++k) flow.force[k] = flow.torque[k] = T(0.0);
    for (const Active& a : model.active) {
        if (a.id < 0) {
            run_own(model, -1 - a.id, flow);
        } else if (auto f = functions<T>()[a.id].flow) {
            f(flow, values + a.offset);
        }
    }
    for (int i = 0; i < 4; ++i) {
        const T* r = flow.hub[i];
        T* f = flow.hub_force[i];
        f[2] += flow.thrust[i];
        for (int k = 0; k < 3; ++k) flow.force[k] += f[k];
        flow.torque[0] += r[1] * f[2] - r[2] * f[1];
        flow.torque[1] += r[2] * f[0] - r[0] * f[2];
        flow.torque[2] += r[0] * f[1] - r[1] * f[0];
    }
}

}  // namespace goshawk
