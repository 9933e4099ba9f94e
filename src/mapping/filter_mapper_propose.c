/* What a particle makes of a key scan: where it may be, and how well it fits there.
 *
 * Method. The path is walked back; of the key scans near the expected pose those of the last while
 * are the recent map, the others the old one. The scan is matched against each alone (icp, with the
 * motion as prior): a particle that comes back to a place it knows has two opinions of where it is,
 * and against both maps together the nearer, recent one would always win. From a normal
 * distribution around every match, with its covariance, candidates x are drawn, and each is weighed
 * by
 *
 *     p(z | recent map, x) p(z | old map, x) p(x | motion).
 *
 * Their mean is the weight of the particle, as in Grisetti et al., eq. 18: the candidates stand for
 * the region in which the product has its mass. To divide by the density from which they were drawn
 * would make that an unbiased estimate, but a noisy one: a few draws from narrow distributions then
 * decide which particles live (seen: half of all steps resampled, and not one in ten without). p(z
 * | map, x) is a likelihood field (Thrun, Burgard and Fox 2005, section 6.4) of the distances along
 * the normals of the nearest points: a scan of n points counts as `weight` independent ones. A path
 * whose ends do not meet has its scan on the one map or on the other, never on both.
 *
 * Source: Grisetti, Stachniss and Burgard 2007, section III-B, with the mixture of Adluru 2008,
 * section 9.2.2. */
#include "src/core/build.h"

#include "src/mapping/filter_mapper_work.h"

enum {
    WALKED_PER_UNIT = 8,
    POINTS_PER_UNIT = 2,
    CLEARED_PER_UNIT = 64,
    EMPTIED_PER_UNIT = 4,
    DRAW_COST = 8
};

/* sigmas, to the point of the map that a point is compared with */
static const cairn_real GATE = 3;
/* cosine, and at least so much is the same side of a wall */
static const cairn_real FACING = CAIRN_REAL(0.5);

static int pay(proposing *at, cairn_budget *budget, int32_t cost)
{
    return cairn_budget_pay(budget, &at->paid, cost);
}

/* ---- The local maps ---- */

static void begin(cairn_filter_mapper *m, const path_state *leaf)
{
    proposing *at = &m->at;

    at->ancestor = leaf;
    at->expected = cairn_pose_compose(leaf->map_key, m->motion);
    at->map[RECENT].count = at->map[OLD].count = 0;
    at->place_count = 0;
    at->which = RECENT;
}

/* Takes the points of the particle before out. 1: both grids are empty. */
static int empty_maps(cairn_filter_mapper *m, cairn_budget *budget)
{
    for (int which = 0; which < LOCAL_MAPS; which++) {
        cairn_point_grid *points = m->at.map[which].points;

        while (cairn_point_grid_count(points) > 0) {
            if (!pay(&m->at, budget, 1))
                return 0;
            for (int k = 0; k < EMPTIED_PER_UNIT; k++)
                cairn_point_grid_remove_last(points);
        }
    }
    return 1;
}

/* Puts a key scan among the nearest ones; of equal ones the later goes first. */
static void keep_nearest(local_map *map, int32_t most, local_key key)
{
    int32_t k = map->count;

    if (k == most && !(key.distance < map->list[most - 1].distance))
        return;
    if (k == most)
        k--;
    else
        map->count++;
    for (; k > 0 && key.distance < map->list[k - 1].distance; k--)
        map->list[k] = map->list[k - 1];
    map->list[k] = key;
}

