/* Thinning of edges to lines one pixel wide.
 *
 * Method:
 * 1. Distance transform: the capped distance of every edge pixel to the nearest pixel without an
 *    edge, in a forward and a backward pass.
 * 2. One queue per strength and distance, as linked lists through the edge pixels.
 * 3. The first pixel of the lowest queue is removed when it is a simple point and no line end; its
 *    neighbours that had to stay are queued again. */
#include "src/base/build.h"

#include "src/edges/edge_chain_work.h"

/* Items for one work unit: pixels and queues that are processed. */
enum { PIXELS_PER_UNIT = 4, QUEUES_PER_UNIT = 8 };

/* ---- Loading ---- */

static int32_t propagated_distance(uint8_t first, uint8_t second)
{
    int32_t a = first & EDGE_CHAIN_DISTANCE_MASK, b = second & EDGE_CHAIN_DISTANCE_MASK,
            smaller = a < b ? a : b;

    return smaller < EDGE_CHAIN_MAX_DISTANCE ? smaller + 1 : EDGE_CHAIN_MAX_DISTANCE;
}

/* End of the pixels that are processed for one work unit. */
static int32_t pixels_end(const cairn_edge_chain_set *set)
{
    int32_t cells = edge_chain_cell_count(set);

    return cells - set->cursor < PIXELS_PER_UNIT ? cells : set->cursor + PIXELS_PER_UNIT;
}

/* Marks an edge pixel; forward pass of the distance transform (from above and from the left). */
static void load_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    int32_t column = cell % set->stride, row = cell / set->stride;
    uint8_t *flag = &set->flags[cell];

    *flag = 0;
    if (column == 0 || column > set->strengths.width || row == 0 || row > set->strengths.height ||
        edge_chain_strength_at(set, cell) < set->params.min_strength)
        return;
    set->edge_count++;
    *flag = (uint8_t)(EDGE_CHAIN_FLAG_EDGE | propagated_distance(flag[-1], flag[-set->stride]));
}

/* Backward pass of the distance transform (from below and from the right). */
static void measure_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    uint8_t *flag = &set->flags[cell];
    int32_t distance;

    if (!(*flag & EDGE_CHAIN_FLAG_EDGE))
        return;
    distance = propagated_distance(flag[1], flag[set->stride]);
    if (distance < (*flag & EDGE_CHAIN_DISTANCE_MASK))
        *flag = (uint8_t)(EDGE_CHAIN_FLAG_EDGE | distance);
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
    set->flags[cell] |= EDGE_CHAIN_FLAG_QUEUED;
}

static void enqueue_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    if (set->flags[cell] & EDGE_CHAIN_FLAG_EDGE)
        enqueue(set, cell,
                edge_chain_strength_at(set, cell) * (EDGE_CHAIN_MAX_DISTANCE + 1) +
                    (set->flags[cell] & EDGE_CHAIN_DISTANCE_MASK));
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
        measure_pixel(set, edge_chain_cell_count(set) - 1 - i);
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
        if (i < EDGE_CHAIN_QUEUE_COUNT)
            set->head[i] = -1;
        if (i < set->edge_count) {
            set->entries[i].next = set->free_entry;
            set->free_entry = i;
        }
    }
}

int cairn_edge_chain_load(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t cells = edge_chain_cell_count(set);

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

int cairn_edge_chain_fill_queues(cairn_edge_chain_set *set, cairn_budget *budget)
{
    int32_t items =
        set->edge_count > EDGE_CHAIN_QUEUE_COUNT ? set->edge_count : EDGE_CHAIN_QUEUE_COUNT;

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < items; set->cursor += QUEUES_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        clear_queues(set);
    }
    for (set->cursor = 0; set->cursor < edge_chain_cell_count(set);
         set->cursor += PIXELS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        enqueue_pixels(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Thinning ---- */

/* Returns 1 for a simple point: its neighbours stay connected without it and it touches the
 * background, so its removal preserves topology (crossing number 1). */
static int is_simple(uint32_t mask)
{
    int32_t crossings = 0;

    for (int32_t k = 0; k < 8; k += 2)
        crossings += !edge_chain_has_bit(mask, k) &&
                     (edge_chain_has_bit(mask, k + 1) || edge_chain_has_bit(mask, k + 2));
    return crossings == 1;
}

/* Returns 1 when the pixel is the end of a line: one neighbour, or two adjacent ones. */
static int is_tip(uint32_t mask)
{
    int32_t count = edge_chain_bit_count(mask);

    if (count != 2)
        return count < 2;
    for (int32_t k = 0; k < 8; k++)
        if (edge_chain_has_bit(mask, k) && edge_chain_has_bit(mask, k + 1))
            return 1;
    return 0;
}

static void remove_pixel(cairn_edge_chain_set *set, int32_t cell)
{
    set->flags[cell] = 0;
    for (int32_t k = 0; k < 8; k++) {
        int32_t neighbour = cell + set->neighbour_offset[k];

        if ((set->flags[neighbour] & (EDGE_CHAIN_FLAG_EDGE | EDGE_CHAIN_FLAG_QUEUED)) ==
            EDGE_CHAIN_FLAG_EDGE)
            enqueue(set, neighbour, set->queue);
    }
}

/* Skips the next empty queues. */
static void skip_queues(cairn_edge_chain_set *set)
{
    for (int32_t k = 0; k < EDGE_CHAIN_SKIPPED_PER_UNIT && set->queue < EDGE_CHAIN_QUEUE_COUNT &&
                        set->head[set->queue] < 0;
         k++)
        set->queue++;
}

/* Takes the first pixel of the lowest queue, and removes it from the edge unless it is needed. */
static void thin_pixel(cairn_edge_chain_set *set)
{
    int32_t entry = set->head[set->queue], cell = set->entries[entry].pixel;
    uint32_t mask = edge_chain_neighbours_of(set, cell);

    set->head[set->queue] = set->entries[entry].next;
    set->entries[entry].next = set->free_entry;
    set->free_entry = entry;
    set->flags[cell] &= (uint8_t)~EDGE_CHAIN_FLAG_QUEUED;
    if (is_simple(mask) && !is_tip(mask))
        remove_pixel(set, cell);
}

int cairn_edge_chain_thin(cairn_edge_chain_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    set->queue = 0;
    while (set->queue < EDGE_CHAIN_QUEUE_COUNT) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        if (set->head[set->queue] < 0)
            skip_queues(set);
        else
            thin_pixel(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}
