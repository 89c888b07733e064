/* Lock step for Betaflight's SITL: `LD_PRELOAD` of this makes its clock that of the simulated body.

   Until the body's first packet the firmware's clock is the machine's, but for the time that a busy machine takes from
   it: a firmware whose gyroscope is late by more than its period as it starts never looks at it again. From then on a
   packet stamped t lets the firmware run from t to t plus the step between packets, however long that takes: its main
   thread's clock goes on while it sleeps and, a little, each time it looks, but never past that end; the next packet is
   handed over only there, and after all bytes that had come for the firmware's receiver and serial port before it. So a
   flight does not depend on the machine's load. The firmware itself is unchanged. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define MOTOR_PORT 9002
#define STATE_PORT 9003
#define RC_PORT 9004
#define SERIAL_PORT 5761 /* TCP */
#define SERIAL_US 500
#define LONGEST_READ 1000000 /* looks, a few seconds: a thread that is stuck does not stop the others */
#define LOOK_NS 200          /* what looking at the clock takes */
#define LOOP_PAUSE_NS 50000  /* of the firmware's main loop */
#define LOOPING 1000
#define LOOP_NS 10000 /* what a turn of that loop takes in hardware: with the pause, tasks of 1 kHz run at 500 Hz */
#define MOST_LOOK_NS 20000 /* between two looks at the clock, sleep not counted, as long as it starts */
#define USUAL_STEP_S 1e-3  /* where packets do not tell the step: the first, and one after a pause */
#define FIRST_STEPS 20
#define LARGEST_STEP_S 0.02 /* as in the firmware, which else keeps its clock's rate */

static _Atomic int64_t now_ns, end_ns; /* of the main thread's clock; end_ns 0: not yet in lock step */
static _Atomic int64_t start_ns;       /* of that clock before the lock step */
static int64_t looked_ns, slept_ns;    /* machine's clock at the last look, and sleep asked for since; main thread's */
static double stamp_s, step_s;         /* of the last packet; only the state thread has them */
static atomic_int asked;               /* whether a packet waits for its answer */
static atomic_int answered;            /* how often the motors were set */
static int handed_over;                /* whether a packet waits for its thread to be done with it */
static atomic_int let;                 /* whether the firmware runs for the last packet */

/* Its ports are fixed, and two firmwares would share their packets: none outlives the tests that started it. */
__attribute__((constructor)) static void end_with_parent(void) { prctl(PR_SET_PDEATHSIG, SIGKILL); }

static int64_t machine_ns(clockid_t id) {
    struct timespec at;
    syscall(SYS_clock_gettime, id, &at);
    return (int64_t)at.tv_sec * 1000000000 + at.tv_nsec;
}

static int in_main_thread(void) { return syscall(SYS_gettid) == getpid(); }

static void pause_ns(long ns) {
    struct timespec wait = {0, ns};
    syscall(SYS_nanosleep, &wait, NULL);
}

/* Moves the clock on, at most to the end of the step; whether there was room. The first steps last until the firmware
   sets the motors, which the body waits for. */
static int go_on(int64_t by_ns) {
    int64_t end = atomic_load(&end_ns), now = atomic_load(&now_ns);
    if (now >= end && (atomic_load(&answered) > FIRST_STEPS || !atomic_load(&let) || !atomic_load(&asked))) return 0;
    if (now >= end) atomic_store(&end_ns, end = now + LOOP_NS);
    atomic_store(&now_ns, now + by_ns < end ? now + by_ns : end);
    return 1;
}

/* The machine's clock as long as the firmware starts, less what the machine did meanwhile for others. */
static int64_t starting_ns(void) {
    const int64_t machine = machine_ns(CLOCK_MONOTONIC), since = machine - looked_ns, most = MOST_LOOK_NS + slept_ns;
    const int64_t start = atomic_load(&start_ns);
    atomic_store(&start_ns, start == 0 ? machine : start + (since < most ? since : most));
    looked_ns = machine;
    slept_ns = 0;
    return atomic_load(&start_ns);
}

int clock_gettime(clockid_t id, struct timespec* at) {
    const int starts = atomic_load(&end_ns) == 0;
    if (id != CLOCK_MONOTONIC || (starts && !in_main_thread())) return (int)syscall(SYS_clock_gettime, id, at);
    if (starts) {
        const int64_t start = starting_ns();
        at->tv_sec = start / 1000000000;
        at->tv_nsec = start % 1000000000;
        return 0;
    }
    if (in_main_thread() && !go_on(LOOK_NS)) pause_ns(1000); /* it polls for the time of its next loop */
    const int64_t now = atomic_load(&now_ns);
    at->tv_sec = now / 1000000000;
    at->tv_nsec = now % 1000000000;
    return 0;
}

/* Says that start-up is over, after many pauses of the main loop in a row: before, a step would end amid a delay. */
static void say_when_looping(const struct timespec* pause) {
    static int in_a_row;
    if (in_a_row >= LOOPING) return;
    in_a_row = pause->tv_sec == 0 && pause->tv_nsec == LOOP_PAUSE_NS ? in_a_row + 1 : 0;
    static const char words[] = "[lock step] ready\n";
    if (in_a_row == LOOPING && write(STDERR_FILENO, words, sizeof words - 1) < 0) in_a_row = 0;
}

