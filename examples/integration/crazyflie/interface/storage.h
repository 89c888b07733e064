#pragma once
#include <stdbool.h>
#include <stddef.h>
bool storageStore(const char* key, const void* buffer, size_t length);
size_t storageFetch(const char* key, void* buffer, size_t length);
