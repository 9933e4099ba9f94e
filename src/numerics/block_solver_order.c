/* Fill-reducing ordering by approximate minimum mean fill.
 *
 * Method:
 * 1. Quotient graph: an eliminated pose leaves its neighbours as a clique, which is stored as one
 *    element instead of its edges. Degrees are bounded from above: the size of the pivot's list,
 *    plus for every element of a variable its poses outside that list, plus the other variables
 *    (Amestoy, Davis and Duff 1996). Elements without poses outside the pivot's list are absorbed.
 *    Variables with equal lists are indistinguishable and merged (supervariables). A variable
 *    without neighbours outside the pivot's list is eliminated with the pivot (mass elimination).
 * 2. The pivot is the variable of the lowest score: the number of blocks of its column, plus the
 *    number of pairs of its neighbours that it would newly link, divided by its poses. Of these
 *    pairs those of the clique made last are known and subtracted; those of other cliques are not
 *    (Rothberg and Eisenstat 1998). On a grid of 100,000 poses the factorization takes a third
 *    fewer products than with the minimum degree; on small graphs the same number.
 * 3. The pivot is eliminated, which gathers its list. Four passes over the list follow: the first
 *    counts the poses of the elements of a variable outside the list. The second cleans the
 *    variable's list and bounds its degree. The third finds indistinguishable variables of the same
 *    hash. The last reinserts it among the scores.
 *
 * Layout: all lists lie in one array, new elements at the end. A full array is compacted. Elements
 * never need more memory than the lists they replace, so after compaction there is capacity for one
 * more list of all poses.
 *
 * Limits: quadratic when a pose is linked to nearly all others.
 *
 * Source: Amestoy, Davis and Duff, An approximate minimum degree ordering algorithm, 1996; Rothberg
 * and Eisenstat, Node selection strategies for bottom-up sparse matrix ordering, 1998. */
#include "src/base/build.h"

#include "src/numerics/block_solver_work.h"

/* Score of a variable, less than n, the number of poses of the graph. clique: other poses of the
 * clique made last that contains the variable. Scores above n / 2 depend only on the degree.
 * The quotient is exact in double, and in float up to 4,096 poses; beyond it is rounded. */
static int32_t score_of(const struct block_solver_order *ordering, int32_t variable, int32_t clique,
                        int32_t n)
{
    int32_t degree = ordering->degree[variable];
    cairn_real pairs = (cairn_real)(degree - clique) * (cairn_real)(degree + clique - 1) / 2,
               fill = cairn_min(pairs / (cairn_real)ordering->size[variable], (cairn_real)n);
    int32_t score = degree + (fill > 0 ? cairn_real_to_int(fill) : 0);

    return score < n / 2 ? score : n / 2 + degree / 2;
}

/* Tag from which the tag and the marks are lowered. */
enum { MAX_TAG = 1 << 18 };

/* Inserts a variable at the head of the list of its score. */
static void insert_by_score(struct block_solver_order *ordering, int32_t variable, int32_t score)
{
    int32_t after = ordering->head[score];

    ordering->score[variable] = score;
    ordering->next[variable] = after;
    ordering->previous[variable] = -1;
    if (after != -1)
        ordering->previous[after] = variable;
    ordering->head[score] = variable;
    if (score < ordering->lowest_score)
        ordering->lowest_score = score;
}

/* Removes a variable from the list of its score. */
static void remove_from_scores(struct block_solver_order *ordering, int32_t variable)
{
    int32_t before = ordering->previous[variable], after = ordering->next[variable];

    if (after != -1)
        ordering->previous[after] = before;
    if (before != -1)
        ordering->next[before] = after;
    else
        ordering->head[ordering->score[variable]] = after;
}

/* Builds the adjacency lists: every link in the lists of both poses. */
static void list_neighbours(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t n = solver->result.poses;

    for (int32_t v = 0; v < n; v++)
        ordering->length[v] = 0;
    for (int32_t l = 0; l < solver->result.links; l++) {
        ordering->length[solver->first[l]]++;
        ordering->length[solver->second[l]]++;
    }
    ordering->graph_end = 0;
    for (int32_t v = 0; v < n; v++) {
        ordering->start[v] = ordering->graph_end;
        ordering->graph_end += ordering->length[v];
        ordering->length[v] = 0;
    }
    for (int32_t l = 0; l < solver->result.links; l++) {
        int32_t a = solver->first[l], b = solver->second[l];

        ordering->graph[ordering->start[a] + ordering->length[a]++] = b;
        ordering->graph[ordering->start[b] + ordering->length[b]++] = a;
    }
}

