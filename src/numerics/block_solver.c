/* Sparse LDL^T solver for systems of 3 x 3 blocks: structure, values and steps.
 *
 * Method:
 * 1. Fill-reducing ordering (block_solver_order.c) and pattern of the factor
 *    (block_solver_pattern.c).
 * 2. Every link stores the index of the factor's block that holds its own block, and values are
 *    added there directly: H is not stored separately, the factor and later the inverse overwrite
 *    H.
 * 3. Numeric factorization and substitution (block_solver_factor.c).
 * 4. Selected inverse (block_solver_inverse.c).
 *
 * Limits: no pivoting and no iterative refinement, which positive definite systems do not need. In
 * float a system whose pivots fall below 1e-5 of its diagonal is refused. */
#include "src/base/build.h"

#include <string.h>

#include "src/numerics/block_solver_work.h"

enum { MAX_POSES = 1 << 22, MAX_LINKS = 1 << 24, MAX_FILL = 1 << 26 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_block_solver_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter parameter_rows[] = {
    INTEGER(max_poses, 1000, 1, MAX_POSES),
    INTEGER(max_links, 3000, 0, MAX_LINKS),
    INTEGER(max_fill, 12000, 0, MAX_FILL),
};
const cairn_parameters cairn_block_solver_parameters =
    CAIRN_PARAMETERS("block_solver", cairn_block_solver_params, parameter_rows);

cairn_block_solver_params cairn_block_solver_default(void)
{
    cairn_block_solver_params params;

    cairn_parameters_preset(&cairn_block_solver_parameters, &params);
    return params;
}

cairn_status cairn_block_solver_check(const cairn_block_solver_params *params,
                                      cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_block_solver_parameters, params, fault);
}

/* Allocates the arrays whose size is the fill; of a counting pool, where solver is NULL, only their
 * bytes. */
static void take_fill(cairn_block_solver *solver, cairn_pool *pool, int32_t max_fill)
{
    CAIRN_TAKE(solver, pool, rows, max_fill);
    CAIRN_TAKE(solver, pool, blocks, max_fill);
}

