/* Skeletons of Adluru 2008, chapter 3, compared with a reference implementation: every centre
 * point, and whole walks. */
#include "tests/skeleton_reference.h"

/* 1: an edgel lies in the look-ahead circle of a side. */
static int is_ahead(const reference_pose *last, const double heading[2], int32_t side,
                    const cairn_edgel *e, double reach)
{
    double tx = -last->ny[side], ty = last->nx[side],
           sign = tx * heading[0] + ty * heading[1] < 0 ? -1 : 1;

    return hypot((double)e->position.x - last->x[side] - sign * reach * tx,
                 (double)e->position.y - last->y[side] - sign * reach * ty) <= reach;
}

/* The heaviest follower. 0: none. */
static int best_follower(const reference_pose *walk, int32_t count, const double heading[2],
                         const cairn_skeleton_grouping_params *p, double least, double most,
                         reference_pose *best, double *weight)
{
    const reference_pose *last = &walk[count - 1];
    double margin = 3 * (double)p->radius_sigma;
    int32_t followers = 0;

    for (int32_t i = 0; i < edgel_count; i++)
        for (int32_t j = 0;
             j < edgel_count && is_ahead(last, heading, 0, &edgels[i], (double)p->step_sigma);
             j++) {
            reference_pose next;
            double way[2], w;

            if (i == j || !is_ahead(last, heading, 1, &edgels[j], (double)p->step_sigma) ||
                !reference_of(i, j, fmax(least - margin, 1), most + margin,
                              (double)p->symmetry_sigma, &next) ||
                !put_in_order(last, &next, way) || !may_follow(walk, count, &next))
                continue;
            w = reference_weight(last, &next, p, least, most);
            if (followers++ == 0 || w > *weight) {
                *weight = w;
                *best = next;
            }
        }
    assert_true(followers < 256);
    return followers > 0;
}

/* Poses of the walk of one particle from a pose on; 0: no match. */
static int is_walk_of(const cairn_skeleton_grouping_result *r,
                      const cairn_skeleton_grouping_part *part, const double way[2],
                      const cairn_skeleton_grouping_params *p, double least, double most)
{
    static reference_pose walk[64];
    const cairn_skeleton_grouping_point *points = &r->points[part->first];
    double heading[2] = {way[0], way[1]}, sum = 0, weight = 0;
    int32_t count = 1, first = points[0].edgel[0], second = points[0].edgel[1];

    assert_true(reference_of(first, second, 1, 1000, PI, &walk[0]));
    for (; count <= p->max_steps; count++) {
        if (!best_follower(walk, count, heading, p, least, most, &walk[count], &weight) ||
            weight < -(double)p->stop_log_odds)
            break;
        (void)put_in_order(&walk[count - 1], &walk[count], heading);
        sum += weight + REFERENCE;
    }
    if (count != part->count || fabs(sum - (double)part->log_odds) > 1e-6)
        return 0;
    for (int32_t i = 0; i < count; i++)
        if (fabs((double)points[i].centre.x - walk[i].cx) > 1e-6 ||
            fabs((double)points[i].centre.y - walk[i].cy) > 1e-6 ||
            fabs((double)points[i].radius - walk[i].r) > 1e-6)
            return 0;
    return 1;
}

static void centres_are_those_of_all_pairs(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    struct fixture f = with(params);

    (void)state;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        int32_t expected = 0, listed = 0;
        cairn_vec2 at;
        cairn_real radius;

        edgel_count = 0;
        add_noise(500, 10 + seed);
        for (int32_t i = 0; i < edgel_count; i++)
            for (int32_t j = i + 1; j < edgel_count; j++) {
                reference_pose t;

                expected += reference_of(i, j, 5, 11, (double)params.symmetry_sigma, &t);
            }
        assert_true(expected > 50 && expected < params.max_centres);
        assert_near(run(f.skeleton, 5, 11).centre_count, expected, NUMBER(0, 2));
        while (cairn_skeleton_grouping_centre_point(f.skeleton, listed, &at, &radius)) {
            assert_true(radius >= 5 && radius <= 11);
            listed++;
        }
        assert_near(listed, expected, NUMBER(0, 2));
    }
    test_pool_free(&f.pool);
}

/* With one particle the walk is the chain of the heaviest followers. */
static void walks_are_those_of_the_reference(void **state)
{
    cairn_skeleton_grouping_params params = small_params();
    int32_t walks = 0;

    (void)state;
    if (sizeof(cairn_real) < sizeof(double))
        skip();
    params.particle_count = 1;
    params.step_sigma = 6;
    params.min_log_odds = 0;
    params.max_steps = 40;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        struct fixture f = with(params);
        cairn_skeleton_grouping_result found;

        add_bar(50, 60, 110, 70, 7, seed);
        add_noise(60, seed);
        found = run(f.skeleton, 6, 8);
        check(&found, &params);
        for (int32_t i = 0; i < found.part_count; i++) {
            cairn_polyline_segment line;
            int known = 0;

            for (int32_t k = 0; !known && cairn_skeleton_grouping_mirror_line(f.skeleton, k, &line);
                 k++)
                for (int32_t sign = -1; sign <= 1; sign += 2) {
                    double way[2] = {sign * (double)(line.b[0] - line.a[0]),
                                     sign * (double)(line.b[1] - line.a[1])};

                    known |= is_walk_of(&found, &found.parts[i], way, &params, 6, 8);
                }
            assert_true(known);
            walks++;
        }
        test_pool_free(&f.pool);
    }
    assert_true(walks >= 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(centres_are_those_of_all_pairs),
        cmocka_unit_test(walks_are_those_of_the_reference),
    };
    return cmocka_run_group_tests_name("skeleton_written_walk", tests, NULL, NULL);
}
