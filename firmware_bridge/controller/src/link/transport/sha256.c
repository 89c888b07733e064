/* SHA-256, FIPS 180-4. The names are the standard's. */
#include <string.h>

#include "goshawk_controller/link_codec.h"

enum { BLOCK = 64, LENGTH_AT = 56 }; /* bytes of a block, and where the length lies in the last one */

/* Section 4.2.2. */
static const uint32_t K[64] = {
    0x428a2f98u, 0x71374491u, 0xb5c0fbcfu, 0xe9b5dba5u, 0x3956c25bu, 0x59f111f1u, 0x923f82a4u, 0xab1c5ed5u,
    0xd807aa98u, 0x12835b01u, 0x243185beu, 0x550c7dc3u, 0x72be5d74u, 0x80deb1feu, 0x9bdc06a7u, 0xc19bf174u,
    0xe49b69c1u, 0xefbe4786u, 0x0fc19dc6u, 0x240ca1ccu, 0x2de92c6fu, 0x4a7484aau, 0x5cb0a9dcu, 0x76f988dau,
    0x983e5152u, 0xa831c66du, 0xb00327c8u, 0xbf597fc7u, 0xc6e00bf3u, 0xd5a79147u, 0x06ca6351u, 0x14292967u,
    0x27b70a85u, 0x2e1b2138u, 0x4d2c6dfcu, 0x53380d13u, 0x650a7354u, 0x766a0abbu, 0x81c2c92eu, 0x92722c85u,
    0xa2bfe8a1u, 0xa81a664bu, 0xc24b8b70u, 0xc76c51a3u, 0xd192e819u, 0xd6990624u, 0xf40e3585u, 0x106aa070u,
    0x19a4c116u, 0x1e376c08u, 0x2748774cu, 0x34b0bcb5u, 0x391c0cb3u, 0x4ed8aa4au, 0x5b9cca4fu, 0x682e6ff3u,
    0x748f82eeu, 0x78a5636fu, 0x84c87814u, 0x8cc70208u, 0x90befffau, 0xa4506cebu, 0xbef9a3f7u, 0xc67178f2u};

/* Section 4.1.2. */
static uint32_t rotr(uint32_t x, unsigned n) { return (x >> n) | (x << (32u - n)); }
static uint32_t ch(uint32_t x, uint32_t y, uint32_t z) { return (x & y) ^ (~x & z); }
static uint32_t maj(uint32_t x, uint32_t y, uint32_t z) { return (x & y) ^ (x & z) ^ (y & z); }
static uint32_t sum_0(uint32_t x) { return rotr(x, 2) ^ rotr(x, 13) ^ rotr(x, 22); }
static uint32_t sum_1(uint32_t x) { return rotr(x, 6) ^ rotr(x, 11) ^ rotr(x, 25); }
static uint32_t sigma_0(uint32_t x) { return rotr(x, 7) ^ rotr(x, 18) ^ (x >> 3); }
static uint32_t sigma_1(uint32_t x) { return rotr(x, 17) ^ rotr(x, 19) ^ (x >> 10); }

static uint32_t load_big_endian(const uint8_t* bytes) {
    return ((uint32_t)bytes[0] << 24) | ((uint32_t)bytes[1] << 16) | ((uint32_t)bytes[2] << 8) | (uint32_t)bytes[3];
}

static void store_big_endian(uint8_t* bytes, uint32_t word) {
    bytes[0] = (uint8_t)(word >> 24);
    bytes[1] = (uint8_t)(word >> 16);
    bytes[2] = (uint8_t)(word >> 8);
    bytes[3] = (uint8_t)word;
}

/* Section 6.2.2: one block of 64 bytes. */
static void compress(uint32_t H[8], const uint8_t* block) {
    uint32_t W[64];
    for (unsigned t = 0; t < 16u; t++) {
        W[t] = load_big_endian(block + 4u * t);
    }
    for (unsigned t = 16; t < 64u; t++) {
        W[t] = sigma_1(W[t - 2u]) + W[t - 7u] + sigma_0(W[t - 15u]) + W[t - 16u];
    }
    uint32_t a = H[0], b = H[1], c = H[2], d = H[3], e = H[4], f = H[5], g = H[6], h = H[7];
    for (unsigned t = 0; t < 64u; t++) {
        const uint32_t T1 = h + sum_1(e) + ch(e, f, g) + K[t] + W[t];
        const uint32_t T2 = sum_0(a) + maj(a, b, c);
        h = g;
        g = f;
        f = e;
        e = d + T1;
        d = c;
        c = b;
        b = a;
        a = T1 + T2;
    }
    H[0] += a;
    H[1] += b;
    H[2] += c;
    H[3] += d;
    H[4] += e;
    H[5] += f;
    H[6] += g;
    H[7] += h;
}

/* Section 5.3.3. */
void tc_sha256_init(tc_sha256* hash) {
    static const uint32_t start[8] = {0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au,
                                      0x510e527fu, 0x9b05688cu, 0x1f83d9abu, 0x5be0cd19u};
    memcpy(hash->state, start, sizeof start);
    hash->length = 0;
}

void tc_sha256_update(tc_sha256* hash, const uint8_t* bytes, size_t n) {
    while (n > 0u) {
        const size_t filled = (size_t)(hash->length % BLOCK);
        const size_t taken = n < BLOCK - filled ? n : BLOCK - filled;
        memcpy(hash->block + filled, bytes, taken);
        hash->length += (uint64_t)taken;
        bytes = &bytes[taken];
        n -= taken;
        if (filled + taken == BLOCK) {
            compress(hash->state, hash->block);
        }
    }
}

/* Section 5.1.1: a one bit, zeros, and the length in bits. */
void tc_sha256_final(tc_sha256* hash, uint8_t digest[32]) {
    const uint64_t bits = hash->length * 8u;
    size_t filled = (size_t)(hash->length % BLOCK);
    hash->block[filled] = 0x80u;
    filled++;
    if (filled > LENGTH_AT) {
        memset(hash->block + filled, 0, BLOCK - filled);
        compress(hash->state, hash->block);
        filled = 0;
    }
    memset(hash->block + filled, 0, LENGTH_AT - filled);
    store_big_endian(hash->block + LENGTH_AT, (uint32_t)(bits >> 32));
    store_big_endian(hash->block + LENGTH_AT + 4u, (uint32_t)(bits & 0xFFFFFFFFu));
    compress(hash->state, hash->block);
    for (unsigned i = 0; i < 8u; i++) {
        store_big_endian(digest + 4u * i, hash->state[i]);
    }
}
