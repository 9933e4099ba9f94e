/* hash: of states, so that two runs can be compared bit by bit. */
#ifndef CAIRN_FIRMWARE_HASH_H
#define CAIRN_FIRMWARE_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { HASH_START = INT32_C(0x1c9dc511) };

/* The hash so far with so many bytes more, of which those beyond the last whole word of 4 do not
 * count: FNV-1a over words. */
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
