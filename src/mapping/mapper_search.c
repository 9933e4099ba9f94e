/* A scan in doubt is searched for in the window about its prediction, by shape alone.
 *
 * Method. scan_match gets the key scans near by, first in a small window, then in a wide one.
 * Where its best hypothesis is the match at hand, that stands. What it finds far from where
 * trusted odometry leads must be no chance likeness: the evidence must outweigh the odds against
 * such a throw. A single scan that nearly does so is kept in mind: when the next one tells the
 * same, both together decide, and a scan that may be elsewhere does not become a key scan
 * meanwhile. */
#include "src/core/build.h"

#include "src/mapping/mapper_work.h"

/* m and rad */
static const cairn_real SEARCH_WINDOW = CAIRN_REAL(0.5), SEARCH_ANGLE = CAIRN_REAL(0.5);
/* ... when nothing was found there, in MAPPER_WIDE_WINDOW */
static const cairn_real WIDE_ANGLE = CAIRN_REAL(1.6);
/* m and rad: nobody pushes a robot much farther */
static const cairn_real THROWN = CAIRN_REAL(0.5);
/* log odds against it, by the square of that, to 4 times as many */
static const cairn_real THROWN_COST = 3;
/* m and rad: what two scans tell of one place differs by no more, while somebody pushes. */
static const cairn_real ALIKE = CAIRN_REAL(0.3);
/* Log odds, by scan_match, that a place is no chance likeness; here it is most likely in the
 * window. */
static const cairn_real LOCAL_EVIDENCE = -4;
/* of a scan, which must fit where odometry does not lead */
static const cairn_real MOST = CAIRN_REAL(0.5);

static cairn_status begin_search(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_scan_match_part query = cairn_scan_match_part_of(&view);
    cairn_scan_match_window window = {SEARCH_WINDOW + cairn_mapper_way(mapper->motion),
                                      SEARCH_ANGLE};

    if (mapper->searches > 0) {
        window.distance = MAPPER_WIDE_WINDOW + cairn_mapper_way(mapper->motion);
        window.angle = WIDE_ANGLE;
    }
    mapper->state.searched += mapper->searches == 0;
    mapper->searches++;
    mapper->phase = SEARCH;
    if (cairn_scan_match_begin(mapper->search, &query, mapper->predicted, &window, NULL) !=
        CAIRN_OK) {
        mapper->phase = KEEP; /* too far away to be searched for */
        mapper->doubtful = 1;
    }
    return CAIRN_OK;
}

static int32_t search_keys(const cairn_mapper *mapper)
{
    return mapper->local_count < MAPPER_SEARCH_KEYS ? mapper->local_count : MAPPER_SEARCH_KEYS;
}

cairn_status cairn_mapper_search_target(cairn_mapper *mapper, cairn_budget *budget)
{
    cairn_scan_match_part part;
    int32_t key;

    if (mapper->search_count == search_keys(mapper))
        return begin_search(mapper);
    if (mapper->search_count == 0) {
        cairn_mapper_yield_match(mapper);
        cairn_scan_match_clear_target(mapper->search);
    }
    key = mapper->local[mapper->search_count++];
    part = cairn_mapper_key_part(mapper, key, mapper->oriented, mapper->beams);
    budget->left -= 2 + part.count + part.beam_count;
    if (cairn_scan_match_add_target(mapper->search, &part, mapper->key_pose[key], NULL) != CAIRN_OK)
        mapper->search_count = search_keys(mapper); /* full */
    return CAIRN_OK;
}

/* 1 when the scan before told the same of a place. */
static int32_t is_rumoured(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose apart = cairn_pose_between(cairn_pose_compose(mapper->rumour, mapper->motion), pose);

    return mapper->rumour_scan > 0 && mapper->rumour_scan == mapper->state.scans &&
           cairn_mapper_way(apart) <= ALIKE && cairn_abs(apart.theta) <= ALIKE;
}

/* What speaks for a place: the evidence of this scan, and of the one before. */
static cairn_real evidence_of(const cairn_mapper *mapper, const cairn_scan_match_hypothesis *found)
{
    return found->evidence +
           (is_rumoured(mapper, found->target_query) ? mapper->rumour_evidence : 0);
}

/* What speaks against a place far from where odometry leads. Half of it where the scan before
 * was only foretold, and may have been thrown already; and half where that scan told the same: a
 * chance likeness is elsewhere with every scan. */
