// Python binding of the batched closed loop; the caller checks shapes and meaning (preflight/core.py).
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "flight.hpp"
#include "own_effect.hpp"
#include "segment.h"

namespace nb = nanobind;
using namespace goshawk;

namespace {

template <class T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T, int N>
using Out = nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;

constexpr std::size_t kDraw = sizeof(Draw) / sizeof(double);
constexpr std::size_t kCommon = 26;

std::uint32_t crc_of(const tc_trajectory_header& header, const std::vector<tc_segment>& segments) {
    std::uint32_t crc = tc_trajectory_header_crc32(&header);
    for (const tc_segment& s : segments) crc = tc_trajectory_segment_crc32(crc, &s, header.coefficient_count);
    return crc;
}

// All flights of one trajectory with one controller.
class Flights {
  public:
    // `common`: see preflight/core.py. Durations and coefficients fit into the store. Of the effects, an empty name is
    // the next of `own`, with which `fly` takes one thread.
    Flights(const std::vector<std::string>& effects, const OwnEffects& own, In<double, 2> hubs, In<double, 1> spin,
            In<float, 1> parameters, In<std::uint32_t, 1> durations_us, In<float, 3> coefficients, float clearance_m,
            In<double, 1> common)
        : model_(effects, hubs.data(), spin.data(), own_effects(own)), setup_(std::make_unique<Setup>()) {
        if (common.shape(0) != kCommon) throw std::invalid_argument("the common row has another length");
        fill(common.data());
        tc_init(&setup_->controller);
        tc_parameters p{};
        std::memcpy(&p, parameters.data(), std::min(parameters.shape(0) * sizeof(float), sizeof p));
        reason_ = tc_parameters_set(&setup_->controller, &p);
        setup_->tracking_m = clearance_m > 0.0f ? clearance_m : p.clearance_m;
        if (reason_ == TC_OK) reason_ = upload(durations_us, coefficients, clearance_m);
    }

    // Why the controller takes neither its parameters nor the trajectory, and in which segment; TC_OK if it does.
    std::tuple<int, int> refused() const {
        return {static_cast<int>(reason_), setup_->controller.store.refused_segment};
    }

    int width() const { return model_.width; }

    // A flight for each row; `seeds` as Seeds; `numbers` those of noise, drop-outs and as many gusts as have `weights`.
    // What is not flown keeps what it is.
    void fly(In<double, 2> values, In<double, 2> draws, In<std::uint64_t, 2> numbers, In<double, 2> weights,
             In<std::uint64_t, 1> seeds, int threads, Out<float, 3> positions, Out<float, 2> errors,
             Out<float, 2> path_s, Out<std::uint8_t, 2> states, Out<double, 2> summaries) const {
        if (draws.shape(1) != kDraw || values.shape(1) != static_cast<std::size_t>(model_.width)) {
            throw std::invalid_argument("rows of draws or values have another length");
        }
        const std::size_t rows = draws.shape(0), gusts = weights.shape(1);
        if (values.shape(0) != rows || numbers.shape(0) != rows || weights.shape(0) != rows || seeds.shape(0) != 3) {
            throw std::invalid_argument("a row of values, of draws, numbers and weights is needed for each flight");
        }
        if (numbers.shape(1) != 2 + gusts) throw std::invalid_argument("each of the gusts' numbers needs a weight");
        const Seeds three{seeds.data()[0], seeds.data()[1], seeds.data()[2]};
        nb::gil_scoped_release release;
        const std::size_t count = rows, most = positions.shape(1);
        std::atomic<std::size_t> next{0};
        const auto work = [&] {
            const auto controller = std::make_unique<tc_controller>();
            for (std::size_t i = next++; i < count; i = next++) {
                Draw draw;
                std::memcpy(&draw, draws.data() + kDraw * i, sizeof draw);
                const std::uint64_t* own = numbers.data() + (2 + gusts) * i;
                const Luck luck{own[0], own[1], own + 2, weights.data() + gusts * i, gusts};
                Flight flight(*setup_, model_, values.data() + values.shape(1) * i, draw, three, luck, *controller);
                const Summary summary = flight.fly([&](std::size_t k, const Sample& s) {
                    if (k >= most) return;
                    std::memcpy(positions.data() + 3 * (most * i + k), s.position_m, sizeof s.position_m);
                    errors.data()[most * i + k] = s.error_m;
                    path_s.data()[most * i + k] = s.path_s;
                    states.data()[most * i + k] = s.state;
                });
                std::memcpy(summaries.data() + kSummary * i, &summary, sizeof summary);
            }
        };
        std::vector<std::thread> others;
        for (int t = 1; t < threads; ++t) others.emplace_back(work);
        work();
        for (std::thread& other : others) other.join();
    }

