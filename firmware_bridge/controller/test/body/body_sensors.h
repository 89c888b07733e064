/* What an autopilot's estimator would tell of the body: a pose at its own rate and delay, gyro and accelerometer at
   every tick, noise, slow errors, and faults that the flight switches on and off. Fills tc_estimate as its header says.

   The estimator's frame is the world turned by `yaw_rad` about z, then moved by `shift_m`; relocalization moves it. */
#ifndef BODY_SENSORS_H
#define BODY_SENSORS_H

#include "body.h"
#include "goshawk_controller/goshawk_controller.h"

#define BODY_QUEUE 64 /* poses on their way: delay times rate must stay below */

typedef struct {
    double pose_rate_hz, delay_s;
    double position_noise_m, velocity_noise_m_s, attitude_noise_rad, gyro_noise_rad_s, accelerometer_noise_m_s2;
    double vibration_m_s2;                   /* of the accelerometer at hover speed; grows with its square */
    double height_wander_m, height_wander_s; /* slow sine of the estimated height, and its period */
    double vertical_bias_m_s;                /* of the estimated vertical velocity */
    double tilt_error_rad[2];                /* of the estimated attitude, about body x and y */
    double accelerometer_bias_m_s2[3], gyro_bias_rad_s[3];
    double position_std_m, velocity_std_m_s;           /* as told to the controller; 0 = not told */
    double battery_v;                                  /* 0 = not measured */
    int32_t has_specific_force, has_vertical_velocity; /* 0 or 1 */
} body_sensors_config;

/* How a part of the estimate is lost. */
typedef enum {
    BODY_GOOD = 0,
    BODY_FROZEN = 1,    /* values and stamps stop */
    BODY_NOT_VALID = 2, /* the valid bits are cleared, under fresh stamps; what is not valid is not a number */
    BODY_NAN = 3,       /* not numbers, under fresh stamps, marked valid */
    BODY_NO_XY = 4      /* of a position only the horizontal bits are cleared; not for the others */
} body_loss;

typedef struct {
    uint64_t deliver_us; /* true time */
    tc_estimate estimate;
} body_pose;

typedef struct {
    body_sensors_config config;
    body_loss position, attitude, rate;
    double shift_m[3], yaw_rad;
    double drift_m_s[3];
    double pose_stamp_offset_s; /* stamps on a clock of their own */
    double pose_age_s;          /* position and velocity are stamped earlier by this */
    double heading_rad;         /* by which the attitude alone is turned about the world's z axis */
    double velocity_error_m_s[3];
    bool stuck;         /* position and velocity repeat, under fresh stamps */
    int32_t bad_axis;   /* of the gyro, whose value is not a number; -1: none */
    int32_t bad_rotor;  /* whose measured speed is replaced; -1: none */
    double rotor_rad_s; /* ... by this */
    uint8_t reset_counter;
    double reset_position_m[3], reset_velocity_m_s[3], reset_yaw_rad;
    uint64_t next_pose_us;
    body_pose queue[BODY_QUEUE];
    uint32_t queued, delivered;
    tc_estimate latest; /* the last pose that was delivered while nothing was lost */
    body_random random;
} body_sensors;

void body_sensors_default(body_sensors_config* config);
void body_sensors_init(body_sensors* s, const body_sensors_config* config, uint64_t seed);

/* The frame jumps by this much as seen by the estimate. `counted`: by how much the reset counter grows: 0 = the
   estimator does not know, 2 = of two jumps only the second half was recorded. */
void body_sensors_jump(body_sensors* s, const body* b, const double jump_m[3], double yaw_rad, uint8_t counted);

/* The estimate at true time `time_us`, which the controller's clock reads as `clock_us`. */
void body_sensors_read(body_sensors* s, const body* b, uint64_t time_us, uint64_t clock_us, double step_s,
                       tc_estimate* out);

#endif
