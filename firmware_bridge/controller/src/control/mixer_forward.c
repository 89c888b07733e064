/* Rotor speeds to wrench: eqs. (1)-(3) forwards, in the units of mixer.c. */
#include "../base/maths.h"
#include "goshawk_controller/mixer.h"

/* One Newton step on eq. (2) from the induced velocity of the last tick: its error falls by 20 a tick, while speeds
   change by some percent. */
static float load_at(const tc_mixer* mixer, float speed, float axial, float lateral2, float* induced) {
    const float drag = mixer->axial * axial, per_load = 1.0f / mixer->load_factor;
    const float v = *induced, w = axial + v;
    const float through = sqrtf(w * w + lateral2);
    const float load = (speed + 2.0f * (drag - mixer->induced * v)) * speed * per_load;
    const float slope = through + v * w / through + 2.0f * mixer->induced * speed * per_load;
    const float next = v - (v * through - load) / tc_max(slope, 0.5f * through);
    *induced = tc_clamp(next, 0.0f, tc_max(speed, 0.0f));
    return (speed + 2.0f * (drag - mixer->induced * *induced)) * speed * per_load;
}

void tc_mixer_wrench(const tc_mixer* mixer, const float rotor_speed_rad_s[TC_ROTORS],
                     const float air_velocity_body_m_s[3], const float rate_body_rad_s[3], float induced[TC_ROTORS],
                     tc_wrench* wrench) {
    memset(wrench, 0, sizeof *wrench);
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        const float x = m->arm_x_m, y = m->arm_y_m, unit = mixer->unit_m_s;
        const float vx = unit * (air_velocity_body_m_s[0] - rate_body_rad_s[2] * y);
        const float vy = unit * (air_velocity_body_m_s[1] + rate_body_rad_s[2] * x);
        const float vz = unit * (air_velocity_body_m_s[2] + rate_body_rad_s[0] * y - rate_body_rad_s[1] * x);
        const float speed = rotor_speed_rad_s[i] / mixer->per_speed, flow2 = vx * vx + vy * vy;
        const float load = load_at(mixer, speed, vz, mixer->lateral * flow2 + mixer->still, &induced[i]);
        const float thrust_n = (load + mixer->lift * flow2) * m->thrust_n;
        wrench->thrust_n += thrust_n;
        wrench->torque_n_m[0] += y * thrust_n;
        wrench->torque_n_m[1] -= x * thrust_n;
        wrench->torque_n_m[2] += m->spin * speed * speed / mixer->turn_per_yaw;
    }
}
