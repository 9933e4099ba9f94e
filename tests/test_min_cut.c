/* The minimum cut beside all cuts of small random graphs, one by one. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cut_is_the_least_of_all_with_the_fewest_nodes),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
