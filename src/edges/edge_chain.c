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

enum { MAX_COUNT = 1 << 28, MAX_SPUR = 64 };

/* Bits of a pixel: its distance, capped, and flags. */
enum { MAX_DISTANCE = 7, DISTANCE_MASK = 7, FLAG_EDGE = 8, FLAG_QUEUED = 16, FLAG_USED = 32 };

enum { QUEUE_COUNT = 256 * (MAX_DISTANCE + 1), PIXELS_PER_UNIT = 16 };

typedef int32_t edge_chain_phase;
enum {
    PHASE_IDLE,
    PHASE_LOAD,
    PHASE_DISTANCE,
    PHASE_CLEAR_QUEUES,
    PHASE_ENQUEUE,
    PHASE_THIN,
    PHASE_PRUNE,
    PHASE_FOLLOW_LINES,
    PHASE_FOLLOW_LOOPS,
    PHASE_DONE
};

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
    /* head of the free list of entries, linked by next; -1: empty */
    int32_t free_entry;
    /* PHASE_THIN: lowest queue that may hold a pixel */
    int32_t queue;
    /* next pixel of the image, row by row */
    int32_t cursor;
    /* PHASE_FOLLOW_LINES: next neighbour of the cursor's pixel to follow */
    int32_t direction;
    /* 1: a chain is being followed, from `start` via `previous` to `current` */
    int32_t is_following;
    int32_t start, previous, current;
    /* sum of strengths of the chain being followed */
    int64_t strength_sum;
    int32_t chain_count, pixel_count, edge_count, short_count;
    edge_chain_phase phase;
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
    set->queue = 0;
    set->cursor = 0;
    set->direction = 0;
    set->is_following = 0;
    set->chain_count = set->pixel_count = set->edge_count = set->short_count = 0;
    set->units_charged = 0;
    set->phase = PHASE_LOAD;
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

/* Advances the cursor to the next edge pixel. Returns 1 there, 0 when the budget is exhausted, -1
 * at the end of the image. */
static int32_t find_edge(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = cell_count(set);

    while (set->cursor < cells) {
        int32_t end = cells - set->cursor < PIXELS_PER_UNIT ? cells : set->cursor + PIXELS_PER_UNIT;

        if (set->flags[set->cursor] & FLAG_EDGE)
            return 1;
        if (budget->left <= 0)
            return 0;
        budget->left--;
        while (set->cursor < end && !(set->flags[set->cursor] & FLAG_EDGE))
            set->cursor++;
    }
    return -1;
}

/* ---- Loading ---- */

static int32_t propagated_distance(uint8_t first, uint8_t second)
{
    int32_t a = first & DISTANCE_MASK, b = second & DISTANCE_MASK, smaller = a < b ? a : b;

    return smaller < MAX_DISTANCE ? smaller + 1 : MAX_DISTANCE;
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

/* Processes pixels from the cursor on in the current phase, four per unit. CAIRN_OK when all are
 * done. */
static cairn_status step_pixels(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = cell_count(set);

    while (set->cursor < cells) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t k = 0; k < 4 && set->cursor < cells; k++, set->cursor++) {
            if (set->phase == PHASE_LOAD)
                load_pixel(set, set->cursor);
            else if (set->phase == PHASE_DISTANCE)
                measure_pixel(set, cells - 1 - set->cursor);
            else
                enqueue_pixel(set, set->cursor);
        }
        if (set->edge_count > set->params.max_edges)
            return CAIRN_FULL;
    }
    return CAIRN_OK;
}

/* Frees all entries and clears all queues, eight per unit. */
static cairn_status step_queues(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t items = set->edge_count > QUEUE_COUNT ? set->edge_count : QUEUE_COUNT;

    while (set->cursor < items) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t k = 0; k < 8; k++, set->cursor++) {
            if (set->cursor < QUEUE_COUNT)
                set->head[set->cursor] = -1;
            if (set->cursor < set->edge_count) {
                set->entries[set->cursor].next = set->free_entry;
                set->free_entry = set->cursor;
            }
        }
    }
    return CAIRN_OK;
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

