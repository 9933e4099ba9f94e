/* place_map: visibility grids of the places, and the pairwise likelihood of a relative pose.
 *
 * Method:
 * 1. A beam clears the cells on its way up to a margin before its end.
 * 2. Cells within the margin of a hit are surface, with the direction of the nearest line if any.
 *    Uncleared cells just behind a surface may be the inside of a wall.
 * 3. Pairwise likelihood: a point of the other place on a surface of its direction supports the
 *    pose; a point in free space is a free-space violation. Between places with little overlap the
 *    most informative observation is the opposite face of a wall, which hardly ever lies behind a
 *    surface by chance.
 * 4. Dynamic-object candidates: small round bodies with free space beside them may be people. In
 *    free space they count almost nothing, on one another much, as static ones are few and apart.
 * 5. The weights are those of a logistic regression of correct against wrong hypotheses in
 *    simulated arenas, bare, with tilted scans and with people.
 * 6. Points at which other places of the map observed free space are invalidated. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/place_map_work.h"

/* Cells and points that a work unit covers; cells when a grid is cleared; places in whose grids a
 * point is classified. */
enum { MAX_SIDE_CELLS = 4096 };
enum { CELLS_PER_UNIT = 16, POINTS_PER_UNIT = 32, CLEARED_PER_UNIT = 1024, PLACES_PER_UNIT = 2 };

/* Surfaces have equal directions when the cosine of their angle is above this; opposite faces of a
 * wall when one reversed has. */
static const cairn_real MIN_COSINE = CAIRN_REAL(0.8);
/* Number of points on opposite faces from which each counts half (saturation): those of one wall
 * are correlated. */
static const cairn_real HALF_WEIGHT_COUNT = 16;
/* greatest ratio of opposite faces to the other positive terms */
static const cairn_real MAX_OPPOSITE_RATIO = 4;
/* m: greatest thickness of a wall. */
static const cairn_real MAX_WALL_THICKNESS_M = CAIRN_REAL(0.25);
/* m: range difference of neighbouring hits on different surfaces. */
static const cairn_real MAX_RANGE_STEP_M = CAIRN_REAL(0.15);
/* m: greatest breadth of a moving body, and of two of them side by side that are seen whole. */
static const cairn_real MAX_BODY_BREADTH_M = CAIRN_REAL(0.6), MAX_PAIR_BREADTH_M = 1;
/* A body bulges from its chord by this share; below the second value, m, it has too few hits
 * for a decision. */
static const cairn_real MIN_BULGE_RATIO = CAIRN_REAL(0.1), MIN_CHORD_M = CAIRN_REAL(0.2);
/* m: a hit without an evenly spaced point within this distance is on a rough surface. */
static const cairn_real MAX_SMOOTH_DISTANCE_M = CAIRN_REAL(0.12);
/* m: an evenly spaced point belongs to the hits within this distance. */
static const cairn_real MAX_HIT_DISTANCE_M = CAIRN_REAL(0.08);

int32_t cairn_place_map_side(const cairn_place_map_params *params)
{
    int32_t half =
        cairn_real_to_int(cairn_ceil(params->visibility_reach / params->visibility_cell));

    return half >= 1 && half <= MAX_SIDE_CELLS / 2 ? 2 * half : 0;
}

/* Returns the cell of a point in the place's frame; -1: beyond the grid. */
static int32_t cell_of(const cairn_place_map *map, cairn_vec2 p)
{
    cairn_real by = 1 / map->params.visibility_cell, half = (cairn_real)map->visibility_side / 2;
    int32_t x = cairn_real_to_int(cairn_floor(p.x * by + half)),
            y = cairn_real_to_int(cairn_floor(p.y * by + half));

    return x < 0 || y < 0 || x >= map->visibility_side || y >= map->visibility_side
               ? -1
               : y * map->visibility_side + x;
}

static uint8_t *grid_of(const cairn_place_map *map, int32_t place)
{
    return map->visibility +
           (size_t)place * (size_t)map->visibility_side * (size_t)map->visibility_side;
}

/* Returns the greatest distance of neighbouring points on a beam at which cells are cleared, m. */
static cairn_real beam_step(const cairn_place_map *map)
{
    return map->params.visibility_cell * CAIRN_REAL(0.7);
}

