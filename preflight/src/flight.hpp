// One closed-loop flight of the C controller on the vehicle's dynamics, from hover to hover.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "gusts.hpp"
#include "sensing.hpp"
#include "standing.h"

namespace goshawk {

enum Ending { kFinished = 0, kFailsafe = 1, kNotStarted = 2, kTimedOut = 3, kDiverged = 4, kEndings };

// What all flights have in common.
struct Setup {
    tc_controller controller;  // configured, with the trajectory active, never ticked
    Noise noise;
    std::uint32_t tick_us;
    std::uint32_t sample_every;  // ticks
    double gravity_m_s2, gust_length_m;
    double tracking_m;          // error beyond which the controller gives the trajectory up
    double floor_m, ceiling_m;  // heights; far away for none
    double duration_s;          // of the trajectory
    std::size_t weakness_at;    // of the first rotor's loss of thrust among the values
    bool rotor_speed_measured;
    double slowest_rad_s, fastest_rad_s;  // limits of the rotors, for the reserve
    double start_m[3], start_yaw_rad;
    double settle_s, limit_s;          // hover before; longest flight
    double after_s, after_failsafe_s;  // how long one goes on after it has ended
};

// What is one flight's own, in the order of preflight/core.py.
struct Draw {
    double wind_m_s[3], gust_std_m_s;
    Localization localization;
    double start_m[3], start_yaw_rad;
    double hover_rad_s[4];
    double battery_v, battery_fall_v_j;         // at the beginning, and by the energy drawn, ...
    double battery_empty_v;                     // ... to no less
    double fault_rotor, fault_at, fault_ratio;  // which one loses how much of its thrust, and when: share of the plan
    double jump_at;                             // when the pose begins to lie: share of the plan
    double updraft_m_s;                         // at the height `kThermal`
};

struct Sample {
    float position_m[3], error_m, path_s;
    std::uint8_t state;
};

struct Summary {
    double ending, state, reason, ended_s;
    double tilt_rad, fell;  // of the whole flight: what follows its end, too
    double reserve, energy_j, flown_s;
    double strain;  // how near the controller came to giving up: 1 where it has cause to
};
constexpr int kSummary = sizeof(Summary) / sizeof(double);

// Seeds of what comes anew in every flight; one can be changed alone.
struct Seeds {
    std::uint64_t noise, air, drop_outs;
};

// Numbers of what comes anew in one flight; its gusts are a sum of `count` numbers' with their weights.
struct Luck {
    std::uint64_t noise, drop_outs;
    const std::uint64_t* gusts;
    const double* weights;
    std::size_t count;
};

class Flight {
  public:
    Flight(const Setup& setup, const Model& model, const double* values, const Draw& draw, const Seeds& seeds,
           const Luck& luck, tc_controller& controller)
        : setup_(setup),
          model_(model),
          values_(values, values + model.width),
          draw_(draw),
          controller_(controller),
          body_(rigid_body(model, values)),
          noise_(seeds.noise, luck.noise, 1),
          drop_outs_(seeds.drop_outs, luck.drop_outs, 3),
          air_(seeds.air, luck.gusts, luck.weights, luck.count, 2),
          gusts_(draw.gust_std_m_s, setup.gust_length_m, along(draw).unit, air_),
          sensing_({setup.noise, draw.localization, setup.tick_us, setup.rotor_speed_measured}, noise_, drop_outs_),
          step_s_(setup.tick_us * 1e-6),
          world_{{0.0, 0.0, 0.0}, 0.0, setup.floor_m, setup.ceiling_m} {
        controller_ = setup.controller;
        place();
    }

    // Calls `sample` from the hover before the start on.
    template <class Samples>
    Summary fly(Samples&& sample) {
        stand();
        if (tc_engage(&controller_, rotors()) != TC_OK) return gave_up(kNotStarted, controller_.mission.reason);
        began_s_ = time_us_ * 1e-6;
        const std::size_t hover = ticks_in(setup_.settle_s), most = hover + ticks_in(setup_.limit_s);
        for (std::size_t i = 0; i < most; ++i) {
            if (i == hover && ending_ < 0) {
                const tc_reason refused = start();
                if (refused != TC_OK) return gave_up(kNotStarted, refused);
            }
            tick();
            watch();
            if (i % setup_.sample_every == 0) sample(i / setup_.sample_every, now());
            if (!std::isfinite(x_[0] + x_[1] + x_[2])) return gave_up(kDiverged, TC_NOT_FINITE);
            if (ending_ >= 0 && time_us_ * 1e-6 >= ended_s_ + after_s()) break;
        }
        return ending_ >= 0 ? whole() : gave_up(kTimedOut, TC_TIMEOUT);
    }

  private:
    struct Along {
        double unit[2];
    };
    static Along along(const Draw& draw) {
        const double size = std::sqrt(draw.wind_m_s[0] * draw.wind_m_s[0] + draw.wind_m_s[1] * draw.wind_m_s[1]);
        if (!(size > 0.0)) return {{1.0, 0.0}};
        return {{draw.wind_m_s[0] / size, draw.wind_m_s[1] / size}};
    }

