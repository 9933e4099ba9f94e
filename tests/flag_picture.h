/* Shared by the tests of the search for a known shape: a flag drawn into an edge image, its model,
 * and the tokens found. */
#ifndef CAIRN_TESTS_FLAG_PICTURE_H
#define CAIRN_TESTS_FLAG_PICTURE_H

#include "tests/test.h"

#include <math.h>

#include "cairn/contour_search_run.h"
#include "cairn/object_detect_run.h"
#include "cairn/shape_model_file.h"

enum { WIDTH = 300, HEIGHT = 220, PIXELS = WIDTH * HEIGHT };

static uint8_t edges[PIXELS];
static cairn_file_error error;

/* A pole with a cloth to the right, 120 px high. */
static const cairn_vec2 flag[] = {{0, 0},   {14, 0},  {60, 8},   {80, 4}, {78, 48},
                                  {56, 52}, {14, 44}, {14, 120}, {0, 120}};
enum { CORNERS = sizeof flag / sizeof *flag };

static inline cairn_shape_model_file make_model(void)
{
    cairn_curve outline = {flag, CORNERS, 1};
    cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
    cairn_shape_model_file file;

    assert_ok(cairn_shape_model_file_build(&file, &outline, 1, &params, "flag", &error));
    return file;
}

static inline void clear_picture(void)
{
    memset(edges, 0, sizeof edges);
}

static inline void draw_line(double ax, double ay, double bx, double by)
{
    int32_t steps = 1 + (int32_t)(2 * hypot(bx - ax, by - ay));

    for (int32_t i = 0; i <= steps; i++) {
        int32_t x = (int32_t)lrint(ax + (bx - ax) * i / steps),
                y = (int32_t)lrint(ay + (by - ay) * i / steps);

        if (x >= 0 && y >= 0 && x < WIDTH && y < HEIGHT)
            edges[y * WIDTH + x] = 200;
    }
}

/* Draws the flag with its upper left corner (upper right when mirrored) at (x, y), without side
 * `hidden`. */
static inline void draw_flag_without(double x, double y, double scale, int mirrored, int32_t hidden)
{
    double wide = scale * (mirrored ? -1 : 1);

    for (int32_t i = 0; i < CORNERS; i++) {
        cairn_vec2 p = flag[i], q = flag[(i + 1) % CORNERS];

        if (i != hidden)
            draw_line(x + wide * (double)p.x, y + scale * (double)p.y, x + wide * (double)q.x,
                      y + scale * (double)q.y);
    }
}

static inline void draw_flag(double x, double y, double scale, int mirrored)
{
    draw_flag_without(x, y, scale, mirrored, -1);
}

/* Random lines up to 42 px long; they cut the chains that they cross. */
static inline void draw_clutter(int32_t lines)
{
    cairn_random random = cairn_random_seed(9, 2);

    for (int32_t i = 0; i < lines; i++) {
        int32_t x = cairn_random_below(&random, WIDTH), y = cairn_random_below(&random, HEIGHT);
        int32_t dx = cairn_random_below(&random, 61) - 30,
                dy = cairn_random_below(&random, 61) - 30;

        draw_line(x, y, x + dx, y + dy);
    }
}

/* Short edges everywhere. */
static inline void draw_edges_everywhere(void)
{
    for (int32_t i = 0; i < PIXELS; i++)
        edges[i] = i % WIDTH % 8 < 6 && i / WIDTH % 3 == 0 ? 255 : 0;
}

static inline cairn_contour_search_tokens find_tokens(int32_t edgels)
{
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_contour_search_tokens tokens;

    assert_ok(cairn_contour_search_run_tokens(&tokens, view, 1, edgels, "edges", &error));
    return tokens;
}

/* Flags that are found by their parts: whole, mirrored, and with a side hidden. */
typedef struct flag_case {
    double x, y, scale;
    int mirrored;
    int32_t hidden;
} flag_case;
static const flag_case flag_cases[] = {
    {110, 40, 1, 0, -1}, {200, 30, 1.2, 1, -1}, {60, 70, 0.9, 0, 7}, {230, 60, 1, 1, 0}};
enum { FLAG_CASES = sizeof flag_cases / sizeof *flag_cases };

/* Tokens of such a flag among random lines. */
static inline cairn_contour_search_tokens case_tokens(const flag_case *c, int32_t clutter)
{
    clear_picture();
    draw_clutter(clutter);
    draw_flag_without(c->x, c->y, c->scale, c->mirrored, c->hidden);
    return find_tokens(0);
}

/* Tokens of a picture of one flag among random lines. */
static inline cairn_contour_search_tokens flag_tokens(int32_t clutter, double x, double y,
                                                      double scale, int mirrored)
{
    clear_picture();
    draw_clutter(clutter);
    draw_flag(x, y, scale, mirrored);
    return find_tokens(0);
}

/* Tokens of an image without edges. */
static inline cairn_contour_search_tokens no_tokens(void)
{
    clear_picture();
    return find_tokens(0);
}

/* Intersection over union of a box and that of a flag. */
static inline double share_of(const cairn_object_detection *d, double x, double y, double scale,
                              int mirrored)
{
    double left = mirrored ? x - 80 * scale : x, w, h;

    w = fmin((double)d->right, left + 80 * scale) - fmax((double)d->left, left);
    h = fmin((double)d->bottom, y + 120 * scale) - fmax((double)d->top, y);
    if (w <= 0 || h <= 0)
        return 0;
    return w * h /
           (9600 * scale * scale + (double)(d->right - d->left) * (double)(d->bottom - d->top) -
            w * h);
}

/* Detections of the flag among tokens, the best first. */
static inline cairn_object_detections detect_flag(const cairn_contour_search_tokens *tokens,
                                                  const cairn_object_detect_params *params)
{
    cairn_shape_model_file model = make_model();
    cairn_object_detect_run_image *field;
    cairn_object_detections found;

    assert_ok(cairn_object_detect_run_make(&field, tokens, params, "edges", &error));
    assert_ok(cairn_object_detect_run(&found, field, &model.model, "edges", &error));
    for (int32_t i = 1; i < found.count; i++)
        assert_true(found.found[i].score <= found.found[i - 1].score);
    cairn_object_detect_run_free_image(field);
    cairn_shape_model_file_free(&model);
    return found;
}

/* `detect`, such as detect_flag(), finds nothing where there are no edges. */
static inline void
assert_nothing_without_edges(cairn_object_detections (*detect)(const cairn_contour_search_tokens *,
                                                               const cairn_object_detect_params *),
                             const cairn_object_detect_params *params)
{
    cairn_contour_search_tokens tokens = no_tokens();
    cairn_object_detections found = detect(&tokens, params);

    assert_int_equal(found.count, 0);
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* The best detection is such a flag, with this share of its box or more. */
static inline void assert_found(const cairn_object_detections *found, const flag_case *c,
                                double share)
{
    assert_true(found->count >= 1);
    assert_true(share_of(&found->found[0], c->x, c->y, c->scale, c->mirrored) > share);
    assert_int_equal(found->found[0].mirrored, c->mirrored);
}

/* Stages follow each other, for the model and for its mirror image: appends each as a digit,
 * char[16]. */
static inline void hear_stage(void *context, cairn_object_detect_stage stage)
{
    char *heard = context;
    size_t count = strlen(heard);

    assert_true(count < 15);
    heard[count] = (char)('0' + stage);
}

static inline void assert_error_holds(const char *piece)
{
    if (strstr(error.text, piece) == NULL)
        fail_msg("\"%s\" does not hold \"%s\"", error.text, piece);
}

#endif
