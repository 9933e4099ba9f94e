/* scan_set: storage of scans for an aligner. A scan is validated completely before it is copied.
 *
 * Layout: segments, points, masses and position bits in the order of add(). A removed scan leaves a
 * gap in each array, its segments marked by scan -1; compaction walks over the segments. Free slots
 * are a linked list through first_segment. With spacing a segment has a bit for each of its
 * positions, set where it has a point, in words of its own.
 * Source: Adluru 2008, section 7.3.5. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/scan_set.h"
#include "src/base/object.h"
#include "src/scans/scan_place.h"

enum { MAX_SCANS = 1 << 20, MAX_ITEMS = 1 << 24, NO_SLOT = -1 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_scan_set_params, field, __VA_ARGS__)

/* Lowest and highest value; a set has no defaults. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 0, 1, MAX_SCANS),
    INTEGER(max_segments, 0, 1, MAX_ITEMS),
    INTEGER(max_points, 0, 1, MAX_ITEMS),
    CAIRN_NUMBER(cairn_scan_set_params, spacing, 0, 0, CAIRN_MAX_MAGNITUDE),
};
extern const cairn_parameters cairn_scan_set_parameters;
const cairn_parameters cairn_scan_set_parameters =
    CAIRN_PARAMETERS("scan_set", cairn_scan_set_params, rows);

cairn_status cairn_scan_set_check(const cairn_scan_set_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_scan_set_parameters, params, fault);
}

static int32_t word_capacity(const cairn_scan_set_params *params)
{
    return params->max_points / 32 + params->max_segments;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_scan_set *build(cairn_pool *pool, const cairn_scan_set_params *params)
{
    cairn_scan_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, scans, params->max_scans);
    CAIRN_TAKE(set, pool, segments, params->max_segments);
    if (params->spacing > 0) {
        CAIRN_TAKE(set, pool, position_bits, word_capacity(params));
    } else {
        CAIRN_TAKE(set, pool, points, params->max_points);
        CAIRN_TAKE(set, pool, mass, params->max_points);
    }
    if (set != NULL) {
        set->params = *params;
        cairn_scan_set_clear(set);
    }
    return set;
}

CAIRN_OBJECT(scan_set, scan_set, build);

static cairn_status check_masses(const cairn_real *mass, int32_t count, cairn_fault *fault)
{
    for (int32_t i = 0; i < count; i++) {
        if (!cairn_is_finite(mass[i]))
            return cairn_refuse(fault, i, "a mass is not finite", CAIRN_NOT_FINITE);
        if (!(mass[i] > 0 && mass[i] <= CAIRN_MAX_MAGNITUDE))
            return cairn_refuse(fault, i, "a mass is not above 0, at most 1e6", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

/* Positions along a segment: a one-dimensional lattice. */
struct lattice {
    cairn_vec2 direction;
    cairn_real margin;
    int32_t count;
};

static struct lattice lattice_of(const cairn_scan_set *set, cairn_segment segment)
{
    cairn_vec2 along = cairn_vec2_sub(segment.b, segment.a);
    cairn_real length = cairn_vec2_norm(along);
    struct lattice lattice;

    lattice.direction = cairn_vec2_unit(along);
    lattice.count = cairn_scan_position_count(length, set->params.spacing);
    lattice.margin = cairn_scan_first_position(length, lattice.count, set->params.spacing);
    return lattice;
}

static cairn_vec2 position_at(const cairn_scan_set *set, cairn_segment segment,
                              const struct lattice *lattice, int32_t k)
{
    return cairn_scan_position(segment.a, lattice->direction, lattice->margin, k,
                               set->params.spacing);
}

/* Matches the points of a segment with its positions in order; sets their bits in bits[] unless
 * NULL. Returns 0 when a point is at no position; *point is its index. */
