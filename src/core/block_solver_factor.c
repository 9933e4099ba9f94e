/* Pattern of the factor, LDL^T by blocks, and solutions.
 *
 * Pattern: the row r of the factor has a block in every column on the paths of the elimination tree from the columns of H
 * in that row up to r (Liu 1990). Rows are walked twice: to count, and to write their numbers into the columns, which come
 * out ascending.
 *
 * Factor: H = L D L^T column by column (left-looking). In a column stands C = L D, so that nothing has to be scaled: column
 * k takes C_ik D_k^-1 C_jk^T from the block (i, j). The columns that are to be subtracted from j are in a list that hangs
 * on j; a column whose next block is in row j is moved on to the list of its next row (George and Liu 1981). When nothing
 * couples third unknowns, the blocks' third rows and columns stay zero and are left out.
 *
 * Layout: columns of blocks, row-major 3 x 3, rows ascending; D^-1 in `diagonal`.
 *
 * Source: George and Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981; Liu, The role of elimination
 * trees in sparse factorization, 1990; Davis, Algorithm 849: a concise sparse Cholesky factorization package, 2005. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/block_solver_work.h"

/* ---- Pattern ---- */

/* Lists the columns of H left of the diagonal, by rows: row r has graph[start[r] ... start[r + 1] - 1]. */
static void list_rows(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    int32_t n = s->result.poses;

    memset(o->start, 0, ((size_t)n + 1) * sizeof *o->start);
    for (int32_t l = 0; l < s->result.links; l++) {
        int32_t a = s->place[s->first[l]], b = s->place[s->second[l]];

        o->start[a > b ? a : b]++;
    }
    for (int32_t r = 0, sum = 0; r <= n; r++) {
        sum += o->start[r];
        o->start[r] = sum;
    }
    for (int32_t l = s->result.links - 1; l >= 0; l--) {
        int32_t a = s->place[s->first[l]], b = s->place[s->second[l]];

        o->graph[--o->start[a > b ? a : b]] = a > b ? b : a;
    }
}

/* Of the ordering's arrays the pattern uses `previous` as the tree's parents, `length` as the blocks of a column and
 * `mark` as the row in which a column was met last. */
void cairn_block_pattern_begin(cairn_block_solver *s)
{
    list_rows(s);
    memset(s->o.length, 0, (size_t)s->result.poses * sizeof *s->o.length);
    s->at = 0;
    s->phase = BLOCK_SOLVER_COUNT;
}

static int32_t count_row(struct cairn_block_order *o, int32_t r)
{
    int32_t walked = 1;

    o->previous[r] = -1;
    o->mark[r] = r;
    for (int32_t k = o->start[r]; k < o->start[r + 1]; k++, walked++)
        for (int32_t c = o->graph[k]; o->mark[c] != r; c = o->previous[c], walked++) {
            if (o->previous[c] == -1)
                o->previous[c] = r;
            o->mark[c] = r;
            o->length[c]++;
        }
    return walked;
}

static int32_t fill_row(cairn_block_solver *s, int32_t r)
{
    struct cairn_block_order *o = &s->o;
    int32_t walked = 1;

    o->mark[r] = r;
    for (int32_t k = o->start[r]; k < o->start[r + 1]; k++, walked++)
        for (int32_t c = o->graph[k]; o->mark[c] != r; c = o->previous[c], walked++) {
            o->mark[c] = r;
            s->rows[s->column[c] + o->length[c]++] = r;
        }
    return walked;
}

/* Columns from their counts. */
static void end_count(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    int32_t n = s->result.poses;
    int64_t fill = 0;

    for (int32_t c = 0; c < n; c++)
        fill += o->length[c];
    s->result.fill = fill < INT32_MAX ? (int32_t)fill : INT32_MAX;
    if (fill > s->params.max_fill) {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_NEW, CAIRN_FULL);
        return;
    }
    s->column[0] = 0;
    for (int32_t c = 0; c < n; c++) {
        s->column[c + 1] = s->column[c] + o->length[c];
        o->length[c] = 0;
        o->mark[c] = -1;
    }
    s->at = 0;
    s->phase = BLOCK_SOLVER_FILL;
}