/* Removes repeated neighbours from all lists. */
static void remove_duplicates(struct block_solver_order *ordering, int32_t poses)
{
    for (int32_t v = 0; v < poses; v++)
        ordering->mark[v] = -1;
    for (int32_t v = 0; v < poses; v++) {
        int32_t kept = 0, *list = &ordering->graph[ordering->start[v]];

        for (int32_t k = 0; k < ordering->length[v]; k++)
            if (ordering->mark[list[k]] != v) {
                ordering->mark[list[k]] = v;
                list[kept++] = list[k];
            }
        ordering->length[v] = kept;
    }
}

void cairn_block_solver_order_begin(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t n = solver->result.poses;

    list_neighbours(solver);
    remove_duplicates(ordering, n);
    ordering->lowest_score = n;
    ordering->tag = 2;
    ordering->largest_degree = 0;
    ordering->poses_left = n;
    ordering->poses_ordered = 0;
    for (int32_t v = 0; v < n; v++) {
        ordering->head[v] = -1;
        ordering->hash_head[v] = -1;
    }
    /* In descending order, so the lowest pose of a score becomes the head of the list. */
    for (int32_t v = n - 1; v >= 0; v--) {
        ordering->elements[v] = 0;
        ordering->degree[v] = ordering->length[v];
        ordering->size[v] = 1;
        ordering->mark[v] = 1;
        ordering->next_member[v] = -1;
        ordering->last_member[v] = v;
        insert_by_score(ordering, v, score_of(ordering, v, 0, n));
    }
}

/* Compacts all lists to the front of the array, and lowers the tag and all marks below it; those of
 * absorbed elements stay 0. The first entry of each list is saved in `start`, and its place in the
 * array marks the owner. */
static void compact(struct block_solver_order *ordering, int32_t poses)
{
    int32_t write = 0;

    ordering->tag = 2;
    for (int32_t v = 0; v < poses; v++) {
        ordering->mark[v] = ordering->mark[v] != 0;
        if (ordering->length[v] > 0) {
            int32_t first = ordering->graph[ordering->start[v]];

            ordering->graph[ordering->start[v]] = -1 - v;
            ordering->start[v] = first;
        }
    }
    for (int32_t read = 0; read < ordering->graph_end;) {
        int32_t v = -1 - ordering->graph[read];

        if (v < 0) {
            read++;
            continue;
        }
        ordering->graph[write] = ordering->start[v];
        ordering->start[v] = write;
        for (int32_t k = 1; k < ordering->length[v]; k++)
            ordering->graph[write + k] = ordering->graph[read + k];
        read += ordering->length[v];
        write += ordering->length[v];
    }
    ordering->graph_end = write;
}

/* Searches the scores of a work unit for the lowest that has a variable. 1 when it is found, and its
 * first variable is the pivot. */
static int find_pivot(struct block_solver_order *ordering)
{
    int32_t last = ordering->lowest_score + BLOCK_SOLVER_ENTRIES_PER_UNIT;

    for (; ordering->lowest_score < last; ordering->lowest_score++) {
        ordering->pivot = ordering->head[ordering->lowest_score];
        if (ordering->pivot != -1)
            return 1;
    }
    return 0;
}

/* 1 when the array has no capacity for the pivot's list, or the tag is too high. */
static int is_full(const cairn_block_solver *solver)
{
    const struct block_solver_order *ordering = &solver->ordering;
    int32_t capacity = 2 * solver->params.max_links + solver->params.max_poses;

    return ordering->degree[ordering->pivot] > capacity - ordering->graph_end ||
           ordering->tag >= MAX_TAG;
}

/* Starts the elimination of the pivot, whose list is gathered at the end of the array. */
static void begin_pivot(struct block_solver_order *ordering)
{
    int32_t pivot = ordering->pivot;

    remove_from_scores(ordering, pivot);
    ordering->poses_left -= ordering->size[pivot];
    ordering->size[pivot] = -ordering->size[pivot];
    ordering->degree[pivot] = 0;
    ordering->write = ordering->graph_end;
}

/* Appends the variables of a list that are not yet in the pivot's list. */
static void append_to_pivot(struct block_solver_order *ordering, const int32_t *list, int32_t count)
{
    int32_t poses = 0;

    for (int32_t k = 0; k < count; k++) {
        int32_t v = list[k];

        if (ordering->size[v] <= 0)
            continue;
        poses += ordering->size[v];
        ordering->size[v] = -ordering->size[v];
        ordering->graph[ordering->graph_end++] = v;
        remove_from_scores(ordering, v);
    }
    ordering->degree[ordering->pivot] += poses;
}

/* The pivot absorbs element e. */
static void absorb_element(struct block_solver_order *ordering, int32_t e)
{
    append_to_pivot(ordering, &ordering->graph[ordering->start[e]], ordering->length[e]);
    ordering->length[e] = 0;
    ordering->mark[e] = 0;
}

