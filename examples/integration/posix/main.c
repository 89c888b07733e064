/* Goshawk on a bare POSIX system: a UDP link, a loop of 500 Hz, a watchdog. Flies a SIMULATED body as it stands.

       goshawk_posix 14550 link.key           serve ground stations at this UDP port, frames signed with that key
       goshawk_posix 14550 link.key --print   also print what the simulated body does

   Two processes: this one controls; the one that owns the rotors (motor_output.c) stops them when this one falls
   silent. For your vehicle, replace read_estimator and write_rotor_speeds, and motor_output.c by your ESC driver. */
#define _DEFAULT_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "goshawk_controller/link.h"
#include "motor_output.h"

enum {
    PERIOD_US = 2000,
    DATAGRAMS_AT_ONCE = 16,
    DATAGRAM_BYTES = 1500,
    LOG_RECORDS = 30000,
    LOG_PERIOD_US = 10000,
    STATION_SILENT_US = 2000000
};

static tc_controller controller;
static tc_link ground_link;
static tc_link_config link_config;
static uint8_t log_memory[LOG_RECORDS * TC_LINK_RECORD]; /* 5 minutes at 100 Hz */
static int motors = -1;                                  /* socket to the process that owns the rotors */
static int udp = -1;
static struct sockaddr_in station; /* where frames go */
static uint64_t station_us;        /* when it last sent one that was accepted */

/* REPLACE: the newest output of your estimator, in these frames and units: world z up, body x forward y left z up,
   SI, quaternion w x y z taking body to world; each group with the time it was true at, on the clock of now_us(). Set
   a bit of `valid` for what holds, the standard deviations if your estimator knows them, and reset_counter with its
   deltas when it moves its frame. Leave the old content where nothing new has come: its time stamps show its age.
   Here: from the simulated body. */
static bool read_estimator(tc_estimate* estimate) {
    motor_sample sample;
    ssize_t n;
    while ((n = recv(motors, &sample, sizeof sample, MSG_DONTWAIT)) == (ssize_t)sizeof sample) {
        *estimate = sample.estimate;
    }
    return n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
}

/* REPLACE: rotor speeds to your ESCs. Nothing is written while another controller flies (in_command is false). */
static bool write_rotor_speeds(const tc_output* output) {
    motor_command command;
    if (!output->in_command) return true;
    memcpy(command.rotor_speed_rad_s, output->rotor_speed_rad_s, sizeof command.rotor_speed_rad_s);
    return send(motors, &command, sizeof command, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)sizeof command ||
           errno == EAGAIN || errno == EWOULDBLOCK;
}

/* A bounded number of datagrams in, then what the byte rate allows out. */
static void serve_link(void) {
    for (int i = 0; i < DATAGRAMS_AT_ONCE; i++) {
        uint8_t bytes[DATAGRAM_BYTES];
        struct sockaddr_in from;
        socklen_t length = sizeof from;
        const ssize_t n = recvfrom(udp, bytes, sizeof bytes, MSG_DONTWAIT, (struct sockaddr*)&from, &length);
        if (n <= 0) break;
        const uint32_t accepted = ground_link.counts.accepted;
        tc_link_receive(&ground_link, bytes, (size_t)n, NULL, now_us());
        const bool known = ground_link.counts.accepted != accepted;
        if (known) station_us = now_us();
        /* A station has to answer a challenge before it is known, so the challenge goes to whoever is there first. */
        if (known || now_us() - station_us > STATION_SILENT_US) station = from;
    }
    uint8_t frame[TC_FRAME_MAX];
    size_t n;
    while (station.sin_port != 0 && (n = tc_link_transmit(&ground_link, frame, now_us())) > 0u) {
        (void)sendto(udp, frame, n, MSG_DONTWAIT, (const struct sockaddr*)&station, sizeof station);
    }
}

static int control_loop(void) {
    tc_estimate estimate = {0};
    uint64_t next_us = now_us();
    for (;;) {
        next_us += PERIOD_US;
        const struct timespec until = {.tv_sec = (time_t)(next_us / 1000000u),
                                       .tv_nsec = (long)(next_us % 1000000u) * 1000};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
        }
        if (now_us() > next_us + 10u * PERIOD_US)
            next_us = now_us(); /* fell behind: missed ticks are not made up for */
        tc_output output;
        if (!read_estimator(&estimate)) return 1; /* the rotors' process is gone */
        (void)tc_tick(&controller, now_us(), &estimate, &output);
        if (!write_rotor_speeds(&output)) return 1;
        tc_link_update(&ground_link, now_us());
        serve_link();
    }
}

