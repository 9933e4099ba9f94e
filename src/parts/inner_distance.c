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

#include "cairn/inner_distance.h"
#include "src/base/object.h"
#include "src/base/step.h"

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
    /* A cell of the distance matrix. While paths are relaxed: the vertex at which they start, and
     * the vertex that they lead over. */
    int32_t row, column;
    /* The edge that blocked the previous segment. */
    int32_t last_blocker;
    /* 1: distances are to be computed. */
    int32_t is_pending;
    int32_t resume, units_charged;
    /* Distance below which points touch, in the units of the outline. */
    cairn_real contact_tolerance;
    cairn_real unreachable; /* Upper bound of any path length: no path yet. */
    cairn_real max_distance;
};

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_inner_distance_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_points, 128, MIN_POINTS, MAX_POINTS),
    INTEGER(fill_holes, 0, 0, 1),
};
extern const cairn_parameters cairn_inner_distance_parameters;
const cairn_parameters cairn_inner_distance_parameters =
    CAIRN_PARAMETERS("inner_distance", cairn_inner_distance_params, rows);

cairn_inner_distance_params cairn_inner_distance_default(void)
{
    cairn_inner_distance_params params;

    cairn_parameters_preset(&cairn_inner_distance_parameters, &params);
    return params;
}

cairn_status cairn_inner_distance_check(const cairn_inner_distance_params *params,
                                        cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_inner_distance_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_inner_distance *build(cairn_pool *pool, const cairn_inner_distance_params *params)
{
    size_t n = (size_t)params->max_points;
    cairn_inner_distance *inner = cairn_object_take(pool, sizeof *inner);

    CAIRN_TAKE(inner, pool, vertices, n);
    CAIRN_TAKE(inner, pool, distance, n * n);
    if (inner != NULL)
        inner->params = *params;
    return inner;
}

CAIRN_OBJECT(inner_distance, inner_distance, build);

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
    inner->last_blocker = 0;
    inner->max_distance = 0;
    inner->resume = inner->units_charged = 0;
    inner->is_pending = 1;
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

/* The cell of the distance matrix of two vertices: the length of their segment, when it is an edge
 * of the visibility graph. */
static void set_edge(cairn_inner_distance *inner, int32_t i, int32_t k)
{
    cairn_real length = inner->unreachable;

    if (are_visible(inner, i, k))
        length = cairn_vec2_norm(
            cairn_vec2_sub(inner->vertices[i].position, inner->vertices[k].position));
    inner->distance[i * inner->count + k] = inner->distance[k * inner->count + i] = length;
}

/* ---- Shortest paths ---- */

/* Relaxes the paths from vertex i over vertex k to all others (Floyd-Warshall step). */
static void relax(cairn_inner_distance *inner, int32_t i, int32_t k)
{
    cairn_real *own = &inner->distance[i * inner->count], first = own[k];
    const cairn_real *over = &inner->distance[k * inner->count];

    if (!(first < inner->unreachable))
        return;
    for (int32_t to = 0; to < inner->count; to++)
        own[to] = cairn_min(own[to], first + over[to]);
}

/* Greatest distance from vertex i to a vertex of the outer outline. */
static cairn_real farthest(const cairn_inner_distance *inner, int32_t i)
{
    cairn_real most = 0;

    for (int32_t k = 0; k < inner->outer_count; k++)
        most = cairn_max(most, inner->distance[i * inner->count + k]);
    return most;
}

/* The distances: see Method in the head of this file. */
static int measure(cairn_inner_distance *inner, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(inner->resume);
    for (inner->row = 0; inner->row < inner->count; inner->row++) {
        for (inner->column = 0; inner->column < inner->row; inner->column++) {
            CAIRN_STEP_CHARGE(inner, resume, budget,
                              UNITS_PER_PAIR + inner->count / EDGES_PER_UNIT);
            set_edge(inner, inner->row, inner->column);
        }
        inner->distance[inner->row * inner->count + inner->row] = 0;
    }
    for (inner->column = 0; inner->column < inner->count; inner->column++) {
        if (!inner->vertices[inner->column].is_path_vertex)
            continue;
        for (inner->row = 0; inner->row < inner->count; inner->row++) {
            CAIRN_STEP_CHARGE(inner, resume, budget, 1 + inner->count / SUMS_PER_UNIT);
            relax(inner, inner->row, inner->column);
        }
    }
    for (inner->row = 0; inner->row < inner->outer_count; inner->row++) {
        CAIRN_STEP_CHARGE(inner, resume, budget, 1 + inner->outer_count / SUMS_PER_UNIT);
        inner->max_distance = cairn_max(inner->max_distance, farthest(inner, inner->row));
    }
    CAIRN_STEP_END(inner->resume);
}

cairn_status cairn_inner_distance_step(cairn_inner_distance *inner, cairn_budget *budget)
{
    if (inner == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (inner->is_pending)
        inner->is_pending = !measure(inner, budget);
    return inner->is_pending ? CAIRN_MORE : CAIRN_OK;
}

cairn_inner_distance_result cairn_inner_distance_read(const cairn_inner_distance *inner)
{
    cairn_inner_distance_result result = {0};

    if (inner != NULL && inner->count > 0 && !inner->is_pending) {
        result.distance = inner->distance;
        result.count = inner->outer_count;
        result.stride = inner->count;
        result.max_distance = inner->max_distance;
    }
    return result;
}
