/* aligner: data association of segments with walls, on one line with overlapping or neighbouring
 * extents.
 *
 * Method:
 * 1. Segments in the order of their information (heap sort); each is assigned to the nearest wall,
 *    or becomes a new one.
 * 2. A wall keeps the moments of all its hits in the map; its line is their total least squares
 *    fit.
 * 3. Index: walls are in hash buckets by direction and the tile of their middle; walls longer than
 *    a tile are in one bucket per direction.
 * Scans with a weakly observable direction accept walls whose extent ends some metres away. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/cell_grid.h"
#include "src/containers/heap.h"
#include "src/alignment/aligner_work.h"

/* least cosine between the directions of a segment and its wall */
static const cairn_real MIN_COSINE = CAIRN_REAL(0.94);
static const cairn_real MIN_COSINE_SHORT = CAIRN_REAL(0.7);
/* m: least length of a wall that determines a short segment's direction */
static const cairn_real MIN_WALL_LENGTH_M = CAIRN_REAL(0.3);
/* m: greatest gap between the extents on one wall, ... */
static const cairn_real MAX_GAP_M = 1;
/* ... of a scan with a weakly observable direction */
static const cairn_real MAX_GAP_WEAK_M = 6;
/* factor on the shorter extent, when that is more */
static const cairn_real MAX_GAP_RATIO = 2;
/* factor on the gate over a gap */
static const cairn_real GAP_GATE_FACTOR = CAIRN_REAL(0.6);
static const cairn_real GAP_COST_PER_M = CAIRN_REAL(0.05);
/* m */
static const cairn_real SHORT_LENGTH_M = CAIRN_REAL(0.3), SHORT_EXTRA_GATE_M = CAIRN_REAL(0.01),
                        MIN_LENGTH_M = CAIRN_REAL(0.08);

/* m: gate of the association, by iteration. */
static const cairn_real gates[] = {CAIRN_REAL(0.08), CAIRN_REAL(0.07), CAIRN_REAL(0.06),
                                   CAIRN_REAL(0.05), CAIRN_REAL(0.04), CAIRN_REAL(0.03)};

/* Cosine and sine of a little more than these angles. */
static const cairn_transform DIRECTION_CONE = {0, 0, CAIRN_REAL(0.9375), CAIRN_REAL(0.3480)};
static const cairn_transform CONE_SHORT = {0, 0, CAIRN_REAL(0.6964), CAIRN_REAL(0.7176)};

static const cairn_real TILE_M = 6;                       /* m: side of a tile */
static const cairn_real TILE_MARGIN_M = CAIRN_REAL(0.15); /* m: margin above any gate */
enum { WALLS_PER_UNIT = 12 };

static cairn_real gate_of(int32_t round)
{
    return gates[round < 5 ? round : 5];
}

static int is_used(const cairn_aligner *aligner, const aligner_segment *segment)
{
    return segment->weight > 0 && (segment->is_short || segment->length > MIN_LENGTH_M) &&
           aligner->scans[segment->scan].cluster == aligner->home;
}

/* ---- Order of the segments: decreasing information, by heap sort ---- */

static int has_less_information(const void *context, int32_t a, int32_t b)
{
    const cairn_aligner *aligner = context;
    const aligner_segment *first = &aligner->segments[aligner->order[a]],
                          *second = &aligner->segments[aligner->order[b]];
    cairn_real less = first->weight * first->length, more = second->weight * second->length;

    return less < more || (!(more < less) && aligner->order[a] > aligner->order[b]);
}

static void exchange_segments(void *context, int32_t a, int32_t b)
{
    const cairn_aligner *aligner = context;
    int32_t moved = aligner->order[a];

    aligner->order[a] = aligner->order[b];
    aligner->order[b] = moved;
}

