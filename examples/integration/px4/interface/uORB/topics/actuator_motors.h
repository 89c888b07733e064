#pragma once
#include <stdint.h>
struct actuator_motors_s {
    static constexpr uint8_t ACTUATOR_FUNCTION_MOTOR1 = 101;
    static constexpr uint8_t NUM_CONTROLS = 12;
    uint64_t timestamp, timestamp_sample;
    float control[12];
    uint16_t reversible_flags;
};
