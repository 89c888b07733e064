#pragma once
#include <stdint.h>
void motorsStop(void);
uint16_t motorsGetRatio(uint32_t id);
