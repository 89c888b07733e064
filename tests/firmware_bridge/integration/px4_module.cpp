// The PX4 module of examples/integration, compiled against its interface headers, on a simulated body. The test is
// estimator, Commander, mixer and clock; one scenario per run, named by the first argument.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "goshawk_control.hpp"
extern "C" {
#include "simulated_body.h"
}

extern "C" int goshawk_control_main(int argc, char* argv[]);

#define CHECK(condition)                                                   \
    if (!(condition)) {                                                    \
        std::printf("%s:%d: CHECK(%s)\n", __FILE__, __LINE__, #condition); \
        std::exit(1);                                                      \
    }

namespace {

constexpr int MODE = 23, CHECK_ID = 2, HOLD = 4, LAND = vehicle_status_s::NAVIGATION_STATE_AUTO_LAND;
constexpr unsigned STEP_US = 2000;
constexpr float FULL_RAD_S = 1800.0f;

template <class T>
T read(uORB::Topic topic) {
    T message{};
    std::memcpy(&message, uORB::slot(topic).data, sizeof message);
    return message;
}
unsigned count(uORB::Topic topic) { return uORB::slot(topic).generation; }
template <class T>
void send(uORB::Topic topic, const T& message) {
    uORB::Publication<T>(topic).publish(message);
}

struct World {
    simulated_body body;
    vehicle_status_s status{};
    vehicle_local_position_s position{};
    bool module_runs = true, commander_runs = true, attitude_good = true, accelerometer_good = true, held = true,
         landed = false;
    unsigned requests_seen = 0, commands_seen = 0;
    uint8_t check_request = 0;
    float origin_m = 0.0f;       // height of the floor in PX4's frame
    float ground_like_s = 0.0f;  // how long it has looked like standing on the ground

    explicit World(float height_m) {
        simulated_body_init(&body);
        body.position_world_m[0] = 3.0f;
        body.position_world_m[1] = 2.0f;
        body.position_world_m[2] = height_m;
        status.arming_state = vehicle_status_s::ARMING_STATE_ARMED;
        status.nav_state = HOLD;
        status.system_id = status.component_id = 1;
        char program[] = "goshawk_control", start[] = "start";
        char* words[] = {program, start};
        CHECK(goshawk_control_main(2, words) == PX4_OK);
    }

    static uint64_t now() { return interface_clock(); }

    // PX4's own controllers, while another mode flies: hover thrust.
    void other_mode_flies() {
        const float hover = body.parameters.mass_kg * body.parameters.gravity_m_s2 / 4.0f /
                            (body.parameters.quad_n_s2 * FULL_RAD_S * FULL_RAD_S);
        actuator_motors_s motors{};
        for (int i = 0; i < 12; i++) motors.control[i] = i < 4 ? (landed ? 0.05f : hover) : NAN;
        send(ORB_ID(actuator_motors), motors);
    }

    void commander() {
        if (!commander_runs) return;
        if (count(ORB_ID(register_ext_component_request)) != requests_seen) {
            requests_seen = count(ORB_ID(register_ext_component_request));
            const auto request = read<register_ext_component_request_s>(ORB_ID(register_ext_component_request));
            register_ext_component_reply_s reply{};
            reply.request_id = request.request_id;
            reply.success = request.register_mode && request.register_arming_check;
            reply.mode_id = MODE;
            reply.arming_check_id = CHECK_ID;
            send(ORB_ID(register_ext_component_reply), reply);
        }
        if (count(ORB_ID(vehicle_command)) != commands_seen) {
            commands_seen = count(ORB_ID(vehicle_command));
            const auto command = read<vehicle_command_s>(ORB_ID(vehicle_command));
            if (command.command == vehicle_command_s::VEHICLE_CMD_SET_NAV_STATE) {
                status.nav_state = static_cast<uint8_t>(command.param1);
            } else if (command.command == vehicle_command_s::VEHICLE_CMD_COMPONENT_ARM_DISARM) {
                CHECK(std::fabs(command.param2 - 21196.0f) < 0.5f);
                status.arming_state = 1;
            }
        }
        if (now() % 300000 < STEP_US) {
            arming_check_request_s request{};
            request.request_id = ++check_request;
            send(ORB_ID(arming_check_request), request);
        }
    }

    // PX4's, in short: low thrust, a descent that is commanded, and nothing that moves, for a second; disarmed 2 s
    // later.
    void land_detector() {
        const auto thrust = read<vehicle_thrust_setpoint_s>(ORB_ID(vehicle_thrust_setpoint));
        const auto setpoint = read<trajectory_setpoint_s>(ORB_ID(trajectory_setpoint));
        const bool low = thrust.timestamp + 1000000 > now() && -thrust.xyz[2] < 0.05f;
        const bool descend = std::isfinite(setpoint.velocity[2]) && setpoint.velocity[2] >= 0.275f;
        const bool still = std::fabs(body.velocity_world_m_s[2]) < 0.25f;
        ground_like_s = low && descend && still ? ground_like_s + STEP_US * 1e-6f : 0.0f;
        if (ground_like_s > 1.0f) landed = true;
        if (ground_like_s > 3.0f) status.arming_state = 1;
    }

    // What EKF2 and the sensors publish: NED and FRD.
    void estimator() {
        const float *p = body.position_world_m, *v = body.velocity_world_m_s, *q = body.q_world_body;
        const float *w = body.rate_body_rad_s, *f = body.specific_force_body_m_s2;
        position.timestamp = position.timestamp_sample = now();
        position.xy_valid = position.z_valid = position.v_xy_valid = position.v_z_valid = true;
        position.x = p[0];
        position.y = -p[1];
        position.z = -p[2] - origin_m;
        position.vx = v[0];
        position.vy = -v[1];
        position.vz = -v[2];
        position.eph = position.epv = 0.05f;
        position.evh = position.evv = 0.05f;
        send(ORB_ID(vehicle_local_position), position);
        vehicle_attitude_s attitude{};
        attitude.timestamp = attitude.timestamp_sample = now();
        const float good[4] = {q[0], q[1], -q[2], -q[3]};
        for (int i = 0; i < 4; i++) attitude.q[i] = attitude_good ? good[i] : NAN;
        send(ORB_ID(vehicle_attitude), attitude);
        vehicle_acceleration_s acceleration{};
        acceleration.timestamp_sample = now();
        vehicle_angular_velocity_s rate{};
        rate.timestamp = rate.timestamp_sample = now();
        for (int i = 0; i < 3; i++) {
            acceleration.xyz[i] = !accelerometer_good ? NAN : i == 0 ? f[i] : -f[i];
            rate.xyz[i] = attitude_good ? (i == 0 ? w[i] : -w[i]) : NAN;
        }
        send(ORB_ID(vehicle_acceleration), acceleration);
        send(ORB_ID(vehicle_angular_velocity), rate);
        vehicle_land_detected_s land{};
        land.landed = landed;
        send(ORB_ID(vehicle_land_detected), land);
        send(ORB_ID(vehicle_status), status);
    }

    // Motor outputs as PX4's mixer has them: the newest message, however old it is.
    void turn() {
        const auto motors = read<actuator_motors_s>(ORB_ID(actuator_motors));
        const int motor_of_rotor[4] = {2, 1, 3, 0};
        float command[4] = {0.0f, 0.0f, 0.0f, 0.0f};
        const bool armed = status.arming_state == vehicle_status_s::ARMING_STATE_ARMED;
        for (int i = 0; i < 4; i++) {
            const float thrust = motors.control[motor_of_rotor[i]];
            if (armed && std::isfinite(thrust)) command[i] = FULL_RAD_S * std::sqrt(thrust);
        }
        simulated_body before = body;
        simulated_body_step(&body, command, STEP_US * 1e-6f);
        if (held) {  // another mode holds it there
            std::memcpy(before.rotor_speed_rad_s, body.rotor_speed_rad_s, sizeof body.rotor_speed_rad_s);
            body = before;
        }
    }

    void step() {
        interface_clock() += STEP_US;
        commander();
        if (commander_runs && status.nav_state != MODE) other_mode_flies();
        if (status.nav_state == MODE && origin_m > 0.0f) land_detector();
        estimator();
        if (module_runs) px4::WorkItem::find("goshawk_control")->run_now();
        auto* watchdog = static_cast<px4::ScheduledWorkItem*>(px4::WorkItem::find("goshawk_watchdog"));
        CHECK(watchdog->interval_us() == 5000);
        if (now() % 5000 < STEP_US) watchdog->run_now();
        turn();
    }
    void run(float duration_s) {
        for (float t = 0.0f; t < duration_s; t += STEP_US * 1e-6f) step();
    }
    void enter() {
        run(1.5f);
        CHECK(read<arming_check_reply_s>(ORB_ID(arming_check_reply)).can_arm_and_run);
        status.nav_state = MODE;
        held = false;
        step();
    }
    bool says_yes() {
        run(0.4f);
        return read<arming_check_reply_s>(ORB_ID(arming_check_reply)).can_arm_and_run;
    }
};

actuator_motors_s motors() { return read<actuator_motors_s>(ORB_ID(actuator_motors)); }

void registers_its_mode_and_stays_silent_until_it_is_selected() {
    World world(5.0f);
    world.run(1.0f);
    const auto mode = read<vehicle_control_mode_s>(ORB_ID(config_control_setpoints));
    CHECK(mode.source_id == MODE);
    CHECK(mode.flag_control_climb_rate_enabled && mode.flag_control_termination_enabled);
    CHECK(!mode.flag_control_attitude_enabled && !mode.flag_control_rates_enabled);
    CHECK(!mode.flag_control_allocation_enabled && !mode.flag_control_position_enabled);
    const auto reply = read<arming_check_reply_s>(ORB_ID(arming_check_reply));
    CHECK(reply.registration_id == CHECK_ID && reply.request_id == world.check_request);
    CHECK(reply.mode_req_angular_velocity && reply.mode_req_attitude && reply.mode_req_local_position);
    CHECK(count(ORB_ID(vehicle_thrust_setpoint)) == 0 && count(ORB_ID(trajectory_setpoint)) == 0);
    CHECK(count(ORB_ID(vehicle_command)) == 0);
    // Its own queue, below everything that PX4 needs to fly on without it.
    CHECK(px4::WorkItem::find("goshawk_control")->queue().relative_priority < -18);
    CHECK(px4::WorkItem::find("goshawk_watchdog")->queue().relative_priority == 0);
}

void takes_over_in_flight_holds_and_publishes_what_px4_reads() {
    World world(5.0f);
    world.enter();
    const unsigned before = count(ORB_ID(actuator_motors));
    world.run(5.0f);
    CHECK(world.status.nav_state == MODE);
    CHECK(count(ORB_ID(actuator_motors)) - before >= 2495);
    const auto out = motors();
    float sum = 0.0f;
    for (int i = 0; i < 12; i++) {
        CHECK(i < 4 ? out.control[i] > 0.1f && out.control[i] < 0.9f : std::isnan(out.control[i]));
        sum += i < 4 ? out.control[i] : 0.0f;
    }
    CHECK(out.timestamp_sample == World::now() && out.reversible_flags == 0);
    CHECK(std::fabs(world.body.position_world_m[0] - 3.0f) < 0.1f);
    CHECK(std::fabs(world.body.position_world_m[1] - 2.0f) < 0.1f);
    CHECK(std::fabs(world.body.position_world_m[2] - 5.0f) < 0.1f);
    const auto thrust = read<vehicle_thrust_setpoint_s>(ORB_ID(vehicle_thrust_setpoint));
    CHECK(std::fabs(thrust.xyz[2] + sum / 4.0f) < 1e-6f);
    CHECK(World::now() - thrust.timestamp < 20000 && thrust.timestamp_sample == World::now());
    const auto setpoint = read<trajectory_setpoint_s>(ORB_ID(trajectory_setpoint));
    CHECK(std::fabs(setpoint.position[1] + 2.0f) < 0.1f && std::fabs(setpoint.position[2] + 5.0f) < 0.1f);
    CHECK(world.says_yes());
}

void gives_back_when_the_pilot_selects_another_mode() {
    World world(5.0f);
    world.enter();
    world.run(1.0f);
    world.status.nav_state = HOLD;
    world.held = true;
    world.step();
    const unsigned thrusts = count(ORB_ID(vehicle_thrust_setpoint));
    world.run(1.0f);
    CHECK(count(ORB_ID(vehicle_thrust_setpoint)) == thrusts);
    CHECK(count(ORB_ID(vehicle_command)) == 0);
    world.enter();  // and takes over once more
    world.run(2.0f);
    CHECK(world.status.nav_state == MODE && std::fabs(world.body.position_world_m[2] - 5.0f) < 0.2f);
}

void refuses_to_be_selected_outside_the_limits_of_taking_over() {
    World world(5.0f);
    world.run(1.5f);
    CHECK(world.says_yes());
    world.body.velocity_world_m_s[0] = 6.0f;
    CHECK(!world.says_yes());
    world.body.velocity_world_m_s[0] = 0.0f;
    CHECK(world.says_yes());
    world.body.q_world_body[0] = std::cos(0.35f);
    world.body.q_world_body[1] = std::sin(0.35f);  // 40 degrees
    CHECK(!world.says_yes());
    // Selected all the same: PX4 has switched its controllers off, so it is asked to switch them on again.
    world.status.nav_state = MODE;
    world.step();
    world.step();
    CHECK(world.status.nav_state == LAND);
    CHECK(count(ORB_ID(vehicle_thrust_setpoint)) == 0);
}

void idles_when_armed_on_the_ground() {
    World world(0.0f);
    world.landed = true;
    world.enter();
    world.run(1.0f);
    const auto out = motors();
    for (int i = 0; i < 4; i++) CHECK(out.control[i] > 0.0f && out.control[i] < 0.02f);
    CHECK(-read<vehicle_thrust_setpoint_s>(ORB_ID(vehicle_thrust_setpoint)).xyz[2] < 0.02f);
    CHECK(world.body.position_world_m[2] <= 0.0f);
}

void lands_and_goes_on_asking_for_a_descent_until_px4_has_disarmed() {
    World world(2.0f);
    world.origin_m = 999.0f;  // 1001 m: outside the default geofence, so it lands
    world.enter();
    for (int i = 0; i < 10000 && world.status.arming_state == vehicle_status_s::ARMING_STATE_ARMED; i++) {
        CHECK(!world.landed || world.body.position_world_m[2] <= 0.0f);
        world.step();
    }
    CHECK(world.landed && world.status.arming_state == 1 && world.status.nav_state == MODE);
    CHECK(std::isnan(motors().control[0]));
    CHECK(count(ORB_ID(vehicle_command)) == 0);  // by PX4's own land detector
}

void a_hang_keeps_the_collective_takes_the_torque_away_and_asks_for_land() {
    World world(5.0f);
    world.enter();
    world.run(1.0f);
    world.body.rate_body_rad_s[0] = 3.0f;  // commands a large torque
    world.step();
    const auto last = motors();
    CHECK(std::fabs(last.control[0] - last.control[2]) > 0.02f);
    world.module_runs = false;
    world.commander_runs = false;
    const uint64_t hung_us = World::now();
    while (count(ORB_ID(vehicle_command)) == 0) world.step();
    CHECK(World::now() - hung_us <= 30000);
    const auto even = motors();
    const float mean = 0.25f * (last.control[0] + last.control[1] + last.control[2] + last.control[3]);
    for (int i = 0; i < 12; i++) CHECK(i < 4 ? std::fabs(even.control[i] - mean) < 1e-6f : std::isnan(even.control[i]));
    world.commander_runs = true;
    world.step();
    CHECK(world.status.nav_state == LAND);
    world.held = true;
    const unsigned published = count(ORB_ID(actuator_motors));
    world.run(0.5f);
    CHECK(count(ORB_ID(actuator_motors)) - published == 250);  // PX4's own, one a step: the watchdog is silent
    // It comes back: it may not fly any more, and says so.
    world.module_runs = true;
    const unsigned thrusts = count(ORB_ID(vehicle_thrust_setpoint));
    CHECK(!world.says_yes());
    CHECK(count(ORB_ID(vehicle_thrust_setpoint)) == thrusts);
    world.status.nav_state = MODE;
    world.run(0.1f);
    CHECK(world.status.nav_state == LAND && count(ORB_ID(vehicle_thrust_setpoint)) == thrusts);
}

void a_hang_of_everything_stops_the_motors() {
    World world(5.0f);
    world.enter();
    world.run(1.0f);
    world.module_runs = world.commander_runs = false;
    const uint64_t hung_us = World::now();
    while (!std::isnan(motors().control[0])) {
        CHECK(World::now() - hung_us < 1000000);
        world.step();
    }
    CHECK(World::now() - hung_us >= 300000 && World::now() - hung_us <= 340000);
    for (int i = 0; i < 12; i++) CHECK(std::isnan(motors().control[i]));
}

void rotors_that_stopped_for_good_are_not_started_by_px4_again() {
    World world(5.0f);
    world.enter();
    world.run(1.0f);
    world.attitude_good = false;  // neither attitude nor gyro: nothing to fly on
    world.run(2.0f);
    CHECK(std::isnan(motors().control[0]));
    CHECK(world.status.arming_state != vehicle_status_s::ARMING_STATE_ARMED);
    CHECK(count(ORB_ID(vehicle_command)) == 1);
}

void unregisters_when_it_is_stopped() {
    World world(5.0f);
    world.run(0.5f);
    char program[] = "goshawk_control", stop[] = "stop";
    char* words[] = {program, stop};
    CHECK(goshawk_control_main(2, words) == PX4_OK);
    px4::WorkItem::find("goshawk_control")->run_now();
    CHECK(px4::WorkItem::find("goshawk_control") == nullptr && px4::WorkItem::find("goshawk_watchdog") == nullptr);
    const auto message = read<unregister_ext_component_s>(ORB_ID(unregister_ext_component));
    CHECK(message.mode_id == MODE && message.arming_check_id == CHECK_ID);
}

void a_new_mass_is_taken_from_the_parameters() {
    World world(5.0f);
    world.enter();
    px4::param_value(px4::params::GHK_MASS) = 0.75f;
    interface_clock() += STEP_US;
    send(ORB_ID(parameter_update), parameter_update_s{});
    world.accelerometer_good = false;  // nor a disturbance observer, which would cancel the difference
    world.run(3.0f);
    // The body weighs 0.70 kg: with 50 g too many in its model and no integrator it hovers higher, by g 0.05 / 0.75 /
    // kp.
    CHECK(world.body.position_world_m[2] > 5.02f && world.body.position_world_m[2] < 5.1f);
}

void converts_resets_of_the_estimator() {
    goshawk::Resets resets;
    vehicle_local_position_s p{};
    tc_estimate e{};
    p.xy_reset_counter = 7;
    p.heading_reset_counter = 255;
    p.delta_xy[0] = 9.0f;
    resets.take(p, e);
    CHECK(e.reset_counter == 0);  // what was before is no reset
    p.xy_reset_counter = 8;
    p.delta_xy[0] = 1.0f;
    p.delta_xy[1] = 2.0f;
    resets.take(p, e);
    CHECK(e.reset_counter == 1 && e.reset_position_world_m[0] == 1.0f && e.reset_position_world_m[1] == -2.0f);
    CHECK(e.reset_yaw_rad == 0.0f);
    p.heading_reset_counter = 0;  // wraps
    p.vz_reset_counter = 1;
    p.delta_heading = 0.3f;
    p.delta_vz = 0.5f;
    resets.take(p, e);
    CHECK(e.reset_counter == 2 && e.reset_yaw_rad == -0.3f && e.reset_velocity_world_m_s[2] == -0.5f);
    CHECK(e.reset_position_world_m[0] == 0.0f);
    resets.take(p, e);
    CHECK(e.reset_counter == 2);
    p.z_reset_counter = 2;  // one was missed
    resets.take(p, e);
    CHECK(e.reset_counter == 4);
}

void marks_what_of_the_estimate_holds() {
    vehicle_local_position_s p{};
    tc_estimate e{};
    p.xy_valid = p.z_valid = p.v_xy_valid = p.v_z_valid = true;
    p.eph = 0.2f;
    p.epv = 0.3f;
    p.evh = NAN;
    p.evv = 0.4f;
    goshawk::take_position(p, e);
    CHECK(e.valid == (TC_VALID_POSITION_XY | TC_VALID_POSITION_Z | TC_VALID_VELOCITY_Z));
    CHECK(e.position_std_m[0] == 0.2f && e.position_std_m[1] == 0.3f && e.velocity_std_m_s[1] == 0.4f);
    p.z_valid = false;
    goshawk::take_position(p, e);
    CHECK(e.valid == (TC_VALID_POSITION_XY | TC_VALID_VELOCITY_Z));
    vehicle_angular_velocity_s w{};
    vehicle_acceleration_s a{};
    w.timestamp_sample = 100000;
    a.timestamp_sample = 99000;
    a.xyz[2] = -9.8f;
    goshawk::take_rate(w, e);
    goshawk::take_acceleration(a, e);
    CHECK((e.valid & TC_VALID_SPECIFIC_FORCE) != 0 && e.specific_force_body_m_s2[2] == 9.8f);
    a.timestamp_sample = 50000;
    goshawk::take_acceleration(a, e);
    CHECK((e.valid & TC_VALID_SPECIFIC_FORCE) == 0);
}

void reads_rotor_speeds_from_the_escs_or_from_the_outputs() {
    esc_status_s escs{};
    float speed[4];
    escs.esc_count = 4;
    for (int i = 0; i < 4; i++) {
        escs.esc[i].timestamp = 1000000;
        escs.esc[i].actuator_function = static_cast<uint8_t>(104 - i);  // in any order
        escs.esc[i].esc_rpm = (i % 2 == 0 ? 1000 : -1000) * (4 - i);
    }
    CHECK(goshawk::rotor_speeds(escs, 1050000, speed));
    CHECK(std::fabs(speed[3] - 104.72f) < 0.01f && std::fabs(speed[0] - 3 * 104.72f) < 0.02f);  // motors 1 and 3
    CHECK(!goshawk::rotor_speeds(escs, 1200000, speed));
    escs.esc_count = 3;
    CHECK(!goshawk::rotor_speeds(escs, 1050000, speed));
    actuator_motors_s out{};
    out.control[0] = 0.25f;
    out.control[1] = NAN;
    goshawk::rotor_speeds(out, 1800.0f, speed);
    CHECK(std::fabs(speed[3] - 900.0f) < 0.1f && speed[1] == 0.0f);
}

struct Scenario {
    const char* name;
    void (*run)();
};
#define SCENARIO(name) {#name, name}
const Scenario scenarios[] = {
    SCENARIO(registers_its_mode_and_stays_silent_until_it_is_selected),
    SCENARIO(takes_over_in_flight_holds_and_publishes_what_px4_reads),
    SCENARIO(gives_back_when_the_pilot_selects_another_mode),
    SCENARIO(refuses_to_be_selected_outside_the_limits_of_taking_over),
    SCENARIO(idles_when_armed_on_the_ground),
    SCENARIO(lands_and_goes_on_asking_for_a_descent_until_px4_has_disarmed),
    SCENARIO(a_hang_keeps_the_collective_takes_the_torque_away_and_asks_for_land),
    SCENARIO(a_hang_of_everything_stops_the_motors),
    SCENARIO(rotors_that_stopped_for_good_are_not_started_by_px4_again),
    SCENARIO(unregisters_when_it_is_stopped),
    SCENARIO(a_new_mass_is_taken_from_the_parameters),
    SCENARIO(converts_resets_of_the_estimator),
    SCENARIO(marks_what_of_the_estimate_holds),
    SCENARIO(reads_rotor_speeds_from_the_escs_or_from_the_outputs),
};

}  // namespace

int main(int argc, char* argv[]) {
    for (const Scenario& scenario : scenarios) {
        if (argc == 1) std::printf("%s\n", scenario.name);
        if (argc == 2 && std::strcmp(argv[1], scenario.name) == 0) return scenario.run(), 0;
    }
    return argc == 1 ? 0 : 2;
}
