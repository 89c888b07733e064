/* MAVLink 2 frames: found in a datagram or in a byte stream, and built. */
#include <string.h>

#include "signing.h"
#include "transport.h"

static const uint8_t MAGIC = 0xFDu;       /* MAVLink 2 begins with it */
static const uint8_t SIGNED_FLAG = 0x01u; /* of the incompatibility flags */
enum { CHECKSUM = 2 };                    /* bytes */

const goshawk_dialect_row* link_row(unsigned message) { return &goshawk_dialect()[message]; }

/* The row of the message whose frame begins here; GOSHAWK_DIALECT_ROWS when it is none of the dialect. */
static unsigned message_of(const uint8_t* raw) {
    unsigned row = 0;
    const uint32_t id = (uint32_t)raw[TC_FRAME_ID] | ((uint32_t)raw[TC_FRAME_ID + 1] << 8);
    while (row < GOSHAWK_DIALECT_ROWS && link_row(row)->id != id) {
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
                const size_t all = end + CHECKSUM + LINK_SIGNATURE * raw[TC_FRAME_FLAGS];
                if (all > *n) {
                    return false;
                }
                const unsigned sum = checksum(raw, link_row(row));
                whole = sum == ((unsigned)raw[end] | ((unsigned)raw[end + 1u] << 8));
                if (whole) {
                    length = all;
                    frame->raw = *bytes;
                    frame->length = (uint16_t)all;
                    frame->message = (uint8_t)row;
                    frame->target_at = link_row(row)->target;
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
        /* What is left comes to the front; what is new fills up the rest. */
        const size_t taken = *n < TC_FRAME_MAX - left ? *n : TC_FRAME_MAX - left;
        for (size_t i = 0; i < left; i++) parser->buffer[i] = at[i];
        memcpy(parser->buffer + left, *bytes, taken);
        *bytes += taken;
        *n -= taken;
        parser->filled = (uint16_t)(left + taken);
        parser->used = 0;
    }
}

size_t tc_frame_build(uint8_t out[TC_FRAME_MAX], unsigned message, unsigned length, uint8_t sequence, uint8_t system_id,
                      uint8_t component_id, tc_signing* signing, uint8_t link_id) {
    const goshawk_dialect_row* row = link_row(message);
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
    out[TC_FRAME_ID] = (uint8_t)row->id;
    out[TC_FRAME_ID + 1] = (uint8_t)(row->id >> 8);
    out[TC_FRAME_ID + 2] = 0;
    const uint16_t sum = checksum(out, row);
    const size_t n = TC_FRAME_HEADER + length;
    out[n] = (uint8_t)sum;
    out[n + 1u] = (uint8_t)(sum >> 8);
    return n + CHECKSUM + (signing != NULL ? link_sign(signing, out, n + CHECKSUM, link_id) : 0u);
}
