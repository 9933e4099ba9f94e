/* Hierarchical region merging: the ultrametric level of each border.
 *
 * Method:
 * 1. The borders are in a binary heap, keyed by merge cost: mean border strength times the smaller
 *    region's share of the image to a power, and for some criteria times a power of the colour
 *    distance.
 * 2. The cheapest border merges its two regions. Where both border on a third region, the two
 *    borders become one. The level of the border is the greatest merge cost so far.
 * 3. The best exponents differ between images. Therefore the merging runs with five criteria, each
 *    from the initial regions.
 * 4. A last run uses the geometric mean of the five levels as border strength. Its contours are
 *    closed at every level.
 *
 * Memory layout: a border is in the doubly linked lists of both its regions, as two half-borders.
 * Borders of the surviving region are marked at their other regions.
 *
 * Source: Arbelaez, Maire, Fowlkes and Malik 2011, section 4; the mean of several criteria is
 * this project's. */
#include "src/base/build.h"

#include "src/containers/heap.h"
#include "src/edges/boundary_work.h"

/* Half-borders per work unit, and the cost factor of a comparison of histograms. */
enum { HALF_BORDERS_PER_UNIT = 2, HISTOGRAM_UNITS = 8 };
/* Lower bound of a level before its logarithm is taken. */
#define MIN_LEVEL CAIRN_REAL(1e-9)

/* Merge criteria: multiple of the size exponent; 1: the colour distance is used. */
enum { CRITERIA_COUNT = 5 };
static const struct {
    cairn_real small;
    int32_t with_contrast;
} criteria[CRITERIA_COUNT] = {{0, 0}, {1, 0}, {2, 0}, {CAIRN_REAL(0.5), 1}, {CAIRN_REAL(1.5), 1}};

/* ---- Heap of borders ---- */

/* Returns whether the border at place a has the lower key; ties: the lower index. */
static int precedes(const void *context, int32_t a, int32_t b)
{
    const cairn_boundary *boundary = context;
    int32_t p = boundary->heap[a], q = boundary->heap[b];

    return boundary->borders[p].key < boundary->borders[q].key ||
           (p < q && boundary->borders[p].key <= boundary->borders[q].key);
}

/* Exchanges two heap elements and sets their back indices. */
static void exchange(void *context, int32_t a, int32_t b)
{
    const cairn_boundary *boundary = context;
    int32_t moved = boundary->heap[a];

    boundary->heap[a] = boundary->heap[b];
    boundary->heap[b] = moved;
    boundary->borders[boundary->heap[a]].heap_index = a;
    boundary->borders[moved].heap_index = b;
}

/* Restores the heap order after a change of the key of a border. */
static void update_key(cairn_boundary *boundary, int32_t border)
{
    heap_update(boundary, boundary->borders[border].heap_index, boundary->heap_count, precedes,
                exchange);
}

/* Removes a border from the heap. */
static void remove_border(cairn_boundary *boundary, int32_t border)
{
    heap_remove(boundary, boundary->borders[border].heap_index, boundary->heap_count, precedes,
                exchange);
    boundary->heap_count--;
    boundary->borders[border].heap_index = -1;
}

/* ---- Borders ---- */

/* Exponents of the current criterion; 0 in the last run. */
static cairn_real size_exponent_of(const cairn_boundary *boundary)
{
    return boundary->merge.criterion < CRITERIA_COUNT
               ? criteria[boundary->merge.criterion].small * boundary->params.size_exponent
               : 0;
}

static cairn_real contrast_exponent_of(const cairn_boundary *boundary)
{
    return boundary->merge.criterion < CRITERIA_COUNT &&
                   criteria[boundary->merge.criterion].with_contrast
               ? boundary->params.contrast_exponent
               : 0;
}

/* Returns the squared Hellinger distance of two regions' colour histograms, averaged over the
 * channels, 0 ... 1. */
static cairn_real hellinger_squared(const cairn_boundary *boundary, int32_t p, int32_t q)
{
    const cairn_real *u = boundary->merge.histogram + (ptrdiff_t)p * BOUNDARY_BINS,
                     *v = boundary->merge.histogram + (ptrdiff_t)q * BOUNDARY_BINS;
    int32_t count = boundary->channels > 1 ? BOUNDARY_BINS : BOUNDARY_L_BINS;
    cairn_real sum = 0;

    for (int32_t k = 0; k < count; k++)
        sum += cairn_sqrt(u[k] * v[k]);
    return 1 - sum / ((cairn_real)boundary->channels *
                      cairn_sqrt((cairn_real)boundary->regions[p].size *
                                 (cairn_real)boundary->regions[q].size));
}

