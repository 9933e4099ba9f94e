/* Block-sparse LDL^T of pose systems: structure, values and steps. The parts are in files of their
 * own: the ordering (block_solver_order.c), pattern of the factor (block_solver_pattern.c), factor
 * and solution (block_solver_factor.c), selected inverse (block_solver_inverse.c).
 *
 * Method: every link knows the block of the factor in which its own block comes to lie, and values
 * are added there at once: H is stored nowhere else, the factor and later the inverse take its
 * place.
 *
 * Limits: no pivoting and no refinement, as positive definite systems need none; in float a
 * system whose pivots fall below 1e-5 of its diagonal is refused. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/block_solver_work.h"

enum { MAX_POSES = 1 << 22, MAX_LINKS = 1 << 24, MAX_FILL = 1 << 26 };

cairn_block_solver_params cairn_block_solver_default(void)
{
    cairn_block_solver_params params = {1000, 3000, 12000};
    return params;
}

static int params_are_good(const cairn_block_solver_params *params)
{
    return params != NULL && params->max_poses >= 1 && params->max_poses <= MAX_POSES &&
           params->max_links >= 0 && params->max_links <= MAX_LINKS && params->max_fill >= 0 &&
           params->max_fill <= MAX_FILL;
}

static void carve_order(struct cairn_block_order *o, cairn_pool *pool,
                        const cairn_block_solver_params *params)
{
    size_t poses = (size_t)params->max_poses;
    int32_t **const arrays[] = {&o->length, &o->elements, &o->degree, &o->size,
                                &o->mark,   &o->member,   &o->tail,   &o->head,
                                &o->next,   &o->previous, &o->hashes};

    o->graph = cairn_pool_take(pool, 2 * (size_t)params->max_links + poses, sizeof *o->graph);
    o->start = cairn_pool_take(pool, poses + 1, sizeof *o->start);
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++)
        *arrays[k] = cairn_pool_take(pool, poses, sizeof(int32_t));
}

static void carve_fill(cairn_block_solver *s, cairn_pool *pool, size_t fill)
{
    s->rows = cairn_pool_take(pool, fill, sizeof *s->rows);
    s->blocks = cairn_pool_take(pool, fill, sizeof *s->blocks);
}

/* Sets the pointers of *s, which is then to be copied to the first piece that was taken. */
static cairn_block_solver *carve(cairn_block_solver *s, cairn_pool *pool,
                                 const cairn_block_solver_params *params)
{
    size_t poses = (size_t)params->max_poses, links = (size_t)params->max_links,
           fill = (size_t)params->max_fill;
    cairn_block_solver *made = cairn_pool_take_one(pool, sizeof *made);

    s->first = cairn_pool_take(pool, links, sizeof *s->first);
    s->second = cairn_pool_take(pool, links, sizeof *s->second);
    s->slot = cairn_pool_take(pool, links, sizeof *s->slot);
    s->order = cairn_pool_take(pool, poses, sizeof *s->order);
    s->place = cairn_pool_take(pool, poses, sizeof *s->place);
    s->column = cairn_pool_take(pool, poses + 1, sizeof *s->column);
    carve_fill(s, pool, fill);
    s->diagonal = cairn_pool_take(pool, poses, sizeof *s->diagonal);
    s->x = cairn_pool_take(pool, poses, sizeof *s->x);
    s->sums = cairn_pool_take(pool, poses, sizeof *s->sums);
    s->p.factor = cairn_pool_take(pool, BLOCK_SOLVER_FACTOR, sizeof *s->p.factor);
    carve_order(&s->o, pool, params);
    s->o.score = s->column;
    return made;
}

