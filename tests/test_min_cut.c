/* The minimum cut beside all cuts of small random graphs, one by one; least capacities, small
 * budgets, and cuts that are not ended. */
#include "tests/test.h"

#include "src/containers/min_cut.h"

enum { MAX_NODES = 8, MAX_EDGES = 20, GRAPHS = 3000 };

typedef struct graph {
    int32_t node_count, edge_count;
    min_cut_node nodes[MAX_NODES];
    min_cut_edge edges[MAX_EDGES];
    min_cut cut;
} graph;

/* Whole capacities, of which many are 0; nodes may share several edges. */
static void make_graph(graph *g, cairn_random *random)
{
    g->node_count = 2 + (int32_t)cairn_random_below(random, MAX_NODES - 1);
    g->edge_count = (int32_t)cairn_random_below(random, MAX_EDGES + 1);
    min_cut_clear(&g->cut, g->nodes, g->edges, g->node_count);
    for (int32_t i = 0; i < g->node_count; i++)
        g->nodes[i].capacity = (cairn_real)cairn_random_below(random, 15) - 7;
    for (int32_t k = 0; k < g->edge_count; k++) {
        int32_t a = (int32_t)cairn_random_below(random, g->node_count), b = a;

        while (b == a)
            b = (int32_t)cairn_random_below(random, g->node_count);
        min_cut_link(&g->cut, k, a, b);
        for (int side = 0; side < 2; side++)
            g->edges[k].capacity[side] =
                cairn_max((cairn_real)cairn_random_below(random, 9) - 3, 0);
    }
}

/* Capacity of the cut with the nodes of a set on the side of the source. */
static cairn_real capacity_of(const graph *g, uint32_t set)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < g->node_count; i++)
        if (set >> i & 1)
            sum += cairn_max(-g->nodes[i].capacity, 0);
        else
            sum += cairn_max(g->nodes[i].capacity, 0);
    for (int32_t k = 0; k < g->edge_count; k++)
        for (int side = 0; side < 2; side++)
            if ((set >> g->edges[k].ends[side] & 1) && !(set >> g->edges[k].ends[!side] & 1))
                sum += g->edges[k].capacity[side];
    return sum;
}

static uint32_t source_side(const graph *g)
{
    uint32_t set = 0;

    for (int32_t i = 0; i < g->node_count; i++)
        set |= (uint32_t)min_cut_is_with_source(&g->cut, i) << i;
    return set;
}

/* Runs the cut with `units` a step. */
static void run(graph *g, int32_t units)
{
    cairn_budget budget = {units};
    int32_t charged = 0;

    while (!min_cut_step(&g->cut, &budget, &charged)) {
        assert_int_equal(budget.left, 0);
        budget.left = units;
    }
    assert_int_equal(charged, 0);
}

static void cut_is_the_least_of_all_with_the_fewest_nodes(void **state)
{
    cairn_random random = cairn_random_seed(7, 1);

    (void)state;
    for (int32_t round = 0; round < GRAPHS; round++) {
        graph g, whole;
        cairn_real least = CAIRN_REAL_MAX;
        uint32_t common = ~(uint32_t)0;

        make_graph(&g, &random);
        whole = g;
        for (uint32_t set = 0; set >> g.node_count == 0; set++) {
            cairn_real sum = capacity_of(&whole, set);

            if (sum < least)
                common = ~(uint32_t)0;
            least = cairn_min(least, sum);
            if (sum <= least)
                common &= set;
        }
        /* Minimum cuts are closed under intersection: the common nodes are one of them. */
        g.cut.nodes = g.nodes;
        g.cut.edges = g.edges;
        run(&g, 1 + round % 5);
        assert_int_equal(source_side(&g), common);
    }
}

/* Returns the least capacity of all cuts. */
static cairn_real least_of(const graph *g)
{
    cairn_real least = CAIRN_REAL_MAX;

    for (uint32_t set = 0; set >> g->node_count == 0; set++)
        least = cairn_min(least, capacity_of(g, set));
    return least;
}