/* Returns the merge cost of a border. */
static cairn_real merge_cost_of(const cairn_boundary *boundary, const boundary_border *border)
{
    const boundary_region *p = &boundary->regions[border->region[0]],
                          *q = &boundary->regions[border->region[1]];
    cairn_real mean = border->strength_sum / (cairn_real)border->length,
               contrast = contrast_exponent_of(boundary);

    if (contrast > 0 && mean > 0) {
        cairn_real distance_squared =
            hellinger_squared(boundary, border->region[0], border->region[1]);

        mean = distance_squared > 0 ? cairn_exp((1 - contrast) * cairn_log(mean) +
                                                contrast / 2 * cairn_log(distance_squared))
                                    : 0;
    }
    return mean * cairn_min(p->size_factor, q->size_factor);
}

/* Returns a region's share of the image to the power of the size exponent. */
static cairn_real size_factor_of(const cairn_boundary *boundary, int32_t region)
{
    cairn_real share =
        (cairn_real)boundary->regions[region].size / (cairn_real)boundary_pixels(boundary);

    return cairn_exp(size_exponent_of(boundary) * cairn_log(share));
}

/* Inserts a half-border into the list of a region. */
static void link_half_border(const cairn_boundary *boundary, int32_t half, int32_t region)
{
    boundary_border *border = &boundary->borders[half / 2];
    boundary_region *r = &boundary->regions[region];

    border->region[half % 2] = region;
    border->previous[half % 2] = -1;
    border->next[half % 2] = r->first_half_border;
    if (r->first_half_border >= 0)
        boundary->borders[r->first_half_border / 2].previous[r->first_half_border % 2] = half;
    r->first_half_border = half;
    r->border_count++;
}

/* Removes a half-border from the list of its region. */
static void unlink_half_border(const cairn_boundary *boundary, int32_t half)
{
    const boundary_border *border = &boundary->borders[half / 2];
    boundary_region *r = &boundary->regions[border->region[half % 2]];
    int32_t next = border->next[half % 2], last = border->previous[half % 2];

    if (last >= 0)
        boundary->borders[last / 2].next[last % 2] = next;
    else
        r->first_half_border = next;
    if (next >= 0)
        boundary->borders[next / 2].previous[next % 2] = last;
    r->border_count--;
}

/* ---- Merging ---- */

/* Returns the work units of the next merge. */
static int32_t merge_units(const cairn_boundary *boundary)
{
    const boundary_border *weakest = &boundary->borders[boundary->heap[0]];

    return 1 + (boundary->regions[weakest->region[0]].border_count +
                boundary->regions[weakest->region[1]].border_count) *
                   (contrast_exponent_of(boundary) > 0 ? HISTOGRAM_UNITS : 1) /
                   HALF_BORDERS_PER_UNIT;
}

/* Inserts a border into the heap. */
static void push_border(cairn_boundary *boundary, int32_t index)
{
    boundary_border *border = &boundary->borders[index];

    for (int32_t side = 0; side < 2; side++)
        boundary->regions[border->region[side]].size_factor =
            size_factor_of(boundary, border->region[side]);
    border->key = merge_cost_of(boundary, border);
    boundary->heap[boundary->heap_count] = index;
    border->heap_index = boundary->heap_count;
    heap_sift_up(boundary, boundary->heap_count++, precedes, exchange);
}

/* Sets, or clears, at each neighbour of a region the index of their common border. */
static void mark_neighbours(const cairn_boundary *boundary, int32_t region, int wipe)
{
    for (int32_t half = boundary->regions[region].first_half_border; half >= 0;
         half = boundary->borders[half / 2].next[half % 2])
        boundary->regions[boundary->borders[half / 2].region[1 - half % 2]].marked_border =
            wipe ? -1 : half / 2;
}

/* Transfers the borders of the absorbed region to the surviving region and merges duplicates. */
static void move_borders(cairn_boundary *boundary, int32_t survivor, int32_t absorbed)
{
    int32_t next;

    for (int32_t half = boundary->regions[absorbed].first_half_border; half >= 0; half = next) {
        boundary_border *border = &boundary->borders[half / 2];
        int32_t third = border->region[1 - half % 2], mark = boundary->regions[third].marked_border;

        next = border->next[half % 2];
        if (mark < 0) {
            link_half_border(boundary, half, survivor);
            continue;
        }
        boundary->borders[mark].strength_sum += border->strength_sum;
        boundary->borders[mark].length += border->length;
        border->merged_into = mark;
        unlink_half_border(boundary, half ^ 1);
        remove_border(boundary, half / 2);
    }
}