size_t cairn_block_solver_memory(const cairn_block_solver_params *params)
{
    cairn_block_solver layout;
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&layout, &counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_block_solver_create(cairn_block_solver **solver, cairn_pool *pool,
                                       const cairn_block_solver_params *params)
{
    size_t need = cairn_block_solver_memory(params);
    cairn_block_solver layout;
    cairn_block_solver *made;

    if (solver == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    memset(&layout, 0, sizeof layout);
    made = carve(&layout, pool, params);
    layout.params = *params;
    layout.result.pose = -1;
    layout.closed = 1;
    *made = layout;
    *solver = made;
    return CAIRN_OK;
}

/* ---- Structure ---- */

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
    solver->result.pose = -1;
    solver->result.units = units;
    solver->phase = BLOCK_SOLVER_IDLE;
    solver->debt = 0;
    solver->closed = 0;
    solver->solved = 0;
    solver->outcome = CAIRN_OK;
    return CAIRN_OK;
}

static int is_running(const cairn_block_solver *s)
{
    return s->phase != BLOCK_SOLVER_IDLE || s->debt > 0 || s->outcome != CAIRN_OK;
}

static int is_in(const cairn_block_solver *s, cairn_block_solver_state state)
{
    return s != NULL && !is_running(s) && s->result.state == state;
}

static int has_pose(const cairn_block_solver *s, int32_t pose)
{
    return pose >= 0 && pose < s->result.poses;
}

cairn_status cairn_block_solver_add_link(cairn_block_solver *solver, int32_t first, int32_t second)
{
    int32_t link;

    if (solver == NULL || solver->closed || !has_pose(solver, first) || !has_pose(solver, second) ||
        first == second)
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
    if (solver == NULL || solver->closed)
        return CAIRN_BAD_ARGUMENT;
    solver->closed = 1;
    cairn_block_order_begin(solver);
    return CAIRN_OK;
}

size_t cairn_block_solver_extend_memory(int32_t max_fill)
{
    cairn_block_solver layout;
    cairn_pool counting;

    if (max_fill < 1 || max_fill > MAX_FILL)
        return 0;
    cairn_pool_init_counting(&counting);
    carve_fill(&layout, &counting, (size_t)max_fill);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_block_solver_extend(cairn_block_solver *solver, cairn_pool *pool,
                                       int32_t max_fill)
{
    size_t need = cairn_block_solver_extend_memory(max_fill);

    if (pool == NULL || need == 0 || !is_in(solver, CAIRN_BLOCK_SOLVER_NEW) || !solver->closed ||
        solver->result.fill <= solver->params.max_fill || solver->result.fill > max_fill)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    carve_fill(solver, pool, (size_t)max_fill);
    solver->params.max_fill = max_fill;
    cairn_block_pattern_go_on(solver);
    return CAIRN_OK;
}

/* ---- Values ---- */

static void clear_values(cairn_block_solver *s)
{
    memset(s->diagonal, 0, (size_t)s->result.poses * sizeof *s->diagonal);
    memset(s->blocks, 0, (size_t)s->result.fill * sizeof *s->blocks);
    s->empty = 1;
    s->solved = 0;
    s->coupled = 0;
    s->result.pose = -1;
    s->result.state = CAIRN_BLOCK_SOLVER_ANALYZED;
}

cairn_status cairn_block_solver_clear(cairn_block_solver *solver)
{
    if (solver == NULL || is_running(solver) || solver->result.state == CAIRN_BLOCK_SOLVER_NEW)
        return CAIRN_BAD_ARGUMENT;
    if (!solver->empty)
        clear_values(solver);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_add_pose_block(cairn_block_solver *solver, int32_t pose,
                                               cairn_sym3 block)
{
    cairn_sym3 *to;

    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED) || !has_pose(solver, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!(cairn_is_finite(block.xx) && cairn_is_finite(block.xy) && cairn_is_finite(block.xz) &&
          cairn_is_finite(block.yy) && cairn_is_finite(block.yz) && cairn_is_finite(block.zz)))
        return CAIRN_NOT_FINITE;
    solver->empty = 0;
    to = &solver->diagonal[solver->place[pose]];
    to->xx += block.xx;
    to->xy += block.xy;
    to->xz += block.xz;
    to->yy += block.yy;
    to->yz += block.yz;
    to->zz += block.zz;
    solver->coupled |= block.xz != 0 || block.yz != 0;
    return CAIRN_OK;
}

/* a += b or b^T */
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
    solver->empty = 0;
    add_block(solver->blocks[solver->slot[link]], block,
              solver->place[solver->first[link]] < solver->place[solver->second[link]]);
    solver->coupled |=
        block[2] != 0 || block[5] != 0 || block[6] != 0 || block[7] != 0 || block[8] != 0;
    return CAIRN_OK;
}

/* ---- Parts ---- */

cairn_status cairn_block_solver_factor(cairn_block_solver *solver)
{
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_ANALYZED))
        return CAIRN_BAD_ARGUMENT;
    solver->empty = 0;
    cairn_block_factor_begin(solver);
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
        memcpy(solver->x[solver->place[i]], &b[3 * i], sizeof *solver->x);
    solver->solved = 0;
    solver->at = 0;
    solver->phase = BLOCK_SOLVER_FORWARD;
    return CAIRN_OK;
}

