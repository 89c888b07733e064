/* The scripted mission of driver.c. */
#ifndef DRIVER_H
#define DRIVER_H

#include <stdint.h>

/* Returns 0, or a number that says what failed; `states` collects a bit for every mission state that was seen. */
int driver_run(uint32_t ticks, uint32_t* crc32, uint32_t* states);

/* Called right before and after each tick; the host does nothing here, the target measures. */
void driver_tick_begins(void);
void driver_tick_ends(void);

#endif
