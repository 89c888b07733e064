#pragma once
#include <uORB/Subscription.hpp>

namespace uORB {
class SubscriptionInterval : public Subscription {
  public:
    SubscriptionInterval(Topic topic, uint32_t interval_us) : Subscription(topic), _interval_us(interval_us) {}
    bool updated() const { return hrt_absolute_time() >= _last_us + _interval_us && Subscription::updated(); }
    bool copy(void* to) {
        _last_us = hrt_absolute_time();
        return Subscription::copy(to);
    }

  private:
    uint32_t _interval_us;
    hrt_abstime _last_us{0};
};
}  // namespace uORB
