#pragma once
#include <stdint.h>
struct vehicle_status_s {
    static constexpr uint8_t ARMING_STATE_ARMED = 2;
    static constexpr uint8_t NAVIGATION_STATE_AUTO_LAND = 18;
    uint64_t timestamp;
    uint8_t arming_state, nav_state, system_id, component_id;
};