/* The pivot, whose elements before the cursor are absorbed, becomes an element with the list of its
 * neighbours. */
static void gather_variables(struct block_solver_order *ordering)
{
    int32_t pivot = ordering->pivot;

    append_to_pivot(ordering, &ordering->graph[ordering->cursor],
                    ordering->start[pivot] + ordering->length[pivot] - ordering->cursor);
    ordering->start[pivot] = ordering->write;
    ordering->length[pivot] = ordering->graph_end - ordering->write;
    if (ordering->degree[pivot] > ordering->largest_degree)
        ordering->largest_degree = ordering->degree[pivot];
    ordering->tag++;
}

/* First pass: for every element of variable i, mark - tag becomes the number of its poses outside
 * the pivot's list. */
static void scan_elements(struct block_solver_order *ordering, int32_t i)
{
    const int32_t *list = &ordering->graph[ordering->start[i]];

    for (int32_t k = 0; k < ordering->elements[i]; k++) {
        int32_t e = list[k];

        if (ordering->mark[e] >= ordering->tag)
            ordering->mark[e] += ordering->size[i];
        else if (ordering->mark[e] != 0)
            ordering->mark[e] = ordering->degree[e] + ordering->tag + ordering->size[i];
    }
}

/* Merges variable j into i. */
static void merge(struct block_solver_order *ordering, int32_t i, int32_t j)
{
    ordering->next_member[ordering->last_member[i]] = j;
    ordering->last_member[i] = ordering->last_member[j];
    ordering->size[j] = 0;
    ordering->length[j] = 0;
}

/* Second pass: removes from the list of variable i the entries that the pivot's list covers, and
 * bounds its degree outside the pivot's list. */
static void update_variable(cairn_block_solver *solver, int32_t i)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t *list = &ordering->graph[ordering->start[i]], length = ordering->length[i];
    int32_t outside = 0, kept = 0, elements;
    uint32_t hash = (uint32_t)ordering->pivot;

    for (int32_t k = 0; k < ordering->elements[i]; k++) {
        int32_t e = list[k];

        if (ordering->mark[e] > ordering->tag) {
            outside += ordering->mark[e] - ordering->tag;
            hash += (uint32_t)e;
            list[kept++] = e;
        } else if (ordering->mark[e] != 0) {
            ordering->mark[e] = 0;
            ordering->length[e] = 0;
        }
    }
    elements = kept;
    for (int32_t k = ordering->elements[i]; k < length; k++) {
        int32_t j = list[k];

        if (ordering->size[j] > 0) {
            outside += ordering->size[j];
            hash += (uint32_t)j;
            list[kept++] = j;
        }
    }
    if (outside == 0) {
        ordering->poses_left += ordering->size[i];
        ordering->degree[ordering->pivot] += ordering->size[i];
        merge(ordering, ordering->pivot, i);
        return;
    }
    /* The pivot becomes the first element. An element that it absorbed, or the pivot itself, was
     * removed from the list, so there is capacity. */
    list[kept] = list[elements];
    list[elements] = list[0];
    list[0] = ordering->pivot;
    ordering->elements[i] = elements + 1;
    ordering->length[i] = kept + 1;
    if (outside < ordering->degree[i])
        ordering->degree[i] = outside;
    hash %= (uint32_t)solver->result.poses;
    ordering->previous[i] = (int32_t)hash;
    ordering->next[i] = ordering->hash_head[hash];
    ordering->hash_head[hash] = i;
}

/* 1 when variables i and j have equal lists. Marks the entries of i with the tag. */
static int lists_are_equal(const struct block_solver_order *ordering, int32_t i, int32_t j)
{
    const int32_t *first = &ordering->graph[ordering->start[i]],
                  *second = &ordering->graph[ordering->start[j]];

    if (ordering->length[i] != ordering->length[j] ||
        ordering->elements[i] != ordering->elements[j])
        return 0;
    for (int32_t k = 0; k < ordering->length[i]; k++)
        ordering->mark[first[k]] = ordering->tag;
    for (int32_t k = 0; k < ordering->length[j]; k++)
        if (ordering->mark[second[k]] != ordering->tag)
            return 0;
    return 1;
}

/* Third pass: takes the list of the variables with the hash of i. Returns the first, -1: none. */
static int32_t take_hash(struct block_solver_order *ordering, int32_t i)
{
    int32_t hash, first;

    if (ordering->size[i] == 0)
        return -1; /* merged: it has no hash */
    hash = ordering->previous[i];
    first = ordering->hash_head[hash];
    ordering->hash_head[hash] = -1;
    return first;
}

