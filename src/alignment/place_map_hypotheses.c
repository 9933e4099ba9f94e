/* place_map: hypotheses of pairs of places: bounded covariance, local optimization, score. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/small_matrix.h"
#include "src/alignment/place_map_work.h"

/* m and rad: standard deviations within which the likelihood changes little. */
static const cairn_real VALID_SIGMA_M = CAIRN_REAL(0.05), VALID_SIGMA_RAD = CAIRN_REAL(0.02);

/* Pattern search: first steps, m and rad, halved MAX_HALVINGS times in at most MAX_MOVES moves;
 * least gain, nats: good matches are more exact than the likelihood's maximum. */
static const cairn_real SEARCH_STEP_M = CAIRN_REAL(0.08), SEARCH_STEP_RAD = CAIRN_REAL(0.02),
                        MIN_GAIN_NATS = 1;
enum { MAX_HALVINGS = 3, MAX_MOVES = 10 };

/* Bounds the covariance to the region for which the score is valid, so that a match with an
 * unobservable direction does not support poses along a wall or about a round body that were never
 * evaluated. */
static void bound_covariance(const cairn_real in[9], cairn_real out[9])
{
    cairn_sym3 information, bounded;

    memcpy(out, in, 9 * sizeof *out);
    if (!cairn_sym3_inverse(cairn_sym3_of_full(in), &information))
        return;
    information.xx += 1 / (VALID_SIGMA_M * VALID_SIGMA_M);
    information.yy += 1 / (VALID_SIGMA_M * VALID_SIGMA_M);
    information.zz += 1 / (VALID_SIGMA_RAD * VALID_SIGMA_RAD);
    if (cairn_sym3_inverse(information, &bounded))
        cairn_sym3_to_full(bounded, out);
}

void cairn_place_map_add_hypothesis(cairn_place_map *map, int32_t first, int32_t second,
                                    cairn_pose first_second, const cairn_real covariance[9])
{
    cairn_pose_consensus_relative_pose *kept = &map->hypotheses[map->hypothesis_count];

    if (map->hypothesis_count == map->params.consensus.max_hypotheses)
        return;
    kept->first = first;
    kept->second = second;
    kept->first_second = first_second;
    bound_covariance(covariance, kept->covariance);
    map->hypothesis_count++;
}

void cairn_place_map_rotate_covariance(const cairn_real in[9], cairn_real theta, cairn_real out[9])
{
    cairn_sym3_to_full(cairn_sym3_rotate_by(cairn_sym3_of_full(in), -theta), out);
}

/* ---- Scores ---- */

/* Pairwise likelihood function of the consensus. */
static int pair_likelihood(void *context, int32_t first, int32_t second, cairn_pose first_second,
                           cairn_pose_likelihood *likelihood, cairn_budget *budget)
{
    const cairn_place_map *map = context;

    if (!cairn_budget_charge(budget, &likelihood->units_charged,
                             cairn_place_map_pair_units(map, first, second)))
        return 0;
    likelihood->ratio = cairn_place_map_pair_likelihood(map, first, second, first_second);
    return 1;
}

static cairn_pose_consensus_relative_pose *visited(const cairn_place_map *map)
{
    return &map->hypotheses[map->hypothesis];
}

/* Returns the log-likelihood ratio of the visited hypothesis at a pose, and its units. */
static cairn_real likelihood_at(const cairn_place_map *map, cairn_pose first_second)
{
    return cairn_place_map_pair_likelihood(map, visited(map)->first, visited(map)->second,
                                           first_second);
}

static int32_t units_of_visited(const cairn_place_map *map)
{
    return cairn_place_map_pair_units(map, visited(map)->first, visited(map)->second);
}

static void begin_pattern(cairn_place_map *map)
{
    struct place_map_pattern *pattern = &map->pattern;

    pattern->matched = pattern->better = visited(map)->first_second;
    pattern->before = pattern->best = likelihood_at(map, pattern->matched);
    pattern->metres = SEARCH_STEP_M;
    pattern->radians = SEARCH_STEP_RAD;
    pattern->moves = pattern->halvings = 0;
}

