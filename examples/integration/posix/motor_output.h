/* The process that owns the rotors. It takes rotor speeds from the controller, and stops the rotors by itself when none
   have come for MOTOR_WATCHDOG_US: the controller's process may hang, be stopped or killed at any time.

   Here it turns the rotors of a SIMULATED body (simulated_body.h) and sends back what a perfect estimator would see.
   On a vehicle it is the driver of the ESCs, and the estimator is another program. */
#ifndef MOTOR_OUTPUT_H
#define MOTOR_OUTPUT_H

#include <stdint.h>

#include "goshawk_controller/goshawk_controller.h"

/* Longest time without a command. The controller's period is 2 ms; a process without real-time priority on a busy
   machine may have to wait for tens of milliseconds. With SCHED_FIFO on a vehicle take 20 ms. */
#define MOTOR_WATCHDOG_US 100000u

typedef struct {
    float rotor_speed_rad_s[TC_ROTORS];
} motor_command;

typedef struct {
    tc_estimate estimate;
} motor_sample;

/* The clock of everything here. It does not jump when somebody sets the date. */
uint64_t now_us(void);

/* Serves one controller on this socket until it is gone and the rotors stand. With `print`, one line every 20 ms:
   "body <time_s> <height_m> <vertical speed_m_s> <mean rotor speed_rad_s>". */
int motor_output_run(int socket_to_controller, bool print);

#endif
