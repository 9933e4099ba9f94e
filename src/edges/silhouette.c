/* Contours of an object from a picture of it.
 *
 * Method:
 * 1. Binarization: the threshold is the middle between the darkest and the brightest pixel
 *    (silhouette_ink.c, with the next).
 * 2. Silhouette or drawing: the maximum of the distance transform of the ink decides.
 * 3. Gaps of a drawing: its lines are thinned and linked, and open ends are joined by straight
 *    lines, the closest pair first (silhouette_lines.c).
 * 4. Connected-component labelling: the outside is flooded from the border. Other background faces
 *    are holes, except for the largest face of each component of a drawing, which is its interior
 *    (silhouette_regions.c, with the next).
 * 5. Components and holes are filtered by area. A picture of greys and specks is a photograph.
 * 6. Boundaries are traced along pixel edges, of drawings outside of their lines, and smoothed
 *    (silhouette_trace.c).
 *
 * Memory layout: ink and labels with a border of one pixel, so that all neighbours of a region
 * exist; one array of scratch memory for the phases.
 *
 * Limits: one object a picture; all components belong to it. A drawing within a drawing (the dots
 * of a giraffe) yields holes.
 *
 * All decisions but those by max_gap and min_part are taken in integers. */
#include "src/base/build.h"

#include <string.h>

#include "src/edges/silhouette_work.h"

enum { MAX_INK = 1 << 27, MAX_POINTS = 1 << 28, MAX_OUTLINES = 64 };

/* Shortest line of a drawing, pixels. */
enum { MIN_LINE_PIXELS = 2 };

/* A picture of greys is a photograph when it has more specks: of the photographs of apple logos,
 * bottles and giraffes of the ETHZ shape classes those that are not refused by their greys alone
 * have 85 specks or more (chosen on these, tried on mugs, swans, horses and scenes: six of the seven
 * left are found, and no drawing). Drawings and silhouettes have shares of greys below 0.04. */
enum { MAX_SPECKS = 30, PICTURES_PER_GREY = 20 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_silhouette_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_silhouette_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_width, 640, 1, CAIRN_SILHOUETTE_MAX_SIDE),
    INTEGER(max_height, 480, 1, CAIRN_SILHOUETTE_MAX_SIDE),
    INTEGER(max_ink, 32768, 1, MAX_INK),
    INTEGER(max_points, 65536, 1, MAX_POINTS),
    INTEGER(max_outlines, 8, 1, MAX_OUTLINES),
    INTEGER(holes, CAIRN_SILHOUETTE_HOLES_KEEP, CAIRN_SILHOUETTE_HOLES_KEEP,
            CAIRN_SILHOUETTE_HOLES_REFUSE),
    NUMBER(max_gap, CAIRN_REAL(0.1), 0, 1),
    NUMBER(min_part, CAIRN_REAL(0.01), 0, 1),
};
extern const cairn_parameters cairn_silhouette_parameters;
const cairn_parameters cairn_silhouette_parameters =
    CAIRN_PARAMETERS("silhouette", cairn_silhouette_params, rows);

cairn_silhouette_params cairn_silhouette_default(void)
{
    cairn_silhouette_params params;

    cairn_parameters_preset(&cairn_silhouette_parameters, &params);
    return params;
}

cairn_status cairn_silhouette_check(const cairn_silhouette_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_silhouette_parameters, params, fault);
}

/* Of the ink with its border. Each pixel has four links at most, which two pixels share, and a
 * chain at least one. */
static cairn_edge_chain_params line_params(const cairn_silhouette_params *params)
{
    cairn_edge_chain_params lines = cairn_edge_chain_default();

    lines.max_width = params->max_width + 2;
    lines.max_height = params->max_height + 2;
    lines.max_edges = params->max_ink;
    lines.max_chains = 2 * params->max_ink;
    lines.min_length = MIN_LINE_PIXELS;
    return lines;
}

