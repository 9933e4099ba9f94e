/* Checks of pictures and pages as text. */
#ifndef CAIRN_TESTS_XML_H
#define CAIRN_TESTS_XML_H

#include <string.h>

#include "tests/test.h"

static inline int count_of(const char *string, const char *piece)
{
    int count = 0;

    for (; (string = strstr(string, piece)) != NULL; string++)
        count++;
    return count;
}

/* Hash of a whole picture except the bytes of its images, which are zlib's. */
static inline uint64_t picture_hash(const char *svg)
{
    uint64_t hash = TEST_HASH_START;
    const char *image;

    while ((image = strstr(svg, "base64,")) != NULL) {
        hash = test_hash(hash, svg, (size_t)(image - svg));
        svg = strchr(image, '"');
        assert_non_null(svg);
    }
    return test_hash(hash, svg, strlen(svg));
}

/* Tags close in order and quotes are even. */
static inline void assert_well_formed(const char *xml)
{
    char open[32][32];
    int depth = 0;

    while ((xml = strchr(xml, '<')) != NULL) {
        const char *end = strchr(xml, '>');
        size_t name;
        int quotes = 0;

        assert_non_null(end);
        for (const char *c = xml + 1; c < end; c++) {
            assert_true(*c != '<');
            quotes += *c == '"';
        }
        assert_int_equal(quotes % 2, 0);
        name = strcspn(xml + 1 + (xml[1] == '/'), " />");
        assert_true(name < 32);
        if (xml[1] == '/') {
            assert_true(depth > 0);
            depth--;
            assert_int_equal(strlen(open[depth]), name);
            assert_memory_equal(open[depth], xml + 2, name);
        } else if (end[-1] != '/') {
            assert_true(depth < 32);
            memcpy(open[depth], xml + 1, name);
            open[depth++][name] = '\0';
        }
        xml = end + 1;
    }
    assert_int_equal(depth, 0);
}

#endif
