/* Regions: basins of the strengths, and how they join.
 *
 * Method: pixels are taken in the order of their strengths, in steps of 1/512; one that no basin has reached is the bottom of a new one,
 * and basins grow over what borders on them, first come first served (Meyer 1991). The borders of the regions are kept in a heap by
 * their mean strength times the share that the smaller region has of the image, to a power; the weakest joins its regions, and where
 * both bordered on a third these borders become one. What a border had to be raised to is its level.
 *
 * Layout: a border is in the lists of both its regions. A table of pairs of regions finds borders while they are made; later those
 * of the larger region are marked at their other regions.
 *
 * Source: Arbelaez, Maire, Fowlkes and Malik 2011, section 4. */
#include "src/core/build.h"

#include "src/contour/boundary_work.h"

#define STEPS CAIRN_REAL(512.0) /* of levels to a unit of strength */

/* Half-borders that are passed over for a unit. */
enum { HALVES_A_UNIT = 2 };

/* ---- Flooding ---- */

static int32_t level_of(const cairn_boundary *b, int32_t pixel)
{
    return cairn_real_to_int(cairn_min(b->one[pixel] * STEPS, BOUNDARY_LEVELS - 1));
}

void cairn_boundary_flood_begin(cairn_boundary *b)
{
    for (int32_t i = 0; i < BOUNDARY_LEVELS; i++)
        b->head[i] = b->tail[i] = b->first[i] = -1;
    b->level = 0;
}

void cairn_boundary_flood_row(cairn_boundary *b, int32_t row)
{
    for (int32_t x = 0; x < b->image.width; x++) {
        int32_t pixel = row * b->image.width + x, level = level_of(b, pixel);

        b->label[pixel] = b->same[pixel] = -1;
        b->walked[pixel] = 0;
        if (b->first[level] < 0)
            b->first[level] = pixel;
        else
            b->same[b->tail[level]] = pixel;
        b->tail[level] = pixel;
    }
}

static void take(cairn_boundary *b, int32_t pixel, int32_t region, int32_t level)
{
    b->label[pixel] = region;
    b->regions[region].size++;
    b->queue[pixel] = -1;
    if (b->head[level] < 0)
        b->head[level] = pixel;
    else
        b->queue[b->tail[level]] = pixel;
    b->tail[level] = pixel;
}

static void spread(cairn_boundary *b, int32_t pixel)
{
    int32_t x = pixel % b->image.width, y = pixel / b->image.width;
    int32_t near[4] = {x > 0 ? pixel - 1 : -1, x + 1 < b->image.width ? pixel + 1 : -1,
                       y > 0 ? pixel - b->image.width : -1, y + 1 < b->image.height ? pixel + b->image.width : -1};

    for (int32_t k = 0; k < 4; k++)
        if (near[k] >= 0 && b->label[near[k]] < 0) {
            int32_t level = level_of(b, near[k]);

            take(b, near[k], b->label[pixel], level > b->level ? level : b->level);
        }
}

int cairn_boundary_flood_pixel(cairn_boundary *b)
{
    int32_t pixel = b->head[b->level];

    if (pixel >= 0) {
        b->head[b->level] = b->queue[pixel];
        spread(b, pixel);
        return 1;
    }
    pixel = b->first[b->level];
    if (pixel < 0)
        return ++b->level < BOUNDARY_LEVELS;
    b->first[b->level] = b->same[pixel];
    if (b->label[pixel] < 0 && b->region_count < b->params.max_regions) {
        boundary_region none = {-1, 0, 0, -1, 0};

        b->regions[b->region_count] = none;
        take(b, pixel, b->region_count++, b->level);
    }
    return 1;
}

/* ---- Heap of borders ---- */

static int before(const cairn_boundary *b, int32_t p, int32_t q)
{
    return b->borders[p].key < b->borders[q].key || (p < q && b->borders[p].key <= b->borders[q].key);
}

static void put(const cairn_boundary *b, int32_t at, int32_t border)
{
    b->heap[at] = border;
    b->borders[border].at = at;
}

