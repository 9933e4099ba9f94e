/* Pattern of the factor, LDL^T by blocks, and solutions.
 *
 * Pattern: the row r of the factor has a block in every column on the paths of the elimination tree from the columns of H
 * in that row up to r (Liu 1990). Rows are walked twice: to count, and to write their numbers into the columns, which come
 * out ascending.
 *
 * Factor: H = L D L^T column by column (left-looking). In a column stands C = L D, so that nothing has to be scaled: column
 * k takes C_ik D_k^-1 C_jk^T from the block (i, j). Columns that follow each other and have the same rows below are a run (a
 * supernode) and are subtracted together from a panel of up to four columns of another: the blocks of two columns in one row
 * stay in registers while the products of the run's columns are added up. The runs that are to be subtracted from a panel are in lists that hang on
 * its rows, and move on to the list of their next row behind it (George and Liu 1981; Ng and Peyton 1993). When nothing couples third unknowns, the blocks'
 * third rows and columns stay zero and are left out.
 *
 * Layout: columns of blocks, row-major 3 x 3, rows ascending; D^-1 in `diagonal`.
 *
 * Source: George and Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981; Liu, The role of elimination
 * trees in sparse factorization, 1990; Ng and Peyton, Block sparse Cholesky algorithms on advanced uniprocessor computers,
 * 1993; Davis, Algorithm 849: a concise sparse Cholesky factorization package, 2005. */
#include "src/core/build.h"

#if defined(__GNUC__) && !defined(__clang__)
/* Keeps the sums of products in registers. */
#pragma GCC optimize("vect-cost-model=dynamic", "peel-loops")
#endif

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

/* The children of a column in the tree, that of the most blocks last: `head` has the first one, `next` the others. */
static void list_children(struct cairn_block_order *o, int32_t n)
{
    int32_t *last = o->tail; /* by parent: the child of the most blocks */

    for (int32_t c = 0; c < n; c++)
        o->head[c] = last[c] = -1;
    for (int32_t c = 0; c < n; c++) {
        int32_t parent = o->previous[c];

        if (parent >= 0 && (last[parent] == -1 || o->length[c] >= o->length[last[parent]]))
            last[parent] = c;
    }
    for (int32_t c = n - 1; c >= 0; c--)
        if (o->previous[c] >= 0 && last[o->previous[c]] == c) {
            o->next[c] = -1;
            o->head[o->previous[c]] = c;
        }
    for (int32_t c = n - 1; c >= 0; c--)
        if (o->previous[c] >= 0 && last[o->previous[c]] != c) {
            o->next[c] = o->head[o->previous[c]];
            o->head[o->previous[c]] = c;
        }
}

/* Numbers the columns so that those of a subtree stand together and every column behind its children: fill and counts stay,
 * but what is multiplied stands close by, and more columns of the same rows follow each other. */
static void postorder(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    int32_t n = s->result.poses, *post = o->size, *parent = o->degree, *count = o->elements, *order = o->member,
            next = 0;

    list_children(o, n);
    for (int32_t root = 0; root < n; root++)
        for (int32_t c = o->previous[root] == -1 ? root : -1; c != -1;) {
            int32_t child = o->head[c];

            if (child != -1) {
                o->head[c] = o->next[child];
                c = child;
            } else {
                post[c] = next++;
                c = o->previous[c];
            }
        }
    for (int32_t c = 0; c < n; c++) {
        parent[post[c]] = o->previous[c] >= 0 ? post[o->previous[c]] : -1;
        count[post[c]] = o->length[c];
        order[post[c]] = s->order[c];
    }
    memcpy(o->previous, parent, (size_t)n * sizeof *parent);
    memcpy(o->length, count, (size_t)n * sizeof *count);
    memcpy(s->order, order, (size_t)n * sizeof *order);
    for (int32_t c = 0; c < n; c++)
        s->place[order[c]] = c;
}

