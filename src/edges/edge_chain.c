/* Chains of edge pixels by ordered thinning and edge linking: the object, pruning and linking.
 *
 * Method:
 * 1. Distance transform: the capped distance of every edge pixel to the nearest pixel without an
 *    edge (edge_chain_thin.c, with the next).
 * 2. Thinning: edge pixels are processed in order of strength, ties in order of distance, and
 *    removed when they are simple points and not line ends. That is: the removal neither splits a
 *    line, nor closes a hole, nor shortens a line from its end. A removal requeues the neighbours
 *    that had to stay. The result is one pixel wide and follows the crests of the strengths, or the
 *    middle of equally strong regions.
 * 3. Pruning: short side branches (spurs) are removed.
 * 4. Linking: pixels are linked to their four neighbours, and to a diagonal one where no shorter
 *    path leads. The number of links distinguishes ends (1), lines (2) and junctions (3 or more).
 *    Lines are followed from the ends and junctions; the rest are closed lines.
 *
 * Memory layout: one byte per pixel with a border of one pixel, so that all neighbours exist; one
 * queue per strength and distance, as linked lists through the edge pixels.
 *
 * Limits: edges of uniform strength wider than twice EDGE_CHAIN_MAX_DISTANCE are thinned to a line
 * that need not be in the middle.
 *
 * Source: Adluru 2008, section 2; simple points: Yokoi, Toriwaki and Fukumura 1975; order by
 * distance: Pudney 1998. */
#include "src/base/build.h"

#include "src/edges/edge_chain_work.h"

enum { MAX_COUNT = 1 << 28, MAX_SPUR = 64 };

/* Work units of a link that is followed, or tried as a start. */
enum { UNITS_PER_LINK = 2 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_edge_chain_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_width, 640, 1, CAIRN_RASTER_MAX_SIDE),
    INTEGER(max_height, 480, 1, CAIRN_RASTER_MAX_SIDE),
    INTEGER(max_edges, 100000, 1, MAX_COUNT),
    INTEGER(max_chains, 10000, 1, MAX_COUNT),
    INTEGER(min_strength, 1, 1, 255),
    INTEGER(min_length, 5, 2, INT32_MAX),
    INTEGER(max_spur, 3, 0, MAX_SPUR),
};
extern const cairn_parameters cairn_edge_chain_parameters;
const cairn_parameters cairn_edge_chain_parameters =
    CAIRN_PARAMETERS("edge_chain", cairn_edge_chain_params, rows);

cairn_edge_chain_params cairn_edge_chain_default(void)
{
    cairn_edge_chain_params params;

    cairn_parameters_preset(&cairn_edge_chain_parameters, &params);
    return params;
}

cairn_status cairn_edge_chain_check(const cairn_edge_chain_params *params,
                                    cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_edge_chain_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_edge_chain_set *build(cairn_pool *pool, const cairn_edge_chain_params *params)
{
    size_t cells = ((size_t)params->max_width + 2) * ((size_t)params->max_height + 2);
    size_t edges = (size_t)params->max_edges, chains = (size_t)params->max_chains;
    cairn_edge_chain_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, flags, cells);
    CAIRN_TAKE(set, pool, head, 2 * EDGE_CHAIN_QUEUE_COUNT);
    CAIRN_TAKE(set, pool, entries, edges);
    CAIRN_TAKE(set, pool, pixels, edges + 2 * chains + 2);
    CAIRN_TAKE(set, pool, chains, chains);
    if (set != NULL) {
        set->params = *params;
        set->status = CAIRN_EMPTY;
        set->tail = set->head + EDGE_CHAIN_QUEUE_COUNT;
    }
    return set;
}

CAIRN_OBJECT(edge_chain, edge_chain_set, build);

