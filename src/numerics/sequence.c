/* Sequence alignment by dynamic programming in linear memory.
 *
 * Method:
 * 1. Nodes (i, j), 0 <= i <= n, 0 <= j <= m, are prefixes of i and j elements. A move arrives at a
 *    node diagonally (elements i - 1 and j - 1 are paired), from above, or from the left, with a
 *    gain. LCS: 1 for a matching pair. LOCAL: the score of the pair, or minus the gap cost. DTW:
 *    minus the distance of the elements i - 1 and j - 1, for any move. The best path has the
 *    greatest sum of gains.
 * 2. LOCAL only: the end of the best local alignment is the node of the greatest sum that is never
 *    below 0; its start is found by the backward sums from there.
 * 3. Divide and conquer (Hirschberg 1975): best sums from the start to the nodes of the middle row,
 *    best sums from there to the end. The node with the greatest total is on the path and splits
 *    the table into two jobs. Jobs wait on a stack; the upper one is done first, so pairs come out
 *    in ascending order.
 * 4. In a job of one row of elements the path is traced directly.
 *
 * Layout: one row of forward sums and one of backward sums. A backward sum of DTW includes the gain
 * of arriving at its own node, because all moves to a node have the same gain.
 *
 * Limits: no affine gap costs, no band.
 *
 * Source: Hirschberg 1975; Smith and Waterman 1981; Sakoe and Chiba 1978. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/sequence.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Largest number of elements of a sequence, and of jobs on the stack. */
enum { MAX_ELEMENTS = 1 << 24, MAX_JOBS = 32 };

/* Gain of a forbidden move. */
static const cairn_real IMPOSSIBLE_GAIN = CAIRN_REAL(-1e30);

/* Part of the table between two nodes of the path, of at least one row of elements. */
typedef struct sequence_job {
    int32_t first_row, last_row, first_column, last_column;
} sequence_job;

struct cairn_sequence {
    /* Current node. */
    int32_t row, column;
    /* Resume points of the alignment, and of a part of it. */
    int32_t resume, part_resume;
    int32_t first_count, second_count;
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none. */
    cairn_status status;
    /* Number of pairs so far. */
    int32_t pair_count;
    /* Node of the best sum so far. */
    int32_t best_row, best_column;
    /* 1: the path moves diagonally between the adjacent rows of the split. */
    int32_t best_is_diagonal;
    /* Number of jobs on the stack, and current job. */
    int32_t job_count;
    sequence_job job;

    /* [max_first + max_second] Pairs of the path so far. */
    cairn_sequence_pair *pairs;
    /* [max_second + 1] Best sums from the start, and to the end. */
    cairn_real *forward, *backward;
    cairn_sequence_compare compare;
    const void *context;
    /* Sum of the diagonal neighbour, which its row has overwritten. */
    cairn_real diagonal;
    /* Best sum so far. */
    cairn_real best;
    /* Score of the path. */
    cairn_real score;
    cairn_sequence_params params;
    /* Stack of jobs. */
    sequence_job jobs[MAX_JOBS];
};

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_sequence_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_sequence_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(kind, CAIRN_SEQUENCE_LCS, CAIRN_SEQUENCE_LCS, CAIRN_SEQUENCE_DTW),
    INTEGER(max_first, 1024, 1, MAX_ELEMENTS),
    INTEGER(max_second, 1024, 1, MAX_ELEMENTS),
    NUMBER(gap_cost, 1, 0, CAIRN_REAL(1e9)),
};
extern const cairn_parameters cairn_sequence_parameters;
const cairn_parameters cairn_sequence_parameters =
    CAIRN_PARAMETERS("sequence", cairn_sequence_params, rows);

cairn_sequence_params cairn_sequence_default(void)
{
    cairn_sequence_params params;

    cairn_parameters_preset(&cairn_sequence_parameters, &params);
    return params;
}

