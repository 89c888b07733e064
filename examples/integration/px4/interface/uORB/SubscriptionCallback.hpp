#pragma once
#include <px4_platform_common/px4_work_queue/WorkItem.hpp>
#include <uORB/Subscription.hpp>

namespace uORB {
class SubscriptionCallbackWorkItem : public Subscription {
  public:
    SubscriptionCallbackWorkItem(px4::WorkItem*, Topic topic) : Subscription(topic) {}
    bool registerCallback() { return true; }
    void unregisterCallback() {}
};
}  // namespace uORB