/* Merges the two regions of the cheapest border. */
static void merge_weakest(cairn_boundary *boundary)
{
    int32_t weakest = boundary->heap[0];
    boundary_border *border = &boundary->borders[weakest];
    int32_t side =
        boundary->regions[border->region[1]].size > boundary->regions[border->region[0]].size;
    int32_t survivor = border->region[side], absorbed = border->region[1 - side];

    boundary->merge.level = cairn_max(boundary->merge.level, border->key);
    border->level = boundary->merge.level;
    remove_border(boundary, weakest);
    unlink_half_border(boundary, 2 * weakest);
    unlink_half_border(boundary, 2 * weakest + 1);
    mark_neighbours(boundary, survivor, 0);
    move_borders(boundary, survivor, absorbed);
    mark_neighbours(boundary, survivor, 1);
    boundary->regions[survivor].size += boundary->regions[absorbed].size;
    for (int32_t k = 0; k < BOUNDARY_BINS && contrast_exponent_of(boundary) > 0; k++)
        boundary->merge.histogram[(ptrdiff_t)survivor * BOUNDARY_BINS + k] +=
            boundary->merge.histogram[(ptrdiff_t)absorbed * BOUNDARY_BINS + k];
    boundary->regions[survivor].size_factor = size_factor_of(boundary, survivor);
    for (int32_t half = boundary->regions[survivor].first_half_border; half >= 0;
         half = boundary->borders[half / 2].next[half % 2]) {
        boundary->borders[half / 2].key = merge_cost_of(boundary, &boundary->borders[half / 2]);
        update_key(boundary, half / 2);
    }
}

int cairn_boundary_merge(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    boundary->heap_count = 0;
    boundary->merge.level = 0;
    for (boundary->merge.cursor = 0; boundary->merge.cursor < boundary->border_count;
         boundary->merge.cursor++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        push_border(boundary, boundary->merge.cursor);
    }
    while (boundary->heap_count > 0) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, merge_units(boundary));
        merge_weakest(boundary);
    }
    CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
    CAIRN_STEP_END(boundary->phase_resume);
}

/* ---- Merge criteria ---- */

int cairn_boundary_has_criterion(const cairn_boundary *boundary)
{
    return boundary->merge.criterion < CRITERIA_COUNT;
}

/* Resets a region to its state before merging. */
static void clear_region(const cairn_boundary *boundary, int32_t region)
{
    boundary_region *r = &boundary->regions[region];

    r->first_half_border = r->marked_border = -1;
    r->border_count = 0;
    r->size = r->initial_size;
    for (int32_t k = 0; k < BOUNDARY_BINS && contrast_exponent_of(boundary) > 0; k++)
        boundary->merge.histogram[(ptrdiff_t)region * BOUNDARY_BINS + k] =
            boundary->merge.initial_histogram[(ptrdiff_t)region * BOUNDARY_BINS + k];
}

/* Resets a border to its state before merging. */
static void clear_border(const cairn_boundary *boundary, int32_t border)
{
    boundary_border *e = &boundary->borders[border];

    e->merged_into = border;
    e->length = e->initial_length;
    e->strength_sum =
        (cairn_real)e->initial_length * (boundary->merge.criterion < CRITERIA_COUNT
                                             ? e->strength
                                             : cairn_exp(e->log_level_sum / CRITERIA_COUNT));
    for (int32_t side = 0; side < 2; side++)
        link_half_border(boundary, 2 * border + side, e->initial_region[side]);
}

int cairn_boundary_reset(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    for (boundary->merge.cursor = 0; boundary->merge.cursor < boundary->region_count;
         boundary->merge.cursor++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        clear_region(boundary, boundary->merge.cursor);
    }
    for (boundary->merge.cursor = 0; boundary->merge.cursor < boundary->border_count;
         boundary->merge.cursor++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        clear_border(boundary, boundary->merge.cursor);
    }
    CAIRN_STEP_END(boundary->phase_resume);
}

/* Returns the border into which a border was merged. The way there is halved. */
static int32_t final_border(const cairn_boundary *boundary, int32_t border)
{
    boundary_border *borders = boundary->borders;

    while (borders[border].merged_into != border) {
        borders[border].merged_into = borders[borders[border].merged_into].merged_into;
        border = borders[border].merged_into;
    }
    return border;
}

/* Adds the level of a border in this run. */
static void record_level(const cairn_boundary *boundary, int32_t border)
{
    boundary->borders[border].log_level_sum +=
        cairn_log(cairn_max(boundary->borders[final_border(boundary, border)].level, MIN_LEVEL));
}

int cairn_boundary_record(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->phase_resume);
    for (boundary->merge.cursor = 0; boundary->merge.cursor < boundary->border_count;
         boundary->merge.cursor++) {
        CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
        record_level(boundary, boundary->merge.cursor);
    }
    CAIRN_STEP_CHARGE(boundary, phase_resume, budget, 1);
    CAIRN_STEP_END(boundary->phase_resume);
}
