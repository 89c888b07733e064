#pragma once
#include "FreeRTOS.h"
typedef void* TaskHandle_t;
typedef void (*TaskFunction_t)(void*);
typedef struct {
    int unused;
} StaticTask_t;
TickType_t xTaskGetTickCount(void);
BaseType_t xTaskDelayUntil(TickType_t* previous, TickType_t period);
TaskHandle_t xTaskCreateStatic(TaskFunction_t code, const char* name, uint32_t stack_words, void* parameter,
                               UBaseType_t priority, StackType_t* stack, StaticTask_t* memory);