/* Where a border whose key has changed belongs. */
static void settle(const cairn_boundary *b, int32_t border)
{
    int32_t at = b->borders[border].at;

    while (at > 0 && before(b, border, b->heap[(at - 1) / 2])) {
        put(b, at, b->heap[(at - 1) / 2]);
        at = (at - 1) / 2;
    }
    for (;;) {
        int32_t child = 2 * at + 1;

        if (child >= b->heap_count)
            break;
        child += child + 1 < b->heap_count && before(b, b->heap[child + 1], b->heap[child]);
        if (!before(b, b->heap[child], border))
            break;
        put(b, at, b->heap[child]);
        at = child;
    }
    put(b, at, border);
}

static void leave_heap(cairn_boundary *b, int32_t border)
{
    int32_t at = b->borders[border].at, last = b->heap[--b->heap_count];

    b->borders[border].at = -1;
    if (last != border) {
        put(b, at, last);
        settle(b, last);
    }
}

/* ---- Borders ---- */

static cairn_real key_of(const cairn_boundary *b, const boundary_border *border)
{
    const boundary_region *p = &b->regions[border->region[0]], *q = &b->regions[border->region[1]];

    return border->sum / (cairn_real)border->length * cairn_min(p->share, q->share);
}

/* A region's share of the image to the power. */
static cairn_real share_of(const cairn_boundary *b, int32_t region)
{
    cairn_real share = (cairn_real)b->regions[region].size / (cairn_real)b->pixels;

    return cairn_exp(b->params.small * cairn_log(share));
}

static void enlist(const cairn_boundary *b, int32_t half, int32_t region)
{
    boundary_border *border = &b->borders[half / 2];
    boundary_region *r = &b->regions[region];

    border->region[half % 2] = region;
    border->before[half % 2] = -1;
    border->next[half % 2] = r->first;
    if (r->first >= 0)
        b->borders[r->first / 2].before[r->first % 2] = half;
    r->first = half;
    r->count++;
}

static void delist(const cairn_boundary *b, int32_t half)
{
    const boundary_border *border = &b->borders[half / 2];
    boundary_region *r = &b->regions[border->region[half % 2]];
    int32_t next = border->next[half % 2], last = border->before[half % 2];

    if (last >= 0)
        b->borders[last / 2].next[last % 2] = next;
    else
        r->first = next;
    if (next >= 0)
        b->borders[next / 2].before[next % 2] = last;
    r->count--;
}

/* Where the table holds the border of p < q, or would. */
static int32_t place_of(const cairn_boundary *b, int32_t p, int32_t q)
{
    uint32_t mask = (uint32_t)b->table_size - 1;
    uint32_t at = ((uint32_t)p * UINT32_C(2654435761) ^ (uint32_t)q * UINT32_C(2246822519)) & mask;

    while (b->table[at] >= 0 && (b->borders[b->table[at]].first[0] != p || b->borders[b->table[at]].first[1] != q))
        at = (at + 1) & mask;
    return (int32_t)at;
}

/* A pixel and the next one to the right or below: their regions touch. */
static void add_side(cairn_boundary *b, int32_t pixel, int32_t other)
{
    int32_t p = b->label[pixel] < b->label[other] ? b->label[pixel] : b->label[other];
    int32_t q = b->label[pixel] + b->label[other] - p, at;
    boundary_border *border;

    if (p == q)
        return;
    at = place_of(b, p, q);
    if (b->table[at] < 0) {
        boundary_border none = {{p, q}, {p, q}, {-1, -1}, {-1, -1}, 0, -1, 0, 0, 0, 0};

        CAIRN_ASSERT(b->border_count < b->max_borders);
        b->table[at] = b->border_count;
        none.into = b->border_count;
        b->borders[b->border_count] = none;
        enlist(b, 2 * b->border_count, p);
        enlist(b, 2 * b->border_count + 1, q);
        b->border_count++;
    }
    border = &b->borders[b->table[at]];
    border->sum += cairn_max(b->one[pixel], b->one[other]);
    border->length++;
}

