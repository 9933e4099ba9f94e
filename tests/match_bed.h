/* Shared by the tests of scan_match by stages and as written: a room with niches, and a match of
 * two scans of it. */
#ifndef CAIRN_TESTS_MATCH_BED_H
#define CAIRN_TESTS_MATCH_BED_H

#include "tests/test.h"

#include "cairn/scan_match.h"

enum { MAX_COUNT = 400 };

/* The corners of a room with niches, counter-clockwise. */
static const cairn_vec2 room[] = {{-2, -2}, {3, -2}, {3, 0},  {2, 0},  {2, 1},   {3, 1},
                                  {3, 3},   {-2, 3}, {-2, 1}, {-3, 1}, {-3, -1}, {-2, -1}};

/* Points every 9.3 cm along the room's walls as seen from a pose, without those of some walls. */
static inline int32_t see(cairn_oriented_point *points, cairn_pose pose, int32_t first_wall,
                          int32_t walls)
{
    cairn_transform t = cairn_transform_of(cairn_pose_inverse(pose));
    int32_t corners = sizeof room / sizeof *room, count = 0;

    for (int32_t w = first_wall; w < first_wall + walls; w++) {
        cairn_vec2 a = room[w % corners], along = cairn_vec2_sub(room[(w + 1) % corners], a);
        cairn_vec2 unit = cairn_vec2_unit(along);

        for (cairn_real s = CAIRN_REAL(0.05); s < cairn_vec2_norm(along); s += CAIRN_REAL(0.093)) {
            assert_true(count < MAX_COUNT);
            points[count].position =
                cairn_transform_point(t, cairn_vec2_add(a, cairn_vec2_scale(unit, s)));
            points[count++].direction = cairn_transform_direction(t, unit);
        }
    }
    return count;
}

typedef struct bed {
    cairn_pool pool;
    cairn_scan_match *match;
    cairn_oriented_point target[MAX_COUNT], query[MAX_COUNT];
    cairn_scan_match_part target_part, query_part;
    cairn_pose start; /* of the search */
    cairn_pose truth; /* the pose of the query, when the caller gives it */
} bed;

/* A match of a target seen from `home`, with the walls from the first on, and a query seen from
 * `from`, with the walls from the fourth on: nine of them. */
static inline void open_bed(bed *b, cairn_scan_match_params params, cairn_pose home, int32_t walls,
                            cairn_pose from)
{
    memset(b, 0, sizeof *b);
    params.max_query = MAX_COUNT;
    params.max_target = 2 * MAX_COUNT;
    b->pool = test_pool(cairn_scan_match_memory(&params));
    assert_ok(cairn_scan_match_create(&b->match, &b->pool, &params));
    b->target_part.points = b->target;
    b->target_part.count = see(b->target, home, 0, walls);
    b->query_part.points = b->query;
    b->query_part.count = see(b->query, from, 3, 9);
    assert_ok(cairn_scan_match_add_target(b->match, &b->target_part, cairn_pose_identity(), NULL));
}

/* The search about b->start. */
static inline cairn_scan_match_result run_in(bed *b, const cairn_scan_match_window *window)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_scan_match_begin(b->match, &b->query_part, b->start, window, NULL));
    assert_int_equal(cairn_scan_match_pair_count(b->match), 0);
    assert_ok(cairn_scan_match_step(b->match, &budget));
    return cairn_scan_match_read(b->match);
}

#endif
