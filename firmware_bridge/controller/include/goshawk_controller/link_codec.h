/* The layers under the link: checksums, SHA-256, MAVLink 2 frames and their signatures. Bytes in, bytes out; no clock,
 * no heap. */
#ifndef GOSHAWK_CONTROLLER_LINK_CODEC_H
#define GOSHAWK_CONTROLLER_LINK_CODEC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TC_FRAME_MAX 280u /* header 10, payload 255, checksum 2, signature 13 */
#define TC_PAYLOAD_MAX 255u
#define TC_KEY_BYTES 32u
#define TC_STREAMS 4u /* how many (system, component, link) may sign towards one endpoint at the same time */

/* CRC-16/MCRF4XX, continued from `crc` (start with 0xFFFF). */
uint16_t tc_crc16(uint16_t crc, const uint8_t* bytes, size_t n);

/* SHA-256 (FIPS 180-4): init, then update as often as wanted, then final once. */
typedef struct {
    uint32_t state[8];
    uint32_t length;    /* bytes so far: less than 4 GiB */
    uint32_t block[16]; /* the one being filled; then its message schedule, in place */
} tc_sha256;

void tc_sha256_init(tc_sha256* hash);
void tc_sha256_update(tc_sha256* hash, const uint8_t* bytes, size_t n);
void tc_sha256_final(tc_sha256* hash, uint8_t digest[32]);

/* A frame that passed its checksum. It lies where it was found: in the datagram, or in the parser. */
typedef struct {
    const uint8_t* raw; /* the whole of it, as it came */
    uint16_t length;    /* of all that */
    uint8_t message;    /* its row in the table of the dialect */
    uint8_t target_at;  /* where the payload names its receiver; 255: nowhere */
} tc_frame;

/* Where what is in a frame. */
enum {
    TC_FRAME_LENGTH = 1, /* of the payload */
    TC_FRAME_FLAGS = 2,  /* 1: signed */
    TC_FRAME_SEQUENCE = 4,
    TC_FRAME_SYSTEM = 5,
    TC_FRAME_COMPONENT = 6,
    TC_FRAME_ID = 7,
    TC_FRAME_HEADER = 10 /* then the payload */
};

/* Copies a part of the payload; what was cut off at its end is zero. */
void tc_frame_read(const tc_frame* frame, unsigned at, void* out, size_t n);

/* What was no frame. */
typedef struct {
    uint32_t checksum_errors; /* frames whose checksum failed */
    uint32_t unknown;         /* starts that were no frame of this dialect */
} tc_frame_faults;

/* Takes bytes from (*bytes, *n) until a frame has been found (true) or no more can be (false): then what is left may
   be the beginning of one. A broken frame costs only itself: the search goes on at its second byte. */
bool tc_frame_next(const uint8_t** bytes, size_t* n, tc_frame* frame, tc_frame_faults* faults);

/* Keeps the unfinished frame of a byte stream. Zero it to start. */
typedef struct {
    uint8_t buffer[TC_FRAME_MAX];
    uint16_t filled;
    uint16_t used; /* up to the end of the frame handed out last: taken off at the next call */
} tc_parser;

/* tc_frame_next for a stream: (*bytes, *n) may end anywhere. The frame is gone after the next call. */
bool tc_parser_next(tc_parser* parser, const uint8_t** bytes, size_t* n, tc_frame* frame, tc_frame_faults* faults);

#define TC_RECENT 16u

/* Who signs: a (system, component, link). Frames may overtake each other: one that is late by less than 0.65 s is
   accepted if it is not one of the last TC_RECENT accepted ones nor older than all of them. None counts twice.
   Ages are counted from the newest stamp, in 10 us, and stay at 65535 once they are there: that is never accepted. */
typedef struct {
    uint64_t newest_10us;
    uint32_t sender;                   /* system, component, link, from the lowest byte on */
    uint16_t age_10us[TC_RECENT + 1u]; /* of the stamps accepted last; then the reach: what is as old is refused */
} tc_stream;

/* Signing and checking with one shared key (MAVLink 2 message signing). Time stamps count 10 microseconds. When there
   is no room for a new stream the one that has been silent longest makes it, and the new one must be later than its
   last stamp: so nothing that it ever sent can come back. */
typedef struct {
    const uint8_t* key; /* TC_KEY_BYTES; the caller's, and stays where it is */
    uint64_t now_10us;  /* next stamp to send is above it; lifted by every accepted frame */
    tc_stream streams[TC_STREAMS];
} tc_signing;

typedef enum { TC_SIGNATURE_GOOD = 0, TC_SIGNATURE_MISSING, TC_SIGNATURE_WRONG, TC_SIGNATURE_REPLAYED } tc_signature;

/* A first stamp must be later than the start: what was recorded before it stays refused. */
void tc_signing_init(tc_signing* signing, const uint8_t key[TC_KEY_BYTES], uint64_t start_10us);

/* Verdict on a frame. Only a good one changes `signing`. */
tc_signature tc_signing_check(tc_signing* signing, const tc_frame* frame);

/* Makes a frame of a payload that lies in `out` already, behind TC_FRAME_HEADER bytes; `message` is its row in the
   table of the dialect. Cuts off the zeros at its end; signs if `signing` is not NULL. Returns the frame's length. */
size_t tc_frame_build(uint8_t out[TC_FRAME_MAX], unsigned message, unsigned length, uint8_t sequence, uint8_t system_id,
                      uint8_t component_id, tc_signing* signing, uint8_t link_id);

#ifdef __cplusplus
}
#endif
#endif
