/* Chains of edge pixels by ordered thinning.
 *
 * Method: edge pixels are taken in order of their strength, those of equal strength in order of
 * their distance to the nearest pixel without an edge, and removed when that neither parts a line,
 * nor closes a hole, nor shortens a line from its end. A removal brings the neighbours that had to
 * stay back into the queue. What is left is one pixel wide and runs along the crests of the
 * strengths, or along the middle of what is equally strong. Pixels are then linked to their four
 * neighbours, and to a diagonal one where no shorter way leads: the number of links tells ends (1),
 * lines (2) and junctions (3 or more) apart. Lines are followed from the ends and junctions; what
 * has none is a closed line.
 *
 * Layout: one byte a pixel with a border of one pixel, so that no neighbour is outside; queues, one
 * for each strength and distance, as lists through the edge pixels.
 *
 * Limits: edges more than twice MAX_DISTANCE wide and of one strength are thinned to a line that
 * need not be in the middle.
 *
 * Source: Adluru 2008, section 2; simple pixels: Yokoi, Toriwaki and Fukumura 1975; order by
 * distance: Pudney 1998. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/edge_chain.h"

enum { MAX_COUNT = 1 << 28, MAX_SPUR = 64 };

/* Bits of a pixel: its distance, capped, and flags. */
enum { MAX_DISTANCE = 7, DISTANCE_BITS = 7, EDGE = 8, QUEUED = 16, USED = 32 };

enum { QUEUES = 256 * (MAX_DISTANCE + 1), PIXELS_A_UNIT = 16 };

typedef int32_t link_phase;
enum { IDLE, LOAD, MEASURE, EMPTY_QUEUES, ENQUEUE, THIN, PRUNE, FOLLOW_LINES, FOLLOW_LOOPS, DONE };

typedef struct queue_entry {
    int32_t pixel, next; /* next: -1 at the end */
} queue_entry;

struct cairn_edge_chain_set {
    cairn_edge_chain_params params;
    /* [(max_height + 2) * (max_width + 2)] */
    uint8_t *flags;
    /* [QUEUES], -1: empty */
    int32_t *head, *tail;
    /* [max_edges]; a pixel is in one queue at most */
    queue_entry *entries;
    /* [max_edges + 2 * max_chains + 2]: all once, ends again, and those of the chain at hand */
    cairn_edge_pixel *pixels;
    /* [max_chains] */
    cairn_edge_chain *chains;
    cairn_raster_u8_view strengths;
    /* of flags */
    int32_t stride;
    /* offsets of the neighbours: east, then clockwise on the screen */
    int32_t ring[8];
    /* first of the free entries, linked by next; -1: none */
    int32_t vacant;
    /* THIN: lowest that may have a pixel */
    int32_t queue;
    /* next pixel of the picture, row by row */
    int32_t cursor;
    /* FOLLOW_LINES: next neighbour of the pixel at the cursor to be followed */
    int32_t direction;
    /* 1: a chain is being followed, from `start` over `before` to `at` */
    int32_t following;
    int32_t start, before, at;
    /* sum of the chain being followed */
    int64_t strength;
    int32_t chain_count, pixel_count, edge_count, short_count;
    link_phase phase;
    /* units towards the item at hand */
    int32_t paid;
};

cairn_edge_chain_params cairn_edge_chain_default(void)
{
    cairn_edge_chain_params params = {
        .max_width = 640,
        .max_height = 480,
        .max_edges = 100000,
        .max_chains = 10000,
        .min_strength = 1,
        .min_length = 5,
        .max_spur = 3,
    };
    return params;
}

static int params_are_valid(const cairn_edge_chain_params *p)
{
    return p != NULL && p->max_width >= 1 && p->max_width <= CAIRN_RASTER_MAX_SIDE &&
           p->max_height >= 1 && p->max_height <= CAIRN_RASTER_MAX_SIDE && p->max_edges >= 1 &&
           p->max_edges <= MAX_COUNT && p->max_chains >= 1 && p->max_chains <= MAX_COUNT &&
           p->min_strength >= 1 && p->min_strength <= 255 && p->min_length >= 2 &&
           p->max_spur >= 0 && p->max_spur <= MAX_SPUR;
}