/* Allocates the arrays of the ordering; `score` shares memory with `column`. */
static void take_ordering(cairn_block_solver *solver, cairn_pool *pool,
                          const cairn_block_solver_params *params)
{
    size_t poses = (size_t)params->max_poses, links = (size_t)params->max_links;

    CAIRN_TAKE(solver, pool, ordering.graph, 2 * links + poses);
    CAIRN_TAKE(solver, pool, ordering.start, poses + 1);
    CAIRN_TAKE(solver, pool, ordering.length, poses);
    CAIRN_TAKE(solver, pool, ordering.elements, poses);
    CAIRN_TAKE(solver, pool, ordering.degree, poses);
    CAIRN_TAKE(solver, pool, ordering.size, poses);
    CAIRN_TAKE(solver, pool, ordering.mark, poses);
    CAIRN_TAKE(solver, pool, ordering.next_member, poses);
    CAIRN_TAKE(solver, pool, ordering.last_member, poses);
    CAIRN_TAKE(solver, pool, ordering.head, poses);
    CAIRN_TAKE(solver, pool, ordering.next, poses);
    CAIRN_TAKE(solver, pool, ordering.previous, poses);
    CAIRN_TAKE(solver, pool, ordering.hash_head, poses);
    if (solver != NULL)
        solver->ordering.score = solver->column;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_block_solver *build(cairn_pool *pool, const cairn_block_solver_params *params)
{
    size_t poses = (size_t)params->max_poses, links = (size_t)params->max_links;
    cairn_block_solver *solver = cairn_object_take(pool, sizeof *solver);

    CAIRN_TAKE(solver, pool, first, links);
    CAIRN_TAKE(solver, pool, second, links);
    CAIRN_TAKE(solver, pool, slot, links);
    CAIRN_TAKE(solver, pool, order, poses);
    CAIRN_TAKE(solver, pool, position, poses);
    CAIRN_TAKE(solver, pool, column, poses + 1);
    take_fill(solver, pool, params->max_fill);
    CAIRN_TAKE(solver, pool, diagonal, poses);
    CAIRN_TAKE(solver, pool, x, poses);
    CAIRN_TAKE(solver, pool, sums, poses);
    CAIRN_TAKE(solver, pool, panel.factor, BLOCK_SOLVER_PANEL_REALS);
    take_ordering(solver, pool, params);
    if (solver != NULL) {
        solver->params = *params;
        solver->result.failed_pose = -1;
        solver->is_closed = 1;
    }
    return solver;
}

CAIRN_OBJECT(block_solver, block_solver, build);

/* ---- Structure ---- */

/* Begins a stage; one that runs is dropped. */
static void begin_stage(cairn_block_solver *solver, block_solver_stage stage)
{
    solver->stage = stage;
    solver->units_charged = 0;
    solver->resume = solver->part_resume = 0;
}

cairn_status cairn_block_solver_begin(cairn_block_solver *solver, int32_t poses)
{
    int64_t units;

    if (solver == NULL || poses < 1)
        return CAIRN_BAD_ARGUMENT;
    if (poses > solver->params.max_poses)
        return CAIRN_FULL;
    units = solver->result.units;
    memset(&solver->result, 0, sizeof solver->result);
    solver->result.poses = poses;
    solver->result.failed_pose = -1;
    solver->result.units = units;
    begin_stage(solver, BLOCK_SOLVER_IDLE);
    solver->is_closed = 0;
    solver->solved = 0;
    return CAIRN_OK;
}

/* 1 while step() has work left. */
static int is_running(const cairn_block_solver *solver)
{
    return solver->stage != BLOCK_SOLVER_IDLE;
}

/* 1 when no stage runs and the solver is in a state. */
static int is_in(const cairn_block_solver *solver, cairn_block_solver_state state)
{
    return solver != NULL && !is_running(solver) && solver->result.state == state;
}

/* 1 when the structure has a pose. */
static int has_pose(const cairn_block_solver *solver, int32_t pose)
{
    return pose >= 0 && pose < solver->result.poses;
}

cairn_status cairn_block_solver_add_link(cairn_block_solver *solver, int32_t first, int32_t second)
{
    int32_t link;

    if (solver == NULL || solver->is_closed || !has_pose(solver, first) ||
        !has_pose(solver, second) || first == second)
        return CAIRN_BAD_ARGUMENT;
    link = solver->result.links;
    if (link == solver->params.max_links)
        return CAIRN_FULL;
    solver->first[link] = first;
    solver->second[link] = second;
    solver->result.links++;
    return CAIRN_OK;
}

cairn_status cairn_block_solver_analyze(cairn_block_solver *solver)
{
    if (solver == NULL || solver->is_closed)
        return CAIRN_BAD_ARGUMENT;
    solver->is_closed = 1;
    cairn_block_solver_order_begin(solver);
    begin_stage(solver, BLOCK_SOLVER_ANALYZE);
    return CAIRN_OK;
}

size_t cairn_block_solver_extend_memory(int32_t max_fill)
{
    cairn_pool counting;

    if (max_fill < 1 || max_fill > MAX_FILL)
        return 0;
    cairn_pool_init_counting(&counting);
    take_fill(NULL, &counting, max_fill);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_block_solver_extend(cairn_block_solver *solver, cairn_pool *pool,
                                       int32_t max_fill)
{
    size_t need = cairn_block_solver_extend_memory(max_fill);

    if (pool == NULL || need == 0 || !is_in(solver, CAIRN_BLOCK_SOLVER_NEW) || !solver->is_closed ||
        solver->result.fill <= solver->params.max_fill || solver->result.fill > max_fill)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    take_fill(solver, pool, max_fill);
    solver->params.max_fill = max_fill;
    begin_stage(solver, BLOCK_SOLVER_FILL);
    return CAIRN_OK;
}

/* ---- Values ---- */

cairn_status cairn_block_solver_clear(cairn_block_solver *solver)
{
    if (solver == NULL || is_running(solver) || solver->result.state == CAIRN_BLOCK_SOLVER_NEW)
        return CAIRN_BAD_ARGUMENT;
    if (!solver->is_zero)
        cairn_block_solver_clear_values(solver);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_add_pose_block(cairn_block_solver *solver, int32_t pose,
                                               cairn_sym3 block)
{
    cairn_sym3 *sum;

    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED) || !has_pose(solver, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!(cairn_is_finite(block.xx) && cairn_is_finite(block.xy) && cairn_is_finite(block.xz) &&
          cairn_is_finite(block.yy) && cairn_is_finite(block.yz) && cairn_is_finite(block.zz)))
        return CAIRN_NOT_FINITE;
    solver->is_zero = 0;
    sum = &solver->diagonal[solver->position[pose]];
    sum->xx += block.xx;
    sum->xy += block.xy;
    sum->xz += block.xz;
    sum->yy += block.yy;
    sum->yz += block.yz;
    sum->zz += block.zz;
    solver->is_coupled |= block.xz != 0 || block.yz != 0;
    return CAIRN_OK;
}

/* a += b, or a += b^T. */
static void add_block(cairn_real a[9], const cairn_real b[9], int transposed)
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            a[3 * r + c] += transposed ? b[3 * c + r] : b[3 * r + c];
}

cairn_status cairn_block_solver_add_link_block(cairn_block_solver *solver, int32_t link,
                                               const cairn_real block[9])
{
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED) || link < 0 || link >= solver->result.links ||
        block == NULL)
        return CAIRN_BAD_ARGUMENT;
    for (int k = 0; k < 9; k++)
        if (!cairn_is_finite(block[k]))
            return CAIRN_NOT_FINITE;
    solver->is_zero = 0;
    add_block(solver->blocks[solver->slot[link]], block,
              solver->position[solver->first[link]] < solver->position[solver->second[link]]);
    solver->is_coupled |=
        block[2] != 0 || block[5] != 0 || block[6] != 0 || block[7] != 0 || block[8] != 0;
    return CAIRN_OK;
}

