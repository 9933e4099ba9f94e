/* hash: FNV-1a hash of states, to compare two runs bit by bit. */
#ifndef CAIRN_FIRMWARE_HASH_H
#define CAIRN_FIRMWARE_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { HASH_START = INT32_C(0x1c9dc511) };

/* Returns the hash updated with `bytes` bytes, by FNV-1a over 4-byte words; bytes after the last
 * complete word are ignored. */
static inline uint32_t hash_words(uint32_t hash, const void *data, size_t bytes)
{
    const unsigned char *at = (const unsigned char *)data;

    for (size_t i = 0; i + 4 <= bytes; i += 4) {
        uint32_t word;

        memcpy(&word, at + i, 4);
        hash = (hash ^ word) * UINT32_C(16777619);
    }
    return hash;
}

#endif
