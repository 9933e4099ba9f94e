/* Hypothesis generation: poses of the model from pairs of tokens.
 *
 * Method:
 * 1. The quantized directions of all tokens are marked in a map of bits (edge-orientation map).
 * 2. Every pair of tokens is matched to the two sides of a model sample. The chord between them
 *    gives the scale, rotation and translation of a similarity transform. The directions of both
 *    tokens must agree with the sample.
 * 3. A hypothesis is scored by edge coverage: the share of the outline with an edge of its
 *    direction nearby, looked up in the map.
 * 4. Non-maximum suppression keeps the best of near-duplicate hypotheses and limits the size of a
 *    cluster. The rest are the initial particles. */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/outlines/contour_grouping_work.h"

/* Least cosine of the angle between a token and its expected direction. */
#define MIN_COSINE CAIRN_REAL(0.9)
/* Near-duplicate hypotheses: distance, and difference of scale and rotation, shares of the size. */
#define DUPLICATE_DISTANCE CAIRN_REAL(0.05)
#define DUPLICATE_SCALE    CAIRN_REAL(0.12)
/* Cluster radius, share of the size; a cluster holds at most 1 / MAX_CLUSTERS of all. */
#define CLUSTER_RADIUS CAIRN_REAL(0.3)
enum { MAX_CLUSTERS = 8 };
enum { MAX_PAIRS = 1 << 22 };
/* Work units of a token that is marked; tokens out of reach that a unit skips. */
enum { UNITS_PER_MARK = 4, FAR_TOKENS_PER_UNIT = 16 };
/* Least cosine of half the rotation range for which chords are rejected early by a squared
 * cosine. */
#define MIN_RANGE_COSINE CAIRN_REAL(0.1)
/* Factors that widen ranges for rounding errors. */
#define ROUND_DOWN CAIRN_REAL(0.9999)
#define ROUND_UP   CAIRN_REAL(1.0001)

/* Direction bin, 0 ... 7 over half a turn, by comparisons only. */
static int32_t direction_bin(cairn_vec2 d)
{
    cairn_real x = d.x, y = d.y;
    int32_t bin;

    if (y < 0 || (y == 0 && x < 0)) {
        x = -x;
        y = -y;
    }
    bin = x >= 0 ? 0 : 4;
    if (bin == 4) {
        cairn_real old_x = x;

        x = y;
        y = -old_x;
    }
    if (y > CAIRN_REAL(2.414213562) * x)
        return bin + 3;
    return bin + (y > x ? 2 : y > CAIRN_REAL(0.414213562) * x);
}

/* Marks a token's direction bin and its neighbours in the cells around the token. */
static void mark_token(cairn_contour_grouping *grouping, const contour_grouping_token *token)
{
    int32_t bin = direction_bin(token->direction),
            steps = 1 + cairn_real_to_int(token->half_length / CONTOUR_GROUPING_EDGE_CELL_PX);
    uint8_t bits = (uint8_t)(1 << bin | 1 << ((bin + 1) & 7) | 1 << ((bin + 7) & 7));

    for (int32_t s = -steps; s <= steps; s++) {
        cairn_vec2 p = cairn_vec2_add(
            token->middle,
            cairn_vec2_scale(token->direction,
                             token->half_length * ((cairn_real)s / (cairn_real)steps)));
        int32_t x = cairn_real_to_int(p.x) / CONTOUR_GROUPING_EDGE_CELL_PX,
                y = cairn_real_to_int(p.y) / CONTOUR_GROUPING_EDGE_CELL_PX;

        for (int32_t v = y - 1; v <= y + 1; v++)
            for (int32_t u = x - 1; u <= x + 1; u++)
                if (u >= 0 && v >= 0 && u < grouping->edge_grid.columns &&
                    v < grouping->edge_grid.rows)
                    grouping->edge_map[v * grouping->edge_grid.columns + u] |= bits;
    }
}

/* Edge coverage of a pose: share of outline samples with an edge of their direction nearby. */
static cairn_real edge_coverage(const cairn_contour_grouping *grouping,
                                const cairn_similarity *pose)
{
    const cairn_shape_model *model = grouping->input.model;
    int32_t stride = 1 + model->outline_count / 48, covered = 0, count = 0;

    for (int32_t i = 0; i < model->outline_count; i += stride) {
        cairn_vec2 p = cairn_similarity_point(*pose, model->outline[i].position);
        int32_t x = cairn_real_to_int(p.x) / CONTOUR_GROUPING_EDGE_CELL_PX,
                y = cairn_real_to_int(p.y) / CONTOUR_GROUPING_EDGE_CELL_PX;

        count++;
        if (p.x < 0 || p.y < 0 || x >= grouping->edge_grid.columns || y >= grouping->edge_grid.rows)
            continue;
        covered += grouping->edge_map[y * grouping->edge_grid.columns + x] >>
                       direction_bin(cairn_similarity_vector(*pose, model->outline[i].direction)) &
                   1;
    }
    return (cairn_real)covered / (cairn_real)count;
}

