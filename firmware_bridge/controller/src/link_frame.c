/* MAVLink 2 frames: the parser that finds them in a byte stream, building, signing. */
#include <string.h>

#include "copy.h"
#include "goshawk_controller/link_codec.h"
#include "goshawk_dialect.h"

#define MAGIC 0xFDu
#define SIGNED_FLAG 0x01u
#define CHECKSUM 2u
#define SIGNATURE 13u    /* link id, time stamp, six bytes of the hash */
#define STAMPED 7u       /* bytes of it that are signed themselves */
#define LATE_10US 65535u /* 0.65 s: what 16 bits hold */

void tc_frame_read(const tc_frame* frame, unsigned at, void* out, size_t n) {
    const unsigned length = frame->raw[TC_FRAME_LENGTH];
    uint8_t* bytes = (uint8_t*)out;
    for (size_t i = 0; i < n; i++) {
        bytes[i] = at + i < length ? frame->raw[TC_FRAME_HEADER + at + i] : 0u;
    }
}

/* The row of the message whose frame begins here; GOSHAWK_DIALECT_ROWS when it is none of the dialect. */
static unsigned message_of(const uint8_t* raw) {
    unsigned row = 0;
    const uint32_t id = (uint32_t)raw[TC_FRAME_ID] | ((uint32_t)raw[TC_FRAME_ID + 1] << 8);
    while (row < GOSHAWK_DIALECT_ROWS && goshawk_dialect()[row].id != id) {
        row++;
    }
    return raw[TC_FRAME_ID + 2] == 0u && raw[TC_FRAME_FLAGS] <= SIGNED_FLAG ? row : GOSHAWK_DIALECT_ROWS;
}

static uint16_t checksum(const uint8_t* frame, const goshawk_dialect_row* row) {
    const size_t n = TC_FRAME_HEADER - 1u + frame[TC_FRAME_LENGTH];
    return tc_crc16(tc_crc16(0xFFFFu, frame + 1, n), &row->crc_extra, 1);
}

bool tc_frame_next(const uint8_t** bytes, size_t* n, tc_frame* frame, tc_frame_faults* faults) {
    while (*n > 0u) {
        const uint8_t* raw = *bytes;
        size_t length = 1; /* of what is no frame */
        bool whole = false;
        if (raw[0] == MAGIC) {
            if (*n < (size_t)TC_FRAME_HEADER) {
                return false;
            }
            const unsigned row = message_of(raw);
            if (row == (unsigned)GOSHAWK_DIALECT_ROWS) {
                faults->unknown++;
            } else {
                const size_t end = (size_t)TC_FRAME_HEADER + raw[TC_FRAME_LENGTH];
                const size_t all = end + CHECKSUM + SIGNATURE * raw[TC_FRAME_FLAGS];
                if (all > *n) {
                    return false;
                }
                const unsigned sum = checksum(raw, &goshawk_dialect()[row]);
                whole = sum == ((unsigned)raw[end] | ((unsigned)raw[end + 1u] << 8));
                if (whole) {
                    length = all;
                    frame->raw = *bytes;
                    frame->length = (uint16_t)all;
                    frame->message = (uint8_t)row;
                    frame->target_at = goshawk_dialect()[row].target;
                } else {
                    faults->checksum_errors++;
                }
            }
        }
        *bytes += length;
        *n -= length;
        if (whole) {
            return true;
        }
    }
    return false;
}

bool tc_parser_next(tc_parser* parser, const uint8_t** bytes, size_t* n, tc_frame* frame, tc_frame_faults* faults) {
    for (;;) {
        const uint8_t* at = parser->buffer + parser->used;
        size_t left = (size_t)parser->filled - parser->used;
        const bool found = tc_frame_next(&at, &left, frame, faults);
        parser->used = (uint16_t)(parser->filled - left);
        if (found || *n == 0u) {
            return found;
        }
        size_t filled = 0; /* what is left comes to the front, and then what is new */
        while (filled < TC_FRAME_MAX && (filled < left || *n > 0u)) {
            if (filled < left) {
                parser->buffer[filled] = at[filled];
            } else {
                parser->buffer[filled] = **bytes;
                (*bytes)++;
                (*n)--;
            }
            filled++;
        }
        parser->filled = (uint16_t)filled;
        parser->used = 0;
    }
}

void tc_signing_init(tc_signing* signing, const uint8_t key[TC_KEY_BYTES], uint64_t start_10us) {
    tc_fill(signing, 0, sizeof *signing);
    signing->key = key;
    signing->now_10us = start_10us;
    for (unsigned i = 0; i < TC_STREAMS; i++) {
        signing->streams[i].newest_10us = start_10us;
    }
}

/* The six bytes that sign `raw`: everything up to and with link id and time stamp. */
static void sign(const tc_signing* signing, const uint8_t* raw, size_t n, uint8_t digest[32]) {
    tc_sha256 hash;
    tc_sha256_init(&hash);
    tc_sha256_update(&hash, signing->key, TC_KEY_BYTES);
    tc_sha256_update(&hash, raw, n);
    tc_sha256_final(&hash, digest);
}

