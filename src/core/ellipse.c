/* Votes for centres, radii about the greatest of them, and the ellipses that come of these circles.
 *
 * Method: a point votes, in a square of cells, for all centres along its normal between the least
 * and the greatest radius; rooms are sought on its free side and columns on the other, each in a
 * square of their own. The square is smoothed, as normals are poorly known far from their points.
 * About every peak a histogram of distances, of points whose normals pass by it, gives a circle
 * (ellipse_refine.c). Three passes of least squares over conics (ellipse_fit.c), each with a
 * narrower gate, make it an ellipse; a last pass measures what covers it. Ellipses that came to lie
 * on a stronger one are dropped.
 *
 * Layout: the squares of votes, room after room; the peaks; two lists of ellipses, one in work, one
 * that readers see.
 *
 * Limits: one radius for a peak and kind; of concentric walls that with the most points. Ellipses
 * of more than one to two have normals that pass their centre too far off to peak there. Cells get
 * wider when points reach too far for them.
 *
 * Source: Duda and Hart 1972; Ballard 1981. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/ellipse_work.h"

#define LIMIT CAIRN_REAL(1e6)

cairn_ellipse_params cairn_ellipse_default(void)
{
    cairn_ellipse_params params = {
        .max_ellipses = 32,
        .cells = 96,
        .cell = CAIRN_REAL(0.15),
        .oriented = 1,
        .least_radius = CAIRN_REAL(0.15),
        .most_radius = 6,
        .most_ratio = 2,
        .angle_tolerance = 15 * (CAIRN_PI / 180),
        .support_distance = CAIRN_REAL(0.05),
        .spacing = CAIRN_REAL(0.10),
        .least_votes = 8,
        .least_covered = CAIRN_REAL(0.5),
        .separation = CAIRN_REAL(0.3),
    };
    return params;
}

static int is_length(cairn_real x)
{
    return x > 0 && x <= LIMIT;
}

static int params_are_valid(const cairn_ellipse_params *p)
{
    return p != NULL && p->max_ellipses >= 1 && p->max_ellipses <= 256 && p->cells >= 8 &&
           p->cells <= 1024 && is_length(p->cell) && is_length(p->least_radius) &&
           p->most_radius > p->least_radius && is_length(p->most_radius) && p->most_ratio >= 1 &&
           p->most_ratio <= LIMIT && p->angle_tolerance > 0 && p->angle_tolerance <= CAIRN_PI / 4 &&
           is_length(p->support_distance) && is_length(p->spacing) && p->least_votes > 0 &&
           cairn_is_finite(p->least_votes) && p->least_covered >= 0 && p->least_covered <= 1 &&
           is_length(p->separation);
}

static int32_t cells_of(const cairn_ellipse_params *params)
{
    return (params->oriented ? 2 : 1) * params->cells * params->cells;
}

static cairn_ellipse_set *carve(cairn_pool *pool, const cairn_ellipse_params *params)
{
    size_t ellipses = (size_t)params->max_ellipses;
    cairn_ellipse_set *set = cairn_pool_take_one(pool, sizeof *set);
    cairn_real *votes = cairn_pool_take(pool, (size_t)cells_of(params), sizeof *votes);
    ellipse_peak *peaks = cairn_pool_take(pool, ellipses, sizeof *peaks);
    cairn_ellipse *work = cairn_pool_take(pool, ellipses, sizeof *work);
    cairn_ellipse *done = cairn_pool_take(pool, ellipses, sizeof *done);

    if (set != NULL) {
        memset(set, 0, sizeof *set);
        set->votes = votes;
        set->peaks = peaks;
        set->work = work;
        set->done = done;
    }
    return set;
}

size_t cairn_ellipse_memory(const cairn_ellipse_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

static void take_params(cairn_ellipse_set *set, const cairn_ellipse_params *params)
{
    set->params = *params;
    set->sine = cairn_sin(params->angle_tolerance);
}

cairn_status cairn_ellipse_create(cairn_ellipse_set **set, cairn_pool *pool,
                                  const cairn_ellipse_params *params)
{
    size_t need = cairn_ellipse_memory(params);
    cairn_ellipse_set *made;

    if (set == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    take_params(made, params);
    made->squares = params->oriented ? 2 : 1;
    *set = made;
    return CAIRN_OK;
}

cairn_status cairn_ellipse_adjust(cairn_ellipse_set *set, const cairn_ellipse_params *params)
{
    if (set == NULL || !params_are_valid(params) ||
        params->max_ellipses != set->params.max_ellipses || params->cells != set->params.cells ||
        (params->oriented != 0) != (set->params.oriented != 0))
        return CAIRN_BAD_ARGUMENT;
    set->phase = ELLIPSE_IDLE;
    take_params(set, params);
    return CAIRN_OK;
}

cairn_status cairn_ellipse_begin(cairn_ellipse_set *set, const cairn_oriented_point *points,
                                 const cairn_real *weights, int32_t count)
{
    if (set == NULL || count < 0 || (points == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    set->points = points;
    set->weights = weights;
    set->count = count;
    set->cursor = set->paid = 0;
    set->box = cairn_box_empty();
    set->peak_count = set->work_count = set->work_dropped = 0;
    set->phase = ELLIPSE_BOUNDS;
    return CAIRN_OK;
}

/* ---- Bounds ---- */

