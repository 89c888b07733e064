#include "goshawk_control.hpp"

#include <fcntl.h>
#include <math.h>
#include <px4_platform_common/getopt.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

using namespace goshawk;

ModuleBase::Descriptor GoshawkControl::desc{task_spawn, custom_command, print_usage};

static constexpr char MODE_NAME[] = "Goshawk";
static constexpr float RAD_S_PER_RPM = 0.104719755f;
static constexpr hrt_abstime REGISTRATION_RETRY_US = 1000000;
static constexpr hrt_abstime REQUEST_RETRY_US = 100000;
static constexpr int READS_AT_ONCE = 4;  /* of 64 bytes; at 1 kHz more than a 921600 baud port brings */
static constexpr int FRAMES_AT_ONCE = 2; /* the driver's buffer must take what is handed to it */

/* A work queue of its own, below attitude and position control (-13), estimator (-14 .. -17) and hp_default (-18): when
   this controller blocks, PX4 can still fly the vehicle; in their queue it would block them too. */
static constexpr px4::wq_config_t QUEUE{"wq:goshawk", 6000, -20};

GoshawkControl::GoshawkControl() : ModuleParams(nullptr), WorkItem(MODULE_NAME, QUEUE) { tc_init(&_controller); }

GoshawkControl::~GoshawkControl() {
    if (_serial >= 0) {
        ::close(_serial);
    }
}

/* The number of this boot, four bytes in a file beside the key. The link's challenges follow from it: one that comes a
   second time would let recordings of the first one in. So a count that cannot be kept is no reason to go on. */
static bool count_boot(const char* key_path, uint32_t& boot) {
    char path[128];
    const int length = snprintf(path, sizeof(path), "%s.boots", key_path);
    if (length < 0 || static_cast<size_t>(length) >= sizeof(path)) return false;
    const int file = ::open(path, O_RDWR | O_CREAT, 0600);
    if (file < 0) return false;
    const ssize_t n = ::read(file, &boot, sizeof(boot));
    bool kept = n == 0 || n == static_cast<ssize_t>(sizeof(boot)); /* 0: the first boot */
    boot = n == 0 ? 1 : boot + 1;
    kept = kept && ::lseek(file, 0, SEEK_SET) == 0 && ::write(file, &boot, sizeof(boot)) == sizeof(boot);
    return ::close(file) == 0 && kept;
}

bool GoshawkControl::init(const char* device, const char* key_path) {
    update_parameters();

    if (!_configured) {
        return false;
    }

    if (device != nullptr) {
        const int file = key_path != nullptr ? ::open(key_path, O_RDONLY) : -1;
        const bool read_whole = file >= 0 && ::read(file, _link_config.key, TC_KEY_BYTES) == TC_KEY_BYTES;

        if (file >= 0) {
            ::close(file);
        }

        if (!read_whole) {
            PX4_ERR("no link key of %u bytes at %s", static_cast<unsigned>(TC_KEY_BYTES),
                    key_path != nullptr ? key_path : "(none)");
            return false;
        }
        if (!count_boot(key_path, _link_config.boot_id)) {
            PX4_ERR("%s.boots: the count of boots cannot be read and written", key_path);
            return false;
        }
    }

    _device = device;

    if (!_angular_velocity_sub.registerCallback()) {
        PX4_ERR("callback registration failed");
        return false;
    }

    _watchdog.start();
    return true;
}

/* Opened in Run: on NuttX a file descriptor belongs to the task that uses it. */
void GoshawkControl::open_link() {
    const char* device = _device;
    _device = nullptr; /* one try */
    _serial = ::open(device, O_RDWR | O_NOCTTY | O_NONBLOCK);
    struct termios settings{};

    if (_serial < 0 || ::tcgetattr(_serial, &settings) != 0) {
        PX4_ERR("ground link: cannot open %s", device);
        return;
    }

    settings.c_iflag = 0;
    settings.c_oflag = 0;
    settings.c_lflag = 0;
    settings.c_cflag = CS8 | CREAD | CLOCAL;
    ::cfsetispeed(&settings, B115200);
    ::cfsetospeed(&settings, B115200);
    ::tcsetattr(_serial, TCSANOW, &settings);
    _link_config.system_id = _status.system_id;
    _link_config.component_id = 191; /* MAV_COMP_ID_ONBOARD_COMPUTER */
    _link_config.sign = true;
    _link_config.identity = TC_IDENTITY_GENERIC; /* PX4 itself is who ground stations see as PX4 */
    _link_config.bytes_per_s = 10000;
    /* tc_link_stamp_to_keep is not kept here: a work queue item must not wait for the SD card, and PX4's parameters
       have 32 bits. So start_10us is 0, and after a restart the link follows the first station that has the key. */
    tc_link_init(&_link, &_controller, &_link_config, hrt_absolute_time());
}

