#pragma once
#include <stdint.h>
struct register_ext_component_reply_s {
    static constexpr uint8_t ORB_QUEUE_LENGTH = 2;
    uint64_t timestamp, request_id;
    bool success;
    int8_t arming_check_id, mode_id;
};