void cairn_place_map_place_beam(cairn_transform transform, cairn_scan_beam *beam)
{
    beam->from = cairn_transform_point(transform, beam->from);
    beam->to = cairn_transform_point(transform, beam->to);
}

/* Returns the visited beam in the frame of the place. */
static cairn_scan_beam placed_beam(const cairn_place_map *map)
{
    cairn_scan_beam beam = map->beams[map->visit.item];

    cairn_place_map_place_beam(map->visit.transform, &beam);
    return beam;
}

/* Returns the number of points on the visited beam whose cells are cleared. */
static int32_t beam_points(const cairn_place_map *map)
{
    cairn_scan_beam beam = placed_beam(map);
    cairn_real end = cairn_min(cairn_vec2_norm(cairn_vec2_sub(beam.to, beam.from)) -
                                   map->params.visibility_margin,
                               2 * map->params.visibility_reach);

    return beam.kind == CAIRN_SCAN_BEAM_UNKNOWN
               ? 0
               : cairn_real_to_int(cairn_ceil(end / beam_step(map)));
}

/* Clears the cells of the visited beam; before any marking. */
static void clear_beam(cairn_place_map *map)
{
    uint8_t *grid = grid_of(map, map->place);
    cairn_scan_beam beam = placed_beam(map);
    cairn_vec2 unit = cairn_vec2_unit(cairn_vec2_sub(beam.to, beam.from));
    int32_t points = beam_points(map);

    for (int32_t k = 0; k < points; k++) {
        int32_t cell = cell_of(
            map, cairn_vec2_add(beam.from, cairn_vec2_scale(unit, (cairn_real)k * beam_step(map))));

        if (cell >= 0)
            grid[cell] = PLACE_MAP_VISIBILITY_FREE;
    }
}

/* Marks a cell; it keeps the most informative code, of surfaces with directions the first. */
static void mark_cell(cairn_place_map *map, cairn_vec2 p, uint8_t value)
{
    int32_t at = cell_of(map, p);
    uint8_t *cell = at >= 0 ? &grid_of(map, map->place)[at] : NULL;

    if (cell != NULL &&
        *cell < (value < PLACE_MAP_VISIBILITY_SURFACE ? value : PLACE_MAP_VISIBILITY_SURFACE))
        *cell = value;
}

/* Returns the cells of the margin. */
static int32_t margin_cells(const cairn_place_map *map)
{
    return cairn_real_to_int(
        cairn_ceil(map->params.visibility_margin / map->params.visibility_cell));
}

/* Returns the units of mark_surface(). */
static int32_t surface_units(const cairn_place_map *map)
{
    int32_t side = 2 * margin_cells(map) + 1;

    return 1 + side * side / CELLS_PER_UNIT;
}

/* Marks the cells within the margin of p. */
static void mark_surface(cairn_place_map *map, cairn_vec2 p, uint8_t value)
{
    cairn_real cell = map->params.visibility_cell, margin = map->params.visibility_margin;
    int32_t reach = margin_cells(map);

    for (int32_t j = -reach; j <= reach; j++)
        for (int32_t i = -reach; i <= reach; i++) {
            cairn_vec2 off = {(cairn_real)i * cell, (cairn_real)j * cell};

            if (cairn_vec2_norm_squared(off) <= margin * margin)
                mark_cell(map, cairn_vec2_add(p, off), value);
        }
}

/* Returns the cells from a surface to the greatest depth behind it, half a cell each. */
static int32_t cells_behind(const cairn_place_map *map)
{
    return cairn_real_to_int(cairn_ceil(MAX_WALL_THICKNESS_M / map->params.visibility_cell * 2));
}

/* Marks uncleared cells behind a surface as possible inside of a wall, whose opposite face another
 * place observes. */
static void mark_behind(cairn_place_map *map, const cairn_oriented_point *point, uint8_t value)
{
    cairn_vec2 back =
        cairn_vec2_scale(cairn_vec2_left_perp(point->direction), -map->params.visibility_cell / 2);
    cairn_vec2 along = cairn_vec2_scale(point->direction, map->params.visibility_cell / 2);
    int32_t depth = cells_behind(map);

    for (int32_t k = 0; k < depth; k++)
        for (int32_t i = -1; i <= 1; i++) {
            cairn_vec2 p = cairn_vec2_add(point->position, cairn_vec2_scale(back, (cairn_real)k));
            int32_t cell;

            p = cairn_vec2_add(p, cairn_vec2_scale(along, (cairn_real)i));
            cell = cell_of(map, p);
            if (cell >= 0 && grid_of(map, map->place)[cell] == PLACE_MAP_VISIBILITY_UNKNOWN)
                mark_cell(map, p, value);
        }
}

