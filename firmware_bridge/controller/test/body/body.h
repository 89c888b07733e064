/* A simulated body to judge failsafes by: a quadrotor, the air and a floor, in double precision.

   It shares no code with the controller nor with the `vehicle` package: only the numbers of Rigter et al. (2019) are
   the same. SI units; world z up; body x forward, y left, z up; quaternion w x y z, body to world. Heights of the floor
   are given for the centre of mass of a vehicle that stands there. */
#ifndef BODY_H
#define BODY_H

#include <stdbool.h>
#include <stdint.h>

#define BODY_ROTORS 4
#define BODY_POINTS 8 /* where it can touch the floor: four feet, four points above the rotors */

typedef struct {
    double mass_kg, gravity_m_s2;
    double inertia_kg_m2[3];
    double centre_of_mass_m[2]; /* in the frame of the rotor positions */
    double rotor_x_m[BODY_ROTORS], rotor_y_m[BODY_ROTORS];
    double spin[BODY_ROTORS]; /* +1: the rotor's drag torque on the body points along +z */
    double k1_n_s2, k2_n_s2_m, cq_n_m_s2;
    double air_density_kg_m3, disk_area_m2;
    double rotor_drag_s_m;    /* lateral drag per newton of thrust */
    double parasitic_kg_m[3]; /* -c |v| v per body axis */
    double rotor_lag_s, rotor_max_rad_s;
    double ground_effect; /* T / (1 - g (R / 4 h)^2) */
    double foot_m[3];     /* |x|, |y| of the feet, and how far they are below the centre of mass */
    double top_m[3];      /* the same of the points above */
    double contact_n_m, contact_n_s_m, friction;
} body_vehicle;

typedef struct {
    double floor_m;  /* at x = y = 0 */
    double slope[2]; /* rise per metre along x and y */
    double bump_m, bump_length_m;
    /* A table or a roof: a block that stands on the floor. None where min >= max. */
    double plate_m, plate_min_m[2], plate_max_m[2];
    double wind_m_s[3], gust_std_m_s, gust_time_s;
} body_world;

/* What the judge asks for. */
typedef struct {
    int32_t touchdowns; /* first contacts after at least 0.1 s with more than 5 cm of clearance */
    double first_touchdown_m_s, first_touchdown_s, hardest_touchdown_m_s, hardest_touchdown_s;
    double last_airborne_s; /* when it was last well clear of everything */
    double largest_tilt_rad, largest_speed_m_s;
    double rest_s; /* how long it has been lying still with its rotors stopped */
    double time_s;
} body_record;

typedef struct {
    uint64_t state;
} body_random;

typedef struct {
    body_vehicle vehicle;
    body_world world;
    double position_m[3], velocity_m_s[3], q[4], rate_rad_s[3], rotor_rad_s[BODY_ROTORS];
    double health[BODY_ROTORS]; /* true thrust and torque over those of a good rotor; 0: it has stopped */
    double wind_m_s[3];         /* now: mean and noise */
    double gust_m_s[3];         /* added to it by the harness */
    bool blocked;               /* something holds the vehicle at: horizontally, a spring of 60 N/m */
    double block_m[2];
    double specific_force_m_s2[3]; /* mean over the last step, body axes */
    bool touching;
    bool airborne;  /* has been well clear of everything since the last contact */
    double clear_s; /* how long it has been more than 5 cm away from everything */
    body_random random;
    body_record record;
} body;

/* Of close seeds and streams the sequences have nothing in common: a state that goes with the seed would make each the
   next one's, some draws on. */
void body_seed(body_random* random, uint64_t seed, uint64_t stream);
double body_uniform(body_random* random); /* [0, 1) */
double body_normal(body_random* random);  /* mean 0, standard deviation 1 */

void body_vehicle_default(body_vehicle* vehicle); /* Rigter et al. (2019), Table I */
/* Stands at x = y = 0 on whatever is there, rotors stopped. */
void body_init(body* b, const body_vehicle* vehicle, const body_world* world, uint64_t seed);
/* In the air instead: hovering, moving. */
void body_place(body* b, const double position_m[3], const double velocity_m_s[3]);
/* Holds the commanded rotor speeds for `step_s`; integrates in substeps of at most 0.5 ms. */
void body_step(body* b, const double command_rad_s[BODY_ROTORS], double step_s);

/* Distance of the lowest point of the body from what is under it; negative when pressed in. */
double body_clearance_m(const body* b);
double body_tilt_rad(const body* b);
void body_to_body(const double q[4], const double world[3], double out[3]);
void body_to_world(const double q[4], const double in_body[3], double out[3]);
void body_turn(const double q[4], const double turn_rad[3], double out[4]); /* q times the turn, body axes */

/* Thrust of one rotor by blade element and momentum theory; the induced velocity is bracketed, not iterated freely.
   `axial_m_s` is the speed along body z through the air, `lateral_m_s` across it. */
double body_rotor_thrust_n(const body_vehicle* vehicle, double rotor_rad_s, double axial_m_s, double lateral_m_s);

#endif
