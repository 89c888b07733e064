/* What the files of the table of worst counts share. */
#ifndef WORST_CASE_H
#define WORST_CASE_H

#include "goshawk_controller/trajectory.h"

/* Around the call that is counted; the largest count of each name and situation is kept. */
void count_begin(void);
void count_end(const char* name, const char* situation);

/* A plan of that many segments, each with all coefficients; its CRC. */
uint32_t worst_case_plan(tc_trajectory* plan, uint16_t segments);
void worst_case_segment(uint16_t index, tc_segment* out);

/* The functions of link.h (worst_case_link.c). */
void worst_case_link(void);

#endif