/* Back along the path. 1: it has been walked. */
static int walk_path(cairn_filter_mapper *m, cairn_budget *budget)
{
    const cairn_filter_mapper_params *p = &m->params;
    proposing *at = &m->at;

    while (at->ancestor != NULL) {
        if (!pay(at, budget, 1))
            return 0;
        for (int k = 0; k < WALKED_PER_UNIT && at->ancestor != NULL; k++) {
            const path_state *s = at->ancestor;
            cairn_real x = s->map_key.x - at->expected.x, y = s->map_key.y - at->expected.y;
            local_key key = {s->map_key, x * x + y * y, s->key};

            if (key.distance <= p->local_radius * p->local_radius)
                keep_nearest(&at->map[s->key < m->keys - p->span ? OLD : RECENT], p->local_keys,
                             key);
            at->ancestor = cairn_particle_state_before(s);
        }
    }
    return 1;
}

/* The points of a key scan, in its own frame; returns how many. */
static int32_t read_key(cairn_filter_mapper *m, int32_t key)
{
    const cairn_scan_set *keys = cairn_mapper_keys(m->front);
    const cairn_scan_set_scan *scan = &keys->scans[key];
    int32_t count = 0;

    for (int32_t s = scan->first_segment; s < scan->end_segment; s++)
        for (int32_t p = keys->segments[s].first_point; p < keys->segments[s].end_point; p++) {
            m->oriented[count].position = keys->points[p];
            m->oriented[count].direction = keys->segments[s].direction;
            count++;
        }
    return count;
}

/* One key scan into the target of the match and into the grid. 0: there is no room for it. */
static int add_key(cairn_filter_mapper *m, local_map *map, const local_key *key)
{
    int32_t count = read_key(m, key->key);
    cairn_transform map_key = cairn_transform_of(key->map_key);
    cairn_status status;

    if (count > m->params.max_local_points - cairn_point_grid_count(map->points))
        return 0;
    status = cairn_icp_add_target(m->icp, m->oriented, count, key->map_key, NULL);
    CAIRN_ASSERT(status == CAIRN_OK);
    for (int32_t i = 0; i < count; i++) {
        map->direction[cairn_point_grid_count(map->points)] =
            cairn_transform_direction(map_key, m->oriented[i].direction);
        status = cairn_point_grid_insert(map->points,
                                         cairn_transform_point(map_key, m->oriented[i].position));
        CAIRN_ASSERT(status == CAIRN_OK);
    }
    (void)status;
    return 1;
}

static int32_t points_of(const cairn_filter_mapper *m, int32_t key)
{
    const cairn_scan_set_scan *scan = &cairn_mapper_keys(m->front)->scans[key];

    return scan->end_point - scan->first_point;
}

static int fill_map(cairn_filter_mapper *m, cairn_budget *budget)
{
    proposing *at = &m->at;
    local_map *map = &at->map[at->which];

    for (; at->cursor < map->count; at->cursor++) {
        const local_key *key = &map->list[at->cursor];

        if (!pay(at, budget, 1 + points_of(m, key->key) / POINTS_PER_UNIT))
            return 0;
        if (!add_key(m, map, key))
            at->cursor = map->count - 1;
    }
    return 1;
}

/* ---- The matches ---- */

/* Begins the match against the local map at hand; 0 when that is empty. */
static int begin_match(cairn_filter_mapper *m)
{
    cairn_scan_view view = cairn_mapper_view(m->front);
    cairn_pose_prior prior = {m->at.expected, m->sigma_distance, m->sigma_distance, m->sigma_turn};

    return cairn_icp_begin(m->icp, view.points, view.point_count, m->at.expected, &prior, NULL) ==
           CAIRN_OK;
}

static void add_place(cairn_filter_mapper *m, cairn_pose mean, cairn_sym3 covariance)
{
    place *p = &m->at.place[m->at.place_count++];
    cairn_real variance[3];

    p->mean = mean;
    cairn_sym3_eigen(covariance, variance, p->axis);
    for (int k = 0; k < 3; k++)
        p->sigma[k] = cairn_sqrt(variance[k]);
}