void GoshawkControl::update_parameters() {
    updateParams();
    _full_rad_s = RAD_S_PER_RPM * _param_full_rpm.get();
    tc_parameters next = *tc_parameters_now(&_controller);
    next.mass_kg = _param_mass_kg.get();
    next.rotor_max_rad_s = _configured ? next.rotor_max_rad_s : fminf(next.rotor_max_rad_s, _full_rad_s);
    const tc_reason reason = tc_parameters_set(&_controller, &next);

    if (reason != TC_OK) {
        PX4_ERR("parameters refused, the old ones stay: %s", tc_reason_text(reason));
    }

    _configured = _configured || reason == TC_OK;
}

void GoshawkControl::send_registration() {
    const hrt_abstime now = hrt_absolute_time();

    if (_requested_at != 0 && now < _requested_at + REGISTRATION_RETRY_US) {
        return;
    }

    register_ext_component_request_s request{};
    _request_id = now;
    _requested_at = now;
    request.timestamp = now;
    request.request_id = _request_id;
    strncpy(request.name, MODE_NAME, sizeof(request.name) - 1);
    request.px4_ros2_api_version = register_ext_component_request_s::LATEST_PX4_ROS2_API_VERSION;
    request.register_arming_check = true;
    request.register_mode = true;
    _register_pub.publish(request);
}

bool GoshawkControl::registered() {
    if (_mode_id >= 0) {
        return true;
    }

    register_ext_component_reply_s reply{};

    for (int i = 0; i < register_ext_component_reply_s::ORB_QUEUE_LENGTH && _registration_sub.update(&reply); i++) {
        if (_requested_at != 0 && reply.request_id == _request_id && reply.success) {
            _arming_check_id = reply.arming_check_id;
            _mode_id = reply.mode_id;
            _heartbeat.mode_id.store(_mode_id);
            configure_mode();
            PX4_INFO("mode %d, arming check %d", _mode_id, _arming_check_id);
            return true;
        }
    }

    send_registration();
    return false;
}

/* What of PX4 stays on in our mode: nothing that controls. Climb rate: the land detector then wants to see a commanded
   descent (trajectory_setpoint) before it finds ground; without, it takes low thrust in a fast dive for a landing. */
void GoshawkControl::configure_mode() {
    vehicle_control_mode_s mode{};
    mode.timestamp = hrt_absolute_time();
    mode.source_id = static_cast<uint8_t>(_mode_id);
    mode.flag_control_climb_rate_enabled = true;
    mode.flag_control_termination_enabled = true;
    _mode_pub.publish(mode);
}

void GoshawkControl::unregister() {
    unregister_ext_component_s message{};
    message.timestamp = hrt_absolute_time();
    strncpy(message.name, MODE_NAME, sizeof(message.name) - 1);
    message.arming_check_id = static_cast<int8_t>(_arming_check_id);
    message.mode_id = static_cast<int8_t>(_mode_id);
    _unregister_pub.publish(message);
    _heartbeat.mode_id.store(-1);
    _mode_id = -1;
}

/* Commander leaves a mode that says no, and refuses to enter it. So on the ground this is the controller's own arming
   check; in flight the limits of tc_engage, that a switch which would be refused is not made; and in the mode it is yes
   until the watchdog has spoken: with rotors that the controller stopped for good, PX4 must not start them again. */
bool GoshawkControl::can_run() const {
    if (!_configured || _heartbeat.tripped.load()) return false;
    if (_ours) return true;
    if (_land.landed) return tc_arming_check(&_controller) == TC_OK;
    const float *v = _estimate.velocity_world_m_s, *w = _estimate.rate_body_rad_s, *q = _estimate.q_world_body;
    const float up = 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]); /* cosine of the tilt */
    const bool all = (_estimate.valid & TC_VALID_POSE) == TC_VALID_POSE;
    return all && up > 0.82f && v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < 25.0f &&
           w[0] * w[0] + w[1] * w[1] + w[2] * w[2] < 4.0f;
}

void GoshawkControl::answer_arming_check() {
    arming_check_request_s request{};

    if (!_check_request_sub.update(&request)) {
        return;
    }

    arming_check_reply_s reply{};
    reply.timestamp = hrt_absolute_time();
    reply.request_id = request.request_id;
    reply.registration_id = static_cast<uint8_t>(_arming_check_id);
    reply.health_component_index = arming_check_reply_s::HEALTH_COMPONENT_INDEX_NONE;
    reply.can_arm_and_run = can_run();
    reply.mode_req_angular_velocity = true;
    reply.mode_req_attitude = true;
    reply.mode_req_local_alt = true;
    reply.mode_req_local_position = true;
    _check_reply_pub.publish(reply);
}

