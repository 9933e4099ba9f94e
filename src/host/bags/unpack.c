/* Decompression of blocks.
 *
 * Method: each format has an adapter of one function that decodes as much as fits into the free
 * space of the buffer. One loop grows the buffer and calls the adapter until the stream ends.
 *
 * Limits: a format whose library is missing at compile time (CAIRN_HAVE_LZ4, CAIRN_HAVE_BZ2,
 * CAIRN_HAVE_ZSTD are not defined) is unsupported. Bytes behind the end of the stream are
 * ignored. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>

#ifdef CAIRN_HAVE_BZ2
#include <bzlib.h>
#endif
#ifdef CAIRN_HAVE_LZ4
#include <lz4frame.h>
#endif
#ifdef CAIRN_HAVE_ZSTD
#include <zstd.h>
#endif

#include "src/host/bags/unpack.h"
#include "src/host/base/interruption.h"

/* Initial capacity of the buffer, bytes. */
#define FIRST_CAPACITY ((size_t)64 * 1024)

/* The unread input and the free space of the output; the adapters advance both. */
typedef struct unpack_stream {
    const uint8_t *in;
    uint8_t *out;
    size_t in_count, out_count;
} unpack_stream;

/* A decoder's state and its functions. decode: CAIRN_OK at the end of the stream, CAIRN_MORE
 * otherwise, CAIRN_BAD_FORMAT, CAIRN_NO_MEMORY. */
typedef struct unpack_decoder {
    const char *name, *library;
    void *(*create)(void);
    cairn_status (*decode)(void *state, unpack_stream *stream);
    void (*destroy)(void *state);
} unpack_decoder;

#ifdef CAIRN_HAVE_LZ4
static void *lz4_create(void)
{
    LZ4F_dctx *state = NULL;

    return LZ4F_isError(LZ4F_createDecompressionContext(&state, LZ4F_VERSION)) ? NULL : state;
}

static cairn_status lz4_decode(void *state, unpack_stream *stream)
{
    size_t in = stream->in_count, out = stream->out_count;
    size_t hint = LZ4F_decompress(state, stream->out, &out, stream->in, &in, NULL);

    if (LZ4F_isError(hint))
        return CAIRN_BAD_FORMAT;
    stream->in += in;
    stream->in_count -= in;
    stream->out += out;
    stream->out_count -= out;
    return hint == 0 ? CAIRN_OK : CAIRN_MORE;
}

static void lz4_destroy(void *state)
{
    (void)LZ4F_freeDecompressionContext(state);
}
#else
#define lz4_create  NULL
#define lz4_decode  NULL
#define lz4_destroy NULL
#endif

#ifdef CAIRN_HAVE_BZ2
static void *bz2_create(void)
{
    bz_stream *state = calloc(1, sizeof *state);

    if (state != NULL && BZ2_bzDecompressInit(state, 0, 0) != BZ_OK) {
        free(state);
        state = NULL;
    }
    return state;
}

static cairn_status bz2_decode(void *context, unpack_stream *stream)
{
    bz_stream *state = context;
    /* its counts are of 32 bits; the loop calls again */
    unsigned in = stream->in_count < UINT32_MAX ? (unsigned)stream->in_count : UINT32_MAX;
    unsigned out = stream->out_count < UINT32_MAX ? (unsigned)stream->out_count : UINT32_MAX;
    int code;

    /* the library reads the input only, though its pointer is not const */
    memcpy(&state->next_in, &stream->in, sizeof state->next_in);
    state->avail_in = in;
    state->next_out = (char *)stream->out;
    state->avail_out = out;
    code = BZ2_bzDecompress(state);
    stream->in += in - state->avail_in;
    stream->in_count -= in - state->avail_in;
    stream->out += out - state->avail_out;
    stream->out_count -= out - state->avail_out;
    if (code == BZ_MEM_ERROR)
        return CAIRN_NO_MEMORY;
    return code == BZ_STREAM_END ? CAIRN_OK : code == BZ_OK ? CAIRN_MORE : CAIRN_BAD_FORMAT;
}

static void bz2_destroy(void *state)
{
    (void)BZ2_bzDecompressEnd(state);
    free(state);
}
#else
#define bz2_create  NULL
#define bz2_decode  NULL
#define bz2_destroy NULL
#endif

#ifdef CAIRN_HAVE_ZSTD
static void *zstd_create(void)
{
    return ZSTD_createDCtx();
}

