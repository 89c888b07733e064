/* Prints what the C reader finds in each file: "status count", then for each point its place and descriptor. */
#include <stdio.h>
#include <stdlib.h>

#include "goshawk_localization_map.h"

static void print_map(const gl_map* map) {
    for (uint32_t i = 0u; i <= map->count; i++) { /* one too many: refused, not read */
        int32_t offset_mm[3];
        uint8_t descriptor[GL_DESCRIPTOR];
        if (gl_point(map, i, offset_mm) != GL_OK || gl_descriptor(map, i, descriptor) != GL_OK) {
            continue;
        }
        for (int axis = 0; axis < 3; axis++) {
            printf("%lld ", 1000ll * map->origin_world_m[axis] + offset_mm[axis]);
        }
        for (unsigned k = 0u; k < GL_DESCRIPTOR; k++) {
            printf("%u ", descriptor[k]);
        }
        printf("\n");
    }
}

int main(int count, char** names) {
    for (int k = 1; k < count; k++) {
        FILE* file = fopen(names[k], "rb");
        if (file == NULL || fseek(file, 0, SEEK_END) != 0) {
            return 1;
        }
        const size_t size = (size_t)ftell(file);
        uint8_t* bytes = malloc(size); /* exactly as long as the file: the sanitizer sees one byte too many */
        rewind(file);
        if ((size > 0u && bytes == NULL) || fread(bytes, 1u, size, file) != size) {
            return 1;
        }
        fclose(file);
        gl_map map;
        const gl_status status = gl_open(&map, bytes, size);
        printf("%d %u\n", (int)status, (unsigned)map.count);
        print_map(&map);
        free(bytes);
    }
    return 0;
}