cairn_status cairn_edge_chain_begin(cairn_edge_chain_set *set, cairn_raster_u8_view strengths)
{
    if (set == NULL || cairn_raster_u8_check(strengths) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    if (strengths.width > set->params.max_width || strengths.height > set->params.max_height)
        return CAIRN_FULL;
    set->strengths = strengths;
    set->stride = strengths.width + 2;
    set->neighbour_offset[0] = 1;
    set->neighbour_offset[1] = set->stride + 1;
    set->neighbour_offset[2] = set->stride;
    set->neighbour_offset[3] = set->stride - 1;
    for (int32_t k = 0; k < 4; k++)
        set->neighbour_offset[k + 4] = -set->neighbour_offset[k];
    set->free_entry = -1;
    set->chain_count = set->pixel_count = set->edge_count = set->short_count = 0;
    set->units_charged = 0;
    set->resume = set->phase_resume = 0;
    set->status = CAIRN_MORE;
    return CAIRN_OK;
}

/* ---- Pixels ---- */

/* Links of a pixel: its edge neighbours, diagonal ones only where no pixel adjacent to both
 * connects them. */
static uint32_t links_of(const cairn_edge_chain_set *set, int32_t cell)
{
    uint32_t mask = edge_chain_neighbours_of(set, cell), links = mask;

    for (int32_t k = 1; k < 8; k += 2)
        if (edge_chain_has_bit(mask, k - 1) || edge_chain_has_bit(mask, k + 1))
            links &= ~(1U << k);
    return links;
}

static int32_t first_bit(uint32_t links)
{
    int32_t k = 0;

    while (!edge_chain_has_bit(links, k))
        k++;
    return k;
}

/* The other link of a pixel with two links. */
static int32_t next_pixel(const cairn_edge_chain_set *set, int32_t previous, int32_t current)
{
    uint32_t links = links_of(set, current);
    int32_t k = first_bit(links);

    if (current + set->neighbour_offset[k] == previous)
        k = first_bit(links & ~(1U << k));
    return current + set->neighbour_offset[k];
}

/* 1 when the cursor is at an edge pixel. */
static int is_at_edge(const cairn_edge_chain_set *set)
{
    return (set->flags[set->cursor] & EDGE_CHAIN_FLAG_EDGE) != 0;
}

/* Skips the next pixels that are no edge pixels. */
static void skip_pixels(cairn_edge_chain_set *set)
{
    int32_t cells = edge_chain_cell_count(set),
            end = cells - set->cursor < EDGE_CHAIN_SKIPPED_PER_UNIT
                      ? cells
                      : set->cursor + EDGE_CHAIN_SKIPPED_PER_UNIT;

    while (set->cursor < end && !is_at_edge(set))
        set->cursor++;
}

/* ---- Spurs ---- */

/* Removes the line from an end to a junction when it is at most max_spur long. */
static void prune_spur(cairn_edge_chain_set *set, int32_t tip)
{
    int32_t previous = tip, current = tip + set->neighbour_offset[first_bit(links_of(set, tip))],
            length = 1;

    while (length < set->params.max_spur && edge_chain_bit_count(links_of(set, current)) == 2) {
        int32_t next = next_pixel(set, previous, current);

        previous = current;
        current = next;
        length++;
    }
    if (edge_chain_bit_count(links_of(set, current)) < 3)
        return;
    for (previous = tip; previous != current;) {
        int32_t next = previous + set->neighbour_offset[first_bit(links_of(set, previous))];

        set->flags[previous] = 0;
        previous = next;
    }
}

/* 1 when the cursor is at the end of a line. */
static int is_at_end(const cairn_edge_chain_set *set)
{
    return edge_chain_bit_count(links_of(set, set->cursor)) == 1;
}

static int prune(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = edge_chain_cell_count(set);

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < cells && set->params.max_spur > 0;)
        if (!is_at_edge(set)) {
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            skip_pixels(set);
        } else {
            CAIRN_STEP_CHARGE(set, phase_resume, budget,
                              is_at_end(set) ? 2 * set->params.max_spur + 1 : 1);
            if (is_at_end(set))
                prune_spur(set, set->cursor);
            set->cursor++;
        }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Following ---- */

static void append(cairn_edge_chain_set *set, int32_t cell)
{
    CAIRN_ASSERT(set->pixel_count < set->params.max_edges + 2 * set->params.max_chains + 2);
    set->pixels[set->pixel_count++] = edge_chain_pixel_of(set, cell);
    set->strength_sum += edge_chain_strength_at(set, cell);
}

static int32_t chain_start(const cairn_edge_chain_set *set)
{
    const cairn_edge_chain *last = &set->chains[set->chain_count - 1];

    return set->chain_count == 0 ? 0 : last->first + last->count;
}

static void start_chain(cairn_edge_chain_set *set, int32_t start, int32_t second)
{
    set->is_following = 1;
    set->start = set->previous = start;
    set->current = second;
    set->strength_sum = 0;
    append(set, start);
}

static cairn_edge_chain_end end_at(const cairn_edge_chain_set *set, int32_t cell)
{
    return edge_chain_bit_count(links_of(set, cell)) == 1 ? CAIRN_EDGE_CHAIN_OPEN
                                                          : CAIRN_EDGE_CHAIN_JUNCTION;
}

/* Stores the followed chain, or drops it as too short. More than max_chains end the extraction. */
static void end_chain(cairn_edge_chain_set *set, cairn_edge_chain_end from, cairn_edge_chain_end to)
{
    int32_t first = chain_start(set), count = set->pixel_count - first;
    cairn_edge_chain *chain;

    set->is_following = 0;
    if (count < set->params.min_length) {
        set->pixel_count = first;
        set->short_count++;
        return;
    }
    if (set->chain_count == set->params.max_chains) {
        set->status = CAIRN_FULL;
        return;
    }
    chain = &set->chains[set->chain_count++];
    chain->first = first;
    chain->count = count;
    chain->from = from;
    chain->to = to;
    chain->strength = (cairn_real)set->strength_sum / (cairn_real)count;
}

/* Follows the chain by one pixel, which is neither an end nor a junction. */
static void pass_pixel(cairn_edge_chain_set *set)
{
    int32_t next = next_pixel(set, set->previous, set->current);

    set->flags[set->current] |= EDGE_CHAIN_FLAG_USED;
    set->previous = set->current;
    set->current = next;
}

/* Follows the chain by one pixel. */
static void follow(cairn_edge_chain_set *set)
{
    if (set->is_loop && set->current == set->start) {
        end_chain(set, CAIRN_EDGE_CHAIN_CLOSED, CAIRN_EDGE_CHAIN_CLOSED);
        return;
    }
    append(set, set->current);
    if (edge_chain_bit_count(links_of(set, set->current)) != 2)
        end_chain(set, end_at(set, set->start), end_at(set, set->current));
    else
        pass_pixel(set);
}

/* Starts the next line from the end or junction at the cursor that has not been followed from its
 * other end. Returns 0 when none is left. */
static int start_line(cairn_edge_chain_set *set)
{
    uint32_t links = links_of(set, set->cursor);

    if (edge_chain_bit_count(links) == 2)
        return 0;
    for (; set->direction < 8; set->direction++) {
        int32_t next = set->cursor + set->neighbour_offset[set->direction];

        if (!edge_chain_has_bit(links, set->direction) ||
            (set->flags[next] & EDGE_CHAIN_FLAG_USED) ||
            (next < set->cursor && edge_chain_bit_count(links_of(set, next)) != 2))
            continue;
        set->direction++;
        start_chain(set, set->cursor, next);
        return 1;
    }
    return 0;
}

static int start_loop(cairn_edge_chain_set *set)
{
    uint32_t links = links_of(set, set->cursor);

    if (edge_chain_bit_count(links) != 2 || (set->flags[set->cursor] & EDGE_CHAIN_FLAG_USED))
        return 0;
    set->flags[set->cursor] |= EDGE_CHAIN_FLAG_USED;
    start_chain(set, set->cursor, set->cursor + set->neighbour_offset[first_bit(links)]);
    return 1;
}

/* Starts the next chain at the cursor. Returns 0 when none is left. */
static int start_next(cairn_edge_chain_set *set)
{
    return set->is_loop ? start_loop(set) : start_line(set);
}

/* Chains: the lines, or the loops. */
static int follow_chains(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = edge_chain_cell_count(set);

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < cells && set->status == CAIRN_MORE;)
        if (!is_at_edge(set)) {
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            skip_pixels(set);
        } else {
            set->direction = 0;
            CAIRN_STEP_CHARGE(set, phase_resume, budget, UNITS_PER_LINK);
            while (set->status == CAIRN_MORE && start_next(set)) {
                do {
                    CAIRN_STEP_CHARGE(set, phase_resume, budget, UNITS_PER_LINK);
                    follow(set);
                } while (set->is_following && set->status == CAIRN_MORE);
                if (set->status == CAIRN_MORE)
                    CAIRN_STEP_CHARGE(set, phase_resume, budget, UNITS_PER_LINK);
            }
            set->cursor++;
        }
    CAIRN_STEP_END(set->phase_resume);
}

