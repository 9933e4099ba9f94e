/* Geodesic distances within a polygon with holes: visibility graph and all-pairs shortest paths.
 *
 * Method:
 * 1. Two vertices are visible to each other if they are neighbours on an outline, or if the segment
 *    between them enters the shape at both ends and touches no edge of other vertices. A segment
 *    that only grazes a vertex counts as blocked: the path over that vertex is equally long, and
 *    rounding cannot decide the side.
 * 2. Shortest paths bend at reflex vertices only. The Floyd-Warshall algorithm therefore uses
 *    reflex vertices as intermediate vertices; straight vertices are included for grazing paths.
 *
 * Memory layout: vertices with their edge directions, neighbours and flags, the distance matrix.
 *
 * Limits: points closer than CONTACT_TOLERANCE (relative to the size) touch. Non-adjacent vertices
 * must not coincide.
 *
 * Source: Lozano-Perez and Wesley 1979 (visibility graph); Adluru 2008, section 4.5. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/inner_distance.h"

typedef int32_t inner_distance_phase;
enum { PHASE_IDLE, PHASE_VISIBILITY, PHASE_PATHS, PHASE_MAXIMUM, PHASE_DONE };
enum { MIN_POINTS = 3, MAX_POINTS = 2048 };
/* Work units: a pair of vertices, edges tested for visibility, compared sums. */
enum { UNITS_PER_PAIR = 1, EDGES_PER_UNIT = 8, SUMS_PER_UNIT = 24 };

#ifdef CAIRN_FLOAT
#define CONTACT_TOLERANCE CAIRN_REAL(8e-6)
#define MAX_STRAIGHT_SINE CAIRN_REAL(1e-4)
#else
#define CONTACT_TOLERANCE CAIRN_REAL(1.5e-14)
#define MAX_STRAIGHT_SINE CAIRN_REAL(1e-6)
#endif

typedef struct inner_vertex {
    /* direction: unit direction of the edge to the next vertex; the shape lies to its left. */
    cairn_vec2 position, direction;
    int32_t before, after;
    /* 1: shortest paths may bend or graze here (reflex or straight vertex). */
    int32_t is_path_vertex;
} inner_vertex;

struct cairn_inner_distance {
    cairn_inner_distance_params params;
    inner_vertex *vertices;
    cairn_real *distance;
    int32_t count, outer_count;
    int32_t row, column;  /* Current cell of the distance matrix. */
    int32_t last_blocker; /* The edge that blocked the previous segment. */
    /* Distance below which points touch, in the units of the outline. */
    cairn_real contact_tolerance;
    cairn_real unreachable; /* Upper bound of any path length: no path yet. */
    cairn_real max_distance;
    inner_distance_phase phase;
    int32_t units_charged;
};

cairn_inner_distance_params cairn_inner_distance_default(void)
{
    cairn_inner_distance_params params = {
        .max_points = 128,
        .fill_holes = 0,
    };

    return params;
}

static cairn_inner_distance *carve(cairn_pool *pool, const cairn_inner_distance_params *params)
{
    size_t n = (size_t)params->max_points;
    cairn_inner_distance *inner = cairn_pool_take_one(pool, sizeof *inner);
    inner_vertex *vertices = cairn_pool_take(pool, n, sizeof *vertices);
    cairn_real *distance = cairn_pool_take(pool, n * n, sizeof *distance);

    if (inner != NULL) {
        memset(inner, 0, sizeof *inner);
        inner->vertices = vertices;
        inner->distance = distance;
    }
    return inner;
}

size_t cairn_inner_distance_memory(const cairn_inner_distance_params *params)
{
    cairn_pool counting;

    if (params == NULL || params->max_points < MIN_POINTS || params->max_points > MAX_POINTS ||
        (params->fill_holes != 0 && params->fill_holes != 1))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_inner_distance_create(cairn_inner_distance **inner, cairn_pool *pool,
                                         const cairn_inner_distance_params *params)
{
    size_t need = cairn_inner_distance_memory(params);

    if (inner == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    *inner = carve(pool, params);
    (*inner)->params = *params;
    return CAIRN_OK;
}

/* ---- Outlines ---- */

/* *reach: greatest absolute coordinate; *whole: length of all outlines. */
static cairn_status check_outlines(const cairn_inner_distance *inner, const cairn_curve *outlines,
                                   int32_t count, cairn_real *reach, cairn_real *whole)
{
    int32_t points = 0;

    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];

        if (c->points == NULL || c->count < MIN_POINTS || !c->closed)
            return CAIRN_BAD_ARGUMENT;
        if (c->count > inner->params.max_points - points)
            return CAIRN_FULL;
        points += c->count;
    }
    *reach = *whole = 0;
    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];

        for (int32_t k = 0; k < c->count; k++) {
            if (!cairn_vec2_is_finite(c->points[k]))
                return CAIRN_NOT_FINITE;
            *reach =
                cairn_max(*reach, cairn_max(cairn_abs(c->points[k].x), cairn_abs(c->points[k].y)));
        }
        *whole += cairn_curve_length(c);
        if (!cairn_is_finite(4 * *whole) || !cairn_is_finite(*reach * *reach))
            return CAIRN_NOT_FINITE;
        if (!(cairn_abs(cairn_polygon_area(c->points, c->count)) > 0))
            return CAIRN_EMPTY;
    }
    return CAIRN_OK;
}

