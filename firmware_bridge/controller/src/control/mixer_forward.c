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

void tc_mixer_wrench(const tc_mixer* mixer, const float rotor_speed_rad_s[TC_ROTORS], const tc_mixer_flow* flow,
                     float induced[TC_ROTORS], tc_wrench* wrench) {
    float sum_n = 0.0f, roll_n_m = 0.0f, pitch_n_m = 0.0f, turn = 0.0f;
    for (int i = 0; i < TC_ROTORS; i++) {
        const tc_mixer_rotor* m = &mixer->rotor[i];
        const float speed = rotor_speed_rad_s[i] / mixer->per_speed, lateral2 = flow->lateral2[i];
        const float load = load_at(mixer, speed, flow->axial[i], mixer->lateral * lateral2 + mixer->still, &induced[i]);
        const float thrust_n = (load + mixer->lift * lateral2) * m->thrust_n;
        sum_n += thrust_n;
        roll_n_m += m->arm_y_m * thrust_n;
        pitch_n_m -= m->arm_x_m * thrust_n;
        turn += m->spin * speed * speed;
    }
    wrench->thrust_n = sum_n;
    wrench->torque_n_m[0] = roll_n_m;
    wrench->torque_n_m[1] = pitch_n_m;
    wrench->torque_n_m[2] = turn / mixer->turn_per_yaw;
}
