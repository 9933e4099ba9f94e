/* bench/match --ablate: ablation study of the stages of the method of chapter 6; with --as-written
 * of the method as printed. */
#include "bench/bench_match.h"

#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/random.h"
#include "src/host/base/degrees.h"
#include "src/scans/scan_match_variants.h"

enum { STAGE_COMMON, STAGE_COLINEAR, STAGE_SEGMENTS, STAGE_ALL, STAGE_LINES, STAGES };
enum { BEFORE = 3, ABLATED_POINTS = 4096, ABLATED_BEAMS = 8192 };

/* rotations that are tried: -2 ... 2 degrees */
static const double WRITTEN_WINDOW = 2 * CAIRN_DEGREE;
/* m between the points of a right correspondence, at the true pose of the query */
static const double RIGHT_PAIR = 0.25;

typedef struct ablation {
    int64_t pairs, pairs_right, matches, right, within_half, units;
} ablation;

/* The points of the scans of a place, as written its readings, in the frame of another place by the
 * truth. */
static int32_t points_of_place(const bench_match_problem *p, bench_match_machine *m, int32_t place,
                               int32_t seen_from, int32_t as_written, cairn_oriented_point *out)
{
    static cairn_oriented_point readings[ABLATED_BEAMS];
    int32_t count = 0;

    for (int32_t k = p->first_scan[place]; k < p->scan_count && p->scans[k].place == place; k++) {
        sim_pose seen = bench_pose_between(p->frame[seen_from], p->truth[k]);
        cairn_pose pose = {(cairn_real)seen.x, (cairn_real)seen.y, (cairn_real)seen.theta};
        cairn_transform t = cairn_transform_of(pose);
        cairn_status status;
        cairn_scan_view view = bench_match_view(m, &p->scans[k], &status);

        const cairn_oriented_point *points = as_written ? readings : view.points;
        int32_t points_count = view.point_count;

        if (as_written && status == CAIRN_OK)
            points_count =
                view.beam_count <= ABLATED_BEAMS ? cairn_scan_match_readings(&view, readings) : 0;
        for (int32_t i = 0; i < points_count && status == CAIRN_OK && count < ABLATED_POINTS; i++) {
            out[count].position = cairn_transform_point(t, points[i].position);
            out[count++].direction = cairn_transform_direction(t, points[i].direction);
        }
    }
    return count;
}

/* Matches a place with the union of the last three at their true poses, the heading known, as in
 * the thesis. Both point sets are in the frame of the place, up to the target's shift. angle: half
 * of the window, rad. */