static cairn_status check(const cairn_oriented_point *p, cairn_real weight)
{
    if (!cairn_is_finite(p->position.x) || !cairn_is_finite(p->position.y) ||
        !cairn_is_finite(p->direction.x) || !cairn_is_finite(p->direction.y) ||
        !cairn_is_finite(weight))
        return CAIRN_NOT_FINITE;
    if (cairn_abs(p->position.x) > LIMIT || cairn_abs(p->position.y) > LIMIT || weight < 0 ||
        weight > LIMIT)
        return CAIRN_BAD_ARGUMENT;
    return CAIRN_OK;
}

/* Centres lie in the points' box. */
static void lay_cells(cairn_ellipse_set *set)
{
    const cairn_ellipse_params *p = &set->params;
    cairn_vec2 size = {0, 0}, middle = {0, 0};
    cairn_real half;

    if (set->count > 0) {
        size = cairn_vec2_sub(set->box.max, set->box.min);
        middle = cairn_vec2_scale(cairn_vec2_add(set->box.max, set->box.min), CAIRN_REAL(0.5));
    }
    set->cell = cairn_max(p->cell, cairn_max(size.x, size.y) / (cairn_real)(p->cells - 3));
    half = set->cell * (cairn_real)(p->cells - 1) / 2;
    set->corner.x = middle.x - half;
    set->corner.y = middle.y - half;
    set->reach =
        cairn_real_to_int(cairn_min(cairn_ceil(p->separation / set->cell), (cairn_real)p->cells));
}

static cairn_status step_bounds(cairn_ellipse_set *set, cairn_budget *budget)
{
    while (set->cursor < set->count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && set->cursor < set->count; i++, set->cursor++) {
            const cairn_oriented_point *p = &set->points[set->cursor];
            cairn_status status = check(p, cairn_ellipse_weight(set, set->cursor));

            if (status != CAIRN_OK)
                return status;
            set->box = cairn_box_extend(set->box, p->position);
        }
    }
    lay_cells(set);
    return CAIRN_OK;
}

/* ---- Votes ---- */

static cairn_status step_clear(cairn_ellipse_set *set, cairn_budget *budget)
{
    int32_t cells = cells_of(&set->params);

    while (set->cursor < cells) {
        int32_t some = cells - set->cursor < 128 ? cells - set->cursor : 128;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        memset(&set->votes[set->cursor], 0, (size_t)some * sizeof *set->votes);
        set->cursor += some;
    }
    return CAIRN_OK;
}

/* Centres along a normal that a point votes for. */
static int32_t steps_of(const cairn_ellipse_set *set)
{
    cairn_real steps = (set->params.most_radius - set->params.least_radius) / set->cell;

    return cairn_real_to_int(cairn_min(steps, (cairn_real)(2 * set->params.cells))) + 1;
}

