/* Words packed one behind the other. Internal. */
#ifndef WORDS_H
#define WORDS_H

#include <stdint.h>

/* The word with this number, from 0, of many that end in zeros. */
static inline const char* tc_word(const char* words, uint32_t number) {
    while (number > 0u) {
        number -= *words == '\0' ? 1u : 0u;
        words++;
    }
    return words;
}

#endif