/* Returns the nearest of the quantized directions. */
static uint8_t code_of(const cairn_place_map *map, cairn_vec2 direction)
{
    int32_t best = 0;

    for (int32_t k = 1; k < PLACE_MAP_VISIBILITY_DIRECTIONS; k++)
        if (cairn_vec2_dot(map->directions[k], direction) >
            cairn_vec2_dot(map->directions[best], direction))
            best = k;
    return (uint8_t)best;
}

/* Returns 1 for a visited beam that ends on a surface. */
static int is_hit(const cairn_place_map *map)
{
    return map->beams[map->visit.item].kind == CAIRN_SCAN_BEAM_HIT;
}

/* Returns 1 when the visited beam has hit a rough surface: one without points of the scan. */
static int is_rough(const cairn_place_map *map)
{
    const place_map_place_scan *scan = &map->scans[map->visit.scan];
    const cairn_oriented_point *points = &map->points[scan->first_point];
    cairn_vec2 hit = map->beams[map->visit.item].to;

    if (!is_hit(map))
        return 0;
    for (int32_t i = 0; i < scan->point_count; i++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(points[i].position, hit)) <
            MAX_SMOOTH_DISTANCE_M * MAX_SMOOTH_DISTANCE_M)
            return 0;
    return 1;
}

/* Returns 1 when the visited point is on a dynamic-object candidate. */
static int is_candidate(const cairn_place_map *map)
{
    return (map->point_class[map->visit.item] & PLACE_MAP_POINT_DYNAMIC_CANDIDATE) != 0;
}

/* Returns the units of the visited point. */
static int32_t point_units(const cairn_place_map *map)
{
    return 1 + surface_units(map) +
           (is_candidate(map) ? 0 : 1 + 3 * cells_behind(map) / CELLS_PER_UNIT);
}

/* Marks the visited point. */
static void mark_point(cairn_place_map *map)
{
    cairn_oriented_point point =
        place_map_placed_point(map->visit.transform, map->points[map->visit.item]);
    uint8_t code = code_of(map, point.direction);

    if (is_candidate(map)) {
        mark_surface(map, point.position, PLACE_MAP_VISIBILITY_DYNAMIC);
        return;
    }
    mark_surface(map, point.position, (uint8_t)(PLACE_MAP_VISIBILITY_SURFACE + code));
    mark_behind(map, &point, (uint8_t)(PLACE_MAP_VISIBILITY_BEHIND + code));
}

void cairn_place_map_begin_visit(cairn_place_map *map, cairn_pose pose, int32_t first,
                                 int32_t count)
{
    map->visit.transform = cairn_transform_of(pose);
    map->visit.item = first;
    map->visit.end = first + count;
}

void cairn_place_map_begin_points(cairn_place_map *map, cairn_pose map_place)
{
    const place_map_place_scan *scan = &map->scans[map->visit.scan];

    cairn_place_map_begin_visit(map, cairn_pose_compose(map_place, scan->place_scan),
                                scan->first_point, scan->point_count);
}

int32_t cairn_place_map_next_items(const cairn_place_map *map)
{
    int32_t left = map->visit.end - map->visit.item;

    return left < PLACE_MAP_ITEMS ? left : PLACE_MAP_ITEMS;
}

/* Starts to visit the beams, or the points, of the visited scan. */
static void begin_beams(cairn_place_map *map)
{
    const place_map_place_scan *scan = &map->scans[map->visit.scan];

    cairn_place_map_begin_visit(map, scan->place_scan, scan->first_beam, scan->beam_count);
}

static void begin_points(cairn_place_map *map)
{
    const place_map_place_scan *scan = &map->scans[map->visit.scan];

    cairn_place_map_begin_visit(map, scan->place_scan, scan->first_point, scan->point_count);
}

static int32_t samples_of_side(const cairn_place_map *map)
{
    return (map->visibility_side + PLACE_MAP_VISIBILITY_SAMPLE_STRIDE - 1) /
           PLACE_MAP_VISIBILITY_SAMPLE_STRIDE;
}

