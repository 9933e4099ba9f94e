/* place_map: what places saw, by cells, and what two of them say for a relative pose.
 *
 * A beam clears the cells that it crosses up to a margin before its end; cells within the margin of a hit are surface, with
 * the direction of the nearest line where there is one. A point of another place on a surface of its direction speaks for
 * the pose, one in a cell that was seen free against it: that is what tells true from false hypotheses of little
 * overlap, as walls cannot stand where another scan saw through. What a point weighs follows a logistic regression of right
 * against wrong hypotheses in simulated arenas, bare, with tilted scans and with people: walls lie on walls by chance, small
 * bodies less often, and rough surfaces hardly ever; small bodies may have walked away in the meantime. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/place_map_work.h"

enum { MOST_CELLS = 4096, CELLS_TO_UNIT = 16, POINTS_TO_UNIT = 32 };

/* Surfaces agree when their directions differ by less than this cosine and half a bin. */
static const cairn_real LEAST_COSINE = CAIRN_REAL(-0.2);
/* Neighbouring beams that end farther apart in depth than this, m, are on different surfaces. */
static const cairn_real JUMP = CAIRN_REAL(0.15);
/* What is no broader than this, m, may be a body that walks. */
static const cairn_real BODY = CAIRN_REAL(0.6);
/* A hit with no evenly spaced point so near, m, is on a rough surface. */
static const cairn_real ROUGH = CAIRN_REAL(0.12);
/* An evenly spaced point belongs to the beams that end so near, m. */
static const cairn_real NEAR = CAIRN_REAL(0.08);

int32_t cairn_place_map_side(const cairn_place_map_params *params)
{
    int32_t half = cairn_real_to_int(cairn_ceil(params->sight_reach / params->sight_cell));

    return half >= 1 && half <= MOST_CELLS / 2 ? 2 * half : 0;
}

/* Index of the cell of a point in the place's frame; -1: beyond the reach. */
static int32_t cell_of(const cairn_place_map *map, cairn_vec2 p)
{
    cairn_real by = 1 / map->params.sight_cell, half = (cairn_real)map->side / 2;
    int32_t x = cairn_real_to_int(cairn_floor(p.x * by + half)), y = cairn_real_to_int(cairn_floor(p.y * by + half));

    return x < 0 || y < 0 || x >= map->side || y >= map->side ? -1 : y * map->side + x;
}

static uint8_t *sight_of(const cairn_place_map *map, int32_t place)
{
    return map->sight + (size_t)place * (size_t)map->side * (size_t)map->side;
}

static void clear_beam(cairn_place_map *map, int32_t place, const cairn_beam *beam)
{
    uint8_t *sight = sight_of(map, place);
    cairn_vec2 along = cairn_vec2_sub(beam->to, beam->from), unit = cairn_vec2_unit(along);
    cairn_real step = map->params.sight_cell * CAIRN_REAL(0.7);
    cairn_real end = cairn_min(cairn_vec2_norm(along) - map->params.sight_margin, 2 * map->params.sight_reach);
    int32_t steps = cairn_real_to_int(cairn_ceil(end / step));

    for (int32_t k = 0; k < steps; k++) {
        int32_t cell = cell_of(map, cairn_vec2_add(beam->from, cairn_vec2_scale(unit, (cairn_real)k * step)));

        if (cell >= 0 && sight[cell] == CAIRN_SIGHT_UNKNOWN)
            sight[cell] = CAIRN_SIGHT_FREE;
    }
    map->debt += steps / CELLS_TO_UNIT;
}

/* Cells within the margin of p become `value`, unless they are more than that already. */
static void mark_surface(cairn_place_map *map, int32_t place, cairn_vec2 p, uint8_t value)
{
    uint8_t *sight = sight_of(map, place);
    cairn_real cell = map->params.sight_cell, margin = map->params.sight_margin;
    int32_t reach = cairn_real_to_int(cairn_ceil(margin / cell));

    for (int32_t j = -reach; j <= reach; j++)
        for (int32_t i = -reach; i <= reach; i++) {
            cairn_vec2 off = {(cairn_real)i * cell, (cairn_real)j * cell};
            int32_t at = cell_of(map, cairn_vec2_add(p, off));

            if (at >= 0 && cairn_vec2_norm_squared(off) <= margin * margin && sight[at] < CAIRN_SIGHT_DIRECTION)
                sight[at] = value;
        }
    map->debt += 1 + (2 * reach + 1) * (2 * reach + 1) / CELLS_TO_UNIT;
}