/* One entry: the heap is built (stage 0) and emptied from its end (stage 1). */
int32_t cairn_aligner_sort_item(cairn_aligner *aligner)
{
    int32_t left = aligner->segment_count - aligner->at;

    if (aligner->stage == 0) {
        if (aligner->at == 0)
            for (int32_t i = 0; i < aligner->segment_count; i++)
                aligner->order[i] = i;
        heap_sift_down(aligner, left - 1, aligner->segment_count, has_less_information,
                       exchange_segments);
    } else {
        heap_pop(aligner, left, has_less_information, exchange_segments);
    }
    if (++aligner->at == aligner->segment_count) {
        aligner->at = 0;
        if (++aligner->stage == 2) {
            aligner->phase = ALIGNER_ASSOCIATE;
            aligner->stage = 0;
        }
    }
    return 3;
}

/* ---- Walls ---- */

static void fit_wall(aligner_wall *wall, cairn_vec2 direction)
{
    cairn_real values[2];
    cairn_vec2 minor, major;

    cairn_sym2_eigen(wall->scatter, values, &minor, &major);
    if (cairn_vec2_dot(minor, cairn_vec2_left_perp(direction)) < 0)
        minor = cairn_vec2_scale(minor, -1);
    wall->normal = minor;
    wall->offset = cairn_vec2_dot(minor, wall->middle);
}

cairn_vec2 cairn_aligner_along(const aligner_wall *wall)
{
    cairn_vec2 along = {wall->normal.y, -wall->normal.x};

    return along;
}

static void add_to_wall(cairn_aligner *aligner, aligner_wall *wall, const aligner_segment *segment)
{
    cairn_transform pose = aligner->poses[segment->scan];
    cairn_vec2 mean = cairn_transform_point(pose, segment->mean), along;
    cairn_real c = pose.cosine, si = pose.sine, sum = wall->weight + segment->weight,
               share = wall->weight * segment->weight / sum;
    cairn_real dx = mean.x - wall->middle.x, dy = mean.y - wall->middle.y, low, high;
    cairn_sym2 m = segment->scatter;

    wall->scatter.xx += c * c * m.xx - 2 * c * si * m.xy + si * si * m.yy + share * dx * dx;
    wall->scatter.xy += c * si * (m.xx - m.yy) + (c * c - si * si) * m.xy + share * dx * dy;
    wall->scatter.yy += si * si * m.xx + 2 * c * si * m.xy + c * c * m.yy + share * dy * dy;
    wall->middle.x += dx * segment->weight / sum;
    wall->middle.y += dy * segment->weight / sum;
    wall->weight = sum;
    fit_wall(wall, cairn_transform_direction(pose, segment->direction));
    along = cairn_aligner_along(wall);
    low = cairn_vec2_dot(along, cairn_transform_point(pose, segment->a));
    high = low + segment->length;
    wall->low = cairn_min(wall->low, low);
    wall->high = cairn_max(wall->high, high);
    if (wall->scan_count == 0)
        wall->first_scan = segment->scan;
    if (wall->scan_count < 2 && (wall->scan_count == 0 || wall->first_scan != segment->scan))
        wall->scan_count++;
}

int cairn_aligner_same_line(const aligner_wall *wall, const aligner_segment *segment,
                            cairn_vec2 direction)
{
    cairn_real cosine = cairn_vec2_dot(cairn_aligner_along(wall), direction);

    return segment->is_short
               ? cosine >= MIN_COSINE_SHORT && wall->high - wall->low >= MIN_WALL_LENGTH_M
               : cosine >= MIN_COSINE;
}

/* A segment in the map. */
typedef struct placed {
    const aligner_segment *segment;
    cairn_vec2 a, b, direction;
    cairn_real gate, far; /* m: gate across, and greatest gap */
} placed;

static placed place_segment(const cairn_aligner *aligner, const aligner_segment *segment)
{
    cairn_transform pose = aligner->poses[segment->scan];
    placed p;

    p.segment = segment;
    p.direction = cairn_transform_direction(pose, segment->direction);
    p.a = cairn_transform_point(pose, segment->a);
    p.b = cairn_vec2_add(p.a, cairn_vec2_scale(p.direction, segment->length));
    p.gate = gate_of(aligner->round) + (segment->length < SHORT_LENGTH_M ? SHORT_EXTRA_GATE_M : 0);
    p.far = aligner->scans[segment->scan].is_weak ? MAX_GAP_WEAK_M : MAX_GAP_M;
    return p;
}

