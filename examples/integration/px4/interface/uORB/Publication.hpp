#pragma once
#include <uORB/uORB.hpp>

namespace uORB {
template <typename T>
class Publication {
  public:
    explicit Publication(Topic topic) : _topic(topic) {}
    bool publish(const T& message) {
        static_assert(sizeof(T) <= sizeof(Slot::data), "a message fits");
        memcpy(slot(_topic).data, &message, sizeof(T));
        slot(_topic).bytes = sizeof(T);
        slot(_topic).generation++;
        return true;
    }

  private:
    Topic _topic;
};
}  // namespace uORB
