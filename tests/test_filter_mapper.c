/* The mapper by particles compared with a reference implementation; refusals, budgets, drives with
 * loops. */
#include "cairn/filter_mapper.h"
#include "src/maps/filter_mapper_work.h"
#include "tests/drive.h"

#include <math.h>

enum { KEYS_MOST = 200, CANDIDATES = 4, MOST_PARTICLES = 10, REFERENCE_POINTS = 4000 };

static cairn_filter_mapper_params filter_params(int32_t particles)
{
    cairn_filter_mapper_params params = cairn_filter_mapper_default();

    params.front = small_params();
    params.particles = particles;
    params.candidates = CANDIDATES;
    return params;
}

static cairn_filter_mapper *new_filter_mapper(cairn_pool *pool,
                                              const cairn_filter_mapper_params *params)
{
    cairn_filter_mapper *mapper;

    *pool = test_pool(cairn_filter_mapper_memory(params));
    assert_ok(cairn_filter_mapper_create(&mapper, pool, params));
    return mapper;
}

static void feed(cairn_filter_mapper *mapper, const sim_scan *scan, int32_t with_odometry,
                 int32_t budget)
{
    cairn_scan_input input = sim_scan_input(scan);
    cairn_pose odometry = pose_of(scan->odometry);
    cairn_status status;

    assert_taken(cairn_filter_mapper_add(mapper, &input, with_odometry ? &odometry : NULL, NULL));
    do {
        cairn_budget left = {budget};

        status = cairn_filter_mapper_step(mapper, &left);
    } while (status == CAIRN_MORE);
    assert_ok(status);
}

static uint64_t hash_of(const cairn_filter_mapper *mapper)
{
    static cairn_pose path[KEYS_MOST];
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < cairn_filter_mapper_count(mapper); i++) {
        int32_t keys = cairn_filter_mapper_path(mapper, i, path, KEYS_MOST);

        hash = test_hash(hash, path, (size_t)keys * sizeof *path);
    }
    return hash;
}

/* ---- Reference implementation: a path in an array for every particle, sorted; all points ---- */

typedef struct reference_state {
    cairn_pose path[KEYS_MOST];
    double drift[KEYS_MOST][3][3];
    cairn_pose expected; /* of the last keyframe */
    double relative[3][3];
    cairn_real log_weight;
    int32_t keys, revisited;
} reference_state;

typedef struct reference_near {
    cairn_real distance;
    int32_t key;
} reference_near;

typedef struct reference_map {
    cairn_vec2 point[REFERENCE_POINTS], direction[REFERENCE_POINTS];
    int32_t count;
} reference_map;

typedef struct reference {
    cairn_filter_mapper_params params;
    cairn_pool pool;
    cairn_mapper *front;
    cairn_particle_filter *filter;
    cairn_icp *icp;
    cairn_random random;
    reference_map map;
    cairn_pose motion;
    double noise[3][3]; /* of the motion, along the axes of the keyframe */
    int64_t returns;
} reference;

static reference t;

static int compare_near(const void *a, const void *b)
{
    const reference_near *x = a, *y = b;

    if (x->distance != y->distance)
        return x->distance < y->distance ? -1 : 1;
    return x->key < y->key ? 1 : -1; /* the later first */
}

static int32_t key_points(int32_t key, cairn_oriented_point *points)
{
    const cairn_scan_set *keys = cairn_mapper_keyframes(t.front);
    int32_t count = 0;

    for (int32_t s = 0; s < keys->segment_count; s++)
        for (int32_t p = keys->segments[s].first_point;
             keys->segments[s].scan == key && p < keys->segments[s].end_point; p++) {
            points[count].position = keys->points[p];
            points[count++].direction = keys->segments[s].direction;
        }
    return count;
}

/* Fills match and map with the nearby keyframes among 0 ... end - 1 of the path. Returns the nearest
 * one; -1: none. */
static int32_t reference_fill(const reference_state *s, cairn_pose expected, int32_t end)
{
    static cairn_oriented_point points[REFERENCE_POINTS];
    reference_map *map = &t.map;
    reference_near near[KEYS_MOST];
    int32_t count = 0;

    map->count = 0;
    cairn_icp_clear_target(t.icp);
    for (int32_t key = 0; key < end; key++) {
        cairn_real x = s->path[key].x - expected.x, y = s->path[key].y - expected.y;

        near[count].key = key;
        near[count].distance = x * x + y * y;
        count += near[count].distance <= t.params.local_radius * t.params.local_radius;
    }
    qsort(near, (size_t)count, sizeof *near, compare_near);
    for (int32_t k = 0; k < count && k < t.params.local_keyframes; k++) {
        cairn_transform map_key = cairn_transform_of(s->path[near[k].key]);
        int32_t n = key_points(near[k].key, points);

        if (map->count + n > t.params.max_local_points)
            break;
        assert_ok(cairn_icp_add_target(t.icp, points, n, s->path[near[k].key], NULL));
        for (int32_t i = 0; i < n; i++, map->count++) {
            map->point[map->count] = cairn_transform_point(map_key, points[i].position);
            map->direction[map->count] = cairn_transform_direction(map_key, points[i].direction);
        }
    }
    return count > 0 ? near[0].key : -1;
}

static cairn_real reference_gain(const reference_map *map, cairn_vec2 p, cairn_vec2 direction)
{
    cairn_real best = 3 * t.params.sigma * (3 * t.params.sigma), across;
    int32_t nearest = -1;

    for (int32_t i = 0; i < map->count; i++) {
        cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(map->point[i], p));

        if (d < best || (d == best && nearest < 0)) {
            best = d;
            nearest = i;
        }
    }
    if (nearest < 0 || cairn_vec2_dot(direction, map->direction[nearest]) < CAIRN_REAL(0.5))
        return 0;
    across = cairn_vec2_cross(map->direction[nearest], cairn_vec2_sub(p, map->point[nearest])) /
             t.params.sigma;
    return cairn_max(t.params.max_point_cost - across * across / 2, 0);
}

