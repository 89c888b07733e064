#pragma once
#include <stdio.h>
#define PX4_INFO(...) (printf(__VA_ARGS__), printf("\n"))
#define PX4_ERR(...) (printf("ERROR "), printf(__VA_ARGS__), printf("\n"))