/* A match that counts is a place for candidates. */
static void end_match(cairn_filter_mapper *m)
{
    const cairn_filter_mapper_params *p = &m->params;
    cairn_icp_result match = cairn_icp_read(m->icp);
    const cairn_real *c = match.covariance;
    cairn_sym3 covariance = {c[0] + p->match_sigma * p->match_sigma,
                             c[1],
                             c[2],
                             c[4] + p->match_sigma * p->match_sigma,
                             c[5],
                             c[8] + p->match_sigma_turn * p->match_sigma_turn};

    if (match.verdict == CAIRN_ICP_TOO_FEW_PAIRS || match.overlap < p->min_support)
        return;
    add_place(m, match.target_query, covariance);
    m->returns += m->at.which == OLD;
}

/* ---- The candidates ---- */

/* Without a match there is the motion alone. */
static void end_matches(cairn_filter_mapper *m)
{
    cairn_real distance = m->sigma_distance * m->sigma_distance,
               turn = m->sigma_turn * m->sigma_turn;
    cairn_sym3 motion = {distance, 0, 0, distance, 0, turn};

    if (m->at.place_count == 0)
        add_place(m, m->at.expected, motion);
}

static cairn_pose draw_from(cairn_filter_mapper *m, const place *from)
{
    cairn_real e[3] = {0, 0, 0};
    cairn_pose pose;

    for (int k = 0; k < 3; k++) {
        cairn_real step = from->sigma[k] * cairn_random_normal(&m->random);

        for (int i = 0; i < 3; i++)
            e[i] += step * from->axis[k][i];
    }
    pose.x = from->mean.x + e[0];
    pose.y = from->mean.y + e[1];
    pose.theta = cairn_wrap_angle(from->mean.theta + e[2]);
    return pose;
}

/* Log of the density of a motion, but for what all candidates of all particles share. */
static cairn_real log_motion(const cairn_filter_mapper *m, cairn_pose x)
{
    cairn_pose e = cairn_pose_between(m->at.expected, x);
    cairn_real distance = m->sigma_distance, turn = e.theta / m->sigma_turn;

    return -((e.x * e.x + e.y * e.y) / (distance * distance) + turn * turn) / 2;
}

static int draw_candidates(cairn_filter_mapper *m, cairn_budget *budget)
{
    proposing *at = &m->at;

    for (; at->cursor < m->params.candidates; at->cursor++) {
        path_state *s = &at->candidates[at->cursor];

        if (!pay(at, budget, DRAW_COST))
            return 0;
        s->key = m->keys;
        s->map_key = draw_from(m, &at->place[at->cursor % at->place_count]);
        s->log_weight = log_motion(m, s->map_key);
    }
    return 1;
}

/* ---- Their weights ---- */

/* Of every how many points of the scan one is weighed. */
static int32_t stride_of(const cairn_filter_mapper *m, int32_t count)
{
    return (count + m->params.points - 1) / m->params.points;
}

/* What a point tells against a map, 0 ... outlier. */
static cairn_real point_cost(const cairn_filter_mapper *m, const local_map *map,
                             cairn_transform map_scan, cairn_oriented_point point)
{
    cairn_vec2 p = cairn_transform_point(map_scan, point.position);
    cairn_vec2 direction = cairn_transform_direction(map_scan, point.direction);
    int32_t nearest = cairn_point_grid_nearest(map->points, p, GATE * m->params.sigma, NULL);
    cairn_real across;

    if (nearest < 0 || cairn_vec2_dot(direction, map->direction[nearest]) < FACING)
        return m->params.outlier;
    across = cairn_vec2_cross(map->direction[nearest],
                              cairn_vec2_sub(p, cairn_point_grid_point(map->points, nearest))) /
             m->params.sigma;
    return cairn_min(across * across / 2, m->params.outlier);
}