static int match_positions(const cairn_scan_set *set, const cairn_scan_view *view, int32_t segment,
                           uint32_t *bits, int32_t *point)
{
    struct lattice lattice = lattice_of(set, view->segments[segment]);

    *point = view->first_point[segment];
    for (int32_t k = 0; k < lattice.count && *point < view->first_point[segment + 1]; k++) {
        cairn_vec2 place = position_at(set, view->segments[segment], &lattice, k);
        cairn_vec2 p = view->points[*point].position;

        if (place.x != p.x || place.y != p.y)
            continue;
        if (bits != NULL)
            bits[k / 32] |= UINT32_C(1) << k % 32;
        (*point)++;
    }
    return *point == view->first_point[segment + 1];
}

/* Returns the words that the position bits of a segment of a view take. */
static int32_t words_of(const cairn_scan_set *set, const cairn_scan_view *view, int32_t segment)
{
    int32_t places;

    if (view->first_point[segment] == view->first_point[segment + 1])
        return 0;
    places = lattice_of(set, view->segments[segment]).count;
    return places / 32 + (places % 32 != 0);
}

static int has_word_capacity(const cairn_scan_set *set, const cairn_scan_view *view)
{
    int32_t left = word_capacity(&set->params) - set->word_count;

    for (int32_t i = 0; i < view->segment_count && left >= 0; i++)
        left -= words_of(set, view, i);
    return left >= 0;
}

static cairn_status check_positions(const cairn_scan_set *set, const cairn_scan_view *view,
                                    const cairn_real *mass, cairn_fault *fault)
{
    int32_t point;

    if (!(set->params.spacing > 0))
        return CAIRN_OK;
    if (mass != NULL)
        return cairn_refuse(fault, -1, "masses, but the set keeps none", CAIRN_BAD_ARGUMENT);
    if (!has_word_capacity(set, view))
        return cairn_refuse(fault, -1, "more than max_points places", CAIRN_FULL);
    for (int32_t i = 0; i < view->segment_count; i++)
        if (!match_positions(set, view, i, NULL, &point))
            return cairn_refuse(fault, point, "a point is at no place of its segment",
                                CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

static cairn_status check_capacity(const cairn_scan_set *set, const cairn_scan_view *view,
                                   cairn_fault *fault)
{
    if (cairn_scan_set_next(set) < 0)
        return cairn_refuse(fault, -1, "more than max_scans scans", CAIRN_FULL);
    if (view->segment_count > set->params.max_segments - set->segment_count)
        return cairn_refuse(fault, -1, "more than max_segments segments", CAIRN_FULL);
    if (view->point_count > set->params.max_points - set->point_count)
        return cairn_refuse(fault, -1, "more than max_points points", CAIRN_FULL);
    return CAIRN_OK;
}

static void copy_position_bits(cairn_scan_set *set, const cairn_scan_view *view, int32_t segment,
                               uint32_t *bits)
{
    int32_t words = words_of(set, view, segment), point;

    memset(bits, 0, (size_t)words * sizeof *bits);
    (void)match_positions(set, view, segment, bits, &point);
    set->word_count += words;
}

static void copy_segments(cairn_scan_set *set, const cairn_scan_view *view, int32_t slot)
{
    for (int32_t i = 0; i < view->segment_count; i++) {
        cairn_scan_set_segment *to = &set->segments[set->segment_count + i];
        int32_t first = view->first_point[i], end = view->first_point[i + 1];
        cairn_vec2 none = {0, 0};

        to->segment = view->segments[i];
        to->direction = first < end ? cairn_vec2_unit(view->points[first].direction) : none;
        to->first_point = set->point_count + first;
        to->end_point = set->point_count + end;
        to->first_word = set->word_count;
        to->scan = slot;
        if (set->params.spacing > 0)
            copy_position_bits(set, view, i, set->position_bits + set->word_count);
    }
}

static cairn_vec2 centroid_of(const cairn_oriented_point *points, int32_t count)
{
    cairn_vec2 sum = {0, 0};

    for (int32_t i = 0; i < count; i++)
        sum = cairn_vec2_add(sum, points[i].position);
    return count > 0 ? cairn_vec2_scale(sum, 1 / (cairn_real)count) : sum;
}

static cairn_real spread_about(cairn_vec2 centre, const cairn_oriented_point *points, int32_t count)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < count; i++)
        sum += cairn_vec2_norm_squared(cairn_vec2_sub(points[i].position, centre));
    return count > 0 ? sum / (cairn_real)count : 0;
}