static cairn_status zstd_decode(void *state, unpack_stream *stream)
{
    ZSTD_inBuffer in = {stream->in, stream->in_count, 0};
    ZSTD_outBuffer out = {stream->out, stream->out_count, 0};
    size_t hint = ZSTD_decompressStream(state, &out, &in);

    stream->in += in.pos;
    stream->in_count -= in.pos;
    stream->out += out.pos;
    stream->out_count -= out.pos;
    if (ZSTD_isError(hint))
        return CAIRN_BAD_FORMAT;
    return hint == 0 ? CAIRN_OK : CAIRN_MORE;
}

static void zstd_destroy(void *state)
{
    (void)ZSTD_freeDCtx(state);
}
#else
#define zstd_create  NULL
#define zstd_decode  NULL
#define zstd_destroy NULL
#endif

/* By cairn_packing. */
static const unpack_decoder decoders[] = {
    {"none", "none", NULL, NULL, NULL},
    {"lz4", "liblz4", lz4_create, lz4_decode, lz4_destroy},
    {"bz2", "libbz2", bz2_create, bz2_decode, bz2_destroy},
    {"zstd", "libzstd", zstd_create, zstd_decode, zstd_destroy}};

cairn_packing cairn_packing_find(const char *name, size_t length)
{
    cairn_packing packing;

    for (packing = CAIRN_PACKING_NONE; length > 0 && packing < CAIRN_PACKING_UNKNOWN; packing++)
        if (strlen(decoders[packing].name) == length &&
            memcmp(decoders[packing].name, name, length) == 0)
            return packing;
    return length > 0 ? CAIRN_PACKING_UNKNOWN : CAIRN_PACKING_NONE;
}

const char *cairn_packing_library(cairn_packing packing)
{
    return packing < CAIRN_PACKING_UNKNOWN ? decoders[packing].library : "a library";
}

int32_t cairn_packing_is_built(cairn_packing packing)
{
    return packing == CAIRN_PACKING_NONE ||
           (packing < CAIRN_PACKING_UNKNOWN && decoders[packing].create != NULL);
}

/* Doubles the capacity, up to max_bytes. */
static cairn_status grow(cairn_unpack_buffer *buffer, size_t max_bytes)
{
    size_t capacity = buffer->capacity > 0 ? 2 * buffer->capacity : FIRST_CAPACITY;
    uint8_t *grown;

    if (buffer->count >= max_bytes)
        return CAIRN_FULL;
    capacity = capacity < max_bytes ? capacity : max_bytes;
    grown = realloc(buffer->bytes, capacity);
    if (grown == NULL)
        return CAIRN_NO_MEMORY;
    buffer->bytes = grown;
    buffer->capacity = capacity;
    return CAIRN_OK;
}

/* Decodes to the end of the stream. */
static cairn_status decode_all(const unpack_decoder *decoder, void *state, unpack_stream *stream,
                               size_t max_bytes, cairn_unpack_buffer *buffer)
{
    for (;;) {
        size_t in = stream->in_count, space;
        cairn_status status = CAIRN_OK;

        if (cairn_interruption_is_requested())
            return CAIRN_MORE;
        /* one byte more than allowed shows that there is more */
        if (buffer->count == buffer->capacity)
            status = grow(buffer, max_bytes + 1);
        if (status != CAIRN_OK)
            return status;
        space = buffer->capacity - buffer->count;
        stream->out = buffer->bytes + buffer->count;
        stream->out_count = space;
        status = decoder->decode(state, stream);
        buffer->count += space - stream->out_count;
        if (buffer->count > max_bytes) {
            buffer->count = max_bytes;
            return CAIRN_FULL;
        }
        if (status != CAIRN_MORE)
            return status;
        if (stream->in_count == in && stream->out_count == space)
            return CAIRN_TRUNCATED;
    }
}

cairn_status cairn_unpack(cairn_packing packing, const uint8_t *bytes, size_t count,
                          size_t max_bytes, cairn_unpack_buffer *buffer)
{
    unpack_stream stream = {.in = bytes, .in_count = count};
    cairn_status status;
    void *state;

    buffer->count = 0;
    if (packing == CAIRN_PACKING_NONE || !cairn_packing_is_built(packing))
        return CAIRN_UNSUPPORTED;
    state = decoders[packing].create();
    if (state == NULL)
        return CAIRN_NO_MEMORY;
    status = decode_all(&decoders[packing], state, &stream, max_bytes, buffer);
    decoders[packing].destroy(state);
    return status;
}

void cairn_unpack_free(cairn_unpack_buffer *buffer)
{
    free(buffer->bytes);
    memset(buffer, 0, sizeof *buffer);
}