static cairn_edge_chain_set *carve(cairn_pool *pool, const cairn_edge_chain_params *params)
{
    size_t cells = ((size_t)params->max_width + 2) * ((size_t)params->max_height + 2);
    size_t edges = (size_t)params->max_edges, chains = (size_t)params->max_chains;
    cairn_edge_chain_set *set = cairn_pool_take_one(pool, sizeof *set);
    uint8_t *flags = cairn_pool_take(pool, cells, sizeof *flags);
    int32_t *ends = cairn_pool_take(pool, 2 * (size_t)QUEUES, sizeof *ends);
    queue_entry *entries = cairn_pool_take(pool, edges, sizeof *entries);
    cairn_edge_pixel *pixels = cairn_pool_take(pool, edges + 2 * chains + 2, sizeof *pixels);
    cairn_edge_chain *found = cairn_pool_take(pool, chains, sizeof *found);

    if (set != NULL) {
        memset(set, 0, sizeof *set);
        set->flags = flags;
        set->head = ends;
        set->tail = ends + QUEUES;
        set->entries = entries;
        set->pixels = pixels;
        set->chains = found;
    }
    return set;
}

size_t cairn_edge_chain_memory(const cairn_edge_chain_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_edge_chain_create(cairn_edge_chain_set **set, cairn_pool *pool,
                                     const cairn_edge_chain_params *params)
{
    size_t need = cairn_edge_chain_memory(params);
    cairn_edge_chain_set *made;

    if (set == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    *set = made;
    return CAIRN_OK;
}

cairn_status cairn_edge_chain_begin(cairn_edge_chain_set *set, cairn_raster_u8_view strengths)
{
    if (set == NULL || cairn_raster_u8_check(strengths) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    if (strengths.width > set->params.max_width || strengths.height > set->params.max_height)
        return CAIRN_FULL;
    set->strengths = strengths;
    set->stride = strengths.width + 2;
    set->ring[0] = 1;
    set->ring[1] = set->stride + 1;
    set->ring[2] = set->stride;
    set->ring[3] = set->stride - 1;
    for (int32_t k = 0; k < 4; k++)
        set->ring[k + 4] = -set->ring[k];
    set->vacant = -1;
    set->queue = 0;
    set->cursor = 0;
    set->direction = 0;
    set->following = 0;
    set->chain_count = set->pixel_count = set->edge_count = set->short_count = 0;
    set->paid = 0;
    set->phase = LOAD;
    return CAIRN_OK;
}

/* ---- Pixels ---- */

static int32_t cell_count(const cairn_edge_chain_set *set)
{
    return set->stride * (set->strengths.height + 2);
}

static cairn_edge_pixel place_of(const cairn_edge_chain_set *set, int32_t cell)
{
    cairn_edge_pixel place = {(int16_t)(cell % set->stride - 1), (int16_t)(cell / set->stride - 1)};

    return place;
}

static int32_t strength_at(const cairn_edge_chain_set *set, int32_t cell)
{
    cairn_edge_pixel p = place_of(set, cell);

    return set->strengths.data[p.y * set->strengths.stride + p.x];
}

/* Bit k: the neighbour ring[k] is an edge. */
static uint32_t neighbours_of(const cairn_edge_chain_set *set, int32_t cell)
{
    uint32_t mask = 0;

    for (int32_t k = 0; k < 8; k++)
        if (set->flags[cell + set->ring[k]] & EDGE)
            mask |= 1U << k;
    return mask;
}

static int has(uint32_t mask, int32_t k)
{
    return ((mask >> (k & 7)) & 1U) != 0;
}

static int32_t count_of(uint32_t mask)
{
    int32_t count = 0;

    for (; mask != 0; mask &= mask - 1)
        count++;
    return count;
}

/* 1 when the neighbours hang together without the pixel and it touches the outside: its removal
 * changes no line's course. */
static int is_simple(uint32_t mask)
{
    int32_t crossings = 0;

    for (int32_t k = 0; k < 8; k += 2)
        crossings += !has(mask, k) && (has(mask, k + 1) || has(mask, k + 2));
    return crossings == 1;
}

/* 1 when the pixel is the tip of a line: one neighbour, or two side by side. */
static int is_tip(uint32_t mask)
{
    int32_t count = count_of(mask);

    if (count != 2)
        return count < 2;
    for (int32_t k = 0; k < 8; k++)
        if (has(mask, k) && has(mask, k + 1))
            return 1;
    return 0;
}

/* The neighbours that a pixel is linked to: diagonal ones only where no pixel beside both leads
 * there. */
static uint32_t links_of(const cairn_edge_chain_set *set, int32_t cell)
{
    uint32_t mask = neighbours_of(set, cell), links = mask;

    for (int32_t k = 1; k < 8; k += 2)
        if (has(mask, k - 1) || has(mask, k + 1))
            links &= ~(1U << k);
    return links;
}

static int32_t first_of(uint32_t links)
{
    int32_t k = 0;

    while (!has(links, k))
        k++;
    return k;
}

/* The other link of a pixel with two. */
static int32_t beyond(const cairn_edge_chain_set *set, int32_t before, int32_t at)
{
    uint32_t links = links_of(set, at);
    int32_t k = first_of(links);

    if (at + set->ring[k] == before)
        k = first_of(links & ~(1U << k));
    return at + set->ring[k];
}

/* Moves the cursor on to the next edge pixel: 1 there, 0 the budget is used up, -1 there is
 * none. */
static int32_t find_edge(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = cell_count(set);

    while (set->cursor < cells) {
        int32_t end = cells - set->cursor < PIXELS_A_UNIT ? cells : set->cursor + PIXELS_A_UNIT;

        if (set->flags[set->cursor] & EDGE)
            return 1;
        if (budget->left <= 0)
            return 0;
        budget->left--;
        while (set->cursor < end && !(set->flags[set->cursor] & EDGE))
            set->cursor++;
    }
    return -1;
}

/* ---- Loading ---- */

static int32_t near_distance(uint8_t first, uint8_t second)
{
    int32_t a = first & DISTANCE_BITS, b = second & DISTANCE_BITS, least = a < b ? a : b;

    return least < MAX_DISTANCE ? least + 1 : MAX_DISTANCE;
}

/* Marks a pixel, and counts its distance from above and from the left. */
static void load_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    int32_t column = cell % set->stride, row = cell / set->stride;
    uint8_t *flag = &set->flags[cell];

    *flag = 0;
    if (column == 0 || column > set->strengths.width || row == 0 || row > set->strengths.height ||
        strength_at(set, cell) < set->params.min_strength)
        return;
    set->edge_count++;
    *flag = (uint8_t)(EDGE | near_distance(flag[-1], flag[-set->stride]));
}

/* Counts the distance from below and from the right. */
static void measure_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    uint8_t *flag = &set->flags[cell];
    int32_t distance;

    if (!(*flag & EDGE))
        return;
    distance = near_distance(flag[1], flag[set->stride]);
    if (distance < (*flag & DISTANCE_BITS))
        *flag = (uint8_t)(EDGE | distance);
}

static void enqueue(cairn_edge_chain_set *set, int32_t cell, int32_t queue)
{
    int32_t entry = set->vacant;

    CAIRN_ASSERT(entry >= 0);
    set->vacant = set->entries[entry].next;
    set->entries[entry].pixel = cell;
    set->entries[entry].next = -1;
    if (set->head[queue] < 0)
        set->head[queue] = entry;
    else
        set->entries[set->tail[queue]].next = entry;
    set->tail[queue] = entry;
    set->flags[cell] |= QUEUED;
}

static void enqueue_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    if (set->flags[cell] & EDGE)
        enqueue(set, cell,
                strength_at(set, cell) * (MAX_DISTANCE + 1) + (set->flags[cell] & DISTANCE_BITS));
}

