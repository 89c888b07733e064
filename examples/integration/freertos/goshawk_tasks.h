/* Goshawk as FreeRTOS tasks: control at 500 Hz, link at 200 Hz, and a watchdog above both. Call goshawk_tasks_start
   once, before the scheduler; write the six board functions below. */
#ifndef GOSHAWK_TASKS_H
#define GOSHAWK_TASKS_H

#include <stdbool.h>

#include "goshawk_controller/goshawk_controller.h"
#include "goshawk_controller/link.h"

/* False when the parameters are refused; `reason` names the cause. `config` stays yours and stays where it is. */
bool goshawk_tasks_start(const tc_parameters* parameters, const tc_link_config* config, tc_reason* reason);

/* Longest time without a finished tick before the watchdog stops the rotors, for good: until the next reset. */
#define GOSHAWK_WATCHDOG_MS 20u

/* Your board. Each returns at once.
   board_time_us       a 64-bit microsecond timer that never jumps
   board_estimate      the newest output of your estimator, and what the ESCs report of the rotors; its old content
   stands where nothing new has come board_rotor_speeds  to the ESCs: rad/s; their throttle curve is yours board_receive
   up to `size` bytes of the radio, how many there were board_send          a frame to the radio; false when it has no
   room, the frame is then lost The watchdog calls board_rotor_speeds too, from a task of higher priority. */
uint64_t board_time_us(void);
void board_estimate(tc_estimate* estimate);
void board_rotor_speeds(const float rotor_speed_rad_s[TC_ROTORS]);
size_t board_receive(uint8_t* bytes, size_t size);
bool board_send(const uint8_t* frame, size_t size);

#endif