static int32_t *free_cells_of(const cairn_place_map *map, int32_t place)
{
    size_t sampled = (size_t)samples_of_side(map);

    return map->free_cells + (size_t)place * sampled * sampled;
}

static void sample_free(cairn_place_map *map)
{
    const uint8_t *grid = grid_of(map, map->place);
    int32_t *cells = free_cells_of(map, map->place), count = 0;

    for (int32_t y = 0; y < map->visibility_side; y += PLACE_MAP_VISIBILITY_SAMPLE_STRIDE)
        for (int32_t x = 0; x < map->visibility_side; x += PLACE_MAP_VISIBILITY_SAMPLE_STRIDE)
            if (grid[y * map->visibility_side + x] == PLACE_MAP_VISIBILITY_FREE)
                cells[count++] = y * map->visibility_side + x;
    map->places[map->place].free_count = count;
}

static int32_t grid_bytes(const cairn_place_map *map)
{
    return map->visibility_side * map->visibility_side;
}

int cairn_place_map_build_visibility(cairn_place_map *map, cairn_budget *budget)
{
    struct place_map_visit *visit = &map->visit;
    const place_map_place *here = &map->places[map->place];
    int32_t end = here->first_scan + here->scan_count;

    CAIRN_STEP_BEGIN(map->resume.phase);
    CAIRN_STEP_CHARGE(map, resume.phase, budget, 1 + grid_bytes(map) / CLEARED_PER_UNIT);
    memset(grid_of(map, map->place), PLACE_MAP_VISIBILITY_UNKNOWN, (size_t)grid_bytes(map));
    for (visit->scan = here->first_scan; visit->scan < end; visit->scan++)
        for (begin_beams(map); visit->item < visit->end; visit->item++) {
            CAIRN_STEP_CHARGE(map, resume.phase, budget, 1 + beam_points(map) / CELLS_PER_UNIT);
            clear_beam(map);
        }
    for (visit->scan = here->first_scan; visit->scan < end; visit->scan++)
        for (begin_points(map); visit->item < visit->end; visit->item++) {
            CAIRN_STEP_CHARGE(map, resume.phase, budget, point_units(map));
            mark_point(map);
        }
    for (visit->scan = here->first_scan; visit->scan < end; visit->scan++)
        for (begin_beams(map); visit->item < visit->end; visit->item++) {
            CAIRN_STEP_CHARGE(map, resume.phase, budget,
                              1 + is_hit(map) *
                                      (1 + map->scans[visit->scan].point_count / POINTS_PER_UNIT));
            if (!is_rough(map))
                continue;
            CAIRN_STEP_CHARGE(map, resume.phase, budget, surface_units(map));
            mark_surface(map, placed_beam(map).to, PLACE_MAP_VISIBILITY_ROUGH);
        }
    CAIRN_STEP_CHARGE(map, resume.phase, budget,
                      1 + samples_of_side(map) * samples_of_side(map) / CELLS_PER_UNIT);
    sample_free(map);
    CAIRN_STEP_END(map->resume.phase);
}

cairn_vec2 cairn_place_map_free_point(const cairn_place_map *map, int32_t place, int32_t i)
{
    int32_t cell = free_cells_of(map, place)[i], column = cell % map->visibility_side,
            row = cell / map->visibility_side;
    cairn_real middle = (cairn_real)(map->visibility_side - 1) / 2;
    cairn_vec2 p = {(cairn_real)column - middle, (cairn_real)row - middle};

    return cairn_vec2_scale(p, map->params.visibility_cell);
}

cairn_real cairn_place_map_free_area(const cairn_place_map *map)
{
    cairn_real spacing = map->params.visibility_cell * PLACE_MAP_VISIBILITY_SAMPLE_STRIDE;

    return spacing * spacing;
}

