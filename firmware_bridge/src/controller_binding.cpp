// tc_controller and its parts as nanobind sees them: contiguous arrays in, arrays out, reasons as numbers. Checks of
// shapes and meaning are in firmware_bridge/controller.py.
#include "controller_binding.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <tuple>

#include "nominal_plant.h"
#include "segment.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace goshawk {
namespace {

template <typename T, int64_t... shape>
using In = nb::ndarray<const T, nb::numpy, nb::shape<shape...>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, float>;

constexpr int64_t any = -1;

Out make(size_t rows, size_t columns, float*& data) {
    data = new float[rows * columns]();
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<float*>(p); });
    return Out(data, {rows, columns}, owner);
}

Out copied(const float* values, size_t count) {
    float* data = new float[count];
    std::memcpy(data, values, count * sizeof(float));
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<float*>(p); });
    return Out(data, {count}, owner);
}

// A state row: position 3, velocity 3, q 4, body rate 3.
tc_estimate estimate_from(const double* row, uint64_t position_time_us, uint64_t attitude_time_us, double battery_v) {
    tc_estimate e{};
    e.position_time_us = position_time_us;
    e.attitude_time_us = attitude_time_us;
    e.rate_time_us = attitude_time_us;
    e.valid = TC_VALID_POSE;
    for (int i = 0; i < 3; i++) {
        e.position_world_m[i] = static_cast<float>(row[i]);
        e.velocity_world_m_s[i] = static_cast<float>(row[3 + i]);
        e.rate_body_rad_s[i] = static_cast<float>(row[10 + i]);
    }
    for (int i = 0; i < 4; i++) e.q_world_body[i] = static_cast<float>(row[6 + i]);
    e.battery_v = static_cast<float>(battery_v);
    return e;
}

// What else a tick may be told: a row of specific force 3, standard deviations of position and velocity (horizontal,
// vertical) 2 + 2, the last reset's position 3, velocity 3, yaw 1, and measured rotor speeds 4.
std::tuple<Out, int> tick(Controller& self, uint64_t time_us, In<double, 13> state, uint64_t position_time_us,
                          uint64_t attitude_time_us, double battery_v, std::optional<uint64_t> rate_time_us,
                          uint8_t valid, uint8_t reset_counter, std::optional<In<double, 18>> more) {
    tc_estimate e = estimate_from(state.data(), position_time_us, attitude_time_us, battery_v);
    e.rate_time_us = rate_time_us.value_or(attitude_time_us);
    e.valid = valid;
    e.reset_counter = reset_counter;
    if (more) {
        const double* row = more->data();
        std::copy_n(row, 3, e.specific_force_body_m_s2);
        std::copy_n(row + 3, 2, e.position_std_m);
        std::copy_n(row + 5, 2, e.velocity_std_m_s);
        std::copy_n(row + 7, 3, e.reset_position_world_m);
        std::copy_n(row + 10, 3, e.reset_velocity_world_m_s);
        e.reset_yaw_rad = static_cast<float>(row[13]);
        std::copy_n(row + 14, TC_ROTORS, e.rotor_speed_rad_s);
    }
    tc_output output{};
    const tc_reason reason = tc_tick(self.c.get(), time_us, &e, &output);
    return {copied(output.rotor_speed_rad_s, TC_ROTORS), static_cast<int>(reason)};
}

Out run(Controller& self, In<uint64_t, any> times_us, In<double, any, 13> states) {
    const size_t n = std::min(times_us.shape(0), states.shape(0));
    float* data = nullptr;
    Out out = make(n, TC_ROTORS, data);
    for (size_t i = 0; i < n; i++) {
        const uint64_t t = times_us.data()[i];
        const tc_estimate e = estimate_from(states.data() + 13 * i, t, t, 0.0);
        tc_output output{};
        tc_tick(self.c.get(), t, &e, &output);
        std::memcpy(data + TC_ROTORS * i, output.rotor_speed_rad_s, sizeof output.rotor_speed_rad_s);
    }
    return out;
}

