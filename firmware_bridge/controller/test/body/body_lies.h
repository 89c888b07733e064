/* Sensors that lie under fresh stamps, and a hand that carries the vehicle about. */
#ifndef BODY_LIES_H
#define BODY_LIES_H

#include "body_flight.h"

void body_lie(body_sensors* s, const body_fault* fault);
/* Back to the truth, for the kinds that end. */
void body_lie_ends(body_sensors* s, const body_sensors_config* normal, int32_t kind);
/* For a step the body moves as the hand does, whatever the rotors do: m/s, and rad/s about body x. */
void body_carry(body* b, const double hand[4], double step_s);

#endif