/* product = a b a^T */
static void congruence(double a[3][3], double b[3][3], double product[3][3])
{
    double sum[3][3];

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            sum[i][j] = 0;
            for (int k = 0; k < 3; k++)
                for (int l = 0; l < 3; l++)
                    sum[i][j] += a[i][k] * b[k][l] * a[j][l];
        }
    memcpy(product, sum, sizeof sum);
}

/* Covariance c of a pose after a rigid motion of its body between two poses. */
static void carry(double c[3][3], cairn_pose from, cairn_pose to, double carried[3][3])
{
    double a[3][3] = {{1, 0, -(double)(to.y - from.y)}, {0, 1, (double)(to.x - from.x)}, {0, 0, 1}};

    congruence(a, c, carried);
}

static void rotate(double c[3][3], double angle, double rotated[3][3])
{
    double a[3][3] = {{cos(angle), -sin(angle), 0}, {sin(angle), cos(angle), 0}, {0, 0, 1}};

    congruence(a, c, rotated);
}

static cairn_sym3 sym3_of(double c[3][3])
{
    cairn_sym3 m = {(cairn_real)c[0][0], (cairn_real)c[0][1], (cairn_real)c[0][2],
                    (cairn_real)c[1][1], (cairn_real)c[1][2], (cairn_real)c[2][2]};

    return m;
}

/* Solves m x = b by Cramer's rule; returns the determinant. */
static double solve(double m[3][3], const double b[3], double x[3])
{
    double inverse[3][3], det = 0;

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int r = (j + 1) % 3, s = (j + 2) % 3, u = (i + 1) % 3, v = (i + 2) % 3;

            inverse[i][j] = m[r][u] * m[s][v] - m[r][v] * m[s][u];
        }
    for (int i = 0; i < 3; i++)
        det += m[i][0] * inverse[0][i];
    for (int i = 0; i < 3; i++) {
        x[i] = 0;
        for (int j = 0; j < 3; j++)
            x[i] += inverse[i][j] / det * b[j];
    }
    return det;
}

static void displace(cairn_pose from, cairn_pose to, double e[3])
{
    e[0] = (double)(to.x - from.x);
    e[1] = (double)(to.y - from.y);
    e[2] = (double)cairn_wrap_angle(to.theta - from.theta);
}

typedef struct reference_place {
    cairn_pose mean;
    cairn_real sigma[3], axis[3][3], overlap;
} reference_place;

/* Keeps the three matches of the largest overlaps, the first of equal ones first; returns their
 * number. The motion (overlap 0) is added to them. */
static int32_t add_place(reference_place *places, int32_t count, cairn_pose mean, cairn_sym3 c,
                         cairn_real overlap)
{
    reference_place place = {.mean = mean, .overlap = overlap};
    cairn_real variance[3];
    int32_t at = count;

    c.xx += t.params.match_sigma * t.params.match_sigma;
    c.yy += t.params.match_sigma * t.params.match_sigma;
    c.zz += t.params.match_sigma_theta * t.params.match_sigma_theta;
    cairn_sym3_eigen(c, variance, place.axis);
    for (int k = 0; k < 3; k++)
        place.sigma[k] = cairn_sqrt(variance[k]);
    while (at > 0 && places[at - 1].overlap < overlap)
        at--;
    if (at == 3 && overlap > 0)
        return count;
    memmove(&places[at + 1], &places[at], (size_t)(count - at) * sizeof *places);
    places[at] = place;
    return count < 3 || overlap <= 0 ? count + 1 : 3;
}

/* Matches from starts along the longest axis of the relative covariance. */
static int32_t reference_matches(const reference_state *s, reference_place *places)
{
    cairn_scan_view view = cairn_mapper_view(t.front);
    cairn_real variance[3], axis[3][3];
    double along[3][3];
    cairn_rigid_motion_pose_prior prior = {.mean = s->expected};
    cairn_sym3 relative = sym3_of((double(*)[3])s->relative);
    int32_t side, count = 0;

    rotate((double(*)[3])s->relative, -(double)s->expected.theta, along);
    prior.sigma_x = (cairn_real)sqrt(along[0][0]);
    prior.sigma_y = (cairn_real)sqrt(along[1][1]);
    prior.sigma_theta = (cairn_real)sqrt(along[2][2]);
    cairn_sym3_eigen(relative, variance, axis);
    side = (int32_t)fmin(7, floor(2 * sqrt((double)variance[2]) / 0.4));
    for (int32_t k = -side; k <= side; k++) {
        cairn_real step = CAIRN_REAL(0.4) * (cairn_real)k;
        cairn_pose start = {s->expected.x + step * axis[2][0], s->expected.y + step * axis[2][1],
                            cairn_wrap_angle(s->expected.theta + step * axis[2][2])};
        cairn_budget unbounded = {CAIRN_UNBOUNDED};
        cairn_icp_result match;
        int known = 0;

        assert_ok(cairn_icp_begin(t.icp, view.points, view.point_count, start, &prior, NULL));
        assert_ok(cairn_icp_step(t.icp, &unbounded));
        match = cairn_icp_read(t.icp);
        for (int32_t i = 0; i < count; i++) {
            cairn_pose e = cairn_pose_between(places[i].mean, match.target_query);

            known |= hypot((double)e.x, (double)e.y) < 0.05 && fabs((double)e.theta) < 0.02;
        }
        if (known || match.verdict == CAIRN_ICP_TOO_FEW_PAIRS || match.observable_dof < 3 ||
            match.overlap < t.params.min_overlap)
            continue;
        count = add_place(places, count, match.target_query, cairn_sym3_of_full(match.covariance),
                          match.overlap);
    }
    t.returns += count;
    return count;
}

