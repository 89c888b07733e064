/* From when on something carries the vehicle beside its rotors; C and C++, as the preflight asks for it, too. */
#ifndef GOSHAWK_CONTROLLER_STANDING_H
#define GOSHAWK_CONTROLLER_STANDING_H

#include "goshawk_controller/controller.h"

/* Support, m/s2: what it misses of the fall that its thrust would be, on average. An attitude that is not as estimated
 * fakes some beyond 30 degrees. */
static inline float tc_stands_from(const tc_controller* c) {
    const bool upright = c->axes[2][2] > 0.87f;
    return (upright ? 0.25f : 0.3f) * c->parameters.gravity_m_s2;
}

#endif