/* True when a new body rate is there: then it is time for a tick. */
bool GoshawkControl::read_topics() {
    const hrt_abstime now = hrt_absolute_time();
    vehicle_angular_velocity_s rate{};
    vehicle_attitude_s attitude{};
    vehicle_local_position_s position{};
    battery_status_s battery{};
    esc_status_s escs{};
    actuator_motors_s motors{};
    _status_sub.update(&_status);
    _land_sub.update(&_land);

    if (!_angular_velocity_sub.update(&rate)) {
        return false;
    }

    take_rate(rate, _estimate);
    _acceleration_sub.update(&_acceleration);
    take_acceleration(_acceleration, _estimate);

    if (_attitude_sub.update(&attitude)) {
        take_attitude(attitude, _estimate);
    }

    if (_position_sub.update(&position)) {
        take_position(position, _estimate);
        _resets.take(position, _estimate);
    }

    if (_battery_sub.update(&battery)) {
        take_battery(battery, _estimate);
    }

    _esc_status_sub.copy(&escs);

    const bool measured = rotor_speeds(escs, now, _rotor_speed_rad_s);
    memcpy(_estimate.rotor_speed_rad_s, _rotor_speed_rad_s, sizeof(_rotor_speed_rad_s));
    _estimate.valid =
        static_cast<uint8_t>((_estimate.valid & ~TC_VALID_ROTOR_SPEED) | (measured ? TC_VALID_ROTOR_SPEED : 0));

    if (!measured && _motors_sub.copy(&motors)) {
        rotor_speeds(motors, _full_rad_s, _rotor_speed_rad_s);
    }

    return true;
}

void GoshawkControl::leave_mode() {
    const uint8_t state = _controller.mission.state;

    if (tc_mission_in_air(state) || state == TC_ARMED) {
        (void)tc_release(&_controller);
    }

    if (_controller.mission.state == TC_FAULT) {
        (void)tc_do(&_controller, TC_COMMAND_DISARM, 0.0f);
    }

    if (_controller.mission.state == TC_DISARMED) {
        (void)tc_shadow(&_controller);
    }

    _engaged = false;
    _touched = false;
    _fault_told = false;
}

/* On the ground: armed, rotors idle, and a take-off comes over the link. In flight: takes over, or gives the vehicle
   back at once, since PX4's own controllers are off in this mode. */
void GoshawkControl::enter_mode() {
    tc_reason reason = TC_OK;

    if (_land.landed) {
        (void)tc_shadow_end(&_controller);
        reason = tc_do(&_controller, TC_COMMAND_ARM, 0.0f);

    } else {
        reason = tc_engage(&_controller, _rotor_speed_rad_s);
    }

    _engaged = reason == TC_OK;

    const hrt_abstime now = hrt_absolute_time();
    if (!_engaged && now > _refused_at + REQUEST_RETRY_US) {
        _refused_at = now;
        PX4_ERR("not taken over: %s", tc_reason_text(reason));
        request_mode(_command_pub, _status, vehicle_status_s::NAVIGATION_STATE_AUTO_LAND);
    }
}

/* Killed from the ground, or nothing left to fly on: the rotors are off, and are to stay off whatever mode comes next.
 */
void GoshawkControl::disarm_by_force() {
    vehicle_command_s command{};
    command.timestamp = hrt_absolute_time();
    command.command = vehicle_command_s::VEHICLE_CMD_COMPONENT_ARM_DISARM;
    command.param1 = 0.0f;
    command.param2 = 21196.0f; /* in the air too */
    command.target_system = command.source_system = _status.system_id;
    command.target_component = _status.component_id;
    command.source_component = _status.component_id;
    _command_pub.publish(command);
}

void GoshawkControl::follow_mode() {
    _ours = _mode_id >= 0 && _status.arming_state == vehicle_status_s::ARMING_STATE_ARMED &&
            static_cast<int>(_status.nav_state) == _mode_id;

    if (!_ours || _heartbeat.tripped.load()) {
        leave_mode();

    } else if (!_engaged) {
        enter_mode();

    } else if (_controller.mission.state == TC_DISARMED) {
        _touched = true;
    } else if (_controller.mission.state == TC_FAULT && !_fault_told) {
        _fault_told = true;
        disarm_by_force();
    }
}

void GoshawkControl::publish(const tc_output& output) {
    const hrt_abstime now = hrt_absolute_time();
    actuator_motors_s motors{};
    vehicle_thrust_setpoint_s thrust{};
    vehicle_torque_setpoint_s torque{};
    trajectory_setpoint_s setpoint{};
    motors.timestamp = thrust.timestamp = torque.timestamp = setpoint.timestamp = now;
    motors.timestamp_sample = thrust.timestamp_sample = torque.timestamp_sample = _estimate.rate_time_us;
    fill_motors(output, _full_rad_s, motors);
    fill_thrust(motors, thrust);
    fill_torque(_controller, _full_rad_s, torque);
    /* After touchdown the controller asks for nothing any more; the land detector still wants a descent. */
    fill_setpoint(_controller.telemetry.setpoint, _touched ? _controller.parameters.landing_m_s : 0.0f, setpoint);
    _motors_pub.publish(motors);
    _thrust_pub.publish(thrust);
    _torque_pub.publish(torque);
    _setpoint_pub.publish(setpoint);
}