cairn_status cairn_sequence_check(const cairn_sequence_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_sequence_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_sequence *build(cairn_pool *pool, const cairn_sequence_params *params)
{
    size_t n = (size_t)params->max_first, m = (size_t)params->max_second;
    cairn_sequence *sequence = cairn_object_take(pool, sizeof *sequence);

    CAIRN_TAKE(sequence, pool, pairs, n + m);
    CAIRN_TAKE(sequence, pool, forward, m + 1);
    CAIRN_TAKE(sequence, pool, backward, m + 1);
    if (sequence != NULL) {
        sequence->params = *params;
        sequence->status = CAIRN_EMPTY;
    }
    return sequence;
}

CAIRN_OBJECT(sequence, sequence, build);

cairn_status cairn_sequence_begin(cairn_sequence *sequence, int32_t first_count,
                                  int32_t second_count, cairn_sequence_compare compare,
                                  const void *context)
{
    if (sequence == NULL || compare == NULL || first_count < 0 || second_count < 0)
        return CAIRN_BAD_ARGUMENT;
    if (first_count > sequence->params.max_first || second_count > sequence->params.max_second)
        return CAIRN_FULL;
    sequence->compare = compare;
    sequence->context = context;
    sequence->first_count = first_count;
    sequence->second_count = second_count;
    sequence->pair_count = sequence->job_count = 0;
    sequence->score = 0;
    sequence->resume = sequence->part_resume = 0;
    sequence->status = first_count == 0 || second_count == 0 ? CAIRN_OK : CAIRN_MORE;
    return CAIRN_OK;
}

/* Gains of the moves that arrive at node (i, j): diagonally, and from above or the left. */
static void move_gains(const cairn_sequence *sequence, int32_t i, int32_t j, cairn_real *pair_gain,
                       cairn_real *skip_gain)
{
    cairn_real value = i > 0 && j > 0 ? sequence->compare(sequence->context, i - 1, j - 1) : 0;

    switch (sequence->params.kind) {
    case CAIRN_SEQUENCE_LCS:
        *pair_gain = value > 0 ? 1 : IMPOSSIBLE_GAIN;
        *skip_gain = 0;
        break;
    case CAIRN_SEQUENCE_LOCAL:
        *pair_gain = value;
        *skip_gain = -sequence->params.gap_cost;
        break;
    default:
        *pair_gain = *skip_gain = i > 0 && j > 0 ? -value : IMPOSSIBLE_GAIN;
        break;
    }
}

/* Best sum from the start of a job to the current node, over the moves that arrive there. */
static cairn_real best_arriving(cairn_sequence *sequence, int32_t first_row, int32_t first_column)
{
    int32_t i = sequence->row, j = sequence->column;
    cairn_real pair_gain, skip_gain, above = i > first_row ? sequence->forward[j] : IMPOSSIBLE_GAIN,
                                     best = IMPOSSIBLE_GAIN;

    move_gains(sequence, i, j, &pair_gain, &skip_gain);
    if (i > first_row && j > first_column)
        best = sequence->diagonal + pair_gain;
    if (i > first_row)
        best = cairn_max(best, above + skip_gain);
    if (j > first_column)
        best = cairn_max(best, sequence->forward[j - 1] + skip_gain);
    sequence->diagonal = above;
    return cairn_max(best, IMPOSSIBLE_GAIN);
}

/* Best sum from the current node to the end of a job, over the moves that leave; backward[j + 1] is
 * final. */
static cairn_real best_leaving(cairn_sequence *sequence, int32_t last_row, int32_t last_column)
{
    int32_t i = sequence->row, j = sequence->column;
    int32_t is_dtw = sequence->params.kind == CAIRN_SEQUENCE_DTW;
    cairn_real pair_gain = 0, skip_gain = 0,
               below = i < last_row ? sequence->backward[j] : IMPOSSIBLE_GAIN,
               best = i == last_row && j == last_column ? 0 : IMPOSSIBLE_GAIN;

    if (is_dtw)
        move_gains(sequence, i, j, &pair_gain, &skip_gain);
    else if (i < last_row || j < last_column)
        move_gains(sequence, i + 1 <= last_row ? i + 1 : i, j + 1 <= last_column ? j + 1 : j,
                   &pair_gain, &skip_gain);
    if (i < last_row && j < last_column)
        best = sequence->diagonal + (is_dtw ? 0 : pair_gain);
    if (i < last_row)
        best = cairn_max(best, below + (is_dtw ? 0 : skip_gain));
    if (j < last_column)
        best = cairn_max(best, sequence->backward[j + 1] + (is_dtw ? 0 : skip_gain));
    if (is_dtw)
        best += skip_gain;
    sequence->diagonal = below;
    return cairn_max(best, IMPOSSIBLE_GAIN);
}

/* ---- LOCAL: end and start of the best local alignment ---- */

/* Keeps the sum of the current node when it is the best so far. */
static void consider_node(cairn_sequence *sequence, cairn_real sum)
{
    if (sum <= sequence->best)
        return;
    sequence->best = sum;
    sequence->best_row = sequence->row;
    sequence->best_column = sequence->column;
}

/* Sum from the start of an alignment to the current node, never below 0. */
static void sum_from_any(cairn_sequence *sequence)
{
    sequence->forward[sequence->column] = cairn_max(best_arriving(sequence, 0, 0), 0);
    consider_node(sequence, sequence->forward[sequence->column]);
}

/* Sum from the current node to the end of the best alignment. */
static void sum_to_end(cairn_sequence *sequence)
{
    sequence->backward[sequence->column] =
        best_leaving(sequence, sequence->job.last_row, sequence->job.last_column);
    consider_node(sequence, sequence->backward[sequence->column]);
}

/* The part of the table from the start to the end of the best local alignment becomes the job;
 * `score` is its sum, 0: there is none. */
static int find_local(cairn_sequence *sequence, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(sequence->part_resume);
    sequence->best = 0;
    for (sequence->row = 0; sequence->row <= sequence->first_count; sequence->row++)
        for (sequence->column = 0; sequence->column <= sequence->second_count; sequence->column++) {
            CAIRN_STEP_CHARGE_UNIT(sequence, part_resume, budget);
            sum_from_any(sequence);
        }
    sequence->score = sequence->best;
    if (sequence->score > 0) {
        sequence->job.last_row = sequence->best_row;
        sequence->job.last_column = sequence->best_column;
        sequence->best = 0;
        for (sequence->row = sequence->job.last_row; sequence->row >= 0; sequence->row--)
            for (sequence->column = sequence->job.last_column; sequence->column >= 0;
                 sequence->column--) {
                CAIRN_STEP_CHARGE_UNIT(sequence, part_resume, budget);
                sum_to_end(sequence);
            }
        sequence->job.first_row = sequence->best_row;
        sequence->job.first_column = sequence->best_column;
    }
    CAIRN_STEP_END(sequence->part_resume);
}

/* ---- The path ---- */

/* Rows of the forward and the backward sums at the split of the job: the same, or adjacent rows in a
 * job of one row of elements. */
static int32_t middle_row(const cairn_sequence *sequence)
{
    return sequence->job.first_row + (sequence->job.last_row - sequence->job.first_row) / 2;
}

static int32_t below_row(const cairn_sequence *sequence)
{
    return sequence->job.last_row - sequence->job.first_row == 1 ? sequence->job.last_row
                                                                 : middle_row(sequence);
}

/* Takes a job off the stack. */
static void take_job(cairn_sequence *sequence)
{
    sequence->job = sequence->jobs[--sequence->job_count];
    sequence->best = 2 * IMPOSSIBLE_GAIN;
    sequence->best_column = sequence->job.first_column;
    sequence->best_is_diagonal = 0;
}

/* Sum from the start of the job to the current node. */
static void sum_forward(cairn_sequence *sequence)
{
    int32_t is_start =
        sequence->row == sequence->job.first_row && sequence->column == sequence->job.first_column;

    sequence->forward[sequence->column] =
        is_start ? 0 : best_arriving(sequence, sequence->job.first_row, sequence->job.first_column);
}

/* Sum from the current node to the end of the job. */
static void sum_backward(cairn_sequence *sequence)
{
    sequence->backward[sequence->column] =
        best_leaving(sequence, sequence->job.last_row, sequence->job.last_column);
}

/* Keeps the current column as the split if its sum is greater than the best so far. */
static void consider_split(cairn_sequence *sequence, cairn_real sum, int32_t is_diagonal)
{
    if (sum <= sequence->best)
        return;
    sequence->best = sum;
    sequence->best_column = sequence->column;
    sequence->best_is_diagonal = is_diagonal;
}

/* Pushes a job. */
static void push_job(cairn_sequence *sequence, int32_t first_row, int32_t last_row,
                     int32_t first_column, int32_t last_column)
{
    sequence_job job = {.first_row = first_row,
                        .last_row = last_row,
                        .first_column = first_column,
                        .last_column = last_column};

    CAIRN_ASSERT(sequence->job_count < MAX_JOBS);
    sequence->jobs[sequence->job_count++] = job;
}

/* Tests a node of the middle row, or a move between the two adjacent rows. */
static void test_split(cairn_sequence *sequence)
{
    const sequence_job *job = &sequence->job;
    int32_t is_dtw = sequence->params.kind == CAIRN_SEQUENCE_DTW, j = sequence->column;
    cairn_real pair_gain, skip_gain;

    if (below_row(sequence) == middle_row(sequence)) {
        move_gains(sequence, middle_row(sequence), j, &pair_gain, &skip_gain);
        consider_split(sequence,
                       sequence->forward[j] + sequence->backward[j] - (is_dtw ? skip_gain : 0), 0);
    } else {
        move_gains(sequence, below_row(sequence), j + 1 <= job->last_column ? j + 1 : j, &pair_gain,
                   &skip_gain);
        if (j < job->last_column)
            consider_split(
                sequence,
                sequence->forward[j] + sequence->backward[j + 1] + (is_dtw ? 0 : pair_gain), 1);
        consider_split(sequence,
                       sequence->forward[j] + sequence->backward[j] + (is_dtw ? 0 : skip_gain), 0);
    }
}

/* 1 when the job is the whole table. */
static int is_whole(const cairn_sequence *sequence)
{
    const sequence_job *job = &sequence->job;

    return job->first_row == 0 && job->first_column == 0 &&
           job->last_row == sequence->first_count && job->last_column == sequence->second_count;
}

/* Splits the job into two at the best node of the middle row. */
static void split_job(cairn_sequence *sequence)
{
    const sequence_job *job = &sequence->job;

    push_job(sequence, middle_row(sequence), job->last_row, sequence->best_column,
             job->last_column);
    push_job(sequence, job->first_row, middle_row(sequence), job->first_column,
             sequence->best_column);
}

/* Appends the pair of the current node. */
static void append_pair(cairn_sequence *sequence)
{
    if (sequence->row > 0 && sequence->column > 0) {
        sequence->pairs[sequence->pair_count].first = sequence->row - 1;
        sequence->pairs[sequence->pair_count++].second = sequence->column - 1;
    }
}

/* One move of a path through two adjacent rows: along the first, down at the split, along the
 * second. 0 at the end of the path. */
static int trace_move(cairn_sequence *sequence)
{
    const sequence_job *job = &sequence->job;
    int32_t is_dtw = sequence->params.kind == CAIRN_SEQUENCE_DTW,
            moves_down = sequence->row < job->last_row && sequence->column == sequence->best_column;

    if (sequence->row == job->last_row && sequence->column == job->last_column)
        return 0;
    sequence->row += moves_down;
    sequence->column += moves_down ? sequence->best_is_diagonal : 1;
    if (is_dtw || (moves_down && sequence->best_is_diagonal))
        append_pair(sequence);
    return 1;
}

/* The split of the job: sums to its middle row, from there to its end, and the node with the best
 * total. */
static int find_split(cairn_sequence *sequence, cairn_budget *budget)
{
    const sequence_job *job = &sequence->job;

    CAIRN_STEP_BEGIN(sequence->part_resume);
    for (sequence->row = job->first_row; sequence->row <= middle_row(sequence); sequence->row++)
        for (sequence->column = job->first_column; sequence->column <= job->last_column;
             sequence->column++) {
            CAIRN_STEP_CHARGE_UNIT(sequence, part_resume, budget);
            sum_forward(sequence);
        }
    for (sequence->row = job->last_row; sequence->row >= below_row(sequence); sequence->row--)
        for (sequence->column = job->last_column; sequence->column >= job->first_column;
             sequence->column--) {
            CAIRN_STEP_CHARGE_UNIT(sequence, part_resume, budget);
            sum_backward(sequence);
        }
    for (sequence->column = job->first_column; sequence->column <= job->last_column;
         sequence->column++) {
        CAIRN_STEP_CHARGE_UNIT(sequence, part_resume, budget);
        test_split(sequence);
    }
    CAIRN_STEP_END(sequence->part_resume);
}

/* The alignment: see Method in the head of this file. */
static int align(cairn_sequence *sequence, cairn_budget *budget)
{
    int32_t is_local = sequence->params.kind == CAIRN_SEQUENCE_LOCAL;

    CAIRN_STEP_BEGIN(sequence->resume);
    if (is_local)
        CAIRN_STEP_RUN(sequence, resume, budget, find_local);
    if (!is_local)
        push_job(sequence, 0, sequence->first_count, 0, sequence->second_count);
    else if (sequence->score > 0)
        sequence->jobs[sequence->job_count++] = sequence->job;
    while (sequence->job_count > 0) {
        CAIRN_STEP_CHARGE_UNIT(sequence, resume, budget);
        take_job(sequence);
        CAIRN_STEP_RUN(sequence, resume, budget, find_split);
        if (!is_local && is_whole(sequence))
            sequence->score =
                sequence->params.kind == CAIRN_SEQUENCE_DTW ? -sequence->best : sequence->best;
        if (below_row(sequence) == middle_row(sequence)) {
            split_job(sequence);
        } else {
            sequence->row = sequence->job.first_row;
            sequence->column = sequence->job.first_column;
            do
                CAIRN_STEP_CHARGE_UNIT(sequence, resume, budget);
            while (trace_move(sequence));
        }
    }
    if (!is_local || sequence->score > 0)
        CAIRN_STEP_CHARGE_UNIT(sequence, resume, budget);
    CAIRN_STEP_END(sequence->resume);
}

cairn_status cairn_sequence_step(cairn_sequence *sequence, cairn_budget *budget)
{
    if (sequence == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (sequence->status == CAIRN_MORE && !align(sequence, budget))
        return CAIRN_MORE;
    if (sequence->status == CAIRN_MORE)
        sequence->status = CAIRN_OK;
    return CAIRN_OK;
}

cairn_sequence_result cairn_sequence_read(const cairn_sequence *sequence)
{
    cairn_sequence_result result = {0};

    if (sequence->status == CAIRN_OK) {
        result.pairs = sequence->pairs;
        result.count = sequence->pair_count;
        result.score = sequence->score;
    }
    return result;
}
