// Effects of the user's own, in Python, as the kernel calls them.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <utility>
#include <vector>

#include "model.hpp"

namespace goshawk {

using Mirror = nanobind::ndarray<double, nanobind::shape<60>, nanobind::c_contig, nanobind::device::cpu>;
using OwnEffects = std::vector<std::pair<nanobind::callable, Mirror>>;

// A Python function without arguments that works on `mirror`, a copy of the flow as 60 numbers in the order of
// Flow<double>.
inline OwnEffect own_effect(nanobind::callable function, Mirror mirror) {
    static_assert(sizeof(Flow<double>) == 60 * sizeof(double), "vehicle/native.py knows the order of these numbers");
    return [function, mirror](Flow<double>& flow) {
        nanobind::gil_scoped_acquire acquire;
        std::memcpy(mirror.data(), &flow, sizeof(flow));
        function();
        std::memcpy(static_cast<void*>(&flow), mirror.data(), sizeof(flow));
    };
}

inline std::vector<OwnEffect> own_effects(const OwnEffects& given) {
    std::vector<OwnEffect> effects;
    for (const auto& [function, mirror] : given) effects.push_back(own_effect(function, mirror));
    return effects;
}

}  // namespace goshawk
