/* LDL^T by blocks, and solutions.
 *
 * Factor: H = L D L^T column by column (left-looking). In a column stands C = L D, so that nothing
 * has to be scaled: column k takes C_ik D_k^-1 C_jk^T from the block (i, j). Columns that follow
 * each other and have the same rows below are a run (a supernode) and are subtracted together from
 * a panel of up to four columns of another: the blocks of two columns in one row stay in registers
 * while the products of the run's columns are added up. The runs that are to be subtracted from a
 * panel are in lists that hang on its rows, and move on to the list of their next row behind it
 * (George and Liu 1981; Ng and Peyton 1993). When nothing couples third unknowns, the blocks' third
 * rows and columns stay zero and are left out, and what is left of the blocks of all four columns
 * stays in registers.
 *
 * Layout: columns of blocks, row-major 3 x 3, rows ascending; D^-1 in `diagonal`. The factors
 * D_k^-1 C_jk^T of a panel: [PANEL / 2] pairs of targets j, [WIDTH] source columns k, [3][6], the
 * two targets side by side; without third unknowns [WIDTH][2][8], all four side by side. What has
 * no target is zero.
 *
 * Source: George and Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981; Ng
 * and Peyton, Block sparse Cholesky algorithms on advanced uniprocessor computers, 1993. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/block_solver_work.h"

enum { PAIR = 6, PAIR_FACTOR = 3 * PAIR, FOUR = 8, FOUR_FACTOR = 2 * FOUR };

/* ---- Factor ---- */

/* Of the ordering's arrays the factor uses `size` as the first column of the run that a column
 * is in, `tail` as the last one of the run that begins with a column, `head` and `next` as the
 * lists of runs by their next row, `start` as that row's block of the last column and `mark` as
 * the place of a row in the columns of the run that is made, counted from their end. */
void cairn_block_factor_begin(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;

    for (int32_t j = 0; j < s->result.poses; j++) {
        int32_t count = s->column[j + 1] - s->column[j];
        int joins =
            j > 0 && s->column[j] - s->column[j - 1] == count + 1 && s->rows[s->column[j - 1]] == j;

        o->head[j] = -1;
        o->size[j] = joins ? o->size[j - 1] : j;
        o->tail[o->size[j]] = j;
    }
    s->at = -1;
    s->source = s->p.source_end = 0;
    s->p.row = s->p.end = 0;
    s->phase = BLOCK_SOLVER_COLUMN;
}

/* Hangs a run of columns on the row of its next block, which is `block` of the last one. */
static void move_on(cairn_block_solver *s, int32_t run, int32_t block)
{
    struct cairn_block_order *o = &s->o;
    int32_t row;

    if (block == s->column[o->tail[run] + 1])
        return;
    row = s->rows[block];
    o->start[run] = block;
    o->next[run] = o->head[row];
    o->head[row] = run;
}

/* D^-1 from D, which came from the diagonal block H; 0 when D is not positive definite to
 * rounding. */
static int invert_pivot(cairn_sym3 *d, const cairn_real h[3])
{
    const cairn_real least = 64 * CAIRN_REAL_EPSILON;
    cairn_sym3 inverse;

    if (!(d->xx > least * h[0] && d->yy > least * h[1] && d->zz > least * h[2]) ||
        !cairn_sym3_inverse(*d, &inverse) ||
        !(inverse.xx <= CAIRN_REAL_MAX && inverse.yy <= CAIRN_REAL_MAX &&
          inverse.zz <= CAIRN_REAL_MAX))
        return 0;
    *d = inverse;
    return 1;
}

/* The next run to be subtracted from the panel: from those of its columns in whose rows the run
 * has blocks. */
static int32_t begin_run(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    struct block_solver_panel *p = &s->p;
    int32_t run = o->head[p->row], block = o->start[run], end = s->column[o->tail[run] + 1];

    o->head[p->row] = o->next[run];
    s->source = run;
    p->source_end = o->tail[run] + 1;
    for (p->targets = 0; block < end && s->rows[block] < p->end; block++) {
        p->target[p->targets] = s->rows[block];
        p->from_end[p->targets++] = end - block;
    }
    move_on(s, run, block);
    return 1;
}

/* The columns of the run at hand before column `end` are to be subtracted from columns first ...
 * last. */
static void begin_own_run(cairn_block_solver *s, int32_t source, int32_t end, int32_t first,
                          int32_t last)
{
    struct block_solver_panel *p = &s->p;

    s->source = source;
    p->source_end = end;
    p->targets = 0;
    for (int32_t j = first; j <= last; j++) {
        p->target[p->targets] = j;
        p->from_end[p->targets++] = s->column[j + 1] - s->column[j] + 1;
    }
}

