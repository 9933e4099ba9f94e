/* Pairs of lines of a force field: neighbour search and forces.
 *
 * Method.
 *
 * 1. The boxes of all lines, grown by half the reach each, are swept (sweep and prune; Adluru 2008,
 *    section 7.3.5). A line is a segment of a scan or a run of external points.
 * 2. Points of two near lines of different scans are processed in tiles, each tile of one line
 *    against each of the other.
 * 3. Only the sum of the forces on the first line is computed. A pair's force acts along the line
 *    through its points, so the other scan gets the same force and torque with the opposite sign.
 *
 * Layout: lines are numbered like their boxes, runs first. Two tiles are reused from pair to pair.
 * A tile refers to points in the map or holds points generated on demand.
 *
 * Source: Adluru 2008, sections 7.3.1 and 7.3.5. */
#include "src/base/build.h"

#include <string.h>

#include "src/fields/force_field_iteration.h"

/* work units: of a pair that is found and skipped, of a pair that is summed, besides its tiles, and
 * of a tile that is loaded */
enum { FOUND_UNITS = 2, PAIR_UNITS = 7, TILE_UNITS = 2 };

static inline struct cairn_force_field_line line_of(const cairn_force_field *field, int32_t index)
{
    const struct cairn_force_field_extra *extra = &field->extra[field->extra_front];
    struct cairn_force_field_line line;

    line.index = index;
    line.segment = index - extra->runs;
    if (line.segment < 0) {
        line.scan = FORCE_FIELD_NO_SCAN;
        line.count = extra->first[index + 1] - extra->first[index];
        line.direction = extra->direction[index];
    } else {
        const cairn_scan_set_segment *segment = &field->set->segments[line.segment];

        line.scan = segment->scan;
        line.count = segment->end_point - segment->first_point;
        line.direction = field->directions[line.segment];
    }
    return line;
}

/* ---- Tiles ---- */

void cairn_force_field_points(const cairn_force_field *field, int32_t segment, int32_t first,
                              int32_t count, cairn_vec2 *points)
{
    const cairn_scan_set_segment *from = &field->set->segments[segment];
    cairn_transform transform;

    if (field->position != NULL) {
        for (int32_t i = 0; i < count; i++)
            points[i] = field->position[from->first_point + first + i];
        return;
    }
    transform = field->bodies[from->scan].transform;
    cairn_scan_set_read(field->set, segment, first, count, points);
    for (int32_t i = 0; i < count; i++)
        points[i] = cairn_transform_point(transform, points[i]);
}

/* Returns the units for the tile of a line that begins at its point `first`: points may have to be
 * generated and boxed. */
static int32_t tile_cost(const cairn_force_field *field, const struct cairn_force_field_line *line,
                         int32_t first)
{
    int32_t left = line->count - first,
            points = left < CAIRN_FORCE_STRIP_POINTS ? left : CAIRN_FORCE_STRIP_POINTS;
    int32_t is_long = line->count > CAIRN_FORCE_STRIP_POINTS;

    return TILE_UNITS + (field->position != NULL ? 0 : points / 4) + (is_long ? points / 4 : 0);
}

/* Returns the mass of a scan's point in the forces (section 7.3.4). */
static cairn_real mass_of(const cairn_force_field *field, int32_t point)
{
    if (field->mass != NULL)
        return field->mass[point];
    if (field->in_region != NULL && field->in_region[point / 32] >> point % 32 & 1)
        return field->params.roi_mass;
    return 1;
}

/* Generates the points of a tile of a segment. */
static void make_points(const cairn_force_field *field, const struct cairn_force_field_line *line,
                        struct cairn_force_field_tile *tile)
{
    int32_t from = field->set->segments[line->segment].first_point + tile->first;

    cairn_force_field_points(field, line->segment, tile->first, tile->strip.count, tile->position);
    for (int32_t i = 0; i < tile->strip.count; i++)
        tile->mass[i] = mass_of(field, from + i);
    tile->strip.position = tile->position;
    tile->strip.mass = tile->mass;
}

static void find_points(const cairn_force_field *field, const struct cairn_force_field_line *line,
                        struct cairn_force_field_tile *tile)
{
    const struct cairn_force_field_extra *extra = &field->extra[field->extra_front];

    if (line->segment < 0) {
        tile->strip.position = extra->position + extra->first[line->index] + tile->first;
        tile->strip.mass = extra->weight + extra->first[line->index] + tile->first;
    } else if (field->position != NULL) {
        int32_t from = field->set->segments[line->segment].first_point + tile->first;

        tile->strip.position = field->position + from;
        tile->strip.mass = field->mass + from;
    } else {
        make_points(field, line, tile);
    }
}