static uint8_t code_of(const cairn_place_map *map, cairn_vec2 direction)
{
    int32_t best = 0;

    for (int32_t k = 1; k < CAIRN_SIGHT_DIRECTIONS; k++)
        if (cairn_vec2_dot(map->directions[k], direction) > cairn_vec2_dot(map->directions[best], direction))
            best = k;
    return (uint8_t)(CAIRN_SIGHT_DIRECTION + best);
}

static cairn_beam placed_beam(cairn_transform transform, cairn_beam beam)
{
    beam.from = cairn_transform_point(transform, beam.from);
    beam.to = cairn_transform_point(transform, beam.to);
    return beam;
}

/* 1 when a hit, in the frame of its scan, belongs to a surface that has points: only others are rough. */
static int has_point_near(cairn_place_map *map, const cairn_place_scan *scan, cairn_vec2 hit)
{
    const cairn_oriented_point *points = &map->points[scan->first_point];

    map->debt += 1 + scan->point_count / POINTS_TO_UNIT;
    for (int32_t i = 0; i < scan->point_count; i++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(points[i].position, hit)) < ROUGH * ROUGH)
            return 1;
    return 0;
}

/* Items: all beams clear, then all points mark, then all hits mark that have no point near them. */
int32_t cairn_place_map_see(cairn_place_map *map, int32_t place, int32_t item)
{
    const cairn_place *here = &map->places[place];
    int32_t pass = item < here->beam_count ? 0 : item < here->beam_count + here->point_count ? 1 : 2;
    int32_t index = item - (pass > 0 ? here->beam_count : 0) - (pass > 1 ? here->point_count : 0);
    int32_t s = here->first_scan;
    cairn_transform transform;

    if (pass == 2 && index >= here->beam_count)
        return 0;
    for (; index >= (pass == 1 ? map->scans[s].point_count : map->scans[s].beam_count); s++)
        index -= pass == 1 ? map->scans[s].point_count : map->scans[s].beam_count;
    transform = cairn_transform_of(map->scans[s].place_scan);
    if (pass == 1) {
        const cairn_oriented_point *point = &map->points[map->scans[s].first_point + index];

        mark_surface(map, place, cairn_transform_point(transform, point->position),
                     code_of(map, cairn_transform_direction(transform, point->direction)));
    } else {
        cairn_beam in_scan = map->beams[map->scans[s].first_beam + index], beam = placed_beam(transform, in_scan);

        if (pass == 0 && beam.kind != CAIRN_BEAM_UNKNOWN)
            clear_beam(map, place, &beam);
        if (pass == 2 && beam.kind == CAIRN_BEAM_HIT && !has_point_near(map, &map->scans[s], in_scan.to))
            mark_surface(map, place, beam.to, CAIRN_SIGHT_SURFACE);
    }
    map->debt++;
    return 1;
}

/* Nats of the points of one place in the sight of another. */
static cairn_real half_evidence(const cairn_place_map *map, int32_t seer, int32_t seen, cairn_pose seer_seen)
{
    const uint8_t *sight = sight_of(map, seer);
    const cairn_place *place = &map->places[seen];
    cairn_real evidence = 0;

    for (int32_t s = place->first_scan; s < place->first_scan + place->scan_count; s++) {
        const cairn_oriented_point *points = &map->points[map->scans[s].first_point];
        const uint8_t *doubt = &map->doubt[map->scans[s].first_point];
        cairn_transform transform = cairn_transform_of(cairn_pose_compose(seer_seen, map->scans[s].place_scan));

        for (int32_t i = 0; i < map->scans[s].point_count; i++) {
            int32_t cell = cell_of(map, cairn_transform_point(transform, points[i].position));
            uint8_t code = cell >= 0 ? sight[cell] : CAIRN_SIGHT_UNKNOWN;
            cairn_vec2 direction = cairn_transform_direction(transform, points[i].direction);

            if (doubt[i] >= CAIRN_POINT_SUSPECT)
                continue;
            if (code == CAIRN_SIGHT_FREE)
                evidence -= map->params.against_point * (doubt[i] == CAIRN_POINT_FLOATING ? map->params.floating : 1);
            else if (code == CAIRN_SIGHT_SURFACE)
                evidence += map->params.for_rough;
            else if (code >= CAIRN_SIGHT_DIRECTION && doubt[i] == CAIRN_POINT_FLOATING)
                evidence += map->params.for_floating;
            else if (code >= CAIRN_SIGHT_DIRECTION &&
                     cairn_vec2_dot(map->directions[code - CAIRN_SIGHT_DIRECTION], direction) > LEAST_COSINE)
                evidence += map->params.for_point;
        }
    }
    return evidence;
}

