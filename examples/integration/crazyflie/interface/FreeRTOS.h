#pragma once
#include <stdint.h>
typedef int BaseType_t;
typedef uint32_t TickType_t;
#define pdTRUE 1
#define pdFALSE 0
#define M2T(ms) ((TickType_t)(ms)) /* a tick is a millisecond */