Out run_nominal(Controller& self, In<double, 13> start, uint64_t time_us, uint32_t step_us, size_t n, size_t every) {
    const size_t rows = every > 0 ? n / every : 0;
    float* data = nullptr;
    Out out = make(rows, 13, data);
    NominalPlant plant(start.data());
    {
        nb::gil_scoped_release free_python;
        tc_output output{};
        for (size_t i = 0; i < n; i++) {
            time_us += step_us;
            const tc_estimate e = plant.estimate(time_us);
            tc_tick(self.c.get(), time_us, &e, &output);
            plant.step(*self.c, static_cast<float>(step_us) * 1e-6f);
            if (every > 0 && (i + 1) % every == 0) plant.write(data + 13 * (i / every));
        }
    }
    return out;
}

nb::dict setpoint_dict(const tc_setpoint& s) {
    nb::dict d;
    d["position_world_m"] = copied(s.position_world_m, 3);
    d["velocity_world_m_s"] = copied(s.velocity_world_m_s, 3);
    d["acceleration_world_m_s2"] = copied(s.acceleration_world_m_s2, 3);
    d["jerk_world_m_s3"] = copied(s.jerk_world_m_s3, 3);
    d["snap_world_m_s4"] = copied(s.snap_world_m_s4, 3);
    d["yaw_rad"] = s.yaw_rad;
    d["yaw_rate_rad_s"] = s.yaw_rate_rad_s;
    d["yaw_acceleration_rad_s2"] = s.yaw_acceleration_rad_s2;
    return d;
}

nb::dict telemetry(const Controller& self) {
    const tc_telemetry& t = self.c->telemetry;
    nb::dict d;
    d["time_us"] = t.time_us;
    d["state"] = t.state;
    d["reason"] = t.reason;
    d["saturation"] = t.saturation;
    d["estimate_faults"] = t.estimate_faults;
    d["position_world_m"] = copied(t.estimate.position_world_m, 3);
    d["velocity_world_m_s"] = copied(t.estimate.velocity_world_m_s, 3);
    d["q_world_body"] = copied(t.estimate.q_world_body, 4);
    d["rate_body_rad_s"] = copied(t.estimate.rate_body_rad_s, 3);
    d["battery_v"] = t.estimate.battery_v;
    d["setpoint"] = setpoint_dict(t.setpoint);
    d["q_reference"] = copied(t.flatness.q_reference, 4);
    d["rate_reference_rad_s"] = copied(t.rate_reference_rad_s, 3);
    d["thrust_n"] = t.wrench.thrust_n;
    d["torque_n_m"] = copied(t.wrench.torque_n_m, 3);
    d["rotor_speed_rad_s"] = copied(t.rotor_speed_rad_s, TC_ROTORS);
    d["path_rate"] = t.path_rate;
    d["path_limit"] = t.path_limit;
    d["limit_reason"] = t.limit_reason;
    d["warnings"] = t.warnings;
    d["landing_stage"] = t.landing_stage;
    d["reckoning_s"] = t.reckoning_s;
    d["reckoning_std_m"] = t.reckoning_std_m;
    const tc_observer& o = self.c->observer;
    d["observer_state"] = o.state;
    d["disturbance_force_world_n"] = copied(o.force_world_n, 3);
    d["disturbance_torque_body_n_m"] = copied(o.torque_body_n_m, 3);
    d["disturbance_force_std_n"] = std::sqrt(o.force_variance_n2);
    float torque_std_n_m[3];
    for (int i = 0; i < 3; i++) torque_std_n_m[i] = std::sqrt(o.torque_variance_n2_m2[i]);
    d["disturbance_torque_std_n_m"] = copied(torque_std_n_m, 3);
    d["position_delay_s"] = self.c->delay.attitude.delay_s + self.c->delay.velocity.delay_s;
    d["shift_world_m"] = copied(self.c->supervisor.shift, 3);
    d["path_time_us"] = t.path_time_us;
    const tc_trajectory* active = tc_store_active(&self.c->store);
    d["trajectory_id"] = active != nullptr ? active->header.id : 0u;
    d["trajectory_crc32"] = active != nullptr ? active->header.crc32 : 0u;
    d["ticks"] = t.ticks;
    d["refused_ticks"] = t.refused_ticks;
    return d;
}