/* Columns from their counts. Returns the entries that were walked. */
static int32_t end_count(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    int32_t n = s->result.poses;
    int64_t fill = 0;

    for (int32_t c = 0; c < n; c++)
        fill += o->length[c];
    s->result.fill = fill < INT32_MAX ? (int32_t)fill : INT32_MAX;
    if (fill > s->params.max_fill) {
        cairn_block_solver_end(s, CAIRN_BLOCK_SOLVER_NEW, CAIRN_FULL);
        return n;
    }
    postorder(s);
    list_rows(s);
    s->column[0] = 0;
    for (int32_t c = 0; c < n; c++) {
        s->column[c + 1] = s->column[c] + o->length[c];
        o->length[c] = 0;
        o->mark[c] = -1;
    }
    s->at = 0;
    s->phase = BLOCK_SOLVER_FILL;
    return 8 * n + s->result.links;
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
        walked = end_count(s);
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

/* Of the ordering's arrays the factor uses `size` as the first column of the run that a column is in, `tail` as the last one
 * of the run that begins with a column, `head` and `next` as the lists of runs by their next row, `start` as that row's block
 * of the last column and `mark` as the place of a row in the columns of the run that is made, counted from their end. */
void cairn_block_factor_begin(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;

    for (int32_t j = 0; j < s->result.poses; j++) {
        int32_t count = s->column[j + 1] - s->column[j];
        int joins = j > 0 && s->column[j] - s->column[j - 1] == count + 1 && s->rows[s->column[j - 1]] == j;

        o->head[j] = -1;
        o->size[j] = joins ? o->size[j - 1] : j;
        o->tail[o->size[j]] = j;
    }
    s->at = -1;
    s->source = s->p.source_end = 0;
    s->p.row = s->p.end = 0;
    s->phase = BLOCK_SOLVER_COLUMN;
}

/* D C^T, into one half of `product` */
static void multiply_sym(cairn_sym3 d, const cairn_real c[9], cairn_real (*product)[6], int half)
{
    for (int k = 0; k < 3; k++, c += 3) {
        product[0][half + k] = d.xx * c[0] + d.xy * c[1] + d.xz * c[2];
        product[1][half + k] = d.xy * c[0] + d.yy * c[1] + d.yz * c[2];
        product[2][half + k] = d.xz * c[0] + d.yz * c[1] + d.zz * c[2];
    }
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

/* The next run to be subtracted from the panel: from those of its columns in whose rows the run has blocks. */
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

/* The columns of the run at hand before column `end` are to be subtracted from columns first ... last. */
static void begin_own_run(cairn_block_solver *s, int32_t source, int32_t end, int32_t first, int32_t last)
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

/* a += x by */
static inline void add_row(cairn_real a[6], const cairn_real x[6], cairn_real by)
{
    for (int k = 0; k < 6; k++)
        a[k] += x[k] * by;
}

/* The sum over the source columns of C_ik (D_k^-1 C_jk^T) for two targets j side by side. */
static void sum_products(const cairn_block_solver *s, int32_t from_end, const cairn_real *m, cairn_real sum[3][6])
{
    cairn_real a[6] = {0}, b[6] = {0}, c[6] = {0};

    for (int32_t k = s->source; k < s->source + s->p.width; k++) {
        const cairn_real *x = s->blocks[s->column[k + 1] - from_end], *end = x + 3;

        for (; x < end; x++, m += 6) {
            add_row(a, m, x[0]);
            add_row(b, m, x[3]);
            add_row(c, m, x[6]);
        }
    }
    memcpy(sum[0], a, sizeof a);
    memcpy(sum[1], b, sizeof b);
    memcpy(sum[2], c, sizeof c);
}

/* The same of blocks whose third rows and columns are zero. */
static void sum_plane_products(const cairn_block_solver *s, int32_t from_end, const cairn_real *m, cairn_real sum[3][6])
{
    cairn_real a[6] = {0}, b[6] = {0};

    for (int32_t k = s->source; k < s->source + s->p.width; k++, m += 18) {
        const cairn_real *x = s->blocks[s->column[k + 1] - from_end];

        add_row(a, m, x[0]);
        add_row(b, m, x[3]);
        add_row(a, m + 6, x[1]);
        add_row(b, m + 6, x[4]);
    }
    memcpy(sum[0], a, sizeof a);
    memcpy(sum[1], b, sizeof b);
    memset(sum[2], 0, sizeof sum[2]);
}

/* Takes one half of the sums from the target's block in the row. */
static void subtract_sum(cairn_block_solver *s, int32_t row, int32_t target, cairn_real sum[3][6], int half)
{
    cairn_real *to = s->blocks[s->column[target + 1] - s->o.mark[row]];

    for (int r = 0; r < 3; r++, to += 3) {
        to[0] -= sum[r][half];
        to[1] -= sum[r][half + 1];
        to[2] -= sum[r][half + 2];
    }
}

/* Subtracts the products of a row's blocks from the targets above it. */
static int32_t subtract_row(cairn_block_solver *s, int32_t from_end)
{
    struct block_solver_panel *p = &s->p;
    int32_t row = s->rows[s->column[s->source + 1] - from_end], count = 0;

    for (int32_t t = 0; t < p->targets && p->target[t] < row; t += 2) {
        cairn_real sum[3][6];

        if (s->coupled)
            sum_products(s, from_end, p->factor[t / 2][0][0], sum);
        else
            sum_plane_products(s, from_end, p->factor[t / 2][0][0], sum);
        subtract_sum(s, row, p->target[t], sum, 0);
        if (t + 1 < p->targets && p->target[t + 1] < row)
            subtract_sum(s, row, p->target[t + 1], sum, 3);
        count += 2 * p->width;
    }
    return count;
}

/* Some blocks of the source columns. */
static int32_t subtract(cairn_block_solver *s)
{
    int32_t count = 0;

    while (s->block > 0 && count < BLOCK_SOLVER_CHUNK)
        count += subtract_row(s, s->block--);
    if (s->block == 0) {
        s->source += s->p.width;
        s->phase = BLOCK_SOLVER_COLUMN;
    }
    return count;
}

/* The factor D_k^-1 C_jk^T of a source column for a target, in whose row its block is C_jk; and the target's diagonal. */
static void begin_product(cairn_block_solver *s, int32_t column, int32_t t)
{
    const cairn_real *c = s->blocks[s->column[column + 1] - s->p.from_end[t]];
    cairn_real(*m)[6] = s->p.factor[t / 2][column - s->source];
    cairn_sym3 *d = &s->diagonal[s->p.target[t]];
    int h = t % 2 * 3;

    multiply_sym(s->diagonal[column], c, m, h);
    d->xx -= c[0] * m[0][h] + c[1] * m[1][h] + c[2] * m[2][h];
    d->xy -= c[0] * m[0][h + 1] + c[1] * m[1][h + 1] + c[2] * m[2][h + 1];
    d->xz -= c[0] * m[0][h + 2] + c[1] * m[1][h + 2] + c[2] * m[2][h + 2];
    d->yy -= c[3] * m[0][h + 1] + c[4] * m[1][h + 1] + c[5] * m[2][h + 1];
    d->yz -= c[3] * m[0][h + 2] + c[4] * m[1][h + 2] + c[5] * m[2][h + 2];
    d->zz -= c[6] * m[0][h + 2] + c[7] * m[1][h + 2] + c[8] * m[2][h + 2];
}

/* The next columns of the run that is subtracted. */
static int32_t begin_columns(cairn_block_solver *s)
{
    struct block_solver_panel *p = &s->p;

    p->width = p->source_end - s->source;
    if (p->width > BLOCK_SOLVER_WIDTH)
        p->width = BLOCK_SOLVER_WIDTH;
    if (p->targets % 2 == 1)
        memset(p->factor[p->targets / 2], 0, (size_t)p->width * sizeof p->factor[0][0]);
    for (int32_t t = 0; t < p->targets; t++)
        for (int32_t k = 0; k < p->width; k++)
            begin_product(s, s->source + k, t);
    s->block = p->from_end[0] - 1;
    s->phase = BLOCK_SOLVER_SUBTRACT;
    return 2 * p->width * p->targets + subtract(s);
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
