/* Every number that can be set: the vehicle's geometry and model, the gains, the limits. All float, all in SI, so that
   the table (name, smallest, largest, default) can be walked by MAVLink's PARAM_* messages and set as one block:

       tc_parameters next = *tc_parameters_now(controller);
       tc_parameters_put(&next, tc_parameters_find("mass_kg"), 0.72f);
       reason = tc_parameters_set(controller, &next);     // all of it or nothing, between two ticks

   Compensation parameters mirror the effects of the vehicle model; zero switches an effect off. */
#ifndef GOSHAWK_CONTROLLER_PARAMETERS_H
#define GOSHAWK_CONTROLLER_PARAMETERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "goshawk_controller/reason.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TC_ROTORS 4
#define TC_PARAMETER_NAME_SIZE 17 /* 16 characters, as in MAVLink, and the closing zero */

typedef enum { TC_THRUST_QUADRATIC = 0, TC_THRUST_BEM_AXIAL = 1, TC_THRUST_BEM = 2 } tc_thrust_model;
typedef enum { TC_VELOCITY_NONE = 0, TC_VELOCITY_SETPOINT = 1, TC_VELOCITY_ESTIMATE = 2 } tc_velocity_source;
typedef enum { TC_ATTITUDE_TILT = 0, TC_ATTITUDE_LEE = 1 } tc_attitude_mode;

typedef struct {
    /* Rigid body. */
    float mass_kg;
    float gravity_m_s2;
    float inertia_kg_m2[3];    /* principal, about body x, y, z */
    float centre_of_mass_m[2]; /* dx, dy of eq. (3), in the frame of the rotor positions */

    /* Rotors: hub positions (body x forward, y left) and spin: +1 when the rotor's drag torque on the body is +z. */
    float rotor_x_m[TC_ROTORS];
    float rotor_y_m[TC_ROTORS];
    float rotor_spin[TC_ROTORS];
    float rotor_gain[TC_ROTORS]; /* true thrust over model thrust, 1 for a healthy rotor */

    /* Thrust, eqs. (1)-(3). For TC_THRUST_QUADRATIC T = quad_n_s2 n^2 - inflow_kg n v_z. */
    float thrust_model; /* tc_thrust_model */
    float k1_n_s2;
    float k2_n_s2_m;
    float quad_n_s2;
    float inflow_kg; /* with TC_THRUST_QUADRATIC: - inflow n v_z, the linear form of inflow */
    float air_density_kg_m3;
    float disk_area_m2;
    float cq_n_m_s2;
    float rotor_min_rad_s; /* the idle floor in flight */
    float rotor_max_rad_s;
    float rotor_idle_rad_s; /* armed on the ground */

    /* Effects that the controller cancels. */
    float rotor_drag_s_m;         /* eq. (4), c_dh: scales with thrust */
    float rotor_drag_kg;          /* the rival form: scales with rotor speed, acts at the hubs */
    float parasitic_kg_m[3];      /* eq. (5), per axis: c_i |v_i| v_i */
    float parasitic_norm_kg_m[3]; /* the rival form: c_i |v| v_i */
    float lift_kg_m;              /* translational lift per rotor: + k |v_xy|^2 */
    float flapping_kg_m;          /* moment -k n (v x e3) per rotor */
    float damping_n_m_s[3];       /* moment -D w */
    float battery_reference_v;    /* rotors turn slower by battery_gain per volt below this; 0 V measured = off */
    float battery_gain_1_v;
    float rotor_lag_s;      /* the speed command leads the wanted speed by this lag; 0 = off */
    float lead_filter_s;    /* noise filter of that lead */
    float drag_velocity;    /* tc_velocity_source of (4)-(5) and the rival forms */
    float airflow_velocity; /* tc_velocity_source of v_z, v_xy in (1)-(2) and of lift, flapping */

    /* Position loop, eq. (9), per unit mass: Kp = m kp. */
    float kp_xy_1_s2;
    float kp_z_1_s2;
    float kd_xy_1_s;
    float kd_z_1_s;
    float ki_xy_1_s3;
    float ki_z_1_s3;
    float integral_m_s2;   /* largest correction by the integrator */
    float integral_gate_m; /* integrates only while the position error is below this */
    float feedback_m_s2;   /* largest acceleration that feedback may add */

    /* Attitude loop. */
    float attitude_mode; /* tc_attitude_mode */
    float att_kp_xy_1_s2;
    float att_kp_z_1_s2;
    float att_kd_xy_1_s;
    float att_kd_z_1_s;
    float feed_rate;       /* 1: body-rate feed-forward from jerk and yaw rate, 0: none */
    float feed_torque;     /* 1: angular-acceleration feed-forward from snap, 0: none */
    float tilt_slew_rad_s; /* how fast the reference axis may turn */
    float yaw_slew_rad_s;  /* how fast the reference may turn about that axis */
    float yaw_share;       /* share of its authority that yaw keeps under saturation, 0 .. 0.5 */
    float predict_max_s;   /* the estimate is carried forward to the tick, at most this far; 0 = off */
    float predict_extra_s; /* delay of the estimate beyond its own time stamp */

    /* Disturbance observer (observer.h). */
    float observer;          /* 1: what it finds is cancelled, 0: it is off */
    float observer_force_hz; /* cut-off frequencies */
    float observer_torque_hz;
    float observer_fuse_rad_s;  /* below, the estimated velocity tells the acceleration, above, the accelerometer */
    float observer_force_m_s2;  /* largest force, per mass, */
    float observer_turn_rad_s2; /* ... and torque, per inertia, that it may find */

    /* Limits and the mission. */
    float fence_min_world_m[3];
    float fence_max_world_m[3];
    float path_speed_m_s;
    float path_acceleration_m_s2;
    float path_jerk_m_s3;
    float path_yaw_rate_rad_s;
    float start_radius_m; /* the trajectory must start this close to the hover point */
    float brake_m_s2;     /* largest slowing-down along the path when pausing */
    float take_off_m_s;
    float landing_m_s;
    float estimate_stale_s;
    float tilt_error_rad; /* emergency beyond this attitude error ... */
    float tilt_error_s;   /* ... for this long */
    float link_loss_s;
    float link_hold_s;    /* hovering without a link, land after this */
    float emergency_sink; /* thrust over weight in the emergency descent */
    float emergency_s;    /* rotors off after this long in the emergency descent, where nothing tells of the ground */
    float gyro_hold_s;    /* without attitude: level on the gyro alone for this long, then rotors off */
    float reckoning_s;    /* without position: brakes on dead reckoning for this long, then the emergency descent */
    float position_std_m; /* a position whose standard deviation is larger counts as lost */
    float velocity_std_m_s;
    float clearance_m;   /* tracking error that counts as too large where a trajectory states no clearance */
    float hold_error_m;  /* the same while hovering or landing */
    float plan_margin_m; /* a flown trajectory's own box and this margin are a fence; 0 = none */
    float monitor;       /* 1: the pose is checked against the IMU; 0: believed */
    float battery_arm_v; /* arming is refused below; 0 = not asked, as for the next two */
    float battery_warn_v;
    float battery_land_v; /* lands below */
} tc_parameters;

