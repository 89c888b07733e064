/* The checksum of MAVLink frames (CRC-16/MCRF4XX, reflected 0x8408), without a table. */
#include "goshawk_controller/link_codec.h"

uint16_t tc_crc16(uint16_t crc, const uint8_t* bytes, size_t n) {
    for (size_t i = 0; i < n; i++) {
        unsigned low = (bytes[i] ^ crc) & 0xFFu;
        low ^= (low << 4) & 0xFFu;
        crc = (uint16_t)(((unsigned)crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4));
    }
    return crc;
}