static void one_node_is_with_what_it_leads_to(void **state)
{
    static const cairn_real capacities[] = {
        0, 1, -1, MIN_CUT_LEAST, 2 * MIN_CUT_LEAST, -MIN_CUT_LEAST};
    static const uint32_t expected[] = {0, 1, 0, 0, 1, 0};

    (void)state;
    for (size_t k = 0; k < sizeof capacities / sizeof *capacities; k++) {
        graph g = {.node_count = 1};

        min_cut_clear(&g.cut, g.nodes, g.edges, 1);
        for (int round = 0; round < 2; round++) {
            g.nodes[0].capacity = capacities[k];
            run(&g, 1);
            assert_int_equal(source_side(&g), expected[k]);
            assert_true(g.nodes[0].capacity == capacities[k]);
        }
    }
}

/* A node that the source feeds, an edge, and a node that leads nowhere or into the sink. */
static graph pair_of(cairn_real source, cairn_real edge, cairn_real end)
{
    graph g = {.node_count = 2, .edge_count = 1};

    min_cut_clear(&g.cut, g.nodes, g.edges, 2);
    min_cut_link(&g.cut, 0, 0, 1);
    g.nodes[0].capacity = source;
    g.nodes[1].capacity = end;
    g.edges[0].capacity[0] = edge;
    g.edges[0].capacity[1] = 0;
    return g;
}

static uint32_t side_of_pair(cairn_real source, cairn_real edge, cairn_real end)
{
    graph g = pair_of(source, edge, end);

    g.cut.nodes = g.nodes;
    g.cut.edges = g.edges;
    run(&g, CAIRN_UNBOUNDED);
    return source_side(&g);
}

static void the_least_capacity_counts_as_none(void **state)
{
    const cairn_real least = MIN_CUT_LEAST;

    (void)state;
    assert_int_equal(side_of_pair(1, least, 0), 1);
    assert_int_equal(side_of_pair(1, 2 * least, 0), 3);
    assert_int_equal(side_of_pair(1, least / 2, -1), 1);
    assert_int_equal(side_of_pair(1, 2 * least, -2), 1);
    assert_int_equal(side_of_pair(1, 2, -least), 3);
    assert_int_equal(side_of_pair(1, 2, -2 * least), 3);
    assert_int_equal(side_of_pair(1, 2, -1 + least / 2), 0);
    assert_int_equal(side_of_pair(1, 2, -1 + 2 * least), 3);
    assert_int_equal(side_of_pair(2 * least, 2, -least), 3);
    assert_int_equal(side_of_pair(2 * least, 2, -3 * least), 0);
}

/* Capacities of a few halves of the least one: the cut is the least up to what is left out. */
static void cuts_of_small_capacities_are_nearly_the_least(void **state)
{
    cairn_random random = cairn_random_seed(8, 1);

    (void)state;
    for (int32_t round = 0; round < GRAPHS; round++) {
        graph g, whole;
        cairn_real excess;

        make_graph(&g, &random);
        for (int32_t i = 0; i < g.node_count; i++)
            g.nodes[i].capacity *= MIN_CUT_LEAST / 2;
        for (int32_t k = 0; k < 2 * g.edge_count; k++)
            g.edges[k / 2].capacity[k % 2] *= MIN_CUT_LEAST / 2;
        whole = g;
        run(&g, 1 + round % 5);
        excess = capacity_of(&whole, source_side(&g)) - least_of(&whole);
        assert_true(excess <= MIN_CUT_LEAST * (cairn_real)(g.node_count + 2 * g.edge_count) *
                                  (1 + (cairn_real)1e-4));
    }
}

/* Steps with `units` until the end, or `calls` of them. Returns the units that were used. */
static int32_t run_some(graph *g, int32_t units, int32_t calls)
{
    int32_t charged = 0, used = 0;

    for (int32_t k = 0; k < calls; k++) {
        cairn_budget budget = {units};
        int done = min_cut_step(&g->cut, &budget, &charged);

        used += units - budget.left;
        if (done)
            break;
    }
    return used;
}

static void copy_graph(graph *to, const graph *from)
{
    *to = *from;
    to->cut.nodes = to->nodes;
    to->cut.edges = to->edges;
}

static void same_bits(const graph *a, const graph *b)
{
    assert_int_equal(source_side(a), source_side(b));
    for (int32_t i = 0; i < a->node_count; i++)
        assert_true(a->nodes[i].capacity == b->nodes[i].capacity);
    for (int32_t k = 0; k < 2 * a->edge_count; k++)
        assert_true(a->edges[k / 2].capacity[k % 2] == b->edges[k / 2].capacity[k % 2]);
}