cairn_real cairn_place_map_evidence(const cairn_place_map *map, int32_t first, int32_t second, cairn_pose first_second)
{
    return half_evidence(map, first, second, first_second) +
           half_evidence(map, second, first, cairn_pose_inverse(first_second));
}

/* ---- Doubt ---- */

/* m; -1: nothing was hit. */
static cairn_real range_of(const cairn_beam *beam)
{
    return beam->kind == CAIRN_BEAM_HIT ? cairn_vec2_norm(cairn_vec2_sub(beam->to, beam->from)) : -1;
}

/* 1 when the beam beside a run shows free space behind it. */
static int is_open_beside(const cairn_scan_view *view, int32_t beside, cairn_real range)
{
    if (beside < 0 || beside >= view->beam_count)
        return 0;
    return view->beams[beside].kind == CAIRN_BEAM_FREE || range_of(&view->beams[beside]) > range + JUMP;
}

/* 1 when the hits of a run, beams [from, to), all lie within a body's breadth of the first. */
static int is_compact(const cairn_scan_view *view, int32_t from, int32_t to)
{
    for (int32_t b = from + 1; b < to; b++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(view->beams[b].to, view->beams[from].to)) > BODY * BODY)
            return 0;
    return 1;
}

static void doubt_run(cairn_place_map *map, const cairn_place_scan *scan, const cairn_scan_view *view, int32_t from,
                      int32_t to)
{
    for (int32_t i = 0; i < view->point_count; i++)
        for (int32_t b = from; b < to; b++)
            if (cairn_vec2_norm_squared(cairn_vec2_sub(view->beams[b].to, view->points[i].position)) < NEAR * NEAR)
                map->doubt[scan->first_point + i] = CAIRN_POINT_FLOATING;
}

void cairn_place_map_find_floating(cairn_place_map *map, const cairn_place_scan *scan, const cairn_scan_view *view)
{
    memset(map->doubt + scan->first_point, CAIRN_POINT_SOUND, (size_t)view->point_count);
    for (int32_t from = 0, to; from < view->beam_count; from = to) {
        cairn_real range = range_of(&view->beams[from]), last = range;
        int32_t open;

        for (to = from + 1; to < view->beam_count; to++) {
            cairn_real next = range_of(&view->beams[to]);

            if (last < 0 || next < 0 || cairn_abs(next - last) > JUMP)
                break;
            last = next;
        }
        if (range < 0)
            continue;
        open = is_open_beside(view, from - 1, range) + is_open_beside(view, to, last);
        if (open == 2 || (open == 1 && is_compact(view, from, to)))
            doubt_run(map, scan, view, from, to);
    }
}

/* How many other places of the part see a point as surface, less those that see free space there. */
static int32_t balance_of(const cairn_place_map *map, int32_t place, cairn_vec2 map_point)
{
    int32_t balance = 0;

    for (int32_t k = 0; k < map->place_count; k++) {
        int32_t cell;

        if (k == place || map->places[k].part != map->places[place].part)
            continue;
        cell = cell_of(
            map, cairn_transform_point(cairn_transform_of(cairn_pose_inverse(map->places[k].map_place)), map_point));
        if (cell >= 0 && sight_of(map, k)[cell] != CAIRN_SIGHT_UNKNOWN)
            balance += sight_of(map, k)[cell] == CAIRN_SIGHT_FREE ? -1 : 1;
    }
    return balance;
}

void cairn_place_map_doubt(cairn_place_map *map, int32_t place)
{
    const cairn_place *here = &map->places[place];

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++) {
        const cairn_place_scan *scan = &map->scans[s];
        cairn_transform transform = cairn_transform_of(cairn_pose_compose(here->map_place, scan->place_scan));

        for (int32_t i = 0; i < scan->point_count; i++) {
            const cairn_oriented_point *point = &map->points[scan->first_point + i];
            uint8_t *doubt = &map->doubt[scan->first_point + i];
            int is_suspect = balance_of(map, place, cairn_transform_point(transform, point->position)) < 0;

            *doubt = (uint8_t)((*doubt & CAIRN_POINT_FLOATING) | (is_suspect ? CAIRN_POINT_SUSPECT : 0));
        }
    }
    map->debt += 1 + here->point_count * map->place_count / 2;
}