static cairn_real thrown_cost(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_real cost = THROWN_COST * cairn_mapper_out_of_the_way(mapper, pose, THROWN);

    if (mapper->result.verdict != CAIRN_MAPPER_MATCHED)
        cost /= 2;
    return is_rumoured(mapper, pose) ? cost / 2 : cost;
}

/* 1 when the search has found a place where the scan fits. The farther that is from where
 * odometry leads, the less it may be a chance likeness; in the wide window most of the scan must
 * fit, too. */
static int32_t is_found(const cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    const cairn_scan_match_hypothesis *best = result->hypotheses;

    if (result->count == 0)
        return 0;
    if (!mapper->believed)
        return best->evidence > LOCAL_EVIDENCE;
    if (mapper->searches > 1 && (result->verdict == CAIRN_SCAN_MATCH_NONE || best->fit <= MOST))
        return 0;
    return evidence_of(mapper, best) > LOCAL_EVIDENCE + thrown_cost(mapper, best->target_query);
}

/* The next scan may tell the same. */
static void remember_rumour(cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    const cairn_scan_match_hypothesis *best = result->hypotheses;
    cairn_real evidence;

    if (result->count == 0 || !mapper->believed)
        return;
    evidence = evidence_of(mapper, best);
    if (!(evidence > 0))
        return;
    mapper->rumour_is_new = mapper->rumour_scan != mapper->state.scans;
    mapper->rumour = best->target_query;
    mapper->rumour_evidence = evidence;
    mapper->rumour_scan = mapper->state.scans + 1;
}

/* 1 when it found the match at hand. */
static int32_t confirms(const cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    cairn_pose apart;

    if (!mapper->has_match || result->count == 0)
        return 0;
    apart = cairn_pose_between(mapper->match.target_query, result->hypotheses[0].target_query);
    return cairn_mapper_way(apart) <= 2 * MAPPER_APART &&
           cairn_abs(apart.theta) <= 2 * MAPPER_APART_TURN;
}

/* The search is over: the match runs from what it found, or what there is stays, in doubt. */
static cairn_status end_search(cairn_mapper *mapper)
{
    cairn_scan_match_result result = cairn_scan_match_read(mapper->search);
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, 0);
    cairn_real best = 0;
    int32_t chosen = -1;

    if (!is_found(mapper, &result) && confirms(mapper, &result))
        return cairn_mapper_end_choice(mapper);
    if (!is_found(mapper, &result) && mapper->searches == 1)
        return begin_search(mapper);
    mapper->phase = KEEP;
    mapper->doubtful = 1;
    if (!is_found(mapper, &result)) {
        remember_rumour(mapper, &result);
        return CAIRN_OK;
    }
    for (int32_t i = 0; i < result.count; i++) {
        cairn_pose pose = result.hypotheses[i].target_query;
        cairn_real value =
            cairn_log(result.hypotheses[i].score + CAIRN_REAL(1e-3)) -
            CAIRN_REAL(0.05) * cairn_mapper_out_of_the_way(mapper, pose, MAPPER_STRANGE);

        if (chosen < 0 || value > best) {
            chosen = i;
            best = value;
        }
    }
    /* Between rivals odometry decides. */
    mapper->doubtful =
        cairn_mapper_has_rival(&result) &&
        (!mapper->believed || cairn_mapper_is_far(mapper, result.hypotheses[chosen].target_query));
    mapper->phase = MATCH_FOUND;
    prior.mean = result.hypotheses[chosen].target_query;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count,
                           result.hypotheses[chosen].target_query, &prior, NULL);
}

cairn_status cairn_mapper_search_step(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t quota = mapper->params.search_units - mapper->matched - mapper->spent;
    int32_t most = budget->left < quota ? budget->left : quota;
    cairn_budget share = {most};
    cairn_status status = cairn_scan_match_step(mapper->search, &share);

    budget->left -= most - share.left;
    mapper->spent += most - share.left;
    if (status == CAIRN_OK)
        return end_search(mapper);
    if (status == CAIRN_MORE && mapper->matched + mapper->spent >= mapper->params.search_units) {
        mapper->phase = KEEP;
        mapper->doubtful = 1;
    }
    return status == CAIRN_MORE ? CAIRN_OK : status;
}