static int are_duplicates(const contour_grouping_hypothesis *a,
                          const contour_grouping_hypothesis *b, cairn_real sizes)
{
    cairn_real da = a->pose.a - b->pose.a, db = a->pose.b - b->pose.b;

    return cairn_vec2_norm_squared(cairn_vec2_sub(a->pose.shift, b->pose.shift)) <
               DUPLICATE_DISTANCE * DUPLICATE_DISTANCE * sizes &&
           da * da + db * db < DUPLICATE_SCALE * DUPLICATE_SCALE * sizes;
}

static int are_in_cluster(const contour_grouping_hypothesis *a,
                          const contour_grouping_hypothesis *b, cairn_real sizes)
{
    return cairn_vec2_norm_squared(cairn_vec2_sub(a->pose.shift, b->pose.shift)) <
           CLUSTER_RADIUS * CLUSTER_RADIUS * sizes;
}

/* Index of the hypothesis that a new one may replace: a near-duplicate, or the worst of a full
 * cluster; -1: none. */
static int32_t replaceable_hypothesis(const cairn_contour_grouping *grouping,
                                      const contour_grouping_hypothesis *hypothesis)
{
    int32_t max_cluster = grouping->params.particles / MAX_CLUSTERS, cluster_size = 0, worst = -1;

    for (int32_t i = 0; i < grouping->found.hypothesis_count; i++) {
        cairn_real sizes = grouping->hypotheses[i].size * hypothesis->size;

        if (!are_in_cluster(&grouping->hypotheses[i], hypothesis, sizes))
            continue;
        if (are_duplicates(&grouping->hypotheses[i], hypothesis, sizes))
            return i;
        cluster_size++;
        worst = i;
    }
    return cluster_size > max_cluster ? worst : -1;
}

/* Inserts a hypothesis into the sorted list, with non-maximum suppression of near-duplicates and a
 * limit per cluster, so that capacity remains for other objects. */
static void insert_hypothesis(cairn_contour_grouping *grouping,
                              const contour_grouping_hypothesis *hypothesis)
{
    ranked_list hypotheses = {.entries = grouping->hypotheses,
                              .count = &grouping->found.hypothesis_count,
                              .capacity = grouping->params.particles,
                              .entry_bytes = sizeof *hypothesis,
                              .score_at = offsetof(contour_grouping_hypothesis, score)};
    int32_t last = grouping->found.hypothesis_count - 1, replaced;

    if (last == grouping->params.particles - 1 &&
        !(hypothesis->score > grouping->hypotheses[last].score))
        return;
    replaced = replaceable_hypothesis(grouping, hypothesis);
    if (replaced >= 0 && !(hypothesis->score > grouping->hypotheses[replaced].score))
        return;
    if (replaced >= 0)
        ranked_list_remove(&hypotheses, replaced);
    (void)ranked_list_add(&hypotheses, hypothesis);
}

/* Returns 1 when a token is aligned with a model direction in a pose. */
static int is_aligned(const contour_grouping_token *token, const cairn_similarity *pose,
                      cairn_vec2 d, cairn_real size)
{
    return cairn_abs(cairn_vec2_dot(token->direction, cairn_similarity_vector(*pose, d))) >=
           MIN_COSINE * size;
}

/* Quantized direction of a chord, 0 ... CONTOUR_GROUPING_CHORD_DIRECTIONS - 1 over the full circle;
 * monotonic in the angle, without an arc tangent. */
static int32_t chord_direction(cairn_vec2 c)
{
    cairn_real sum = cairn_abs(c.x) + cairn_abs(c.y), along = sum > 0 ? c.x / sum : 0;
    int32_t direction = cairn_real_to_int((1 - along) * CONTOUR_GROUPING_CHORD_DIRECTIONS / 4);

    direction = direction < CONTOUR_GROUPING_CHORD_DIRECTIONS / 2
                    ? direction
                    : CONTOUR_GROUPING_CHORD_DIRECTIONS / 2 - 1;
    return c.y < 0 ? CONTOUR_GROUPING_CHORD_DIRECTIONS - 1 - direction : direction;
}

