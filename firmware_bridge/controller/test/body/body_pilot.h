/* The other controller of engage and release: flies the body at a velocity, knows the truth, shares no code. */
#ifndef BODY_PILOT_H
#define BODY_PILOT_H

#include "body.h"

void body_pilot(const body* b, const double velocity_m_s[3], double speed_rad_s[BODY_ROTORS]);

#endif
