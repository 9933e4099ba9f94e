/* Figures: positions of points, lines, bars, numbers and the key; refusals; every figure is
 * well-formed XML. */
#include "tests/files.h"
#include "tests/xml.h"

#include <math.h>

#include "cairn/report.h"

static char *draw(const cairn_report_figure *figure)
{
    cairn_file_error error;
    const char *path = files_path("figure.svg");
    char *svg;

    if (cairn_report_figure_write(path, figure, &error) != CAIRN_OK)
        fail_msg("%s", error.text);
    svg = files_read(path, NULL);
    assert_non_null(svg);
    assert_well_formed(svg);
    assert_null(strstr(svg, "nan"));
    assert_null(strstr(svg, "inf"));
    return svg;
}

/* A map of two dots and a line, and a bar chart. */
typedef struct sample {
    cairn_vec2 dot[2], line[2], bar[2];
    cairn_report_layer layer[3];
    cairn_report_plot plot[4];
    cairn_report_figure figure;
} sample;

static void make_sample(sample *s)
{
    static const cairn_report_layer layers[3] = {
        {"dots", "#111111", CAIRN_REPORT_DOTS, 2, NULL, 4, 1},
        {"lines", "#222222", CAIRN_REPORT_LINES, 1, NULL, 2, 0.5},
        {"bars", "#333333", CAIRN_REPORT_BARS, 2, NULL, 1, 0.25}};

    memset(s, 0, sizeof *s);
    s->dot[1].x = 10;
    s->dot[1].y = 5;
    s->line[0].x = 5;
    s->line[1].y = 5;
    s->bar[0].x = 1;
    s->bar[0].y = 4;
    s->bar[1].x = 2;
    s->bar[1].y = -4;
    memcpy(s->layer, layers, sizeof layers);
    s->layer[0].point = s->dot;
    s->layer[1].point = s->line;
    s->layer[2].point = s->bar;
    for (int i = 0; i < 4; i++) {
        s->plot[i].layer = s->layer;
        s->plot[i].layer_count = 2;
        s->plot[i].box = cairn_box_empty();
    }
    s->figure = cairn_report_figure_default();
    s->figure.plot = s->plot;
    s->figure.plot_count = 1;
    s->figure.width = 1000;
}

static void test_map(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.figure.title = "<T>";
    s.figure.subtitle = "S & s";
    s.plot[0].title = "plot";
    s.plot[0].note = "note";
    svg = draw(&s.figure);
    /* Frame 952 x 714 below 24 + 24 + 20 + 12 + 26; 16 within, so (952 - 32)/10 = 92 pixels a
     * metre, in the middle. */
    assert_holds(svg, "width=\"1000\" height=\"864\"");
    assert_holds(svg, "x=\"24.0\" y=\"106.0\" width=\"952.0\" height=\"714.0\"");
    assert_holds(svg, "d=\"M40.0 693.0h0M960.0 233.0h0\"");
    assert_holds(svg, "d=\"M500.0 693.0L40.0 233.0\"");
    assert_holds(svg,
                 "stroke=\"#111111\" stroke-width=\"4.00\" stroke-linecap=\"round\" opacity=\"1\"");
    assert_holds(svg, "fill=\"none\" stroke=\"#222222\" stroke-width=\"2.00\" "
                      "stroke-linecap=\"round\" opacity=\"0.5\"");
    /* 1 m is 92 pixels, 2 m more than 120. */
    assert_holds(svg, "M870.0 799.0v7h92.0v-7");
    assert_holds(svg, ">1 m</text>");
    assert_holds(svg, "<title>&lt;T&gt;</title>");
    assert_holds(svg, ">S &amp; s</text>");
    assert_holds(svg, ">plot</text>");
    assert_holds(svg, "text-anchor=\"end\">note</text>");
    assert_holds(svg, "<text x=\"51.0\" y=\"848.0\" font-size=\"12\" fill=\"#475569\">dots</text>");
    /* Four letters, then 24 pixels. */
    assert_holds(svg,
                 "<text x=\"126.4\" y=\"848.0\" font-size=\"12\" fill=\"#475569\">lines</text>");
    assert_holds(svg, "<circle cx=\"35.0\" cy=\"844.0\" r=\"2.6\" fill=\"#111111\"/>");
    assert_holds(svg, "M101.4 844.0h18\" stroke=\"#222222\"");
    free(svg);

    /* A box of its own: the frame cuts off what is outside. */
    s.plot[0].box.min.x = s.plot[0].box.min.y = 0;
    s.plot[0].box.max.x = s.plot[0].box.max.y = 1;
    svg = draw(&s.figure);
    /* The smaller height decides: 682 pixels a metre. */
    assert_holds(svg, "M159.0 804.0h0");
    assert_holds(svg, ">0.1 m</text>");
    free(svg);
}

