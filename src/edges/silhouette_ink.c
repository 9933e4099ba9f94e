/* Binarization of a picture, and the thickness of its ink. silhouette.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/edges/silhouette_work.h"

/* A picture of which more than one in four pixels is neither dark nor bright is a photograph. */
enum { MAX_GREY_DIVISOR = 4 };
/* Ink up to a half thickness of 2 pixels, or of 1/50 of its diagonal, is a line drawing. */
enum { MAX_LINE_PIXELS = 2, LINE_DIVISOR = 50 };

/* ---- Greys ---- */

/* Row y of the picture: the darkest and the brightest pixel. */
static CAIRN_STEP_NOT_INLINED void find_extremes(cairn_silhouette *s)
{
    const uint8_t *grey = s->grey.data + s->y * s->grey.stride;
    uint8_t darkest = (uint8_t)s->darkest, brightest = (uint8_t)s->brightest;

    for (int32_t x = 0; x < s->grey.width; x++) {
        darkest = grey[x] < darkest ? grey[x] : darkest;
        brightest = grey[x] > brightest ? grey[x] : brightest;
    }
    s->darkest = darkest;
    s->brightest = brightest;
}

/* The middle between the darkest and the brightest pixel. */
static int32_t threshold_of(const cairn_silhouette *s)
{
    return (s->darkest + s->brightest) / 2;
}

/* Number of pixels of a row that are brighter than `low` and darker than `high`. */
static int32_t count_between(const uint8_t *grey, int32_t width, int32_t low, int32_t high)
{
    int32_t count = 0;

    for (int32_t x = 0; x < width; x++)
        count += grey[x] > low && grey[x] < high;
    return count;
}

/* Row y of the picture: counts pixels in the middle half of the greys, and bright ones of the
 * picture's border. */
static CAIRN_STEP_NOT_INLINED void count_greys(cairn_silhouette *s)
{
    const uint8_t *grey = s->grey.data + s->y * s->grey.stride;
    int32_t width = s->grey.width, threshold = threshold_of(s),
            quarter = (s->brightest - s->darkest) / 4;

    s->measure.between += count_between(grey, width, s->darkest + quarter, s->brightest - quarter);
    if (s->y == 0 || s->y == s->grey.height - 1) {
        s->border += width;
        s->bright_border += count_between(grey, width, threshold, UINT8_MAX + 1);
    } else {
        s->border += width > 1 ? 2 : 1;
        s->bright_border += grey[0] > threshold;
        s->bright_border += width > 1 && grey[width - 1] > threshold;
    }
}

/* ---- Ink ---- */

/* Row y of the ink, with its border. */
static CAIRN_STEP_NOT_INLINED void binarize_row(cairn_silhouette *s)
{
    const uint8_t *grey = s->grey.data + (s->y - 1) * s->grey.stride;
    uint8_t *ink = s->ink + (ptrdiff_t)s->y * s->width;
    int32_t threshold = threshold_of(s), is_bright = 2 * s->bright_border > s->border, count = 0;

    memset(ink, 0, (size_t)s->width);
    if (s->y == 0 || s->y == s->height - 1)
        return;
    for (int32_t x = 0; x < s->grey.width; x++) {
        ink[x + 1] = (grey[x] > threshold) != is_bright;
        count += ink[x + 1];
    }
    if (count == 0)
        return;
    s->measure.ink += count;
    s->top = s->y < s->top ? s->y : s->top;
    s->bottom = s->y;
    for (int32_t x = 1; x < s->left; x++)
        if (ink[x])
            s->left = x;
    for (int32_t x = s->grey.width; x > s->right; x--)
        if (ink[x])
            s->right = x;
}

/* Refuses a photograph by its greys, and a picture of one colour. */
static void check_greys(cairn_silhouette *s)
{
    int64_t pixels = (int64_t)s->grey.width * s->grey.height;

    if ((int64_t)s->measure.between * MAX_GREY_DIVISOR > pixels)
        silhouette_refuse(s, CAIRN_SILHOUETTE_PHOTOGRAPH, CAIRN_BAD_FORMAT);
    else if (s->darkest == s->brightest)
        silhouette_refuse(s, CAIRN_SILHOUETTE_ONE_COLOUR, CAIRN_EMPTY);
}

/* Stores the size of the ink, and refuses a small object. */
static void check_ink(cairn_silhouette *s)
{
    s->measure.ink_width = s->right - s->left + 1;
    s->measure.ink_height = s->bottom - s->top + 1;
    if (silhouette_squared_diagonal(s) <
        CAIRN_SILHOUETTE_MIN_DIAGONAL * CAIRN_SILHOUETTE_MIN_DIAGONAL)
        silhouette_refuse(s, CAIRN_SILHOUETTE_TOO_SMALL, CAIRN_EMPTY);
}

int cairn_silhouette_binarize(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->phase_resume);
    s->darkest = UINT8_MAX;
    s->brightest = s->border = s->bright_border = s->right = s->bottom = 0;
    s->left = s->width;
    s->top = s->height;
    for (s->y = 0; s->y < s->grey.height; s->y++) {
        CAIRN_STEP_CHARGE(s, phase_resume, budget, silhouette_row_units(s));
        find_extremes(s);
    }
    for (s->y = 0; s->y < s->grey.height; s->y++) {
        CAIRN_STEP_CHARGE(s, phase_resume, budget, silhouette_row_units(s));
        count_greys(s);
    }
    check_greys(s);
    for (s->y = 0; s->y < s->height && s->status == CAIRN_MORE; s->y++) {
        CAIRN_STEP_CHARGE(s, phase_resume, budget, silhouette_row_units(s));
        binarize_row(s);
    }
    if (s->status == CAIRN_MORE)
        check_ink(s);
    CAIRN_STEP_END(s->phase_resume);
}

/* ---- Thickness ---- */

static void begin_distances(cairn_silhouette *s)
{
    cairn_distance_map_input input = {
        .pixels = {s->ink, s->width, s->height, s->width},
        .distances = {s->component, s->width, s->height, s->width},
        .mask = UINT8_MAX,
        .match = 0,
        .metric = CAIRN_DISTANCE_MAP_L1,
    };

    cairn_must_be_ok(cairn_distance_map_begin(s->distances, &input));
}

/* Row y: the greatest distance. */
static CAIRN_STEP_NOT_INLINED void find_thickness(cairn_silhouette *s)
{
    const int32_t *distance = s->component + (ptrdiff_t)s->y * s->width;
    int32_t most = s->thickness;

    for (int32_t x = 0; x < s->width; x++)
        most = distance[x] > most ? distance[x] : most;
    s->thickness = most;
}

static int is_thin(const cairn_silhouette *s)
{
    int64_t parts = (int64_t)s->thickness * LINE_DIVISOR;

    return s->thickness <= MAX_LINE_PIXELS || parts * parts <= silhouette_squared_diagonal(s);
}

int cairn_silhouette_measure_lines(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->phase_resume);
    begin_distances(s);
    CAIRN_STEP_UNTIL(s->phase_resume, cairn_distance_map_step(s->distances, budget) == CAIRN_OK);
    s->thickness = 0;
    for (s->y = 0; s->y < s->height; s->y++) {
        CAIRN_STEP_CHARGE(s, phase_resume, budget, silhouette_row_units(s));
        find_thickness(s);
    }
    s->is_drawing = is_thin(s);
    CAIRN_STEP_END(s->phase_resume);
}
