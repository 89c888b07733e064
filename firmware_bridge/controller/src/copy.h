/* Copying and filling without the C library, whose memcpy and memset take 470 bytes of flash to be fast where nobody
   waits. Internal. */
#ifndef COPY_H
#define COPY_H

#include <stddef.h>
#include <stdint.h>

/* Copies bytes between places that do not overlap. Bit i of `signs` turns the highest bit of byte i over, which is the
   sign where a number ends. */
void tc_copy_bytes(void* to, const void* from, size_t n, uint32_t signs);

void tc_fill(void* to, uint8_t value, size_t n);

#endif
