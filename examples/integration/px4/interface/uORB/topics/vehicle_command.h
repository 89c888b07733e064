#pragma once
#include <stdint.h>
struct vehicle_command_s {
    static constexpr uint32_t VEHICLE_CMD_COMPONENT_ARM_DISARM = 400;
    static constexpr uint32_t VEHICLE_CMD_SET_NAV_STATE = 100001;
    uint64_t timestamp;
    float param1, param2;
    uint32_t command;
    uint16_t source_component;
    uint8_t target_system, target_component, source_system;
};
