#pragma once
#include <stdint.h>
struct arming_check_request_s {
    uint64_t timestamp;
    uint32_t valid_registrations_mask;
    uint8_t request_id;
};
