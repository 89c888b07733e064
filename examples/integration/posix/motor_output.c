#define _POSIX_C_SOURCE 200809L
#include "motor_output.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#include "simulated_body.h"

enum { PERIOD_US = 1000, SAMPLE_EVERY = 2, PRINT_EVERY = 20 };

uint64_t now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

static void wait_until(uint64_t time_us) {
    const struct timespec until = {.tv_sec = (time_t)(time_us / 1000000u),
                                   .tv_nsec = (long)(time_us % 1000000u) * 1000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
    }
}

typedef struct {
    motor_command command; /* what the rotors do */
    uint64_t command_us;   /* when the last one came */
    bool tripped;          /* by the watchdog; only a controller that commands standing rotors lifts it */
    bool gone;             /* the controller's end of the socket is closed */
} outputs;

static bool stands(const motor_command* command) {
    for (int i = 0; i < TC_ROTORS; i++) {
        if (command->rotor_speed_rad_s[i] > 0.0f) return false;
    }
    return true;
}

/* The newest command of those that wait. A controller that comes back after the watchdog tripped must not spin the
   rotors up out of the middle of its flight. */
static void take_commands(outputs* out, int socket_to_controller, uint64_t time_us) {
    motor_command next;
    ssize_t n;
    while ((n = recv(socket_to_controller, &next, sizeof next, MSG_DONTWAIT)) == (ssize_t)sizeof next) {
        out->command_us = time_us;
        if (out->tripped && stands(&next)) out->tripped = false;
        if (!out->tripped) out->command = next;
    }
    out->gone = n == 0 || (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

static void watch(outputs* out, uint64_t time_us) {
    if (out->tripped || stands(&out->command) || time_us - out->command_us <= MOTOR_WATCHDOG_US) return;
    out->tripped = true;
    memset(&out->command, 0, sizeof out->command);
    printf("watchdog: no command for %u ms, rotors stopped\n", MOTOR_WATCHDOG_US / 1000u);
    fflush(stdout);
}

static void print_body(const simulated_body* body, uint64_t since_us) {
    const float* n = body->rotor_speed_rad_s;
    const double mean = 0.25 * ((double)n[0] + (double)n[1] + (double)n[2] + (double)n[3]);
    printf("body %.3f %.3f %.3f %.1f\n", (double)since_us * 1e-6, (double)body->position_world_m[2],
           (double)body->velocity_world_m_s[2], mean);
    fflush(stdout);
}

int motor_output_run(int socket_to_controller, bool print) {
    static simulated_body body;
    outputs out = {.command_us = now_us()};
    const uint64_t start_us = now_us();
    uint64_t next_us = start_us;
    simulated_body_init(&body);
    for (uint32_t step = 0; !(out.gone && stands(&out.command)); step++) {
        next_us += PERIOD_US;
        wait_until(next_us);
        const uint64_t time_us = now_us();
        if (time_us > next_us + 50000u) next_us = time_us; /* this machine stalled: simulated time waits with it */
        take_commands(&out, socket_to_controller, time_us);
        watch(&out, time_us);
        simulated_body_step(&body, out.command.rotor_speed_rad_s, PERIOD_US * 1e-6f);
        if (step % SAMPLE_EVERY == 0u) {
            motor_sample sample;
            simulated_body_estimate(&body, time_us, &sample.estimate);
            (void)send(socket_to_controller, &sample, sizeof sample, MSG_DONTWAIT | MSG_NOSIGNAL); /* full: it hangs */
        }
        if (print && step % PRINT_EVERY == 0u) print_body(&body, time_us - start_us);
    }
    return 0;
}