/* The centres from a place on, along a unit normal, a cell apart. */
static void vote_along(cairn_ellipse_set *set, int32_t square, cairn_vec2 from, cairn_vec2 normal,
                       cairn_real weight)
{
    int32_t cells = set->params.cells, steps = steps_of(set);
    cairn_real *votes = &set->votes[square * cells * cells],
               least = set->params.least_radius / set->cell;
    cairn_real x = (from.x - set->corner.x) / set->cell + CAIRN_REAL(0.5) + normal.x * least;
    cairn_real y = (from.y - set->corner.y) / set->cell + CAIRN_REAL(0.5) + normal.y * least;

    for (int32_t k = 0; k < steps; k++) {
        if (x >= 0 && y >= 0 && x < (cairn_real)cells && y < (cairn_real)cells)
            votes[(int32_t)y * cells + (int32_t)x] += weight;
        x += normal.x;
        y += normal.y;
    }
}

static cairn_status step_vote(cairn_ellipse_set *set, cairn_budget *budget)
{
    for (; set->cursor < set->count; set->cursor++) {
        const cairn_oriented_point *p = &set->points[set->cursor];
        cairn_vec2 normal = cairn_vec2_left(cairn_vec2_unit(p->direction));
        cairn_real weight = cairn_ellipse_weight(set, set->cursor);

        if (!cairn_budget_pay(budget, &set->paid, 1 + steps_of(set) / 4))
            return CAIRN_MORE;
        if (!(weight > 0) || !(cairn_vec2_norm_squared(normal) > 0))
            continue;
        vote_along(set, 0, p->position, normal, weight);
        vote_along(set, set->squares - 1, p->position, cairn_vec2_scale(normal, -1), weight);
    }
    return CAIRN_OK;
}

/* ---- Peaks ---- */

/* Every value of a line of cells with its neighbours, as one to two to one. */
static void smooth_line(cairn_real *first, int32_t stride, int32_t count)
{
    cairn_real before = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_real *at = &first[i * stride], own = *at, after = i + 1 < count ? at[stride] : 0;

        *at = before + 2 * own + after;
        before = own;
    }
}

/* The rows, then the columns of a square, then the next. */
static cairn_status step_smooth(cairn_ellipse_set *set, cairn_budget *budget)
{
    int32_t cells = set->params.cells;

    for (; set->cursor < 2 * cells * set->squares; set->cursor++) {
        cairn_real *square = &set->votes[set->cursor / (2 * cells) * cells * cells];
        int32_t line = set->cursor % (2 * cells);

        if (!cairn_budget_pay(budget, &set->paid, 1 + cells / 16))
            return CAIRN_MORE;
        if (line < cells)
            smooth_line(&square[line * cells], 1, cells);
        else
            smooth_line(&square[line - cells], cells, cells);
    }
    return CAIRN_OK;
}

/* 1 when no cell near this one has more votes, or as many and comes before. */
static int is_peak(const cairn_ellipse_set *set, int32_t cell)
{
    int32_t cells = set->params.cells, square = cell - cell % (cells * cells);
    int32_t row = (cell - square) / cells, column = (cell - square) % cells;
    int32_t left = column > set->reach ? column - set->reach : 0;
    int32_t right = cells - 1 - column > set->reach ? column + set->reach : cells - 1;
    int32_t low = row > set->reach ? row - set->reach : 0;
    int32_t high = cells - 1 - row > set->reach ? row + set->reach : cells - 1;

    for (int32_t i = low; i <= high; i++)
        for (int32_t k = square + i * cells + left; k <= square + i * cells + right; k++)
            if (set->votes[k] > set->votes[cell] || (k < cell && set->votes[k] == set->votes[cell]))
                return 0;
    return 1;
}

/* Among the peaks found before, all of which come before it when they are as high. */
static void keep(cairn_ellipse_set *set, int32_t cell)
{
    int32_t cells = set->params.cells, at = set->peak_count;
    ellipse_peak p = {set->votes[cell], cell / (cells * cells), cell / cells % cells, cell % cells};

    if (at == set->params.max_ellipses) {
        set->work_dropped++;
        if (set->peaks[at - 1].votes >= p.votes)
            return;
        at--;
    } else {
        set->peak_count++;
    }
    for (; at > 0 && set->peaks[at - 1].votes < p.votes; at--)
        set->peaks[at] = set->peaks[at - 1];
    set->peaks[at] = p;
}