/* Inline, see force_field_iteration.c. */
static inline cairn_box grown(cairn_box box, cairn_real by)
{
    cairn_box larger = {{box.min.x - by, box.min.y - by}, {box.max.x + by, box.max.y + by}};
    return larger;
}

static void load_tile(const cairn_force_field *field, const struct cairn_force_field_line *line,
                      int32_t first, struct cairn_force_field_tile *tile)
{
    int32_t left = line->count - first;
    cairn_box box;

    tile->line = line->index;
    tile->first = first;
    tile->strip.count = left < CAIRN_FORCE_STRIP_POINTS ? left : CAIRN_FORCE_STRIP_POINTS;
    find_points(field, line, tile);
    tile->strip.reach_box = grown(field->boxes[line->index], field->margin);
    if (line->count <= CAIRN_FORCE_STRIP_POINTS)
        return;
    box.min = box.max = tile->strip.position[0];
    for (int32_t i = 1; i < tile->strip.count; i++) {
        box.min.x = cairn_min(box.min.x, tile->strip.position[i].x);
        box.min.y = cairn_min(box.min.y, tile->strip.position[i].y);
        box.max.x = cairn_max(box.max.x, tile->strip.position[i].x);
        box.max.y = cairn_max(box.max.y, tile->strip.position[i].y);
    }
    tile->box = box;
    tile->strip.reach_box = grown(box, 2 * field->margin);
}

/* ---- Pairs of lines ---- */

static int is_dirty(const cairn_force_field *field, int32_t scan)
{
    return scan != FORCE_FIELD_NO_SCAN && field->bodies[scan].dirty;
}

static int is_fixed(const cairn_force_field *field, int32_t scan)
{
    return scan == FORCE_FIELD_NO_SCAN || field->bodies[scan].is_fixed;
}

/* Returns 1 when two lines attract each other. */
static inline int can_attract(const cairn_force_field *field,
                              const struct cairn_force_field_line *a,
                              const struct cairn_force_field_line *b)
{
    return a->scan != b->scan && a->count > 0 && b->count > 0 &&
           !(is_fixed(field, a->scan) && is_fixed(field, b->scan));
}

/* Returns 1 when directions are oriented: the faces of a wall are distinguished. */
static int uses_orientation(const cairn_force_field *field)
{
    return field->sigma <= field->params.oriented_below;
}

/* Returns the direction factor of two lines: |cos|, or max(0, cos) when oriented. */
static cairn_real direction_factor(const cairn_force_field *field,
                                   const struct cairn_force_field_line *a,
                                   const struct cairn_force_field_line *b)
{
    cairn_real cosine = cairn_vec2_dot(a->direction, b->direction);

    return uses_orientation(field) ? cairn_max(cosine, 0) : cairn_abs(cosine);
}

/* 1 when the current pair of lines has forces to be computed; sets its direction factor. */
static int has_forces(cairn_force_field *field)
{
    const struct cairn_force_field_line *a = &field->pair.line[0], *b = &field->pair.line[1];

    if (!can_attract(field, a, b) || !(is_dirty(field, a->scan) || is_dirty(field, b->scan)))
        return 0;
    field->pair.cosine = direction_factor(field, a, b);
    /* The faces of opposite sides have none. */
    return field->pair.cosine != 0 || !uses_orientation(field);
}

/* Begins the sum of the current pair of lines. */
static void begin_sum(cairn_force_field *field)
{
    struct cairn_force_field_pair *pair = &field->pair;

    memset(&pair->sum, 0, sizeof pair->sum);
    if (force_field_has_springs(field)) {
        memset(&pair->springs, 0, sizeof pair->springs);
        pair->sum.springs = &pair->springs;
    }
    /* Runs come first: the second line is a segment. */
    pair->sum.centre = field->bodies[pair->line[1].scan].centre;
}

/* Adds the sum of a pair of lines to one of its two scans; sign: of its force. */
static void add_to_scan(cairn_force_field *field, int32_t scan, cairn_real sign, int32_t other)
{
    const struct cairn_force_field_pair *pair = &field->pair;
    struct cairn_force_field_body *body = &field->bodies[scan];
    cairn_real strength = pair->cosine * field->kernel.norm * sign;
    cairn_vec2 force = cairn_vec2_scale(pair->sum.force, strength);
    /* Pairs are counted by both scans; pairs with external points by one. */
    int32_t shares = other == FORCE_FIELD_NO_SCAN ? 2 : 1;

    body->force = cairn_vec2_add(body->force, force);
    body->torque += strength * pair->sum.torque +
                    cairn_vec2_cross(cairn_vec2_sub(pair->sum.centre, body->centre), force);
    body->potential -= (cairn_real)shares * (pair->cosine / 2 * pair->sum.potential);
    body->pairs += shares * pair->sum.pairs;
    body->segment_pairs += shares;
}

