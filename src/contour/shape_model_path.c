/* The longest path through the symmetry set of an arc.
 *
 * A path that has come to `low` and `high`, `gap` places apart, came from one of (low, high -
 * 1), (low + 1, high) and (low + 1, high - 1); values[gap][low] is the most that any path to it
 * is worth. Ties: both sides first, then the one that moves on. */
#include "src/core/build.h"

#include "src/contour/shape_model_work.h"

/* How the path came to a pair. */
enum { START, BOTH, UP, DOWN };

/* Of a step that one side makes alone. */
#define ALONE CAIRN_REAL(0.95)

static int32_t side_of(const cairn_shape_builder *b)
{
    return b->params.points + SHAPE_LEAST_POINTS;
}

static cairn_real *row(cairn_shape_builder *b, int32_t gap)
{
    return &b->value[(gap % 3) * side_of(b)];
}

static cairn_real gain_at(const cairn_shape_builder *b, const shape_arc *arc, int32_t low,
                          int32_t high)
{
    int32_t n = shape_points(b), first = b->first[b->at];

    return b->gain[(shape_point(b, arc, low) - first) * n + shape_point(b, arc, high) - first];
}

void cairn_shape_walk_begin(cairn_shape_builder *b)
{
    b->cursor = 0;
    b->best_value = 0;
    b->best[0] = b->best[1] = 0;
    b->way_count = 0;
}

/* The best way to (low, low + gap); places count round the arc. */
static void walk_cell(cairn_shape_builder *b, const shape_arc *arc, int32_t gap, int32_t low)
{
    int32_t next = arc->round && low + 1 == arc->count ? 0 : low + 1;
    cairn_real gain = gain_at(b, arc, low, low + gap), best = 0, value;
    uint8_t move = START;

    if (gap >= 2) {
        value = row(b, gap - 2)[next] + 2 * gain;
        if (value > best) {
            best = value;
            move = BOTH;
        }
    }
    value = row(b, gap - 1)[low] + ALONE * gain;
    if (value > best) {
        best = value;
        move = UP;
    }
    value = row(b, gap - 1)[next] + ALONE * gain;
    if (value > best) {
        best = value;
        move = DOWN;
    }
    row(b, gap)[low] = best;
    b->move[gap * arc->count + low] = move;
    if (best > b->best_value) {
        b->best_value = best;
        b->best[0] = gap;
        b->best[1] = low;
    }
}

/* Writes the best path into way[], from its start on. */
static void trace_back(cairn_shape_builder *b, const shape_arc *arc)
{
    int32_t gap = b->best[0], low = b->best[1], count = 0, drift = 0;

    if (b->best_value <= 0)
        return;
    for (;;) {
        uint8_t move = b->move[gap * arc->count + low];
        shape_pair pair = {low + drift, low + drift + gap};

        b->way[count++] = pair;
        if (move == START)
            break;
        gap -= move == BOTH ? 2 : 1;
        if (move != UP && ++low == arc->count) {
            low = 0;
            drift += arc->count;
        }
    }
    for (int32_t i = 0; i < count / 2; i++) {
        shape_pair swapped = b->way[i];

        b->way[i] = b->way[count - 1 - i];
        b->way[count - 1 - i] = swapped;
    }
    b->way_count = count;
}

cairn_status cairn_shape_walk_step(cairn_shape_builder *b, const shape_arc *arc,
                                   cairn_budget *budget)
{
    int32_t cells = arc->count * arc->count;

    for (; b->cursor < cells; b->cursor++) {
        int32_t gap = b->cursor / arc->count, low = b->cursor % arc->count;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (gap == 0) {
            row(b, 0)[low] = 0;
            b->move[low] = START;
        } else if (arc->round || low + gap < arc->count) {
            walk_cell(b, arc, gap, low);
        }
        if (b->cursor + 1 == cells)
            trace_back(b, arc);
    }
    return CAIRN_OK;
}

/* ---- From the way to a path ---- */

/* Samples of the outline that the way passes up to pair i, on both sides. */
static int32_t passed(const cairn_shape_builder *b, int32_t i)
{
    return (b->way[i].high - b->way[i].low) - (b->way[0].high - b->way[0].low);
}

/* The most symmetric pair of way[from ... to-1] in its middle half, -1: none is symmetric. */
static int32_t best_pair(const cairn_shape_builder *b, const shape_arc *arc, int32_t from,
                         int32_t to)
{
    int32_t best = -1;
    cairn_real most = 0;

    for (int32_t i = from; i < to; i++) {
        cairn_real gain = gain_at(b, arc, b->way[i].low, b->way[i].high);
        int32_t off = 2 * i - from - to + 1;

        /* Of equally symmetric ones that nearest the middle. */
        gain -= gain > 0 ? CAIRN_REAL(0.01) * (cairn_real)(off < 0 ? -off : off) /
                               (cairn_real)(to - from)
                         : 0;
        if (gain > most) {
            most = gain;
            best = i;
        }
    }
    return best;
}

