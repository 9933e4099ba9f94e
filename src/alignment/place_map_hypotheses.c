/* place_map: hypotheses of pairs of places: bounded covariance, score, local optimization. */
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

cairn_real cairn_place_map_score_pair(cairn_place_map *map, int32_t first, int32_t second,
                                      cairn_pose first_second)
{
    map->units_due += cairn_place_map_pair_units(map, first, second);
    return cairn_place_map_pair_likelihood(map, first, second, first_second);
}

void cairn_place_map_rotate_covariance(const cairn_real in[9], cairn_real theta, cairn_real out[9])
{
    cairn_sym3_to_full(cairn_sym3_rotate_by(cairn_sym3_of_full(in), -theta), out);
}

/* A match aligns faces of walls; opposite faces, rough surfaces and bodies are as informative. */
cairn_real cairn_place_map_optimize_hypothesis(cairn_place_map *map,
                                               cairn_pose_consensus_relative_pose *pose)
{
    cairn_pose matched = pose->first_second;
    cairn_real before = cairn_place_map_score_pair(map, pose->first, pose->second, matched),
               best = before;
    cairn_real step = SEARCH_STEP_M, turn = SEARCH_STEP_RAD;

    for (int32_t halvings = 0, moves = 0; halvings < MAX_HALVINGS && moves < MAX_MOVES;) {
        cairn_pose around = pose->first_second, better = around;

        for (int32_t k = 0; k < 6; k++) {
            cairn_pose tried = around;
            cairn_real evidence, sign = k % 2 == 0 ? 1 : -1;

            tried.x += k / 2 == 0 ? sign * step : 0;
            tried.y += k / 2 == 1 ? sign * step : 0;
            tried.theta += k / 2 == 2 ? sign * turn : 0;
            evidence = cairn_place_map_score_pair(map, pose->first, pose->second, tried);
            if (evidence > best) {
                best = evidence;
                better = tried;
            }
        }
        pose->first_second = better;
        moves++;
        if (better.x == around.x && better.y == around.y && better.theta == around.theta) {
            halvings++;
            step /= 2;
            turn /= 2;
        }
    }
    if (best < before + MIN_GAIN_NATS) {
        pose->first_second = matched;
        return before;
    }
    return best;
}
