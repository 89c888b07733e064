#pragma once
#include <stdint.h>
struct unregister_ext_component_s {
    uint64_t timestamp;
    char name[25];
    int8_t arming_check_id, mode_id;
};
