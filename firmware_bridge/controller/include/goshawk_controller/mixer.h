/* Wrench to rotor speeds: the exact inverse of eqs. (1)-(3), without a table.

   Collective, roll and pitch are linear in the four thrusts; one direction of thrusts is left free and is set so that
   sum spin_i c_q n_i^2 is the wanted yaw torque. Induced velocities, speeds and the free direction are found together
   by one step of third order (docs/evidence/studies/mixer.md). A demand that the rotors can meet is met exactly. When
   they cannot give all of it, torque about x and y comes first, then the collective, then yaw, which keeps a guaranteed
   share. */
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

/* One rotor. What turns newtons and metres per second into the units of mixer.c is multiplied in already. */
typedef struct {
    float arm_x_m, arm_y_m;                           /* hub relative to the centre of mass */
    float per_collective, per_torque_x, per_torque_y; /* load of least norm for each of the three */
    float free;     /* loads that change none of the three, per newton of the largest */
    float thrust_n; /* of a unit of load */
    float spin;
    float yaw_n; /* free over per_collective: what yaw takes, as a change of the collective */
} tc_mixer_rotor;

/* What follows from the parameters alone; made once by tc_mixer_configure. */
typedef struct {
    tc_mixer_rotor rotor[TC_ROTORS];
    float free_per_yaw; /* first guess of the multiple of `free` per N m of yaw */
    float turn_per_yaw; /* wanted sum of spin times squared speed, per N m of yaw */
    float unit_m_s;     /* one metre per second */
    float load_factor;  /* 4 a times the thrust of a unit of load */
    float induced;      /* 1 when induced velocity counts in the thrust law, else 0 */
    float least_load;   /* operating points below are extrapolated */
    float axial;        /* linear term of the thrust law per unit of v_z */
    float lateral;      /* 1 when v_xy counts in eq. (2), else 0 */
    float lift;         /* load per squared lateral air speed */
    float still;        /* squared speed of air that stands: keeps the guess and the Newton step finite */
    float per_speed;    /* 1 / 2 a: rad/s per unit of speed */
    float slowest2;     /* squared speed limits */
    float fastest2;
    float near;             /* moves of the free direction that change loads by less are small */
    float guaranteed_yaw;   /* multiple of `free` that yaw has at any rate */
    float largest_thrust_n; /* of all four, hovering */
} tc_mixer;

typedef struct {
    float thrust_n; /* along body z */
    float torque_n_m[3];
} tc_wrench;

/* TC_SINGULAR_GEOMETRY when the four rotors cannot produce an arbitrary wrench. */
tc_reason tc_mixer_configure(tc_mixer* mixer, const tc_parameters* parameters);

/* The air at the hubs, in the mixer's units: along the rotor's axis, and squared across. */
typedef struct {
    float axial[TC_ROTORS], lateral2[TC_ROTORS];
} tc_mixer_flow;

/* air_velocity_body_m_s: of the vehicle through the air, rate_body_rad_s moves the hubs. All finite. */
void tc_mixer_flow_at(const tc_mixer* mixer, const float air_velocity_body_m_s[3], const float rate_body_rad_s[3],
                      tc_mixer_flow* flow);

/* Speeds come out in [rotor_min_rad_s, rotor_max_rad_s]; returns TC_SATURATED_ bits. */
uint8_t tc_mixer_solve(const tc_mixer* mixer, const tc_wrench* wrench, const tc_mixer_flow* flow,
                       float rotor_speed_rad_s[TC_ROTORS]);

/* The other way round: the wrench of rotors that turn at these speeds. `induced`: velocities of the last call, in the
   mixer's units, improved by each call; begin with zero. */
void tc_mixer_wrench(const tc_mixer* mixer, const float rotor_speed_rad_s[TC_ROTORS], const tc_mixer_flow* flow,
                     float induced[TC_ROTORS], tc_wrench* wrench);

#ifdef __cplusplus
}
#endif

#endif
