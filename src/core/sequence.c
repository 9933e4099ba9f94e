/* The best path through the table of two sequences, in linear memory.
 *
 * Method. Nodes (i, j), 0 <= i <= n, 0 <= j <= m, stand for prefixes of i and j elements. A move
 * arrives at a node diagonally (elements i - 1 and j - 1 are paired), from above, or from the left,
 * and gains something: COMMON 1 for a pair that is alike; LOCAL the pair's score, or minus the gap;
 * WARP minus the distance of elements i - 1 and j - 1 for any move. The path of the greatest sum is
 * found by halving (Hirschberg 1975): best sums from the start to the nodes of the middle row, best
 * sums from there to the end, and the node where both together are greatest is on the path. Halves
 * wait on a stack of their own; the upper one is done first, so that pairs come out in order.
 *
 * LOCAL first finds where the best piece ends (sums that are never below 0), then, backwards from
 * there, where it starts.
 *
 * Layout: one row of sums from the start and one to the end. A backward sum of WARP includes the
 * arrival at its own node, since all moves gain the same there.
 *
 * Limits: no affine gaps, no band. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/sequence.h"

enum { ELEMENTS_MOST = 1 << 24, JOBS_MOST = 32 };

/* The gain of a move that must not be. */
static const cairn_real NEVER = CAIRN_REAL(-1e30);

/* A part of the table between two nodes of the path; at least one row of elements. */
typedef struct sequence_job {
    int32_t i0, i1, j0, j1;
} sequence_job;

typedef enum sequence_phase {
    SEQUENCE_IDLE,
    SEQUENCE_END,      /* LOCAL: where the best piece ends */
    SEQUENCE_START,    /* ... and starts */
    SEQUENCE_TAKE,     /* the next job */
    SEQUENCE_FORWARD,  /* sums from the job's start to its middle row */
    SEQUENCE_BACKWARD, /* sums from the row behind it, or from itself, to the job's end */
    SEQUENCE_JOIN,
    SEQUENCE_EMIT,
    SEQUENCE_DONE
} sequence_phase;

struct cairn_sequence {
    cairn_sequence_params params;
    cairn_sequence_pair *pairs;     /* [max_first + max_second] */
    cairn_real *forward, *backward; /* [max_second + 1] */
    cairn_sequence_compare compare;
    const void *context;
    int32_t first_count, second_count;
    sequence_phase phase;
    sequence_job jobs[JOBS_MOST];
    int32_t job_count;
    sequence_job job;
    int32_t middle, bottom; /* rows of the sums that are joined: the same, or next to each other */
    int32_t i, j;           /* node under way */
    cairn_real diagonal;    /* the sum at the diagonal neighbour, which its row has overwritten */
    cairn_real best;
    int32_t best_i, best_j, best_pairs; /* best_pairs: the move between adjacent rows is diagonal */
    cairn_real score;
    int32_t pair_count;
};

cairn_sequence_params cairn_sequence_default(void)
{
    cairn_sequence_params params = {CAIRN_SEQUENCE_COMMON, 1024, 1024, 1};

    return params;
}

static int params_are_good(const cairn_sequence_params *p)
{
    return p != NULL && p->kind >= CAIRN_SEQUENCE_COMMON && p->kind <= CAIRN_SEQUENCE_WARP &&
           p->max_first >= 1 && p->max_first <= ELEMENTS_MOST && p->max_second >= 1 &&
           p->max_second <= ELEMENTS_MOST && p->gap >= 0 && p->gap <= CAIRN_REAL(1e9);
}

/* The object with its arrays; NULL from a counting pool. */
static cairn_sequence *carve(cairn_pool *pool, const cairn_sequence_params *p)
{
    cairn_sequence *x = cairn_pool_take(pool, 1, sizeof *x);
    cairn_sequence_pair *pairs =
        cairn_pool_take(pool, (size_t)p->max_first + (size_t)p->max_second, sizeof *pairs);
    cairn_real *forward = cairn_pool_take(pool, (size_t)p->max_second + 1, sizeof *forward);
    cairn_real *backward = cairn_pool_take(pool, (size_t)p->max_second + 1, sizeof *backward);

    if (x == NULL)
        return NULL;
    memset(x, 0, sizeof *x);
    x->params = *p;
    x->pairs = pairs;
    x->forward = forward;
    x->backward = backward;
    return x;
}

size_t cairn_sequence_memory(const cairn_sequence_params *params)
{
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return counting.used == SIZE_MAX ? 0 : counting.used;
}

