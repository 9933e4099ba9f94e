/* report_text: texts and bytes as pictures and pages hold them. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_TEXT_H
#define CAIRN_HOST_REPORT_TEXT_H

#include <stddef.h>
#include <stdint.h>

#include "cairn/output.h"

/* Text for XML and HTML, in and outside of attributes. Control characters are left out, bytes that are not UTF-8 become
 * U+FFFD. */
void cairn_report_print_escaped(cairn_output *output, const char *text);

/* Text as a JSON string that may stand within a script element; bytes that are not UTF-8 become U+FFFD. */
void cairn_report_print_json(cairn_output *output, const char *text);

void cairn_report_print_base64(cairn_output *output, const uint8_t *bytes, size_t count);

#endif
