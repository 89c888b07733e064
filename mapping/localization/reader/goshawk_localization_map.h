/* A map's points and descriptors, `localization/points.bin`, read in place: no heap, no copy, no floating point, no
   I/O.

       gl_map map;
       const gl_status status = gl_open(&map, bytes, size);       bytes: the whole file, kept as long as `map` is used
       if (status == GL_OK) {
           for (uint32_t i = 0u; i < map.count; i++) {
               int32_t offset_mm[3];
               uint8_t descriptor[GL_DESCRIPTOR];
               (void)gl_point(&map, i, offset_mm);                world = map.origin_world_m + 0.001 * offset_mm
               (void)gl_descriptor(&map, i, descriptor);          to be scaled to unit length before it is compared
           }
       }

   The format is described in docs/reference/formats.md. C99; compiles as C++ as well. */
#ifndef GOSHAWK_LOCALIZATION_MAP_H
#define GOSHAWK_LOCALIZATION_MAP_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GL_VERSION 1u
#define GL_DESCRIPTOR 128u
#define GL_LEVELS 8u

typedef enum {
    GL_OK = 0,
    GL_NOT_A_MAP,     /* shorter than any, or of another kind */
    GL_OTHER_VERSION, /* of the format */
    GL_WRONG_SIZE,    /* not as long as the number of points asks: cut off, or something is behind it */
    GL_DAMAGED,       /* the checksum does not match, or the levels do not increase */
    GL_NO_SUCH_POINT  /* the index is not below the count */
} gl_status;

typedef struct {
    const uint8_t* points;     /* the first point, within the bytes of the file */
    uint32_t count;            /* how many there are */
    int32_t origin_world_m[3]; /* the points are relative to it; z is up */
    uint8_t level[GL_LEVELS];  /* what the codes of a descriptor's elements mean, increasing */
} gl_map;

/* Check a whole file, its checksum too, and find its parts. Unless it returns GL_OK, *map is empty. */
gl_status gl_open(gl_map* map, const uint8_t* bytes, size_t size);

/* Where a point is, in millimetres from the origin. Unless it returns GL_OK, nothing is written. */
gl_status gl_point(const gl_map* map, uint32_t index, int32_t offset_mm[3]);

/* A point's mean descriptor: the square roots of a SIFT descriptor of sum 1, times 512, each the nearest level. */
gl_status gl_descriptor(const gl_map* map, uint32_t index, uint8_t descriptor[GL_DESCRIPTOR]);

#ifdef __cplusplus
}
#endif
#endif