int32_t cairn_place_map_observed(const cairn_place_map *map, int32_t place, cairn_vec2 point,
                                 cairn_vec2 direction)
{
    int32_t cell = cell_of(map, point),
            code = cell >= 0 ? grid_of(map, place)[cell] : PLACE_MAP_VISIBILITY_UNKNOWN;
    int32_t is_behind = code < PLACE_MAP_VISIBILITY_ROUGH;
    cairn_real cosine;

    if (code == PLACE_MAP_VISIBILITY_UNKNOWN)
        return PLACE_MAP_OBSERVED_UNKNOWN;
    if (code == PLACE_MAP_VISIBILITY_FREE)
        return PLACE_MAP_OBSERVED_FREE;
    if (code == PLACE_MAP_VISIBILITY_ROUGH || code == PLACE_MAP_VISIBILITY_DYNAMIC)
        return code == PLACE_MAP_VISIBILITY_ROUGH ? PLACE_MAP_OBSERVED_ROUGH
                                                  : PLACE_MAP_OBSERVED_DYNAMIC;
    cosine = cairn_vec2_dot(map->directions[code - (is_behind ? PLACE_MAP_VISIBILITY_BEHIND
                                                              : PLACE_MAP_VISIBILITY_SURFACE)],
                            direction);
    if (cosine < -MIN_COSINE)
        return PLACE_MAP_OBSERVED_OPPOSITE;
    if (is_behind)
        return PLACE_MAP_OBSERVED_UNKNOWN;
    return cosine > MIN_COSINE ? PLACE_MAP_OBSERVED_PARALLEL : PLACE_MAP_OBSERVED_OTHER_DIRECTION;
}

/* Terms of a pairwise likelihood. */
struct likelihood_terms {
    cairn_real pro, contra; /* terms for and against, nats */
    int32_t backs;          /* points on opposite faces of walls */
};

/* Adds a point of known direction on a static surface, or just behind one. */
static void add_on_surface(const cairn_place_map *map, uint8_t code, cairn_vec2 direction,
                           struct likelihood_terms *likelihood_terms)
{
    int32_t is_behind = code < PLACE_MAP_VISIBILITY_ROUGH;
    cairn_vec2 observed = map->directions[code - (is_behind ? PLACE_MAP_VISIBILITY_BEHIND
                                                            : PLACE_MAP_VISIBILITY_SURFACE)];
    cairn_real cosine = cairn_vec2_dot(observed, direction);

    likelihood_terms->backs += cosine < -MIN_COSINE;
    if (cosine > MIN_COSINE && !is_behind)
        likelihood_terms->pro += map->params.surface_nats;
}

/* Adds a point, by the other place's code of its cell. */
static void add_point(const cairn_place_map *map, uint8_t code, cairn_vec2 direction, int is_body,
                      struct likelihood_terms *likelihood_terms)
{
    const cairn_place_map_params *params = &map->params;

    if (code == PLACE_MAP_VISIBILITY_FREE)
        likelihood_terms->contra +=
            params->free_space_penalty * (is_body ? params->dynamic_factor : 1);
    else if (code == PLACE_MAP_VISIBILITY_ROUGH)
        likelihood_terms->pro += params->rough_surface_nats;
    else if (code == PLACE_MAP_VISIBILITY_DYNAMIC)
        likelihood_terms->pro += is_body ? params->dynamic_nats : params->surface_nats;
    else if (code != PLACE_MAP_VISIBILITY_UNKNOWN && is_body)
        likelihood_terms->pro += code >= PLACE_MAP_VISIBILITY_SURFACE ? params->surface_nats : 0;
    else if (code != PLACE_MAP_VISIBILITY_UNKNOWN)
        add_on_surface(map, code, direction, likelihood_terms);
}

/* Adds the points of one place, in the visibility grid of another. */
static void add_points(const cairn_place_map *map, int32_t observer, int32_t observed,
                       cairn_pose observer_observed, struct likelihood_terms *likelihood_terms)
{
    const uint8_t *grid = grid_of(map, observer);
    const place_map_place *place = &map->places[observed];

    for (int32_t s = place->first_scan; s < place->first_scan + place->scan_count; s++) {
        const cairn_oriented_point *points = &map->points[map->scans[s].first_point];
        const uint8_t *classes = &map->point_class[map->scans[s].first_point];
        cairn_transform transform =
            cairn_transform_of(cairn_pose_compose(observer_observed, map->scans[s].place_scan));

        for (int32_t i = 0; i < map->scans[s].point_count; i++) {
            int32_t cell = cell_of(map, cairn_transform_point(transform, points[i].position));

            if (cell >= 0 && classes[i] < PLACE_MAP_POINT_INVALIDATED)
                add_point(map, grid[cell],
                          cairn_transform_direction(transform, points[i].direction),
                          classes[i] == PLACE_MAP_POINT_DYNAMIC_CANDIDATE, likelihood_terms);
        }
    }
}