int32_t cairn_scan_set_next(const cairn_scan_set *set)
{
    if (set->free_slot != NO_SLOT)
        return set->free_slot;
    return set->scan_count < set->params.max_scans ? set->scan_count : NO_SLOT;
}

static int32_t take_slot(cairn_scan_set *set)
{
    int32_t slot = cairn_scan_set_next(set);

    if (slot == set->scan_count)
        set->scan_count++;
    else
        set->free_slot = set->scans[slot].first_segment;
    return slot;
}

cairn_status cairn_scan_set_add(cairn_scan_set *set, const cairn_scan_view *view,
                                const cairn_real *mass, cairn_fault *fault)
{
    cairn_scan_set_scan *scan;
    cairn_scan_view kept;
    cairn_status status;
    int32_t slot;

    if (set == NULL || view == NULL)
        return cairn_refuse(fault, -1, "no set or no scan", CAIRN_BAD_ARGUMENT);
    kept = *view;
    kept.beam_count = 0; /* beams are not read */
    status = cairn_scan_view_check(&kept, fault);
    if (status == CAIRN_OK && mass != NULL)
        status = check_masses(mass, view->point_count, fault);
    if (status == CAIRN_OK)
        status = check_capacity(set, view, fault);
    if (status == CAIRN_OK)
        status = check_positions(set, view, mass, fault);
    if (status != CAIRN_OK)
        return status;

    slot = take_slot(set);
    scan = &set->scans[slot];
    scan->word_count = -set->word_count;
    copy_segments(set, view, slot);
    scan->word_count += set->word_count;
    for (int32_t i = 0; i < view->point_count && !(set->params.spacing > 0); i++) {
        set->points[set->point_count + i] = view->points[i].position;
        set->mass[set->point_count + i] = mass != NULL ? mass[i] : 1;
    }
    scan->in_use = 1;
    scan->first_segment = set->segment_count;
    scan->end_segment = set->segment_count + view->segment_count;
    scan->first_point = set->point_count;
    scan->end_point = set->point_count + view->point_count;
    scan->centroid = centroid_of(view->points, view->point_count);
    scan->sensor = view->sensor;
    scan->centroid_spread = spread_about(scan->centroid, view->points, view->point_count);
    scan->sensor_spread = spread_about(scan->sensor, view->points, view->point_count);
    set->segment_count += view->segment_count;
    set->point_count += view->point_count;
    return cairn_refuse(fault, -1, NULL, CAIRN_OK);
}

/* ---- Removal and compaction ---- */

cairn_status cairn_scan_set_remove(cairn_scan_set *set, int32_t scan)
{
    cairn_scan_set_scan *removed;

    if (set == NULL || scan < 0 || scan >= set->scan_count || !set->scans[scan].in_use)
        return CAIRN_BAD_ARGUMENT;
    removed = &set->scans[scan];
    for (int32_t i = removed->first_segment; i < removed->end_segment; i++)
        set->segments[i].scan = NO_SLOT;
    if (removed->first_segment < removed->end_segment &&
        (!set->needs_packing || removed->first_segment < set->pack_from)) {
        const cairn_scan_set_segment *first = &set->segments[removed->first_segment];

        set->needs_packing = 1;
        set->pack_from = set->pack_segment = removed->first_segment;
        set->pack_point = first->first_point;
        set->pack_word = first->first_word;
    }
    removed->in_use = 0;
    removed->first_segment = set->free_slot;
    set->free_slot = scan;
    return CAIRN_OK;
}

