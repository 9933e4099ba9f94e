/* The walls of the aligner: segments of several scans on one line, with overlapping or neighbouring
 * extents.
 *
 * Segments are taken in the order of what they say, the most first; each goes to the wall that it
 * fits best, or becomes a new one. A wall keeps the moments of all hits on it in the map. A scan
 * that little else holds may have its surfaces on walls whose extent ends some metres away.
 *
 * Walls are found by their direction and by the tile in which their middle lies, in lists of
 * hashed tiles; walls longer than a tile are in a list of their own for each direction. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/aligner_work.h"

/* of the directions of one wall */
static const cairn_real LEAST_COSINE = CAIRN_REAL(0.94);
static const cairn_real LEAST_COSINE_STUB = CAIRN_REAL(0.7);
/* m, of a wall that gives a stub its direction */
static const cairn_real LONG = CAIRN_REAL(0.3);
/* m between the extents on one wall, ... */
static const cairn_real GAP = 1;
/* ... of one of a scan that little else holds */
static const cairn_real GAP_WEAK = 6;
/* times the shorter extent, when that is more */
static const cairn_real GAP_LONG = 2;
/* ... over which the gate is that share of itself */
static const cairn_real GAP_STRICT = CAIRN_REAL(0.6);
static const cairn_real GAP_COST = CAIRN_REAL(0.05);
/* m */
static const cairn_real SHORT = CAIRN_REAL(0.3), SHORT_EXTRA = CAIRN_REAL(0.01),
                        SHORTEST = CAIRN_REAL(0.08);

/* m, of the association. */
static const cairn_real gates[] = {CAIRN_REAL(0.08), CAIRN_REAL(0.07), CAIRN_REAL(0.06),
                                   CAIRN_REAL(0.05), CAIRN_REAL(0.04), CAIRN_REAL(0.03)};

/* Cosine and sine of a little more than the angles of those. */
static const cairn_transform CONE = {0, 0, CAIRN_REAL(0.9375), CAIRN_REAL(0.3480)};
static const cairn_transform CONE_STUB = {0, 0, CAIRN_REAL(0.6964), CAIRN_REAL(0.7176)};

static const cairn_real TILE = 6;                 /* m */
static const cairn_real SLACK = CAIRN_REAL(0.15); /* m: more than any gate */
enum { WALLS_OF_UNIT = 12 };

static cairn_real gate_of(int32_t round)
{
    return gates[round < 5 ? round : 5];
}

static int is_used(const cairn_aligner *x, const aligner_segment *s)
{
    return s->weight > 0 && (s->stub || s->length > SHORTEST) && x->scans[s->scan].part == x->home;
}

/* ---- The order of segments: those that say most first, by heap ---- */

static int says_less(const cairn_aligner *x, int32_t a, int32_t b)
{
    cairn_real first = x->segments[a].weight * x->segments[a].length;
    cairn_real second = x->segments[b].weight * x->segments[b].length;

    return first < second || (!(second < first) && a > b);
}

/* Sinks entry `at` of a heap of `count` with the least on top. */
static void sink(cairn_aligner *x, int32_t at, int32_t count)
{
    for (;;) {
        int32_t child = 2 * at + 1, swap = x->order[at];

        if (child >= count)
            return;
        if (child + 1 < count && says_less(x, x->order[child + 1], x->order[child]))
            child++;
        if (!says_less(x, x->order[child], x->order[at]))
            return;
        x->order[at] = x->order[child];
        x->order[child] = swap;
        at = child;
    }
}

/* One entry: the heap is built (stage 0) and emptied from its end (stage 1). */
int32_t cairn_aligner_sort_item(cairn_aligner *x)
{
    if (x->stage == 0) {
        if (x->at == 0)
            for (int32_t i = 0; i < x->segment_count; i++)
                x->order[i] = i;
        sink(x, x->segment_count - 1 - x->at, x->segment_count);
    } else {
        int32_t last = x->segment_count - 1 - x->at, swap = x->order[0];

        x->order[0] = x->order[last];
        x->order[last] = swap;
        sink(x, 0, last);
    }
    if (++x->at == x->segment_count) {
        x->at = 0;
        if (++x->stage == 2) {
            x->phase = ALIGNER_ASSOCIATE;
            x->stage = 0;
        }
    }
    return 3;
}