/* Adds the sum of the current pair of lines to its scans. */
static void end_pair(cairn_force_field *field)
{
    int32_t a = field->pair.line[0].scan, b = field->pair.line[1].scan;

    if (is_dirty(field, a))
        add_to_scan(field, a, 1, b);
    if (is_dirty(field, b))
        add_to_scan(field, b, -1, a);
    if (force_field_has_springs(field))
        cairn_force_field_add_springs(field);
}

/* 1 when the tile of a line of the current pair is loaded. */
static int is_loaded(const cairn_force_field *field, int32_t of)
{
    return field->tiles[of].line == field->pair.line[of].index &&
           field->tiles[of].first == field->pair.tile_first[of];
}

/* Units of the tile of a line of the current pair. */
static int32_t tile_units(const cairn_force_field *field, int32_t of)
{
    return is_loaded(field, of)
               ? TILE_UNITS
               : tile_cost(field, &field->pair.line[of], field->pair.tile_first[of]);
}

/* Loads the tile of a line of the current pair. */
static void load(cairn_force_field *field, int32_t of)
{
    if (!is_loaded(field, of))
        load_tile(field, &field->pair.line[of], field->pair.tile_first[of], &field->tiles[of]);
}

static cairn_real gap(cairn_real low, cairn_real high, cairn_real other_low, cairn_real other_high)
{
    return cairn_max(cairn_max(other_low - high, low - other_high), 0);
}

/* Returns 1 when no points of the two current tiles are within reach, which is common for two long
 * lines. */
static int are_out_of_reach(const cairn_force_field *field)
{
    const struct cairn_force_field_pair *pair = &field->pair;
    const cairn_box *a = &field->tiles[0].box, *b = &field->tiles[1].box;
    cairn_real x, y;

    if (pair->line[0].count <= CAIRN_FORCE_STRIP_POINTS ||
        pair->line[1].count <= CAIRN_FORCE_STRIP_POINTS)
        return 0;
    x = gap(a->min.x, a->max.x, b->min.x, b->max.x);
    y = gap(a->min.y, a->max.y, b->min.y, b->max.y);
    return x * x + y * y > 4 * field->margin * field->margin;
}

/* Sum of the current pair of lines, tile by tile. */
static int sum_pair(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->pair_resume);
    begin_sum(field);
    for (field->pair.tile_first[0] = 0; field->pair.tile_first[0] < field->pair.line[0].count;
         field->pair.tile_first[0] += CAIRN_FORCE_STRIP_POINTS)
        for (field->pair.tile_first[1] = 0; field->pair.tile_first[1] < field->pair.line[1].count;
             field->pair.tile_first[1] += CAIRN_FORCE_STRIP_POINTS) {
            CAIRN_STEP_CHARGE(field, pair_resume, budget, tile_units(field, 0));
            load(field, 0);
            CAIRN_STEP_CHARGE(field, pair_resume, budget, tile_units(field, 1));
            load(field, 1);
            if (are_out_of_reach(field))
                continue;
            field->pair.cursor.row = 0;
            CAIRN_STEP_UNTIL(field->pair_resume,
                             cairn_force_kernel_strips(&field->kernel, &field->tiles[0].strip,
                                                       &field->tiles[1].strip, &field->pair.cursor,
                                                       field->params.potential, &field->pair.sum,
                                                       budget) == CAIRN_OK);
        }
    CAIRN_STEP_END(field->pair_resume);
}

/* Advances the sweep to the next pair of near boxes; is_found: 0 when there are no more. */
static int next_boxes(cairn_force_field *field, cairn_budget *budget, int32_t *first,
                      int32_t *second)
{
    cairn_status status = cairn_box_sweep_next(field->sweep, budget, first, second);

    field->pair.is_found = status == CAIRN_OK;
    return status != CAIRN_MORE;
}

/* Number of boxes of runs and placed segments. */
static int32_t box_count(const cairn_force_field *field)
{
    return field->extra[field->extra_front].runs + field->placed_segments;
}

/* Begins the pairs of lines in the box of the free scans. */
static void begin_pairs(cairn_force_field *field)
{
    memset(&field->pair.cursor, 0, sizeof field->pair.cursor);
    field->tiles[0].line = field->tiles[1].line = -1;
    field->bond_count = field->bonds_dropped = 0;
    cairn_must_be_ok(
        cairn_box_sweep_begin_in(field->sweep, field->boxes, box_count(field), field->free_box));
}

