/* Chains of edge pixels by ordered thinning and edge linking.
 *
 * Method:
 * 1. Distance transform: the capped distance of every edge pixel to the nearest pixel without an
 *    edge.
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
 * Limits: edges of uniform strength wider than twice MAX_DISTANCE are thinned to a line that need
 * not be in the middle.
 *
 * Source: Adluru 2008, section 2; simple points: Yokoi, Toriwaki and Fukumura 1975; order by
 * distance: Pudney 1998. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/edge_chain.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum { MAX_COUNT = 1 << 28, MAX_SPUR = 64 };

/* Bits of a pixel: its distance, capped, and flags. */
enum { MAX_DISTANCE = 7, DISTANCE_MASK = 7, FLAG_EDGE = 8, FLAG_QUEUED = 16, FLAG_USED = 32 };

enum { QUEUE_COUNT = 256 * (MAX_DISTANCE + 1) };

/* Items for one work unit: pixels that are skipped, pixels and queues that are processed. */
enum { SKIPPED_PER_UNIT = 16, PIXELS_PER_UNIT = 4, QUEUES_PER_UNIT = 8 };

/* Work units of a link that is followed, or tried as a start. */
enum { UNITS_PER_LINK = 2 };

typedef struct queue_entry {
    int32_t pixel, next; /* next: -1 at the end */
} queue_entry;

struct cairn_edge_chain_set {
    cairn_edge_chain_params params;
    /* [(max_height + 2) * (max_width + 2)] */
    uint8_t *flags;
    /* [QUEUE_COUNT], -1: empty */
    int32_t *head, *tail;
    /* [max_edges]; a pixel is in one queue at most */
    queue_entry *entries;
    /* [max_edges + 2 * max_chains + 2]: all pixels once, ends again, and those of the current
     * chain */
    cairn_edge_chain_pixel *pixels;
    /* [max_chains] */
    cairn_edge_chain *chains;
    cairn_raster_u8_view strengths;
    /* row stride of flags */
    int32_t stride;
    /* index offsets of the 8 neighbours: east, then clockwise on the screen */
    int32_t neighbour_offset[8];
    /* next pixel of the image, row by row, or next queue */
    int32_t cursor;
    union {
        /* loading and thinning: head of the free list of entries, linked by next, -1: empty; lowest
         * queue that may hold a pixel */
        struct {
            int32_t free_entry, queue;
        };
        /* chains */
        struct {
            /* sum of strengths of the chain being followed */
            int64_t strength_sum;
            /* 1: a chain is being followed, from `start` via `previous` to `current`; 1: it is a
             * loop */
            int32_t is_following, is_loop;
            int32_t start, previous, current;
            /* lines: next neighbour of the cursor's pixel to follow */
            int32_t direction;
        };
    };
    int32_t chain_count, pixel_count, edge_count, short_count;
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none */
    cairn_status status;
    /* resume points of the extraction and of a phase */
    int32_t resume, phase_resume;
    /* work units charged for the current item */
    int32_t units_charged;
};

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
    CAIRN_TAKE(set, pool, head, 2 * QUEUE_COUNT);
    CAIRN_TAKE(set, pool, entries, edges);
    CAIRN_TAKE(set, pool, pixels, edges + 2 * chains + 2);
    CAIRN_TAKE(set, pool, chains, chains);
    if (set != NULL) {
        set->params = *params;
        set->status = CAIRN_EMPTY;
        set->tail = set->head + QUEUE_COUNT;
    }
    return set;
}