static cairn_real distance_of(const aligner_wall *wall, cairn_vec2 point)
{
    return cairn_abs(cairn_vec2_dot(wall->normal, point) - wall->offset);
}

/* Returns the distance of a segment from a wall, m, gaps added; negative: no association. */
static cairn_real distance_from_wall(const aligner_wall *wall, const placed *p)
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
    most = cairn_max(p->far, MAX_GAP_RATIO * cairn_min(wall->high - wall->low, high - low));
    if (gap > most || error > (gap > 0 ? GAP_GATE_FACTOR * p->gate : p->gate))
        return -1;
    return error + GAP_COST_PER_M * cairn_max(gap, 0);
}

cairn_real cairn_aligner_wall_distance(const cairn_aligner *aligner, const aligner_segment *segment,
                                       const aligner_wall *wall)
{
    placed p = place_segment(aligner, segment);

    return distance_from_wall(wall, &p);
}

static int32_t direction_bin(cairn_vec2 direction)
{
    return cairn_visibility_bin(direction, ALIGNER_WALL_DIRECTIONS);
}

/* ---- Wall index ---- */

static int32_t bucket_of(int32_t x, int32_t y, int32_t way)
{
    return (int32_t)(cell_hash(x, y, way) & (ALIGNER_WALL_BUCKETS - 1));
}

static int32_t tile_index(cairn_real metres)
{
    return cairn_real_to_int(cairn_floor(metres / TILE_M));
}

/* Returns the bucket of a wall. */
static int32_t bucket_of_wall(const aligner_wall *wall)
{
    cairn_real middle = (wall->low + wall->high) / 2;
    cairn_vec2 along = cairn_aligner_along(wall), p;
    int32_t way = direction_bin(along);

    if (wall->high - wall->low > TILE_M)
        return ALIGNER_WALL_BUCKETS + way;
    p = cairn_vec2_add(cairn_vec2_scale(wall->normal, wall->offset),
                       cairn_vec2_scale(along, middle));
    return bucket_of(tile_index(p.x), tile_index(p.y), way);
}

/* Moves a changed wall into its bucket. */
static void index_wall(cairn_aligner *aligner, int32_t w)
{
    aligner_wall *wall = &aligner->walls[w];
    int32_t tile = bucket_of_wall(wall), *link;

    if (tile == wall->bucket)
        return;
    if (wall->bucket >= 0) {
        for (link = &aligner->buckets[wall->bucket]; *link != w;)
            link = &aligner->walls[*link].next_in_bucket;
        *link = wall->next_in_bucket;
    }
    wall->bucket = tile;
    wall->next_in_bucket = aligner->buckets[tile];
    aligner->buckets[tile] = w;
}

/* Search for the nearest wall. */
typedef struct wall_search {
    placed segment;
    cairn_real slope; /* tangent of the greatest angle between wall and segment */
    cairn_real best;
    int32_t wall;
    int32_t passed;
} wall_search;

/* Visits the walls of a bucket. */
static void visit_bucket(const cairn_aligner *aligner, int32_t tile, wall_search *search)
{
    for (int32_t w = aligner->buckets[tile]; w >= 0; w = aligner->walls[w].next_in_bucket) {
        cairn_real fit;

        search->passed++;
        if (distance_of(&aligner->walls[w], search->segment.a) > search->segment.gate)
            continue;
        fit = distance_from_wall(&aligner->walls[w], &search->segment);
        if (fit >= 0 && (fit < search->best || (fit <= search->best && w < search->wall))) {
            search->best = fit;
            search->wall = w;
        }
    }
}

/* Returns 0 when no wall with its middle in this tile can be associated. The line of an associated
 * wall passes the segment's end within the gate, and diverges from the segment's line by at most
 * the cone's slope. */
