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
/* Walls and tiles of a search; entries set to a value; entries that sink in the heap. */
enum { WALLS_PER_UNIT = 12, ENTRIES_PER_UNIT = 64, UNITS_PER_SIFT = 3, UNITS_PER_SEGMENT = 3 };

static cairn_real gate_of(int32_t round)
{
    return gates[round < 5 ? round : 5];
}

static int is_used(const cairn_aligner *aligner, const aligner_segment *segment)
{
    return segment->weight > 0 && (segment->is_short || segment->length > MIN_LENGTH_M) &&
           aligner->scans[segment->scan].cluster == aligner->move.home;
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

static void begin_order(cairn_aligner *aligner)
{
    for (int32_t i = 0; i < aligner->segment_count; i++)
        aligner->order[i] = i;
    aligner->joint.sorting = heap_sorting_of(aligner->segment_count);
}

int cairn_aligner_sort(cairn_aligner *aligner, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 1 + aligner->segment_count / ENTRIES_PER_UNIT);
    begin_order(aligner);
    CAIRN_STEP_UNTIL(aligner->resume.part,
                     heap_sort_step(&aligner->joint.sorting, budget, &aligner->units_charged,
                                    UNITS_PER_SIFT, aligner, has_less_information,
                                    exchange_segments));
    CAIRN_STEP_END(aligner->resume.part);
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

/* Sets the segment of a search, and its place in the map. */
static void place_segment(const cairn_aligner *aligner, const aligner_segment *segment,
                          aligner_wall_search *search)
{
    cairn_transform pose = aligner->poses[segment->scan];

    search->segment = segment;
    search->direction = cairn_transform_direction(pose, segment->direction);
    search->a = cairn_transform_point(pose, segment->a);
    search->b = cairn_vec2_add(search->a, cairn_vec2_scale(search->direction, segment->length));
    search->gate =
        gate_of(aligner->joint.round) + (segment->length < SHORT_LENGTH_M ? SHORT_EXTRA_GATE_M : 0);
    search->far = aligner->scans[segment->scan].is_weak ? MAX_GAP_WEAK_M : MAX_GAP_M;
}

static cairn_real distance_of(const aligner_wall *wall, cairn_vec2 point)
{
    return cairn_abs(cairn_vec2_dot(wall->normal, point) - wall->offset);
}

/* Returns the distance of a segment from a wall, m, gaps added; negative: no association. */
static cairn_real distance_from_wall(const aligner_wall *wall, const aligner_wall_search *p)
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
    aligner_wall_search search;

    place_segment(aligner, segment, &search);
    return distance_from_wall(wall, &search);
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
    int32_t way = cairn_visibility_bin(along, ALIGNER_WALL_DIRECTIONS);

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

/* Compares the next wall of the bucket with the segment. */
static void visit_wall(cairn_aligner *aligner)
{
    aligner_wall_search *search = &aligner->joint.search;
    int32_t w = search->next;
    const aligner_wall *wall = &aligner->walls[w];
    cairn_real fit =
        distance_of(wall, search->a) > search->gate ? -1 : distance_from_wall(wall, search);

    search->next = wall->next_in_bucket;
    search->passed++;
    if (fit >= 0 && (fit < search->least || (fit <= search->least && w < search->wall))) {
        search->least = fit;
        search->wall = w;
    }
}

/* Returns 0 when no wall with its middle in the current tile can be associated. The line of an
 * associated wall passes the segment's end within the gate, and diverges from the segment's line by
 * at most the cone's slope. */
static int may_hold(const aligner_wall_search *p)
{
    cairn_vec2 middle = {((cairn_real)p->u + CAIRN_REAL(0.5)) * TILE_M,
                         ((cairn_real)p->v + CAIRN_REAL(0.5)) * TILE_M};
    cairn_vec2 from = cairn_vec2_sub(middle, p->a);
    cairn_real far =
        TILE_M / 2 * (cairn_abs(p->direction.x) + cairn_abs(p->direction.y)) + TILE_MARGIN_M;
    cairn_real along = cairn_abs(cairn_vec2_dot(p->direction, from));

    return cairn_abs(cairn_vec2_cross(p->direction, from)) <= far + (along + far) * p->slope;
}

void cairn_aligner_begin_search(cairn_aligner *aligner, const aligner_segment *segment)
{
    cairn_transform cone = segment->is_short ? CONE_SHORT : DIRECTION_CONE;
    aligner_wall_search *p = &aligner->joint.search;
    cairn_real gap, reach;
    int32_t last;

    place_segment(aligner, segment, p);
    p->slope = cone.sine / cone.cosine;
    p->least = CAIRN_REAL_MAX;
    p->wall = -1;
    p->passed = 0;
    gap = cairn_min(cairn_max(p->far, MAX_GAP_RATIO * segment->length),
                    cairn_max(p->far, MAX_GAP_RATIO * TILE_M));
    reach = gap + TILE_M / 2 + TILE_MARGIN_M;
    p->west = tile_index(cairn_min(p->a.x, p->b.x) - reach);
    p->east = tile_index(cairn_max(p->a.x, p->b.x) + reach);
    p->south = tile_index(cairn_min(p->a.y, p->b.y) - reach);
    p->north = tile_index(cairn_max(p->a.y, p->b.y) + reach);
    last = cairn_visibility_bin(cairn_transform_direction(cone, p->direction),
                                ALIGNER_WALL_DIRECTIONS);
    cone.sine = -cone.sine;
    p->first = cairn_visibility_bin(cairn_transform_direction(cone, p->direction),
                                    ALIGNER_WALL_DIRECTIONS);
    p->ways = 1 + ((last - p->first) & (ALIGNER_WALL_DIRECTIONS - 1));
}

/* The current one of the directions that an associated wall can have. */
static int32_t current_direction(const aligner_wall_search *search)
{
    return (search->first + search->way) & (ALIGNER_WALL_DIRECTIONS - 1);
}

/* Returns the first long wall of the current direction; -1: none. */
static int32_t first_long_wall(const cairn_aligner *aligner)
{
    return aligner->buckets[ALIGNER_WALL_BUCKETS + current_direction(&aligner->joint.search)];
}

/* Returns the first wall of the current tile and direction; -1: none. */
static int32_t first_of_tile(const cairn_aligner *aligner)
{
    const aligner_wall_search *search = &aligner->joint.search;

    return aligner->buckets[bucket_of(search->u, search->v, current_direction(search))];
}

/* Step: the long walls, then those of each tile. */
int cairn_aligner_find_wall(cairn_aligner *aligner, cairn_budget *budget)
{
    aligner_wall_search *search = &aligner->joint.search;

    CAIRN_STEP_BEGIN(aligner->resume.item);
    ALIGNER_CHARGE_EVERY(item, WALLS_PER_UNIT, search->passed);
    search->passed++;
    for (search->way = 0; search->way < search->ways; search->way++)
        for (search->next = first_long_wall(aligner); search->next >= 0;) {
            ALIGNER_CHARGE_EVERY(item, WALLS_PER_UNIT, search->passed);
            visit_wall(aligner);
        }
    for (search->v = search->south; search->v <= search->north; search->v++)
        for (search->u = search->west; search->u <= search->east; search->u++) {
            ALIGNER_CHARGE_EVERY(item, WALLS_PER_UNIT, search->passed);
            search->passed++;
            if (!may_hold(search))
                continue;
            for (search->way = 0; search->way < search->ways; search->way++)
                for (search->next = first_of_tile(aligner); search->next >= 0;) {
                    ALIGNER_CHARGE_EVERY(item, WALLS_PER_UNIT, search->passed);
                    visit_wall(aligner);
                }
        }
    CAIRN_STEP_END(aligner->resume.item);
}

static void clear_wall(aligner_wall *wall)
{
    memset(wall, 0, sizeof *wall);
    wall->low = CAIRN_REAL_MAX;
    wall->high = -CAIRN_REAL_MAX;
    wall->bucket = wall->next_in_bucket = -1;
}

/* Clears the walls whose association is fixed, or drops all; empties the index. */
static void begin_walls(cairn_aligner *aligner)
{
    if (!cairn_aligner_has_fixed_association(aligner))
        aligner->wall_count = 0;
    for (int32_t w = 0; w < aligner->wall_count; w++)
        clear_wall(&aligner->walls[w]);
    for (int32_t k = 0; k < ALIGNER_WALL_BUCKETS + ALIGNER_WALL_DIRECTIONS; k++)
        aligner->buckets[k] = -1;
}

static aligner_segment *current_segment(const cairn_aligner *aligner)
{
    return &aligner->segments[aligner->order[aligner->joint.at]];
}

/* Assigns the current segment to the wall that was found, or to a new one. */
static void assign(cairn_aligner *aligner)
{
    aligner_segment *s = current_segment(aligner);

    s->wall = aligner->joint.search.wall;
    if (s->wall < 0) {
        s->wall = aligner->wall_count++;
        clear_wall(&aligner->walls[s->wall]);
    }
}

/* Adds the current segment to its wall, if it has one. */
static void add_current(cairn_aligner *aligner)
{
    const aligner_segment *s = current_segment(aligner);

    if (s->wall < 0)
        return;
    add_to_wall(aligner, &aligner->walls[s->wall], s);
    index_wall(aligner, s->wall);
}

int cairn_aligner_associate(cairn_aligner *aligner, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(aligner->resume.part);
    ALIGNER_CHARGE(part, 1 + (ALIGNER_WALL_BUCKETS + aligner->wall_count) / ENTRIES_PER_UNIT);
    begin_walls(aligner);
    for (aligner->joint.at = 0; aligner->joint.at < aligner->segment_count; aligner->joint.at++) {
        ALIGNER_CHARGE(part, UNITS_PER_SEGMENT);
        if (!cairn_aligner_has_fixed_association(aligner)) {
            current_segment(aligner)->wall = -1;
            if (!is_used(aligner, current_segment(aligner)))
                continue;
            cairn_aligner_begin_search(aligner, current_segment(aligner));
            CAIRN_STEP_RUN(aligner, resume.part, budget, cairn_aligner_find_wall);
            assign(aligner);
        }
        add_current(aligner);
    }
    CAIRN_STEP_END(aligner->resume.part);
}
