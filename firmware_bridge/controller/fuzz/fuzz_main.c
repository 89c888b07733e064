/* Drives fuzz_link.c where there is no libFuzzer: random inputs with a seed, or the files named on the command line.

     fuzz_link SEED RUNS        RUNS inputs from the seed on; the seed of a failing one is printed as it starts
     fuzz_link FILE...          replay */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define LONGEST 2048u

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

static uint64_t next(uint64_t* state) { /* xorshift64* */
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return *state * 2685821657736338717u;
}

/* Mostly small bytes: ids, counts and flags are small, and a lease must be taken before anything else counts. */
static size_t invent(uint64_t seed, uint8_t data[LONGEST]) {
    uint64_t state = seed * 0x9E3779B97F4A7C15u + 1u;
    const size_t n = next(&state) % LONGEST;
    const unsigned wild = (unsigned)(next(&state) % 4u);
    static const uint8_t lease[] = {0, 0, 7, 9, 0, 0, 0, 0, 0, 1};
    for (size_t i = 0; i < n; i++) {
        const uint64_t r = next(&state);
        data[i] = (uint8_t)((r & 0x300u) == 0u || wild == 3u ? r >> 16 : (r >> 16) % 16u);
    }
    for (size_t i = 0; i < sizeof lease && i < n && wild != 0u; i++) {
        data[i] = lease[i];
    }
    return n;
}

static int replay(const char* path) {
    static uint8_t data[1u << 20];
    FILE* file = fopen(path, "rb");
    if (file == NULL) {
        fprintf(stderr, "cannot read %s\n", path);
        return 1;
    }
    const size_t n = fread(data, 1, sizeof data, file);
    (void)fclose(file);
    return LLVMFuzzerTestOneInput(data, n);
}

int main(int argc, char** argv) {
    static uint8_t data[LONGEST];
    char* end = argv[argc - 1];
    const uint64_t seed = argc == 3 ? strtoull(argv[1], &end, 10) : 0u;
    if (argc != 3 || *end != '\0') {
        int failed = 0;
        for (int i = 1; i < argc; i++) {
            failed |= replay(argv[i]);
        }
        return failed;
    }
    const uint64_t runs = strtoull(argv[2], NULL, 10);
    for (uint64_t i = 0; i < runs; i++) {
        const size_t n = invent(seed + i, data);
        if (i % 1000u == 0u) {
            fprintf(stderr, "from seed %llu\n", (unsigned long long)(seed + i));
        }
        (void)LLVMFuzzerTestOneInput(data, n);
    }
    printf("%llu runs, no finding\n", (unsigned long long)runs);
    return 0;
}