/* The object, its arrays, distance map and lines; NULL from a counting pool. */
static cairn_silhouette *build(cairn_pool *pool, const cairn_silhouette_params *params)
{
    size_t cells = ((size_t)params->max_width + 2) * ((size_t)params->max_height + 2),
           scratch = cells / (sizeof(cairn_vec2) / sizeof(int32_t)) + 1,
           points = (size_t)params->max_points;
    cairn_distance_map_params distances = {.max_width = params->max_width + 2};
    cairn_edge_chain_params lines = line_params(params);
    cairn_silhouette *s = cairn_object_take(pool, sizeof *s);

    CAIRN_TAKE(s, pool, ink, cells);
    CAIRN_TAKE(s, pool, face, cells);
    CAIRN_TAKE(s, pool, component, cells);
    CAIRN_TAKE_FIELD(
        s, scratch, cairn_pool_take(pool, points > scratch ? points : scratch, sizeof(cairn_vec2)));
    CAIRN_TAKE(s, pool, regions, params->max_outlines);
    CAIRN_TAKE(s, pool, outlines, params->max_outlines);
    CAIRN_TAKE_OBJECT(s, pool, distances, distance_map, &distances);
    CAIRN_TAKE_OBJECT(s, pool, lines, edge_chain, &lines);
    if (s != NULL) {
        s->params = *params;
        s->status = CAIRN_EMPTY;
    }
    return s;
}

CAIRN_OBJECT(silhouette, silhouette, build);

cairn_status cairn_silhouette_begin(cairn_silhouette *s, cairn_raster_u8_view grey)
{
    if (s == NULL || cairn_raster_u8_check(grey) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    if (grey.width > s->params.max_width || grey.height > s->params.max_height)
        return CAIRN_FULL;
    s->grey = grey;
    s->width = grey.width + 2;
    s->height = grey.height + 2;
    s->end_count = s->gap_count = s->region_count = s->hole_count = s->is_drawing = 0;
    memset(&s->measure, 0, sizeof s->measure);
    s->units_charged = 0;
    s->resume = s->label_resume = s->phase_resume = 0;
    s->status = CAIRN_MORE;
    return CAIRN_OK;
}

/* Refuses a photograph by its greys and specks. */
static void check_specks(cairn_silhouette *s)
{
    int64_t pixels = (int64_t)s->grey.width * s->grey.height;

    if (s->status == CAIRN_MORE && (int64_t)s->measure.between * PICTURES_PER_GREY > pixels &&
        s->measure.dropped_regions > MAX_SPECKS)
        silhouette_refuse(s, CAIRN_SILHOUETTE_SPECKS, CAIRN_BAD_FORMAT);
}

/* The extraction: see Method in the head of this file. */
static int extract(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->resume);
    CAIRN_STEP_RUN(s, resume, budget, cairn_silhouette_binarize);
    if (s->status == CAIRN_MORE)
        CAIRN_STEP_RUN(s, resume, budget, cairn_silhouette_measure_lines);
    if (s->status == CAIRN_MORE && s->is_drawing)
        CAIRN_STEP_RUN(s, resume, budget, cairn_silhouette_bridge);
    if (s->status == CAIRN_MORE) {
        CAIRN_STEP_RUN(s, resume, budget, cairn_silhouette_label);
        CAIRN_STEP_RUN(s, resume, budget, cairn_silhouette_select);
        check_specks(s);
    }
    if (s->status == CAIRN_MORE)
        CAIRN_STEP_RUN(s, resume, budget, cairn_silhouette_trace);
    CAIRN_STEP_END(s->resume);
}

cairn_status cairn_silhouette_step(cairn_silhouette *s, cairn_budget *budget)
{
    if (s == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (s->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!extract(s, budget))
        return CAIRN_MORE;
    if (s->status == CAIRN_MORE)
        s->status = CAIRN_OK;
    return s->status;
}

cairn_silhouette_result cairn_silhouette_read(const cairn_silhouette *s)
{
    cairn_silhouette_result result = {0};

    if (s == NULL || s->status != CAIRN_OK)
        return result;
    result.outlines = s->outlines;
    result.gaps = s->gaps;
    result.count = s->region_count;
    result.holes = s->hole_count;
    result.gap_count = s->gap_count;
    result.is_drawing = s->is_drawing;
    result.dropped_regions = s->measure.dropped_regions;
    return result;
}

cairn_silhouette_measure cairn_silhouette_measured(const cairn_silhouette *s)
{
    cairn_silhouette_measure none = {0};

    return s != NULL ? s->measure : none;
}
