/* What the parts of the controller share. Internal. */
#ifndef GOSHAWK_CONTROLLER_INTERNAL_H
#define GOSHAWK_CONTROLLER_INTERNAL_H

#include "goshawk_controller/controller.h"

enum { TC_FAULT_POSITION_STALE = 1, TC_FAULT_POSITION_BAD = 2, TC_FAULT_ATTITUDE_STALE = 4, TC_FAULT_ATTITUDE_BAD = 8 };

/* estimate.c: takes what is usable of `estimate`, carries it forward to `time_us` into telemetry.estimate, and returns
   the fault bits. */
uint8_t tc_take_estimate(tc_controller* c, uint64_t time_us, float step_s, const tc_estimate* estimate);

/* transitions.c: posts an event; when the state changes, prepares the set-point source of the new one. */
tc_reason tc_post(tc_controller* c, uint8_t event, tc_reason reason);
/* Looks for everything that may change the state by itself, after the set-point has been advanced. */
void tc_observe(tc_controller* c, uint8_t faults);
/* Changes the rate of the path clock, so slowly that braking stays within brake_m_s2. */
void tc_change_rate(tc_controller* c, float rate);

bool tc_inside_fence(const tc_parameters* p, const float position_world_m[3]);

#endif
