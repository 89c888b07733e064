/* SHA-256, FIPS 180-4 section 6.2. */
#include <string.h>

#include "goshawk_controller/link_codec.h"

static const uint32_t K[64] = {
    0x428a2f98u, 0x71374491u, 0xb5c0fbcfu, 0xe9b5dba5u, 0x3956c25bu, 0x59f111f1u, 0x923f82a4u, 0xab1c5ed5u,
    0xd807aa98u, 0x12835b01u, 0x243185beu, 0x550c7dc3u, 0x72be5d74u, 0x80deb1feu, 0x9bdc06a7u, 0xc19bf174u,
    0xe49b69c1u, 0xefbe4786u, 0x0fc19dc6u, 0x240ca1ccu, 0x2de92c6fu, 0x4a7484aau, 0x5cb0a9dcu, 0x76f988dau,
    0x983e5152u, 0xa831c66du, 0xb00327c8u, 0xbf597fc7u, 0xc6e00bf3u, 0xd5a79147u, 0x06ca6351u, 0x14292967u,
    0x27b70a85u, 0x2e1b2138u, 0x4d2c6dfcu, 0x53380d13u, 0x650a7354u, 0x766a0abbu, 0x81c2c92eu, 0x92722c85u,
    0xa2bfe8a1u, 0xa81a664bu, 0xc24b8b70u, 0xc76c51a3u, 0xd192e819u, 0xd6990624u, 0xf40e3585u, 0x106aa070u,
    0x19a4c116u, 0x1e376c08u, 0x2748774cu, 0x34b0bcb5u, 0x391c0cb3u, 0x4ed8aa4au, 0x5b9cca4fu, 0x682e6ff3u,
    0x748f82eeu, 0x78a5636fu, 0x84c87814u, 0x8cc70208u, 0x90befffau, 0xa4506cebu, 0xbef9a3f7u, 0xc67178f2u};

static uint32_t rotate(uint32_t x, unsigned n) { return (x >> n) | (x << (32u - n)); }

/* One block, whose message schedule is a ring of 16 words in its own place: so the stack stays small. The eight working
   words a to h move on by one place in every round. */
static void compress(tc_sha256* hash) {
    uint32_t s[8];
    memcpy(s, hash->state, sizeof s);
    for (unsigned t = 0; t < 64u; t++) {
        uint32_t* w = &hash->block[t & 15u];
        if (t >= 16u) {
            const uint32_t x = hash->block[(t + 1u) & 15u];
            const uint32_t y = hash->block[(t + 14u) & 15u];
            *w += (rotate(x, 7) ^ rotate(x, 18) ^ (x >> 3)) + hash->block[(t + 9u) & 15u] +
                  (rotate(y, 17) ^ rotate(y, 19) ^ (y >> 10));
        }
        const uint32_t a = s[0];
        const uint32_t e = s[4];
        const uint32_t h =
            s[7] + (rotate(e, 6) ^ rotate(e, 11) ^ rotate(e, 25)) + ((e & s[5]) ^ (~e & s[6])) + K[t] + *w;
        uint32_t next = h + (rotate(a, 2) ^ rotate(a, 13) ^ rotate(a, 22)) + ((a & s[1]) ^ (a & s[2]) ^ (s[1] & s[2]));
        for (unsigned i = 0; i < 8u; i++) {
            const uint32_t moved = s[i];
            s[i] = next;
            next = moved;
        }
        s[4] += h;
    }
    for (unsigned i = 0; i < 8u; i++) {
        hash->state[i] += s[i];
    }
}

void tc_sha256_init(tc_sha256* hash) {
    static const uint32_t start[8] = {0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au,
                                      0x510e527fu, 0x9b05688cu, 0x1f83d9abu, 0x5be0cd19u};
    memcpy(hash->state, start, sizeof start);
    hash->length = 0;
}

void tc_sha256_update(tc_sha256* hash, const uint8_t* bytes, size_t n) {
    for (size_t i = 0; i < n; i++) {
        uint32_t* word = &hash->block[hash->length / 4u % 16u];
        *word = (*word << 8) | bytes[i]; /* four of them push out what was there */
        hash->length++;
        if (hash->length % 64u == 0u) {
            compress(hash);
        }
    }
}

void tc_sha256_final(tc_sha256* hash, uint8_t digest[32]) {
    const uint32_t length = hash->length;
    uint8_t padding = 0x80u; /* one bit, then zeros up to the length */
    do {
        tc_sha256_update(hash, &padding, 1);
        padding = 0;
    } while (hash->length % 64u != 56u);
    hash->block[14] = length >> 29;
    hash->block[15] = length << 3;
    compress(hash);
    for (unsigned i = 0; i < 8u; i++) {
        const uint32_t word = __builtin_bswap32(hash->state[i]);
        memcpy(digest + 4u * i, &word, sizeof word);
    }
}