static void test_chart(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.plot[0].layer = &s.layer[2];
    s.plot[0].layer_count = 1;
    s.plot[0].x_label = "x (m)";
    s.plot[0].y_label = "y < 1";
    svg = draw(&s.figure);
    /* 952 x 380.8 at 24, 24; 62 and 16 beside, 46 and 16 below and above: 874/2 pixels by
     * 318.8/8. */
    assert_holds(svg, "width=\"1000\" height=\"449\"");
    assert_holds(svg, "fill=\"#333333\" stroke=\"#fff\" stroke-width=\"0.80\" "
                      "stroke-linecap=\"round\" opacity=\"0.25\"");
    assert_holds(svg, "M86.0 199.4V40.0H523.0V199.4ZM523.0 199.4V358.8H960.0V199.4Z");
    assert_holds(svg, ">x (m)</text>");
    assert_holds(svg, ">y &lt; 1</text>");
    assert_holds(svg, "rotate(-90)");
    /* Every 0.2 in x, 1 in y: 0.6 to 2.4, and -4 to 4. */
    assert_int_equal(count_of(svg, "V40.0\" stroke=\"#e8edf3\""), 10);
    assert_int_equal(count_of(svg, "H960.0\" stroke=\"#e8edf3\""), 9);
    assert_holds(svg, "<text x=\"304.5\" y=\"375.8\" font-size=\"12\" fill=\"#475569\" "
                      "text-anchor=\"middle\">1</text>");
    assert_holds(svg, "<text x=\"79.0\" y=\"203.4\" font-size=\"12\" fill=\"#475569\" "
                      "text-anchor=\"end\">0</text>");
    assert_holds(svg, "text-anchor=\"end\">-4</text>");
    assert_holds(svg, "<rect x=\"29.0\" y=\"423.8\" width=\"12\" height=\"11\" fill=\"#333333\"/>");
    assert_int_equal(count_of(svg, " m</text>"), 0);
    free(svg);
    s.plot[0].y_step = 4;
    s.plot[0].x_step = 0.001; /* would be too close */
    svg = draw(&s.figure);
    assert_int_equal(count_of(svg, "V40.0\" stroke=\"#e8edf3\""), 10);
    assert_int_equal(count_of(svg, "H960.0\" stroke=\"#e8edf3\""), 3);
    free(svg);
}

static void test_side_by_side(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.figure.plot_count = 4;
    s.plot[1].x_label = s.plot[1].y_label = "a";
    s.plot[2].layer = &s.layer[1];
    s.plot[3].layer_count = 0;
    svg = draw(&s.figure);
    /* (952 - 60)/4 pixels, 20 apart, as high as wide with a map among them. */
    assert_int_equal(count_of(svg, "width=\"223.0\" height=\"223.0\""), 4);
    assert_holds(svg, "x=\"267.0\"");
    assert_holds(svg, "x=\"753.0\"");
    assert_holds(svg, "height=\"291\"");
    /* Each name once. */
    assert_int_equal(count_of(svg, ">dots</text>"), 1);
    assert_int_equal(count_of(svg, ">lines</text>"), 1);
    assert_int_equal(count_of(svg, ">bars</text>"), 1);
    free(svg);
    for (int i = 0; i < 4; i++)
        s.plot[i].x_label = s.plot[i].y_label = "a";
    s.layer[0].name = NULL;
    s.layer[1].count = 0;
    svg = draw(&s.figure);
    assert_int_equal(count_of(svg, "width=\"223.0\" height=\"156.1\""), 4);
    assert_int_equal(count_of(svg, ">dots</text>"), 0);
    free(svg);
}

/* Nothing at all, one point, points on a line: no division by zero. */
static void test_degenerate(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.plot[0].layer_count = 0;
    svg = draw(&s.figure);
    /* 1 m in the middle. */
    assert_holds(svg, ">0.1 m</text>");
    free(svg);
    s.plot[0].x_label = s.plot[0].y_label = "a";
    free(draw(&s.figure));
    s.plot[0].layer_count = 1;
    s.layer[0].count = 1;
    free(draw(&s.figure));
    s.plot[0].x_label = s.plot[0].y_label = NULL;
    s.dot[0].x = CAIRN_REAL(1e9);
    svg = draw(&s.figure);
    assert_holds(svg, "M500.0 381.0h0");
    free(svg);
    s.layer[0].count = 2;
    s.dot[1].x = CAIRN_REAL(-1e9);
    free(draw(&s.figure));
}

static void refuse(const cairn_report_figure *figure, cairn_status status, const char *piece)
{
    cairn_file_error error;

    assert_status(cairn_report_figure_write(files_path("refused.svg"), figure, &error), status);
    if (strstr(error.text, piece) == NULL)
        fail_msg("\"%s\" does not hold \"%s\"", error.text, piece);
    assert_int_equal(error.line, 0);
    assert_int_not_equal(access(files_path("refused.svg"), F_OK), 0);
}