/* The panel that begins with column j. */
static int32_t begin_panel(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    struct block_solver_panel *p = &s->p;
    int32_t j = s->at, run = o->size[j], walked = 0;

    p->first = p->row = j;
    p->end = j + BLOCK_SOLVER_PANEL <= o->tail[run] ? j + BLOCK_SOLVER_PANEL : o->tail[run] + 1;
    for (int32_t k = j; k < p->end; k++) {
        p->scale[k - j][0] = s->diagonal[k].xx;
        p->scale[k - j][1] = s->diagonal[k].yy;
        p->scale[k - j][2] = s->diagonal[k].zz;
    }
    if (run == j)
        for (int32_t b = s->column[j]; b < s->column[j + 1]; b++, walked++)
            o->mark[s->rows[b]] = s->column[j + 1] - b;
    begin_own_run(s, run, j, j, p->end - 1);
    return 2 + walked / BLOCK_SOLVER_ENTRIES;
}

/* Ends column j and begins the next. */
static int32_t next_column(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    int32_t j = s->at;

    if (j >= 0) {
        if (!invert_pivot(&s->diagonal[j], s->p.scale[j - s->p.first])) {
            s->result.pose = s->order[j];
            cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_NOT_POSITIVE, CAIRN_OK);
            return 1;
        }
        if (o->tail[o->size[j]] == j)
            move_on(s, o->size[j], s->column[j]);
    }
    s->at = ++j;
    if (j == s->result.poses) {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_FACTORED, CAIRN_OK);
        return 1;
    }
    if (j == s->p.end)
        return begin_panel(s);
    begin_own_run(s, s->p.first, j, j, j);
    return 2;
}

/* ---- Products ---- */

#if defined(__GNUC__) && !defined(__clang__)
/* At -O2 gcc would keep the rows of a sum as loops in memory, which takes twice the time: with
 * this it unrolls them and holds them in vector registers. No other function is meant, and no
 * result depends on it. */
#pragma GCC push_options
#pragma GCC optimize("vect-cost-model=dynamic", "peel-loops")
#endif

/* a += x by */
static inline void add_row(cairn_real a[PAIR], const cairn_real x[PAIR], cairn_real by)
{
    for (int k = 0; k < PAIR; k++)
        a[k] += x[k] * by;
}

/* The sum over the source columns of C_ik (D_k^-1 C_jk^T) for two targets j side by side; m: the
 * factors. */
static void sum_products(const cairn_block_solver *s, int32_t from_end, const cairn_real *m,
                         cairn_real sum[3 * PAIR])
{
    cairn_real a[PAIR] = {0}, b[PAIR] = {0}, c[PAIR] = {0};

    for (int32_t k = s->source; k < s->source + s->p.width; k++) {
        const cairn_real *x = s->blocks[s->column[k + 1] - from_end], *end = x + 3;

        for (; x < end; x++, m += PAIR) {
            add_row(a, m, x[0]);
            add_row(b, m, x[3]);
            add_row(c, m, x[6]);
        }
    }
    memcpy(sum, a, sizeof a);
    memcpy(sum + PAIR, b, sizeof b);
    memcpy(sum + 2 * PAIR, c, sizeof c);
}

/* a += x by */
static inline void add_plane_row(cairn_real a[FOUR], const cairn_real x[FOUR], cairn_real by)
{
    for (int k = 0; k < FOUR; k++)
        a[k] += x[k] * by;
}

