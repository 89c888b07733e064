#pragma once
#include <stdint.h>
#define STABILIZER_NR_OF_MOTORS 4
typedef uint32_t stabilizerStep_t;
typedef struct {
    float x, y, z;
} Axis3f;
typedef struct {
    uint32_t timestamp; /* ms */
    float x, y, z;
} point_t;
typedef point_t velocity_t;
typedef struct {
    uint32_t timestamp;
    float roll, pitch, yaw; /* deg */
} attitude_t;
typedef struct {
    float x, y, z, w;
} quaternion_t;
typedef struct {
    Axis3f acc;                  /* g, specific force */
    Axis3f gyro;                 /* deg/s */
    uint64_t interruptTimestamp; /* us */
} sensorData_t;
typedef struct {
    quaternion_t attitudeQuaternion;
    point_t position;    /* m */
    velocity_t velocity; /* m/s */
} state_t;
typedef enum { controlModeForce = 2 } control_mode_t;
typedef struct {
    float normalizedForces[STABILIZER_NR_OF_MOTORS];
    control_mode_t controlMode;
} control_t;
typedef enum { modeDisable = 0, modeAbs, modeVelocity } stab_mode_t;
typedef struct {
    stab_mode_t x, y, z, roll, pitch, yaw;
} setpoint_mode_t;
typedef struct {
    uint32_t timestamp;
    attitude_t attitude, attitudeRate;
    float thrust;
    point_t position;
    velocity_t velocity;
    setpoint_mode_t mode;
} setpoint_t;