    void place() {
        for (int k = 0; k < 3; ++k) x_[k] = setup_.start_m[k] + draw_.start_m[k];
        const SineCosine half = sine_cosine(0.5 * (setup_.start_yaw_rad + draw_.start_yaw_rad));
        x_[6] = half.cosine;
        x_[9] = half.sine;
        for (int i = 0; i < 4; ++i) x_[13 + i] = command_[i] = draw_.hover_rad_s[i];
        force_[2] = setup_.gravity_m_s2;
    }

    const float* rotors() {
        for (int i = 0; i < 4; ++i) engaged_[i] = static_cast<float>(x_[13 + i]);
        return engaged_;
    }

    // Held still for as long as the estimate has to be good before the controller takes over.
    void stand() {
        constexpr std::uint64_t kStep = 20000, kSteps = 52;
        for (std::uint64_t i = 0; i < kSteps; ++i) {
            time_us_ += kStep;
            control();
        }
    }

    std::size_t ticks_in(double seconds) const { return static_cast<std::size_t>(seconds / step_s_); }

    tc_reason start() {
        const tc_reason refused = tc_do(&controller_, TC_COMMAND_START, 0.0f);
        if (refused != TC_OK) return refused;
        began_s_ = time_us_ * 1e-6;
        disturbed_ = true;
        return TC_OK;
    }

    void control() {
        sensing_.keep(x_);
        const tc_estimate e = sensing_.estimate(time_us_, x_, force_, {disturbed_, on_way(draw_.jump_at)});
        tc_output output{};
        tc_tick(&controller_, time_us_, &e, &output);
        if (tc_mission_on_path(output.state)) path_s_ = controller_.telemetry.path_time_us * 1e-6;
        if (!output.in_command || !tc_mission_in_air(output.state)) return;
        for (int i = 0; i < 4; ++i) command_[i] = output.rotor_speed_rad_s[i];
    }

    // Whether that share of the trajectory's time has passed.
    bool on_way(double share) const { return path_s_ >= share * setup_.duration_s; }

    void weaken() {
        if (weakened_ || !(draw_.fault_ratio > 0.0) || !on_way(draw_.fault_at)) return;
        weakened_ = true;
        double& loss = values_[setup_.weakness_at + static_cast<std::size_t>(draw_.fault_rotor)];
        loss = 1.0 - (1.0 - loss) * (1.0 - draw_.fault_ratio);
    }

    void tick() {
        time_us_ += setup_.tick_us;
        for (int k = 0; k < 3; ++k) at_[k] = x_[k];
        control();
        if (controller_.mission.state == TC_FAULT) command_[0] = command_[1] = command_[2] = command_[3] = 0.0;
        weaken();
        blow();
        move();
    }

    // The mean wind rises over the first second of the hover; gusts change every fifth tick.
    void blow() {
        ramp_ = std::fmin(1.0, ramp_ + step_s_);
        if (ticks_++ % kGustEvery == 0) {
            const double relative[3] = {x_[3] - ramp_ * draw_.wind_m_s[0], x_[4] - ramp_ * draw_.wind_m_s[1],
                                        x_[5] - ramp_ * draw_.wind_m_s[2]};
            const double speed =
                std::sqrt(relative[0] * relative[0] + relative[1] * relative[1] + relative[2] * relative[2]);
            gusts_.step(kGustEvery * step_s_, speed, air_, gust_);
        }
        const double updraft = draw_.updraft_m_s != 0.0 ? draw_.updraft_m_s * rise(x_[2] / kThermal) : 0.0;
        for (int k = 0; k < 3; ++k) world_.wind[k] = ramp_ * (draw_.wind_m_s[k] + gust_[k]);
        world_.wind[2] += ramp_ * updraft;
    }

    // Thermals grow with the cube root of the height well below the top of the mixed layer (Lenschow et al. 1980).
    static double rise(double height) {
        if (!(height > 0.0)) return 0.0;
        double root = std::sqrt(height);
        for (int i = 0; i < kNewton; ++i) root -= (root - height / (root * root)) / 3.0;
        return root;
    }

    // The accelerometer reads what the last stage found at the end of the step.
    void move() {
        world_.gravity = setup_.gravity_m_s2;
        Derivative first, last;
        const double battery_v = std::fmax(draw_.battery_v - draw_.battery_fall_v_j * energy_j_, draw_.battery_empty_v);
        runge_kutta(model_, values_.data(), body_, world_, command_, battery_v, step_s_, x_, first, last);
        battery_v_ = battery_v;
        if (!lags_) {
            for (int i = 0; i < 4; ++i) x_[13 + i] = command_[i];
        }
        for (int k = 0; k < 3; ++k) force_[k] = last.specific_force[k];
        energy_j_ += step_s_ * first.rotor_power;
    }

