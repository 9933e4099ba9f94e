/* Connected-component labelling, and the selection of the regions that get outlines. silhouette.c
 * describes the method.
 *
 * Labels count the components in the order of their first pixels in row order, so that one pass in
 * that order meets them one after the other. Their measures lie in the scratch memory, whose
 * capacity is an int32_t a pixel: it suffices, because
 * - components lie apart from each other by a pixel, also at corners. With the column to their right
 *   and the row below them they are disjoint, and each has 4 pixels or more;
 * - a component has as many pixels of ink as it has faces, as ink lies above the first pixel of each
 *   face. So each face takes 2 pixels more. */
#include "src/base/build.h"

#include "src/edges/silhouette_work.h"

/* Label of pixels that have none yet. */
enum { LABEL_NONE = -2, LABEL_INK = -1, LABEL_OUTSIDE = 0 };

/* Pixels whose neighbours are flooded for one work unit. */
enum { FLOODED_PER_UNIT = 2 };

/* ---- Flood fill ---- */

/* Labels a pixel, which waits for its neighbours. */
static void label_pixel(cairn_silhouette *s, int32_t pixel)
{
    int32_t *stack = s->scratch;

    s->labels[pixel] = s->label;
    stack[s->waiting++] = pixel;
}

/* Labels the neighbours of the next waiting pixels. */
static CAIRN_STEP_NOT_INLINED void flood(cairn_silhouette *s)
{
    int32_t w = s->width, offsets[8] = {1, -1, w, -w, w + 1, w - 1, 1 - w, -1 - w},
            *labels = s->labels, *stack = s->scratch, waiting = s->waiting, label = s->label,
            neighbours = s->neighbours;

    for (int32_t i = 0; i < FLOODED_PER_UNIT && waiting > 0; i++) {
        int32_t pixel = stack[--waiting];

        for (int32_t k = 0; k < neighbours; k++) {
            int32_t neighbour = pixel + offsets[k];

            if (labels[neighbour] == LABEL_NONE) {
                labels[neighbour] = label;
                stack[waiting++] = neighbour;
            }
        }
    }
    s->waiting = waiting;
}

/* Floods until no pixel waits. */
static int fill(cairn_silhouette *s, cairn_budget *budget)
{
    while (s->waiting > 0 && cairn_budget_take(budget, 1) > 0)
        flood(s);
    return s->waiting == 0;
}

/* Begins to label an array of labels. */
static void begin_labels(cairn_silhouette *s, int32_t *labels, int32_t neighbours)
{
    s->labels = labels;
    s->neighbours = neighbours;
    s->label = LABEL_OUTSIDE;
    s->waiting = 0;
}

/* ---- Labels ---- */

/* Row y: ink and background. The first and the last row are of the outside. */
static CAIRN_STEP_NOT_INLINED void mark_background(cairn_silhouette *s)
{
    ptrdiff_t first = (ptrdiff_t)s->y * s->width;
    int32_t background = s->y == 0 || s->y == s->height - 1 ? LABEL_OUTSIDE : LABEL_NONE;

    for (ptrdiff_t i = first; i < first + s->width; i++)
        s->face[i] = s->ink[i] ? LABEL_INK : background;
}

/* Row y: what is not outside. */
static CAIRN_STEP_NOT_INLINED void mark_components(cairn_silhouette *s)
{
    ptrdiff_t first = (ptrdiff_t)s->y * s->width;

    for (ptrdiff_t i = first; i < first + s->width; i++)
        s->component[i] = s->face[i] == LABEL_OUTSIDE ? LABEL_OUTSIDE : LABEL_NONE;
}

/* Labels the background beside the first and the last row. Both columns of the border belong to it;
 * they are next to each other in memory, and next to these rows, so that the flood does not leave
 * the array. */
static void label_rim(cairn_silhouette *s)
{
    int32_t last = (s->height - 2) * s->width;

    for (int32_t x = 0; x < s->width; x++) {
        if (s->face[s->width + x] == LABEL_NONE)
            label_pixel(s, s->width + x);
        if (s->face[last + x] == LABEL_NONE)
            label_pixel(s, last + x);
    }
}

/* Finds the next pixel of row y without a label, from x on; 0: there is none. */
static int find_unlabelled(cairn_silhouette *s)
{
    const int32_t *labels = s->labels + (ptrdiff_t)s->y * s->width;
    int32_t x = s->x;

    while (x < s->width && labels[x] != LABEL_NONE)
        x++;
    s->x = x;
    return x < s->width;
}