static void draw_pose(reference_state *s, const reference_place *from)
{
    cairn_real e[3] = {0, 0, 0};
    cairn_pose *pose = &s->path[s->keys - 1];

    for (int a = 0; a < 3; a++) {
        cairn_real step = from->sigma[a] * cairn_random_normal(&t.random);

        for (int i = 0; i < 3; i++)
            e[i] += step * from->axis[a][i];
    }
    pose->x = from->mean.x + e[0];
    pose->y = from->mean.y + e[1];
    pose->theta = cairn_wrap_angle(from->mean.theta + e[2]);
    carry(s->drift[s->keys - 1], s->expected, *pose, s->drift[s->keys - 1]);
}

static cairn_real reference_weight(const reference_state *s, const reference_place *place)
{
    const cairn_filter_mapper_params *p = &t.params;
    cairn_scan_view view = cairn_mapper_view(t.front);
    cairn_pose x = s->path[s->keys - 1];
    cairn_transform map_scan = cairn_transform_of(x);
    int32_t every = (int32_t)ceil((double)view.point_count / p->scored_points), weighed = 0;
    double gain = 0, e[3], solved[3], det;

    for (int32_t i = 0; i < view.point_count; i += every, weighed++)
        gain +=
            (double)reference_gain(&t.map, cairn_transform_point(map_scan, view.points[i].position),
                                   cairn_transform_direction(map_scan, view.points[i].direction));
    gain *= (double)p->independent_points / weighed;
    if (s->revisited < 0)
        return (cairn_real)gain;
    displace(s->expected, x, e);
    det = solve((double(*)[3])s->relative, e, solved);
    for (int k = 0; k < 3; k++)
        gain -= e[k] * solved[k] / 2;
    return gain + log((double)(place->sigma[0] * place->sigma[1] * place->sigma[2])) < log(det) / 2
               ? -CAIRN_REAL_MAX
               : (cairn_real)gain;
}

static cairn_status reference_propose(void *context, cairn_particle_filter *filter, int32_t index,
                                      cairn_budget *budget)
{
    static reference_state s, drawn;
    int32_t last, recent, count = 0, nearest;
    reference_place places[4];
    double noise[3][3], c[3][3];
    reference_state *kept = calloc(CANDIDATES, sizeof *kept);

    (void)context;
    s = *(const reference_state *)cairn_particle_filter_particle(filter, index).state;
    last = s.keys++;
    s.expected = cairn_pose_compose(s.path[last - 1], t.motion);
    carry(s.drift[last - 1], s.path[last - 1], s.expected, s.drift[last]);
    rotate(t.noise, (double)s.expected.theta, noise);
    for (int i = 0; i < 9; i++)
        s.drift[last][i / 3][i % 3] += noise[i / 3][i % 3];
    recent = last > t.params.recent_keyframes ? last - t.params.recent_keyframes : 0;
    nearest = reference_fill(&s, s.expected, recent);
    if (nearest >= 0) {
        carry(s.drift[nearest], s.path[nearest], s.expected, c);
        for (int i = 0; i < 9; i++)
            s.relative[i / 3][i % 3] = s.drift[last][i / 3][i % 3] - c[i / 3][i % 3];
    }
    if (t.map.count > 0)
        count = reference_matches(&s, places);
    count = add_place(places, count, s.expected, cairn_sym3_zero(), 0);
    for (int32_t k = 0; k < CANDIDATES; k++) {
        drawn = s;
        draw_pose(&drawn, &places[k % count]);
        drawn.revisited = places[k % count].overlap > 0 ? nearest : -1;
        drawn.log_weight = 0;
        kept[k] = drawn;
    }
    for (int32_t k = 0; k < CANDIDATES; k++) {
        if (nearest >= 0)
            kept[k].log_weight = reference_weight(&kept[k], &places[k % count]);
        assert_ok(cairn_particle_filter_offer(filter, &kept[k], 0));
    }
    free(kept);
    budget->left--;
    return CAIRN_OK;
}

/* Distributes the error of a closed loop along the path. */
static void reference_correct(reference_state *s)
{
    int32_t last = s->keys - 1, k = s->revisited;
    double e[3], force[3], c[3][3];
    cairn_pose closed = s->path[last];

    displace(s->expected, closed, e);
    (void)solve(s->relative, e, force);
    for (int32_t j = k + 1; j < last; j++) {
        cairn_pose *pose = &s->path[j];
        double moved[3] = {0, 0, 0}, at[3] = {force[0], force[1], force[2]};

        at[2] += (double)(s->expected.x - pose->x) * force[1] -
                 (double)(s->expected.y - pose->y) * force[0];
        carry(s->drift[k], s->path[k], *pose, c);
        if (s->drift[j][2][2] <= s->drift[k][2][2])
            continue;
        for (int i = 0; i < 9; i++)
            moved[i / 3] += (s->drift[j][i / 3][i % 3] - c[i / 3][i % 3]) * at[i % 3];
        pose->x += (cairn_real)moved[0];
        pose->y += (cairn_real)moved[1];
        pose->theta = cairn_wrap_angle(pose->theta + (cairn_real)moved[2]);
        carry(s->drift[k], s->path[k], *pose, s->drift[j]);
    }
    carry(s->drift[k], s->path[k], closed, s->drift[last]);
}

static cairn_status reference_likelihood(void *context, const cairn_particle_filter *filter,
                                         int32_t index, const void *state,
                                         cairn_real *log_likelihood, cairn_budget *budget)
{
    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = ((const reference_state *)state)->log_weight;
    return CAIRN_OK;
}