/* The stream of a sender; else the one that makes room for it, the most silent. */
static tc_stream* find_stream(tc_signing* signing, uint32_t sender) {
    tc_stream* quietest = &signing->streams[0];
    for (unsigned i = 0; i < TC_STREAMS; i++) {
        tc_stream* stream = &signing->streams[i];
        if (stream->sender == sender) {
            return stream;
        }
        if (stream->newest_10us < quietest->newest_10us) {
            quietest = stream;
        }
    }
    return quietest;
}

static uint32_t at_most(uint64_t age_10us) { return (uint32_t)(age_10us < LATE_10US ? age_10us : LATE_10US); }

/* Whether a stamp is a new one. Then it is noted; where there is no room the oldest one goes, and bounds the reach. */
static bool accept(tc_stream* stream, uint64_t stamp_10us) {
    if (stamp_10us > stream->newest_10us) {
        const uint32_t step = at_most(stamp_10us - stream->newest_10us);
        for (unsigned i = 0; i <= TC_RECENT; i++) {
            const uint32_t older = stream->age_10us[i] + step;
            stream->age_10us[i] = (uint16_t)(older < LATE_10US ? older : LATE_10US);
        }
        stream->newest_10us = stamp_10us;
    }
    const uint32_t age_10us = at_most(stream->newest_10us - stamp_10us);
    uint16_t* oldest = &stream->age_10us[0];
    uint16_t* reach = &stream->age_10us[TC_RECENT];
    bool is_new = age_10us < *reach;
    for (unsigned i = 0; i < TC_RECENT; i++) {
        uint16_t* other = &stream->age_10us[i];
        is_new = is_new && *other != age_10us;
        oldest = *other > *oldest ? other : oldest;
    }
    if (is_new) {
        *reach = *oldest < *reach ? *oldest : *reach;
        *oldest = (uint16_t)age_10us;
    }
    return is_new;
}

tc_signature tc_signing_check(tc_signing* signing, const tc_frame* frame) {
    if (frame->raw[TC_FRAME_FLAGS] == 0u) {
        return TC_SIGNATURE_MISSING;
    }
    uint8_t digest[32];
    const size_t n = frame->length - (SIGNATURE - STAMPED);
    const uint8_t* end = frame->raw + n;
    sign(signing, frame->raw, n, digest);
    unsigned difference = 0; /* all six bytes are always compared, so that the time taken tells nothing */
    for (unsigned i = 0; i < SIGNATURE - STAMPED; i++) {
        difference |= (unsigned)digest[i] ^ (unsigned)end[i];
    }
    if (difference != 0u) {
        return TC_SIGNATURE_WRONG;
    }
    uint64_t stamp_10us = 0;
    uint32_t sender = 0;
    memcpy(&stamp_10us, end - 6, 6);
    memcpy(&sender, frame->raw + TC_FRAME_SYSTEM, 2);
    sender |= (uint32_t)end[-7] << 16;
    tc_stream* stream = find_stream(signing, sender);
    if (stream->sender != sender && stamp_10us > stream->newest_10us) { /* its last stamp stays, as the start */
        tc_fill(stream->age_10us, 0, sizeof stream->age_10us);
        stream->sender = sender;
    }
    if (stream->sender != sender || !accept(stream, stamp_10us)) {
        return TC_SIGNATURE_REPLAYED;
    }
    if (stamp_10us > signing->now_10us) {
        signing->now_10us = stamp_10us;
    }
    return TC_SIGNATURE_GOOD;
}

size_t tc_frame_build(uint8_t out[TC_FRAME_MAX], unsigned message, unsigned length, uint8_t sequence, uint8_t system_id,
                      uint8_t component_id, tc_signing* signing, uint8_t link_id) {
    const goshawk_dialect_row* row = &goshawk_dialect()[message];
    while (length > 1u && out[TC_FRAME_HEADER + length - 1u] == 0u) {
        length--;
    }
    out[0] = MAGIC;
    out[TC_FRAME_LENGTH] = (uint8_t)length;
    out[TC_FRAME_FLAGS] = signing != NULL ? SIGNED_FLAG : 0u;
    out[TC_FRAME_FLAGS + 1] = 0;
    out[TC_FRAME_SEQUENCE] = sequence;
    out[TC_FRAME_SYSTEM] = system_id;
    out[TC_FRAME_COMPONENT] = component_id;
    memcpy(out + TC_FRAME_ID, &row->id, 2);
    out[TC_FRAME_ID + 2] = 0;
    size_t n = TC_FRAME_HEADER + length;
    const uint16_t sum = checksum(out, row);
    memcpy(out + n, &sum, sizeof sum);
    n += CHECKSUM;
    if (signing != NULL) {
        uint8_t digest[32];
        signing->now_10us++;
        out[n] = link_id;
        memcpy(out + n + 1u, &signing->now_10us, 6);
        sign(signing, out, n + STAMPED, digest);
        memcpy(out + n + STAMPED, digest, SIGNATURE - STAMPED);
        n += SIGNATURE;
    }
    return n;
}