int nanosleep(const struct timespec* time, struct timespec* left) {
    if (in_main_thread()) {
        say_when_looping(time);
        slept_ns += (int64_t)time->tv_sec * 1000000000 + time->tv_nsec;
    }
    if (atomic_load(&end_ns) == 0 || !in_main_thread()) return (int)syscall(SYS_nanosleep, time, left);
    const int64_t asked_ns = (int64_t)time->tv_sec * 1000000000 + time->tv_nsec;
    if (!go_on(asked_ns == LOOP_PAUSE_NS ? LOOP_NS : asked_ns)) pause_ns(1000);
    return 0;
}

/* The clock stands from the first packet on, before the firmware looks at it: half a second that a busy machine took
   between the first two would leave the firmware's rate of time at next to nothing. */
static void begin(void) {
    const int64_t now = atomic_load(&start_ns) + 1000000; /* never back */
    atomic_store(&now_ns, now);
    atomic_store(&end_ns, now);
}

/* The state thread asks for the next packet: it is done with the last one, and the firmware may run on. */
static void let_run(void) {
    if (!handed_over) return;
    handed_over = 0;
    atomic_store(&end_ns, atomic_load(&now_ns) + (int64_t)(step_s * 1e9 + 0.5));
    atomic_store(&let, 1);
}

/* Whose bytes come before a step: the last socket that its thread has looked at, and whether it looks, done with all
   that it has read. */
typedef struct {
    atomic_int fd, looks;
} input;
static input receiver = {0, 1}, serial = {0, 1};
static atomic_int listening; /* whether the serial port is open */

static int local_port(int fd) {
    struct sockaddr_in own = {0};
    socklen_t size = sizeof own;
    return getsockname(fd, (struct sockaddr*)&own, &size) == 0 ? ntohs(own.sin_port) : 0;
}

static int unread(input* from) {
    int bytes = 0;
    return ioctl(atomic_load(&from->fd), FIONREAD, &bytes) == 0 && bytes > 0;
}

static void wait_for(input* from) {
    for (int left = LONGEST_READ; left > 0 && atomic_load(&from->fd) > 0; left--) {
        if (atomic_load(&from->looks) && !unread(from)) return;
        pause_ns(1000);
    }
}

/* The firmware's thread for TCP drops a port that its main thread has made and not yet opened: it starts when that is
   done. */
static void wait_until_listening(void) {
    while (!atomic_load(&listening)) pause_ns(1000000);
    pause_ns(20000000);
}

int listen(int fd, int backlog) {
    static int (*next)(int, int);
    if (next == NULL) next = dlsym(RTLD_NEXT, "listen");
    const int done = next(fd, backlog);
    if (local_port(fd) == SERIAL_PORT) atomic_store(&listening, 1);
    return done;
}

int select(int count, fd_set* read, fd_set* write, fd_set* other, struct timeval* timeout) {
    static int (*next)(int, fd_set*, fd_set*, fd_set*, struct timeval*);
    if (next == NULL) next = dlsym(RTLD_NEXT, "select");
    const int port = count > 0 ? local_port(count - 1) : 0;
    if (port == STATE_PORT) let_run();
    input* from = port == RC_PORT ? &receiver : port == SERIAL_PORT ? &serial : NULL;
    if (port == 0 && !atomic_load(&listening)) wait_until_listening();
    if (from == NULL) return next(count, read, write, other, timeout);
    if (port == SERIAL_PORT) *timeout = (struct timeval){0, SERIAL_US}; /* answers wait for the next look */
    atomic_store(&from->fd, count - 1);
    atomic_store(&from->looks, 1);
    const int ready = next(count, read, write, other, timeout);
    atomic_store(&from->looks, 0);
    return ready;
}

/* So that a firmware that restarts has its port at once, and not after the minute of its last connection. */
int bind(int fd, const struct sockaddr* at, socklen_t size) {
    static int (*next)(int, const struct sockaddr*, socklen_t);
    if (next == NULL) next = dlsym(RTLD_NEXT, "bind");
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &(int){1}, sizeof(int));
    return next(fd, at, size);
}

ssize_t recvfrom(int fd, void* data, size_t size, int flags, struct sockaddr* from, socklen_t* length) {
    static ssize_t (*next)(int, void*, size_t, int, struct sockaddr*, socklen_t*);
    if (next == NULL) next = dlsym(RTLD_NEXT, "recvfrom");
    const ssize_t got = next(fd, data, size, flags, from, length);
    if (got < (ssize_t)sizeof(double) || local_port(fd) != STATE_PORT) return got;
    double at_s;
    memcpy(&at_s, data, sizeof at_s);
    step_s = at_s > stamp_s && at_s - stamp_s < LARGEST_STEP_S ? at_s - stamp_s : USUAL_STEP_S;
    stamp_s = at_s;
    handed_over = 1;
    atomic_store(&let, 0);
    if (atomic_load(&end_ns) == 0) begin();
    while (atomic_load(&now_ns) < atomic_load(&end_ns)) pause_ns(1000);
    wait_for(&receiver);
    wait_for(&serial);
    atomic_store(&asked, 1);
    return got;
}

/* Outputs are an answer to one packet each; what the firmware sends unasked when it starts is not. */
ssize_t sendto(int fd, const void* data, size_t size, int flags, const struct sockaddr* to, socklen_t length) {
    static ssize_t (*next)(int, const void*, size_t, int, const struct sockaddr*, socklen_t);
    if (next == NULL) next = dlsym(RTLD_NEXT, "sendto");
    const struct sockaddr_in* where = (const struct sockaddr_in*)to;
    if (where != NULL && where->sin_port == htons(MOTOR_PORT)) {
        if (!atomic_exchange(&asked, 0)) return (ssize_t)size;
        atomic_fetch_add(&answered, 1);
    }
    return next(fd, data, size, flags, to, length);
}
