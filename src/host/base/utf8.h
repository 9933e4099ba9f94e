/* utf8: validation of UTF-8 sequences (RFC 3629). Internal to the host library. */
#ifndef CAIRN_HOST_UTF8_H
#define CAIRN_HOST_UTF8_H

#include <stddef.h>
#include <stdint.h>

/* The replacement character U+FFFD, written in place of invalid bytes. */
#define CAIRN_UTF8_REPLACEMENT "\xEF\xBF\xBD"

/* Returns the length in bytes of the UTF-8 character at the start of a 0-terminated text that is
 * not empty; 0 when the bytes are not valid UTF-8. */
static inline size_t cairn_utf8_length(const char *text)
{
    const uint8_t *byte = (const uint8_t *)text;
    size_t length = byte[0] < 0x80   ? 1
                    : byte[0] < 0xC2 ? 0
                    : byte[0] < 0xE0 ? 2
                    : byte[0] < 0xF0 ? 3
                    : byte[0] < 0xF5 ? 4
                                     : 0;
    size_t i;

    for (i = 1; i < length; i++)
        if ((byte[i] & 0xC0) != 0x80)
            return 0;
    /* An overlong encoding, a surrogate, or a code point beyond U+10FFFF. */
    if ((byte[0] == 0xE0 && byte[1] < 0xA0) || (byte[0] == 0xED && byte[1] > 0x9F) ||
        (byte[0] == 0xF0 && byte[1] < 0x90) || (byte[0] == 0xF4 && byte[1] > 0x8F))
        return 0;
    return length;
}

/* Returns the code point of the valid character of `length` bytes at the start of a text. */
static inline uint32_t cairn_utf8_code_point(const char *text, size_t length)
{
    const uint8_t *byte = (const uint8_t *)text;
    uint32_t code = length > 1 ? byte[0] & (0x7Fu >> length) : byte[0];

    for (size_t i = 1; i < length; i++)
        code = code << 6 | (byte[i] & 0x3Fu);
    return code;
}

#endif