tc_parameters parameters_from(const float* values, size_t count) {
    tc_parameters p{};
    std::memcpy(&p, values, std::min<size_t>(count * sizeof(float), sizeof p));  // in the order of the table
    return p;
}

Out parameters(const Controller& self) {
    float* data = nullptr;
    Out out = make(tc_parameters_count(), 1, data);
    for (uint16_t i = 0; i < tc_parameters_count(); i++) data[i] = tc_parameters_get(&self.c->parameters, i);
    return out;
}

nb::list parameter_table() {
    nb::list rows;
    for (uint16_t i = 0; i < tc_parameters_count(); i++) {
        float smallest, largest, preset;
        tc_parameters_range(i, &smallest, &largest, &preset);
        rows.append(nb::make_tuple(tc_parameters_name(i), smallest, largest, preset, tc_parameters_in_flight(i),
                                   tc_parameters_unit(i)));
    }
    return rows;
}

// A slot of its own, for the CRC and for evaluation; `durations` and `coefficients` must fit (the wrapper checks).
std::unique_ptr<tc_trajectory> trajectory_from(const tc_trajectory_header& header, In<uint32_t, any> durations_us,
                                               In<float, any, 4, any> coefficients) {
    auto slot = std::make_unique<tc_trajectory>();
    slot->header = header;
    slot->start_us[0] = 0;
    const size_t n = coefficients.shape(2);
    for (size_t i = 0; i < durations_us.shape(0) && i < TC_MAX_SEGMENTS; i++) {
        slot->segment[i] = segment_from(durations_us.data()[i], coefficients.data() + 4 * n * i, n);
        slot->start_us[i + 1] = slot->start_us[i] + durations_us.data()[i];
    }
    return slot;
}

tc_trajectory_header header_of(uint32_t id, uint32_t crc32, size_t segments, size_t coefficients, int policy) {
    tc_trajectory_header h{};
    h.id = id;
    h.crc32 = crc32;
    h.segment_count = static_cast<uint16_t>(segments);
    h.coefficient_count = static_cast<uint8_t>(coefficients);
    h.link_loss_policy = static_cast<uint8_t>(policy);
    return h;
}

uint32_t trajectory_crc32(uint32_t id, int policy, In<uint32_t, any> durations_us, In<float, any, 4, any> c) {
    return tc_trajectory_crc32(
        trajectory_from(header_of(id, 0, durations_us.shape(0), c.shape(2), policy), durations_us, c).get());
}

// Rows: position 3, velocity 3, acceleration 3, jerk 3, snap 3, yaw, yaw rate, yaw acceleration.
Out evaluate(In<uint32_t, any> durations_us, In<float, any, 4, any> c, In<uint32_t, any> times_us) {
    const auto slot = trajectory_from(header_of(1, 0, durations_us.shape(0), c.shape(2), 0), durations_us, c);
    float* data = nullptr;
    Out out = make(times_us.shape(0), 18, data);
    for (size_t i = 0; i < times_us.shape(0); i++) {
        tc_setpoint s{};
        const uint32_t t = times_us.data()[i];
        tc_trajectory_evaluate(slot.get(), tc_trajectory_find(slot.get(), t), t, &s);
        float* row = data + 18 * i;
        std::memcpy(row, s.position_world_m, 12);
        std::memcpy(row + 3, s.velocity_world_m_s, 12);
        std::memcpy(row + 6, s.acceleration_world_m_s2, 12);
        std::memcpy(row + 9, s.jerk_world_m_s3, 12);
        std::memcpy(row + 12, s.snap_world_m_s4, 12);
        row[15] = s.yaw_rad;
        row[16] = s.yaw_rate_rad_s;
        row[17] = s.yaw_acceleration_rad_s2;
    }
    return out;
}

