/* report_text: texts and bytes as pictures and pages hold them. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_TEXT_H
#define CAIRN_HOST_REPORT_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/output.h"

#define CAIRN_REPORT_MARGIN 24.0
/* Text for XML and HTML, in and outside of attributes. Control characters are left out, bytes
 * that are not UTF-8 become U+FFFD. */
void cairn_report_print_escaped(cairn_output *output, const char *text);

/* Text as a JSON string that may stand within a script element; bytes that are not UTF-8 become
 * U+FFFD. */
void cairn_report_print_json(cairn_output *output, const char *text);

/* An SVG text element; style: its attributes. */
void cairn_report_print_text(cairn_output *output, double x, double y, const char *style,
                             const char *text);

/* What a line of a picture means. */
typedef struct cairn_report_key {
    const char *words, *style; /* the line's attributes */
} cairn_report_key;

/* Keys side by side, each so far from the one before. */
void cairn_report_print_keys(cairn_output *output, double y, double step,
                             const cairn_report_key *keys, int32_t count);

/* The start of a picture: the svg element, its title and background, title and subtitle as texts
 * (NULL: none). */
void cairn_report_print_head(cairn_output *output, double width, double height, const char *title,
                             const char *subtitle);

/* The height of what print_head writes, the margin above it included. */
double cairn_report_head_height(const char *title, const char *subtitle);

/* The largest of 1, 2, 5 times a power of ten that is at most so much, which is above 1e-9. */
double cairn_report_round_down(double most);

void cairn_report_print_base64(cairn_output *output, const uint8_t *bytes, size_t count);

#endif