static void units_of_one_give_the_same_bits_at_the_same_cost(void **state)
{
    cairn_random random = cairn_random_seed(9, 1);

    (void)state;
    for (int32_t round = 0; round < GRAPHS; round++) {
        graph g, other;

        make_graph(&g, &random);
        for (int32_t i = 0; i < g.node_count; i++)
            g.nodes[i].capacity *= cairn_random_uniform(&random, 0, 1);
        copy_graph(&other, &g);
        assert_int_equal(run_some(&g, CAIRN_UNBOUNDED, 1), run_some(&other, 1, INT32_MAX));
        same_bits(&g, &other);
    }
}

/* A cut ends early, the graph is cleared, and another one takes its memory. */
static void a_graph_that_was_left_early_does_not_matter(void **state)
{
    cairn_random random = cairn_random_seed(10, 1);

    (void)state;
    for (int32_t round = 0; round < GRAPHS; round++) {
        graph g, fresh = {.node_count = 0};
        cairn_random again;

        make_graph(&g, &random);
        (void)run_some(&g, 1, 1 + round % 40);
        again = random;
        make_graph(&g, &random);
        make_graph(&fresh, &again);
        assert_int_equal(run_some(&g, 1, INT32_MAX), run_some(&fresh, 1, INT32_MAX));
        same_bits(&g, &fresh);
    }
}

/* A node with many arcs costs in proportion, and does not in one step what exceeds a unit. */
static void arcs_are_charged(void **state)
{
    enum { LEAVES = 400 };
    static min_cut_node nodes[LEAVES + 1];
    static min_cut_edge edges[LEAVES];
    int32_t used[2];

    (void)state;
    for (int k = 0; k < 2; k++) {
        int32_t leaves = LEAVES / (k + 1), charged = 0;
        min_cut cut;

        memset(&cut, 0, sizeof cut);
        used[k] = 0;
        min_cut_clear(&cut, nodes, edges, leaves + 1);
        for (int32_t i = 0; i < leaves; i++) {
            min_cut_link(&cut, i, 0, i + 1);
            edges[i].capacity[0] = edges[i].capacity[1] = 1;
            nodes[i + 1].capacity = 0;
        }
        nodes[0].capacity = 1;
        for (int is_done = 0; !is_done; used[k]++) {
            cairn_budget budget = {1};
            int32_t before = cut.tail;

            is_done = min_cut_step(&cut, &budget, &charged);
            assert_true(cut.tail - before <= MIN_CUT_ARCS_PER_UNIT);
        }
        for (int32_t i = 0; i <= leaves; i++)
            assert_true(min_cut_is_with_source(&cut, i));
    }
    assert_true(used[0] > LEAVES / MIN_CUT_ARCS_PER_UNIT);
    assert_in_range(used[0], 2 * used[1] - 8, 2 * used[1] + 8);
}

/* The same edges with other capacities. */
static void a_graph_can_be_cut_again(void **state)
{
    cairn_random random = cairn_random_seed(11, 1);

    (void)state;
    for (int32_t round = 0; round < GRAPHS; round++) {
        graph g, first;

        make_graph(&g, &random);
        copy_graph(&first, &g);
        run(&g, 3);
        for (int32_t i = 0; i < g.node_count; i++)
            first.nodes[i].capacity = g.nodes[i].capacity = -(cairn_real)i + 2;
        for (int32_t k = 0; k < 2 * g.edge_count; k++)
            first.edges[k / 2].capacity[k % 2] = g.edges[k / 2].capacity[k % 2] =
                (cairn_real)(k % 3);
        run(&g, 2);
        run(&first, 2);
        same_bits(&g, &first);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cut_is_the_least_of_all_with_the_fewest_nodes),
        cmocka_unit_test(one_node_is_with_what_it_leads_to),
        cmocka_unit_test(the_least_capacity_counts_as_none),
        cmocka_unit_test(cuts_of_small_capacities_are_nearly_the_least),
        cmocka_unit_test(units_of_one_give_the_same_bits_at_the_same_cost),
        cmocka_unit_test(a_graph_that_was_left_early_does_not_matter),
        cmocka_unit_test(a_graph_can_be_cut_again),
        cmocka_unit_test(arcs_are_charged),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
