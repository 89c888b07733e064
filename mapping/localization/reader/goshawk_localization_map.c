#include "goshawk_localization_map.h"

#include <string.h>

#define VERSION_AT 8u
#define COUNT_AT 12u
#define ORIGIN_AT 16u
#define LEVELS_AT 28u
#define POINTS_AT 36u
#define PLACE_BYTES 9u
#define CODE_BITS 3u
#define POINT_BYTES 57u
#define CRC_BYTES 4u

static uint32_t read_u24(const uint8_t* bytes) {
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16);
}

static uint32_t read_u32(const uint8_t* bytes) { return read_u24(bytes) | ((uint32_t)bytes[3] << 24); }

/* Two's complement of 24 or 32 bits, without a conversion that the compiler may define. */
static int32_t signed_value(uint32_t value, uint32_t sign_bit) {
    const uint32_t magnitude_bits = sign_bit - 1u;
    int32_t result = (int32_t)(value & magnitude_bits);
    if ((value & sign_bit) != 0u) {
        result = (result - (int32_t)magnitude_bits) - 1;
    }
    return result;
}

/* CRC-32 (IEEE 802.3, reflected 0xEDB88320), four bits at a time. */
static uint32_t crc32(const uint8_t* bytes, size_t count) {
    static const uint32_t table[16] = {0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u,
                                       0x4db26158u, 0x5005713cu, 0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu,
                                       0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu};
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0u; i < count; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4) ^ table[crc & 15u];
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return ~crc;
}

gl_status gl_open(gl_map* map, const uint8_t* bytes, size_t size) {
    static const uint8_t magic[8] = {0x67u, 0x6fu, 0x73u, 0x68u, 0x6cu, 0x6fu, 0x63u, 0x00u}; /* "goshloc" */
    (void)memset(map, 0, sizeof *map);
    if ((bytes == NULL) || (size < (POINTS_AT + CRC_BYTES)) || (memcmp(bytes, magic, sizeof magic) != 0)) {
        return GL_NOT_A_MAP;
    }
    if (read_u32(&bytes[VERSION_AT]) != GL_VERSION) {
        return GL_OTHER_VERSION;
    }
    const uint32_t count = read_u32(&bytes[COUNT_AT]);
    const size_t body_bytes = size - (POINTS_AT + CRC_BYTES);
    if (((body_bytes % POINT_BYTES) != 0u) || ((body_bytes / POINT_BYTES) != count)) {
        return GL_WRONG_SIZE;
    }
    if (crc32(bytes, size - CRC_BYTES) != read_u32(&bytes[size - CRC_BYTES])) {
        return GL_DAMAGED;
    }
    for (uint32_t i = 1u; i < GL_LEVELS; i++) {
        if (bytes[LEVELS_AT + i] <= bytes[(LEVELS_AT + i) - 1u]) {
            return GL_DAMAGED;
        }
    }
    for (uint32_t axis = 0u; axis < 3u; axis++) {
        map->origin_world_m[axis] = signed_value(read_u32(&bytes[ORIGIN_AT + (4u * axis)]), 0x80000000u);
    }
    (void)memcpy(map->level, &bytes[LEVELS_AT], sizeof map->level);
    map->points = &bytes[POINTS_AT];
    map->count = count;
    return GL_OK;
}

gl_status gl_point(const gl_map* map, uint32_t index, int32_t offset_mm[3]) {
    if (index >= map->count) {
        return GL_NO_SUCH_POINT;
    }
    const uint8_t* const point = &map->points[(size_t)index * POINT_BYTES];
    for (uint32_t axis = 0u; axis < 3u; axis++) {
        offset_mm[axis] = signed_value(read_u24(&point[3u * axis]), 0x800000u);
    }
    return GL_OK;
}

gl_status gl_descriptor(const gl_map* map, uint32_t index, uint8_t descriptor[GL_DESCRIPTOR]) {
    if (index >= map->count) {
        return GL_NO_SUCH_POINT;
    }
    const uint8_t* codes = &map->points[((size_t)index * POINT_BYTES) + PLACE_BYTES];
    for (uint32_t group = 0u; group < GL_DESCRIPTOR; group += 8u) { /* eight elements of three bits are three bytes */
        uint32_t bits = read_u24(codes);
        for (uint32_t i = 0u; i < 8u; i++) {
            descriptor[group + i] = map->level[bits & 7u];
            bits >>= CODE_BITS;
        }
        codes = &codes[3];
    }
    return GL_OK;
}
