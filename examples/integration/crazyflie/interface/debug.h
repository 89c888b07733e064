#pragma once
#include <stdio.h>
#define DEBUG_PRINT(...) ((void)printf(DEBUG_MODULE ": " __VA_ARGS__))