/* ---- Walls ---- */

static void fit_wall(aligner_wall *wall, cairn_vec2 direction)
{
    cairn_real values[2];
    cairn_vec2 minor, major;

    cairn_sym2_eigen(wall->spread, values, &minor, &major);
    if (cairn_vec2_dot(minor, cairn_vec2_left(direction)) < 0)
        minor = cairn_vec2_scale(minor, -1);
    wall->normal = minor;
    wall->offset = cairn_vec2_dot(minor, wall->middle);
}

cairn_vec2 cairn_aligner_along(const aligner_wall *wall)
{
    cairn_vec2 along = {wall->normal.y, -wall->normal.x};

    return along;
}

static void add_to_wall(cairn_aligner *x, aligner_wall *wall, const aligner_segment *s)
{
    cairn_transform pose = x->poses[s->scan];
    cairn_vec2 mean = cairn_transform_point(pose, s->mean), along;
    cairn_real c = pose.cosine, si = pose.sine, sum = wall->weight + s->weight,
               share = wall->weight * s->weight / sum;
    cairn_real dx = mean.x - wall->middle.x, dy = mean.y - wall->middle.y, low, high;
    cairn_sym2 m = s->spread;

    wall->spread.xx += c * c * m.xx - 2 * c * si * m.xy + si * si * m.yy + share * dx * dx;
    wall->spread.xy += c * si * (m.xx - m.yy) + (c * c - si * si) * m.xy + share * dx * dy;
    wall->spread.yy += si * si * m.xx + 2 * c * si * m.xy + c * c * m.yy + share * dy * dy;
    wall->middle.x += dx * s->weight / sum;
    wall->middle.y += dy * s->weight / sum;
    wall->weight = sum;
    fit_wall(wall, cairn_transform_direction(pose, s->direction));
    along = cairn_aligner_along(wall);
    low = cairn_vec2_dot(along, cairn_transform_point(pose, s->a));
    high = low + s->length;
    wall->low = cairn_min(wall->low, low);
    wall->high = cairn_max(wall->high, high);
    if (wall->scans == 0)
        wall->first_scan = s->scan;
    if (wall->scans < 2 && (wall->scans == 0 || wall->first_scan != s->scan))
        wall->scans++;
}

int cairn_aligner_same_line(const aligner_wall *wall, const aligner_segment *s,
                            cairn_vec2 direction)
{
    cairn_real cosine = cairn_vec2_dot(cairn_aligner_along(wall), direction);

    return s->stub ? cosine >= LEAST_COSINE_STUB && wall->high - wall->low >= LONG
                   : cosine >= LEAST_COSINE;
}

/* A segment in the map. */
typedef struct placed {
    const aligner_segment *segment;
    cairn_vec2 a, b, direction;
    cairn_real gate, far; /* m: from a wall, and over a gap */
} placed;

static placed place_segment(const cairn_aligner *x, const aligner_segment *s)
{
    cairn_transform pose = x->poses[s->scan];
    placed p;

    p.segment = s;
    p.direction = cairn_transform_direction(pose, s->direction);
    p.a = cairn_transform_point(pose, s->a);
    p.b = cairn_vec2_add(p.a, cairn_vec2_scale(p.direction, s->length));
    p.gate = gate_of(x->round) + (s->length < SHORT ? SHORT_EXTRA : 0);
    p.far = x->scans[s->scan].weak ? GAP_WEAK : GAP;
    return p;
}

static cairn_real distance_of(const aligner_wall *wall, cairn_vec2 point)
{
    return cairn_abs(cairn_vec2_dot(wall->normal, point) - wall->offset);
}

