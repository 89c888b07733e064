// What the controller is told of the true state: late, noisy, biased, and sometimes nothing new.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "goshawk_controller/goshawk_controller.h"
#include "motion.hpp"
#include "random.hpp"

namespace goshawk {

// Standard deviations of white noise on each sample, and the delay that the time stamps tell.
struct Noise {
    double position_m, velocity_m_s, attitude_rad, rate_rad_s, specific_force_m_s2, rotor_speed_rad_s, told_delay_s;
};

// Of one flight.
struct Localization {
    double delay_s;  // true age of a pose; what the stamp does not tell is the difference to `told_delay_s`
    double bias_m[3], heading_bias_rad;
    double drop_outs_per_s, drop_out_s;
    double jump_m[3];
};

// What may befall the pose now.
struct Disturbed {
    bool drops_out, jumped;
};

class Sensing {
  public:
    struct Given {
        const Noise& noise;
        const Localization& localization;
        std::uint32_t tick_us;
        bool rotor_speed_measured;
    };

    Sensing(const Given& given, Random& random, Random& gaps)
        : noise_(given.noise),
          localization_(given.localization),
          tick_us_(given.tick_us),
          rotor_speed_measured_(given.rotor_speed_measured),
          random_(random),
          gaps_(gaps) {
        const double ticks = localization_.delay_s * 1e6 / tick_us_;
        whole_ = static_cast<std::size_t>(ticks);
        part_ = ticks - static_cast<double>(whole_);
        past_.resize(13 * (whole_ + 2));
    }

    // The true state `x` of a tick, which calls must follow each other by `tick_us` but for the first.
    void keep(const double* x) {
        if (count_ == 0) {
            for (std::size_t i = 0; i < whole_ + 2; ++i) std::memcpy(row(i), x, 13 * sizeof *x);
        }
        std::memcpy(row(count_ % (whole_ + 2)), x, 13 * sizeof *x);
        ++count_;
    }

    tc_estimate estimate(std::uint64_t time_us, const double* x, const double specific_force[3], Disturbed now) {
        tc_estimate e{};
        e.valid = TC_VALID_ALL;
        e.rate_time_us = time_us;
        pose(time_us, now, e);
        for (int k = 0; k < 3; ++k) {
            e.rate_body_rad_s[k] = noisy(x[10 + k], noise_.rate_rad_s);
            e.specific_force_body_m_s2[k] = noisy(specific_force[k], noise_.specific_force_m_s2);
        }
        if (rotor_speed_measured_) {
            e.valid = TC_VALID_ALL | TC_VALID_ROTOR_SPEED;
            for (int i = 0; i < TC_ROTORS; ++i) e.rotor_speed_rad_s[i] = noisy(x[13 + i], noise_.rotor_speed_rad_s);
        }
        return e;
    }

  private:
    double* row(std::size_t i) { return past_.data() + 13 * i; }

    float noisy(double value, double std) {
        return static_cast<float>(std > 0.0 ? value + std * random_.normal() : value);
    }

    // In a drop-out the last pose comes again, with its old stamp.
    void pose(std::uint64_t time_us, Disturbed now, tc_estimate& e) {
        if (now.drops_out && localization_.drop_outs_per_s > 0.0 && time_us >= until_us_ &&
            gaps_.uniform() < localization_.drop_outs_per_s * 1e-6 * tick_us_) {
            until_us_ = time_us + static_cast<std::uint64_t>(localization_.drop_out_s * 1e6);
        }
        if (time_us >= until_us_ || stamp_us_ == 0) measure(time_us, now.jumped);
        e.position_time_us = e.attitude_time_us = stamp_us_;
        std::memcpy(e.position_world_m, position_m_, sizeof position_m_);
        std::memcpy(e.velocity_world_m_s, velocity_m_s_, sizeof velocity_m_s_);
        std::memcpy(e.q_world_body, q_, sizeof q_);
    }

    void measure(std::uint64_t time_us, bool jumped) {
        const std::size_t size = whole_ + 2;
        const double* newer = row((count_ + size - 1 - whole_) % size);
        const double* older = row((count_ + size - 2 - whole_) % size);
        double seen[10];
        for (int k = 0; k < 10; ++k) seen[k] = newer[k] + part_ * (older[k] - newer[k]);
        stamp_us_ = time_us - static_cast<std::uint64_t>(noise_.told_delay_s * 1e6);
        for (int k = 0; k < 3; ++k) {
            const double lie = localization_.bias_m[k] + (jumped ? localization_.jump_m[k] : 0.0);
            position_m_[k] = noisy(seen[k] + lie, noise_.position_m);
            velocity_m_s_[k] = noisy(seen[3 + k], noise_.velocity_m_s);
        }
        attitude(seen + 6);
    }

    // The attitude turned by the noise in body axes and by the heading bias about world z, to first order.
    void attitude(const double* q) {
        const double h = 0.5 * localization_.heading_bias_rad;
        const double x = 0.5 * noise_.attitude_rad * random_.normal(), y = 0.5 * noise_.attitude_rad * random_.normal(),
                     z = 0.5 * noise_.attitude_rad * random_.normal();
        const double a[4] = {q[0] - h * q[3], q[1] - h * q[2], q[2] + h * q[1], q[3] + h * q[0]};
        const double b[4] = {a[0] - x * a[1] - y * a[2] - z * a[3], a[1] + x * a[0] + z * a[2] - y * a[3],
                             a[2] + y * a[0] - z * a[1] + x * a[3], a[3] + z * a[0] + y * a[1] - x * a[2]};
        const double scale = 1.0 / std::sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2] + b[3] * b[3]);
        for (int k = 0; k < 4; ++k) q_[k] = static_cast<float>(b[k] * scale);
    }

    const Noise& noise_;
    const Localization& localization_;
    std::uint32_t tick_us_;
    bool rotor_speed_measured_;
    Random &random_, &gaps_;
    std::vector<double> past_;  // a ring of true states
    std::size_t whole_ = 0, count_ = 0;
    double part_ = 0.0;
    std::uint64_t until_us_ = 0, stamp_us_ = 0;
    float position_m_[3] = {}, velocity_m_s_[3] = {}, q_[4] = {1.0f, 0.0f, 0.0f, 0.0f};
};

}  // namespace goshawk