/* Extends the sample range of a direction by a sample. */
static void admit_sample(contour_grouping_sample_range *range, int32_t sample)
{
    if (sample < range->from)
        range->from = (int16_t)sample;
    if (sample >= range->to)
        range->to = (int16_t)(sample + 1);
}

/* Chord between the two contact points of a model sample. */
static cairn_vec2 chord_of(const cairn_contour_grouping *grouping, int32_t sample)
{
    const cairn_shape_model_sample *s = &grouping->input.model->samples[sample];

    return cairn_vec2_sub(s->contact[1].position, s->contact[0].position);
}

/* Registers the quantized directions that a sample's chord may have over the rotation range, with a
 * margin of one for rounding. */
static void admit_directions(cairn_contour_grouping *grouping, int32_t sample)
{
    cairn_vec2 m = chord_of(grouping, sample), axis = grouping->limits.middle_rotation;
    cairn_vec2 middle = {m.x * axis.x - m.y * axis.y, m.x * axis.y + m.y * axis.x};
    cairn_real cosine = cairn_sqrt(cairn_max(grouping->limits.min_cosine_squared, 0)),
               sine = cairn_sqrt(1 - cosine * cosine);
    cairn_vec2 low = {middle.x * cosine + middle.y * sine, middle.y * cosine - middle.x * sine};
    cairn_vec2 high = {middle.x * cosine - middle.y * sine, middle.y * cosine + middle.x * sine};
    int32_t first = chord_direction(low) + CONTOUR_GROUPING_CHORD_DIRECTIONS - 1;
    int32_t count =
        grouping->limits.min_cosine_squared < 0
            ? CONTOUR_GROUPING_CHORD_DIRECTIONS
            : (chord_direction(high) + CONTOUR_GROUPING_CHORD_DIRECTIONS - chord_direction(low)) %
                      CONTOUR_GROUPING_CHORD_DIRECTIONS +
                  3;

    for (int32_t i = 0; i < count; i++)
        admit_sample(
            &grouping->limits.chord_samples[(first + i) % CONTOUR_GROUPING_CHORD_DIRECTIONS],
            sample);
}

void cairn_contour_grouping_begin_hypotheses(cairn_contour_grouping *grouping)
{
    grouping->limits.min_size_squared =
        grouping->input.min_size * grouping->input.min_size * ROUND_DOWN;
    grouping->limits.max_size_squared =
        grouping->input.max_size * grouping->input.max_size * ROUND_UP;
    grouping->limits.min_cosine_squared = grouping->limits.min_rotation_cosine > MIN_RANGE_COSINE
                                              ? grouping->limits.min_rotation_cosine *
                                                    grouping->limits.min_rotation_cosine *
                                                    ROUND_DOWN
                                              : -2;
    for (int32_t i = 0; i < CONTOUR_GROUPING_CHORD_DIRECTIONS; i++) {
        grouping->limits.chord_samples[i].from = INT16_MAX;
        grouping->limits.chord_samples[i].to = 0;
    }
    for (int32_t k = 0; k < grouping->input.model->sample_count; k++)
        admit_directions(grouping, k);
}

/* Returns 0 when a chord of tokens, of squared length cc, is too short, too long or rotated too far
 * for a sample. */
static int is_feasible(const cairn_contour_grouping *grouping, int32_t sample, cairn_vec2 c,
                       cairn_real cc)
{
    cairn_vec2 m = chord_of(grouping, sample);
    cairn_real mm = cairn_vec2_norm_squared(m);
    cairn_real along = cairn_vec2_dot(m, c) * grouping->limits.middle_rotation.x +
                       cairn_vec2_cross(m, c) * grouping->limits.middle_rotation.y;

    return cc >= mm * grouping->limits.min_size_squared &&
           cc <= mm * grouping->limits.max_size_squared &&
           along * cairn_abs(along) >= grouping->limits.min_cosine_squared * mm * cc;
}

