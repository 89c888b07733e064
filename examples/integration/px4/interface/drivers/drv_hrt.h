#pragma once
#include <stdint.h>
typedef uint64_t hrt_abstime;
/* The test's clock. */
inline hrt_abstime& interface_clock() {
    static hrt_abstime now_us = 1000000;
    return now_us;
}
inline hrt_abstime hrt_absolute_time() { return interface_clock(); }