/* Smoothing has multiplied votes that fall into one cell by 4; from those that spread over four
 * by four one is left. */
static int may_be_peak(const cairn_ellipse_set *set, int32_t cell)
{
    return set->votes[cell] >= set->params.least_votes;
}

static cairn_status step_peaks(cairn_ellipse_set *set, cairn_budget *budget)
{
    int32_t cells = cells_of(&set->params), about = (2 * set->reach + 1) * (2 * set->reach + 1);

    while (set->cursor < cells) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (!may_be_peak(set, set->cursor)) {
            budget->left--;
            for (int32_t i = 0; i < 32 && set->cursor < cells && !may_be_peak(set, set->cursor);
                 i++)
                set->cursor++;
            continue;
        }
        if (!cairn_budget_pay(budget, &set->paid, 1 + about / 32))
            return CAIRN_MORE;
        if (is_peak(set, set->cursor)) {
            set->paid -= 1 + set->peak_count / 8; /* owed to the next item */
            keep(set, set->cursor);
        }
        set->cursor++;
    }
    return CAIRN_OK;
}

/* ---- The search ---- */

static int is_same(const cairn_ellipse_set *set, const cairn_ellipse *a, const cairn_ellipse *b)
{
    cairn_vec2 apart = {a->centre.x - b->centre.x, a->centre.y - b->centre.y};

    return a->kind == b->kind && cairn_vec2_norm(apart) < set->params.separation &&
           cairn_abs(a->half_length - b->half_length) < set->params.separation &&
           cairn_abs(a->half_width - b->half_width) < set->params.separation;
}

/* Ellipses that lie on a stronger one go; the rest is what readers see. */
static cairn_status step_thin(cairn_ellipse_set *set, cairn_budget *budget)
{
    cairn_ellipse *list = set->done;
    int32_t kept = 0;

    if (!cairn_budget_pay(budget, &set->paid, 1 + set->work_count * set->work_count / 8))
        return CAIRN_MORE;
    for (int32_t i = 0; i < set->work_count; i++) {
        int same = 0;

        for (int32_t k = 0; k < kept && !same; k++)
            same = is_same(set, &set->work[k], &set->work[i]);
        if (!same)
            set->work[kept++] = set->work[i];
    }
    set->done = set->work;
    set->done_count = kept;
    set->done_dropped = set->work_dropped;
    set->work = list;
    return CAIRN_OK;
}

static cairn_status step_phase(cairn_ellipse_set *set, cairn_budget *budget)
{
    switch (set->phase) {
    case ELLIPSE_BOUNDS:
        return step_bounds(set, budget);
    case ELLIPSE_CLEAR:
        return step_clear(set, budget);
    case ELLIPSE_VOTE:
        return step_vote(set, budget);
    case ELLIPSE_SMOOTH:
        return step_smooth(set, budget);
    case ELLIPSE_PEAKS:
        return step_peaks(set, budget);
    case ELLIPSE_FIT:
        return cairn_ellipse_refine(set, budget);
    default:
        return step_thin(set, budget);
    }
}

cairn_status cairn_ellipse_step(cairn_ellipse_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->phase != ELLIPSE_IDLE) {
        cairn_status status = step_phase(set, budget);

        if (status == CAIRN_MORE)
            return status;
        set->phase = status < 0 || set->phase == ELLIPSE_THIN ? ELLIPSE_IDLE : set->phase + 1;
        if (status < 0)
            return status;
        set->cursor = 0;
        set->item = 0;
        if (set->phase == ELLIPSE_FIT && set->peak_count > 0)
            cairn_ellipse_start_peak(set);
    }
    return CAIRN_OK;
}

const cairn_ellipse *cairn_ellipse_list(const cairn_ellipse_set *set, int32_t *count)
{
    *count = set->done_count;
    return set->done;
}

int32_t cairn_ellipse_dropped(const cairn_ellipse_set *set)
{
    return set->done_dropped;
}
