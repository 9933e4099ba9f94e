/* Longest path through the symmetry set of an arc, by dynamic programming.
 *
 * Method:
 * 1. A path at (low, high), gap = high - low, comes from (low, high - 1), (low + 1, high) or (low +
 *    1, high - 1).
 * 2. dp_value[gap][low] is the greatest value of a path to that pair. Ties: both sides first, then
 *    the forward side.
 * 3. Backtracking gives the pairs of the best path, which are resampled. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/outlines/shape_model_work.h"

/* Predecessor moves. */
enum { MOVE_START, MOVE_BOTH, MOVE_UP, MOVE_DOWN };

/* Weight of a step that one side makes alone. */
#define ONE_SIDED_WEIGHT CAIRN_REAL(0.95)

static int32_t row_stride(const cairn_shape_model_builder *builder)
{
    return builder->params.outline_samples + SHAPE_MODEL_MIN_OUTLINE_SAMPLES;
}

/* Returns the row of values of a gap. */
static cairn_real *value_row(cairn_shape_model_builder *builder, int32_t gap)
{
    return &builder->dp_value[(gap % 3) * row_stride(builder)];
}

/* Returns the gain of a pair of positions of an arc. */
static cairn_real gain_at(const cairn_shape_model_builder *builder, const shape_model_arc *arc,
                          int32_t low, int32_t high)
{
    int32_t n = shape_model_points(builder), first = builder->outline_first[builder->outline_index];

    return builder->gain[(shape_model_point(builder, arc, low) - first) * n +
                         shape_model_point(builder, arc, high) - first];
}

/* ---- Waiting arcs ---- */

static int is_longer(const void *context, const void *entry, const void *other)
{
    const shape_model_arc *a = entry, *b = other;

    (void)context;
    return a->count > b->count;
}

void cairn_shape_model_add_arc(cairn_shape_model_builder *builder, shape_model_arc arc)
{
    ranked_list arcs = {.entries = builder->arcs,
                        .count = &builder->arc_count,
                        .capacity = CAIRN_SHAPE_MODEL_MAX_PATHS,
                        .entry_bytes = sizeof arc,
                        .ranks_before = is_longer};

    if ((cairn_real)arc.count >=
        builder->params.min_outline_share * (cairn_real)shape_model_points(builder))
        (void)ranked_list_add(&arcs, &arc);
}

/* Removes and returns the longest waiting arc. */
static shape_model_arc remove_arc(cairn_shape_model_builder *builder)
{
    ranked_list arcs = {.entries = builder->arcs,
                        .count = &builder->arc_count,
                        .entry_bytes = sizeof *builder->arcs};
    shape_model_arc arc = builder->arcs[0];

    ranked_list_remove(&arcs, 0);
    return arc;
}

/* ---- Search ---- */

/* Computes the best predecessor of (low, low + gap), gap > 0, if the arc has it; positions wrap
 * around a closed arc. */
static void evaluate_cell(cairn_shape_model_builder *builder, const shape_model_arc *arc,
                          int32_t gap, int32_t low)
{
    int32_t next = arc->is_closed && low + 1 == arc->count ? 0 : low + 1;
    cairn_real gain = gain_at(builder, arc, low, low + gap), best = 0, value;
    uint8_t move = MOVE_START;

    if (!arc->is_closed && low + gap >= arc->count)
        return;
    if (gap >= 2) {
        value = value_row(builder, gap - 2)[next] + 2 * gain;
        if (value > best) {
            best = value;
            move = MOVE_BOTH;
        }
    }
    value = value_row(builder, gap - 1)[low] + ONE_SIDED_WEIGHT * gain;
    if (value > best) {
        best = value;
        move = MOVE_UP;
    }
    value = value_row(builder, gap - 1)[next] + ONE_SIDED_WEIGHT * gain;
    if (value > best) {
        best = value;
        move = MOVE_DOWN;
    }
    value_row(builder, gap)[low] = best;
    builder->dp_move[gap * arc->count + low] = move;
    if (best > builder->best_value) {
        builder->best_value = best;
        builder->best_gap = gap;
        builder->best_low = low;
    }
}

/* Backtracks the best path into path_pairs[], from its start. */
static void backtrack(cairn_shape_model_builder *builder, const shape_model_arc *arc)
{
    int32_t gap = builder->best_gap, low = builder->best_low, count = 0, wrap_offset = 0;

    builder->path_pair_count = 0;
    if (builder->best_value <= 0)
        return;
    for (;;) {
        uint8_t move = builder->dp_move[gap * arc->count + low];
        shape_model_pair pair = {low + wrap_offset, low + wrap_offset + gap};

        builder->path_pairs[count++] = pair;
        if (move == MOVE_START)
            break;
        gap -= move == MOVE_BOTH ? 2 : 1;
        if (move != MOVE_UP && ++low == arc->count) {
            low = 0;
            wrap_offset += arc->count;
        }
    }
    for (int32_t i = 0; i < count / 2; i++) {
        shape_model_pair swapped = builder->path_pairs[i];

        builder->path_pairs[i] = builder->path_pairs[count - 1 - i];
        builder->path_pairs[count - 1 - i] = swapped;
    }
    builder->path_pair_count = count;
}

