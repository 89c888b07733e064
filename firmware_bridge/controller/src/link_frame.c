/* MAVLink 2 frames: the parser that finds them in a byte stream, building, signing. */
#include <string.h>

#include "goshawk_controller/link_codec.h"
#include "goshawk_dialect.h"

#define MAGIC 0xFDu
#define HEADER TC_FRAME_HEADER
#define SIGNED_FLAG 0x01u
#define SIGNATURE 13u
#define LATE_10US 65535u /* 0.65 s: what 16 bits hold */

static unsigned get_u16(const uint8_t* b) { return (unsigned)b[0] | ((unsigned)b[1] << 8); }

static uint32_t get_u24(const uint8_t* b) { return (uint32_t)get_u16(b) | ((uint32_t)b[2] << 16); }

enum { NO_FRAME = 0, MORE_NEEDED = 1 };

/* Length of the frame that starts here, and what message it is; NO_FRAME and no message if none can, MORE_NEEDED if the
   header's bytes do not tell yet. */
static size_t frame_length(const uint8_t* b, size_t n, const goshawk_dialect_row** row, tc_frame_faults* faults) {
    *row = NULL;
    if (b[0] != MAGIC) {
        return NO_FRAME;
    }
    if (n < HEADER) {
        return MORE_NEEDED;
    }
    if ((b[2] & ~SIGNED_FLAG) == 0u) {
        *row = goshawk_dialect_of(get_u24(b + 7));
    }
    if (*row == NULL) {
        faults->unknown++;
        return NO_FRAME;
    }
    return HEADER + b[1] + 2u + ((b[2] & SIGNED_FLAG) != 0u ? SIGNATURE : 0u);
}

static uint16_t checksum(const uint8_t* frame, const goshawk_dialect_row* row) {
    return tc_crc16(tc_crc16(0xFFFFu, frame + 1, HEADER - 1u + frame[1]), &row->crc_extra, 1);
}

/* Reads a whole frame; false when its checksum is wrong. */
static bool read_frame(const uint8_t* b, size_t length, const goshawk_dialect_row* row, tc_frame* frame) {
    memset(frame, 0, sizeof *frame);
    frame->raw = b;
    frame->payload = b + HEADER;
    frame->payload_length = b[1];
    frame->raw_length = (uint16_t)length;
    frame->is_signed = (b[2] & SIGNED_FLAG) != 0u;
    frame->sequence = b[4];
    frame->system_id = b[5];
    frame->component_id = b[6];
    frame->id = row->id;
    frame->target_at = row->target;
    if (frame->is_signed) {
        const uint8_t* s = b + length - SIGNATURE;
        frame->link_id = s[0];
        frame->timestamp_10us = (uint64_t)get_u24(s + 1) | ((uint64_t)get_u24(s + 4) << 24);
    }
    return checksum(b, row) == get_u16(b + HEADER + b[1]);
}

bool tc_frame_next(const uint8_t** bytes, size_t* n, tc_frame* frame, tc_frame_faults* faults) {
    while (*n > 0u) {
        const goshawk_dialect_row* row;
        const size_t length = frame_length(*bytes, *n, &row, faults);
        if (length == (size_t)MORE_NEEDED || length > *n) {
            return false;
        }
        const bool whole = row != NULL && read_frame(*bytes, length, row, frame);
        faults->checksum_errors += row != NULL && !whole ? 1u : 0u;
        *bytes += whole ? length : 1u;
        *n -= whole ? length : 1u;
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
        memmove(parser->buffer, at, left);
        const size_t room = TC_FRAME_MAX - left;
        const size_t take = *n < room ? *n : room;
        memcpy(parser->buffer + left, *bytes, take);
        parser->filled = (uint16_t)(left + take);
        parser->used = 0;
        *bytes += take;
        *n -= take;
    }
}

void tc_signing_init(tc_signing* signing, const uint8_t key[TC_KEY_BYTES], uint64_t start_10us) {
    memset(signing, 0, sizeof *signing);
    signing->key = key;
    signing->now_10us = start_10us;
    signing->start_10us = start_10us;
}

/* The six bytes that sign `raw`: everything up to and with link id and time stamp. */
static void sign(const tc_signing* signing, const uint8_t* raw, size_t n, uint8_t digest[32]) {
    tc_sha256 hash;
    tc_sha256_init(&hash);
    tc_sha256_update(&hash, signing->key, TC_KEY_BYTES);
    tc_sha256_update(&hash, raw, n);
    tc_sha256_final(&hash, digest);
}

static bool is_stream_of(const tc_stream* stream, const tc_frame* frame) {
    return stream->count != 0u && stream->system_id == frame->system_id &&
           stream->component_id == frame->component_id && stream->link_id == frame->link_id;
}

/* The stream of a frame; else the one that makes room for it: a free one (its newest stamp is 0), or the most silent.
 */
static tc_stream* find_stream(tc_signing* signing, const tc_frame* frame) {
    tc_stream* quietest = &signing->streams[0];
    for (unsigned i = 0; i < TC_STREAMS; i++) {
        tc_stream* stream = &signing->streams[i];
        if (is_stream_of(stream, frame)) {
            return stream;
        }
        if (stream->newest_10us < quietest->newest_10us) {
            quietest = stream;
        }
    }
    return quietest;
}