/* Returns the free space that two places share, m^2. */
static cairn_real shared_free_area(const cairn_place_map *map, int32_t observer, int32_t observed,
                                   cairn_pose observer_observed)
{
    const uint8_t *grid = grid_of(map, observer);
    cairn_transform transform = cairn_transform_of(observer_observed);
    int32_t shared = 0;

    for (int32_t i = 0; i < map->places[observed].free_count; i++) {
        int32_t at = cell_of(
            map, cairn_transform_point(transform, cairn_place_map_free_point(map, observed, i)));

        shared += at >= 0 && grid[at] == PLACE_MAP_VISIBILITY_FREE;
    }
    return (cairn_real)shared * cairn_place_map_free_area(map);
}

int32_t cairn_place_map_pair_units(const cairn_place_map *map, int32_t first, int32_t second)
{
    const place_map_place *a = &map->places[first], *b = &map->places[second];
    int32_t samples = a->free_count < b->free_count ? a->free_count : b->free_count;

    return 1 + (a->point_count + b->point_count + samples) / 6;
}

/* Opposite faces are informative only with other overlap, as whole rooms can be placed back to
 * back: they are limited to a multiple of the other positive terms. */
cairn_real cairn_place_map_pair_likelihood(const cairn_place_map *map, int32_t first,
                                           int32_t second, cairn_pose first_second)
{
    cairn_pose second_first = cairn_pose_inverse(first_second);
    struct likelihood_terms likelihood_terms = {0, 0, 0};
    cairn_real backs, shared;

    add_points(map, first, second, first_second, &likelihood_terms);
    add_points(map, second, first, second_first, &likelihood_terms);
    shared = map->places[first].free_count < map->places[second].free_count
                 ? shared_free_area(map, second, first, second_first)
                 : shared_free_area(map, first, second, first_second);
    backs = map->params.opposite_face_nats * (cairn_real)likelihood_terms.backs /
            (1 + (cairn_real)likelihood_terms.backs / HALF_WEIGHT_COUNT);
    return likelihood_terms.pro + cairn_min(backs, MAX_OPPOSITE_RATIO * likelihood_terms.pro) +
           map->params.free_area_nats * shared - likelihood_terms.contra;
}

/* ---- Dynamic-object candidates and invalidated points ---- */

/* Range of a hit, m; -1: no hit. */
static cairn_real range_of(const cairn_scan_beam *beam)
{
    return beam->kind == CAIRN_SCAN_BEAM_HIT ? cairn_vec2_norm(cairn_vec2_sub(beam->to, beam->from))
                                             : -1;
}

/* Returns 1 when the beam beside a run has free space behind the run. */
static int is_open_beside(const cairn_scan_view *view, int32_t beside, cairn_real range)
{
    if (beside < 0 || beside >= view->beam_count)
        return 0;
    return view->beams[beside].kind == CAIRN_SCAN_BEAM_FREE ||
           range_of(&view->beams[beside]) > range + MAX_RANGE_STEP_M;
}

/* Returns 1 when the hits of a run, beams [from, to), all lie within a body's breadth of the first,
 * and bulge towards the sensor or are too few for a decision: flat runs are parts of walls. */
static int is_body(const cairn_scan_view *view, int32_t from, int32_t to, cairn_real breadth)
{
    cairn_vec2 first = view->beams[from].to, chord = cairn_vec2_sub(view->beams[to - 1].to, first);
    cairn_real length = cairn_vec2_norm(chord), bulge = 0;
    cairn_real side =
        cairn_vec2_cross(chord, cairn_vec2_sub(view->beams[from].from, first)) > 0 ? 1 : -1;

    for (int32_t b = from + 1; b < to; b++) {
        cairn_vec2 off = cairn_vec2_sub(view->beams[b].to, first);

        if (cairn_vec2_norm_squared(off) > breadth * breadth)
            return 0;
        bulge = cairn_max(bulge, side * cairn_vec2_cross(chord, off));
    }
    return length < MIN_CHORD_M || bulge > MIN_BULGE_RATIO * length * length;
}

