/* The library's two checksums for the fuzz targets: the same values four bytes at a time, because half of an execution
   would go into them. The address sanitizer sees one byte in sixteen of what they read, which is the narrowest guard it
   puts between objects, and the last. The plain ones of src/base/crc32.c and src/link/transport/crc16.c are left out of
   those programs. */
#include <stdbool.h>
#include <string.h>

#include "goshawk_controller/link_codec.h"
#include "goshawk_controller/trajectory.h"

#define NOT_SANITIZED __attribute__((no_sanitize("address", "undefined")))

typedef struct {
    bool ready;
    uint32_t after[4][256]; /* what a byte leaves behind when so many others follow it */
} tables;

static NOT_SANITIZED void make(tables* t, uint32_t polynomial) {
    for (uint32_t byte = 0; byte < 256u; byte++) {
        uint32_t crc = byte;
        for (unsigned i = 0; i < 8u; i++) crc = (crc >> 1) ^ ((crc & 1u) != 0u ? polynomial : 0u);
        t->after[0][byte] = crc;
    }
    for (uint32_t byte = 0; byte < 256u; byte++) {
        for (unsigned i = 1; i < 4u; i++) {
            const uint32_t crc = t->after[i - 1u][byte];
            t->after[i][byte] = (crc >> 8) ^ t->after[0][crc & 255u];
        }
    }
    t->ready = true;
}

static NOT_SANITIZED uint32_t quick_crc(tables* t, uint32_t polynomial, uint32_t crc, const uint8_t* bytes, size_t n) {
    if (!t->ready) make(t, polynomial);
    for (; n >= 4u; n -= 4u, bytes += 4) {
        uint32_t word;
        memcpy(&word, bytes, sizeof word);
        crc ^= word;
        crc = t->after[3][crc & 255u] ^ t->after[2][(crc >> 8) & 255u] ^ t->after[1][(crc >> 16) & 255u] ^
              t->after[0][crc >> 24];
    }
    for (; n > 0u; n--, bytes++) crc = (crc >> 8) ^ t->after[0][(crc ^ *bytes) & 255u];
    return crc;
}

static void touch(const volatile uint8_t* bytes, size_t n) {
    for (size_t i = 0; i < n; i += 16u) (void)bytes[i];
    if (n > 0u) (void)bytes[n - 1u];
}

uint16_t tc_crc16(uint16_t crc, const uint8_t* bytes, size_t n) {
    static tables t;
    touch(bytes, n);
    return (uint16_t)quick_crc(&t, 0x8408u, crc, bytes, n);
}

uint32_t tc_crc32(uint32_t crc, const uint8_t* bytes, size_t n) {
    static tables t;
    touch(bytes, n);
    return ~quick_crc(&t, 0xedb88320u, ~crc, bytes, n);
}

uint32_t tc_crc32_u32(uint32_t crc, uint32_t value) { /* on a little-endian machine */
    uint8_t bytes[sizeof value];
    memcpy(bytes, &value, sizeof value);
    return tc_crc32(crc, bytes, sizeof bytes);
}