size_t cairn_edge_chain_memory(const cairn_edge_chain_params *params)
{
    cairn_pool counting;

    if (cairn_edge_chain_check(params, NULL) != CAIRN_OK)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)build(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_edge_chain_create(cairn_edge_chain_set **set, cairn_pool *pool,
                                     const cairn_edge_chain_params *params)
{
    cairn_status status = cairn_object_admit(set, pool, cairn_edge_chain_memory(params));

    if (status == CAIRN_OK)
        *set = build(pool, params);
    return status;
}

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

static int32_t cell_count(const cairn_edge_chain_set *set)
{
    return set->stride * (set->strengths.height + 2);
}

static cairn_edge_chain_pixel pixel_of(const cairn_edge_chain_set *set, int32_t cell)
{
    cairn_edge_chain_pixel pixel = {(int16_t)(cell % set->stride - 1),
                                    (int16_t)(cell / set->stride - 1)};

    return pixel;
}

static int32_t strength_at(const cairn_edge_chain_set *set, int32_t cell)
{
    cairn_edge_chain_pixel p = pixel_of(set, cell);

    return set->strengths.data[p.y * set->strengths.stride + p.x];
}

/* Bit k: neighbour k is an edge pixel. */
static uint32_t neighbours_of(const cairn_edge_chain_set *set, int32_t cell)
{
    uint32_t mask = 0;

    for (int32_t k = 0; k < 8; k++)
        if (set->flags[cell + set->neighbour_offset[k]] & FLAG_EDGE)
            mask |= 1U << k;
    return mask;
}

static int has_bit(uint32_t mask, int32_t k)
{
    return ((mask >> (k & 7)) & 1U) != 0;
}

static int32_t bit_count(uint32_t mask)
{
    int32_t count = 0;

    for (; mask != 0; mask &= mask - 1)
        count++;
    return count;
}

/* Returns 1 for a simple point: its neighbours stay connected without it and it touches the
 * background, so its removal preserves topology (crossing number 1). */
static int is_simple(uint32_t mask)
{
    int32_t crossings = 0;

    for (int32_t k = 0; k < 8; k += 2)
        crossings += !has_bit(mask, k) && (has_bit(mask, k + 1) || has_bit(mask, k + 2));
    return crossings == 1;
}

/* Returns 1 when the pixel is the end of a line: one neighbour, or two adjacent ones. */
static int is_tip(uint32_t mask)
{
    int32_t count = bit_count(mask);

    if (count != 2)
        return count < 2;
    for (int32_t k = 0; k < 8; k++)
        if (has_bit(mask, k) && has_bit(mask, k + 1))
            return 1;
    return 0;
}

/* Links of a pixel: its edge neighbours, diagonal ones only where no pixel adjacent to both
 * connects them. */
static uint32_t links_of(const cairn_edge_chain_set *set, int32_t cell)
{
    uint32_t mask = neighbours_of(set, cell), links = mask;

    for (int32_t k = 1; k < 8; k += 2)
        if (has_bit(mask, k - 1) || has_bit(mask, k + 1))
            links &= ~(1U << k);
    return links;
}

static int32_t first_bit(uint32_t links)
{
    int32_t k = 0;

    while (!has_bit(links, k))
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
    return (set->flags[set->cursor] & FLAG_EDGE) != 0;
}

/* Skips the next pixels that are no edge pixels. */
static void skip_pixels(cairn_edge_chain_set *set)
{
    int32_t cells = cell_count(set),
            end = cells - set->cursor < SKIPPED_PER_UNIT ? cells : set->cursor + SKIPPED_PER_UNIT;

    while (set->cursor < end && !is_at_edge(set))
        set->cursor++;
}

/* ---- Loading ---- */

static int32_t propagated_distance(uint8_t first, uint8_t second)
{
    int32_t a = first & DISTANCE_MASK, b = second & DISTANCE_MASK, smaller = a < b ? a : b;

    return smaller < MAX_DISTANCE ? smaller + 1 : MAX_DISTANCE;
}

/* End of the pixels that are processed for one work unit. */
static int32_t pixels_end(const cairn_edge_chain_set *set)
{
    int32_t cells = cell_count(set);

    return cells - set->cursor < PIXELS_PER_UNIT ? cells : set->cursor + PIXELS_PER_UNIT;
}

/* Marks an edge pixel; forward pass of the distance transform (from above and from the left). */
static void load_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    int32_t column = cell % set->stride, row = cell / set->stride;
    uint8_t *flag = &set->flags[cell];

    *flag = 0;
    if (column == 0 || column > set->strengths.width || row == 0 || row > set->strengths.height ||
        strength_at(set, cell) < set->params.min_strength)
        return;
    set->edge_count++;
    *flag = (uint8_t)(FLAG_EDGE | propagated_distance(flag[-1], flag[-set->stride]));
}

/* Backward pass of the distance transform (from below and from the right). */
static void measure_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    uint8_t *flag = &set->flags[cell];
    int32_t distance;

    if (!(*flag & FLAG_EDGE))
        return;
    distance = propagated_distance(flag[1], flag[set->stride]);
    if (distance < (*flag & DISTANCE_MASK))
        *flag = (uint8_t)(FLAG_EDGE | distance);
}

static void enqueue(cairn_edge_chain_set *set, int32_t cell, int32_t queue)
{
    int32_t entry = set->free_entry;

    CAIRN_ASSERT(entry >= 0);
    set->free_entry = set->entries[entry].next;
    set->entries[entry].pixel = cell;
    set->entries[entry].next = -1;
    if (set->head[queue] < 0)
        set->head[queue] = entry;
    else
        set->entries[set->tail[queue]].next = entry;
    set->tail[queue] = entry;
    set->flags[cell] |= FLAG_QUEUED;
}

static void enqueue_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    if (set->flags[cell] & FLAG_EDGE)
        enqueue(set, cell,
                strength_at(set, cell) * (MAX_DISTANCE + 1) + (set->flags[cell] & DISTANCE_MASK));
}

/* Processes the next pixels of a pass over the image. */
static void load_pixels(cairn_edge_chain_set *set)
{
    for (int32_t i = set->cursor, end = pixels_end(set); i < end; i++)
        load_pixel(set, i);
    if (set->edge_count > set->params.max_edges)
        set->status = CAIRN_FULL;
}

static void measure_pixels(cairn_edge_chain_set *set)
{
    for (int32_t i = set->cursor, end = pixels_end(set); i < end; i++)
        measure_pixel(set, cell_count(set) - 1 - i);
}

static void enqueue_pixels(cairn_edge_chain_set *set)
{
    for (int32_t i = set->cursor, end = pixels_end(set); i < end; i++)
        enqueue_pixel(set, i);
}