/* Four pixels a unit: those from the cursor on in the order of the phase. CAIRN_OK when all are
 * done. */
static cairn_status step_pixels(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = cell_count(set);

    while (set->cursor < cells) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t k = 0; k < 4 && set->cursor < cells; k++, set->cursor++) {
            if (set->phase == LOAD)
                load_pixel(set, set->cursor);
            else if (set->phase == MEASURE)
                measure_pixel(set, cells - 1 - set->cursor);
            else
                enqueue_pixel(set, set->cursor);
        }
        if (set->edge_count > set->params.max_edges)
            return CAIRN_FULL;
    }
    return CAIRN_OK;
}

/* All entries free, all queues empty. A unit for every eight of them. */
static cairn_status step_queues(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t items = set->edge_count > QUEUES ? set->edge_count : QUEUES;

    while (set->cursor < items) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t k = 0; k < 8; k++, set->cursor++) {
            if (set->cursor < QUEUES)
                set->head[set->cursor] = -1;
            if (set->cursor < set->edge_count) {
                set->entries[set->cursor].next = set->vacant;
                set->vacant = set->cursor;
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
        int32_t near = cell + set->ring[k];

        if ((set->flags[near] & (EDGE | QUEUED)) == EDGE)
            enqueue(set, near, set->queue);
    }
}