static void mark_candidate(cairn_place_map *map, const place_map_place_scan *scan,
                           const cairn_scan_view *view, int32_t from, int32_t to)
{
    for (int32_t i = 0; i < view->point_count; i++)
        for (int32_t b = from; b < to; b++)
            if (cairn_vec2_norm_squared(
                    cairn_vec2_sub(view->beams[b].to, view->points[i].position)) <
                MAX_HIT_DISTANCE_M * MAX_HIT_DISTANCE_M)
                map->point_class[scan->first_point + i] = PLACE_MAP_POINT_DYNAMIC_CANDIDATE;
}

void cairn_place_map_find_dynamic_candidates(cairn_place_map *map, const place_map_place_scan *scan,
                                             const cairn_scan_view *view)
{
    memset(map->point_class + scan->first_point, PLACE_MAP_POINT_STATIC, (size_t)view->point_count);
    for (int32_t from = 0, to; from < view->beam_count; from = to) {
        cairn_real range = range_of(&view->beams[from]), last = range;
        int32_t open;

        for (to = from + 1; to < view->beam_count; to++) {
            cairn_real next = range_of(&view->beams[to]);

            if (last < 0 || next < 0 || cairn_abs(next - last) > MAX_RANGE_STEP_M)
                break;
            last = next;
        }
        if (range < 0)
            continue;
        open = is_open_beside(view, from - 1, range) + is_open_beside(view, to, last);
        if (open >= 1 &&
            is_body(view, from, to, open == 1 ? MAX_BODY_BREADTH_M : MAX_PAIR_BREADTH_M))
            mark_candidate(map, scan, view, from, to);
    }
}

void cairn_place_map_add_observer(cairn_place_map *map, int32_t place, cairn_pose map_place)
{
    map->observing_places[map->observer_count] = place;
    map->observer_map[map->observer_count++] = cairn_transform_of(cairn_pose_inverse(map_place));
}

/* Finds the other places of the component of the visited scan's place, and starts with its points in
 * the map. */
static void begin_classification(cairn_place_map *map)
{
    const place_map_place_scan *scan = &map->scans[map->visit.scan];
    const place_map_place *here = &map->places[scan->place];

    map->observer_count = 0;
    for (int32_t k = 0; k < map->place_count; k++)
        if (k != scan->place && map->places[k].component == here->component)
            cairn_place_map_add_observer(map, k, map->places[k].map_place);
    cairn_place_map_begin_points(map, here->map_place);
}

/* Returns the number of observing places with a surface at a point, less those with free space. */
static int32_t balance_of(const cairn_place_map *map, cairn_vec2 map_point)
{
    int32_t balance = 0;

    for (int32_t k = 0; k < map->observer_count; k++) {
        const uint8_t *grid = grid_of(map, map->observing_places[k]);
        int32_t cell = cell_of(map, cairn_transform_point(map->observer_map[k], map_point));

        if (cell >= 0 && grid[cell] == PLACE_MAP_VISIBILITY_FREE)
            balance--;
        else if (cell >= 0 && grid[cell] >= PLACE_MAP_VISIBILITY_ROUGH)
            balance++;
    }
    return balance;
}

/* Classifies the next points of the scan. */
static void classify_points(cairn_place_map *map)
{
    struct place_map_visit *visit = &map->visit;

    for (int32_t end = visit->item + cairn_place_map_next_items(map); visit->item < end;
         visit->item++) {
        uint8_t *point_class = &map->point_class[visit->item];
        int32_t candidate = *point_class & PLACE_MAP_POINT_DYNAMIC_CANDIDATE,
                least = map->submaps_found && candidate ? 1 : 0;
        int is_invalidated =
            balance_of(map, cairn_transform_point(visit->transform,
                                                  map->points[visit->item].position)) < least;

        *point_class = (uint8_t)(candidate | (is_invalidated ? PLACE_MAP_POINT_INVALIDATED : 0));
    }
}

int cairn_place_map_classify(cairn_place_map *map, cairn_budget *budget)
{
    struct place_map_visit *visit = &map->visit;

    CAIRN_STEP_BEGIN(map->resume.phase);
    for (visit->scan = 0; visit->scan < map->scan_count; visit->scan++) {
        CAIRN_STEP_CHARGE(map, resume.phase, budget, 1 + map->place_count);
        begin_classification(map);
        while (visit->item < visit->end) {
            CAIRN_STEP_CHARGE(map, resume.phase, budget,
                              cairn_place_map_next_items(map) * map->place_count / PLACES_PER_UNIT);
            classify_points(map);
        }
    }
    CAIRN_STEP_END(map->resume.phase);
}