  private:
    void fill(const double* c) {
        Setup& s = *setup_;
        s.noise = {c[0], c[1], c[2], c[3], c[4], c[5], c[6]};
        s.tick_us = static_cast<std::uint32_t>(c[7]);
        s.sample_every = static_cast<std::uint32_t>(c[8]);
        s.gravity_m_s2 = c[9];
        s.gust_length_m = c[10];
        s.slowest_rad_s = c[11];
        s.fastest_rad_s = c[12];
        std::copy_n(c + 13, 3, s.start_m);
        s.start_yaw_rad = c[16];
        s.settle_s = c[17];
        s.limit_s = c[18];
        s.after_s = c[19];
        s.after_failsafe_s = c[20];
        s.rotor_speed_measured = c[21] != 0.0;
        s.duration_s = c[22];
        s.weakness_at = static_cast<std::size_t>(c[23]);
        s.floor_m = std::max(c[24], -kFar);
        s.ceiling_m = std::min(c[25], kFar);
    }

    tc_reason upload(const In<std::uint32_t, 1>& durations_us, const In<float, 3>& coefficients, float clearance_m) {
        tc_controller* c = &setup_->controller;
        const std::size_t count = durations_us.shape(0), n = coefficients.shape(2);
        std::vector<tc_segment> segments;
        for (std::size_t i = 0; i < count; ++i) {
            segments.push_back(segment_from(durations_us.data()[i], coefficients.data() + TC_AXES * n * i, n));
        }
        tc_trajectory_header header{};
        header.id = 1;
        header.segment_count = static_cast<std::uint16_t>(count);
        header.coefficient_count = static_cast<std::uint8_t>(n);
        header.link_loss_policy = TC_LINK_LOSS_FINISH;
        header.clearance_m = clearance_m;
        header.crc32 = crc_of(header, segments);
        tc_reason reason = tc_upload_begin(c, &header);
        for (std::size_t i = 0; i < count && reason == TC_OK; ++i) {
            reason = tc_upload_segment(c, static_cast<std::uint16_t>(i), &segments[i]);
        }
        if (reason != TC_OK) return reason;
        do reason = tc_upload_finish(c);
        while (reason == TC_BUSY);
        return reason == TC_OK ? tc_upload_activate(c, header.id, header.crc32) : reason;
    }

    Model model_;
    std::unique_ptr<Setup> setup_;
    tc_reason reason_ = TC_OK;
};

}  // namespace

NB_MODULE(_preflight, m) {
    m.attr("DRAW") = kDraw;
    m.attr("COMMON") = kCommon;
    m.attr("SUMMARY") = kSummary;
    nb::class_<Flights>(m, "Flights")
        .def(nb::init<const std::vector<std::string>&, const OwnEffects&, In<double, 2>, In<double, 1>, In<float, 1>,
                      In<std::uint32_t, 1>, In<float, 3>, float, In<double, 1>>())
        .def("refused", &Flights::refused)
        .def_prop_ro("width", &Flights::width)
        .def("fly", &Flights::fly);
}
