/* The layers under the link: checksums, SHA-256, MAVLink 2 frames, their signatures. Bytes in, bytes out; no clock, no
   heap. */
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

/* CRC-16/MCRF4XX, continued from `crc` (start with 0xFFFF). */
uint16_t tc_crc16(uint16_t crc, const uint8_t* bytes, size_t n);

/* SHA-256 (FIPS 180-4): init, then update as often as wanted, then final once. */
typedef struct {
    uint32_t state[8];
    uint64_t length;   /* bytes so far */
    uint8_t block[64]; /* the one being filled */
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

/* Signatures (MAVLink 2 message signing): one shared key; a frame carries a time stamp and 48 bits of SHA-256 over key
   and frame. Time stamps count units of 10 microseconds since 2015-01-01 00:00 UTC.

   A stream is who signs: a system, a component, a link id. It is opened by an answer to an unpredictable challenge
   (link.h), and the stamp of that answer is its floor: what was signed before is refused for ever. From then on a
   frame counts once: its stamp is above the floor and none of the last TC_RECENT accepted ones. The floor rises to
   TC_STAMP_LATE_10US below the newest stamp and to every stamp that TC_RECENT newer ones have pushed out, so that
   frames may overtake each other on the way and none is accepted twice. */
#define TC_STREAMS 4u
#define TC_RECENT 8u
#define TC_STAMP_LATE_10US 65000u /* 0.65 s */

typedef struct {
    uint8_t system_id, component_id, link_id;
} tc_sender;

typedef struct {
    tc_sender sender;
    bool open;
    uint64_t floor_10us; /* at and below it everything is refused */
    uint64_t recent_10us[TC_RECENT];
    uint64_t last_used; /* tc_signing.accepted at its last frame */
} tc_stream;

typedef struct {
    const uint8_t* key; /* TC_KEY_BYTES; the caller's, and stays where it is */
    uint64_t now_10us;  /* the next stamp to send is above it; raised by every accepted frame */
    uint64_t accepted;  /* frames so far */
    tc_stream streams[TC_STREAMS];
} tc_signing;

typedef enum {
    TC_SIGNATURE_GOOD = 0,
    TC_SIGNATURE_MISSING,
    TC_SIGNATURE_WRONG,
    TC_SIGNATURE_REPLAYED,
    TC_SIGNATURE_UNOPENED /* of a stream that has not answered a challenge */
} tc_signature;

void tc_signing_init(tc_signing* signing, const uint8_t key[TC_KEY_BYTES], uint64_t start_10us);

/* Who a signed frame claims to be from. */
tc_sender tc_frame_sender(const tc_frame* frame);
uint64_t tc_frame_stamp_10us(const tc_frame* frame);

/* What can be known without a hash: MISSING, UNOPENED, REPLAYED; GOOD means worth checking. */
tc_signature tc_signing_screen(const tc_signing* signing, const tc_frame* frame);

/* Whether the key signed it. The expensive part: about 2 + length / 64 blocks of SHA-256. */
bool tc_signing_verify(const tc_signing* signing, const tc_frame* frame);

/* Notes a frame that was screened and verified: it will not be accepted again. */
void tc_signing_accept(tc_signing* signing, const tc_frame* frame);

/* Opens a stream whose floor is this verified frame's stamp. Where there is no room the one unused for longest goes,
   but never `keep`. */
void tc_signing_open(tc_signing* signing, const tc_frame* frame, const tc_sender* keep);

/* Makes a frame of a payload that lies in `out` already, behind TC_FRAME_HEADER bytes; `message` is its row in the
   table of the dialect. Cuts off the zeros at its end; signs if `signing` is not NULL. Returns the frame's length. */
size_t tc_frame_build(uint8_t out[TC_FRAME_MAX], unsigned message, unsigned length, uint8_t sequence, uint8_t system_id,
                      uint8_t component_id, tc_signing* signing, uint8_t link_id);

#ifdef __cplusplus
}
#endif
#endif