/* Variable that is compared next, -1: none. */
static int32_t next_variable(const struct block_solver_order *ordering)
{
    return ordering->next[ordering->before];
}

/* Merges the next variable of the hash when its list is equal. */
static void compare_next(struct block_solver_order *ordering)
{
    int32_t v = ordering->compared, j = next_variable(ordering);

    if (lists_are_equal(ordering, v, j)) {
        ordering->size[v] += ordering->size[j];
        merge(ordering, v, j);
        ordering->next[ordering->before] = ordering->next[j];
    } else {
        ordering->before = j;
    }
}

/* Last pass: reinserts variable i among the scores. */
static void finish_variable(struct block_solver_order *ordering, int32_t i, int32_t n)
{
    int32_t outside, most;

    if (ordering->size[i] == 0)
        return;
    ordering->size[i] = -ordering->size[i];
    outside = ordering->degree[i] + ordering->degree[ordering->pivot] - ordering->size[i];
    most = ordering->poses_left - ordering->size[i];
    ordering->degree[i] = outside < most ? outside : most;
    insert_by_score(
        ordering, i,
        score_of(ordering, i, ordering->degree[ordering->pivot] - ordering->size[i], n));
    ordering->graph[ordering->write++] = i;
}

/* Number of poses of the pivot, once its list has been updated. */
static int32_t poses_of_pivot(const cairn_block_solver *solver)
{
    return solver->result.poses - solver->ordering.poses_ordered - solver->ordering.poses_left;
}

/* Appends the poses of the pivot to the order of elimination. */
static void end_pivot(cairn_block_solver *solver)
{
    struct block_solver_order *ordering = &solver->ordering;

    ordering->graph_end = ordering->write;
    ordering->length[ordering->pivot] = ordering->graph_end - ordering->start[ordering->pivot];
    ordering->mark[ordering->pivot] = ordering->length[ordering->pivot] > 0;
    for (int32_t v = ordering->pivot; v != -1; v = ordering->next_member[v]) {
        solver->position[v] = ordering->poses_ordered;
        solver->order[ordering->poses_ordered++] = v;
    }
}

int cairn_block_solver_order(cairn_block_solver *solver, cairn_budget *budget)
{
    struct block_solver_order *ordering = &solver->ordering;
    int32_t poses = solver->result.poses, *graph = ordering->graph, *cursor = &ordering->cursor;

    CAIRN_STEP_BEGIN(solver->part_resume);
    while (ordering->poses_left > 0) {
        do
            CAIRN_STEP_CHARGE_UNIT(solver, part_resume, budget);
        while (!find_pivot(ordering));
        if (is_full(solver)) {
            BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget, ordering->graph_end + poses);
            compact(ordering, poses);
        }
        BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget, ordering->length[ordering->pivot]);
        begin_pivot(ordering);
        for (*cursor = ordering->start[ordering->pivot];
             *cursor < ordering->start[ordering->pivot] + ordering->elements[ordering->pivot];
             ++*cursor)
            if (ordering->mark[graph[*cursor]] != 0) {
                BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget,
                                         ordering->length[graph[*cursor]]);
                absorb_element(ordering, graph[*cursor]);
            }
        gather_variables(ordering);
        for (*cursor = ordering->write; *cursor < ordering->graph_end; ++*cursor) {
            BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget,
                                     ordering->elements[graph[*cursor]]);
            scan_elements(ordering, graph[*cursor]);
        }
        for (*cursor = ordering->write; *cursor < ordering->graph_end; ++*cursor) {
            BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget, ordering->length[graph[*cursor]]);
            update_variable(solver, graph[*cursor]);
        }
        ordering->tag += ordering->largest_degree + 1;
        for (*cursor = ordering->write; *cursor < ordering->graph_end; ++*cursor) {
            CAIRN_STEP_CHARGE_UNIT(solver, part_resume, budget);
            for (ordering->compared = take_hash(ordering, graph[*cursor]); ordering->compared != -1;
                 ordering->compared = ordering->next[ordering->compared]) {
                ordering->before = ordering->compared;
                while (next_variable(ordering) != -1) {
                    BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget,
                                             2 * ordering->length[next_variable(ordering)]);
                    compare_next(ordering);
                }
                ordering->tag++;
            }
        }
        for (*cursor = ordering->write; *cursor < ordering->graph_end; ++*cursor) {
            CAIRN_STEP_CHARGE_UNIT(solver, part_resume, budget);
            finish_variable(ordering, graph[*cursor], poses);
        }
        BLOCK_SOLVER_CHARGE_LIST(solver, part_resume, budget, poses_of_pivot(solver));
        end_pivot(solver);
    }
    CAIRN_STEP_END(solver->part_resume);
}
