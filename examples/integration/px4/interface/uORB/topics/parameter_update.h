#pragma once
#include <stdint.h>
struct parameter_update_s {
    uint64_t timestamp;
};
