#pragma once
#include <uORB/uORB.hpp>

namespace uORB {
class Subscription {
  public:
    explicit Subscription(Topic topic) : _topic(topic) {}
    bool updated() const { return slot(_topic).generation != _generation; }
    bool copy(void* to) {
        const Slot& s = slot(_topic);
        if (s.generation == 0) return false;
        memcpy(to, s.data, s.bytes);
        _generation = s.generation;
        return true;
    }
    bool update(void* to) { return updated() && copy(to); }

  private:
    Topic _topic;
    unsigned _generation{0};
};
}  // namespace uORB