int32_t cairn_block_find(const cairn_block_solver *s, int32_t row, int32_t column)
{
    int32_t low = s->column[column], high = s->column[column + 1];

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (s->rows[middle] < row)
            low = middle + 1;
        else
            high = middle;
    }
    return low < s->column[column + 1] && s->rows[low] == row ? low : -1;
}

static void find_slot(cairn_block_solver *s, int32_t link)
{
    int32_t a = s->place[s->first[link]], b = s->place[s->second[link]];

    s->slot[link] = cairn_block_find(s, a > b ? a : b, a > b ? b : a);
    CAIRN_ASSERT(s->slot[link] >= 0);
}

int32_t cairn_block_pattern_item(cairn_block_solver *s)
{
    int32_t n = s->result.poses, walked = BLOCK_SOLVER_ENTRIES;

    if (s->phase == BLOCK_SOLVER_COUNT && s->at < n) {
        walked = count_row(&s->o, s->at++);
    } else if (s->phase == BLOCK_SOLVER_COUNT) {
        end_count(s);
        walked = n;
    } else if (s->phase == BLOCK_SOLVER_FILL && s->at < n) {
        walked = fill_row(s, s->at++);
    } else if (s->phase == BLOCK_SOLVER_FILL) {
        s->at = 0;
        s->phase = BLOCK_SOLVER_SLOT;
    } else if (s->at < s->result.links) {
        find_slot(s, s->at++);
    } else {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_ANALYZED, CAIRN_OK);
    }
    return 1 + walked / BLOCK_SOLVER_ENTRIES;
}

/* ---- Factor ---- */

/* Of the ordering's arrays the factor uses `head` and `next` as the lists of columns by their next row, `start` as the
 * next block of a column and `mark` as the block of a row in the column that is made. */
void cairn_block_factor_begin(cairn_block_solver *s)
{
    for (int32_t j = 0; j < s->result.poses; j++)
        s->o.head[j] = -1;
    s->at = -1;
    s->source = -1;
    s->phase = BLOCK_SOLVER_COLUMN;
}

static void multiply_sym(cairn_sym3 d, const cairn_real c[9], cairn_real m[9])
{
    for (int k = 0; k < 3; k++) {
        m[k] = d.xx * c[3 * k] + d.xy * c[3 * k + 1] + d.xz * c[3 * k + 2];
        m[3 + k] = d.xy * c[3 * k] + d.yy * c[3 * k + 1] + d.yz * c[3 * k + 2];
        m[6 + k] = d.xz * c[3 * k] + d.yz * c[3 * k + 1] + d.zz * c[3 * k + 2];
    }
}

/* a -= b m */
static void subtract_product(cairn_real a[9], const cairn_real b[9], const cairn_real m[9])
{
    for (int r = 0; r < 9; r += 3) {
        cairn_real x = b[r], y = b[r + 1], z = b[r + 2];

        a[r] -= x * m[0] + y * m[3] + z * m[6];
        a[r + 1] -= x * m[1] + y * m[4] + z * m[7];
        a[r + 2] -= x * m[2] + y * m[5] + z * m[8];
    }
}

/* The same of blocks whose third rows and columns are zero. */
static void subtract_plane_product(cairn_real a[9], const cairn_real b[9], const cairn_real m[9])
{
    for (int r = 0; r < 6; r += 3) {
        cairn_real x = b[r], y = b[r + 1];

        a[r] -= x * m[0] + y * m[3];
        a[r + 1] -= x * m[1] + y * m[4];
    }
}

/* Hangs a column on the row of its next block. */
static void move_on(cairn_block_solver *s, int32_t k, int32_t block)
{
    struct cairn_block_order *o = &s->o;
    int32_t row;

    if (block == s->column[k + 1])
        return;
    row = s->rows[block];
    o->start[k] = block;
    o->next[k] = o->head[row];
    o->head[row] = k;
}

/* D^-1 from D, which came from the diagonal block H; 0 when D is not positive definite to rounding. */
static int invert_pivot(cairn_sym3 *d, const cairn_real h[3])
{
    const cairn_real least = 64 * CAIRN_REAL_EPSILON;
    cairn_sym3 inverse;

    if (!(d->xx > least * h[0] && d->yy > least * h[1] && d->zz > least * h[2]) || !cairn_sym3_inverse(*d, &inverse) ||
        !(inverse.xx <= CAIRN_REAL_MAX && inverse.yy <= CAIRN_REAL_MAX && inverse.zz <= CAIRN_REAL_MAX))
        return 0;
    *d = inverse;
    return 1;
}

