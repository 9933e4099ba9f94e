/* Texts and bytes as pictures and pages hold them. */
#include "src/core/build.h"

#include <string.h>

#include "src/host/report_text.h"

#define FONT "system-ui,-apple-system,'Segoe UI',Roboto,Helvetica,Arial,sans-serif"

#define REPLACEMENT "\xEF\xBF\xBD"

/* Bytes of the UTF-8 character at the start of a text that is not empty; 0: it is none. */
static size_t utf8_length(const char *text)
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
    /* Too long a form, a surrogate, or beyond U+10FFFF. */
    if ((byte[0] == 0xE0 && byte[1] < 0xA0) || (byte[0] == 0xED && byte[1] > 0x9F) ||
        (byte[0] == 0xF0 && byte[1] < 0x90) || (byte[0] == 0xF4 && byte[1] > 0x8F))
        return 0;
    return length;
}

static void print_character(cairn_output *output, const char *text, size_t length)
{
    if (length > 0)
        cairn_output_bytes(output, text, length);
    else
        cairn_output_bytes(output, REPLACEMENT, strlen(REPLACEMENT));
}

void cairn_report_print_escaped(cairn_output *output, const char *text)
{
    size_t length;

    for (; *text != 0; text += length > 0 ? length : 1) {
        length = utf8_length(text);
        if (*text == '<')
            cairn_output_print(output, "&lt;");
        else if (*text == '&')
            cairn_output_print(output, "&amp;");
        else if (*text == '"')
            cairn_output_print(output, "&quot;");
        else if ((unsigned char)*text >= ' ')
            print_character(output, text, length);
    }
}

void cairn_report_print_json(cairn_output *output, const char *text)
{
    size_t length;

    cairn_output_bytes(output, "\"", 1);
    for (; *text != 0; text += length > 0 ? length : 1) {
        length = utf8_length(text);
        if ((unsigned char)*text < ' ' || strchr("\"\\<>&", *text) != NULL)
            cairn_output_print(output, "\\u%04x", (unsigned)(unsigned char)*text);
        else
            print_character(output, text, length);
    }
    cairn_output_bytes(output, "\"", 1);
}

void cairn_report_print_text(cairn_output *output, double x, double y, const char *style, const char *text)
{
    cairn_output_print(output, "<text x=\"%.1f\" y=\"%.1f\" %s>", x, y, style);
    cairn_report_print_escaped(output, text);
    cairn_output_print(output, "</text>\n");
}

double cairn_report_head_height(const char *title, const char *subtitle)
{
    return CAIRN_REPORT_MARGIN + (title != NULL ? 24 : 0) + (subtitle != NULL ? 20 : 0) +
           (title != NULL || subtitle != NULL ? 12 : 0);
}

void cairn_report_print_head(cairn_output *output, double width, double height, const char *title, const char *subtitle)
{
    double x = CAIRN_REPORT_MARGIN + 2, y = CAIRN_REPORT_MARGIN + 18;

    cairn_output_print(output,
                       "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f "
                       "%.0f\" font-family=\"" FONT "\">\n<title>",
                       width, height, width, height);
    cairn_report_print_escaped(output, title != NULL ? title : "Map");
    cairn_output_print(output, "</title>\n<rect width=\"100%%\" height=\"100%%\" rx=\"10\" fill=\"#f6f8fa\"/>\n");
    if (title != NULL)
        cairn_report_print_text(output, x, y, "font-size=\"20\" font-weight=\"650\" fill=\"#0f172a\"", title);
    if (subtitle != NULL)
        cairn_report_print_text(output, x, title != NULL ? y + 22 : y, "font-size=\"13\" fill=\"#64748b\"", subtitle);
}

double cairn_report_round_down(double most)
{
    double power = 1e-9;

    while (power * 10 <= most)
        power *= 10;
    return power * 5 <= most ? power * 5 : power * 2 <= most ? power * 2 : power;
}

void cairn_report_print_base64(cairn_output *output, const uint8_t *bytes, size_t count)
{
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char text[4];
    size_t i, k;

    for (i = 0; i < count; i += 3) {
        size_t left = count - i < 3 ? count - i : 3;
        uint32_t group = 0;

        for (k = 0; k < 3; k++)
            group = group << 8 | (k < left ? bytes[i + k] : 0u);
        for (k = 0; k < 4; k++)
            text[k] = (char)(k <= left ? digit[group >> (18 - 6 * k) & 63u] : '=');
        cairn_output_bytes(output, text, 4);
    }
}
