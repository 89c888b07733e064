#pragma once
#include <stdint.h>
struct battery_status_s {
    uint64_t timestamp;
    float voltage_v;
    bool connected;
};