/* Copies an outline in its vertex order; before and after are linked so that the shape lies to
 * the left. */
static void add_outline(cairn_inner_distance *inner, const cairn_curve *curve, int32_t is_hole)
{
    int32_t first = inner->count, n = curve->count;
    int forward = (cairn_polygon_area(curve->points, n) > 0) != is_hole;

    for (int32_t i = 0; i < n; i++) {
        inner_vertex *v = &inner->vertices[first + i];
        int32_t low = first + (i > 0 ? i - 1 : n - 1), high = first + (i + 1 < n ? i + 1 : 0);

        v->position = curve->points[i];
        v->before = forward ? low : high;
        v->after = forward ? high : low;
    }
    inner->count += n;
    for (int32_t i = first; i < inner->count; i++)
        inner->vertices[i].direction = cairn_vec2_unit(cairn_vec2_sub(
            inner->vertices[inner->vertices[i].after].position, inner->vertices[i].position));
    for (int32_t i = first; i < inner->count; i++)
        inner->vertices[i].is_path_vertex =
            cairn_vec2_cross(inner->vertices[inner->vertices[i].before].direction,
                             inner->vertices[i].direction) <= MAX_STRAIGHT_SINE;
}

cairn_status cairn_inner_distance_begin(cairn_inner_distance *inner, const cairn_curve *outlines,
                                        int32_t count)
{
    cairn_real reach, whole;
    cairn_status status;

    if (inner == NULL || outlines == NULL || count < 1)
        return CAIRN_BAD_ARGUMENT;
    count = inner->params.fill_holes ? 1 : count;
    status = check_outlines(inner, outlines, count, &reach, &whole);
    if (status != CAIRN_OK)
        return status;
    inner->count = 0;
    for (int32_t i = 0; i < count; i++)
        add_outline(inner, &outlines[i], i > 0);
    inner->outer_count = outlines[0].count;
    inner->contact_tolerance = CONTACT_TOLERANCE * (reach + whole);
    inner->unreachable = 2 * whole;
    inner->row = inner->column = inner->last_blocker = inner->units_charged = 0;
    inner->max_distance = 0;
    inner->phase = PHASE_VISIBILITY;
    return CAIRN_OK;
}

/* ---- Visibility graph ---- */

/* Returns 1 if a unit direction enters the shape at a vertex, or runs along one of its edges. */
static int leads_inside(const cairn_inner_distance *inner, const inner_vertex *vertex,
                        cairn_vec2 direction)
{
    cairn_vec2 in = inner->vertices[vertex->before].direction;
    int of_in = cairn_vec2_cross(in, direction) >= -MAX_STRAIGHT_SINE,
        of_out = cairn_vec2_cross(vertex->direction, direction) >= -MAX_STRAIGHT_SINE;

    return cairn_vec2_cross(in, vertex->direction) >= 0 ? of_in && of_out : of_in || of_out;
}

/* A segment between two vertices: start, unit direction, length. */
typedef struct inner_segment {
    cairn_vec2 from, along;
    cairn_real length;
} inner_segment;

/* Returns the signed distance of a point to the line of a segment. */
static cairn_real lateral_offset(const inner_segment *segment, cairn_vec2 p)
{
    return cairn_vec2_cross(segment->along, cairn_vec2_sub(p, segment->from));
}

/* Returns the position of a point along a segment. */
static cairn_real position_along(const inner_segment *segment, cairn_vec2 p)
{
    return cairn_vec2_dot(segment->along, cairn_vec2_sub(p, segment->from));
}

static int is_within(const inner_segment *segment, cairn_real place)
{
    return place >= 0 && place <= segment->length;
}

/* Returns 1 if the segment touches an edge whose ends have lateral offsets a and b. */
static int intersects(const inner_segment *segment, cairn_vec2 from, cairn_vec2 to, cairn_real a,
                      cairn_real b, cairn_real tolerance)
{
    if ((a > tolerance && b > tolerance) || (a < -tolerance && b < -tolerance))
        return 0;
    if (cairn_abs(a) <= tolerance || cairn_abs(b) <= tolerance)
        return (cairn_abs(a) <= tolerance && is_within(segment, position_along(segment, from))) ||
               (cairn_abs(b) <= tolerance && is_within(segment, position_along(segment, to)));
    return is_within(
        segment, (position_along(segment, from) * b - position_along(segment, to) * a) / (b - a));
}