/* The next column to be subtracted from column j, whose block there is C_jk: the factor D_k^-1 C_jk^T, and the diagonal. */
static int32_t begin_source(cairn_block_solver *s)
{
    int32_t j = s->at, k = s->o.head[j], block = s->o.start[k];
    const cairn_real *c = s->blocks[block];
    cairn_real *m = s->factor;
    cairn_sym3 *d = &s->diagonal[j];

    s->o.head[j] = s->o.next[k];
    multiply_sym(s->diagonal[k], c, m);
    d->xx -= c[0] * m[0] + c[1] * m[3] + c[2] * m[6];
    d->xy -= c[0] * m[1] + c[1] * m[4] + c[2] * m[7];
    d->xz -= c[0] * m[2] + c[1] * m[5] + c[2] * m[8];
    d->yy -= c[3] * m[1] + c[4] * m[4] + c[5] * m[7];
    d->yz -= c[3] * m[2] + c[4] * m[5] + c[5] * m[8];
    d->zz -= c[6] * m[2] + c[7] * m[5] + c[8] * m[8];
    move_on(s, k, block + 1);
    s->source = k;
    s->block = block + 1;
    s->phase = BLOCK_SOLVER_SUBTRACT;
    return 2;
}

/* Ends column j and begins the next. */
static int32_t next_column(cairn_block_solver *s)
{
    int32_t j = s->at, walked = 0;

    if (j >= 0) {
        if (!invert_pivot(&s->diagonal[j], s->scale)) {
            s->result.pose = s->order[j];
            cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_NOT_POSITIVE, CAIRN_OK);
            return 1;
        }
        move_on(s, j, s->column[j]);
    }
    s->at = ++j;
    if (j == s->result.poses) {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_FACTORED, CAIRN_OK);
        return 1;
    }
    for (int32_t b = s->column[j]; b < s->column[j + 1]; b++, walked++)
        s->o.mark[s->rows[b]] = b;
    s->scale[0] = s->diagonal[j].xx;
    s->scale[1] = s->diagonal[j].yy;
    s->scale[2] = s->diagonal[j].zz;
    return 2 + walked / BLOCK_SOLVER_ENTRIES;
}

/* Some blocks of the source column. */
static int32_t subtract(cairn_block_solver *s)
{
    int32_t end = s->column[s->source + 1], count = 0;

    for (; s->block < end && count < BLOCK_SOLVER_CHUNK; s->block++, count++) {
        cairn_real *to = s->blocks[s->o.mark[s->rows[s->block]]];

        if (s->coupled)
            subtract_product(to, s->blocks[s->block], s->factor);
        else
            subtract_plane_product(to, s->blocks[s->block], s->factor);
    }
    if (s->block == end)
        s->phase = BLOCK_SOLVER_COLUMN;
    return count;
}

int32_t cairn_block_factor_item(cairn_block_solver *s)
{
    if (s->phase == BLOCK_SOLVER_SUBTRACT)
        return subtract(s);
    if (s->at >= 0 && s->o.head[s->at] != -1)
        return begin_source(s);
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

/* x_j -= D_j^-1 C_j^T x of the later rows; 0 when it overflows. */
static int solve_backward(cairn_block_solver *s, int32_t j)
{
    cairn_real sum[3] = {0, 0, 0}, z[3];

    for (int32_t b = s->column[j]; b < s->column[j + 1]; b++) {
        const cairn_real *x = s->x[s->rows[b]], *c = s->blocks[b];

        for (int k = 0; k < 3; k++)
            sum[k] += c[k] * x[0] + c[3 + k] * x[1] + c[6 + k] * x[2];
    }
    multiply_vector(s->diagonal[j], sum, z);
    for (int k = 0; k < 3; k++)
        s->x[j][k] -= z[k];
    return cairn_is_finite(s->x[j][0]) && cairn_is_finite(s->x[j][1]) && cairn_is_finite(s->x[j][2]);
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