cairn_status cairn_sequence_create(cairn_sequence **sequence, cairn_pool *pool,
                                   const cairn_sequence_params *params)
{
    size_t need = cairn_sequence_memory(params);

    if (sequence == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *sequence = carve(pool, params);
    return CAIRN_OK;
}

cairn_status cairn_sequence_begin(cairn_sequence *x, int32_t first_count, int32_t second_count,
                                  cairn_sequence_compare compare, const void *context)
{
    if (x == NULL || compare == NULL || first_count < 0 || second_count < 0)
        return CAIRN_BAD_ARGUMENT;
    if (first_count > x->params.max_first || second_count > x->params.max_second)
        return CAIRN_FULL;
    x->compare = compare;
    x->context = context;
    x->first_count = first_count;
    x->second_count = second_count;
    x->pair_count = x->job_count = 0;
    x->score = 0;
    x->i = x->j = 0;
    if (first_count == 0 || second_count == 0) {
        x->phase = SEQUENCE_DONE;
        return CAIRN_OK;
    }
    x->jobs[0].i0 = x->jobs[0].j0 = 0;
    x->jobs[0].i1 = first_count;
    x->jobs[0].j1 = second_count;
    x->best = 0;
    x->best_i = x->best_j = 0;
    if (x->params.kind == CAIRN_SEQUENCE_LOCAL) {
        x->phase = SEQUENCE_END;
    } else {
        x->job_count = 1;
        x->phase = SEQUENCE_TAKE;
    }
    return CAIRN_OK;
}

/* Gains of the moves that arrive at node (i, j). */
static void gains(const cairn_sequence *x, int32_t i, int32_t j, cairn_real *pair, cairn_real *skip)
{
    cairn_real value = i > 0 && j > 0 ? x->compare(x->context, i - 1, j - 1) : 0;

    switch (x->params.kind) {
    case CAIRN_SEQUENCE_COMMON:
        *pair = value > 0 ? 1 : NEVER;
        *skip = 0;
        break;
    case CAIRN_SEQUENCE_LOCAL:
        *pair = value;
        *skip = -x->params.gap;
        break;
    default:
        *pair = *skip = i > 0 && j > 0 ? -value : NEVER;
        break;
    }
}

/* The best sum that arrives at node (i, j) of a part that starts in row i0 and column j0. */
static cairn_real arrive(cairn_sequence *x, int32_t i0, int32_t j0)
{
    int32_t i = x->i, j = x->j;
    cairn_real pair, skip, above = i > i0 ? x->forward[j] : NEVER, best = NEVER;

    gains(x, i, j, &pair, &skip);
    if (i > i0 && j > j0)
        best = x->diagonal + pair;
    if (i > i0)
        best = cairn_max(best, above + skip);
    if (j > j0)
        best = cairn_max(best, x->forward[j - 1] + skip);
    x->diagonal = above;
    return cairn_max(best, NEVER);
}

/* The best sum from node (i, j) to the end (i1, j1) of a part; backward[j + 1] is done. */
static cairn_real leave(cairn_sequence *x, int32_t i1, int32_t j1)
{
    int32_t i = x->i, j = x->j;
    int32_t warp = x->params.kind == CAIRN_SEQUENCE_WARP;
    cairn_real pair = 0, skip = 0, below = i < i1 ? x->backward[j] : NEVER,
               best = i == i1 && j == j1 ? 0 : NEVER;

    if (warp)
        gains(x, i, j, &pair, &skip);
    else if (i < i1 || j < j1)
        gains(x, i + 1 <= i1 ? i + 1 : i, j + 1 <= j1 ? j + 1 : j, &pair, &skip);
    if (i < i1 && j < j1)
        best = x->diagonal + (warp ? 0 : pair);
    if (i < i1)
        best = cairn_max(best, below + (warp ? 0 : skip));
    if (j < j1)
        best = cairn_max(best, x->backward[j + 1] + (warp ? 0 : skip));
    if (warp)
        best += skip;
    x->diagonal = below;
    return cairn_max(best, NEVER);
}

/* ---- LOCAL: where the best piece lies ---- */

static void find_end(cairn_sequence *x)
{
    cairn_real sum = cairn_max(arrive(x, 0, 0), 0);

    x->forward[x->j] = sum;
    if (sum > x->best) {
        x->best = sum;
        x->best_i = x->i;
        x->best_j = x->j;
    }
    if (x->j++ < x->second_count)
        return;
    x->j = 0;
    if (x->i++ < x->first_count)
        return;
    x->score = x->best;
    x->job.i1 = x->i = x->best_i;
    x->job.j1 = x->j = x->best_j;
    x->best = 0;
    x->phase = x->score > 0 ? SEQUENCE_START : SEQUENCE_DONE;
}

static void find_start(cairn_sequence *x)
{
    cairn_real sum = leave(x, x->job.i1, x->job.j1);

    x->backward[x->j] = sum;
    if (sum > x->best) {
        x->best = sum;
        x->best_i = x->i;
        x->best_j = x->j;
    }
    if (x->j-- > 0)
        return;
    x->j = x->job.j1;
    if (x->i-- > 0)
        return;
    x->job.i0 = x->best_i;
    x->job.j0 = x->best_j;
    x->jobs[0] = x->job;
    x->job_count = 1;
    x->phase = SEQUENCE_TAKE;
}

/* ---- The path ---- */

static void take(cairn_sequence *x)
{
    if (x->job_count == 0) {
        x->phase = SEQUENCE_DONE;
        return;
    }
    x->job = x->jobs[--x->job_count];
    x->middle = x->job.i0 + (x->job.i1 - x->job.i0) / 2;
    x->bottom = x->job.i1 - x->job.i0 == 1 ? x->job.i1 : x->middle;
    x->i = x->job.i0;
    x->j = x->job.j0;
    x->best = 2 * NEVER;
    x->best_j = x->job.j0;
    x->best_pairs = 0;
    x->phase = SEQUENCE_FORWARD;
}

static void go_forward(cairn_sequence *x)
{
    int32_t is_start = x->i == x->job.i0 && x->j == x->job.j0;

    x->forward[x->j] = is_start ? 0 : arrive(x, x->job.i0, x->job.j0);
    if (x->j++ < x->job.j1)
        return;
    x->j = x->job.j0;
    if (x->i++ < x->middle)
        return;
    x->i = x->job.i1;
    x->j = x->job.j1;
    x->phase = SEQUENCE_BACKWARD;
}

static void go_backward(cairn_sequence *x)
{
    x->backward[x->j] = leave(x, x->job.i1, x->job.j1);
    if (x->j-- > x->job.j0)
        return;
    x->j = x->job.j1;
    if (x->i-- > x->bottom)
        return;
    x->j = x->job.j0;
    x->phase = SEQUENCE_JOIN;
}

static void offer(cairn_sequence *x, cairn_real sum, int32_t pairs)
{
    if (sum <= x->best)
        return;
    x->best = sum;
    x->best_j = x->j;
    x->best_pairs = pairs;
}

static void push(cairn_sequence *x, int32_t i0, int32_t i1, int32_t j0, int32_t j1)
{
    sequence_job job = {i0, i1, j0, j1};

    CAIRN_ASSERT(x->job_count < JOBS_MOST);
    x->jobs[x->job_count++] = job;
}

/* The node of the middle row, or the move between two adjacent rows, that the path goes through. */
static void join(cairn_sequence *x)
{
    const sequence_job *job = &x->job;
    int32_t warp = x->params.kind == CAIRN_SEQUENCE_WARP, j = x->j;
    cairn_real pair, skip;

    if (x->bottom == x->middle) {
        gains(x, x->middle, j, &pair, &skip);
        offer(x, x->forward[j] + x->backward[j] - (warp ? skip : 0), 0);
    } else {
        gains(x, x->bottom, j + 1 <= job->j1 ? j + 1 : j, &pair, &skip);
        if (j < job->j1)
            offer(x, x->forward[j] + x->backward[j + 1] + (warp ? 0 : pair), 1);
        offer(x, x->forward[j] + x->backward[j] + (warp ? 0 : skip), 0);
    }
    if (x->j++ < job->j1)
        return;
    if (job->i0 == 0 && job->j0 == 0 && job->i1 == x->first_count && job->j1 == x->second_count &&
        x->params.kind != CAIRN_SEQUENCE_LOCAL)
        x->score = warp ? -x->best : x->best;
    x->i = job->i0;
    x->j = job->j0;
    x->phase = SEQUENCE_EMIT;
    if (x->bottom != x->middle)
        return;
    push(x, x->middle, job->i1, x->best_j, job->j1);
    push(x, job->i0, x->middle, job->j0, x->best_j);
    x->phase = SEQUENCE_TAKE;
}

static void emit(cairn_sequence *x)
{
    if (x->i > 0 && x->j > 0) {
        x->pairs[x->pair_count].first = x->i - 1;
        x->pairs[x->pair_count++].second = x->j - 1;
    }
}

/* One node of a path through one or two rows: along the first, over, along the second. */
static void walk(cairn_sequence *x)
{
    const sequence_job *job = &x->job;
    int32_t warp = x->params.kind == CAIRN_SEQUENCE_WARP,
            over = x->i < job->i1 && x->j == x->best_j;

    if (x->i == job->i1 && x->j == job->j1) {
        x->phase = SEQUENCE_TAKE;
        return;
    }
    x->i += over;
    x->j += over ? x->best_pairs : 1;
    if (warp || (over && x->best_pairs))
        emit(x);
}

static void run_item(cairn_sequence *x)
{
    switch (x->phase) {
    case SEQUENCE_END:
        find_end(x);
        break;
    case SEQUENCE_START:
        find_start(x);
        break;
    case SEQUENCE_TAKE:
        take(x);
        break;
    case SEQUENCE_FORWARD:
        go_forward(x);
        break;
    case SEQUENCE_BACKWARD:
        go_backward(x);
        break;
    case SEQUENCE_JOIN:
        join(x);
        break;
    default:
        walk(x);
        break;
    }
}

cairn_status cairn_sequence_step(cairn_sequence *x, cairn_budget *budget)
{
    if (x == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    for (; x->phase != SEQUENCE_IDLE && x->phase != SEQUENCE_DONE; budget->left--) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        run_item(x);
    }
    return CAIRN_OK;
}

cairn_sequence_result cairn_sequence_read(const cairn_sequence *x)
{
    cairn_sequence_result result = {x->pairs, x->pair_count, x->score}, nothing = {NULL, 0, 0};

    return x->phase == SEQUENCE_DONE ? result : nothing;
}