/* Returns whether an edge blocks the segment between vertices i and k. */
static int is_blocking(const cairn_inner_distance *inner, const inner_segment *segment,
                       int32_t side, int32_t i, int32_t k)
{
    const inner_vertex *v = &inner->vertices[side];
    cairn_vec2 to = inner->vertices[v->after].position;

    if (side == i || side == k || v->after == i || v->after == k)
        return 0;
    return intersects(segment, v->position, to, lateral_offset(segment, v->position),
                      lateral_offset(segment, to), inner->contact_tolerance);
}

/* Neighbouring segments are mostly blocked by the same edge: it is tested first. */
static int are_visible(cairn_inner_distance *inner, int32_t i, int32_t k)
{
    const inner_vertex *a = &inner->vertices[i], *b = &inner->vertices[k];
    cairn_vec2 displacement = cairn_vec2_sub(b->position, a->position);
    inner_segment s = {a->position, cairn_vec2_unit(displacement), cairn_vec2_norm(displacement)};

    if (a->after == k || a->before == k)
        return 1;
    if (!leads_inside(inner, a, s.along) ||
        !leads_inside(inner, b, cairn_vec2_scale(s.along, -1)) ||
        is_blocking(inner, &s, inner->last_blocker, i, k))
        return 0;
    for (int32_t side = 0; side < inner->count; side++)
        if (is_blocking(inner, &s, side, i, k)) {
            inner->last_blocker = side;
            return 0;
        }
    return 1;
}

/* Fills the distance matrix with the edges of the visibility graph. */
static cairn_status step_visibility(cairn_inner_distance *inner, cairn_budget *budget)
{
    int32_t n = inner->count;

    for (; inner->row < n; inner->row++, inner->column = 0) {
        for (; inner->column < inner->row; inner->column++) {
            cairn_real length = inner->unreachable;

            if (!cairn_budget_charge(budget, &inner->units_charged,
                                     UNITS_PER_PAIR + n / EDGES_PER_UNIT))
                return CAIRN_MORE;
            if (are_visible(inner, inner->row, inner->column))
                length = cairn_vec2_norm(cairn_vec2_sub(inner->vertices[inner->row].position,
                                                        inner->vertices[inner->column].position));
            inner->distance[inner->row * n + inner->column] =
                inner->distance[inner->column * n + inner->row] = length;
        }
        inner->distance[inner->row * n + inner->row] = 0;
    }
    inner->row = inner->column = 0;
    inner->phase = PHASE_PATHS;
    return CAIRN_OK;
}

/* ---- Shortest paths ---- */

/* Relaxes the paths from vertex i over vertex k to all others (Floyd-Warshall step). */
static void relax(cairn_inner_distance *inner, int32_t i, int32_t k)
{
    cairn_real *own = &inner->distance[i * inner->count], first = own[k];
    const cairn_real *over = &inner->distance[k * inner->count];

    for (int32_t to = 0; to < inner->count; to++)
        own[to] = cairn_min(own[to], first + over[to]);
}

/* Runs the Floyd-Warshall algorithm over the reflex vertices. */
static cairn_status step_paths(cairn_inner_distance *inner, cairn_budget *budget)
{
    int32_t n = inner->count;

    for (; inner->column < n; inner->column++, inner->row = 0) {
        for (; inner->row < n && inner->vertices[inner->column].is_path_vertex; inner->row++) {
            if (!cairn_budget_charge(budget, &inner->units_charged, 1 + n / SUMS_PER_UNIT))
                return CAIRN_MORE;
            if (inner->distance[inner->row * n + inner->column] < inner->unreachable)
                relax(inner, inner->row, inner->column);
        }
    }
    inner->row = 0;
    inner->phase = PHASE_MAXIMUM;
    return CAIRN_OK;
}

/* Computes the greatest distance. */
static cairn_status step_maximum(cairn_inner_distance *inner, cairn_budget *budget)
{
    for (; inner->row < inner->outer_count; inner->row++) {
        if (!cairn_budget_charge(budget, &inner->units_charged,
                                 1 + inner->outer_count / SUMS_PER_UNIT))
            return CAIRN_MORE;
        for (int32_t k = 0; k < inner->outer_count; k++)
            inner->max_distance =
                cairn_max(inner->max_distance, inner->distance[inner->row * inner->count + k]);
    }
    inner->phase = PHASE_DONE;
    return CAIRN_OK;
}

cairn_status cairn_inner_distance_step(cairn_inner_distance *inner, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (inner == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (inner->phase == PHASE_VISIBILITY)
        status = step_visibility(inner, budget);
    if (inner->phase == PHASE_PATHS && status == CAIRN_OK)
        status = step_paths(inner, budget);
    if (inner->phase == PHASE_MAXIMUM && status == CAIRN_OK)
        status = step_maximum(inner, budget);
    return status;
}

cairn_inner_distance_result cairn_inner_distance_read(const cairn_inner_distance *inner)
{
    cairn_inner_distance_result result = {0};

    if (inner != NULL && inner->phase == PHASE_DONE) {
        result.distance = inner->distance;
        result.count = inner->outer_count;
        result.stride = inner->count;
        result.max_distance = inner->max_distance;
    }
    return result;
}
