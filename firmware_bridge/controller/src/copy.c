#include "copy.h"

void tc_copy_bytes(void* to, const void* from, size_t n, uint32_t signs) {
    uint8_t* place = (uint8_t*)to;
    const uint8_t* bytes = (const uint8_t*)from;
    for (size_t i = 0; i < n; i++) {
        place[i] = (uint8_t)(bytes[i] ^ ((signs & 1u) << 7));
        signs >>= 1;
    }
}

void tc_fill(void* to, uint8_t value, size_t n) {
    uint8_t* place = (uint8_t*)to;
    for (size_t i = 0; i < n; i++) place[i] = value;
}
