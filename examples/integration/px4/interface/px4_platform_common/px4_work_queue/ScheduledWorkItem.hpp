#pragma once
#include <drivers/drv_hrt.h>

#include <px4_platform_common/px4_work_queue/WorkItem.hpp>

namespace px4 {
class ScheduledWorkItem : public WorkItem {
  public:
    void ScheduleOnInterval(uint32_t interval_us) { _interval_us = interval_us; }
    void ScheduleClear() { _interval_us = 0; }
    uint32_t interval_us() const { return _interval_us; }

  protected:
    using WorkItem::WorkItem;

  private:
    uint32_t _interval_us{0};
};
}  // namespace px4