/* Outline that the symmetric pairs of way[from ... to-1] pass, as shares of all outlines. */
static void add_shares(const cairn_shape_builder *b, const shape_arc *arc, int32_t from, int32_t to,
                       cairn_shape_sample *sample)
{
    cairn_real each = b->length[b->at] / ((cairn_real)shape_points(b) * b->whole);

    for (int32_t i = from; i < to; i++) {
        const shape_pair *before = &b->way[i > 0 ? i - 1 : 0], *now = &b->way[i];

        if (gain_at(b, arc, now->low, now->high) > 0) {
            sample->share[0] += each * (cairn_real)(now->high - before->high);
            sample->share[1] += each * (cairn_real)(before->low - now->low);
        }
    }
    sample->share[0] = cairn_min(sample->share[0], 1);
    sample->share[1] = cairn_min(sample->share[1], 1);
}

/* Stretches that one side passes alone and without symmetry, where a part branches off; and the
 * rests beyond both ends. */
static void add_arcs(cairn_shape_builder *b, const shape_arc *arc, int32_t path)
{
    shape_pair first = b->way[0], last = b->way[b->way_count - 1];
    int32_t rest = arc->round ? arc->count - 1 - (last.high - last.low) : 0, from = 0;
    shape_arc part = {0, 0, 0, path, -1};

    part.start = arc->start + first.low;
    part.count = first.high - first.low + 1;
    cairn_shape_add_arc(b, part);
    if (arc->round) {
        part.start = arc->start + last.high;
        part.count = rest + 2;
        cairn_shape_add_arc(b, part);
    }
    for (int32_t i = 1; i <= b->way_count; i++) {
        if (i < b->way_count && gain_at(b, arc, b->way[i].low, b->way[i].high) < 0)
            continue;
        if (i - from > 1) {
            const shape_pair *a = &b->way[from],
                             *z = &b->way[i < b->way_count ? i : b->way_count - 1];
            int32_t up = z->high - a->high, down = a->low - z->low;

            part.start = arc->start + (up >= down ? a->high : z->low);
            part.count = (up >= down ? up : down) + 1;
            cairn_shape_add_arc(b, part);
        }
        from = i;
    }
}

/* The sample of a path nearest to a point. */
static int32_t nearest_sample(const cairn_shape_builder *b, const cairn_shape_path *path,
                              cairn_vec2 p)
{
    int32_t best = 0;

    for (int32_t k = 1; k < path->count; k++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(b->samples[path->first + k].centre, p)) <
            cairn_vec2_norm_squared(cairn_vec2_sub(b->samples[path->first + best].centre, p)))
            best = k;
    return best;
}

/* A branch is walked from where it begins: from its wide end to its tip. */
static void turn_path(cairn_shape_builder *b, const cairn_shape_path *path)
{
    cairn_shape_sample *s = &b->samples[path->first];

    for (int32_t i = 0, j = path->count - 1; i <= j; i++, j--) {
        cairn_shape_sample pair[2] = {s[i], s[j]};

        for (int32_t e = 0; e < 2; e++) {
            cairn_shape_sample turned = pair[e];

            for (int32_t side = 0; side < 2; side++) {
                turned.side[side].position = pair[e].side[1 - side].position;
                turned.side[side].direction =
                    cairn_vec2_scale(pair[e].side[1 - side].direction, -1);
                turned.share[side] = pair[e].share[1 - side];
            }
            s[e == 0 ? j : i] = turned;
        }
    }
}

void cairn_shape_add_path(cairn_shape_builder *b, const shape_arc *arc)
{
    cairn_shape_path path = {b->sample_count, 0, arc->parent, -1, 0};
    cairn_real each = b->length[b->at] / ((cairn_real)shape_points(b) * b->whole);
    int32_t length = b->way_count > 0 ? passed(b, b->way_count - 1) : 0, wanted, from = 0;

    if ((cairn_real)length < b->params.min_share * (cairn_real)shape_points(b))
        return;
    wanted =
        cairn_real_to_int(cairn_rint((cairn_real)b->params.samples * each * (cairn_real)length));
    wanted = wanted < SHAPE_LEAST_SAMPLES ? SHAPE_LEAST_SAMPLES : wanted;
    for (int32_t k = 0; k < wanted && b->sample_count < cairn_shape_most_samples(&b->params); k++) {
        cairn_shape_sample *sample = &b->samples[b->sample_count];
        int32_t to = from, best;

        while (to < b->way_count && (passed(b, to) * wanted < (k + 1) * length || k + 1 == wanted))
            to++;
        best = best_pair(b, arc, from, to);
        if (best >= 0 && cairn_shape_disc(b, shape_point(b, arc, b->way[best].low),
                                          shape_point(b, arc, b->way[best].high), sample)) {
            add_shares(b, arc, from, to, sample);
            path.share += sample->share[0] + sample->share[1];
            b->sample_count++;
            path.count++;
        }
        from = to;
    }
    if (path.count == 0)
        return;
    path.share = cairn_min(path.share, 1);
    if (path.parent >= 0) {
        if (!arc->round)
            turn_path(b, &path);
        path.branch = nearest_sample(b, &b->paths[path.parent], b->samples[path.first].centre);
    }
    b->paths[b->path_count++] = path;
    add_arcs(b, arc, b->path_count - 1);
}