/* How badly a segment fits a wall, m; negative: it does not. */
static cairn_real fits_wall(const aligner_wall *wall, const placed *p)
{
    cairn_real error = distance_of(wall, p->a), low, high, gap, most;
    cairn_vec2 along;

    if (error > p->gate || !cairn_aligner_same_line(wall, p->segment, p->direction))
        return -1;
    along = cairn_aligner_along(wall);
    error = cairn_max(error, distance_of(wall, p->b));
    low = cairn_vec2_dot(along, p->a);
    high = cairn_vec2_dot(along, p->b);
    gap = cairn_max(low - wall->high, wall->low - high);
    most = cairn_max(p->far, GAP_LONG * cairn_min(wall->high - wall->low, high - low));
    if (gap > most || error > (gap > 0 ? GAP_STRICT * p->gate : p->gate))
        return -1;
    return error + GAP_COST * cairn_max(gap, 0);
}

cairn_real cairn_aligner_misfit(const cairn_aligner *x, const aligner_segment *s,
                                const aligner_wall *wall)
{
    placed p = place_segment(x, s);

    return fits_wall(wall, &p);
}

static int32_t way_of(cairn_vec2 direction)
{
    return cairn_aligner_bin_of(direction.x, direction.y) / (ALIGNER_BINS / ALIGNER_WAYS);
}

/* ---- Where walls are ---- */

static int32_t tile_of(int32_t x, int32_t y, int32_t way)
{
    uint32_t hash = (uint32_t)x * 73856093U ^ (uint32_t)y * 19349663U ^ (uint32_t)way * 83492791U;

    return (int32_t)((hash ^ hash >> 15) & (ALIGNER_TILES - 1));
}

static int32_t step_of(cairn_real metres)
{
    return cairn_real_to_int(cairn_floor(metres / TILE));
}

/* The list that a wall belongs in. */
static int32_t place_of(const aligner_wall *wall)
{
    cairn_real middle = (wall->low + wall->high) / 2;
    cairn_vec2 along = cairn_aligner_along(wall), p;
    int32_t way = way_of(along);

    if (wall->high - wall->low > TILE)
        return ALIGNER_TILES + way;
    p = cairn_vec2_add(cairn_vec2_scale(wall->normal, wall->offset),
                       cairn_vec2_scale(along, middle));
    return tile_of(step_of(p.x), step_of(p.y), way);
}

/* Puts a wall that has changed into its list. */
static void put_wall(cairn_aligner *x, int32_t w)
{
    aligner_wall *wall = &x->walls[w];
    int32_t tile = place_of(wall), *link;

    if (tile == wall->tile)
        return;
    if (wall->tile >= 0) {
        for (link = &x->tiles[wall->tile]; *link != w;)
            link = &x->walls[*link].next;
        *link = wall->next;
    }
    wall->tile = tile;
    wall->next = x->tiles[tile];
    x->tiles[tile] = w;
}

/* The wall that a segment fits best, of those that have been looked at. */
typedef struct fitting {
    placed segment;
    cairn_real slope; /* tangent of the angle that its walls may be off */
    cairn_real best;
    int32_t wall;
    int32_t passed;
} fitting;

/* Looks at the walls of a list, of which few are near the end of the segment. */
static void look_through(const cairn_aligner *x, int32_t tile, fitting *f)
{
    for (int32_t w = x->tiles[tile]; w >= 0; w = x->walls[w].next) {
        cairn_real fit;

        f->passed++;
        if (distance_of(&x->walls[w], f->segment.a) > f->segment.gate)
            continue;
        fit = fits_wall(&x->walls[w], &f->segment);
        if (fit >= 0 && (fit < f->best || (fit <= f->best && w < f->wall))) {
            f->best = fit;
            f->wall = w;
        }
    }
}

/* 0 when no wall that has its middle in a tile can fit: its line passes the segment's end by
 * less than the gate, and leaves the segment's own line by the slope of the cone at most. */
