/* Text and binary data within SVG and HTML. */
#include "src/base/build.h"

#include "cairn/json_text.h"
#include "src/host/pictures/report_text.h"
#include "src/host/base/utf8.h"

#define FONT_FAMILY "system-ui,-apple-system,'Segoe UI',Roboto,Helvetica,Arial,sans-serif"

void cairn_report_print_escaped(cairn_output *output, const char *text)
{
    size_t length;

    for (; *text != 0; text += length > 0 ? length : 1) {
        length = cairn_utf8_length(text);
        if (*text == '<')
            cairn_output_print(output, "&lt;");
        else if (*text == '>') /* "]]>" must not stand in XML */
            cairn_output_print(output, "&gt;");
        else if (*text == '&')
            cairn_output_print(output, "&amp;");
        else if (*text == '"')
            cairn_output_print(output, "&quot;");
        else if (length == 0 || (cairn_utf8_code_point(text, length) & ~1u) == 0xFFFE)
            cairn_output_print(output, CAIRN_UTF8_REPLACEMENT);
        else if ((unsigned char)*text >= ' ')
            cairn_output_bytes(output, text, length);
    }
}

void cairn_report_print_json(cairn_output *output, const char *text)
{
    char escaped[CAIRN_JSON_CHARACTER_BYTES];

    cairn_output_bytes(output, "\"", 1);
    while (*text != 0)
        cairn_output_bytes(output, escaped, cairn_json_character(&text, escaped));
    cairn_output_bytes(output, "\"", 1);
}

void cairn_report_print_text(cairn_output *output, double x, double y, const char *style,
                             const char *text)
{
    cairn_output_print(output, "<text x=\"%.1f\" y=\"%.1f\" %s>", x, y, style);
    cairn_report_print_escaped(output, text);
    cairn_output_print(output, "</text>\n");
}

void cairn_report_print_keys(cairn_output *output, double y, double step,
                             const cairn_report_key *keys, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        double x = CAIRN_REPORT_MARGIN + 2 + step * i;

        cairn_output_print(output, "<path %s stroke-width=\"3\" d=\"M%.1f %.1fh22\"/>\n",
                           keys[i].style, x, y - 4);
        cairn_report_print_text(output, x + 30, y, "font-size=\"13\" fill=\"#334155\"",
                                keys[i].text);
    }
}

double cairn_report_head_height(const char *title, const char *subtitle)
{
    return CAIRN_REPORT_MARGIN + (title != NULL ? 24 : 0) + (subtitle != NULL ? 20 : 0) +
           (title != NULL || subtitle != NULL ? 12 : 0);
}

void cairn_report_print_head(cairn_output *output, double width, double height, const char *title,
                             const char *subtitle)
{
    double x = CAIRN_REPORT_MARGIN + 2, y = CAIRN_REPORT_MARGIN + 18;

    cairn_output_print(output,
                       "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" "
                       "viewBox=\"0 0 %.0f "
                       "%.0f\" font-family=\"" FONT_FAMILY "\">\n<title>",
                       width, height, width, height);
    cairn_report_print_escaped(output, title != NULL ? title : "Map");
    cairn_output_print(
        output, "</title>\n<rect width=\"100%%\" height=\"100%%\" rx=\"10\" fill=\"#f6f8fa\"/>\n");
    if (title != NULL)
        cairn_report_print_text(output, x, y,
                                "font-size=\"20\" font-weight=\"650\" fill=\"#0f172a\"", title);
    if (subtitle != NULL)
        cairn_report_print_text(output, x, title != NULL ? y + 22 : y,
                                "font-size=\"13\" fill=\"#64748b\"", subtitle);
}

double cairn_report_round_down(double maximum)
{
    double power = 1e-9;

    while (power * 10 <= maximum)
        power *= 10;
    return power * 5 <= maximum ? power * 5 : power * 2 <= maximum ? power * 2 : power;
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