/* The cell (0, low), where every path begins. */
static void begin_cell(cairn_shape_model_builder *builder, int32_t low)
{
    value_row(builder, 0)[low] = 0;
    builder->dp_move[low] = MOVE_START;
}

int cairn_shape_model_search(cairn_shape_model_builder *builder, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(builder->search_resume);
    builder->best_value = 0;
    for (builder->low = 0; builder->low < builder->arcs[0].count; builder->low++) {
        CAIRN_STEP_CHARGE(builder, search_resume, budget, 1);
        begin_cell(builder, builder->low);
    }
    for (builder->gap = 1; builder->gap < builder->arcs[0].count; builder->gap++)
        for (builder->low = 0; builder->low < builder->arcs[0].count; builder->low++) {
            CAIRN_STEP_CHARGE(builder, search_resume, budget, 1);
            evaluate_cell(builder, &builder->arcs[0], builder->gap, builder->low);
        }
    backtrack(builder, &builder->arcs[0]);
    CAIRN_STEP_END(builder->search_resume);
}

/* ---- Resampling ---- */

/* Returns the number of outline samples passed on both sides up to pair i. */
static int32_t passed_samples(const cairn_shape_model_builder *builder, int32_t i)
{
    return (builder->path_pairs[i].high - builder->path_pairs[i].low) -
           (builder->path_pairs[0].high - builder->path_pairs[0].low);
}

/* Returns the most symmetric pair of path_pairs[from ... to - 1], preferably near the middle;
 * -1: none is symmetric. */
static int32_t best_pair(const cairn_shape_model_builder *builder, const shape_model_arc *arc,
                         int32_t from, int32_t to)
{
    int32_t best = -1;
    cairn_real most = 0;

    for (int32_t i = from; i < to; i++) {
        cairn_real gain =
            gain_at(builder, arc, builder->path_pairs[i].low, builder->path_pairs[i].high);
        int32_t middle_offset = 2 * i - from - to + 1;

        /* Among equal gains the pair nearest to the middle wins. */
        gain -= gain > 0 ? CAIRN_REAL(0.01) *
                               (cairn_real)(middle_offset < 0 ? -middle_offset : middle_offset) /
                               (cairn_real)(to - from)
                         : 0;
        if (gain > most) {
            most = gain;
            best = i;
        }
    }
    return best;
}

/* Adds the outline passed by the symmetric pairs of path_pairs[from ... to - 1], as shares of
 * all outlines. */
static void add_shares(const cairn_shape_model_builder *builder, const shape_model_arc *arc,
                       int32_t from, int32_t to, cairn_shape_model_sample *sample)
{
    cairn_real each = builder->outline_length[builder->outline_index] /
                      ((cairn_real)shape_model_points(builder) * builder->total_length);

    for (int32_t i = from; i < to; i++) {
        const shape_model_pair *now = &builder->path_pairs[i];

        /* The first pair, where the path starts, has no gain. */
        if (gain_at(builder, arc, now->low, now->high) > 0) {
            const shape_model_pair *before = now - 1;

            sample->outline_share[0] += each * (cairn_real)(now->high - before->high);
            sample->outline_share[1] += each * (cairn_real)(before->low - now->low);
        }
    }
    sample->outline_share[0] = cairn_min(sample->outline_share[0], 1);
    sample->outline_share[1] = cairn_min(sample->outline_share[1], 1);
}

/* Adds waiting arcs: asymmetric stretches passed on one side, where a limb branches off, and the
 * remainders beyond both ends. */