uint16_t tc_parameters_count(void);
const char* tc_parameters_name(uint16_t index); /* "" beyond the table */
const char* tc_parameters_unit(uint16_t index); /* "1": dimensionless; "" beyond the table */
bool tc_parameters_in_flight(uint16_t index);   /* whether it may change in the air */
/* What differs: TC_CHANGES_GROUND, some that may change on the ground only; TC_CHANGES_LIMIT, some that trajectories
   are checked by at upload. */
uint8_t tc_parameters_changes(const tc_parameters* before, const tc_parameters* after);
enum { TC_CHANGES_GROUND = 1, TC_CHANGES_LIMIT = 2 };
/* False beyond the table, with nothing written. */
bool tc_parameters_range(uint16_t index, float* smallest, float* largest, float* preset);
int32_t tc_parameters_find(const char* name); /* -1 when there is none; reads at most 16 characters */

void tc_parameters_default(tc_parameters* parameters);
float tc_parameters_get(const tc_parameters* parameters, uint16_t index); /* 0 beyond the table */
/* Refuses an unknown index, a value that is not finite or out of range. */
tc_reason tc_parameters_put(tc_parameters* parameters, uint16_t index, float value);
/* Every value finite and in its range; `index` (may be NULL) tells the first that is not. */
tc_reason tc_parameters_check(const tc_parameters* parameters, uint16_t* index);
/* CRC-32 over all values as little-endian float32 in table order. */
uint32_t tc_parameters_crc32(const tc_parameters* parameters);

#ifdef __cplusplus
}
#endif

#endif
