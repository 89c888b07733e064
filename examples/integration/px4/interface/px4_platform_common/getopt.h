#pragma once
#include <stdio.h>
#include <string.h>
/* Options with a value only. */
inline int px4_getopt(int argc, char* argv[], const char* options, int* index, const char** value) {
    if (*index >= argc || argv[*index][0] != '-') return EOF;
    const char option = argv[*index][1];
    if (strchr(options, option) == nullptr || *index + 1 >= argc) return '?';
    *value = argv[*index + 1];
    *index += 2;
    return option;
}
