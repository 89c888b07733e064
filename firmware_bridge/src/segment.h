// A segment of a trajectory from Python's numbers; also for preflight/src.
#pragma once

#include <cstddef>
#include <cstdint>

#include "goshawk_controller/goshawk_controller.h"

// `coefficients`: (TC_AXES, count); those beyond what the controller holds are left out.
inline tc_segment segment_from(std::uint32_t duration_us, const float* coefficients, std::size_t count) {
    tc_segment s{};
    s.duration_us = duration_us;
    for (std::size_t axis = 0; axis < TC_AXES; ++axis) {
        for (std::size_t j = 0; j < count && j < TC_MAX_COEFFICIENTS; ++j) {
            s.coefficient[axis][j] = coefficients[axis * count + j];
        }
    }
    return s;
}