cairn_status cairn_block_solver_solution(const cairn_block_solver *solver, int32_t pose,
                                         cairn_real x[3])
{
    if (solver == NULL || x == NULL || !has_pose(solver, pose))
        return CAIRN_BAD_ARGUMENT;
    if (!solver->solved)
        return CAIRN_EMPTY;
    memcpy(x, solver->x[solver->place[pose]], sizeof *solver->x);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_invert(cairn_block_solver *solver)
{
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_FACTORED))
        return CAIRN_BAD_ARGUMENT;
    cairn_block_inverse_begin(solver);
    return CAIRN_OK;
}

cairn_status cairn_block_solver_covariance(const cairn_block_solver *solver, int32_t first,
                                           int32_t second, cairn_real block[9])
{
    int32_t a, b, at;

    if (solver == NULL || block == NULL || !has_pose(solver, first) || !has_pose(solver, second))
        return CAIRN_BAD_ARGUMENT;
    if (!is_in(solver, CAIRN_BLOCK_SOLVER_INVERTED))
        return CAIRN_EMPTY;
    a = solver->place[first];
    b = solver->place[second];
    if (a == b) {
        cairn_sym3 d = solver->diagonal[a];
        const cairn_real rows[9] = {d.xx, d.xy, d.xz, d.xy, d.yy, d.yz, d.xz, d.yz, d.zz};

        memcpy(block, rows, sizeof rows);
        return CAIRN_OK;
    }
    at = cairn_block_find(solver, a > b ? a : b, a > b ? b : a);
    if (at < 0)
        return CAIRN_UNSUPPORTED;
    memset(block, 0, sizeof *solver->blocks);
    add_block(block, solver->blocks[at], a < b);
    return CAIRN_OK;
}

/* One item of the part that runs; returns its units. */
static int32_t do_item(cairn_block_solver *s)
{
    if (s->phase <= BLOCK_SOLVER_FINISH)
        return cairn_block_order_item(s);
    if (s->phase <= BLOCK_SOLVER_SLOT) {
        int32_t units = cairn_block_pattern_item(s);

        if (s->result.state != CAIRN_BLOCK_SOLVER_ANALYZED)
            return units;
        clear_values(s);
        return units + (s->result.poses + s->result.fill) / BLOCK_SOLVER_ENTRIES;
    }
    if (s->phase <= BLOCK_SOLVER_SUBTRACT)
        return cairn_block_factor_item(s);
    if (s->phase <= BLOCK_SOLVER_BACKWARD)
        return cairn_block_solve_item(s);
    return cairn_block_inverse_item(s);
}

cairn_status cairn_block_solver_step(cairn_block_solver *solver, cairn_budget *budget)
{
    cairn_status outcome;

    while (solver->phase != BLOCK_SOLVER_IDLE || solver->debt > 0) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (solver->debt > 0) {
            int32_t paid = solver->debt < budget->left ? solver->debt : budget->left;

            solver->debt -= paid;
            budget->left -= paid;
        } else {
            solver->debt = do_item(solver);
            solver->result.units += solver->debt;
        }
    }
    outcome = solver->outcome;
    solver->outcome = CAIRN_OK;
    return outcome;
}

cairn_block_solver_result cairn_block_solver_read(const cairn_block_solver *solver)
{
    cairn_block_solver_result result = solver->result;

    result.running = is_running(solver);
    return result;
}
