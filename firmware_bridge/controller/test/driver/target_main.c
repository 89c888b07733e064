/* The driver on a bare Cortex-M under QEMU (mps2-an386: M4F, mps2-an500: M7): vector table, FPU on, results by
   semihosting. Prints "crc32 states stack_bytes". TICKS is given at compile time. */
#include <stdint.h>
#include <string.h>

#include "driver.h"
#include "goshawk_controller/goshawk_controller.h"

#define PAINT 0xa5a5a5a5u
#ifndef PAINTED_WORDS
#define PAINTED_WORDS 1024u /* 0 when instructions are counted */
#endif

extern uint32_t stack_top, data_load, data_start, data_end, bss_start, bss_end;

static uint32_t deepest_bytes;
static uint32_t* painted_from;

void reset(void);

static void trap(void) {
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static void* const vectors[16] = {
    (void*)&stack_top, (void*)reset, (void*)trap, (void*)trap, (void*)trap, (void*)trap, (void*)trap};

static void semihost(uint32_t operation, const void* argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register const void* r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void print_hex(uint32_t value, char last) {
    char text[10];
    for (int i = 0; i < 8; i++) text[i] = "0123456789abcdef"[(value >> (28 - 4 * i)) & 15u];
    text[8] = last;
    text[9] = '\0';
    semihost(0x04u, text); /* SYS_WRITE0 */
}

/* With PAINTED_WORDS 0, under `-icount shift=6`: a tick's instructions, 64 ns each, by SysTick's counts of 40 ns. */
static volatile uint32_t* const systick = (volatile uint32_t*)0xe000e010u; /* control, reload, value */
static uint32_t tick_began;

__attribute__((noinline)) void driver_tick_begins(void) {
    uint32_t* sp;
    __asm__ volatile("mov %0, sp" : "=r"(sp));
    painted_from = sp - 16; /* leave what this function itself still uses */
    for (uint32_t i = 1; i <= PAINTED_WORDS; i++) *(volatile uint32_t*)(painted_from - i) = PAINT;
    tick_began = systick[2];
}

__attribute__((noinline)) void driver_tick_ends(void) {
    const uint32_t counts = (tick_began - systick[2]) & 0xffffffu;
    if (PAINTED_WORDS == 0u) print_hex((counts * 40u + 32u) / 64u, '\n');
    uint32_t untouched = PAINTED_WORDS;
    while (untouched > 0u && *(volatile uint32_t*)(painted_from - untouched) == PAINT) untouched--;
    const uint32_t bytes = 4u * untouched + 64u; /* with the 16 words that were left out */
    if (bytes > deepest_bytes) deepest_bytes = bytes;
}

void reset(void) {
    *(volatile uint32_t*)0xe000ed88u |= 0xfu << 20; /* CPACR: floating point on */
    __asm__ volatile("dsb\n\tisb");
    memcpy(&data_start, &data_load, (size_t)((uint8_t*)&data_end - (uint8_t*)&data_start));
    memset(&bss_start, 0, (size_t)((uint8_t*)&bss_end - (uint8_t*)&bss_start));
    uint32_t crc32, states;
    systick[1] = 0xffffffu;
    systick[2] = 0u;
    systick[0] = 5u; /* enabled, processor clock */
    const int failed = driver_run(TICKS, &crc32, &states);
    print_hex(crc32, ' ');
    print_hex(states, ' ');
    print_hex(deepest_bytes, ' ');
    print_hex((uint32_t)failed, '\n');
    semihost(0x18u, (const void*)0x20026u); /* exit, "application exit" */
    trap();
}
