/* Pattern of the factor.
 *
 * Method: the row r of the factor has a block in every column on the paths of the elimination tree
 * from the columns of H in that row up to r (Liu 1990). Rows are walked twice: to count, and to
 * write their numbers into the columns, which come out ascending.
 *
 * Source: Liu, The role of elimination trees in sparse factorization, 1990; Davis, Algorithm
 * 849: a concise sparse Cholesky factorization package, 2005. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/block_solver_work.h"

/* Lists the columns of H left of the diagonal, by rows: row r has graph[start[r] ... start[r +
 * 1] - 1]. */
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

/* Of the ordering's arrays the pattern uses `previous` as the tree's parents, `length` as the
 * blocks of a column and `mark` as the row in which a column was met last. */
void cairn_block_pattern_begin(cairn_block_solver *s)
{
    list_rows(s);
    memset(s->o.length, 0, (size_t)s->result.poses * sizeof *s->o.length);
    s->at = 0;
    s->phase = BLOCK_SOLVER_COUNT;
}

void cairn_block_pattern_go_on(cairn_block_solver *s)
{
    s->at = s->result.poses;
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

/* The children of a column in the tree, that of the most blocks last: `head` has the first one,
 * `next` the others. */
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

/* Numbers the columns so that those of a subtree stand together and every column behind its
 * children: fill and counts stay, but what is multiplied stands close by, and more columns of
 * the same rows follow each other. */
static void postorder(cairn_block_solver *s)
{
    struct cairn_block_order *o = &s->o;
    int32_t n = s->result.poses, *post = o->size, *parent = o->degree, *count = o->elements,
            *order = o->member, next = 0;

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
