/* Wrench to rotor speeds: the exact inverse of eqs. (1)-(3), without a table.

   Collective, roll and pitch are linear in the four thrusts; one direction is left free and is set so that
   sum spin_i c_q n_i^2 is the wanted yaw torque. Thrust to speed is explicit once the induced velocity is known, and
   that is a Newton iteration with a fixed number of steps. When the rotors cannot give all of it, torque about x and y
   comes first, then the collective, then yaw, which keeps a guaranteed share. */
#ifndef GOSHAWK_CONTROLLER_MIXER_H
#define GOSHAWK_CONTROLLER_MIXER_H

#include "goshawk_controller/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    TC_SATURATED_TILT = 1,       /* roll/pitch torque was scaled down */
    TC_SATURATED_COLLECTIVE = 2, /* collective thrust differs from what was asked */
    TC_SATURATED_YAW = 4,        /* yaw torque was cut */
    TC_SATURATED_ROTOR = 8,      /* a rotor speed was clipped at the end */
    TC_SATURATED_INPUT = 16      /* the position loop's demand was limited */
};

/* What follows from the parameters alone; made once by tc_mixer_configure. */
typedef struct {
    float from_wrench[TC_ROTORS][3]; /* thrusts of least norm for (collective, torque x, torque y) */
    float free[TC_ROTORS];           /* the direction of thrusts that changes none of the three; largest entry 1 */
    float per_lift[TC_ROTORS];       /* reciprocals of from_wrench[i][0], of free, of the rotor gains */
    float per_free[TC_ROTORS];
    float per_gain[TC_ROTORS];
    float free_gain[TC_ROTORS]; /* 2 free / gain: the slope of n^2 in the free direction takes this factor */
    float yaw_per_free;         /* sum spin_i free_i, and its sign */
    float yaw_sign;
    float free_per_yaw;       /* first guess of the multiple of `free` per N m of yaw */
    float arm_x_m[TC_ROTORS]; /* hub relative to the centre of mass */
    float arm_y_m[TC_ROTORS];
    float square, through, axial; /* T = square n^2 + (through (v_z + v_ind) + axial v_z) n */
    float lateral;                /* 1 when v_xy counts in eq. (2), else 0 */
    float half_per_square, four_square;
    float per_load;         /* 1 / (2 rho A) */
    float largest_thrust_n; /* of all four, hovering */
} tc_mixer;

typedef struct {
    float thrust_n; /* along body z */
    float torque_n_m[3];
} tc_wrench;

typedef struct {
    float rotor_speed_rad_s[TC_ROTORS];
    float rotor_thrust_n[TC_ROTORS]; /* what each rotor was asked for, after desaturation */
    uint8_t saturation;              /* TC_SATURATED_ bits */
} tc_mix;

/* TC_SINGULAR_GEOMETRY when the four rotors cannot produce an arbitrary wrench. */
tc_reason tc_mixer_configure(tc_mixer* mixer, const tc_parameters* parameters);

/* air_velocity_body_m_s: of the vehicle through the air, rate_body_rad_s moves the hubs. All finite. Speeds come out in
   [rotor_min_rad_s, rotor_max_rad_s]. */
void tc_mixer_solve(const tc_mixer* mixer, const tc_parameters* parameters, const tc_wrench* wrench,
                    const float air_velocity_body_m_s[3], const float rate_body_rad_s[3], tc_mix* out);

#ifdef __cplusplus
}
#endif

#endif