static cairn_status step_thin(cairn_edge_chain_set *set, cairn_budget *budget)
{
    while (set->queue < QUEUES) {
        int32_t entry = set->head[set->queue], cell;
        uint32_t mask;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (entry < 0) {
            for (int32_t k = 0;
                 k < PIXELS_A_UNIT && set->queue < QUEUES && set->head[set->queue] < 0; k++)
                set->queue++;
            continue;
        }
        cell = set->entries[entry].pixel;
        set->head[set->queue] = set->entries[entry].next;
        set->entries[entry].next = set->vacant;
        set->vacant = entry;
        set->flags[cell] &= (uint8_t)~QUEUED;
        mask = neighbours_of(set, cell);
        if (is_simple(mask) && !is_tip(mask))
            remove_pixel(set, cell);
    }
    return CAIRN_OK;
}

/* ---- Spurs ---- */

/* Removes the line from a tip to a junction when it is no longer than max_spur. */
static void prune_from(cairn_edge_chain_set *set, int32_t tip)
{
    int32_t before = tip, at = tip + set->ring[first_of(links_of(set, tip))], length = 1;

    while (length < set->params.max_spur && count_of(links_of(set, at)) == 2) {
        int32_t next = beyond(set, before, at);

        before = at;
        at = next;
        length++;
    }
    if (count_of(links_of(set, at)) < 3)
        return;
    for (before = tip; before != at;) {
        int32_t next = before + set->ring[first_of(links_of(set, before))];

        set->flags[before] = 0;
        before = next;
    }
}

static cairn_status step_prune(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t found;

    if (set->params.max_spur == 0)
        return CAIRN_OK;
    while ((found = find_edge(set, budget)) > 0) {
        int32_t is_end = count_of(links_of(set, set->cursor)) == 1;

        if (!cairn_budget_pay(budget, &set->paid, is_end ? 2 * set->params.max_spur + 1 : 1))
            return CAIRN_MORE;
        if (is_end)
            prune_from(set, set->cursor);
        set->cursor++;
    }
    return found == 0 ? CAIRN_MORE : CAIRN_OK;
}

/* ---- Following ---- */

static void append(cairn_edge_chain_set *set, int32_t cell)
{
    CAIRN_ASSERT(set->pixel_count < set->params.max_edges + 2 * set->params.max_chains + 2);
    set->pixels[set->pixel_count++] = place_of(set, cell);
    set->strength += strength_at(set, cell);
}

static int32_t chain_start(const cairn_edge_chain_set *set)
{
    const cairn_edge_chain *last = &set->chains[set->chain_count - 1];

    return set->chain_count == 0 ? 0 : last->first + last->count;
}