static int may_hold(const wall_search *search, int32_t u, int32_t v)
{
    const placed *p = &search->segment;
    cairn_vec2 middle = {((cairn_real)u + CAIRN_REAL(0.5)) * TILE_M,
                         ((cairn_real)v + CAIRN_REAL(0.5)) * TILE_M};
    cairn_vec2 from = cairn_vec2_sub(middle, p->a);
    cairn_real far =
        TILE_M / 2 * (cairn_abs(p->direction.x) + cairn_abs(p->direction.y)) + TILE_MARGIN_M;
    cairn_real along = cairn_abs(cairn_vec2_dot(p->direction, from));

    return cairn_abs(cairn_vec2_cross(p->direction, from)) <= far + (along + far) * search->slope;
}

int32_t cairn_aligner_find_wall(const cairn_aligner *aligner, const aligner_segment *segment,
                                int32_t *passed)
{
    cairn_transform cone = segment->is_short ? CONE_SHORT : DIRECTION_CONE;
    wall_search f = {place_segment(aligner, segment), cone.sine / cone.cosine, CAIRN_REAL_MAX, -1,
                     0};
    const placed *p = &f.segment;
    cairn_real gap = cairn_min(cairn_max(p->far, MAX_GAP_RATIO * segment->length),
                               cairn_max(p->far, MAX_GAP_RATIO * TILE_M));
    cairn_real reach = gap + TILE_M / 2 + TILE_MARGIN_M;
    int32_t west = tile_index(cairn_min(p->a.x, p->b.x) - reach),
            east = tile_index(cairn_max(p->a.x, p->b.x) + reach);
    int32_t south = tile_index(cairn_min(p->a.y, p->b.y) - reach),
            north = tile_index(cairn_max(p->a.y, p->b.y) + reach);
    int32_t last = direction_bin(cairn_transform_direction(cone, p->direction)), first, ways;

    cone.sine = -cone.sine;
    first = direction_bin(cairn_transform_direction(cone, p->direction));
    ways = 1 + ((last - first) & (ALIGNER_WALL_DIRECTIONS - 1));
    for (int32_t k = 0; k < ways; k++)
        visit_bucket(aligner, ALIGNER_WALL_BUCKETS + ((first + k) & (ALIGNER_WALL_DIRECTIONS - 1)),
                     &f);
    for (int32_t v = south; v <= north; v++)
        for (int32_t u = west; u <= east; u++, f.passed++)
            if (may_hold(&f, u, v))
                for (int32_t k = 0; k < ways; k++)
                    visit_bucket(aligner,
                                 bucket_of(u, v, (first + k) & (ALIGNER_WALL_DIRECTIONS - 1)), &f);
    *passed = f.passed;
    return f.wall;
}

static void clear_wall(aligner_wall *wall)
{
    memset(wall, 0, sizeof *wall);
    wall->low = CAIRN_REAL_MAX;
    wall->high = -CAIRN_REAL_MAX;
    wall->bucket = wall->next_in_bucket = -1;
}

/* Associates the next segment; with a fixed association only the walls' moments are recomputed. */
int32_t cairn_aligner_associate_item(cairn_aligner *aligner)
{
    aligner_segment *s = &aligner->segments[aligner->order[aligner->at]];
    int32_t keep = cairn_aligner_has_fixed_association(aligner), cleared = 0, passed = 0;

    if (aligner->at == 0) {
        cleared = keep ? aligner->wall_count : 0;
        for (int32_t w = 0; w < cleared; w++)
            clear_wall(&aligner->walls[w]);
        aligner->wall_count = cleared;
        for (int32_t k = 0; k < ALIGNER_WALL_BUCKETS + ALIGNER_WALL_DIRECTIONS; k++)
            aligner->buckets[k] = -1;
    }
    aligner->at++;
    if (!keep) {
        s->wall = -1;
        if (!is_used(aligner, s))
            return 1;
        s->wall = cairn_aligner_find_wall(aligner, s, &passed);
        if (s->wall < 0) {
            s->wall = aligner->wall_count++;
            clear_wall(&aligner->walls[s->wall]);
        }
    }
    if (s->wall >= 0) {
        add_to_wall(aligner, &aligner->walls[s->wall], s);
        index_wall(aligner, s->wall);
    }
    return 3 + cleared / 16 + passed / WALLS_PER_UNIT;
}