static int may_hold(const fitting *f, int32_t u, int32_t v)
{
    const placed *p = &f->segment;
    cairn_vec2 middle = {((cairn_real)u + CAIRN_REAL(0.5)) * TILE,
                         ((cairn_real)v + CAIRN_REAL(0.5)) * TILE};
    cairn_vec2 from = cairn_vec2_sub(middle, p->a);
    cairn_real far = TILE / 2 * (cairn_abs(p->direction.x) + cairn_abs(p->direction.y)) + SLACK;
    cairn_real along = cairn_abs(cairn_vec2_dot(p->direction, from));

    return cairn_abs(cairn_vec2_cross(p->direction, from)) <= far + (along + far) * f->slope;
}

int32_t cairn_aligner_find_wall(const cairn_aligner *x, const aligner_segment *s, int32_t *passed)
{
    cairn_transform cone = s->stub ? CONE_STUB : CONE;
    fitting f = {place_segment(x, s), cone.sine / cone.cosine, CAIRN_REAL_MAX, -1, 0};
    const placed *p = &f.segment;
    cairn_real gap =
        cairn_min(cairn_max(p->far, GAP_LONG * s->length), cairn_max(p->far, GAP_LONG * TILE));
    cairn_real reach = gap + TILE / 2 + SLACK;
    int32_t west = step_of(cairn_min(p->a.x, p->b.x) - reach),
            east = step_of(cairn_max(p->a.x, p->b.x) + reach);
    int32_t south = step_of(cairn_min(p->a.y, p->b.y) - reach),
            north = step_of(cairn_max(p->a.y, p->b.y) + reach);
    int32_t last = way_of(cairn_transform_direction(cone, p->direction)), first, ways;

    cone.sine = -cone.sine;
    first = way_of(cairn_transform_direction(cone, p->direction));
    ways = 1 + ((last - first) & (ALIGNER_WAYS - 1));
    for (int32_t k = 0; k < ways; k++)
        look_through(x, ALIGNER_TILES + ((first + k) & (ALIGNER_WAYS - 1)), &f);
    for (int32_t v = south; v <= north; v++)
        for (int32_t u = west; u <= east; u++, f.passed++)
            if (may_hold(&f, u, v))
                for (int32_t k = 0; k < ways; k++)
                    look_through(x, tile_of(u, v, (first + k) & (ALIGNER_WAYS - 1)), &f);
    *passed = f.passed;
    return f.wall;
}

static void clear_wall(aligner_wall *wall)
{
    memset(wall, 0, sizeof *wall);
    wall->low = CAIRN_REAL_MAX;
    wall->high = -CAIRN_REAL_MAX;
    wall->tile = wall->next = -1;
}

/* Walls are found anew, or, when the rounds near their end, keep their segments. */
int32_t cairn_aligner_associate_item(cairn_aligner *x)
{
    aligner_segment *s = &x->segments[x->order[x->at]];
    int32_t keep = cairn_aligner_keeps_walls(x), cleared = 0, passed = 0;

    if (x->at == 0) {
        cleared = keep ? x->wall_count : 0;
        for (int32_t w = 0; w < cleared; w++)
            clear_wall(&x->walls[w]);
        x->wall_count = cleared;
        for (int32_t k = 0; k < ALIGNER_TILES + ALIGNER_WAYS; k++)
            x->tiles[k] = -1;
    }
    x->at++;
    if (!keep) {
        s->wall = -1;
        if (!is_used(x, s))
            return 1;
        s->wall = cairn_aligner_find_wall(x, s, &passed);
        if (s->wall < 0) {
            s->wall = x->wall_count++;
            clear_wall(&x->walls[s->wall]);
        }
    }
    if (s->wall >= 0) {
        add_to_wall(x, &x->walls[s->wall], s);
        put_wall(x, s->wall);
    }
    return 3 + cleared / 16 + passed / WALLS_OF_UNIT;
}
