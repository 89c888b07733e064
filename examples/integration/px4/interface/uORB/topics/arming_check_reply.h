#pragma once
#include <stdint.h>
struct arming_check_reply_s {
    static constexpr uint8_t HEALTH_COMPONENT_INDEX_NONE = 0;
    uint64_t timestamp;
    uint8_t request_id, registration_id, health_component_index, num_events;
    bool can_arm_and_run;
    bool mode_req_angular_velocity, mode_req_attitude, mode_req_local_alt, mode_req_local_position;
};