/* Moves a scan to the start of the gap before it. Segments left behind are marked as removed. */
static void move_scan(cairn_scan_set *set, cairn_scan_set_scan *scan)
{
    int32_t first = scan->first_segment, end = scan->end_segment, count = end - first;
    int32_t points = scan->end_point - scan->first_point,
            by_points = scan->first_point - set->pack_point;
    int32_t word = set->segments[first].first_word, by_words = word - set->pack_word;

    if (set->position_bits != NULL) {
        memmove(set->position_bits + set->pack_word, set->position_bits + word,
                (size_t)scan->word_count * sizeof *set->position_bits);
    } else {
        memmove(set->points + set->pack_point, set->points + scan->first_point,
                (size_t)points * sizeof *set->points);
        memmove(set->mass + set->pack_point, set->mass + scan->first_point,
                (size_t)points * sizeof *set->mass);
    }
    for (int32_t i = 0; i < count; i++) {
        cairn_scan_set_segment *to = &set->segments[set->pack_segment + i];

        *to = set->segments[first + i];
        to->first_point -= by_points;
        to->end_point -= by_points;
        to->first_word -= by_words;
    }
    scan->first_segment = set->pack_segment;
    scan->end_segment = set->pack_segment + count;
    scan->first_point -= by_points;
    scan->end_point -= by_points;
    for (int32_t i = first > scan->end_segment ? first : scan->end_segment; i < end; i++)
        set->segments[i].scan = NO_SLOT;
    set->pack_segment += count;
    set->pack_point += points;
    set->pack_word += scan->word_count;
    set->pack_from = end;
}

cairn_status cairn_scan_set_pack(cairn_scan_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->needs_packing && set->pack_from < set->segment_count) {
        int32_t slot = set->segments[set->pack_from].scan;

        if (slot == NO_SLOT) {
            if (!cairn_budget_charge(budget, &set->pack_units, 1))
                return CAIRN_MORE;
            for (int32_t i = 0; i < 8 && set->pack_from < set->segment_count &&
                                set->segments[set->pack_from].scan == NO_SLOT;
                 i++)
                set->pack_from++;
        } else {
            cairn_scan_set_scan *scan = &set->scans[slot];
            int32_t segments = scan->end_segment - scan->first_segment,
                    points = scan->end_point - scan->first_point;

            if (!cairn_budget_charge(budget, &set->pack_units, 1 + segments / 2 + points / 8))
                return CAIRN_MORE;
            move_scan(set, scan);
        }
    }
    if (set->needs_packing) {
        set->segment_count = set->pack_segment;
        set->point_count = set->pack_point;
        set->word_count = set->pack_word;
        set->needs_packing = 0;
    }
    return CAIRN_OK;
}

/* ---- Points ---- */

static int32_t bits_in(uint32_t word)
{
    word -= word >> 1 & UINT32_C(0x55555555);
    word = (word & UINT32_C(0x33333333)) + (word >> 2 & UINT32_C(0x33333333));
    word = (word + (word >> 4)) & UINT32_C(0x0f0f0f0f);
    return (int32_t)(word * UINT32_C(0x01010101) >> 24);
}

void cairn_scan_set_read(const cairn_scan_set *set, int32_t segment, int32_t first, int32_t count,
                         cairn_vec2 *points)
{
    const cairn_scan_set_segment *s = &set->segments[segment];
    const uint32_t *word;
    struct lattice lattice;
    int32_t k = 0, done = 0, skip = first;

    CAIRN_ASSERT(first >= 0 && first + count <= s->end_point - s->first_point);
    if (set->position_bits == NULL) {
        for (; done < count; done++)
            points[done] = set->points[s->first_point + first + done];
        return;
    }
    lattice = lattice_of(set, s->segment);
    word = set->position_bits + s->first_word;
    for (; skip > 0 && bits_in(*word) <= skip; word++, k += 32)
        skip -= bits_in(*word);
    for (; done < count; k++) {
        if (*word >> k % 32 & 1) {
            if (skip > 0)
                skip--;
            else
                points[done++] = position_at(set, s->segment, &lattice, k);
        }
        word += k % 32 == 31;
    }
}

void cairn_scan_set_clear(cairn_scan_set *set)
{
    set->scan_count = set->segment_count = set->point_count = set->word_count = 0;
    set->free_slot = NO_SLOT;
    set->needs_packing = 0;
    set->pack_units = 0;
}