static void test_refusals(void **state)
{
    cairn_real *coordinates[4];
    sample s;

    (void)state;
#define REFUSED(change, piece)                                                                     \
    make_sample(&s);                                                                               \
    s.change;                                                                                      \
    refuse(&s.figure, CAIRN_BAD_ARGUMENT, piece)
    REFUSED(figure.plot = NULL,
            "1 plots, width 1000: expected 1 to 4 plots, a width from 200 to 10000");
    REFUSED(figure.plot_count = 0, "0 plots");
    REFUSED(figure.plot_count = 5, "5 plots");
    REFUSED(figure.width = 199, "width 199");
    REFUSED(figure.width = 10001, "width 10001");
    REFUSED(plot[0].layer_count = -1,
            "plot 0: expected layers, both labels or none, steps not below 0");
    REFUSED(plot[0].layer = NULL, "plot 0: expected layers");
    REFUSED(plot[0].x_label = "x", "plot 0: expected layers");
    REFUSED(plot[0].y_label = "y", "plot 0: expected layers");
    REFUSED(plot[0].x_step = -1, "plot 0: expected layers");
    REFUSED(plot[0].y_step = (double)NAN, "plot 0: expected layers");
    REFUSED(layer[1].count = -1,
            "plot 0, layer 1: expected points, a mark, a colour, a width and an opacity");
    REFUSED(layer[1].count = INT32_MAX, "layer 1: expected points");
    REFUSED(layer[1].point = NULL, "layer 1: expected points");
    REFUSED(layer[1].mark = -1, "layer 1: expected points");
    REFUSED(layer[1].mark = 3, "layer 1: expected points");
    REFUSED(layer[1].colour = NULL, "layer 1: expected points");
    REFUSED(layer[1].width = 0, "layer 1: expected points");
    REFUSED(layer[1].opacity = 0, "layer 1: expected points");
    REFUSED(layer[1].opacity = 1.01, "layer 1: expected points");
#undef REFUSED
    make_sample(&s);
    coordinates[0] = &s.dot[1].x;
    coordinates[1] = &s.dot[1].y;
    coordinates[2] = &s.line[1].x;
    coordinates[3] = &s.line[1].y;
    for (int i = 0; i < 4; i++) {
        cairn_real kept = *coordinates[i];

        *coordinates[i] = (cairn_real)NAN;
        refuse(&s.figure, CAIRN_NOT_FINITE,
               i < 2 ? "plot 0, layer 0: point 1 is not finite" : "layer 1: point 1 is not finite");
        *coordinates[i] = CAIRN_REAL(-1.1e9);
        refuse(&s.figure, CAIRN_NOT_FINITE, "is not finite");
        *coordinates[i] = kept;
    }
    s.plot[0].box.min.x = s.plot[0].box.min.y = 0;
    s.plot[0].box.max.x = s.plot[0].box.max.y = (cairn_real)INFINITY;
    refuse(&s.figure, CAIRN_NOT_FINITE, "plot 0: its box is not finite");
    make_sample(&s);
    {
        cairn_file_error error;

        assert_status(cairn_report_figure_write(files_path("missing/f.svg"), &s.figure, &error),
                      CAIRN_IO);
        assert_status(cairn_report_figure_write("/dev/full", &s.figure, &error), CAIRN_IO);
    }
}

/* Every byte of some figures. */
static void figures_stay_as_they_are(void **state)
{
    static const char *const names[] = {"map", "chart", "four", "bare"};
    static const uint64_t known[] = {UINT64_C(0x2ee4112603660eff), UINT64_C(0x06a1ab35ab953f2b),
                                     UINT64_C(0x5fdd922c74883911), UINT64_C(0x5ced680e6a0e4231)};

    (void)state;
    for (int k = 0; k < 4; k++) {
        sample s;
        char *svg;

        make_sample(&s);
        s.line[1].x = CAIRN_REAL(-2.5);
        if (k < 3) {
            s.figure.title = names[k];
            s.figure.subtitle = "\u00e4 < \u00f6 & more";
            s.plot[0].title = "title";
            s.plot[0].note = "note";
        }
        if (k == 1 || k == 2) {
            s.plot[k - 1].layer_count = 3;
            s.plot[k - 1].x_label = "x (m)";
            s.plot[k - 1].y_label = "y";
            s.plot[k - 1].x_step = k == 1 ? 0.5 : 0;
            s.plot[k - 1].y_step = 2;
            s.figure.plot_count = k == 1 ? 1 : 4;
            s.plot[3].layer_count = 0;
            s.plot[2].box.min.x = -1;
            s.plot[2].box.max.x = 7;
            s.plot[2].box.min.y = s.plot[2].box.max.y = 3;
        }
        svg = draw(&s.figure);
        assert_golden(test_hash(TEST_HASH_START, svg, strlen(svg)), known[k], known[k]);
        free(svg);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_map),          cmocka_unit_test(test_chart),
        cmocka_unit_test(test_side_by_side), cmocka_unit_test(test_degenerate),
        cmocka_unit_test(test_refusals),     cmocka_unit_test(figures_stay_as_they_are),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
