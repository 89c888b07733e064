/* The FreeRTOS tasks of examples/integration under a scheduler of the test's own: a millisecond clock, tasks by
   priority, each on its own stack. On a simulated body; one scenario per run, named by the first argument. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <ucontext.h>

#include "simulated_body.h"

/* The source itself: its controller is static, and the test gives orders as the link would. */
#include "goshawk_tasks.c"

#define CHECK(condition)                                                  \
    do {                                                                  \
        if (!(condition)) {                                               \
            printf("%s:%d: CHECK(%s)\n", __FILE__, __LINE__, #condition); \
            exit(1);                                                      \
        }                                                                 \
    } while (0)

enum { TASKS = 3, STACK_BYTES = 1 << 18 };
static struct {
    ucontext_t context;
    TickType_t due;
    UBaseType_t priority;
} tasks[TASKS];
static int task_count, running = -1;
static ucontext_t scheduler;
static TickType_t now_ms;
static bool mutex_is_taken;
static simulated_body body;
static float outputs[TC_ROTORS];
static bool hangs; /* the estimator's driver does not come back */
static unsigned sent;

static void sleep_until(TickType_t due) {
    const int self = running;
    tasks[self].due = due;
    swapcontext(&tasks[self].context, &scheduler);
}

TickType_t xTaskGetTickCount(void) { return now_ms; }
BaseType_t xTaskDelayUntil(TickType_t* previous, TickType_t period) {
    *previous += period;
    sleep_until(*previous);
    return pdTRUE;
}
SemaphoreHandle_t xSemaphoreCreateMutexStatic(StaticSemaphore_t* memory) { return memory; }
BaseType_t xSemaphoreTake(SemaphoreHandle_t semaphore, TickType_t wait) {
    CHECK(semaphore != NULL && wait <= 50u && !mutex_is_taken);
    mutex_is_taken = true;
    return pdTRUE;
}
BaseType_t xSemaphoreGive(SemaphoreHandle_t semaphore) {
    CHECK(semaphore != NULL && mutex_is_taken);
    mutex_is_taken = false;
    return pdTRUE;
}
TaskHandle_t xTaskCreateStatic(TaskFunction_t code, const char* name, uint32_t stack_words, void* parameter,
                               UBaseType_t priority, StackType_t* stack, StaticTask_t* memory) {
    static char stacks[TASKS][STACK_BYTES];
    CHECK(name != NULL && stack_words >= 512u && stack != NULL && memory != NULL && parameter == NULL);
    const int i = task_count++;
    tasks[i].priority = priority;
    CHECK(getcontext(&tasks[i].context) == 0);
    tasks[i].context.uc_stack.ss_sp = stacks[i];
    tasks[i].context.uc_stack.ss_size = STACK_BYTES;
    tasks[i].context.uc_link = NULL;
    makecontext(&tasks[i].context, (void (*)(void))code, 1, NULL);
    return memory;
}

uint64_t board_time_us(void) { return (uint64_t)(1000000 + 1000 * (int64_t)now_ms); }
void board_estimate(tc_estimate* estimate) {
    while (hangs) sleep_until(now_ms + 1u);
    simulated_body_estimate(&body, board_time_us(), estimate);
}
void board_rotor_speeds(const float rotor_speed_rad_s[TC_ROTORS]) {
    memcpy(outputs, rotor_speed_rad_s, sizeof outputs);
}
size_t board_receive(uint8_t* bytes, size_t size) {
    CHECK(size >= 64u);
    memset(bytes, 0, size);
    return 0u;
}
bool board_send(const uint8_t* frame, size_t size) {
    sent += frame[0] == 0xFDu && size > 11u;
    return true;
}

/* One millisecond: every task that is due, the highest priority first; then the body. */
static void tick(void) {
    for (;;) {
        int best = -1;
        for (int i = 0; i < task_count; i++) {
            if (tasks[i].due <= now_ms && (best < 0 || tasks[i].priority > tasks[best].priority)) best = i;
        }
        if (best < 0) break;
        running = best;
        tasks[best].due = ~0u;
        swapcontext(&scheduler, &tasks[best].context);
    }
    simulated_body_step(&body, outputs, 0.001f);
    now_ms++;
}
static void run(float duration_s) {
    for (int i = 0; i < (int)(1000.0f * duration_s); i++) tick();
}

static void begin(void) {
    static tc_link_config config = {.system_id = 1, .component_id = 1, .bytes_per_s = 20000};
    tc_parameters parameters;
    tc_reason reason;
    simulated_body_init(&body);
    tc_parameters_default(&parameters);
    CHECK(goshawk_tasks_start(&parameters, &config, &reason) && reason == TC_OK);
    run(1.0f);
}
static void hover(void) {
    begin();
    CHECK(tc_do(&controller, TC_COMMAND_ARM, 0.0f) == TC_OK);
    run(0.2f);
    CHECK(tc_do(&controller, TC_COMMAND_TAKE_OFF, 1.0f) == TC_OK);
    run(4.0f);
    CHECK(fabsf(body.position_world_m[2] - 1.0f) < 0.05f);
}

static void takes_off_hovers_and_lands(void) {
    hover();
    CHECK(controller.mission.state == TC_HOLD && controller.telemetry.ticks > 2500u && sent > 20u);
    CHECK(tc_do(&controller, TC_COMMAND_LAND, 0.0f) == TC_OK);
    run(6.0f);
    CHECK(controller.mission.state == TC_DISARMED && body.position_world_m[2] <= 0.0f);
    for (int i = 0; i < TC_ROTORS; i++) CHECK(outputs[i] <= 0.0f);
    CHECK(!stopped);
}

static void a_hanging_control_task_loses_its_rotors_within_30_ms(void) {
    hover();
    hangs = true;
    const TickType_t since = now_ms;
    while (outputs[0] > 0.0f) {
        CHECK(now_ms - since <= 30u);
        tick();
    }
    CHECK(now_ms - since >= GOSHAWK_WATCHDOG_MS - WATCHDOG_PERIOD_MS);
    hangs = false; /* it comes back: the rotors stay off */
    run(0.5f);
    for (int i = 0; i < TC_ROTORS; i++) CHECK(outputs[i] <= 0.0f);
}

static void a_hang_on_the_ground_is_no_reason_to_refuse_the_next_flight(void) {
    begin();
    hangs = true;
    run(1.0f);
    hangs = false;
    run(0.1f);
    CHECK(!stopped);
}

static void parameters_that_cannot_fly_are_refused_with_the_reason(void) {
    static const tc_link_config config = {.system_id = 1};
    tc_parameters parameters;
    tc_reason reason;
    tc_parameters_default(&parameters);
    parameters.mass_kg = 40.0f;
    CHECK(!goshawk_tasks_start(&parameters, &config, &reason) && reason == TC_CANNOT_HOVER && task_count == 0);
}

struct scenario {
    const char* name;
    void (*run)(void);
};
#define SCENARIO(name) {#name, name}
static const struct scenario scenarios[] = {
    SCENARIO(takes_off_hovers_and_lands),
    SCENARIO(a_hanging_control_task_loses_its_rotors_within_30_ms),
    SCENARIO(a_hang_on_the_ground_is_no_reason_to_refuse_the_next_flight),
    SCENARIO(parameters_that_cannot_fly_are_refused_with_the_reason),
};

int main(int argc, char* argv[]) {
    for (size_t i = 0; i < sizeof scenarios / sizeof *scenarios; i++) {
        if (argc == 1) printf("%s\n", scenarios[i].name);
        if (argc == 2 && strcmp(argv[1], scenarios[i].name) == 0) {
            scenarios[i].run();
            return 0;
        }
    }
    return argc == 1 ? 0 : 2;
}
