#include "goshawk_watchdog.hpp"

#include <drivers/drv_hrt.h>
#include <math.h>
#include <px4_platform_common/log.h>

#include "goshawk_topics.hpp"

namespace goshawk {

void request_mode(uORB::Publication<vehicle_command_s>& commands, const vehicle_status_s& status, uint8_t nav_state) {
    vehicle_command_s command{};
    command.timestamp = hrt_absolute_time();
    command.command = vehicle_command_s::VEHICLE_CMD_SET_NAV_STATE;
    command.param1 = static_cast<float>(nav_state);
    command.target_system = status.system_id;
    command.target_component = status.component_id;
    command.source_system = status.system_id;
    command.source_component = status.component_id;
    commands.publish(command);
}

Watchdog::Watchdog(Heartbeat& heartbeat)
    : ScheduledWorkItem("goshawk_watchdog", px4::wq_configurations::rate_ctrl), _heartbeat(heartbeat) {}

void Watchdog::publish_motors(hrt_abstime now, bool stop) {
    actuator_motors_s motors{};
    motors.timestamp = now;
    motors.timestamp_sample = now;

    for (unsigned i = 0; i < actuator_motors_s::NUM_CONTROLS; i++) {
        motors.control[i] = NAN;
    }

    for (int rotor = 0; rotor < TC_ROTORS && !stop; rotor++) {
        motors.control[MOTOR_OF_ROTOR[rotor]] = _collective;
    }

    _actuator_motors_pub.publish(motors);
}

void Watchdog::Run() {
    const hrt_abstime now = hrt_absolute_time();
    vehicle_status_s status{};
    _vehicle_status_sub.copy(&status);
    const bool ours = status.arming_state == vehicle_status_s::ARMING_STATE_ARMED &&
                      static_cast<int>(status.nav_state) == _heartbeat.mode_id.load();

    if (!ours) {
        _ours_since = 0;
        _tripped_at = 0;
        return;
    }

    if (_ours_since == 0) {
        _ours_since = now;
    }

    const hrt_abstime finished = _heartbeat.finished_us.load();
    const hrt_abstime since = finished > _ours_since ? finished : _ours_since;

    if (_tripped_at == 0) {
        if (!_heartbeat.tripped.load() && now <= since + WATCHDOG_US) {
            return;
        }

        actuator_motors_s motors{};
        vehicle_thrust_setpoint_s thrust{};

        if (_actuator_motors_sub.copy(&motors)) {
            fill_thrust(motors, thrust);
        }

        if (!_heartbeat.tripped.load()) PX4_ERR("no control tick for %u ms", static_cast<unsigned>(WATCHDOG_US / 1000));
        _heartbeat.tripped.store(true);
        _collective = -thrust.xyz[2];
        _tripped_at = now;
        request_mode(_vehicle_command_pub, status, vehicle_status_s::NAVIGATION_STATE_AUTO_LAND);
    }

    publish_motors(now, _collective <= 0.0f || now > _tripped_at + STOP_US);
}

}  // namespace goshawk