static void add_arcs(cairn_shape_model_builder *builder, const shape_model_arc *arc, int32_t path)
{
    shape_model_pair first = builder->path_pairs[0],
                     last = builder->path_pairs[builder->path_pair_count - 1];
    int32_t rest = arc->is_closed ? arc->count - 1 - (last.high - last.low) : 0, from = 0;
    shape_model_arc part = {0, 0, 0, path, -1};

    part.start = arc->start + first.low;
    part.count = first.high - first.low + 1;
    cairn_shape_model_add_arc(builder, part);
    if (arc->is_closed) {
        part.start = arc->start + last.high;
        part.count = rest + 2;
        cairn_shape_model_add_arc(builder, part);
    }
    for (int32_t i = 1; i <= builder->path_pair_count; i++) {
        if (i < builder->path_pair_count &&
            gain_at(builder, arc, builder->path_pairs[i].low, builder->path_pairs[i].high) < 0)
            continue;
        if (i - from > 1) {
            const shape_model_pair *a = &builder->path_pairs[from],
                                   *z = &builder->path_pairs[i < builder->path_pair_count
                                                                 ? i
                                                                 : builder->path_pair_count - 1];
            int32_t up = z->high - a->high, down = a->low - z->low;

            part.start = arc->start + (up >= down ? a->high : z->low);
            part.count = (up >= down ? up : down) + 1;
            cairn_shape_model_add_arc(builder, part);
        }
        from = i;
    }
}

/* Returns the sample of a path nearest to a point. */
static int32_t nearest_sample(const cairn_shape_model_builder *builder,
                              const cairn_shape_model_path *path, cairn_vec2 p)
{
    int32_t best = 0;

    for (int32_t k = 1; k < path->count; k++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(builder->samples[path->first + k].centre, p)) <
            cairn_vec2_norm_squared(cairn_vec2_sub(builder->samples[path->first + best].centre, p)))
            best = k;
    return best;
}

/* Reverses a branch path, so that it runs from the branch point to its tip. */
static void reverse_path(cairn_shape_model_builder *builder, const cairn_shape_model_path *path)
{
    cairn_shape_model_sample *s = &builder->samples[path->first];

    for (int32_t i = 0, j = path->count - 1; i <= j; i++, j--) {
        cairn_shape_model_sample pair[2] = {s[i], s[j]};

        for (int32_t e = 0; e < 2; e++) {
            cairn_shape_model_sample turned = pair[e];

            for (int32_t side = 0; side < 2; side++) {
                turned.contact[side].position = pair[e].contact[1 - side].position;
                turned.contact[side].direction =
                    cairn_vec2_scale(pair[e].contact[1 - side].direction, -1);
                turned.outline_share[side] = pair[e].outline_share[1 - side];
            }
            s[e == 0 ? j : i] = turned;
        }
    }
}

/* Resamples path_pairs[] to a path, and adds arcs of the remaining outline. */
static void add_path(cairn_shape_model_builder *builder, const shape_model_arc *arc)
{
    cairn_shape_model_path path = {
        .first = builder->sample_count, .parent = arc->parent, .branch = -1};
    cairn_real each = builder->outline_length[builder->outline_index] /
                      ((cairn_real)shape_model_points(builder) * builder->total_length);
    int32_t length = builder->path_pair_count > 0
                         ? passed_samples(builder, builder->path_pair_count - 1)
                         : 0,
            wanted, from = 0;

    if ((cairn_real)length <
        builder->params.min_outline_share * (cairn_real)shape_model_points(builder))
        return;
    wanted = cairn_real_to_int(
        cairn_rint((cairn_real)builder->params.path_samples * each * (cairn_real)length));
    wanted = wanted < SHAPE_MODEL_MIN_PATH_SAMPLES ? SHAPE_MODEL_MIN_PATH_SAMPLES : wanted;
    for (int32_t k = 0;
         k < wanted && builder->sample_count < shape_model_max_samples(&builder->params); k++) {
        cairn_shape_model_sample *sample = &builder->samples[builder->sample_count];
        int32_t to = from, best;

        while (to < builder->path_pair_count &&
               (passed_samples(builder, to) * wanted < (k + 1) * length || k + 1 == wanted))
            to++;
        best = best_pair(builder, arc, from, to);
        if (best >= 0 &&
            cairn_shape_model_disc(
                builder, shape_model_point(builder, arc, builder->path_pairs[best].low),
                shape_model_point(builder, arc, builder->path_pairs[best].high), sample)) {
            add_shares(builder, arc, from, to, sample);
            path.outline_share += sample->outline_share[0] + sample->outline_share[1];
            builder->sample_count++;
            path.count++;
        }
        from = to;
    }
    if (path.count == 0)
        return;
    path.outline_share = cairn_min(path.outline_share, 1);
    if (path.parent >= 0) {
        if (!arc->is_closed)
            reverse_path(builder, &path);
        path.branch = nearest_sample(builder, &builder->paths[path.parent],
                                     builder->samples[path.first].centre);
    }
    builder->paths[builder->path_count++] = path;
    add_arcs(builder, arc, builder->path_count - 1);
}

void cairn_shape_model_add_path(cairn_shape_model_builder *builder)
{
    shape_model_arc arc = remove_arc(builder);

    add_path(builder, &arc);
}
