#pragma once
#include <stdint.h>
struct register_ext_component_request_s {
    static constexpr uint16_t LATEST_PX4_ROS2_API_VERSION = 1;
    uint64_t timestamp, request_id;
    uint16_t px4_ros2_api_version;
    char name[25];
    bool register_arming_check, register_mode;
};