// Columns out: rotor speeds 4, saturation bits.
std::tuple<Out, int> mixer(In<float, any> parameters, In<float, any, 4> wrench, In<float, any, 3> air,
                           In<float, any, 3> rate) {
    const tc_parameters p = parameters_from(parameters.data(), parameters.shape(0));
    tc_mixer m{};
    const tc_reason reason = tc_mixer_configure(&m, &p);
    float* data = nullptr;
    const size_t n = reason == TC_OK ? wrench.shape(0) : 0;
    Out out = make(n, 5, data);
    for (size_t i = 0; i < n; i++) {
        tc_wrench w{};
        w.thrust_n = wrench.data()[4 * i];
        std::memcpy(w.torque_n_m, wrench.data() + 4 * i + 1, 12);
        float speed[TC_ROTORS];
        tc_mixer_flow flow;
        tc_mixer_flow_at(&m, air.data() + 3 * i, rate.data() + 3 * i, &flow);
        const uint8_t saturation = tc_mixer_solve(&m, &w, &flow, speed);
        std::memcpy(data + 5 * i, speed, 16);
        data[5 * i + 4] = saturation;
    }
    return {out, static_cast<int>(reason)};
}

// The state of a vehicle whose reference has followed this force and yaw for long.
void start_on_chart(const float* row, tc_flatness_state* state) {
    const float size_n = std::sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2]);
    const float axis[3] = {row[0] / size_n, row[1] / size_n, row[2] / size_n};
    float q[4];
    tc_flatness_chart(axis, row[9], q);
    tc_flatness_reset(state, q);
}

// Rows in: force 3, its two derivatives 3 + 3, yaw, yaw rate, yaw acceleration. Rows out: q 4, and rate 3 and angular
// acceleration 3 in world axes.
Out flatness(In<float, any> parameters, In<float, any, 12> inputs, float step_s) {
    const tc_parameters p = parameters_from(parameters.data(), parameters.shape(0));
    tc_flatness_state state{};
    float* data = nullptr;
    Out out = make(inputs.shape(0), 10, data);
    for (size_t i = 0; i < inputs.shape(0); i++) {
        const float* row = inputs.data() + 12 * i;
        if (i == 0) start_on_chart(row, &state);
        tc_setpoint setpoint{};
        for (int j = 0; j < 3; j++) {
            setpoint.jerk_world_m_s3[j] = row[3 + j] / p.mass_kg;
            setpoint.snap_world_m_s4[j] = row[6 + j] / p.mass_kg;
        }
        setpoint.yaw_rad = row[9];
        setpoint.yaw_rate_rad_s = row[10];
        setpoint.yaw_acceleration_rad_s2 = row[11];
        tc_turning turning{};
        tc_flatness_step(&state, &p, row, &setpoint, 0.0f, step_s, &turning);
        std::memcpy(data + 10 * i, state.q_reference, 16);
        std::memcpy(data + 10 * i + 4, turning.rate_world_rad_s, 12);
        std::memcpy(data + 10 * i + 7, turning.acceleration_world_rad_s2, 12);
    }
    return out;
}

}  // namespace