static int ablate_match(cairn_scan_match *match, const cairn_oriented_point *query, int32_t count,
                        const cairn_oriented_point *target, int32_t target_count, cairn_pose shift,
                        double angle, ablation *out)
{
    const cairn_scan_match_window window = {20, (cairn_real)angle};
    cairn_scan_match_part query_part = {.points = query, .count = count},
                          known = {.points = target, .count = target_count};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_match_result found;
    cairn_status status;

    cairn_scan_match_clear_target(match);
    if (cairn_scan_match_add_target(match, &known, shift, NULL) != CAIRN_OK ||
        cairn_scan_match_begin(match, &query_part, cairn_pose_identity(), &window, NULL) !=
            CAIRN_OK)
        return 0;
    while ((status = cairn_scan_match_step(match, &budget)) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    for (int32_t i = 0; i < cairn_scan_match_pair_count(match); i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(match, i);
        cairn_vec2 apart = cairn_vec2_sub(query[pair.query].position, target[pair.target].position);

        out->pairs += pair.stage == CAIRN_SCAN_MATCH_ACCEPTED;
        out->pairs_right +=
            pair.stage == CAIRN_SCAN_MATCH_ACCEPTED && (double)cairn_vec2_norm(apart) < RIGHT_PAIR;
    }
    found = cairn_scan_match_read(match);
    out->matches++;
    out->units += cairn_scan_match_measured(match).units;
    if (found.count > 0) {
        sim_pose pose = bench_sim_pose(found.hypotheses[0].target_query),
                 right = bench_sim_pose(shift);

        out->right += bench_pose_near(right, pose, BENCH_RIGHT_M, BENCH_RIGHT_RAD);
        out->within_half += bench_pose_near(right, pose, 0.5, 10 * CAIRN_DEGREE);
    }
    return status == CAIRN_OK;
}

static int ablate_arena(const bench_match_settings *s, const cairn_place_map_params *params,
                        uint64_t seed, cairn_scan_match *const match[STAGES], ablation *out)
{
    static cairn_oriented_point query[ABLATED_POINTS], target[(BEFORE + 1) * ABLATED_POINTS];
    bench_match_machine m = {NULL, 0, NULL, NULL};
    cairn_random random = cairn_random_seed(seed, 92);
    bench_match_problem p;
    int done;

    if (!bench_match_make(s, seed, &p))
        return 0;
    done = bench_match_machine_make(params, &m);
    for (int32_t place = BEFORE; place < p.place_count && done; place++) {
        int32_t count = points_of_place(&p, &m, place, place, s->as_written, query),
                target_count = 0;
        cairn_pose shift = {2 * cairn_random_uniform(&random, -1, 1),
                            2 * cairn_random_uniform(&random, -1, 1), 0};

        for (int32_t i = place - BEFORE; i < place; i++)
            target_count += points_of_place(&p, &m, i, place, s->as_written, target + target_count);
        if (s->as_written)
            shift.theta = cairn_random_uniform(&random, -1, 1) *
                          (cairn_real)(s->heading_error * CAIRN_DEGREE);
        for (int k = 0; k < STAGES && done; k++)
            done = ablate_match(match[k], query, count, target, target_count, shift,
                                s->as_written ? WRITTEN_WINDOW : 0, &out[k]);
    }
    free(m.memory);
    bench_match_free(&p);
    return done;
}

static void print_ablation(const bench_match_settings *s, const ablation *all)
{
    static const char *const names[STAGES] = {"common subsequence", "+ colinear filter",
                                              "+ segment filter", "+ ICP",
                                              "all but the colinear filter"};

    for (int k = 0; k < STAGES; k++) {
        double matches = (double)(all[k].matches > 0 ? all[k].matches : 1);
        double pairs = (double)(all[k].pairs > 0 ? all[k].pairs : 1);

        bench_json_begin("match");
        bench_json_text("ablation", names[k]);
        bench_json_integer("arenas", s->arenas);
        bench_json_integer("matches", all[k].matches);
        bench_json_integer("as_written", s->as_written);
        bench_json_number("correspondences", (double)all[k].pairs / matches);
        bench_json_number("correspondences_right", (double)all[k].pairs_right / pairs);
        bench_json_number("near", (double)all[k].within_half / matches);
        bench_json_number("success", (double)all[k].right / matches);
        bench_json_number("ops_mean", (double)all[k].units / matches);
        bench_json_end();
    }
    bench_json_begin("match");
    bench_json_integer("arenas", s->arenas);
    bench_json_integer("matches", all[STAGE_ALL].matches);
    bench_json_integer("right", all[STAGE_ALL].right);
    bench_json_integer("right_without_icp", all[STAGE_SEGMENTS].right);
    bench_json_integer("right_without_colinear", all[STAGE_LINES].right);
    bench_json_true("summary");
    bench_json_end();
}

int bench_match_ablate(const bench_match_settings *s, const cairn_place_map_params *map)
{
    static const cairn_scan_match_mode modes[2][STAGES] = {
        {CAIRN_SCAN_MATCH_SHAPE_COMMON, CAIRN_SCAN_MATCH_SHAPE_COLINEAR,
         CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, CAIRN_SCAN_MATCH_SHAPE, CAIRN_SCAN_MATCH_SHAPE_LINES},
        {CAIRN_SCAN_MATCH_AS_WRITTEN_COMMON, CAIRN_SCAN_MATCH_AS_WRITTEN_COLINEAR,
         CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS, CAIRN_SCAN_MATCH_AS_WRITTEN,
         CAIRN_SCAN_MATCH_AS_WRITTEN_LINES}};
    cairn_scan_match_params params =
        s->as_written ? cairn_scan_match_as_written() : cairn_scan_match_default();
    cairn_scan_match *match[STAGES];
    void *memory[STAGES] = {NULL};
    ablation all[STAGES];
    int done = 1;

    memset(all, 0, sizeof all);
    params.max_target = (BEFORE + 1) * ABLATED_POINTS;
    params.max_query = ABLATED_POINTS;
    for (int k = 0; k < STAGES && done; k++) {
        cairn_pool pool;
        size_t bytes;

        params.mode = modes[s->as_written][k];
        bytes = cairn_scan_match_memory(&params) + CAIRN_ALIGN;
        memory[k] = malloc(bytes);
        done = memory[k] != NULL && cairn_pool_init(&pool, memory[k], bytes) == CAIRN_OK &&
               cairn_scan_match_create(&match[k], &pool, &params) == CAIRN_OK;
    }
    for (int64_t i = 0; i < s->arenas && done; i++)
        done = ablate_arena(s, map, (uint64_t)(s->seed + i), match, all);
    if (done)
        print_ablation(s, all);
    for (int k = 0; k < STAGES; k++)
        free(memory[k]);
    return done;
}
