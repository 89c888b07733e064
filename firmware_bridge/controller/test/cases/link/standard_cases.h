/* What the case files of standard ground stations share: the vehicle of link_cases.h with PILOT in control. */
#ifndef STANDARD_CASES_H
#define STANDARD_CASES_H

#include <stdint.h>

enum { REQUEST = 512 }; /* MAV_CMD_REQUEST_MESSAGE */

/* On the ground; hovering at 1 m. */
void standard_begin(void);
void standard_hovering(void);

/* The mode in a heartbeat on request, and one of PX4's as its heartbeats have it. */
uint32_t mode_shown(void);
uint32_t px4_mode(uint32_t main, uint32_t sub);

#endif