static void new_reference(const cairn_filter_mapper_params *params)
{
    cairn_particle_filter_params filter = cairn_particle_filter_default();
    cairn_particle_filter_model model = {NULL, reference_propose, reference_likelihood, NULL, NULL};
    cairn_mapper_params front = params->front;
    cairn_icp_params icp = front.icp;

    t.params = *params;
    t.returns = 0;
    front.window = 0;
    front.loop.max_loops = 0;
    icp.max_target = params->max_local_points;
    filter.particles = filter.max_particles = params->particles;
    filter.max_followers = 1;
    filter.adaptive_followers = 0;
    filter.state_bytes = sizeof(reference_state);
    filter.max_blocks = params->particles * KEYS_MOST;
    t.pool = test_pool(cairn_mapper_memory(&front) + cairn_icp_memory(&icp) +
                       cairn_particle_filter_memory(&filter));
    assert_ok(cairn_mapper_create(&t.front, &t.pool, &front));
    assert_ok(cairn_icp_create(&t.icp, &t.pool, &icp));
    assert_ok(cairn_particle_filter_create(&t.filter, &t.pool, &filter, &model));
    assert_ok(cairn_particle_filter_clear(t.filter, params->seed));
    t.random = cairn_random_seed(params->seed, 1);
}

static void feed_reference(const sim_scan *scan, int32_t with_odometry)
{
    const cairn_filter_mapper_params *p = &t.params;
    cairn_budget unbounded = {CAIRN_UNBOUNDED};
    cairn_scan_input input = sim_scan_input(scan);
    cairn_pose odometry = pose_of(scan->odometry);
    cairn_mapper_result result;
    double way, turn, wide, turned;

    assert_taken(cairn_mapper_add(t.front, &input, with_odometry ? &odometry : NULL, NULL));
    assert_ok(cairn_mapper_step(t.front, &unbounded));
    result = cairn_mapper_read(t.front);
    if (!result.is_keyframe)
        return;
    if (result.keyframe == 0) {
        static reference_state first = {.keys = 1, .revisited = -1};

        first.path[0] = cairn_mapper_keyframe_pose(t.front, 0);
        for (int32_t i = 0; i < p->particles; i++)
            assert_ok(cairn_particle_filter_start(t.filter, &first, 0));
        return;
    }
    t.motion = cairn_pose_between(cairn_mapper_keyframe_pose(t.front, result.keyframe - 1),
                                  result.map_scan);
    way = hypot((double)t.motion.x, (double)t.motion.y);
    turn = fabs((double)t.motion.theta);
    wide = (double)p->motion_distance_min + (double)p->motion_distance * way;
    turned = (double)p->motion_turn_min + (double)p->motion_turn * turn;
    if (result.verdict != CAIRN_MAPPER_MATCHED) {
        wide += (double)p->front.motion_distance_min + (double)p->front.motion_distance * way;
        turned += (double)p->front.motion_turn_min + (double)p->front.motion_turn * turn;
    }
    for (int i = 0; i < 9; i++)
        t.noise[i / 3][i % 3] = (double)result.covariance[i];
    rotate(t.noise, -(double)result.map_scan.theta, t.noise);
    t.noise[0][0] += wide * wide;
    t.noise[1][1] += wide * wide;
    t.noise[2][2] += turned * turned;
    assert_ok(cairn_particle_filter_begin(t.filter));
    unbounded.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_particle_filter_step(t.filter, &unbounded));
    for (int32_t i = 0; i < cairn_particle_filter_count(t.filter); i++) {
        const reference_state *last = cairn_particle_filter_particle(t.filter, i).state;

        if (last->revisited >= 0)
            reference_correct(cairn_particle_filter_own_state(t.filter, i, NULL));
    }
}

/* The two differ by rounding only; in float the differences grow, and after some keyframes other
 * particles are drawn. */
static void compare_with_reference(const cairn_filter_mapper *mapper, int32_t key_count)
{
    static cairn_pose path[KEYS_MOST];

    assert_int_equal(cairn_filter_mapper_count(mapper), cairn_particle_filter_count(t.filter));
    for (int32_t i = 0; i < cairn_filter_mapper_count(mapper); i++) {
        const reference_state *s = cairn_particle_filter_particle(t.filter, i).state;

        assert_int_equal(cairn_filter_mapper_path(mapper, i, path, KEYS_MOST), key_count);
        assert_int_equal(s->keys, key_count);
        for (int32_t k = 0; k < key_count; k++) {
            assert_near(path[k].x, s->path[k].x, NUMBER(1e-7, 1e-3));
            assert_near(path[k].y, s->path[k].y, NUMBER(1e-7, 1e-3));
            assert_near(cairn_wrap_angle(path[k].theta - s->path[k].theta), 0, NUMBER(1e-7, 1e-3));
        }
        assert_near(cairn_filter_mapper_last(mapper, i).x, path[key_count - 1].x, 0);
    }
}

/* Returns the number of keyframes of all paths, those that particles share counted once. */
static int32_t distinct_keyframes(const cairn_filter_mapper *mapper)
{
    static cairn_pose path[MOST_PARTICLES][KEYS_MOST];
    int32_t particles = cairn_filter_mapper_count(mapper), keys = 0, distinct = 0;

    assert_true(particles <= MOST_PARTICLES);
    for (int32_t i = 0; i < particles; i++)
        keys = cairn_filter_mapper_path(mapper, i, path[i], KEYS_MOST);
    for (int32_t k = 0; k < keys; k++)
        for (int32_t i = 0; i < particles; i++) {
            int32_t first = 0;

            while (memcmp(path[first], path[i], (size_t)(k + 1) * sizeof **path) != 0)
                first++;
            distinct += first == i;
        }
    return distinct;
}

