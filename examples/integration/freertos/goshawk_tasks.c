#include "goshawk_tasks.h"

#include <string.h>

#include "FreeRTOS.h"
#include "semphr.h"
#include "task.h"

enum {
    CONTROL_PERIOD_MS = 2,
    LINK_PERIOD_MS = 5,
    WATCHDOG_PERIOD_MS = 5,
    LINK_WAIT_MS = 50,
    FRAMES_AT_ONCE = 8,
    STACK_WORDS = 768, /* the controller needs 1 kB at the most, the kernel and your board functions the rest */
    LINK_PRIORITY = 2,
    CONTROL_PRIORITY = 3,
    WATCHDOG_PRIORITY = 4
};

static tc_controller controller;
static tc_link ground_link;
static tc_parser stream;
static SemaphoreHandle_t mutex; /* guards controller and link; FreeRTOS mutexes inherit priority */
static volatile uint32_t finished_ticks;
static volatile bool commanding; /* the rotors turn at our command */
static volatile bool stopped;    /* by the watchdog */

static void write_outputs(const tc_output* output) {
    static const float standing[TC_ROTORS] = {0.0f, 0.0f, 0.0f, 0.0f};
    if (output->in_command) board_rotor_speeds(stopped ? standing : output->rotor_speed_rad_s);
    commanding = output->in_command && tc_mission_rotors_on(output->state);
}

/* The link task holds the mutex for one bounded call at a time, far less than a period; if it is not given back, the
   tick is left out and the watchdog decides. */
static void control_task(void* unused) {
    static tc_estimate estimate;
    TickType_t woken = xTaskGetTickCount();
    (void)unused;
    for (;;) {
        tc_output output;
        (void)xTaskDelayUntil(&woken, pdMS_TO_TICKS(CONTROL_PERIOD_MS));
        board_estimate(&estimate);
        if (xSemaphoreTake(mutex, pdMS_TO_TICKS(CONTROL_PERIOD_MS)) != pdTRUE) continue;
        (void)tc_tick(&controller, board_time_us(), &estimate, &output);
        tc_link_update(&ground_link, board_time_us());
        (void)xSemaphoreGive(mutex);
        write_outputs(&output);
        finished_ticks = finished_ticks + 1u;
    }
}

static void link_task(void* unused) {
    TickType_t woken = xTaskGetTickCount();
    (void)unused;
    for (;;) {
        uint8_t bytes[64], frame[TC_FRAME_MAX];
        size_t n;
        (void)xTaskDelayUntil(&woken, pdMS_TO_TICKS(LINK_PERIOD_MS));
        while ((n = board_receive(bytes, sizeof bytes)) > 0u) {
            if (xSemaphoreTake(mutex, pdMS_TO_TICKS(LINK_WAIT_MS)) != pdTRUE) break;
            tc_link_receive(&ground_link, bytes, n, &stream, board_time_us());
            (void)xSemaphoreGive(mutex);
        }
        for (int i = 0; i < FRAMES_AT_ONCE; i++) {
            if (xSemaphoreTake(mutex, pdMS_TO_TICKS(LINK_WAIT_MS)) != pdTRUE) break;
            n = tc_link_transmit(&ground_link, frame, board_time_us());
            (void)xSemaphoreGive(mutex);
            if (n == 0u || !board_send(frame, n)) break;
        }
    }
}

/* Without the mutex, and of higher priority: it runs while the control task hangs in a loop or waits for ever. What
   hangs in an interrupt, or with interrupts off, is for the hardware watchdog: feed that from here. */
static void watchdog_task(void* unused) {
    static const float standing[TC_ROTORS] = {0.0f, 0.0f, 0.0f, 0.0f};
    TickType_t woken = xTaskGetTickCount();
    uint32_t last = 0u, silent_ms = 0u;
    (void)unused;
    for (;;) {
        (void)xTaskDelayUntil(&woken, pdMS_TO_TICKS(WATCHDOG_PERIOD_MS));
        const uint32_t now = finished_ticks;
        silent_ms = now == last ? silent_ms + WATCHDOG_PERIOD_MS : 0u;
        last = now;
        if (commanding && silent_ms >= GOSHAWK_WATCHDOG_MS) stopped = true;
        if (stopped) board_rotor_speeds(standing);
    }
}

static bool start(TaskFunction_t code, const char* name, UBaseType_t priority, StackType_t stack[STACK_WORDS],
                  StaticTask_t* memory) {
    return xTaskCreateStatic(code, name, STACK_WORDS, NULL, priority, stack, memory) != NULL;
}

bool goshawk_tasks_start(const tc_parameters* parameters, const tc_link_config* config, tc_reason* reason) {
    static StaticSemaphore_t mutex_memory;
    static StaticTask_t memory[3];
    static StackType_t stack[3][STACK_WORDS];
    tc_init(&controller);
    *reason = tc_parameters_set(&controller, parameters);
    if (*reason != TC_OK) return false;
    tc_link_init(&ground_link, &controller, config, board_time_us());
    mutex = xSemaphoreCreateMutexStatic(&mutex_memory);
    return mutex != NULL && start(control_task, "control", CONTROL_PRIORITY, stack[0], &memory[0]) &&
           start(link_task, "link", LINK_PRIORITY, stack[1], &memory[1]) &&
           start(watchdog_task, "watchdog", WATCHDOG_PRIORITY, stack[2], &memory[2]);
}