/* Clears the next queues, and frees as many entries. */
static void clear_queues(cairn_edge_chain_set *set)
{
    for (int32_t i = set->cursor; i < set->cursor + QUEUES_PER_UNIT; i++) {
        if (i < QUEUE_COUNT)
            set->head[i] = -1;
        if (i < set->edge_count) {
            set->entries[i].next = set->free_entry;
            set->free_entry = i;
        }
    }
}

/* Edge pixels with their distances from the background. */
static int load(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = cell_count(set);

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < cells && set->status == CAIRN_MORE;
         set->cursor += PIXELS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        load_pixels(set);
    }
    for (set->cursor = 0; set->cursor < cells && set->status == CAIRN_MORE;
         set->cursor += PIXELS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        measure_pixels(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* Queues of the edge pixels. */
static int fill_queues(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t items = set->edge_count > QUEUE_COUNT ? set->edge_count : QUEUE_COUNT;

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < items; set->cursor += QUEUES_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        clear_queues(set);
    }
    for (set->cursor = 0; set->cursor < cell_count(set); set->cursor += PIXELS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        enqueue_pixels(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Thinning ---- */

static void remove_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    set->flags[cell] = 0;
    for (int32_t k = 0; k < 8; k++) {
        int32_t neighbour = cell + set->neighbour_offset[k];

        if ((set->flags[neighbour] & (FLAG_EDGE | FLAG_QUEUED)) == FLAG_EDGE)
            enqueue(set, neighbour, set->queue);
    }
}

/* Skips the next empty queues. */
static void skip_queues(cairn_edge_chain_set *set)
{
    for (int32_t k = 0;
         k < SKIPPED_PER_UNIT && set->queue < QUEUE_COUNT && set->head[set->queue] < 0; k++)
        set->queue++;
}

/* Takes the first pixel of the lowest queue, and removes it from the edge unless it is needed. */
static void thin_pixel(cairn_edge_chain_set *set)
{
    int32_t entry = set->head[set->queue], cell = set->entries[entry].pixel;
    uint32_t mask = neighbours_of(set, cell);

    set->head[set->queue] = set->entries[entry].next;
    set->entries[entry].next = set->free_entry;
    set->free_entry = entry;
    set->flags[cell] &= (uint8_t)~FLAG_QUEUED;
    if (is_simple(mask) && !is_tip(mask))
        remove_pixel(set, cell);
}

static int thin(cairn_edge_chain_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    set->queue = 0;
    while (set->queue < QUEUE_COUNT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        if (set->head[set->queue] < 0)
            skip_queues(set);
        else
            thin_pixel(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Spurs ---- */

/* Removes the line from an end to a junction when it is at most max_spur long. */
static void prune_spur(cairn_edge_chain_set *set, int32_t tip)
{
    int32_t previous = tip, current = tip + set->neighbour_offset[first_bit(links_of(set, tip))],
            length = 1;

    while (length < set->params.max_spur && bit_count(links_of(set, current)) == 2) {
        int32_t next = next_pixel(set, previous, current);

        previous = current;
        current = next;
        length++;
    }
    if (bit_count(links_of(set, current)) < 3)
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
    return bit_count(links_of(set, set->cursor)) == 1;
}

static int prune(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = cell_count(set);

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
    set->pixels[set->pixel_count++] = pixel_of(set, cell);
    set->strength_sum += strength_at(set, cell);
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
    return bit_count(links_of(set, cell)) == 1 ? CAIRN_EDGE_CHAIN_OPEN : CAIRN_EDGE_CHAIN_JUNCTION;
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

    set->flags[set->current] |= FLAG_USED;
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
    if (bit_count(links_of(set, set->current)) != 2)
        end_chain(set, end_at(set, set->start), end_at(set, set->current));
    else
        pass_pixel(set);
}

/* Starts the next line from the end or junction at the cursor that has not been followed from its
 * other end. Returns 0 when none is left. */
static int start_line(cairn_edge_chain_set *set)
{
    uint32_t links = links_of(set, set->cursor);

    if (bit_count(links) == 2)
        return 0;
    for (; set->direction < 8; set->direction++) {
        int32_t next = set->cursor + set->neighbour_offset[set->direction];

        if (!has_bit(links, set->direction) || (set->flags[next] & FLAG_USED) ||
            (next < set->cursor && bit_count(links_of(set, next)) != 2))
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

    if (bit_count(links) != 2 || (set->flags[set->cursor] & FLAG_USED))
        return 0;
    set->flags[set->cursor] |= FLAG_USED;
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
    int32_t cells = cell_count(set);

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
    CAIRN_STEP_UNTIL(set->resume, load(set, budget));
    if (set->status == CAIRN_MORE) {
        CAIRN_STEP_UNTIL(set->resume, fill_queues(set, budget));
        CAIRN_STEP_UNTIL(set->resume, thin(set, budget));
        CAIRN_STEP_UNTIL(set->resume, prune(set, budget));
        for (set->is_loop = 0; set->is_loop < 2; set->is_loop++)
            CAIRN_STEP_UNTIL(set->resume, follow_chains(set, budget));
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