    void watch() {
        const std::uint8_t state = controller_.mission.state;
        const double up = 1.0 - 2.0 * (x_[7] * x_[7] + x_[8] * x_[8]);
        if (up < least_up_) least_up_ = up;
        fell_ = fell_ || state == TC_EMERGENCY || state == TC_FAULT;
        if (ending_ < 0 && state == TC_TRAJECTORY) reserve();
        if (ending_ < 0) strain_ = std::fmax(strain_, strain());
        if (ending_ >= 0 || as_planned(state)) return;
        const bool finished = state == TC_HOLD && controller_.mission.reason == TC_FINISHED;
        ended(finished ? kFinished : kFailsafe, controller_.mission.reason);
    }

    bool as_planned(std::uint8_t state) const {
        return disturbed_ ? state == TC_APPROACH || state == TC_TRAJECTORY : state == TC_HOLD;
    }

    double after_s() const { return ending_ == kFinished ? setup_.after_s : setup_.after_failsafe_s; }

    // The larger of what may pass for standing on the ground, in an updraft, and of the tracking error.
    double strain() const {
        const double support = controller_.support_m_s2 / tc_stands_from(&controller_);
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            const double off = at_[k] - controller_.telemetry.setpoint.position_world_m[k];
            square += off * off;
        }
        return std::fmax(support, std::sqrt(square) / setup_.tracking_m);
    }

    // What the rotors reach at the largest command: less than their limit as the battery empties.
    double fastest() const {
        if (!(draw_.battery_fall_v_j > 0.0)) return setup_.fastest_rad_s;
        Drive<double> d{};
        d.battery_v = battery_v_;
        for (double& command : d.command) command = setup_.fastest_rad_s;
        drive(model_, values_.data(), d);
        return d.command[0];
    }

    // As vehicle.Limits.rotor_margin.
    void reserve() {
        const double most = fastest(), low = setup_.slowest_rad_s * setup_.slowest_rad_s, high = most * most;
        const double span = setup_.fastest_rad_s * setup_.fastest_rad_s - low;
        for (int i = 0; i < 4; ++i) {
            const double square = x_[13 + i] * x_[13 + i], left = std::fmin(high - square, square - low) / span;
            if (left < reserve_) reserve_ = left;
        }
    }

    void ended(Ending ending, int reason) {
        ending_ = ending;
        ended_s_ = time_us_ * 1e-6;
        summary_.ending = ending;
        summary_.state = controller_.mission.state;
        summary_.reason = reason;
        summary_.ended_s = ended_s_ - began_s_;
        summary_.reserve = reserve_;
        summary_.energy_j = energy_j_;
    }

    Summary gave_up(Ending ending, int reason) {
        ended(ending, reason);
        return whole();
    }

    // With what happened after the end.
    Summary whole() {
        summary_.tilt_rad = arccosine(std::fmax(-1.0, least_up_));
        summary_.fell = fell_;
        summary_.strain = strain_;
        summary_.flown_s = static_cast<double>(ticks_) * step_s_;
        return summary_;
    }

    Sample now() const {
        const tc_telemetry& t = controller_.telemetry;
        Sample s{};
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            const double off = at_[k] - t.setpoint.position_world_m[k];
            s.position_m[k] = static_cast<float>(at_[k]);
            square += off * off;
        }
        s.error_m = static_cast<float>(std::sqrt(square));
        const bool on_path = tc_mission_on_path(t.state);
        s.path_s = on_path ? static_cast<float>(t.path_time_us * 1e-6) : std::numeric_limits<float>::quiet_NaN();
        s.state = t.state;
        return s;
    }

    static constexpr int kGustEvery = 5;
    static constexpr int kNewton = 12;                // steps for a cube root of any height of flight, to the last bit
    static constexpr double kThermal = 10.0;          // m: height at which the updraft is told
    static constexpr std::uint64_t kClock = 1000000;  // at the first tick, so that no stamp comes before zero

    const Setup& setup_;
    const Model& model_;
    std::vector<double> values_;
    const Draw& draw_;
    tc_controller& controller_;
    Body<double> body_;
    Random noise_, drop_outs_;
    Mixture air_;
    Gusts gusts_;
    Sensing sensing_;
    double step_s_;
    World world_;
    double x_[kState] = {}, command_[4] = {}, force_[3] = {}, gust_[3] = {};
    double at_[3] = {};  // where it was when the controller was called, to whose set-point that belongs
    float engaged_[4] = {};
    std::uint64_t time_us_ = kClock, ticks_ = 0;
    double path_s_ = -1.0;  // on the trajectory, last
    double ramp_ = 0.0, began_s_ = 0.0, ended_s_ = 0.0, energy_j_ = 0.0, least_up_ = 1.0;
    double reserve_ = 1.0, battery_v_ = 0.0, strain_ = 0.0;
    int ending_ = -1;
    bool disturbed_ = false;  // on its way; drop-outs are for the path: before it one waits until the vehicle is ready
    bool fell_ = false, weakened_ = false;
    bool lags_ = lags(model_, values_.data());
    Summary summary_{};

    static bool lags(const Model& model, const double* values) {
        Drive<double> d{};
        return drive(model, values, d);
    }
};

}  // namespace goshawk