void GoshawkControl::serve_link() {
    const hrt_abstime now = hrt_absolute_time();

    if (_device != nullptr && _status.system_id != 0) {
        open_link();
    }

    if (_serial < 0) {
        return;
    }

    tc_link_update(&_link, now);
    uint8_t bytes[64];
    uint8_t frame[TC_FRAME_MAX];

    for (int i = 0; i < READS_AT_ONCE; i++) {
        const ssize_t n = ::read(_serial, bytes, sizeof(bytes));

        if (n <= 0) {
            break;
        }

        tc_link_receive(&_link, bytes, static_cast<size_t>(n), &_stream, now);
    }

    for (int i = 0; i < FRAMES_AT_ONCE; i++) {
        const size_t n = tc_link_transmit(&_link, frame, now);

        if (n == 0 || ::write(_serial, frame, n) != static_cast<ssize_t>(n)) {
            break;
        } /* full: a frame is lost */
    }
}

void GoshawkControl::Run() {
    if (should_exit()) {
        _angular_velocity_sub.unregisterCallback();
        _watchdog.stop();

        if (_mode_id >= 0) {
            unregister();
        }

        exit_and_cleanup(desc);
        return;
    }

    if (_parameter_update_sub.updated()) {
        parameter_update_s update{};
        _parameter_update_sub.copy(&update);
        update_parameters();
    }

    if (!read_topics()) {
        return;
    }

    if (registered()) {
        answer_arming_check();
    }

    follow_mode();
    tc_output output{};
    (void)tc_tick(&_controller, hrt_absolute_time(), &_estimate, &output);
    _heartbeat.finished_us.store(hrt_absolute_time());

    if (_engaged && !_heartbeat.tripped.load()) {
        publish(output);
    }

    serve_link();
}

int GoshawkControl::task_spawn(int argc, char* argv[]) {
    const char *device = nullptr, *key_path = nullptr, *value = nullptr;
    int index = 1, option = 0;

    while ((option = px4_getopt(argc, argv, "d:k:", &index, &value)) != EOF) {
        if (option == 'd') {
            device = strdup(value);

        } else if (option == 'k') {
            key_path = value;

        } else {
            return print_usage("unknown option");
        }
    }

    GoshawkControl* instance = new GoshawkControl();

    if (instance == nullptr) {
        PX4_ERR("alloc failed");
        return PX4_ERROR;
    }

    desc.object.store(instance);
    desc.task_id = task_id_is_work_queue;

    if (instance->init(device, key_path)) {
        return PX4_OK;
    }

    delete instance;
    desc.object.store(nullptr);
    desc.task_id = -1;
    return PX4_ERROR;
}

int GoshawkControl::custom_command(int, char*[]) { return print_usage("unknown command"); }

int GoshawkControl::print_status() {
    const tc_telemetry& t = *tc_telemetry_now(&_controller);
    PX4_INFO("mode %d, %s (%s), %s", _mode_id, tc_mission_state_text(t.state),
             tc_reason_text(static_cast<tc_reason>(t.reason)), _engaged ? "in command" : "shadow");
    PX4_INFO("%u ticks, %u refused%s", static_cast<unsigned>(t.ticks), static_cast<unsigned>(t.refused_ticks),
             _heartbeat.tripped.load() ? "; stopped by its watchdog: restart the module on the ground" : "");
    return 0;
}

int GoshawkControl::print_usage(const char* reason) {
    if (reason != nullptr) {
        PX4_ERR("%s", reason);
    }

    PRINT_MODULE_DESCRIPTION("Goshawk's trajectory controller as a flight mode.");
    PRINT_MODULE_USAGE_NAME("goshawk_control", "controller");
    PRINT_MODULE_USAGE_COMMAND("start");
    PRINT_MODULE_USAGE_PARAM_STRING('d', nullptr, "<file:dev>", "Serial port of the ground link, 115200 baud", true);
    PRINT_MODULE_USAGE_PARAM_STRING('k', nullptr, "<file>", "32 bytes that sign the ground link", true);
    PRINT_MODULE_USAGE_DEFAULT_COMMANDS();
    return 0;
}

extern "C" __EXPORT int goshawk_control_main(int argc, char* argv[]) {
    return ModuleBase::main(GoshawkControl::desc, argc, argv);
}