static cairn_status step_thin(cairn_edge_chain_set *set, cairn_budget *budget)
{
    while (set->queue < QUEUE_COUNT) {
        int32_t entry = set->head[set->queue], cell;
        uint32_t mask;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (entry < 0) {
            for (int32_t k = 0;
                 k < PIXELS_PER_UNIT && set->queue < QUEUE_COUNT && set->head[set->queue] < 0; k++)
                set->queue++;
            continue;
        }
        cell = set->entries[entry].pixel;
        set->head[set->queue] = set->entries[entry].next;
        set->entries[entry].next = set->free_entry;
        set->free_entry = entry;
        set->flags[cell] &= (uint8_t)~FLAG_QUEUED;
        mask = neighbours_of(set, cell);
        if (is_simple(mask) && !is_tip(mask))
            remove_pixel(set, cell);
    }
    return CAIRN_OK;
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

static cairn_status step_prune(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t found;

    if (set->params.max_spur == 0)
        return CAIRN_OK;
    while ((found = find_edge(set, budget)) > 0) {
        int32_t is_end = bit_count(links_of(set, set->cursor)) == 1;

        if (!cairn_budget_charge(budget, &set->units_charged,
                                 is_end ? 2 * set->params.max_spur + 1 : 1))
            return CAIRN_MORE;
        if (is_end)
            prune_spur(set, set->cursor);
        set->cursor++;
    }
    return found == 0 ? CAIRN_MORE : CAIRN_OK;
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

/* Stores the followed chain, or drops it as too short. */
static cairn_status end_chain(cairn_edge_chain_set *set, cairn_edge_chain_end from,
                              cairn_edge_chain_end to)
{
    int32_t first = chain_start(set), count = set->pixel_count - first;
    cairn_edge_chain *chain;

    set->is_following = 0;
    if (count < set->params.min_length) {
        set->pixel_count = first;
        set->short_count++;
        return CAIRN_OK;
    }
    if (set->chain_count == set->params.max_chains)
        return CAIRN_FULL;
    chain = &set->chains[set->chain_count++];
    chain->first = first;
    chain->count = count;
    chain->from = from;
    chain->to = to;
    chain->strength = (cairn_real)set->strength_sum / (cairn_real)count;
    return CAIRN_OK;
}

/* Follows the chain by one pixel. */
static cairn_status follow(cairn_edge_chain_set *set)
{
    int32_t next;

    if (set->phase == PHASE_FOLLOW_LOOPS && set->current == set->start)
        return end_chain(set, CAIRN_EDGE_CHAIN_CLOSED, CAIRN_EDGE_CHAIN_CLOSED);
    append(set, set->current);
    if (bit_count(links_of(set, set->current)) != 2)
        return end_chain(set, end_at(set, set->start), end_at(set, set->current));
    set->flags[set->current] |= FLAG_USED;
    next = next_pixel(set, set->previous, set->current);
    set->previous = set->current;
    set->current = next;
    return CAIRN_OK;
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

static cairn_status step_follow(cairn_edge_chain_set *set, cairn_budget *budget)
{
    for (;;) {
        int32_t found = set->is_following ? 1 : find_edge(set, budget);

        if (found < 0)
            return CAIRN_OK;
        if (found == 0 || !cairn_budget_charge(budget, &set->units_charged, 2))
            return CAIRN_MORE;
        if (set->is_following) {
            cairn_status status = follow(set);

            if (status != CAIRN_OK)
                return status;
        } else if (!(set->phase == PHASE_FOLLOW_LINES ? start_line(set) : start_loop(set))) {
            set->cursor++;
            set->direction = 0;
        }
    }
}

static cairn_status step_phase(cairn_edge_chain_set *set, cairn_budget *budget)
{
    switch (set->phase) {
    case PHASE_LOAD:
    case PHASE_DISTANCE:
    case PHASE_ENQUEUE:
        return step_pixels(set, budget);
    case PHASE_CLEAR_QUEUES:
        return step_queues(set, budget);
    case PHASE_THIN:
        return step_thin(set, budget);
    case PHASE_PRUNE:
        return step_prune(set, budget);
    default:
        return step_follow(set, budget);
    }
}

cairn_status cairn_edge_chain_step(cairn_edge_chain_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->phase != PHASE_IDLE && set->phase != PHASE_DONE) {
        cairn_status status = step_phase(set, budget);

        if (status < 0)
            set->phase = PHASE_IDLE;
        if (status != CAIRN_OK)
            return status;
        set->phase++;
        set->cursor = 0;
    }
    return CAIRN_OK;
}

cairn_edge_chain_result cairn_edge_chain_read(const cairn_edge_chain_set *set)
{
    cairn_edge_chain_result result = {0};

    if (set == NULL || set->phase != PHASE_DONE)
        return result;
    result.chains = set->chains;
    result.pixels = set->pixels;
    result.chain_count = set->chain_count;
    result.pixel_count = set->pixel_count;
    result.edge_count = set->edge_count;
    result.short_count = set->short_count;
    return result;
}