/* The extraction: see Method in the head of this file. */
static int extract(cairn_edge_chain_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->resume);
    CAIRN_STEP_RUN(set, resume, budget, cairn_edge_chain_load);
    if (set->status == CAIRN_MORE) {
        CAIRN_STEP_RUN(set, resume, budget, cairn_edge_chain_fill_queues);
        CAIRN_STEP_RUN(set, resume, budget, cairn_edge_chain_thin);
        CAIRN_STEP_RUN(set, resume, budget, prune);
        for (set->is_loop = 0; set->is_loop < 2; set->is_loop++)
            CAIRN_STEP_RUN(set, resume, budget, follow_chains);
    }
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_edge_chain_step(cairn_edge_chain_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (set->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!extract(set, budget))
        return CAIRN_MORE;
    if (set->status == CAIRN_MORE)
        set->status = CAIRN_OK;
    return set->status;
}

cairn_edge_chain_result cairn_edge_chain_read(const cairn_edge_chain_set *set)
{
    cairn_edge_chain_result result = {0};

    if (set == NULL || set->status != CAIRN_OK)
        return result;
    result.chains = set->chains;
    result.pixels = set->pixels;
    result.chain_count = set->chain_count;
    result.pixel_count = set->pixel_count;
    result.edge_count = set->edge_count;
    result.short_count = set->short_count;
    return result;
}
