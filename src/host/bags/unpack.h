/* unpack: decompression of a block of bytes in memory: lz4 frames, bzip2, zstd. Internal to the
 * host library. */
#ifndef CAIRN_HOST_UNPACK_H
#define CAIRN_HOST_UNPACK_H

#include "cairn/status.h"

/* The compression of a block. */
typedef int32_t cairn_packing;
enum {
    CAIRN_PACKING_NONE = 0,
    CAIRN_PACKING_LZ4 = 1,
    CAIRN_PACKING_BZ2 = 2,
    CAIRN_PACKING_ZSTD = 3,
    CAIRN_PACKING_UNKNOWN = 4
};

/* A growing buffer on the heap; all zero: empty. */
typedef struct cairn_unpack_buffer {
    uint8_t *bytes; /* [count] of [capacity] */
    size_t count, capacity;
} cairn_unpack_buffer;

/* Returns the compression of a name in a file ("", "none", "lz4", "bz2", "zstd");
 * CAIRN_PACKING_UNKNOWN for other names. */
cairn_packing cairn_packing_find(const char *name, size_t length);

/* Returns the name of the library that decompresses, for error texts: "liblz4". */
const char *cairn_packing_library(cairn_packing packing);

/* Returns 1 when this build decompresses the format. */
int32_t cairn_packing_is_built(cairn_packing packing);

/* Decompresses bytes[0 .. count) into the buffer, whose memory is used again. The buffer grows with
 * the output, not with a size that a file declares, up to max_bytes. On failure the buffer holds
 * what was decompressed before the fault.
 *
 * CAIRN_TRUNCATED: the data end early; CAIRN_BAD_FORMAT: they are damaged; CAIRN_FULL: more than
 * max_bytes; CAIRN_UNSUPPORTED: this build lacks the library; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_unpack(cairn_packing packing, const uint8_t *bytes, size_t count,
                                        size_t max_bytes, cairn_unpack_buffer *buffer);

/* Frees the memory of the buffer. */
void cairn_unpack_free(cairn_unpack_buffer *buffer);

#endif
