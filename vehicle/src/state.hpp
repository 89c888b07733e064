// The quantities that effects read and change: the C++ form of vehicle/effects/base.py, for one instant.
#pragma once

#include "dual.hpp"
#include "portable.hpp"

namespace goshawk {

template <class T>
struct Body {
    T mass;
    T inertia[3][3];
    T centre[3];
};

template <class T>
struct Drive {
    T command[4];
    T speed[4];
    T battery_v;
    T acceleration[4];
    bool follows_at_once = true;
};

template <class T>
struct Flow {
    T velocity[3];  // of the centre of mass relative to the air, body axes
    T rate[3];
    T rotor_speed[4];
    T hub[4][3];
    double spin[4];
    T radius, air_density;
    T q[4];
    T height, ceiling_gap;
    T rotor_acceleration[4];
    T thrust[4];
    T hub_force[4][3];
    T force[3];
    T torque[3];

    // Velocity of hub i relative to the air, body axes.
    void hub_velocity(int i, T a[3]) const {
        const T* r = hub[i];
        a[0] = velocity[0] + rate[1] * r[2] - rate[2] * r[1];
        a[1] = velocity[1] + rate[2] * r[0] - rate[0] * r[2];
        a[2] = velocity[2] + rate[0] * r[1] - rate[1] * r[0];
    }
};

}  // namespace goshawk
