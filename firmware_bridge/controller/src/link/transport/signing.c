/* Message signing: who signs, what is new. */
#include "signing.h"

#include <string.h>

enum { STAMP = 6, HASH = 6 }; /* bytes */

/* The bytes that sign a frame: over the key and everything up to and with link id and time stamp. */
static void hash_frame(const tc_signing* signing, const uint8_t* frame, size_t n, uint8_t digest[32]) {
    tc_sha256 hash;
    tc_sha256_init(&hash);
    tc_sha256_update(&hash, signing->key, TC_KEY_BYTES);
    tc_sha256_update(&hash, frame, n);
    tc_sha256_final(&hash, digest);
}

static bool same_sender(const tc_sender* a, const tc_sender* b) {
    return a->system_id == b->system_id && a->component_id == b->component_id && a->link_id == b->link_id;
}

/* The stream's index; TC_STREAMS when it is not open. */
static unsigned find(const tc_signing* signing, const tc_frame* frame) {
    const tc_sender sender = tc_frame_sender(frame);
    unsigned found = TC_STREAMS;
    for (unsigned i = 0; i < TC_STREAMS; i++) {
        const tc_stream* stream = &signing->streams[i];
        if (stream->open && same_sender(&stream->sender, &sender)) {
            found = i;
        }
    }
    return found;
}

void tc_signing_init(tc_signing* signing, const uint8_t key[TC_KEY_BYTES], uint64_t start_10us) {
    memset(signing, 0, sizeof *signing);
    signing->key = key;
    signing->now_10us = start_10us;
}

tc_sender tc_frame_sender(const tc_frame* frame) {
    const tc_sender sender = {frame->raw[TC_FRAME_SYSTEM], frame->raw[TC_FRAME_COMPONENT],
                              frame->raw[frame->length - LINK_SIGNATURE]};
    return sender;
}

uint64_t tc_frame_stamp_10us(const tc_frame* frame) {
    const uint8_t* bytes = frame->raw + frame->length - HASH - STAMP;
    uint64_t stamp_10us = 0;
    for (unsigned i = STAMP; i > 0u; i--) {
        stamp_10us = (stamp_10us << 8) | bytes[i - 1u];
    }
    return stamp_10us;
}

static bool is_new(const tc_stream* stream, uint64_t stamp_10us) {
    bool is_new = stamp_10us > stream->floor_10us;
    for (unsigned i = 0; i < TC_RECENT; i++) {
        is_new = is_new && stream->recent_10us[i] != stamp_10us;
    }
    return is_new;
}

tc_signature tc_signing_screen(const tc_signing* signing, const tc_frame* frame) {
    if (frame->raw[TC_FRAME_FLAGS] == 0u) {
        return TC_SIGNATURE_MISSING;
    }
    const unsigned i = find(signing, frame);
    if (i == TC_STREAMS) {
        return TC_SIGNATURE_UNOPENED;
    }
    return is_new(&signing->streams[i], tc_frame_stamp_10us(frame)) ? TC_SIGNATURE_GOOD : TC_SIGNATURE_REPLAYED;
}

bool tc_signing_verify(const tc_signing* signing, const tc_frame* frame) {
    uint8_t digest[32];
    hash_frame(signing, frame->raw, (size_t)frame->length - HASH, digest);
    unsigned difference = 0; /* all six bytes are always compared, so that the time taken shows nothing */
    for (unsigned i = 0; i < HASH; i++) {
        difference |= (unsigned)digest[i] ^ (unsigned)frame->raw[frame->length - HASH + i];
    }
    return difference == 0u;
}

static uint64_t later(uint64_t a, uint64_t b) { return a > b ? a : b; }

/* The new stamp takes the place of the oldest one, which becomes the floor. */
static void note(tc_stream* stream, uint64_t stamp_10us) {
    uint64_t* oldest = &stream->recent_10us[0];
    for (unsigned i = 1; i < TC_RECENT; i++) {
        if (stream->recent_10us[i] < *oldest) {
            oldest = &stream->recent_10us[i];
        }
    }
    stream->floor_10us = later(stream->floor_10us, *oldest);
    *oldest = stamp_10us;
    if (stamp_10us > TC_STAMP_LATE_10US) {
        stream->floor_10us = later(stream->floor_10us, stamp_10us - TC_STAMP_LATE_10US);
    }
}

void tc_signing_accept(tc_signing* signing, const tc_frame* frame) {
    const uint64_t stamp_10us = tc_frame_stamp_10us(frame);
    const unsigned i = find(signing, frame);
    if (i < TC_STREAMS) {
        signing->accepted++;
        signing->streams[i].last_used = signing->accepted;
        note(&signing->streams[i], stamp_10us);
        signing->now_10us = later(signing->now_10us, stamp_10us);
    }
}

/* A free place; else that of the stream unused for longest. */
static tc_stream* make_room(tc_signing* signing, const tc_sender* keep) {
    tc_stream* place = NULL;
    for (unsigned i = 0; i < TC_STREAMS; i++) {
        tc_stream* stream = &signing->streams[i];
        const bool kept = stream->open && same_sender(&stream->sender, keep);
        if (!kept && (place == NULL || (place->open && (!stream->open || stream->last_used < place->last_used)))) {
            place = stream;
        }
    }
    return place;
}

void tc_signing_open(tc_signing* signing, const tc_frame* frame, const tc_sender* keep) {
    tc_stream* stream = make_room(signing, keep);
    const uint64_t stamp_10us = tc_frame_stamp_10us(frame);
    stream->sender = tc_frame_sender(frame);
    stream->open = true;
    stream->floor_10us = stamp_10us;
    for (unsigned i = 0; i < TC_RECENT; i++) {
        stream->recent_10us[i] = stamp_10us;
    }
    signing->accepted++;
    stream->last_used = signing->accepted;
    signing->now_10us = later(signing->now_10us, stamp_10us);
}

size_t link_sign(tc_signing* signing, uint8_t* frame, size_t n, uint8_t link_id) {
    uint8_t digest[32];
    signing->now_10us++;
    frame[n] = link_id;
    for (unsigned i = 0; i < STAMP; i++) {
        frame[n + 1u + i] = (uint8_t)(signing->now_10us >> (8u * i));
    }
    hash_frame(signing, frame, n + 1u + STAMP, digest);
    memcpy(frame + n + 1u + STAMP, digest, HASH);
    return LINK_SIGNATURE;
}