/* Gives the stream to a new sender. What the one before sent is older than the new start. */
static void hand_over(tc_signing* signing, tc_stream* stream, const tc_frame* frame) {
    if (stream->newest_10us > signing->start_10us) {
        signing->start_10us = stream->newest_10us;
    }
    memset(stream, 0, sizeof *stream);
    stream->newest_10us = signing->start_10us; /* within reach of it is nothing */
    stream->system_id = frame->system_id;
    stream->component_id = frame->component_id;
    stream->link_id = frame->link_id;
}

static uint16_t low_half(uint64_t stamp_10us) { return (uint16_t)(stamp_10us & 0xFFFFu); }

static bool is_new(const tc_stream* stream, uint64_t stamp_10us) {
    if (stamp_10us > stream->newest_10us) {
        return true;
    }
    bool known = stream->newest_10us - stamp_10us >= stream->reach_10us;
    for (unsigned i = 0; i < stream->count; i++) {
        known = known || stream->recent[i] == low_half(stamp_10us);
    }
    return !known;
}

/* How much older than the newest a remembered stamp is. */
static uint16_t age_of(const tc_stream* stream, unsigned i) {
    return (uint16_t)((low_half(stream->newest_10us) - stream->recent[i]) & 0xFFFF);
}

/* A newer stamp than all before: forgets what 16 bits cannot tell apart from it. */
static void advance(tc_stream* stream, uint64_t stamp_10us) {
    const uint64_t step = stamp_10us - stream->newest_10us;
    unsigned kept = 0;
    for (unsigned i = 0; i < stream->count; i++) {
        if (step + age_of(stream, i) <= LATE_10US) {
            stream->recent[kept] = stream->recent[i];
            kept++;
        }
    }
    stream->count = (uint8_t)kept;
    stream->reach_10us = (uint16_t)(step + stream->reach_10us < LATE_10US ? step + stream->reach_10us : LATE_10US);
    stream->newest_10us = stamp_10us;
}

/* Notes an accepted stamp; when there is no room the oldest one goes, and bounds the reach. */
static void remember(tc_stream* stream, uint64_t stamp_10us) {
    if (stamp_10us > stream->newest_10us) {
        advance(stream, stamp_10us);
    }
    unsigned place = stream->count;
    if (place == TC_RECENT) {
        uint16_t oldest = 0;
        for (unsigned i = 0; i < TC_RECENT; i++) {
            const uint16_t age = age_of(stream, i);
            if (age >= oldest) {
                oldest = age;
                place = i;
            }
        }
        stream->reach_10us = oldest;
    } else {
        stream->count++;
    }
    stream->recent[place] = low_half(stamp_10us);
}

tc_signature tc_signing_check(tc_signing* signing, const tc_frame* frame) {
    const uint8_t* raw = frame->raw;
    if (!frame->is_signed) {
        return TC_SIGNATURE_MISSING;
    }
    uint8_t digest[32];
    sign(signing, raw, frame->raw_length - 6u, digest);
    unsigned difference = 0; /* all six bytes are always compared, so that the time taken tells nothing */
    for (unsigned i = 0; i < 6u; i++) {
        difference |= (unsigned)digest[i] ^ (unsigned)raw[frame->raw_length - 6u + i];
    }
    if (difference != 0u) {
        return TC_SIGNATURE_WRONG;
    }
    tc_stream* stream = find_stream(signing, frame);
    if (is_stream_of(stream, frame)) {
        if (!is_new(stream, frame->timestamp_10us)) {
            return TC_SIGNATURE_REPLAYED;
        }
    } else if (frame->timestamp_10us > signing->start_10us && frame->timestamp_10us > stream->newest_10us) {
        hand_over(signing, stream, frame);
    } else {
        return TC_SIGNATURE_REPLAYED;
    }
    remember(stream, frame->timestamp_10us);
    if (frame->timestamp_10us > signing->now_10us) {
        signing->now_10us = frame->timestamp_10us;
    }
    return TC_SIGNATURE_GOOD;
}

size_t tc_frame_build(uint8_t out[TC_FRAME_MAX], uint32_t id, const uint8_t* payload, unsigned length, uint8_t sequence,
                      uint8_t system_id, uint8_t component_id, tc_signing* signing, uint8_t link_id) {
    const goshawk_dialect_row* row = goshawk_dialect_of(id);
    if (row == NULL) {
        return 0;
    }
    while (length > 1u && payload[length - 1u] == 0u) {
        length--;
    }
    out[0] = MAGIC;
    out[1] = (uint8_t)length;
    out[2] = signing != NULL ? SIGNED_FLAG : 0u;
    out[3] = 0;
    out[4] = sequence;
    out[5] = system_id;
    out[6] = component_id;
    out[7] = (uint8_t)(id & 0xFFu);
    out[8] = (uint8_t)((id >> 8) & 0xFFu);
    out[9] = (uint8_t)((id >> 16) & 0xFFu);
    memmove(out + HEADER, payload, length);
    size_t n = HEADER + length;
    goshawk_put_u16(out + n, checksum(out, row));
    n += 2u;
    if (signing != NULL) {
        uint8_t digest[32];
        signing->now_10us++;
        out[n] = link_id;
        goshawk_put_u32(out + n + 1u, (uint32_t)(signing->now_10us & 0xFFFFFFFFu));
        goshawk_put_u16(out + n + 5u, (uint16_t)((signing->now_10us >> 32) & 0xFFFFu));
        sign(signing, out, n + 7u, digest);
        memcpy(out + n + 7u, digest, 6);
        n += SIGNATURE;
    }
    return n;
}
