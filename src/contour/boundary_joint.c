/* Regions join until all is one: at which level each border goes.
 *
 * Method: the borders of the regions are kept in a heap by their strength times the share that the
 * smaller region has of the image, to a power; the weakest joins its regions, and where both
 * bordered on a third these borders become one. What a border had to be raised to is its level.
 * Which power is right differs from image to image, and whether the colours of the regions that are
 * being joined should count: so all is joined in five ways, each anew, and then once more by the
 * geometric mean of the levels, whose contours are closed at every level.
 *
 * Layout: a border is in the lists of both its regions; those of the larger region are marked at
 * their other regions.
 *
 * Source: Arbelaez, Maire, Fowlkes and Malik 2011, section 4; the mean of several ways is this
 * project's. */
#include "src/core/build.h"

#include "src/contour/boundary_work.h"

/* Half-borders that are passed over for a unit, and what it costs more when histograms are
 * compared. */
enum { HALVES_A_UNIT = 2, HISTOGRAM_UNITS = 8 };
/* A level below it counts as it. */
#define LEAST_LEVEL CAIRN_REAL(1e-9)

/* Ways of joining: of the power of the share, in units of the parameter; 1: colours count. */
enum { WAYS = 5 };
static const struct {
    cairn_real small;
    int32_t with_contrast;
} ways[WAYS] = {{0, 0}, {1, 0}, {2, 0}, {CAIRN_REAL(0.5), 1}, {CAIRN_REAL(1.5), 1}};

/* ---- Heap of borders ---- */

static int before(const cairn_boundary *b, int32_t p, int32_t q)
{
    return b->borders[p].key < b->borders[q].key ||
           (p < q && b->borders[p].key <= b->borders[q].key);
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

/* Powers of the way at hand; the last way has neither. */
static cairn_real small_of(const cairn_boundary *b)
{
    return b->way < WAYS ? ways[b->way].small * b->params.small : 0;
}

static cairn_real contrast_of(const cairn_boundary *b)
{
    return b->way < WAYS && ways[b->way].with_contrast ? b->params.contrast : 0;
}

/* The square of the Hellinger distance of two regions' colours, the mean of the channels. */
static cairn_real apart2(const cairn_boundary *b, int32_t p, int32_t q)
{
    const cairn_real *u = b->bins + (ptrdiff_t)p * BOUNDARY_BINS,
                     *v = b->bins + (ptrdiff_t)q * BOUNDARY_BINS;
    int32_t count = b->channels > 1 ? BOUNDARY_BINS : BOUNDARY_L_BINS;
    cairn_real sum = 0;

    for (int32_t k = 0; k < count; k++)
        sum += cairn_sqrt(u[k] * v[k]);
    return 1 - sum / ((cairn_real)b->channels *
                      cairn_sqrt((cairn_real)b->regions[p].size * (cairn_real)b->regions[q].size));
}

static cairn_real key_of(const cairn_boundary *b, const boundary_border *border)
{
    const boundary_region *p = &b->regions[border->region[0]], *q = &b->regions[border->region[1]];
    cairn_real mean = border->sum / (cairn_real)border->length, contrast = contrast_of(b);

    if (contrast > 0 && mean > 0) {
        cairn_real apart = apart2(b, border->region[0], border->region[1]);

        mean = apart > 0
                   ? cairn_exp((1 - contrast) * cairn_log(mean) + contrast / 2 * cairn_log(apart))
                   : 0;
    }
    return mean * cairn_min(p->share, q->share);
}

/* A region's share of the image to the power. */
static cairn_real share_of(const cairn_boundary *b, int32_t region)
{
    cairn_real share = (cairn_real)b->regions[region].size / (cairn_real)b->pixels;

    return cairn_exp(small_of(b) * cairn_log(share));
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

/* ---- Joining ---- */

int32_t cairn_boundary_join_cost(const cairn_boundary *b)
{
    const boundary_border *weakest;

    if (b->fed < b->border_count)
        return 1;
    if (b->heap_count == 0)
        return 0;
    weakest = &b->borders[b->heap[0]];
    return 1 + (b->regions[weakest->region[0]].count + b->regions[weakest->region[1]].count) *
                   (contrast_of(b) > 0 ? HISTOGRAM_UNITS : 1) / HALVES_A_UNIT;
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
    for (int32_t half = b->regions[region].first; half >= 0;
         half = b->borders[half / 2].next[half % 2])
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
    for (int32_t k = 0; k < BOUNDARY_BINS && contrast_of(b) > 0; k++)
        b->bins[(ptrdiff_t)stays * BOUNDARY_BINS + k] +=
            b->bins[(ptrdiff_t)goes * BOUNDARY_BINS + k];
    b->regions[stays].share = share_of(b, stays);
    for (int32_t half = b->regions[stays].first; half >= 0;
         half = b->borders[half / 2].next[half % 2]) {
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

/* ---- Ways ---- */

int cairn_boundary_has_ways(const cairn_boundary *b)
{
    return b->way < WAYS;
}

static void clear_region(const cairn_boundary *b, int32_t region)
{
    boundary_region *r = &b->regions[region];

    r->first = r->mark = -1;
    r->count = 0;
    r->size = r->pixels;
    for (int32_t k = 0; k < BOUNDARY_BINS && contrast_of(b) > 0; k++)
        b->bins[(ptrdiff_t)region * BOUNDARY_BINS + k] =
            b->first_bins[(ptrdiff_t)region * BOUNDARY_BINS + k];
}

static void clear_border(const cairn_boundary *b, int32_t border)
{
    boundary_border *e = &b->borders[border];

    e->into = border;
    e->length = e->sides;
    e->sum = (cairn_real)e->sides * (b->way < WAYS ? e->own : cairn_exp(e->logs / WAYS));
    for (int32_t side = 0; side < 2; side++)
        enlist(b, 2 * border + side, e->first[side]);
}

int cairn_boundary_clear_next(cairn_boundary *b)
{
    if (b->fed < b->region_count)
        clear_region(b, b->fed++);
    else if (b->fed < b->region_count + b->border_count)
        clear_border(b, b->fed++ - b->region_count);
    if (b->fed < b->region_count + b->border_count)
        return 1;
    b->fed = b->heap_count = 0;
    b->joined = 0;
    return 0;
}

/* The border that border `border` has become part of. */
static int32_t root_of(const cairn_boundary *b, int32_t border)
{
    while (b->borders[border].into != border)
        border = b->borders[border].into;
    return border;
}

int cairn_boundary_tell_next(cairn_boundary *b)
{
    if (b->fed < b->border_count) {
        b->borders[b->fed].logs +=
            cairn_log(cairn_max(b->borders[root_of(b, b->fed)].level, LEAST_LEVEL));
        b->fed++;
        return 1;
    }
    b->fed = 0;
    b->way++;
    return 0;
}