/* Evaluates the next pose of the pattern. */
static void try_direction(cairn_place_map *map)
{
    struct place_map_pattern *pattern = &map->pattern;
    int32_t axis = pattern->direction / 2;
    cairn_real sign = pattern->direction % 2 == 0 ? 1 : -1, metres = sign * pattern->metres;
    cairn_pose tried = pattern->around;
    cairn_real evidence;

    tried.x += axis == 0 ? metres : 0;
    tried.y += axis == 1 ? metres : 0;
    tried.theta += axis == 2 ? sign * pattern->radians : 0;
    evidence = likelihood_at(map, tried);
    if (evidence > pattern->best) {
        pattern->best = evidence;
        pattern->better = tried;
    }
}

/* A pattern without a better pose is halved. */
static void end_move(struct place_map_pattern *pattern)
{
    pattern->moves++;
    if (pattern->better.x == pattern->around.x && pattern->better.y == pattern->around.y &&
        pattern->better.theta == pattern->around.theta) {
        pattern->halvings++;
        pattern->metres /= 2;
        pattern->radians /= 2;
    }
}

/* Keeps the best pose, or that of the match unless the gain is enough. */
static void end_pattern(cairn_place_map *map)
{
    const struct place_map_pattern *pattern = &map->pattern;
    int is_better = !(pattern->best < pattern->before + MIN_GAIN_NATS);

    visited(map)->first_second = is_better ? pattern->better : pattern->matched;
    visited(map)->score = is_better ? pattern->best : pattern->before;
}

/* Step of a part: moves the hypothesis to the local maximum of its likelihood, which becomes its
 * score. A match aligns faces of walls; opposite faces, rough surfaces and bodies are as
 * informative. */
static int optimize(cairn_place_map *map, cairn_budget *budget)
{
    struct place_map_pattern *pattern = &map->pattern;

    CAIRN_STEP_BEGIN(map->resume.part);
    CAIRN_STEP_CHARGE(map, resume.part, budget, units_of_visited(map));
    begin_pattern(map);
    while (pattern->halvings < MAX_HALVINGS && pattern->moves < MAX_MOVES) {
        pattern->around = pattern->better;
        for (pattern->direction = 0; pattern->direction < 6; pattern->direction++) {
            CAIRN_STEP_CHARGE(map, resume.part, budget, units_of_visited(map));
            try_direction(map);
        }
        end_move(pattern);
    }
    end_pattern(map);
    CAIRN_STEP_END(map->resume.part);
}

/* Clears the consensus. */
static void begin_scores(cairn_place_map *map)
{
    cairn_must_be_ok(cairn_pose_consensus_clear(map->consensus, map->place_count));
    cairn_pose_consensus_set_pair_likelihood(map->consensus, pair_likelihood, map);
    cairn_pose_consensus_set_joint_likelihood(map->consensus, cairn_place_map_joint_likelihood,
                                              map);
    map->result.hypotheses = 0;
}

/* Adds the hypothesis to the consensus when its score is positive. */
static void add_to_consensus(cairn_place_map *map)
{
    visited(map)->score -= map->params.chance_nats;
    if (visited(map)->score > 0 &&
        cairn_pose_consensus_add(map->consensus, visited(map), NULL) == CAIRN_OK)
        map->result.hypotheses++;
}

/* All are scored again in each round, as fewer points are valid. */
int cairn_place_map_score(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    CAIRN_STEP_CHARGE(map, resume.phase, budget, 1 + map->place_count);
    begin_scores(map);
    for (map->hypothesis = 0; map->hypothesis < map->hypothesis_count; map->hypothesis++) {
        if (map->hypothesis < map->optimized_hypotheses) {
            CAIRN_STEP_CHARGE(map, resume.phase, budget, units_of_visited(map));
            visited(map)->score = likelihood_at(map, visited(map)->first_second);
        } else {
            CAIRN_STEP_RUN(map, resume.phase, budget, optimize);
        }
        add_to_consensus(map);
    }
    map->optimized_hypotheses = map->hypothesis_count;
    CAIRN_STEP_END(map->resume.phase);
}
