/* Goshawk as a flight mode of PX4. Runs with every vehicle_angular_velocity; while another mode flies it computes and
   commands nothing (shadow), in its own mode it replaces PX4's position, attitude and rate controllers and the control
   allocator. PX4 keeps estimator, arming, failsafes, kill switch and motor output.

   Written for one commit of PX4: see README.md. */
#pragma once

#include <drivers/drv_hrt.h>
#include <px4_platform_common/log.h>
#include <px4_platform_common/module.h>
#include <px4_platform_common/module_params.h>
#include <uORB/topics/actuator_motors.h>
#include <uORB/topics/arming_check_reply.h>
#include <uORB/topics/arming_check_request.h>
#include <uORB/topics/battery_status.h>
#include <uORB/topics/esc_status.h>
#include <uORB/topics/parameter_update.h>
#include <uORB/topics/register_ext_component_reply.h>
#include <uORB/topics/register_ext_component_request.h>
#include <uORB/topics/trajectory_setpoint.h>
#include <uORB/topics/unregister_ext_component.h>
#include <uORB/topics/vehicle_acceleration.h>
#include <uORB/topics/vehicle_angular_velocity.h>
#include <uORB/topics/vehicle_attitude.h>
#include <uORB/topics/vehicle_command.h>
#include <uORB/topics/vehicle_control_mode.h>
#include <uORB/topics/vehicle_land_detected.h>
#include <uORB/topics/vehicle_local_position.h>
#include <uORB/topics/vehicle_status.h>
#include <uORB/topics/vehicle_thrust_setpoint.h>
#include <uORB/topics/vehicle_torque_setpoint.h>

#include <px4_platform_common/px4_work_queue/WorkItem.hpp>
#include <uORB/Publication.hpp>
#include <uORB/Subscription.hpp>
#include <uORB/SubscriptionCallback.hpp>
#include <uORB/SubscriptionInterval.hpp>

#include "goshawk_controller/goshawk_controller.h"
#include "goshawk_controller/link.h"
#include "goshawk_topics.hpp"
#include "goshawk_watchdog.hpp"

class GoshawkControl : public ModuleBase, public ModuleParams, public px4::WorkItem {
  public:
    static Descriptor desc;

    GoshawkControl();
    ~GoshawkControl() override;

    static int task_spawn(int argc, char* argv[]);
    static int custom_command(int argc, char* argv[]);
    static int print_usage(const char* reason = nullptr);
    int print_status() override;

    /* `device`: serial port of the ground link, nullptr: none; `key_path`: file of the 32 bytes that sign it. */
    bool init(const char* device, const char* key_path);

  private:
    void Run() override;

    /* The external mode. */
    bool registered();
    void send_registration();
    void configure_mode();
    void unregister();
    void answer_arming_check();
    bool can_run() const;

    /* One step per line of Run. */
    void update_parameters();
    bool read_topics();
    void follow_mode();
    void leave_mode();
    void enter_mode();
    void disarm_by_force();
    void publish(const tc_output& output);
    void serve_link();
    void open_link();

    tc_controller _controller{};
    tc_link _link{};
    tc_link_config _link_config{};
    tc_parser _stream{};
    tc_estimate _estimate{};
    bool _configured{false};
    bool _ours{false};    /* armed, in our mode */
    bool _engaged{false}; /* ... and taken over */
    bool _touched{false}; /* landed by itself; PX4 has yet to see it and disarm */
    bool _fault_told{false};
    float _full_rad_s{0.0f};
    float _rotor_speed_rad_s[TC_ROTORS]{};
    const char* _device{nullptr};
    int _serial{-1};

    goshawk::Resets _resets;
    goshawk::Heartbeat _heartbeat;
    goshawk::Watchdog _watchdog{_heartbeat};

    int _arming_check_id{-1};
    int _mode_id{-1};
    uint64_t _request_id{0};
    hrt_abstime _requested_at{0};
    hrt_abstime _refused_at{0};
    vehicle_status_s _status{};
    vehicle_land_detected_s _land{};
    vehicle_acceleration_s _acceleration{};

    uORB::SubscriptionCallbackWorkItem _angular_velocity_sub{this, ORB_ID(vehicle_angular_velocity)};
    uORB::SubscriptionInterval _parameter_update_sub{ORB_ID(parameter_update), 1000000};
    uORB::Subscription _attitude_sub{ORB_ID(vehicle_attitude)};
    uORB::Subscription _position_sub{ORB_ID(vehicle_local_position)};
    uORB::Subscription _acceleration_sub{ORB_ID(vehicle_acceleration)};
    uORB::Subscription _esc_status_sub{ORB_ID(esc_status)};
    uORB::Subscription _motors_sub{ORB_ID(actuator_motors)};
    uORB::Subscription _battery_sub{ORB_ID(battery_status)};
    uORB::Subscription _status_sub{ORB_ID(vehicle_status)};
    uORB::Subscription _land_sub{ORB_ID(vehicle_land_detected)};
    uORB::Subscription _check_request_sub{ORB_ID(arming_check_request)};
    uORB::Subscription _registration_sub{ORB_ID(register_ext_component_reply)};

    uORB::Publication<actuator_motors_s> _motors_pub{ORB_ID(actuator_motors)};
    uORB::Publication<vehicle_thrust_setpoint_s> _thrust_pub{ORB_ID(vehicle_thrust_setpoint)};
    uORB::Publication<vehicle_torque_setpoint_s> _torque_pub{ORB_ID(vehicle_torque_setpoint)};
    uORB::Publication<trajectory_setpoint_s> _setpoint_pub{ORB_ID(trajectory_setpoint)};
    uORB::Publication<vehicle_command_s> _command_pub{ORB_ID(vehicle_command)};
    uORB::Publication<vehicle_control_mode_s> _mode_pub{ORB_ID(config_control_setpoints)};
    uORB::Publication<arming_check_reply_s> _check_reply_pub{ORB_ID(arming_check_reply)};
    uORB::Publication<register_ext_component_request_s> _register_pub{ORB_ID(register_ext_component_request)};
    uORB::Publication<unregister_ext_component_s> _unregister_pub{ORB_ID(unregister_ext_component)};

    DEFINE_PARAMETERS((ParamFloat<px4::params::GHK_MASS>)_param_mass_kg,
                      (ParamFloat<px4::params::GHK_RPM_FULL>)_param_full_rpm)
};