void cairn_boundary_border_row(cairn_boundary *b)
{
    int32_t at = b->row * b->image.width;

    for (int32_t x = 0; x < b->image.width; x++, at++) {
        if (x + 1 < b->image.width)
            add_side(b, at, at + 1);
        if (b->row + 1 < b->image.height)
            add_side(b, at, at + b->image.width);
    }
    b->row++;
}

/* ---- Joining ---- */

int32_t cairn_boundary_join_cost(const cairn_boundary *b)
{
    const boundary_border *weakest;

    if (b->fed < b->border_count)
        return 1;
    if (b->heap_count == 0)
        return 0;
    weakest = &b->borders[b->heap[0]];
    return 1 + (b->regions[weakest->region[0]].count + b->regions[weakest->region[1]].count) / HALVES_A_UNIT;
}

/* The next border's way into the heap. */
static void feed(cairn_boundary *b)
{
    boundary_border *border = &b->borders[b->fed];

    for (int32_t side = 0; side < 2; side++)
        b->regions[border->region[side]].share = share_of(b, border->region[side]);
    border->key = key_of(b, border);
    put(b, b->heap_count++, b->fed);
    settle(b, b->fed++);
}

/* Marks at the regions about this one by which border, or wipes the marks. */
static void mark_about(const cairn_boundary *b, int32_t region, int wipe)
{
    for (int32_t half = b->regions[region].first; half >= 0; half = b->borders[half / 2].next[half % 2])
        b->regions[b->borders[half / 2].region[1 - half % 2]].mark = wipe ? -1 : half / 2;
}

/* Borders of the region that goes become those of the one that stays. */
static void hand_over(cairn_boundary *b, int32_t stays, int32_t goes)
{
    int32_t next;

    for (int32_t half = b->regions[goes].first; half >= 0; half = next) {
        boundary_border *border = &b->borders[half / 2];
        int32_t third = border->region[1 - half % 2], mark = b->regions[third].mark;

        next = border->next[half % 2];
        if (mark < 0) {
            enlist(b, half, stays);
            continue;
        }
        b->borders[mark].sum += border->sum;
        b->borders[mark].length += border->length;
        border->into = mark;
        delist(b, half ^ 1);
        leave_heap(b, half / 2);
    }
}

static void join(cairn_boundary *b)
{
    int32_t weakest = b->heap[0];
    boundary_border *border = &b->borders[weakest];
    int32_t side = b->regions[border->region[1]].size > b->regions[border->region[0]].size;
    int32_t stays = border->region[side], goes = border->region[1 - side];

    b->joined = cairn_max(b->joined, border->key);
    border->level = b->joined;
    leave_heap(b, weakest);
    delist(b, 2 * weakest);
    delist(b, 2 * weakest + 1);
    mark_about(b, stays, 0);
    hand_over(b, stays, goes);
    mark_about(b, stays, 1);
    b->regions[stays].size += b->regions[goes].size;
    b->regions[stays].share = share_of(b, stays);
    for (int32_t half = b->regions[stays].first; half >= 0; half = b->borders[half / 2].next[half % 2]) {
        b->borders[half / 2].key = key_of(b, &b->borders[half / 2]);
        settle(b, half / 2);
    }
}

void cairn_boundary_join_next(cairn_boundary *b)
{
    if (b->fed < b->border_count)
        feed(b);
    else
        join(b);
}

int32_t cairn_boundary_border_of(const cairn_boundary *b, int32_t p, int32_t q)
{
    int32_t last, border;

    /* The table knows borders by the regions that they had. */
    last = border = b->table[place_of(b, p < q ? p : q, p < q ? q : p)];
    while (b->borders[border].into != border)
        border = b->borders[border].into;
    while (b->borders[last].into != border && last != border) {
        int32_t next = b->borders[last].into;

        b->borders[last].into = border;
        last = next;
    }
    return border;
}