/* The same of blocks whose third rows and columns are zero, for four targets. */
static void sum_plane_products(const cairn_block_solver *s, int32_t from_end,
                               cairn_real sum[2 * FOUR])
{
    cairn_real a[FOUR] = {0}, b[FOUR] = {0};
    const cairn_real *m = s->p.factor;

    for (int32_t k = s->source; k < s->source + s->p.width; k++, m += FOUR_FACTOR) {
        const cairn_real *x = s->blocks[s->column[k + 1] - from_end];

        add_plane_row(a, m, x[0]);
        add_plane_row(b, m, x[3]);
        add_plane_row(a, m + FOUR, x[1]);
        add_plane_row(b, m + FOUR, x[4]);
    }
    memcpy(sum, a, sizeof a);
    memcpy(sum + FOUR, b, sizeof b);
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif

static void subtract_block(cairn_real to[9], const cairn_real *sum)
{
    for (int r = 0; r < 3; r++, to += 3, sum += PAIR) {
        to[0] -= sum[0];
        to[1] -= sum[1];
        to[2] -= sum[2];
    }
}

static void subtract_diagonal(cairn_sym3 *d, const cairn_real *sum)
{
    d->xx -= sum[0];
    d->xy -= sum[1];
    d->xz -= sum[2];
    d->yy -= sum[PAIR + 1];
    d->yz -= sum[PAIR + 2];
    d->zz -= sum[2 * PAIR + 2];
}

/* Subtracts the products of a row's blocks from the targets' blocks in the row, the row's place
 * in whose columns is `place`, and from its diagonal where it is a target itself. Returns how
 * many products were made. */
static int32_t subtract_pairs(cairn_block_solver *s, int32_t from_end, int32_t row, int32_t place)
{
    const struct block_solver_panel *p = &s->p;
    int32_t t = 0;

    for (; t < p->targets && p->target[t] <= row; t += 2) {
        cairn_real sum[3 * PAIR];

        sum_products(s, from_end, p->factor + t / 2 * (BLOCK_SOLVER_WIDTH * PAIR_FACTOR), sum);
        for (int32_t u = t; u < t + 2 && u < p->targets; u++) {
            if (p->target[u] < row)
                subtract_block(s->blocks[s->column[p->target[u] + 1] - place], &sum[3 * (u - t)]);
            else if (p->target[u] == row)
                subtract_diagonal(&s->diagonal[row], &sum[3 * (u - t)]);
        }
    }
    return t * p->width;
}

/* The same without third unknowns. */
static int32_t subtract_four(cairn_block_solver *s, int32_t from_end, int32_t row, int32_t place)
{
    const struct block_solver_panel *p = &s->p;
    cairn_real sum[2 * FOUR];
    int32_t t = 0;

    sum_plane_products(s, from_end, sum);
    for (; t < p->targets && p->target[t] <= row; t++) {
        const cairn_real *a = &sum[2 * t], *b = &sum[FOUR + 2 * t];

        if (p->target[t] < row) {
            cairn_real *block = s->blocks[s->column[p->target[t] + 1] - place];

            block[0] -= a[0];
            block[1] -= a[1];
            block[3] -= b[0];
            block[4] -= b[1];
        } else {
            s->diagonal[row].xx -= a[0];
            s->diagonal[row].xy -= a[1];
            s->diagonal[row].yy -= b[1];
        }
    }
    return t * p->width;
}

/* Subtracts the products of some rows' blocks of the source columns. */
static int32_t subtract(cairn_block_solver *s)
{
    const int32_t *end = s->rows + s->column[s->source + 1];
    int32_t count = 0;

    for (; s->block > 0 && count < BLOCK_SOLVER_CHUNK; s->block--) {
        int32_t row = end[-s->block];

        count += s->coupled ? subtract_pairs(s, s->block, row, s->o.mark[row])
                            : subtract_four(s, s->block, row, s->o.mark[row]);
    }
    if (s->block == 0) {
        s->source += s->p.width;
        s->phase = BLOCK_SOLVER_COLUMN;
    }
    return count;
}

/* ---- Factors ---- */

/* D C^T */
static void multiply_sym(cairn_sym3 d, const cairn_real c[9], cairn_real *product)
{
    for (int k = 0; k < 3; k++, c += 3) {
        product[k] = d.xx * c[0] + d.xy * c[1] + d.xz * c[2];
        product[PAIR + k] = d.xy * c[0] + d.yy * c[1] + d.yz * c[2];
        product[2 * PAIR + k] = d.xz * c[0] + d.yz * c[1] + d.zz * c[2];
    }
}

static void multiply_plane_sym(cairn_sym3 d, const cairn_real c[9], cairn_real *product)
{
    for (int k = 0; k < 2; k++, c += 3) {
        product[k] = d.xx * c[0] + d.xy * c[1];
        product[FOUR + k] = d.xy * c[0] + d.yy * c[1];
    }
}

/* The factors D_k^-1 C_jk^T of the source columns k for a target j, in whose row their blocks
 * are C_jk. */
static void begin_target(cairn_block_solver *s, int32_t t)
{
    struct block_solver_panel *p = &s->p;

    for (int32_t k = 0; k < p->width; k++) {
        const cairn_real *c = s->blocks[s->column[s->source + k + 1] - p->from_end[t]];
        cairn_sym3 d = s->diagonal[s->source + k];

        if (s->coupled)
            multiply_sym(d, c,
                         p->factor + (t / 2 * BLOCK_SOLVER_WIDTH + k) * PAIR_FACTOR + t % 2 * 3);
        else
            multiply_plane_sym(d, c, p->factor + k * FOUR_FACTOR + t * 2);
    }
}

/* The next columns of the run that is subtracted. */
static int32_t begin_columns(cairn_block_solver *s)
{
    struct block_solver_panel *p = &s->p;
    cairn_real *last_pair = p->factor + p->targets / 2 * (BLOCK_SOLVER_WIDTH * PAIR_FACTOR);

    p->width = p->source_end - s->source;
    if (p->width > BLOCK_SOLVER_WIDTH)
        p->width = BLOCK_SOLVER_WIDTH;
    if (s->coupled && p->targets % 2 == 1)
        memset(last_pair, 0, (size_t)p->width * PAIR_FACTOR * sizeof *p->factor);
    else if (!s->coupled && p->targets < BLOCK_SOLVER_PANEL)
        memset(p->factor, 0, (size_t)p->width * FOUR_FACTOR * sizeof *p->factor);
    for (int32_t t = 0; t < p->targets; t++)
        begin_target(s, t);
    s->block = p->from_end[0];
    s->phase = BLOCK_SOLVER_SUBTRACT;
    return p->width * p->targets + subtract(s);
}

int32_t cairn_block_factor_item(cairn_block_solver *s)
{
    if (s->phase == BLOCK_SOLVER_SUBTRACT)
        return subtract(s);
    if (s->source < s->p.source_end)
        return begin_columns(s);
    for (; s->p.row < s->p.end; s->p.row++)
        if (s->o.head[s->p.row] != -1)
            return begin_run(s) + begin_columns(s);
    return next_column(s);
}

/* ---- Solution ---- */

static void multiply_vector(cairn_sym3 m, const cairn_real v[3], cairn_real product[3])
{
    product[0] = m.xx * v[0] + m.xy * v[1] + m.xz * v[2];
    product[1] = m.xy * v[0] + m.yy * v[1] + m.yz * v[2];
    product[2] = m.xz * v[0] + m.yz * v[1] + m.zz * v[2];
}

/* x_j = D_j^-1 x_j, and its part of the later rows. */
static void solve_forward(cairn_block_solver *s, int32_t j)
{
    cairn_real z[3];

    multiply_vector(s->diagonal[j], s->x[j], z);
    for (int32_t b = s->column[j]; b < s->column[j + 1]; b++) {
        cairn_real *x = s->x[s->rows[b]];
        const cairn_real *c = s->blocks[b];

        for (int k = 0; k < 3; k++)
            x[k] -= c[3 * k] * z[0] + c[3 * k + 1] * z[1] + c[3 * k + 2] * z[2];
    }
    memcpy(s->x[j], z, sizeof z);
}

/* x_j -= D_j^-1 C_j^T x of the later rows; 0 when it overflows. Columns and rows alike are
 * walked backwards: a factor that is larger than the cache comes in twice as fast when its
 * addresses only fall. */
static int solve_backward(cairn_block_solver *s, int32_t j)
{
    cairn_real sum[3] = {0, 0, 0}, z[3];

    for (int32_t b = s->column[j + 1] - 1; b >= s->column[j]; b--) {
        const cairn_real *x = s->x[s->rows[b]], *c = s->blocks[b];

        for (int k = 0; k < 3; k++)
            sum[k] += c[k] * x[0] + c[3 + k] * x[1] + c[6 + k] * x[2];
    }
    multiply_vector(s->diagonal[j], sum, z);
    for (int k = 0; k < 3; k++)
        s->x[j][k] -= z[k];
    return cairn_is_finite(s->x[j][0]) && cairn_is_finite(s->x[j][1]) &&
           cairn_is_finite(s->x[j][2]);
}

int32_t cairn_block_solve_item(cairn_block_solver *s)
{
    int32_t j = s->at;

    if (s->phase == BLOCK_SOLVER_FORWARD) {
        solve_forward(s, j);
        s->at++;
        if (s->at == s->result.poses) {
            s->at--;
            s->phase = BLOCK_SOLVER_BACKWARD;
        }
    } else if (!solve_backward(s, j)) {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_FACTORED, CAIRN_NOT_FINITE);
    } else if (j == 0) {
        s->solved = 1;
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_FACTORED, CAIRN_OK);
    } else {
        s->at--;
    }
    return 1 + (s->column[j + 1] - s->column[j]) / 2;
}
