/* Watches the control work item from the highest work queue. PX4's mixer repeats the last motor outputs for ever, so a
   controller that hangs would fly on with them; Commander notices after 1.2 s, by missing arming check replies.

   - WATCHDOG_US after the last finished tick: the four motors get their mean (collective kept, no torque), Commander is
     asked for Land, and the module may not command again until it is restarted on the ground.
   - STOP_US later, when the mode is still ours (Commander does not run either): the motors stop. */
#pragma once

#include <px4_platform_common/atomic.h>
#include <uORB/topics/actuator_motors.h>
#include <uORB/topics/vehicle_command.h>
#include <uORB/topics/vehicle_status.h>

#include <px4_platform_common/px4_work_queue/ScheduledWorkItem.hpp>
#include <uORB/Publication.hpp>
#include <uORB/Subscription.hpp>

namespace goshawk {

/* What the two work items share. Their work queues are threads of their own. */
struct Heartbeat {
    px4::atomic<hrt_abstime> finished_us{0}; /* when the last tick was done */
    px4::atomic<int> mode_id{-1};
    px4::atomic<bool> tripped{false};
};

/* Asks Commander for another mode, as a pilot's switch would. */
void request_mode(uORB::Publication<vehicle_command_s>& commands, const vehicle_status_s& status, uint8_t nav_state);

class Watchdog : public px4::ScheduledWorkItem {
  public:
    static constexpr uint32_t PERIOD_US = 5000;
    static constexpr uint32_t WATCHDOG_US = 25000;
    static constexpr uint32_t STOP_US = 300000;

    explicit Watchdog(Heartbeat& heartbeat);
    void start() { ScheduleOnInterval(PERIOD_US); }
    void stop() { ScheduleClear(); }

  private:
    void Run() override;
    void publish_motors(hrt_abstime now, bool stop);

    Heartbeat& _heartbeat;
    hrt_abstime _ours_since{0}; /* since when the vehicle is armed in our mode, 0: it is not */
    hrt_abstime _tripped_at{0};
    float _collective{0.0f};

    uORB::Subscription _vehicle_status_sub{ORB_ID(vehicle_status)};
    uORB::Subscription _actuator_motors_sub{ORB_ID(actuator_motors)};
    uORB::Publication<actuator_motors_s> _actuator_motors_pub{ORB_ID(actuator_motors)};
    uORB::Publication<vehicle_command_s> _vehicle_command_pub{ORB_ID(vehicle_command)};
};

}  // namespace goshawk