/* The next pair of lines. */
static int next_pair(cairn_force_field *field, cairn_budget *budget)
{
    int32_t first, second, is_done = next_boxes(field, budget, &first, &second);

    if (is_done && field->pair.is_found) {
        field->pair.line[0] = line_of(field, first);
        field->pair.line[1] = line_of(field, second);
    }
    return is_done;
}

int cairn_force_field_pairs(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    begin_pairs(field);
    for (;;) {
        CAIRN_STEP_RUN(field, phase_resume, budget, next_pair);
        if (!field->pair.is_found)
            break;
        if (!has_forces(field)) {
            CAIRN_STEP_CHARGE(field, phase_resume, budget, FOUND_UNITS);
            continue;
        }
        CAIRN_STEP_CHARGE(field, phase_resume, budget, PAIR_UNITS);
        CAIRN_STEP_RUN(field, phase_resume, budget, sum_pair);
        if (force_field_has_springs(field))
            CAIRN_STEP_CHARGE(field, phase_resume, budget,
                              cairn_force_field_add_springs_cost(field));
        end_pair(field);
    }
    CAIRN_STEP_END(field->phase_resume);
}

/* ---- Dirty scans ---- */

static int32_t scan_of(const cairn_force_field *field, int32_t line)
{
    int32_t segment = line - field->extra[field->extra_front].runs;

    return segment < 0 ? FORCE_FIELD_NO_SCAN : field->set->segments[segment].scan;
}

/* The scans of the next pair of lines. */
static int next_scans(cairn_force_field *field, cairn_budget *budget)
{
    int32_t first, second, is_done = next_boxes(field, budget, &first, &second);

    if (is_done && field->pair.is_found) {
        field->pair.line[0].scan = scan_of(field, first);
        field->pair.line[1].scan = scan_of(field, second);
    }
    return is_done;
}

/* Marks the scans of the current pair of lines, near each other. */
static void mark_pair(cairn_force_field *field)
{
    int32_t a = field->pair.line[0].scan, b = field->pair.line[1].scan;

    if (a == FORCE_FIELD_NO_SCAN || b == FORCE_FIELD_NO_SCAN)
        return;
    if (field->bodies[b].moved)
        field->bodies[a].dirty = 1;
    if (field->bodies[a].moved)
        field->bodies[b].dirty = 1;
}

int cairn_force_field_mark_dirty(cairn_force_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->phase_resume);
    cairn_must_be_ok(cairn_box_sweep_begin(field->sweep, field->boxes, box_count(field)));
    for (;;) {
        CAIRN_STEP_RUN(field, phase_resume, budget, next_scans);
        if (!field->pair.is_found)
            break;
        CAIRN_STEP_CHARGE(field, phase_resume, budget, FOUND_UNITS);
        mark_pair(field);
    }
    CAIRN_STEP_END(field->phase_resume);
}

/* ---- Readers ---- */

/* Adds the force of the points of a line on a point of a line. */
static void add_force(const cairn_force_field *field, const struct cairn_force_field_line *of,
                      const struct cairn_force_field_line *from,
                      const cairn_force_kernel_strip *point, cairn_vec2 *force)
{
    cairn_real strength = direction_factor(field, of, from) * field->kernel.norm;
    cairn_force_kernel_sum sum;

    memset(&sum, 0, sizeof sum);
    for (int32_t first = 0; first < from->count; first += CAIRN_FORCE_STRIP_POINTS) {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        struct cairn_force_field_tile tile;
        cairn_force_kernel_cursor cursor;

        memset(&cursor, 0, sizeof cursor);
        load_tile(field, from, first, &tile);
        cairn_must_be_ok(cairn_force_kernel_strips(&field->kernel, point, &tile.strip, &cursor, 0,
                                                   &sum, &budget));
    }
    force->x += strength * sum.force.x;
    force->y += strength * sum.force.y;
}

cairn_vec2 cairn_force_field_at(const cairn_force_field *field, int32_t segment, int32_t index,
                                cairn_real *mass)
{
    int32_t runs = field->extra[field->extra_front].runs;
    struct cairn_force_field_line line = line_of(field, runs + segment);
    cairn_force_kernel_strip point;
    cairn_vec2 position, force = {0, 0};
    cairn_box box;

    cairn_force_field_points(field, segment, index, 1, &position);
    *mass = mass_of(field, field->set->segments[segment].first_point + index);
    point.position = &position;
    point.mass = mass;
    point.count = 1;
    box.min = box.max = position;
    point.reach_box = box = grown(box, field->margin);
    for (int32_t i = 0; i < runs + field->placed_segments; i++) {
        struct cairn_force_field_line other = line_of(field, i);

        if (can_attract(field, &line, &other) && cairn_box_overlap(box, field->boxes[i]))
            add_force(field, &line, &other, &point, &force);
    }
    return force;
}
