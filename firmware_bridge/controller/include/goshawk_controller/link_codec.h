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
#define TC_FRAME_HEADER 10u
#define TC_STREAMS 4u /* how many (system, component, link) may sign towards one endpoint at the same time */

/* CRC-16/MCRF4XX, continued from `crc` (start with 0xFFFF). */
uint16_t tc_crc16(uint16_t crc, const uint8_t* bytes, size_t n);

/* SHA-256 (FIPS 180-4): init, then update as often as wanted, then final once. */
typedef struct {
    uint32_t state[8];
    uint64_t length;    /* bytes so far */
    uint32_t block[16]; /* the one being filled; then its message schedule, in place */
} tc_sha256;

void tc_sha256_init(tc_sha256* hash);
void tc_sha256_update(tc_sha256* hash, const uint8_t* bytes, size_t n);
void tc_sha256_final(tc_sha256* hash, uint8_t digest[32]);

/* A frame that passed its checksum. Its payload lies in the parser's buffer and is gone after the next call. */
typedef struct {
    uint64_t timestamp_10us; /* of the signature */
    const uint8_t* payload;  /* as it came: what is missing at its end is zero */
    uint32_t id;
    uint8_t sequence;
    uint8_t system_id;
    uint8_t component_id;
    uint8_t link_id; /* of the signature */
    bool is_signed;
    uint8_t payload_length;
    uint16_t raw_length; /* of the frame as it came */
} tc_frame;

/* Cuts a byte stream into frames. Zero it to start. */
typedef struct {
    uint8_t buffer[TC_FRAME_MAX];
    uint16_t filled;
    uint16_t frame_length;    /* of the frame handed out last: taken off at the next call */
    uint32_t checksum_errors; /* frames whose checksum failed */
    uint32_t unknown;         /* starts that were no frame of this dialect */
} tc_parser;

/* Takes bytes from (*bytes, *n) until a frame is complete (true) or none are left (false). `parser->buffer` then holds
   the raw frame until the next call. A broken frame costs only itself: the search goes on at its second byte. */
bool tc_parser_next(tc_parser* parser, const uint8_t** bytes, size_t* n, tc_frame* frame);

/* Forgets an unfinished frame: at the end of a datagram, whose rest will never come. */
void tc_parser_flush(tc_parser* parser);

#define TC_RECENT 16u

/* Who signs: a (system, component, link). Frames may overtake each other: one that is late by less than a second is
   accepted if it is not one of the last TC_RECENT accepted ones nor older than all of them. None counts twice. */
typedef struct {
    uint64_t newest_10us;
    uint64_t floor_10us;        /* at or below this all is refused */
    uint32_t recent[TC_RECENT]; /* low words of the stamps accepted last */
    uint8_t count;
    uint8_t system_id, component_id, link_id;
} tc_stream;

/* Signing and checking with one shared key (MAVLink 2 message signing). Time stamps count 10 microseconds. When there
   is no room for a new stream the one that has been silent longest goes, and its last stamp becomes the start: so
   nothing it ever sent can come back. */
typedef struct {
    const uint8_t* key;  /* TC_KEY_BYTES; the caller's, and stays where it is */
    uint64_t now_10us;   /* next stamp to send is above it; lifted by every accepted frame */
    uint64_t start_10us; /* a new stream must be later than this: what was recorded before the start stays refused */
    tc_stream streams[TC_STREAMS];
} tc_signing;

typedef enum { TC_SIGNATURE_GOOD = 0, TC_SIGNATURE_MISSING, TC_SIGNATURE_WRONG, TC_SIGNATURE_REPLAYED } tc_signature;

void tc_signing_init(tc_signing* signing, const uint8_t key[TC_KEY_BYTES], uint64_t start_10us);

/* Verdict on a frame; `raw` is the frame's bytes as they came. Only a good one changes `signing`. */
tc_signature tc_signing_check(tc_signing* signing, const tc_frame* frame, const uint8_t* raw);

/* Builds a frame of a message of the dialect into `out`; signs it if `signing` is not NULL. Trailing zeros of the
   payload are cut; it may lie in `out` already, behind TC_FRAME_HEADER bytes. Returns its length. */
size_t tc_frame_build(uint8_t out[TC_FRAME_MAX], uint32_t id, const uint8_t* payload, unsigned length, uint8_t sequence,
                      uint8_t system_id, uint8_t component_id, tc_signing* signing, uint8_t link_id);

#ifdef __cplusplus
}
#endif
#endif