void bind_controller(nb::module_& m) {
    m.def("parameter_table", &parameter_table);
    m.def("reason_text", [](int reason) { return tc_reason_text(static_cast<tc_reason>(reason)); }, "reason"_a);
    m.def("state_text", &tc_mission_state_text, "state"_a);
    m.def("trajectory_crc32", &trajectory_crc32, "id"_a, "policy"_a, "durations_us"_a, "coefficients"_a);
    m.def("evaluate", &evaluate, "durations_us"_a, "coefficients"_a, "times_us"_a);
    m.def("mixer", &mixer, "parameters"_a, "wrench"_a, "air_velocity_body_m_s"_a, "rate_body_rad_s"_a);
    m.def("flatness", &flatness, "parameters"_a, "inputs"_a, "step_s"_a);
    m.attr("MAX_SEGMENTS") = TC_MAX_SEGMENTS;
    m.attr("MAX_COEFFICIENTS") = TC_MAX_COEFFICIENTS;
    nb::class_<Controller>(m, "Controller")
        .def(nb::init<>())
        .def(
            "set_parameters",
            [](Controller& self, In<float, any> values) {
                const tc_parameters p = parameters_from(values.data(), values.shape(0));
                uint16_t index = 0;
                const tc_reason wrong = tc_parameters_check(&p, &index);
                const tc_reason reason = wrong != TC_OK ? wrong : tc_parameters_set(self.c.get(), &p);
                return std::tuple<int, int>(reason, wrong != TC_OK ? index : -1);
            },
            "values"_a)
        .def("parameters", &parameters)
        .def("parameters_crc32", [](const Controller& self) { return tc_parameters_crc32(&self.c->parameters); })
        .def(
            "command",
            [](Controller& self, int command, float value) {
                return static_cast<int>(tc_do(self.c.get(), static_cast<tc_command>(command), value));
            },
            "command"_a, "value"_a)
        .def(
            "upload_begin",
            [](Controller& self, uint32_t id, uint32_t crc32, size_t segments, size_t coefficients, int policy,
               float clearance_m) {
                tc_trajectory_header header = header_of(id, crc32, segments, coefficients, policy);
                header.clearance_m = clearance_m;
                return static_cast<int>(tc_upload_begin(self.c.get(), &header));
            },
            "id"_a, "crc32"_a, "segments"_a, "coefficients"_a, "policy"_a, "clearance_m"_a = 0.0f)
        .def(
            "upload_segment",
            [](Controller& self, uint16_t index, uint32_t duration_us, In<float, 4, any> coefficients) {
                const tc_segment s = segment_from(duration_us, coefficients.data(), coefficients.shape(1));
                return static_cast<int>(tc_upload_segment(self.c.get(), index, &s));
            },
            "index"_a, "duration_us"_a, "coefficients"_a)
        .def(
            "upload_sample",
            [](Controller& self, uint32_t time_us, In<float, 4> value) {
                tc_trajectory_sample sample{};
                sample.time_us = time_us;
                std::memcpy(sample.value, value.data(), sizeof sample.value);
                return static_cast<int>(tc_upload_sample(self.c.get(), &sample));
            },
            "time_us"_a, "value"_a)
        .def("upload_finish",
             [](Controller& self) {
                 tc_reason reason = TC_BUSY;
                 while (reason == TC_BUSY) reason = tc_upload_finish(self.c.get());
                 return static_cast<int>(reason);
             })
        .def(
            "upload_activate",
            [](Controller& self, uint32_t id, uint32_t crc32) {
                return static_cast<int>(tc_upload_activate(self.c.get(), id, crc32));
            },
            "id"_a, "crc32"_a)
        .def("state", [](const Controller& self) { return static_cast<int>(self.c->mission.state); })
        .def_prop_ro("configured", [](const Controller& self) { return self.c->configured; })
        .def("has_trajectory", [](const Controller& self) { return tc_store_active(&self.c->store) != nullptr; })
        .def("refused_segment", [](const Controller& self) { return self.c->store.refused_segment; })
        .def(
            "ground_alive", [](Controller& self, uint64_t ago_us) { tc_ground_alive(self.c.get(), ago_us); },
            "ago_us"_a)
        .def("tick", &tick, "time_us"_a, "state"_a, "position_time_us"_a, "attitude_time_us"_a, "battery_v"_a,
             "rate_time_us"_a = nb::none(), "valid"_a = static_cast<int>(TC_VALID_POSE), "reset_counter"_a = 0,
             "more"_a = nb::none())
        .def("shadow", [](Controller& self) { return static_cast<int>(tc_shadow(self.c.get())); })
        .def("shadow_end", [](Controller& self) { return static_cast<int>(tc_shadow_end(self.c.get())); })
        .def(
            "engage",
            [](Controller& self, std::optional<In<float, 4>> rotor_speed) {
                return static_cast<int>(tc_engage(self.c.get(), rotor_speed ? rotor_speed->data() : nullptr));
            },
            "rotor_speed_rad_s"_a.none())
        .def("release", [](Controller& self) { return static_cast<int>(tc_release(self.c.get())); })
        .def("arming_check", [](const Controller& self) { return static_cast<int>(tc_arming_check(self.c.get())); })
        .def("run", &run, "times_us"_a, "states"_a)
        .def("run_nominal", &run_nominal, "start"_a, "time_us"_a, "step_us"_a, "n"_a, "every"_a)
        .def("telemetry", &telemetry);
}

}  // namespace goshawk