static void along_reference(const cairn_filter_mapper_params *params, sim_scene scene,
                            int32_t scans, int32_t with_odometry)
{
    drive d = start_drive(scene, 3, scans, 0.02, 0.3);
    cairn_filter_mapper *mapper;
    cairn_filter_mapper_state state;
    cairn_pool pool;
    int32_t most = NUMBER(scans, 12);
    double best = -HUGE_VAL;

    new_reference(params);
    mapper = new_filter_mapper(&pool, params);
    for (int32_t i = 0; i < most; i++) {
        feed(mapper, &d.scans[i], with_odometry, 1000);
        feed_reference(&d.scans[i], with_odometry);
        compare_with_reference(mapper, cairn_mapper_read(t.front).keyframe + 1);
    }
    state = cairn_filter_mapper_measure(mapper);
    assert_int_equal(state.revisit_matches, t.returns);
    assert_int_equal(state.keyframes, cairn_mapper_read(t.front).keyframe + 1);
    assert_int_equal(state.resamplings, cairn_particle_filter_read(t.filter).resamplings);
    assert_near(state.n_eff, cairn_particle_filter_read(t.filter).n_eff, NUMBER(1e-5, 0.1));
    assert_true(state.nodes >= distinct_keyframes(mapper));
    if (state.resamplings == 0)
        assert_int_equal(state.nodes, params->particles * state.keyframes);
    else
        assert_true(state.nodes < params->particles * state.keyframes);
    assert_true(state.nodes_peak >= state.nodes);
    for (int32_t i = 0; i < cairn_filter_mapper_count(mapper); i++)
        best = fmax(best, (double)cairn_particle_filter_particle(t.filter, i).log_likelihood);
    assert_near(
        cairn_particle_filter_particle(t.filter, cairn_filter_mapper_best(mapper)).log_likelihood,
        best, NUMBER(1e-4, 1));
    test_pool_free(&pool);
    test_pool_free(&t.pool);
    end_drive(&d);
}

static void agrees_with_reference(void **state)
{
    cairn_filter_mapper_params params = filter_params(4);

    (void)state;
    params.recent_keyframes = 6;
    params.local_keyframes = 5;
    along_reference(&params, SIM_APARTMENT, 60, 1);
}

/* Capacities so small that the farthest keyframes are left out, uninformative scans that match
 * nothing, no odometry, another seed. */
static void agrees_with_reference_when_capacities_are_short(void **state)
{
    cairn_filter_mapper_params params = filter_params(3);

    (void)state;
    params.recent_keyframes = 4;
    params.max_local_points = 450;
    params.scored_points = 1000; /* all */
    params.seed = 7;
    params.min_overlap = CAIRN_REAL(0.9);
    params.local_radius = 2;
    along_reference(&params, SIM_RESCUE, 40, 0);
    params.min_overlap = CAIRN_REAL(0.3);
    params.max_local_points = 260;
    along_reference(&params, SIM_RESCUE, 40, 1);
    params.max_local_points = 190;
    along_reference(&params, SIM_APARTMENT, 40, 1);
}

/* ---- Refusals ---- */

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_filter_mapper *mapper;

    return cairn_filter_mapper_create(&mapper, pool, context);
}

static void takes_just_its_memory(void **state)
{
    cairn_filter_mapper_params params = filter_params(2);

    (void)state;
    params.front.max_keyframes = 4;
    params.front.max_keyframe_points = 500;
    params.front.max_keyframe_segments = 100;
    params.front.search = 0;
    params.max_local_points = 64;
    for (int32_t shape = 0; shape < 2; shape++) {
        params.shape_prior = shape;
        test_every_pool_size(create, &params, cairn_filter_mapper_memory(&params));
    }
}

/* The shape prior takes a search by shape with one hypothesis, without dense points and views. */
static void memory_of_the_shape_prior(void **state)
{
    cairn_filter_mapper_params params = filter_params(2);
    cairn_scan_match_params shape = cairn_scan_match_default();
    size_t without = cairn_filter_mapper_memory(&params);

    (void)state;
    shape.mode = CAIRN_SCAN_MATCH_SHAPE;
    shape.max_target = shape.max_query = params.front.scan.max_points;
    shape.max_dense = shape.max_views = 0;
    shape.max_hypotheses = 1;
    shape.spacing = params.front.scan.spacing;
    params.shape_prior = 1;
    assert_int_equal(cairn_filter_mapper_memory(&params),
                     without + cairn_scan_match_memory(&shape));
}