/* Labels one component after the other. */
static int label_rows(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->phase_resume);
    for (s->y = 0; s->y < s->height; s->y++) {
        CAIRN_STEP_CHARGE(s, phase_resume, budget, silhouette_row_units(s));
        for (s->x = 0; find_unlabelled(s);) {
            s->label++;
            label_pixel(s, s->y * s->width + s->x);
            CAIRN_STEP_RUN(s, phase_resume, budget, fill);
        }
    }
    CAIRN_STEP_END(s->phase_resume);
}

int cairn_silhouette_label(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->label_resume);
    for (s->y = 0; s->y < s->height; s->y++) {
        CAIRN_STEP_CHARGE(s, label_resume, budget, silhouette_row_units(s));
        mark_background(s);
    }
    begin_labels(s, s->face, 4);
    CAIRN_STEP_CHARGE(s, label_resume, budget, 2 * silhouette_row_units(s));
    label_rim(s);
    CAIRN_STEP_RUN(s, label_resume, budget, fill);
    CAIRN_STEP_RUN(s, label_resume, budget, label_rows);
    s->face_count = s->label;
    for (s->y = 0; s->y < s->height; s->y++) {
        CAIRN_STEP_CHARGE(s, label_resume, budget, silhouette_row_units(s));
        mark_components(s);
    }
    begin_labels(s, s->component, 8);
    CAIRN_STEP_RUN(s, label_resume, budget, label_rows);
    s->component_count = s->label;
    CAIRN_STEP_END(s->label_resume);
}

/* ---- Measures ---- */

/* The component with a label. */
static silhouette_component *component_with(const cairn_silhouette *s, int32_t label)
{
    silhouette_component *components = s->scratch;

    return &components[label - 1];
}

/* The face with a label, behind the components. */
static silhouette_face *face_with(const cairn_silhouette *s, int32_t label)
{
    silhouette_component *components = s->scratch;
    silhouette_face *faces = (void *)(components + s->component_count);

    return &faces[label - 1];
}

/* The component of a face. */
static silhouette_component *component_around(const cairn_silhouette *s, int32_t face_label)
{
    return component_with(s, s->component[face_with(s, face_label)->first]);
}

static void count_component_pixel(cairn_silhouette *s, int32_t pixel)
{
    silhouette_component *component = component_with(s, s->component[pixel]);

    if (s->component[pixel] > s->seen_components) {
        s->seen_components++;
        *component = (silhouette_component){.first = pixel};
    }
    component->area++;
    component->ink += s->ink[pixel];
}

static void count_face_pixel(cairn_silhouette *s, int32_t pixel)
{
    silhouette_face *face = face_with(s, s->face[pixel]);

    if (s->face[pixel] > s->seen_faces) {
        s->seen_faces++;
        *face = (silhouette_face){.first = pixel};
    }
    face->area++;
}

/* Row y: counts the pixels of components and faces. */
static CAIRN_STEP_NOT_INLINED void count_pixels(cairn_silhouette *s)
{
    int32_t first = s->y * s->width;

    for (int32_t i = first; i < first + s->width; i++)
        if (s->component[i] != LABEL_OUTSIDE) {
            count_component_pixel(s, i);
            if (s->face[i] != LABEL_INK)
                count_face_pixel(s, i);
        }
}

/* Last label of the next regions, of `count`. */
static int32_t last_of_unit(const cairn_silhouette *s, int32_t count)
{
    return count - s->cursor < SILHOUETTE_REGIONS_PER_UNIT
               ? count
               : s->cursor + SILHOUETTE_REGIONS_PER_UNIT - 1;
}

/* Finds the largest faces of components, among the next faces. */
static void find_largest_faces(cairn_silhouette *s)
{
    for (int32_t i = s->cursor, last = last_of_unit(s, s->face_count); i <= last; i++) {
        silhouette_component *component = component_around(s, i);

        if (component->largest_face == 0 ||
            face_with(s, component->largest_face)->area < face_with(s, i)->area)
            component->largest_face = i;
    }
}

/* ---- Selection ---- */

/* 1 for a component that may be a part of the object: of a drawing one whose lines enclose an area
 * at least half as large as their ink. */
static int is_object(const cairn_silhouette *s, const silhouette_component *component)
{
    return !s->is_drawing || (component->largest_face > 0 &&
                              face_with(s, component->largest_face)->area >= component->ink / 2);
}

