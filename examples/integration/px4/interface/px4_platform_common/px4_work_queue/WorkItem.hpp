#pragma once
#include <stdint.h>
#include <string.h>

namespace px4 {

struct wq_config_t {
    const char* name;
    uint16_t stacksize;
    int8_t relative_priority;
};

namespace wq_configurations {
static constexpr wq_config_t rate_ctrl{"wq:rate_ctrl", 3150, 0};
static constexpr wq_config_t nav_and_controllers{"wq:nav_and_controllers", 2240, -13};
}  // namespace wq_configurations

/* The test finds an item by its name and runs it, or does not, as a hanging one. */
class WorkItem {
  public:
    static WorkItem* find(const char* name) {
        for (WorkItem* item = list(); item != nullptr; item = item->_next) {
            if (strcmp(item->_name, name) == 0) return item;
        }
        return nullptr;
    }
    void run_now() { Run(); }
    const wq_config_t& queue() const { return _queue; }

  protected:
    WorkItem(const char* name, const wq_config_t& queue) : _name(name), _queue(queue), _next(list()) { list() = this; }
    virtual ~WorkItem() {
        WorkItem** at = &list();
        while (*at != this) at = &(*at)->_next;
        *at = _next;
    }
    virtual void Run() = 0;

  private:
    static WorkItem*& list() {
        static WorkItem* first = nullptr;
        return first;
    }
    const char* _name;
    const wq_config_t& _queue;
    WorkItem* _next;
};

}  // namespace px4