/* Goes on with the candidate at hand. 1: it is weighed. */
static int weigh_candidate(cairn_filter_mapper *m, cairn_scan_view view, cairn_budget *budget)
{
    proposing *at = &m->at;
    path_state *s = &at->candidates[at->candidate];
    cairn_transform map_scan = cairn_transform_of(s->map_key);
    int32_t stride = stride_of(m, view.point_count),
            weighed = (view.point_count + stride - 1) / stride;

    for (; at->cursor < view.point_count; at->cursor += stride) {
        if (!pay(at, budget, 2 * LOCAL_MAPS))
            return 0;
        for (int which = 0; which < LOCAL_MAPS; which++)
            at->cost += point_cost(m, &at->map[which], map_scan, view.points[at->cursor]);
    }
    s->log_weight -= at->cost * m->params.weight / (cairn_real)weighed;
    at->cursor = 0;
    at->cost = 0;
    return 1;
}

/* 1: all candidates are weighed. */
static int weigh_candidates(cairn_filter_mapper *m, cairn_budget *budget)
{
    cairn_scan_view view = cairn_mapper_view(m->front);

    for (; m->at.candidate < m->params.candidates; m->at.candidate++)
        if (!weigh_candidate(m, view, budget))
            return 0;
    return 1;
}

/* ---- The particle's turn ---- */

static void enter(proposing *at, propose_stage stage)
{
    at->stage = stage;
    at->cursor = 0;
}

/* After the match against one map that against the other; after both the candidates. */
static void next_map(cairn_filter_mapper *m)
{
    if (++m->at.which < LOCAL_MAPS) {
        enter(&m->at, PROPOSE_CLEAR);
        return;
    }
    end_matches(m);
    enter(&m->at, PROPOSE_DRAW);
}

/* One stage. 0: the budget is used up. */
static int advance(cairn_filter_mapper *m, cairn_budget *budget)
{
    proposing *at = &m->at;

    switch (at->stage) {
    case PROPOSE_EMPTY:
        if (!empty_maps(m, budget))
            return 0;
        enter(at, PROPOSE_WALK);
        return 1;
    case PROPOSE_WALK:
        if (!walk_path(m, budget))
            return 0;
        enter(at, PROPOSE_CLEAR);
        return 1;
    case PROPOSE_CLEAR:
        if (!pay(at, budget, 1 + m->params.max_local_points / CLEARED_PER_UNIT))
            return 0;
        cairn_icp_clear_target(m->icp);
        enter(at, PROPOSE_FILL);
        return 1;
    case PROPOSE_FILL:
        if (!fill_map(m, budget))
            return 0;
        if (begin_match(m))
            enter(at, PROPOSE_MATCH);
        else
            next_map(m);
        return 1;
    case PROPOSE_MATCH:
        if (cairn_icp_step(m->icp, budget) == CAIRN_MORE)
            return 0;
        end_match(m);
        next_map(m);
        return 1;
    case PROPOSE_DRAW:
        if (!draw_candidates(m, budget))
            return 0;
        enter(at, PROPOSE_WEIGH);
        at->candidate = 0;
        at->cost = 0;
        return 1;
    default:
        if (!weigh_candidates(m, budget))
            return 0;
        enter(at, PROPOSE_OFFER);
        return 1;
    }
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_filter_mapper *m = context;

    if (m->at.stage == PROPOSE_BEGIN) {
        begin(m, cairn_particle_filter_particle(filter, index).state);
        enter(&m->at, PROPOSE_EMPTY);
    }
    while (m->at.stage != PROPOSE_OFFER)
        if (!advance(m, budget))
            return CAIRN_MORE;
    for (int32_t k = 0; k < m->params.candidates; k++) {
        cairn_status status = cairn_particle_filter_offer(filter, &m->at.candidates[k], 0);

        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    m->at.stage = PROPOSE_BEGIN;
    return CAIRN_OK;
}

/* Weighed when they were drawn: the local maps are those of one particle at a time. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const path_state *s = state;

    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = s->log_weight;
    return CAIRN_OK;
}

cairn_particle_model cairn_filter_mapper_model(cairn_filter_mapper *mapper)
{
    cairn_particle_model model = {mapper, propose, likelihood, NULL, NULL};

    return model;
}