static bool read_key(const char* path, uint8_t key[TC_KEY_BYTES]) {
    FILE* file = fopen(path, "r");
    if (!file) return false;
    unsigned value = 0;
    size_t i = 0;
    while (i < TC_KEY_BYTES && fscanf(file, "%2x", &value) == 1) key[i++] = (uint8_t)value;
    fclose(file);
    return i == TC_KEY_BYTES;
}

static bool open_udp(uint16_t port) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    socklen_t length = sizeof address;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK); /* INADDR_ANY for a station on another machine */
    udp = socket(AF_INET, SOCK_DGRAM, 0);
    if (udp < 0 || bind(udp, (const struct sockaddr*)&address, sizeof address) != 0) return false;
    if (getsockname(udp, (struct sockaddr*)&address, &length) != 0) return false;
    printf("link udp://127.0.0.1:%u\n", ntohs(address.sin_port));
    return true;
}

/* 10 us units since 2015-01-01: MAVLink's signature clock. Without a real-time clock: see tc_link_stamp_to_keep. */
static uint64_t signature_clock(void) { return ((uint64_t)time(NULL) - 1420070400u) * 100000u; }

/* The number of this boot, counted in a file beside the key. The link's challenges follow from it: one that comes a
   second time would let recordings of the first one in. So a count that cannot be kept is no reason to go on. */
static bool count_boot(const char* key_path, uint32_t* boot) {
    char path[512];
    unsigned long count = 0;
    const int length = snprintf(path, sizeof path, "%s.boots", key_path);
    if (length < 0 || (size_t)length >= sizeof path) return false;
    FILE* file = fopen(path, "r");
    if (file) {
        const bool read = fscanf(file, "%lu", &count) == 1;
        fclose(file);
        if (!read) return false;
    }
    file = fopen(path, "w");
    if (!file) return false;
    const bool written = fprintf(file, "%lu\n", count + 1) > 0;
    *boot = (uint32_t)(count + 1);
    return fclose(file) == 0 && written;
}

static bool set_up(const char* key_path) {
    tc_parameters parameters;
    tc_init(&controller);
    tc_parameters_default(&parameters); /* REPLACE: your vehicle's; those of the simulated body are the defaults */
    const tc_reason reason = tc_parameters_set(&controller, &parameters);
    if (reason != TC_OK) {
        fprintf(stderr, "parameters refused: %s\n", tc_reason_text(reason));
        return false;
    }
    if (!read_key(key_path, link_config.key)) {
        fprintf(stderr, "%s is not a link key: a file of 64 hexadecimal digits\n", key_path);
        return false;
    }
    if (!count_boot(key_path, &link_config.boot_id)) {
        fprintf(stderr, "%s.boots: the count of boots cannot be read and written; the link needs it\n", key_path);
        return false;
    }
    link_config.system_id = link_config.component_id = 1;
    link_config.sign = true;
    link_config.start_10us = signature_clock();
    link_config.bytes_per_s = 200000;
    link_config.log = log_memory;
    link_config.log_records = LOG_RECORDS;
    link_config.log_period_us = LOG_PERIOD_US;
    tc_link_init(&ground_link, &controller, &link_config, now_us());
    return true;
}

int main(int count, char** words) {
    const bool print = count == 4 && strcmp(words[3], "--print") == 0;
    char* end = NULL;
    const long port = count >= 3 ? strtol(words[1], &end, 10) : -1;
    if (!(count == 3 || print) || *end != '\0' || port < 0 || port > 65535) {
        fprintf(stderr, "usage: %s PORT KEYFILE [--print]   (port 0 takes a free one)\n", words[0]);
        return 2;
    }
    int ends[2];
    if (!set_up(words[2])) return 1;
    if (!open_udp((uint16_t)port) || socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends) != 0) {
        perror("sockets");
        return 1;
    }
    fflush(stdout);
    const pid_t child = fork();
    if (child < 0) {
        perror("fork");
        return 1;
    }
    if (child == 0) {
        close(ends[0]);
        motors = ends[1];
        return control_loop();
    }
    close(ends[1]);
    close(udp);
    printf("controller pid %ld\n", (long)child);
    fflush(stdout);
    return motor_output_run(ends[0], print);
}
