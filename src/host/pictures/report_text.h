/* report_text: text and binary data within SVG and HTML. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_TEXT_H
#define CAIRN_HOST_REPORT_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/output.h"

/* Margin of a picture, px. */
#define CAIRN_REPORT_MARGIN 24.0
/* Prints text escaped for XML and HTML, inside and outside of attributes. Control characters are
 * dropped, bytes that are not UTF-8 become U+FFFD. */
void cairn_report_print_escaped(cairn_output *output, const char *text);

/* Prints text as a JSON string that is safe within a script element; bytes that are not UTF-8
 * become U+FFFD. */
void cairn_report_print_json(cairn_output *output, const char *text);

/* Prints an SVG text element; style: its attributes. */
void cairn_report_print_text(cairn_output *output, double x, double y, const char *style,
                             const char *text);

/* An entry of the legend: a line and its meaning. */
typedef struct cairn_report_key {
    const char *text, *style; /* text, and attributes of the line */
} cairn_report_key;

/* Prints a legend: entries side by side, `step` px apart. */
void cairn_report_print_keys(cairn_output *output, double y, double step,
                             const cairn_report_key *keys, int32_t count);

/* Prints the head of a picture: the svg element, its title and background, title and subtitle as
 * texts (NULL: none). */
void cairn_report_print_head(cairn_output *output, double width, double height, const char *title,
                             const char *subtitle);

/* Returns the height of the head in px, with the margin above it. */
double cairn_report_head_height(const char *title, const char *subtitle);

/* Returns the largest of 1, 2 and 5 times a power of ten that is at most `maximum`, which is above
 * 1e-9. */
double cairn_report_round_down(double maximum);

/* Prints bytes in base 64. */
void cairn_report_print_base64(cairn_output *output, const uint8_t *bytes, size_t count);

#endif