static void start_chain(cairn_edge_chain_set *set, int32_t start, int32_t second)
{
    set->following = 1;
    set->start = set->before = start;
    set->at = second;
    set->strength = 0;
    append(set, start);
}

static cairn_edge_end end_at(const cairn_edge_chain_set *set, int32_t cell)
{
    return count_of(links_of(set, cell)) == 1 ? CAIRN_EDGE_OPEN : CAIRN_EDGE_JUNCTION;
}

/* Keeps the chain that was followed, or drops it as too short. */
static cairn_status end_chain(cairn_edge_chain_set *set, cairn_edge_end from, cairn_edge_end to)
{
    int32_t first = chain_start(set), count = set->pixel_count - first;
    cairn_edge_chain *chain;

    set->following = 0;
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
    chain->strength = (cairn_real)set->strength / (cairn_real)count;
    return CAIRN_OK;
}

/* One pixel further along the chain. */
static cairn_status follow(cairn_edge_chain_set *set)
{
    int32_t next;

    if (set->phase == FOLLOW_LOOPS && set->at == set->start)
        return end_chain(set, CAIRN_EDGE_CLOSED, CAIRN_EDGE_CLOSED);
    append(set, set->at);
    if (count_of(links_of(set, set->at)) != 2)
        return end_chain(set, end_at(set, set->start), end_at(set, set->at));
    set->flags[set->at] |= USED;
    next = beyond(set, set->before, set->at);
    set->before = set->at;
    set->at = next;
    return CAIRN_OK;
}

/* The next line from the end or junction at the cursor that has not been followed from its other
 * end. 0: none is left. */
static int start_line(cairn_edge_chain_set *set)
{
    uint32_t links = links_of(set, set->cursor);

    if (count_of(links) == 2)
        return 0;
    for (; set->direction < 8; set->direction++) {
        int32_t next = set->cursor + set->ring[set->direction];

        if (!has(links, set->direction) || (set->flags[next] & USED) ||
            (next < set->cursor && count_of(links_of(set, next)) != 2))
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

    if (count_of(links) != 2 || (set->flags[set->cursor] & USED))
        return 0;
    set->flags[set->cursor] |= USED;
    start_chain(set, set->cursor, set->cursor + set->ring[first_of(links)]);
    return 1;
}

static cairn_status step_follow(cairn_edge_chain_set *set, cairn_budget *budget)
{
    for (;;) {
        int32_t found = set->following ? 1 : find_edge(set, budget);

        if (found < 0)
            return CAIRN_OK;
        if (found == 0 || !cairn_budget_pay(budget, &set->paid, 2))
            return CAIRN_MORE;
        if (set->following) {
            cairn_status status = follow(set);

            if (status != CAIRN_OK)
                return status;
        } else if (!(set->phase == FOLLOW_LINES ? start_line(set) : start_loop(set))) {
            set->cursor++;
            set->direction = 0;
        }
    }
}

static cairn_status step_phase(cairn_edge_chain_set *set, cairn_budget *budget)
{
    switch (set->phase) {
    case LOAD:
    case MEASURE:
    case ENQUEUE:
        return step_pixels(set, budget);
    case EMPTY_QUEUES:
        return step_queues(set, budget);
    case THIN:
        return step_thin(set, budget);
    case PRUNE:
        return step_prune(set, budget);
    default:
        return step_follow(set, budget);
    }
}

cairn_status cairn_edge_chain_step(cairn_edge_chain_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->phase != IDLE && set->phase != DONE) {
        cairn_status status = step_phase(set, budget);

        if (status < 0)
            set->phase = IDLE;
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

    if (set == NULL || set->phase != DONE)
        return result;
    result.chains = set->chains;
    result.pixels = set->pixels;
    result.chain_count = set->chain_count;
    result.pixel_count = set->pixel_count;
    result.edge_count = set->edge_count;
    result.short_count = set->short_count;
    return result;
}