/* Tests a pair of tokens as the sides 0 and 1 of a sample, and inserts the resulting hypothesis. */
static void test_sample(cairn_contour_grouping *grouping, const contour_grouping_token *p,
                        const contour_grouping_token *q, int32_t sample)
{
    const cairn_shape_model_sample *s = &grouping->input.model->samples[sample];
    cairn_vec2 m = chord_of(grouping, sample), c = cairn_vec2_sub(q->middle, p->middle);
    cairn_real mm = cairn_vec2_norm_squared(m), cc = cairn_vec2_norm_squared(c);
    contour_grouping_hypothesis hypothesis;

    if (mm == 0 || cc < mm * grouping->input.min_size * grouping->input.min_size ||
        cc > mm * grouping->input.max_size * grouping->input.max_size)
        return;
    hypothesis.pose = cairn_similarity_from_moments(s->contact[0].position, p->middle, mm,
                                                    cairn_vec2_dot(m, c), cairn_vec2_cross(m, c));
    hypothesis.size = cairn_similarity_scale(hypothesis.pose);
    if (hypothesis.pose.a * grouping->limits.middle_rotation.x +
                hypothesis.pose.b * grouping->limits.middle_rotation.y <
            grouping->limits.min_rotation_cosine * hypothesis.size ||
        !is_aligned(p, &hypothesis.pose, s->contact[0].direction, hypothesis.size) ||
        !is_aligned(q, &hypothesis.pose, s->contact[1].direction, hypothesis.size))
        return;
    hypothesis.score = edge_coverage(grouping, &hypothesis.pose);
    hypothesis.sample = sample;
    grouping->found.generated_count += grouping->found.generated_count < INT32_MAX;
    insert_hypothesis(grouping, &hypothesis);
}

/* Subsampling stride of the first token of a pair, so that the number of pairs stays within
 * MAX_PAIRS. */
static int32_t token_stride(const cairn_contour_grouping *grouping)
{
    return 1 + cairn_real_to_int((cairn_real)grouping->token_count *
                                 (cairn_real)grouping->token_count / MAX_PAIRS);
}

/* Chord of the pair of tokens. */
static cairn_vec2 pair_chord(const cairn_contour_grouping *grouping)
{
    return cairn_vec2_sub(grouping->tokens[grouping->second].middle,
                          grouping->tokens[grouping->first].middle);
}

/* Tests the pair of tokens at all samples whose chord may have its direction. */
static void test_pair(cairn_contour_grouping *grouping)
{
    cairn_vec2 c = pair_chord(grouping);
    cairn_real cc = cairn_vec2_norm_squared(c);
    contour_grouping_sample_range range = grouping->limits.chord_samples[chord_direction(c)];

    for (int32_t k = range.from; k < range.to; k++)
        if (is_feasible(grouping, k, c, cc))
            test_sample(grouping, &grouping->tokens[grouping->first],
                        &grouping->tokens[grouping->second], k);
}

/* 1 when a token is another one than the first of the pair, and within reach of it. */
static int is_near(const cairn_contour_grouping *grouping, int32_t token)
{
    cairn_vec2 c =
        cairn_vec2_sub(grouping->tokens[token].middle, grouping->tokens[grouping->first].middle);

    return token != grouping->first &&
           !(cairn_vec2_norm_squared(c) > grouping->limits.max_chord * grouping->limits.max_chord);
}

/* Skips second tokens up to the next one within reach of the first, or to the end. 0: the budget is
 * used up. */
static int skip_far(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    int32_t i = grouping->second, is_charged = 1;

    while (is_charged && i < grouping->token_count && !is_near(grouping, i)) {
        is_charged = i % FAR_TOKENS_PER_UNIT != 0 || cairn_budget_take(budget, 1) == 1;
        i += is_charged;
    }
    grouping->second = i;
    return is_charged;
}

/* Marks all tokens in the map, then tests pair by pair. */
int cairn_contour_grouping_generate_hypotheses(cairn_contour_grouping *grouping,
                                               cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->phase_resume);
    for (grouping->edge_cell = 0; grouping->edge_cell < cell_grid_count(&grouping->edge_grid);
         grouping->edge_cell++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, 1);
        grouping->edge_map[grouping->edge_cell] = 0;
    }
    for (grouping->first = 0; grouping->first < grouping->token_count; grouping->first++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, UNITS_PER_MARK);
        mark_token(grouping, &grouping->tokens[grouping->first]);
    }
    for (grouping->first = 0; grouping->first < grouping->token_count;
         grouping->first += token_stride(grouping))
        for (grouping->second = 0; grouping->second < grouping->token_count; grouping->second++) {
            CAIRN_STEP_RUN(grouping, phase_resume, budget, skip_far);
            if (grouping->second == grouping->token_count)
                break;
            CAIRN_STEP_CHARGE(grouping, phase_resume, budget, grouping->input.model->sample_count);
            test_pair(grouping);
        }
    CAIRN_STEP_END(grouping->phase_resume);
}
