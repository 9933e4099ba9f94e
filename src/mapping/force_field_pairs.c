/* The pairs of a force field: who is near whom, and how they pull.
 *
 * Method: the boxes of all lines, grown by half the reach each, are swept (Adluru 2008, section 7.3.5); a line is a segment
 * of a scan or a run of points from outside. Points of two near lines of different scans are loaded in tiles, the points of
 * the one against tiles of the other. Only the force of each point of the first line is formed: as each pair pulls along
 * the line through its two points, the other scan gets the same force and torque with the opposite sign.
 *
 * Layout: lines are numbered as their boxes, runs first. Two tiles, kept from pair to pair where they serve again.
 *
 * Source: Adluru 2008, sections 7.3.1 and 7.3.5. */
#include "src/core/build.h"

#include "src/core/budget_pay.h"
#include "src/mapping/force_field_iteration.h"

enum { NOBODY = -1 };

/* A line, whatever it is of. */
struct line {
    int32_t scan; /* NOBODY: from outside */
    int32_t count;
    int32_t segment; /* below 0: a run */
    cairn_vec2 direction;
};

static struct line line_of(const cairn_force_field *field, int32_t index)
{
    const struct cairn_force_extra *extra = &field->extra[field->extra_front];
    struct line line;

    line.segment = index - extra->runs;
    if (line.segment < 0) {
        line.scan = NOBODY;
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

void cairn_force_points(const cairn_force_field *field, int32_t segment, int32_t first, int32_t count,
                        cairn_vec2 *points)
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

int32_t cairn_force_tile_cost(const cairn_force_field *field, int32_t left)
{
    int32_t points = left < CAIRN_FORCE_STRIP ? left : CAIRN_FORCE_STRIP;

    return 1 + points / (field->position != NULL ? 8 : 4);
}

/* The mass of a point of a scan in the forces (section 7.3.4). */
static cairn_real mass_of(const cairn_force_field *field, int32_t point)
{
    cairn_real mass = field->set->mass != NULL ? field->set->mass[point] : 1;

    if (field->in_region != NULL && field->in_region[point / 32] >> point % 32 & 1)
        mass *= field->params.roi_mass;
    return mass;
}

static void load_points(const cairn_force_field *field, const struct line *line, struct cairn_force_tile *tile)
{
    cairn_vec2 points[CAIRN_FORCE_STRIP];
    int32_t from = 0;

    if (line->segment < 0) {
        const struct cairn_force_extra *extra = &field->extra[field->extra_front];

        from = extra->first[tile->line] + tile->first;
        for (int32_t i = 0; i < tile->strip.count; i++) {
            points[i] = extra->position[from + i];
            tile->strip.mass[i] = extra->weight[from + i];
        }
    } else {
        cairn_force_points(field, line->segment, tile->first, tile->strip.count, points);
        from = field->set->segments[line->segment].first_point + tile->first;
        for (int32_t i = 0; i < tile->strip.count; i++)
            tile->strip.mass[i] = mass_of(field, from + i);
    }
    tile->box = cairn_box_empty();
    for (int32_t i = 0; i < tile->strip.count; i++) {
        tile->strip.x[i] = points[i].x;
        tile->strip.y[i] = points[i].y;
        tile->box.min.x = cairn_min(tile->box.min.x, points[i].x);
        tile->box.min.y = cairn_min(tile->box.min.y, points[i].y);
        tile->box.max.x = cairn_max(tile->box.max.x, points[i].x);
        tile->box.max.y = cairn_max(tile->box.max.y, points[i].y);
    }
}

static void load_tile(const cairn_force_field *field, const struct line *line, int32_t index, int32_t first,
                      struct cairn_force_tile *tile)
{
    int32_t left = line->count - first;

    tile->line = index;
    tile->first = first;
    tile->strip.count = left < CAIRN_FORCE_STRIP ? left : CAIRN_FORCE_STRIP;
    load_points(field, line, tile);
}

/* A little more than the squared distance beyond which no point of a tile is within reach. */
static cairn_real far_squared(const cairn_force_field *field)
{
    return 4 * field->margin * field->margin;
}

static cairn_real gap(cairn_real low, cairn_real high, cairn_real other_low, cairn_real other_high)
{
    return cairn_max(cairn_max(other_low - high, low - other_high), 0);
}

static int is_far(const cairn_force_field *field, const cairn_box *a, const cairn_box *b)
{
    cairn_real x = gap(a->min.x, a->max.x, b->min.x, b->max.x), y = gap(a->min.y, a->max.y, b->min.y, b->max.y);

    return x * x + y * y > far_squared(field);
}

static int is_far_from(const cairn_force_field *field, cairn_vec2 p, const cairn_box *box)
{
    cairn_real x = gap(p.x, p.x, box->min.x, box->max.x), y = gap(p.y, p.y, box->min.y, box->max.y);

    return x * x + y * y > far_squared(field);
}

/* ---- Pairs of lines ---- */

static int is_dirty(const cairn_force_field *field, int32_t scan)
{
    return scan != NOBODY && field->bodies[scan].dirty;
}

static int is_fixed(const cairn_force_field *field, int32_t scan)
{
    return scan == NOBODY || field->bodies[scan].is_fixed;
}

/* 1 when two lines attract each other. */
static int do_attract(const cairn_force_field *field, const struct line *a, const struct line *b)
{
    return a->scan != b->scan && a->count > 0 && b->count > 0 &&
           !(is_fixed(field, a->scan) && is_fixed(field, b->scan));
}

static void begin_pair(cairn_force_field *field, int32_t first, int32_t second)
{
    struct line a = line_of(field, first), b = line_of(field, second);
    struct cairn_force_pair *pair = &field->pair;

    if (!do_attract(field, &a, &b) || !(is_dirty(field, a.scan) || is_dirty(field, b.scan)))
        return;
    pair->first = first;
    pair->second = second;
    pair->tile[0] = pair->tile[1] = 0;
    pair->loaded = 0;
    pair->row = 0;
    pair->next = -1;
    pair->cosine = cairn_abs(cairn_vec2_dot(a.direction, b.direction));
    pair->centre = field->bodies[b.scan].centre;
    pair->pull.x = pair->pull.y = 0;
    pair->pull.potential = 0;
    pair->pull.pairs = 0;
    pair->force.x = pair->force.y = 0;
    pair->torque = 0;
    pair->potential = 0;
    pair->pairs = 0;
}

/* Adds what a pair of lines has summed up to one of its two scans. sign: of its force. */
static void add_to_scan(cairn_force_field *field, int32_t scan, cairn_real sign, int32_t other)
{
    const struct cairn_force_pair *pair = &field->pair;
    struct cairn_force_body *body = &field->bodies[scan];
    cairn_vec2 force = cairn_vec2_scale(pair->force, sign);
    /* Pairs are counted by both scans; what pairs with points from outside, by the one. */
    int32_t shares = other == NOBODY ? 2 : 1;

    body->force = cairn_vec2_add(body->force, force);
    body->torque += sign * pair->torque + cairn_vec2_cross(cairn_vec2_sub(pair->centre, body->centre), force);
    body->potential += (cairn_real)shares * pair->potential;
    body->pairs += shares * pair->pairs;
    body->segment_pairs += shares;
}

static void end_pair(cairn_force_field *field)
{
    struct line a = line_of(field, field->pair.first), b = line_of(field, field->pair.second);

    if (is_dirty(field, a.scan))
        add_to_scan(field, a.scan, 1, b.scan);
    if (is_dirty(field, b.scan))
        add_to_scan(field, b.scan, -1, a.scan);
    field->pair.second = -1;
}

/* Loads what the pair needs of its two tiles, each where it may already be; 0 when the budget is used up. */
static int load_tiles(cairn_force_field *field, cairn_budget *budget)
{
    struct cairn_force_pair *pair = &field->pair;

    for (; pair->loaded < 2; pair->loaded++) {
        int32_t index = pair->loaded == 0 ? pair->first : pair->second, first = pair->tile[pair->loaded];
        struct cairn_force_tile *tile = &field->tiles[pair->loaded];
        struct line line = line_of(field, index);
        int is_there = tile->line == index && tile->first == first;
        int32_t cost = is_there ? 1 : cairn_force_tile_cost(field, line.count - first);

        if (!cairn_budget_pay(budget, &field->paid, cost))
            return 0;
        if (!is_there)
            load_tile(field, &line, index, first, tile);
    }
    return 1;
}

/* The force of one point of the first tile is complete as far as the second tile goes. */
static void end_row(cairn_force_field *field, cairn_vec2 p)
{
    struct cairn_force_pair *pair = &field->pair;
    cairn_real weight = field->tiles[0].strip.mass[pair->row] * pair->cosine;
    cairn_real strength = weight * field->kernel.norm;
    cairn_vec2 force = {strength * pair->pull.x, strength * pair->pull.y};

    pair->force = cairn_vec2_add(pair->force, force);
    pair->torque += cairn_vec2_cross(cairn_vec2_sub(p, pair->centre), force);
    pair->potential -= weight / 2 * pair->pull.potential;
    pair->pairs += pair->pull.pairs;
    pair->pull.x = pair->pull.y = 0;
    pair->pull.potential = 0;
    pair->pull.pairs = 0;
}

/* All points of the first tile against the second. */
static cairn_status step_rows(cairn_force_field *field, cairn_budget *budget)
{
    const struct cairn_force_tile *a = &field->tiles[0], *b = &field->tiles[1];
    struct cairn_force_pair *pair = &field->pair;

    if (pair->row == 0 && pair->next < 0 && is_far(field, &a->box, &b->box))
        return CAIRN_OK;
    for (; pair->row < a->strip.count; pair->row++, pair->next = -1) {
        cairn_vec2 p = {a->strip.x[pair->row], a->strip.y[pair->row]};
        cairn_status status;

        if (pair->next < 0 && is_far_from(field, p, &b->box)) {
            if (!cairn_budget_pay(budget, &field->paid, 1))
                return CAIRN_MORE;
            continue;
        }
        status = cairn_force_kernel_pull(&field->kernel, p, &b->strip, &pair->next, field->params.potential,
                                         &pair->pull, budget);
        if (status != CAIRN_OK)
            return status;
        end_row(field, p);
    }
    return CAIRN_OK;
}

/* Goes on to the next two tiles; 0 when there are none. */
static int next_tiles(cairn_force_field *field)
{
    struct cairn_force_pair *pair = &field->pair;

    pair->row = 0;
    pair->next = -1;
    pair->loaded = 0;
    pair->tile[1] += CAIRN_FORCE_STRIP;
    if (pair->tile[1] < line_of(field, pair->second).count)
        return 1;
    pair->tile[1] = 0;
    pair->tile[0] += CAIRN_FORCE_STRIP;
    return pair->tile[0] < line_of(field, pair->first).count;
}

static cairn_status step_pair(cairn_force_field *field, cairn_budget *budget)
{
    do {
        cairn_status status;

        if (!load_tiles(field, budget))
            return CAIRN_MORE;
        status = step_rows(field, budget);
        if (status != CAIRN_OK)
            return status;
    } while (next_tiles(field));
    end_pair(field);
    return CAIRN_OK;
}

cairn_status cairn_force_pairs(cairn_force_field *field, cairn_budget *budget)
{
    for (;;) {
        int32_t first, second;
        cairn_status status;

        if (field->pair.second >= 0) {
            status = step_pair(field, budget);
            if (status != CAIRN_OK)
                return status;
        }
        status = cairn_box_sweep_next(field->sweep, budget, &first, &second);
        if (status != CAIRN_OK)
            return status == CAIRN_EMPTY ? CAIRN_OK : status;
        begin_pair(field, first, second);
    }
}

cairn_status cairn_force_mark(cairn_force_field *field, cairn_budget *budget)
{
    for (;;) {
        int32_t first, second, a, b;
        cairn_status status = cairn_box_sweep_next(field->sweep, budget, &first, &second);

        if (status != CAIRN_OK)
            return status == CAIRN_EMPTY ? CAIRN_OK : status;
        a = line_of(field, first).scan;
        b = line_of(field, second).scan;
        if (a == NOBODY || b == NOBODY)
            continue;
        field->bodies[a].dirty |= field->bodies[b].moved;
        field->bodies[b].dirty |= field->bodies[a].moved;
    }
}

/* ---- Readers ---- */

/* What the points of a line do to a point of mass 1 and parallel direction. */
static cairn_force_pull pull_of(const cairn_force_field *field, int32_t index, cairn_vec2 point)
{
    struct line line = line_of(field, index);
    cairn_force_pull pull = {0, 0, 0, 0};

    for (int32_t first = 0; first < line.count; first += CAIRN_FORCE_STRIP) {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        struct cairn_force_tile tile;
        cairn_status status;
        int32_t next = -1;

        load_tile(field, &line, index, first, &tile);
        status = cairn_force_kernel_pull(&field->kernel, point, &tile.strip, &next, 0, &pull, &budget);
        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    return pull;
}

cairn_vec2 cairn_force_at(const cairn_force_field *field, int32_t segment, int32_t index, cairn_real *mass)
{
    int32_t self = field->extra[field->extra_front].runs + segment;
    struct line line = line_of(field, self);
    cairn_vec2 point, force = {0, 0};
    cairn_box box;

    cairn_force_points(field, segment, index, 1, &point);
    *mass = mass_of(field, field->set->segments[segment].first_point + index);
    box.min = box.max = point;
    box = cairn_box_grow(box, field->margin);
    for (int32_t i = 0; i < self + field->placed_segments - segment; i++) {
        struct line other = line_of(field, i);

        if (do_attract(field, &line, &other) && cairn_box_overlap(box, field->boxes[i])) {
            cairn_force_pull pull = pull_of(field, i, point);
            cairn_real strength =
                *mass * cairn_abs(cairn_vec2_dot(line.direction, other.direction)) * field->kernel.norm;

            force.x += strength * pull.x;
            force.y += strength * pull.y;
        }
    }
    return force;
}