/* ---- Stages ---- */

cairn_status cairn_block_solver_factor(cairn_block_solver *solver)
{
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED))
        return CAIRN_BAD_ARGUMENT;
    solver->is_zero = 0;
    cairn_block_solver_factor_begin(solver);
    begin_stage(solver, BLOCK_SOLVER_FACTOR);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_solve(cairn_block_solver *solver, const cairn_real *b)
{
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_FACTORED) || b == NULL)
        return CAIRN_BAD_ARGUMENT;
    for (int32_t i = 0; i < 3 * solver->result.poses; i++)
        if (!cairn_is_finite(b[i]))
            return CAIRN_NOT_FINITE;
    for (int32_t i = 0; i < solver->result.poses; i++)
        memcpy(solver->x[solver->position[i]], &b[3 * i], sizeof *solver->x);
    solver->solved = 0;
    begin_stage(solver, BLOCK_SOLVER_SOLVE);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_solution(const cairn_block_solver *solver, int32_t pose,
                                         cairn_real x[3])
{
    if (solver == NULL || x == NULL || !has_pose(solver, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!solver->solved)
        return CAIRN_EMPTY;
    memcpy(x, solver->x[solver->position[pose]], sizeof *solver->x);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_invert(cairn_block_solver *solver)
{
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_FACTORED))
        return CAIRN_BAD_ARGUMENT;
    cairn_block_solver_inverse_begin(solver);
    begin_stage(solver, BLOCK_SOLVER_INVERT);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_covariance(const cairn_block_solver *solver, int32_t first,
                                           int32_t second, cairn_real block[9])
{
    int32_t a, b, block_index;

    if (solver == NULL || block == NULL || !has_pose(solver, first) || !has_pose(solver, second))
        return CAIRN_BAD_ARGUMENT;
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_INVERTED))
        return CAIRN_EMPTY;
    a = solver->position[first];
    b = solver->position[second];
    if (a == b) {
        cairn_sym3_to_full(solver->diagonal[a], block);
        return CAIRN_OK;
    }
    block_index = cairn_block_solver_find_block(solver, a > b ? a : b, a > b ? b : a);
    if (block_index < 0)
        return CAIRN_UNSUPPORTED;
    memset(block, 0, sizeof *solver->blocks);
    add_block(block, solver->blocks[block_index], a < b);
    return CAIRN_OK;
}

/* The stage that runs. */
static int run_stage(cairn_block_solver *solver, cairn_budget *budget)
{
    switch (solver->stage) {
    case BLOCK_SOLVER_ANALYZE:
    case BLOCK_SOLVER_FILL:
        return cairn_block_solver_analysis(solver, budget);
    case BLOCK_SOLVER_FACTOR:
        return cairn_block_solver_factorize(solver, budget);
    case BLOCK_SOLVER_SOLVE:
        return cairn_block_solver_substitute(solver, budget);
    default:
        return cairn_block_solver_inverse(solver, budget);
    }
}

cairn_status cairn_block_solver_step(cairn_block_solver *solver, cairn_budget *budget)
{
    int32_t before = budget->left;
    int done;

    if (!is_running(solver))
        return CAIRN_OK;
    done = run_stage(solver, budget);
    solver->result.units += before - budget->left;
    if (!done)
        return CAIRN_MORE;
    solver->stage = BLOCK_SOLVER_IDLE;
    return solver->outcome;
}

cairn_block_solver_result cairn_block_solver_read(const cairn_block_solver *solver)
{
    cairn_block_solver_result result = solver->result;

    result.running = is_running(solver);
    return result;
}