/* Finds the largest component that may be a part of the object, among the next ones. */
static void find_largest_component(cairn_silhouette *s)
{
    for (int32_t i = s->cursor, last = last_of_unit(s, s->component_count); i <= last; i++) {
        const silhouette_component *component = component_with(s, i);

        if (component->area > s->largest_area && is_object(s, component))
            s->largest_area = component->area;
    }
}

static int is_small(const cairn_silhouette *s, int32_t area)
{
    return (cairn_real)area < s->params.min_part * (cairn_real)s->largest_area;
}

/* Inserts a region behind the larger ones of its kind; regions beyond the capacity are counted. */
static void add_region(cairn_silhouette *s, silhouette_region added)
{
    silhouette_region *regions = s->regions;
    int32_t at = s->region_count;

    s->measure.regions++;
    if (at == s->params.max_outlines) {
        s->excess++;
        return;
    }
    for (; at > 0 && regions[at - 1].is_hole == added.is_hole && regions[at - 1].area < added.area;
         at--)
        regions[at] = regions[at - 1];
    regions[at] = added;
    s->region_count++;
    s->hole_count += added.is_hole;
}

/* Keeps or drops the next components. */
static void select_components(cairn_silhouette *s)
{
    for (int32_t i = s->cursor, last = last_of_unit(s, s->component_count); i <= last; i++) {
        const silhouette_component *component = component_with(s, i);
        silhouette_region region = {i, component->first, component->area, 0};

        if (is_small(s, component->area) || !is_object(s, component))
            s->measure.dropped_regions++;
        else
            add_region(s, region);
    }
}

static void refuse_hole(cairn_silhouette *s, const silhouette_face *hole)
{
    /* Without the border of one pixel. */
    s->measure.hole_x = hole->first % s->width - 1;
    s->measure.hole_y = hole->first / s->width - 1;
    s->measure.hole_area = hole->area;
    silhouette_refuse(s, CAIRN_SILHOUETTE_HOLE, CAIRN_UNSUPPORTED);
}

/* Keeps or drops the next faces that are holes; all but the interiors of drawings are. */
static void select_holes(cairn_silhouette *s)
{
    for (int32_t i = s->cursor, last = last_of_unit(s, s->face_count);
         i <= last && s->status == CAIRN_MORE; i++) {
        const silhouette_face *face = face_with(s, i);
        silhouette_region region = {i, face->first, face->area, 1};

        if (s->is_drawing && component_around(s, i)->largest_face == i)
            continue;
        if (is_small(s, face->area))
            s->measure.dropped_regions++;
        else if (s->params.holes == CAIRN_SILHOUETTE_HOLES_REFUSE)
            refuse_hole(s, face);
        else
            add_region(s, region);
    }
}

int cairn_silhouette_select(cairn_silhouette *s, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(s->phase_resume);
    s->seen_components = s->seen_faces = s->largest_area = s->excess = 0;
    CAIRN_ASSERT(4 * s->component_count + 2 * s->face_count <= s->width * s->height);
    for (s->y = 0; s->y < s->height; s->y++) {
        CAIRN_STEP_CHARGE(s, phase_resume, budget, silhouette_row_units(s));
        count_pixels(s);
    }
    for (s->cursor = 1; s->cursor <= s->face_count; s->cursor += SILHOUETTE_REGIONS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
        find_largest_faces(s);
    }
    for (s->cursor = 1; s->cursor <= s->component_count; s->cursor += SILHOUETTE_REGIONS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
        find_largest_component(s);
    }
    if (s->largest_area == 0)
        silhouette_refuse(s, CAIRN_SILHOUETTE_OPEN_LINES, CAIRN_BAD_FORMAT);
    for (s->cursor = 1; s->cursor <= s->component_count && s->status == CAIRN_MORE;
         s->cursor += SILHOUETTE_REGIONS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
        select_components(s);
    }
    for (s->cursor = 1; s->cursor <= s->face_count && s->status == CAIRN_MORE &&
                        s->params.holes != CAIRN_SILHOUETTE_HOLES_FILL;
         s->cursor += SILHOUETTE_REGIONS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(s, phase_resume, budget);
        select_holes(s);
    }
    if (s->status == CAIRN_MORE && s->excess > 0)
        silhouette_refuse(s, CAIRN_SILHOUETTE_OUTLINES, CAIRN_FULL);
    CAIRN_STEP_END(s->phase_resume);
}