static void assert_refused(const cairn_filter_mapper_params *params)
{
    cairn_filter_mapper *mapper = NULL;
    cairn_pool pool = test_pool(4096);

    assert_int_equal(cairn_filter_mapper_memory(params), 0);
    assert_status(cairn_filter_mapper_create(&mapper, &pool, params), CAIRN_BAD_ARGUMENT);
    assert_null(mapper);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

#define REFUSED(field, value)                                                                      \
    do {                                                                                           \
        cairn_filter_mapper_params params = filter_params(2);                                      \
        params.field = (value);                                                                    \
        assert_refused(&params);                                                                   \
    } while (0)

#define TAKEN(field, value)                                                                        \
    do {                                                                                           \
        cairn_filter_mapper_params params = filter_params(2);                                      \
        params.field = (value);                                                                    \
        assert_true(cairn_filter_mapper_memory(&params) > 0);                                      \
    } while (0)

/* Rules between parameters; tests/test_object.c has the ranges. */
static void refuses_bad_params(void **state)
{
    cairn_filter_mapper *mapper;
    cairn_filter_mapper_params good = filter_params(2);
    cairn_pool pool = test_pool(4096);

    (void)state;
    REFUSED(front.max_keyframes, 0);
    REFUSED(front.keyframe_angle, -1);
    REFUSED(front.icp.min_pairs, 0);
    TAKEN(particles, 1);
    TAKEN(particles, 4096);
    REFUSED(candidates, 3);
    TAKEN(candidates, 4);
    TAKEN(candidates, CAIRN_FILTER_MAPPER_MAX_CANDIDATES);
    TAKEN(scored_points, 1);
    TAKEN(local_keyframes, 1);
    TAKEN(local_keyframes, CAIRN_FILTER_MAPPER_MAX_LOCAL_KEYFRAMES);
    TAKEN(max_local_points, 1);
    TAKEN(max_local_points, 1 << 20);
    TAKEN(recent_keyframes, 1);
    TAKEN(motion_distance, 0);
    TAKEN(motion_turn, 0);
    TAKEN(min_overlap, 0);
    TAKEN(min_overlap, 1);
    TAKEN(shape_prior, 1);
    REFUSED(shape_prior, 2);
    /* Parameters that the front-end mapper does not use are not checked. */
    TAKEN(front.window, 1);
    TAKEN(front.loop.max_loops, -1);
    /* 2^28 nodes at most. */
    good.particles = 4096;
    good.front.max_keyframes = 1 << 16;
    assert_true(cairn_filter_mapper_memory(&good) > 0);
    good.front.max_keyframes++;
    assert_refused(&good);
    assert_refused(NULL);
    good = filter_params(2);
    assert_status(cairn_filter_mapper_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_filter_mapper_create(&mapper, NULL, &good), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

/* The fault names the field and the range of the nested object. */
static void names_bad_params_of_nested_objects(void **state)
{
    cairn_filter_mapper_params params = filter_params(2);
    cairn_object_fault fault = {.module = NULL};

    (void)state;
    params.front.icp.max_iterations = 0;
    assert_status(cairn_filter_mapper_check(&params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.module, "icp");
    assert_non_null(fault.field);
    assert_string_equal(fault.field, "max_iterations");
    assert_true(fault.value == 0 && fault.lowest == 1);
    /* The largest numbers of particles and candidates fit the filter. */
    params = filter_params(2);
    params.particles = 4096;
    params.candidates = CAIRN_FILTER_MAPPER_MAX_CANDIDATES;
    params.front.max_keyframes = 1 << 16;
    assert_ok(cairn_filter_mapper_check(&params, NULL));
    assert_true(cairn_filter_mapper_memory(&params) > 0);
}

static void refuses_bad_calls(void **state)
{
    cairn_filter_mapper_params params = filter_params(3);
    drive d = start_drive(SIM_APARTMENT, 1, 8, 0, 0.6);
    cairn_pool pool;
    cairn_filter_mapper *mapper = new_filter_mapper(&pool, &params);
    cairn_scan_input input = sim_scan_input(&d.scans[0]), bad = input;
    cairn_pose not_finite = {(cairn_real)NAN, 0, 0}, path[2] = {{9, 9, 0}, {9, 9, 0}};
    cairn_budget budget = {0};
    cairn_fault fault;

    (void)state;
    assert_int_equal(cairn_filter_mapper_count(mapper), 0);
    assert_int_equal(cairn_filter_mapper_best(mapper), -1);
    assert_near(cairn_filter_mapper_last(mapper, 0).theta, 0, 0);
    assert_int_equal(cairn_filter_mapper_path(mapper, 0, path, 2), 0);
    assert_int_equal(cairn_filter_mapper_measure(mapper).keyframes, 0);

    budget.left = 10;
    assert_ok(cairn_filter_mapper_step(mapper, &budget)); /* nothing to do */
    assert_int_equal(budget.left, 10);
    bad.count = 0;
    assert_fault(&fault, cairn_filter_mapper_add(mapper, &bad, NULL, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_status(cairn_filter_mapper_add(mapper, &input, &not_finite, NULL), CAIRN_NOT_FINITE);
    assert_status(cairn_filter_mapper_add(NULL, &input, NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_filter_mapper_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_filter_mapper_step(mapper, NULL), CAIRN_BAD_ARGUMENT);

    assert_taken(cairn_filter_mapper_add(mapper, &input, NULL, NULL));
    assert_status(cairn_filter_mapper_add(mapper, &input, NULL, NULL), CAIRN_BUSY);
    budget.left = 0;
    assert_status(cairn_filter_mapper_step(mapper, &budget), CAIRN_MORE);
    assert_status(cairn_filter_mapper_add(mapper, &input, NULL, NULL), CAIRN_BUSY);
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_filter_mapper_step(mapper, &budget));
    assert_int_equal(cairn_filter_mapper_measure(mapper).keyframes, 1);
    assert_int_equal(cairn_filter_mapper_measure(mapper).units, CAIRN_UNBOUNDED - budget.left);
    assert_int_equal(cairn_filter_mapper_count(mapper), 3);
    assert_int_equal(cairn_filter_mapper_best(mapper), 0);
    /* While particles are processed no scan is accepted either. */
    for (int32_t i = 1; i < 8; i++) {
        cairn_scan_input next = sim_scan_input(&d.scans[i]);

        assert_taken(cairn_filter_mapper_add(mapper, &next, NULL, NULL));
        do {
            budget.left = 1;
            assert_status(cairn_filter_mapper_add(mapper, &next, NULL, NULL), CAIRN_BUSY);
        } while (cairn_filter_mapper_step(mapper, &budget) == CAIRN_MORE);
    }
    assert_true(cairn_filter_mapper_measure(mapper).keyframes > 1);
    assert_int_equal(cairn_filter_mapper_path(mapper, -1, path, 2), 0);
    assert_int_equal(cairn_filter_mapper_path(mapper, 3, path, 2), 0);
    assert_near(path[0].x, 9, 0);
    assert_int_equal(cairn_filter_mapper_path(mapper, 2, path, 1), 1);
    assert_near(path[0].x, 0, 0);
    assert_near(path[1].x, 9, 0);
    test_pool_free(&pool);
    end_drive(&d);
}

static void says_when_it_is_full(void **state)
{
    cairn_filter_mapper_params params = filter_params(2);
    drive d = start_drive(SIM_APARTMENT, 1, 8, 0, 0.6);
    cairn_status status = CAIRN_OK;
    cairn_filter_mapper *mapper;
    cairn_pool pool;
    int32_t i;

    (void)state;
    params.front.max_keyframes = 3;
    mapper = new_filter_mapper(&pool, &params);
    for (i = 0; i < 8 && status == CAIRN_OK; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_budget budget = {CAIRN_UNBOUNDED};

        assert_taken(cairn_filter_mapper_add(mapper, &input, NULL, NULL));
        status = cairn_filter_mapper_step(mapper, &budget);
    }
    assert_status(status, CAIRN_FULL);
    assert_int_equal(cairn_filter_mapper_measure(mapper).keyframes, 3);
    {
        cairn_scan_input input = sim_scan_input(&d.scans[0]);
        cairn_pose path[3];

        assert_status(cairn_filter_mapper_add(mapper, &input, NULL, NULL), CAIRN_FULL);
        assert_int_equal(cairn_filter_mapper_path(mapper, 0, path, 3), 3);
    }
    test_pool_free(&pool);
    end_drive(&d);
}

/* ---- Budgets, degenerate scans ---- */

static void result_does_not_depend_on_budget(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1000, 7, 1};
    drive d = start_drive(SIM_APARTMENT, 2, 16, 0.02, 0.6);
    uint64_t hash = 0;
    int64_t units = 0;

    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_filter_mapper_params params = filter_params(3);
        cairn_filter_mapper *mapper;
        cairn_pool pool;

        params.recent_keyframes = 4;
        params.shape_prior = 1;
        mapper = new_filter_mapper(&pool, &params);
        for (int32_t i = 0; i < 2 * d.count; i++)
            feed(mapper, &d.scans[i < d.count ? i : 2 * d.count - 1 - i], 1, budgets[k]);
        if (k == 0) {
            hash = hash_of(mapper);
            units = cairn_filter_mapper_measure(mapper).units;
        }
        assert_true(hash_of(mapper) == hash);
        assert_true(cairn_filter_mapper_measure(mapper).units == units);
        assert_true(cairn_filter_mapper_measure(mapper).shape_starts > 0);
        test_pool_free(&pool);
    }
    end_drive(&d);
}

/* No step exceeds its budget except by the last item of the inner mapper. */
static void steps_are_bounded(void **state)
{
    cairn_filter_mapper_params params = filter_params(4);
    drive d = start_drive(SIM_APARTMENT, 2, 10, 0.02, 0.6);
    cairn_pool pool;
    cairn_filter_mapper *mapper = new_filter_mapper(&pool, &params);

    (void)state;
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry = pose_of(d.scans[i].odometry);
        cairn_budget budget;

        assert_taken(cairn_filter_mapper_add(mapper, &input, &odometry, NULL));
        do {
            budget.left = 100;
            assert_true(budget.left <= 100);
        } while (cairn_filter_mapper_step(mapper, &budget) == CAIRN_MORE && budget.left > -300);
        assert_true(budget.left > -300);
    }
    test_pool_free(&pool);
    end_drive(&d);
}

/* Scans without points: the first one is the start of the path, the others are attached to it. */
static void accepts_scans_without_returns(void **state)
{
    cairn_filter_mapper_params params = filter_params(2);
    drive d = start_drive(SIM_APARTMENT, 1, 6, 0, 0.6);
    cairn_pool pool;
    cairn_filter_mapper *mapper = new_filter_mapper(&pool, &params);
    static float nothing[181];
    cairn_pose path[8];

    (void)state;
    for (int i = 0; i < 181; i++)
        nothing[i] = (float)INFINITY;
    for (int32_t i = 0; i < 3; i++) {
        cairn_scan_input blind = sim_scan_input(&d.scans[0]);
        cairn_pose odometry = {(cairn_real)i, 0, 0};
        cairn_budget budget = {CAIRN_UNBOUNDED};

        blind.range = nothing;
        assert_taken(cairn_filter_mapper_add(mapper, &blind, &odometry, NULL));
        assert_ok(cairn_filter_mapper_step(mapper, &budget));
    }
    assert_int_equal(cairn_filter_mapper_measure(mapper).keyframes, 1);
    for (int32_t i = 0; i < d.count; i++)
        feed(mapper, &d.scans[i], 1, CAIRN_UNBOUNDED);
    assert_true(cairn_filter_mapper_measure(mapper).keyframes > 3);
    for (int32_t p = 0; p < 2; p++) {
        int32_t keys = cairn_filter_mapper_path(mapper, p, path, 8);

        for (int32_t k = 0; k < keys; k++)
            assert_true(cairn_pose_is_finite(path[k]));
    }
    test_pool_free(&pool);
    end_drive(&d);
}

/* Runs a short drive that returns to its map with all real parameters at an end of their ranges. */
static void drive_at_limits(int highest)
{
    cairn_filter_mapper_params params = filter_params(2);
    drive d = start_drive(SIM_APARTMENT, 1, 12, 0.02, 0.6);
    cairn_filter_mapper *mapper;
    cairn_pool pool;

    params.recent_keyframes = 2;
    for (int32_t i = 0; i < cairn_filter_mapper_parameters.count; i++) {
        const cairn_parameter *row = &cairn_filter_mapper_parameters.list[i];

        if (row->type != CAIRN_PARAMETER_INTEGER)
            memcpy((unsigned char *)&params + row->at,
                   highest ? &row->highest.number : &row->lowest.number, sizeof(cairn_real));
    }
    mapper = new_filter_mapper(&pool, &params);
    for (int32_t i = 0; i < d.count; i++)
        feed(mapper, &d.scans[i], 1, CAIRN_UNBOUNDED);
    assert_true(cairn_filter_mapper_measure(mapper).keyframes > 6);
    for (int32_t p = 0; p < cairn_filter_mapper_count(mapper); p++) {
        static cairn_pose path[KEYS_MOST];
        int32_t keys = cairn_filter_mapper_path(mapper, p, path, KEYS_MOST);

        assert_int_equal(keys, cairn_filter_mapper_measure(mapper).keyframes);
        for (int32_t k = 0; k < keys; k++)
            assert_true(cairn_pose_is_finite(path[k]));
    }
    test_pool_free(&pool);
    end_drive(&d);
}

static void stays_finite_at_limits_of_parameters(void **state)
{
    (void)state;
    drive_at_limits(0);
    drive_at_limits(1);
}

/* ---- A drive out and back ---- */

/* Scans of the way out; near its far end, in both directions, the scanner has no returns beyond
 * NEAR_RANGE, and the odometry turns. */
enum { OUT_SCANS = 60, BLIND_FROM = 40, BLIND_TO = 2 * OUT_SCANS - BLIND_FROM };
static const double NEAR_RANGE = 0.6, TURN_BIAS = 0.02; /* m, rad per scan */

/* Scan n of the drive out and back, without the ranges that the scanner does not see. */
static sim_scan scan_of_drive(const drive *d, int32_t n)
{
    static float range[181];
    sim_scan scan = d->scans[n < OUT_SCANS ? n : 2 * OUT_SCANS - 1 - n];

    if (n < BLIND_FROM || n >= BLIND_TO)
        return scan;
    for (int32_t i = 0; i < 181; i++)
        range[i] = (double)scan.range[i] < NEAR_RANGE ? scan.range[i] : (float)INFINITY;
    scan.range = range;
    return scan;
}

/* Mean errors of position relative to the first scan on the way back, m: along the best
 * path, and by the motion alone.
 *
 * recent: keyframes that do not belong to the old map */
static void drive_errors(uint64_t seed, int32_t recent, int32_t shape_prior, double errors[2],
                         cairn_filter_mapper_state *measured)
{
    static cairn_pose path[KEYS_MOST];
    cairn_filter_mapper_params params = filter_params(MOST_PARTICLES);
    drive d = start_drive(SIM_OFFICE, seed, OUT_SCANS, 0.02, 0.5);
    cairn_filter_mapper *mapper;
    const cairn_mapper *front;
    cairn_pool pool;
    cairn_pose odometry = pose_of(d.scans[0].odometry), before = odometry;
    cairn_mapper_result results[2 * OUT_SCANS];

    params.recent_keyframes = recent;
    params.shape_prior = shape_prior;
    mapper = new_filter_mapper(&pool, &params);
    front = cairn_filter_mapper_front(mapper);
    for (int32_t n = 0; n < 2 * OUT_SCANS; n++) {
        sim_scan scan = scan_of_drive(&d, n);
        cairn_pose now = pose_of(scan.odometry);
        cairn_scan_input input = sim_scan_input(&scan);

        odometry = cairn_pose_compose(odometry, cairn_pose_between(before, now));
        if (n >= BLIND_FROM && n < BLIND_TO)
            odometry.theta = cairn_wrap_angle(odometry.theta + (cairn_real)TURN_BIAS);
        before = now;
        assert_ok(cairn_filter_mapper_map(mapper, &input, &odometry, NULL));
        results[n] = cairn_mapper_read(front);
    }
    (void)cairn_filter_mapper_path(mapper, cairn_filter_mapper_best(mapper), path, KEYS_MOST);
    errors[0] = errors[1] = 0;
    for (int32_t n = OUT_SCANS; n < 2 * OUT_SCANS; n++) {
        const sim_scan scan = scan_of_drive(&d, n);
        cairn_pose truth = cairn_pose_between(pose_of(d.scans[0].truth), pose_of(scan.truth));

        for (int k = 0; k < 2; k++) {
            cairn_pose key = k == 0 ? path[results[n].keyframe]
                                    : cairn_mapper_keyframe_pose(front, results[n].keyframe);
            cairn_pose found =
                cairn_pose_between(path[0], cairn_pose_compose(key, results[n].keyframe_scan));

            errors[k] +=
                hypot((double)(truth.x - found.x), (double)(truth.y - found.y)) / OUT_SCANS;
        }
    }
    *measured = cairn_filter_mapper_measure(mapper);
    test_pool_free(&pool);
    end_drive(&d);
}

/* The motion alone drifts by metres where the scanner sees little; a filter that closes the loop on
 * the way out takes back most of it, on the way there too. Seeds at which the front-end mapper does
 * drift, and the drift is within the reach of the starts. */
static void closes_a_loop(void **state)
{
    static const uint64_t seeds[] = {2, 16, 25};

    (void)state;
    for (int k = 0; k < 3; k++) {
        cairn_filter_mapper_state closed, open;
        double errors[2], without[2];

        drive_errors(seeds[k], 25, 0, errors, &closed);
        drive_errors(seeds[k], KEYS_MOST, 0, without, &open);
        assert_true(closed.revisit_matches > 0);
        assert_int_equal(open.revisit_matches, 0);
        assert_true(errors[1] > 2 && without[0] > 2);
        assert_true(errors[0] < without[0] / 6);
    }
}

/* Starts by shape place scans better on average where the drift is large across the line of the
 * other starts. */
static void shapes_place_scans(void **state)
{
    static const uint64_t seeds[] = {24, 33, 36};
    double with_shapes = 0, without_shapes = 0;

    (void)state;
    for (int k = 0; k < 3; k++) {
        cairn_filter_mapper_state by_shape, plain;
        double errors[2], without[2];

        drive_errors(seeds[k], 25, 1, errors, &by_shape);
        drive_errors(seeds[k], 25, 0, without, &plain);
        assert_true(by_shape.shape_starts > 0 && by_shape.shape_matches < by_shape.shape_starts);
        assert_int_equal(plain.shape_matches + plain.shape_starts, 0);
        with_shapes += errors[0] / 3;
        without_shapes += without[0] / 3;
    }
    assert_true(with_shapes < without_shapes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_reference),
        cmocka_unit_test(agrees_with_reference_when_capacities_are_short),
        cmocka_unit_test(takes_just_its_memory),
        cmocka_unit_test(memory_of_the_shape_prior),
        cmocka_unit_test(refuses_bad_params),
        cmocka_unit_test(names_bad_params_of_nested_objects),
        cmocka_unit_test(refuses_bad_calls),
        cmocka_unit_test(says_when_it_is_full),
        cmocka_unit_test(result_does_not_depend_on_budget),
        cmocka_unit_test(steps_are_bounded),
        cmocka_unit_test(accepts_scans_without_returns),
        cmocka_unit_test(stays_finite_at_limits_of_parameters),
        cmocka_unit_test(closes_a_loop),
        cmocka_unit_test(shapes_place_scans),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
