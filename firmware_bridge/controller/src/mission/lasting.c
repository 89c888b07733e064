/* How long something has been so, in controller time. */
#include "internal.h"

bool tc_lasts(const tc_controller* c, uint64_t since_us, float limit_s) {
    return tc_seconds(c->telemetry.time_us - since_us) > limit_s;
}
