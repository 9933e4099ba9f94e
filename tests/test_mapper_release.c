/* A mapper that runs without end: culled keyframes, their links and attached scans, beside
 * reference implementations. */
#include "tests/drive.h"

#include <math.h>

#include "src/maps/mapper_work.h"

enum {
    SCANS = 150,
    LAPS = 3,
    TURNS = LAPS * SCANS,
    KEYFRAMES = 26,
    LINKS = 400,
    MAX_CLOSURES = 100
};

static drive tour;

static int make_tour(void **state)
{
    (void)state;
    tour = start_drive(SIM_APARTMENT, 3, SCANS, 0.01, 0.3);
    return 0;
}

static int end_tour(void **state)
{
    (void)state;
    end_drive(&tour);
    return 0;
}

static cairn_mapper_params release_params(void)
{
    cairn_mapper_params params = small_params();

    params.max_keyframes = KEYFRAMES;
    params.cull_keyframes = 1;
    params.local_span = 8;
    params.local_keyframes = 8;
    params.loop.min_keyframe_gap = 8;
    params.loop.max_loops = MAX_CLOSURES;
    params.loop.max_fill = 2000;
    params.window = 4;
    params.window_free = 2;
    return params;
}

/* To and fro: the same places in every lap. */
static const sim_scan *scan_of(int32_t turn)
{
    int32_t at = turn % (2 * SCANS);

    return &tour.scans[at < SCANS ? at : 2 * SCANS - 1 - at];
}

/* Odometry that turns a little too much. */
static cairn_pose odometry_at(int32_t turn, cairn_pose before)
{
    cairn_pose step;

    if (turn == 0)
        return pose_of(scan_of(0)->truth);
    step = cairn_pose_between(pose_of(scan_of(turn - 1)->truth), pose_of(scan_of(turn)->truth));
    step.theta += CAIRN_REAL(0.002);
    return cairn_pose_compose(before, step);
}

/* Reference keyframes of scans, as a user of the mapper keeps them. */
typedef struct scan_references {
    int32_t key[TURNS];
    cairn_pose keyframe_scan[TURNS];
    int32_t count, releases;
} scan_references;

static cairn_pose pose_at(const cairn_mapper *mapper, const scan_references *h, int32_t i)
{
    return cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, h->key[i]), h->keyframe_scan[i]);
}

static void follow(const cairn_mapper *mapper, scan_references *h)
{
    for (int32_t now = cairn_mapper_measure(mapper).culled_keyframes; h->releases < now;
         h->releases++)
        for (int32_t i = 0; i < h->count; i++)
            cairn_mapper_reattach(cairn_mapper_culling_at(mapper, h->releases), &h->key[i],
                                  &h->keyframe_scan[i]);
}

typedef void (*watch)(void *context, cairn_mapper *mapper, scan_references *h);

/* Drives, in steps of `units`; callbacks before and after each of them. */
static void run(cairn_mapper *mapper, int32_t turns, int32_t units, scan_references *h,
                watch before, watch after, void *context)
{
    cairn_pose odometry = cairn_pose_identity();

    memset(h, 0, sizeof *h);
    for (int32_t turn = 0; turn < turns; turn++) {
        cairn_scan_input input = sim_scan_input(scan_of(turn));
        cairn_status status = CAIRN_MORE;

        odometry = odometry_at(turn, odometry);
        assert_taken(cairn_mapper_add(mapper, &input, &odometry, NULL));
        while (status == CAIRN_MORE) {
            cairn_budget budget = {units};

            if (before != NULL)
                before(context, mapper, h);
            status = cairn_mapper_step(mapper, &budget);
            assert_true(status == CAIRN_MORE ? budget.left == 0 : budget.left >= 0);
            follow(mapper, h);
            if (after != NULL)
                after(context, mapper, h);
        }
        assert_ok(status);
        h->key[turn] = cairn_mapper_read(mapper).keyframe;
        h->keyframe_scan[turn] = cairn_mapper_read(mapper).keyframe_scan;
        h->count++;
    }
}

/* ---- The whole ---- */

static void check_links(const cairn_mapper *mapper)
{
    int32_t links = cairn_mapper_link_count(mapper), loops = 0,
            keys = cairn_mapper_measure(mapper).keyframes;
    int32_t root[KEYFRAMES];

    for (int32_t i = 0; i < keys; i++)
        root[i] = i;
    for (int32_t i = 0; i < links; i++) {
        cairn_mapper_link link = cairn_mapper_link_at(mapper, i);
        int32_t from = root[link.first], to = root[link.second];
        cairn_sym3 covariance;

        assert_true(link.first >= 0 && link.first < link.second && link.second < keys);
        assert_true(cairn_pose_is_finite(link.first_second));
        assert_true(cairn_sym3_inverse(link.information, &covariance));
        loops += link.is_loop && !link.is_outlier;
        for (int32_t k = 0; k < keys && !link.is_loop && !link.is_outlier; k++)
            if (root[k] == to)
                root[k] = from;
    }
    assert_int_equal(loops, cairn_mapper_measure(mapper).loops);
    /* Connected even without its loop closures. */
    for (int32_t i = 0; i < mapper->loop.graph_keyframes; i++)
        assert_int_equal(root[i], root[0]);
}

static double error_at(const cairn_mapper *mapper, const scan_references *h, int32_t i)
{
    cairn_pose found = pose_at(mapper, h, i);
    sim_pose truth = scan_of(i)->truth;

    return hypot((double)found.x - truth.x, (double)found.y - truth.y);
}

static scan_references kept, other;

static void it_runs_on_in_fixed_memory(void **state)
{
    cairn_mapper_params params = release_params();
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_budget all = {INT32_MAX};
    double sum[LAPS] = {0};

    (void)state;
    run(mapper, TURNS, INT32_MAX, &kept, NULL, NULL, NULL);
    check_links(mapper);
    assert_ok(cairn_mapper_settle(mapper, &all));
    follow(mapper, &kept);
    check_links(mapper);
    assert_true(cairn_mapper_measure(mapper).culled_keyframes > 2 * KEYFRAMES);
    assert_true(cairn_mapper_measure(mapper).keyframes < KEYFRAMES &&
                cairn_mapper_measure(mapper).keyframes > KEYFRAMES / 2);
    assert_int_equal(cairn_mapper_measure(mapper).keyframes, mapper->keyframe_count);
    assert_true(cairn_mapper_measure(mapper).graph_solutions > 3);
    for (int32_t i = 0; i < TURNS; i++) {
        assert_true(error_at(mapper, &kept, i) < 0.3);
        sum[i / SCANS] += error_at(mapper, &kept, i) / SCANS;
    }
    for (int32_t i = 0; i < LAPS; i++)
        assert_true(sum[i] < 0.1);
    for (int32_t key = 0; key < mapper->keyframe_count; key++) {
        int32_t slot = cairn_mapper_keyframe_slot(mapper, key);

        assert_true(cairn_mapper_keyframes(mapper)->scans[slot].in_use);
        for (int32_t k = 0; k < key; k++)
            assert_int_not_equal(slot, cairn_mapper_keyframe_slot(mapper, k));
    }
    test_pool_free(&pool);
}

static void without_culling_it_is_full(void **state)
{
    cairn_mapper_params params = release_params();
    cairn_pool pool;
    cairn_mapper *mapper;
    cairn_status status = CAIRN_OK;
    cairn_pose odometry = cairn_pose_identity();
    int32_t turn;

    (void)state;
    params.cull_keyframes = 0;
    mapper = new_mapper(&pool, &params);
    for (turn = 0; turn < SCANS && status == CAIRN_OK; turn++) {
        cairn_scan_input input = sim_scan_input(scan_of(turn));
        cairn_budget all = {INT32_MAX};

        odometry = odometry_at(turn, odometry);
        assert_taken(cairn_mapper_add(mapper, &input, &odometry, NULL));
        status = cairn_mapper_step(mapper, &all);
        assert_int_equal(cairn_mapper_keyframe_slot(mapper, 0), 0);
    }
    assert_status(status, CAIRN_FULL);
    assert_int_equal(cairn_mapper_measure(mapper).keyframes, KEYFRAMES);
    assert_int_equal(cairn_mapper_measure(mapper).culled_keyframes, 0);
    test_pool_free(&pool);
}

static void a_small_capacity_of_points_is_enough(void **state)
{
    cairn_mapper_params params = release_params();
    cairn_pool pool;
    cairn_mapper *mapper;

    (void)state;
    params.max_keyframes = 60;
    params.max_keyframe_points = params.scan.max_points + 30 * 60;
    mapper = new_mapper(&pool, &params);
    run(mapper, SCANS, INT32_MAX, &kept, NULL, NULL, NULL);
    assert_true(cairn_mapper_measure(mapper).culled_keyframes > 0);
    assert_true(cairn_mapper_measure(mapper).keyframes < 50);
    test_pool_free(&pool);
    params.max_keyframe_points = 200000;
    params.max_keyframe_segments = params.scan.max_segments + 5 * 30;
    mapper = new_mapper(&pool, &params);
    run(mapper, SCANS, INT32_MAX, &kept, NULL, NULL, NULL);
    assert_true(cairn_mapper_measure(mapper).culled_keyframes > 0);
    assert_true(cairn_mapper_measure(mapper).keyframes < 50);
    test_pool_free(&pool);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t units[] = {1, 7, 1000};
    cairn_mapper_params params = release_params();
    cairn_mapper *all, *mapper;
    cairn_pool pool, other_pool;

    (void)state;
    all = new_mapper(&pool, &params);
    run(all, SCANS, INT32_MAX, &kept, NULL, NULL, NULL);
    for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
        mapper = new_mapper(&other_pool, &params);
        run(mapper, SCANS, units[i], &other, NULL, NULL, NULL);
        assert_int_equal(cairn_mapper_measure(mapper).units, cairn_mapper_measure(all).units);
        assert_int_equal(other.releases, kept.releases);
        assert_memory_equal(other.key, kept.key, SCANS * sizeof *kept.key);
        assert_memory_equal(other.keyframe_scan, kept.keyframe_scan,
                            SCANS * sizeof *kept.keyframe_scan);
        for (int32_t k = 0; k < all->keyframe_count; k++) {
            cairn_pose a = cairn_mapper_keyframe_pose(all, k),
                       b = cairn_mapper_keyframe_pose(mapper, k);

            assert_memory_equal(&a, &b, sizeof a);
        }
        test_pool_free(&other_pool);
    }
    test_pool_free(&pool);
}

/* ---- State of the mapper before a step ---- */

typedef struct snapshot {
    int32_t key_count, entered, link_count, releases, local_count, pending_count, solutions;
    int32_t slot[KEYFRAMES], pieces[KEYFRAMES], low_confidence[KEYFRAMES];
    int32_t heading[KEYFRAMES];
    mapper_neighbour local[CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES];
    cairn_pose pose[KEYFRAMES];
    uint16_t visibility[KEYFRAMES][CAIRN_VISIBILITY_BINS];
    cairn_vec2 sensor[KEYFRAMES];
    cairn_mapper_link link[LINKS];
    cairn_real chi2[LINKS];
    mapper_pending pending[MAPPER_MAX_PENDING];
    cairn_mapper_loop events[MAPPER_LOOP_EVENTS];
    cairn_pose last;
    int32_t seen, fused, bent, taken, contradicted; /* culled keyframes, and links by their fate */
} snapshot;

static snapshot was;

static void remember(void *context, cairn_mapper *mapper, scan_references *h)
{
    snapshot *m = context;

    (void)h;
    if (mapper->loop.cull_resume == 0)
        return;
    m->key_count = mapper->keyframe_count;
    m->entered = mapper->loop.graph_keyframes;
    m->releases = mapper->state.culled_keyframes;
    m->solutions = mapper->state.graph_solutions;
    m->link_count = mapper->loop.link_count;
    m->local_count = mapper->target.count;
    m->pending_count = mapper->loop.pending_count;
    m->last = cairn_pose_compose(mapper->keyframe_pose[mapper->result.keyframe],
                                 mapper->result.keyframe_scan);
    memcpy(m->slot, mapper->slot, sizeof *m->slot * (size_t)m->key_count);
    memcpy(m->local, mapper->target.keyframes, sizeof m->local);
    memcpy(m->pose, mapper->keyframe_pose, sizeof *m->pose * (size_t)m->key_count);
    memcpy(m->pending, mapper->loop.pending, sizeof m->pending);
    memcpy(m->events, mapper->loop.events, sizeof m->events);
    for (int32_t k = 0; k < m->key_count; k++) {
        memcpy(m->visibility[k], &mapper->visibility[(size_t)m->slot[k] * CAIRN_VISIBILITY_BINS],
               sizeof m->visibility[k]);
        m->sensor[k] = mapper->keyframes->scans[m->slot[k]].sensor;
        m->pieces[k] = mapper->loop.constraints[k].submap;
        m->low_confidence[k] = mapper->loop.constraints[k].low_confidence;
        /* of each kind, which the maps do not depend on */
        mapper->loop.constraints[k].heading =
            k % 7 == 3 ? MAPPER_HEADING_UNKNOWN
                       : (k % 3 == 0 ? MAPPER_HEADING_BY_MATCH : MAPPER_HEADING_BY_ODOMETRY);
        m->heading[k] = mapper->loop.constraints[k].heading;
    }
    assert_true(m->link_count <= LINKS);
    for (int32_t i = 0; i < m->link_count; i++) {
        m->link[i] = cairn_mapper_link_at(mapper, i);
        m->chi2[i] = cairn_pose_graph_link_of(mapper->loop.graph, i).chi2;
    }
}

/* ---- Which one goes ---- */

/* The bearing whose sector holds the angle of a direction: by the corners of a square that stands
 * on its tip, which the bearings divide evenly. */
static int32_t slow_bearing(cairn_vec2 d)
{
    double angle = atan2((double)d.y, (double)d.x);
    int32_t found = 0;

    if (angle < 0)
        angle += 2 * 3.14159265358979323846;
    for (int32_t b = 1; b < CAIRN_VISIBILITY_BINS; b++) {
        double t = 4.0 * b / CAIRN_VISIBILITY_BINS, within = t - floor(t);
        double x[4] = {1 - within, -within, within - 1, within},
               y[4] = {within, 1 - within, -within, within - 1};
        double begin = atan2(y[(int)t], x[(int)t]);

        if (begin < 0)
            begin += 2 * 3.14159265358979323846;
        if (angle >= begin)
            found = b;
    }
    return found;
}

static cairn_vec2 middle_of(int32_t bearing)
{
    double t = 4.0 * (bearing + 0.5) / CAIRN_VISIBILITY_BINS, within = t - floor(t);
    double x[4] = {1 - within, -within, within - 1, within},
           y[4] = {within, 1 - within, -within, within - 1};
    double n = hypot(x[(int)t], y[(int)t]);
    cairn_vec2 d = {(cairn_real)(x[(int)t] / n), (cairn_real)(y[(int)t] / n)};

    return d;
}

static int slow_sees(const snapshot *m, int32_t key, cairn_vec2 in_map, int surface)
{
    cairn_vec2 p = cairn_pose_point(cairn_pose_inverse(m->pose[key]), in_map),
               d = cairn_vec2_sub(p, m->sensor[key]);
    double range = m->visibility[key][slow_bearing(d)] / 100.0,
           distance = hypot((double)d.x, (double)d.y);

    return surface ? range > 0 && fabs(range - distance) <= 0.2 : range >= distance;
}

static double distance_of(const snapshot *m, int32_t a, int32_t b)
{
    cairn_vec2 p = cairn_pose_point(m->pose[a], m->sensor[a]),
               q = cairn_pose_point(m->pose[b], m->sensor[b]);

    return hypot((double)(p.x - q.x), (double)(p.y - q.y));
}

static const snapshot *sorted_for;
static int32_t sorted_about;

static int by_distance(const void *a, const void *b)
{
    int32_t p = *(const int32_t *)a, q = *(const int32_t *)b;
    double d = distance_of(sorted_for, sorted_about, p) - distance_of(sorted_for, sorted_about, q);

    return d < 0 ? -1 : d > 0 ? 1 : p - q;
}

static double slow_loss(const snapshot *m, int32_t key)
{
    int32_t near[KEYFRAMES], count = 0;
    double loss = 0;

    for (int32_t k = 0; k < key; k++)
        near[count++] = k;
    sorted_for = m;
    sorted_about = key;
    qsort(near, (size_t)count, sizeof *near, by_distance);
    for (int32_t b = 0; b < CAIRN_VISIBILITY_BINS; b += 4)
        for (int part = 1; part <= 2 && m->visibility[key][b] > 0; part++) {
            cairn_vec2 way = cairn_vec2_scale(
                middle_of(b), (cairn_real)(m->visibility[key][b] / 100.0 * part / 2));
            cairn_vec2 at = cairn_pose_point(m->pose[key], cairn_vec2_add(m->sensor[key], way));
            int seen = 0;

            for (int32_t k = 0; k < count && k < 8; k++)
                seen += slow_sees(m, near[k], at, part == 2);
            loss += 1.0 / (1 + seen);
        }
    return loss;
}

/* Rounding may put a sample on the other side of an edge. */
static const double ROUNDING_TOLERANCE = NUMBER(0.6, 3);

static void check_choice(const snapshot *m, const cairn_mapper_culling *release)
{
    int32_t end = m->entered - 8 < m->key_count - 10 ? m->entered - 8 : m->key_count - 10;
    double loss = slow_loss(m, release->keyframe);

    assert_true(release->keyframe >= 1 && release->keyframe < end);
    for (int32_t k = 1; k < end; k++)
        assert_true(loss <= slow_loss(m, k) + ROUNDING_TOLERANCE);
}

/* ---- Links of a culled keyframe ---- */

/* A measurement as three numbers with a dense covariance, in double. */
typedef struct dense {
    double z[3], c[3][3];
} dense;

static dense dense_of(const cairn_mapper_link *link, int32_t from)
{
    cairn_sym3 i = link->information;
    double a[3][3] = {{(double)i.xx, (double)i.xy, (double)i.xz},
                      {(double)i.xy, (double)i.yy, (double)i.yz},
                      {(double)i.xz, (double)i.yz, (double)i.zz}};
    double det = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                 a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                 a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    dense d = {{(double)link->first_second.x, (double)link->first_second.y,
                (double)link->first_second.theta},
               {{0}}};

    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            d.c[k][r] = (a[(r + 1) % 3][(k + 1) % 3] * a[(r + 2) % 3][(k + 2) % 3] -
                         a[(r + 1) % 3][(k + 2) % 3] * a[(r + 2) % 3][(k + 1) % 3]) /
                        det;
    (void)from;
    return d;
}

static void compose(const double a[3], const double b[3], double out[3])
{
    out[0] = a[0] + cos(a[2]) * b[0] - sin(a[2]) * b[1];
    out[1] = a[1] + sin(a[2]) * b[0] + cos(a[2]) * b[1];
    out[2] = a[2] + b[2];
}

static void invert(const double a[3], double out[3])
{
    out[0] = -cos(a[2]) * a[0] - sin(a[2]) * a[1];
    out[1] = sin(a[2]) * a[0] - cos(a[2]) * a[1];
    out[2] = -a[2];
}

/* Change of out.z when the motions a and b are disturbed by e and f in their own frames, relative
 * to the undisturbed out. */
typedef void (*combine)(const double a[3], const double b[3], double out[3]);

static void inverse_of(const double a[3], const double b[3], double out[3])
{
    (void)b;
    invert(a, out);
}

static dense propagate(const dense *a, const dense *b, combine how)
{
    const double step = 1e-6;
    double jacobian[3][6], back[3];
    dense out;

    memset(&out, 0, sizeof out);
    how(a->z, b->z, out.z);
    invert(out.z, back);
    for (int k = 0; k < 6; k++) {
        double e[3] = {0, 0, 0}, off_a[3], off_b[3], there[3], off[3];

        e[k % 3] = step;
        compose(a->z, e, off_a);
        compose(b->z, e, off_b);
        how(k < 3 ? off_a : a->z, k < 3 ? b->z : off_b, there);
        compose(back, there, off);
        for (int r = 0; r < 3; r++)
            jacobian[r][k] = off[r] / step;
    }
    for (int r = 0; r < 3; r++)
        for (int s = 0; s < 3; s++)
            for (int k = 0; k < 6; k++)
                for (int l = 0; l < 6; l++)
                    if (k / 3 == l / 3)
                        out.c[r][s] +=
                            jacobian[r][k] * (k < 3 ? a : b)->c[k % 3][l % 3] * jacobian[s][l];
    return out;
}

static dense seen_from(const cairn_mapper_link *link, int32_t from)
{
    dense d = dense_of(link, from);

    return link->first == from ? d : propagate(&d, &d, inverse_of);
}

static void invert_dense(double in[3][3], double out[3][3])
{
    double a[3][6];

    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 6; k++)
            a[r][k] = k < 3 ? in[r][k] : k - 3 == r;
    for (int p = 0; p < 3; p++)
        for (int r = 0; r < 3; r++) {
            double by = r == p ? 1 - 1 / a[p][p] : a[r][p] / a[p][p];

            for (int k = 0; k < 6; k++)
                a[r][k] -= r == p ? 0 : by * a[p][k];
        }
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            out[r][k] = a[r][k + 3] / a[r][r];
}

/* The weighted mean, seen from a. 0 when they contradict each other. */
static int slow_fuse(const dense *a, const dense *b, dense *out)
{
    double back[3], e[3], ia[3][3], ib[3][3], both[3][3], sum[3][3], weight[3][3],
        chi2 = 0, by = 1, off[3] = {0, 0, 0};

    invert(a->z, back);
    compose(back, b->z, e);
    e[2] = remainder(e[2], 2 * 3.14159265358979323846);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            sum[r][k] = a->c[r][k] + b->c[r][k];
    invert_dense(sum, weight);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            chi2 += e[r] * weight[r][k] * e[k];
    if (chi2 > 50)
        return 0;
    memcpy(ia, a->c, sizeof ia);
    memcpy(ib, b->c, sizeof ib);
    invert_dense(ia, ia);
    invert_dense(ib, ib);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            both[r][k] = ia[r][k] + ib[r][k];
    memset(out, 0, sizeof *out);
    invert_dense(both, out->c);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            for (int l = 0; l < 3; l++)
                off[r] += out->c[r][k] * ib[k][l] * e[l];
    compose(a->z, off, out->z);
    by = fmax(by, fmax(1e-6 / out->c[0][0], fmax(1e-6 / out->c[1][1], 1.6e-7 / out->c[2][2])));
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            out->c[r][k] *= by;
    return 1;
}

static void assert_same(const dense *expected, const cairn_mapper_link *link)
{
    dense d = dense_of(link, link->first);

    for (int r = 0; r < 3; r++) {
        assert_near(remainder(d.z[r] - expected->z[r], 2 * 3.14159265358979323846), 0,
                    NUMBER(1e-5, 1e-3));
        for (int k = 0; k < 3; k++)
            assert_near(d.c[r][k], expected->c[r][k],
                        NUMBER(1e-4, 2e-2) * sqrt(expected->c[r][r] * expected->c[k][k]));
    }
}

static int32_t far_end(const cairn_mapper_link *link, int32_t key)
{
    return link->first == key ? link->second : link->first;
}

static int32_t renamed(int32_t key, int32_t gone)
{
    return key - (key > gone);
}

/* The active link between two keyframes, of an array; -1: none. */
static int32_t slow_find(const cairn_mapper_link *links, int32_t count, int32_t a, int32_t b)
{
    for (int32_t i = 0; i < count; i++)
        if (!links[i].is_outlier && ((links[i].first == a && links[i].second == b) ||
                                     (links[i].first == b && links[i].second == a)))
            return i;
    return -1;
}

static double chi2_at(const snapshot *m, int32_t from, int32_t to, const dense *d)
{
    cairn_pose there = cairn_pose_between(m->pose[from], m->pose[to]);
    double z[3] = {(double)there.x, (double)there.y, (double)there.theta}, back[3], e[3], w[3][3],
           chi2 = 0, c[3][3];

    invert(d->z, back);
    compose(back, z, e);
    e[2] = remainder(e[2], 2 * 3.14159265358979323846);
    memcpy(c, d->c, sizeof c);
    invert_dense(c, w);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            chi2 += e[r] * w[r][k] * e[k];
    return chi2;
}

/* Every link of the culled keyframe, one after the other, on copies of the former links. */
static void check_contraction(snapshot *m, const cairn_mapper *mapper,
                              const cairn_mapper_culling *release)
{
    static cairn_mapper_link now[LINKS];
    static dense expected[LINKS];
    static int32_t known[LINKS];
    int32_t gone = release->keyframe, best = -1, onto, count = cairn_mapper_link_count(mapper);
    double least = 0;

    for (int32_t i = 0; i < m->link_count; i++) {
        cairn_mapper_link *l = &m->link[i];
        dense d;
        double cost;

        known[i] = 0;
        if (l->first != gone && l->second != gone)
            continue;
        d = dense_of(l, l->first);
        cost = fmax(1, (double)m->chi2[i]) * (d.c[0][0] + d.c[1][1] + d.c[2][2]);
        if (!l->is_outlier && (best < 0 || cost < least * (1 - 1e-6))) {
            best = i;
            least = cost;
        }
    }
    onto = m->link[best].first == gone ? m->link[best].second : m->link[best].first;
    if (release->reference != renamed(onto, gone)) { /* as good, up to rounding */
        onto = release->reference + (release->reference >= gone);
        best = slow_find(m->link, m->link_count, onto, gone);
        assert_true(best >= 0);
    }
    for (int32_t i = 0; i < count; i++)
        now[i] = cairn_mapper_link_at(mapper, i);
    for (int32_t i = 0; i < m->link_count; i++) {
        cairn_mapper_link *l = &m->link[i];
        int32_t far = far_end(l, gone), there, after;
        dense onto_key = seen_from(&m->link[best], onto), key_far, onto_far, before, both;

        if ((l->first != gone && l->second != gone) || l->is_outlier || far == onto)
            continue;
        key_far = seen_from(l, gone);
        onto_far = propagate(&onto_key, &key_far, compose);
        there = slow_find(m->link, m->link_count, onto, far);
        after = slow_find(now, count, renamed(onto, gone), renamed(far, gone));
        if (there < 0 && after < 0) {
            assert_true(l->is_loop && m->link_count >= 2 * m->entered);
            continue;
        }
        assert_true(after >= 0);
        both = onto_far;
        if (there >= 0 && known[there] == 0) {
            before = seen_from(&m->link[there], onto);
            if (!slow_fuse(&before, &onto_far, &both)) {
                both = chi2_at(m, onto, far, &onto_far) < chi2_at(m, onto, far, &before) ? onto_far
                                                                                         : before;
                m->contradicted++;
            }
            assert_int_equal(now[after].is_loop, l->is_loop && m->link[there].is_loop);
            m->taken++;
        } else if (there < 0) {
            assert_int_equal(now[after].is_loop, l->is_loop);
            m->bent++;
        }
        if (renamed(onto, gone) > renamed(far, gone))
            both = propagate(&both, &both, inverse_of);
        expected[after] = both;
        assert_same(&expected[after], &now[after]);
    }
    /* All others are unchanged, in their order. */
    for (int32_t i = 0, at = 0; i < m->link_count; i++) {
        cairn_mapper_link *l = &m->link[i];

        if (l->first == gone || l->second == gone || l->first == onto || l->second == onto)
            continue;
        while (at < count && (now[at].first != renamed(l->first, gone) ||
                              now[at].second != renamed(l->second, gone)))
            at++;
        assert_true(at < count);
        assert_int_equal(now[at].is_loop, l->is_loop);
        assert_int_equal(now[at].is_outlier, l->is_outlier);
        assert_memory_equal(&now[at].first_second, &l->first_second, sizeof l->first_second);
        at++;
    }
}

/* ---- Renumbering ---- */

static void assert_same_pose(cairn_pose a, cairn_pose b)
{
    assert_near(a.x, b.x, NUMBER(1e-9, 1e-4));
    assert_near(a.y, b.y, NUMBER(1e-9, 1e-4));
    assert_near(cairn_wrap_angle(a.theta - b.theta), 0, NUMBER(1e-9, 1e-4));
}

static void check_names(const snapshot *m, const cairn_mapper *mapper,
                        const cairn_mapper_culling *release)
{
    int32_t gone = release->keyframe, heir = -1;
    int32_t waits = m->pending_count < MAPPER_MAX_PENDING ? m->pending_count : MAPPER_MAX_PENDING;

    assert_int_equal(mapper->keyframe_count, m->key_count - 1);
    assert_int_equal(mapper->loop.graph_keyframes, m->entered - 1);
    for (int32_t k = 0; k < m->key_count; k++)
        if (k != gone && m->pieces[k] == gone && heir < 0)
            heir = k;
    for (int32_t k = 0; k < m->key_count; k++) {
        int32_t now = renamed(k, gone), piece = m->pieces[k] == gone ? heir : m->pieces[k];

        if (k == gone)
            continue;
        assert_int_equal(mapper->slot[now], m->slot[k]);
        assert_memory_equal(&mapper->keyframe_pose[now], &m->pose[k], sizeof m->pose[k]);
        assert_int_equal(mapper->loop.constraints[now].submap, renamed(piece, gone));
        assert_int_equal(mapper->loop.constraints[now].low_confidence,
                         m->low_confidence[k == heir ? gone : k]);
        /* the less sure one of both */
        assert_int_equal(mapper->loop.constraints[now].heading,
                         k == gone + 1 && m->heading[gone] > m->heading[k] ? m->heading[gone]
                                                                           : m->heading[k]);
        if (now < mapper->loop.graph_keyframes) {
            cairn_pose in_graph = cairn_pose_graph_pose(mapper->loop.graph, now);

            assert_near(in_graph.x, m->pose[k].x, 1e-6);
        }
    }
    assert_same_pose(cairn_pose_compose(mapper->keyframe_pose[mapper->result.keyframe],
                                        mapper->result.keyframe_scan),
                     m->last);
    assert_same_pose(
        cairn_pose_compose(mapper->keyframe_pose[release->reference], release->reference_keyframe),
        m->pose[gone]);
    assert_int_equal(mapper->target.count, m->local_count);
    for (int32_t i = 0; i < m->local_count; i++)
        assert_int_equal(mapper->target.keyframes[i].keyframe, renamed(m->local[i].keyframe, gone));
    for (int32_t i = 0; i < waits; i++) {
        const cairn_mapper_loop *p = &mapper->loop.pending[i].event, *before = &m->pending[i].event;

        assert_same_pose(cairn_pose_compose(mapper->keyframe_pose[p->first], p->first_second),
                         cairn_pose_compose(m->pose[before->first], before->first_second));
        if (before->second != gone)
            assert_int_equal(p->second, renamed(before->second, gone));
    }
    for (int32_t i = 0; i < MAPPER_LOOP_EVENTS && i < mapper->state.loop_events; i++) {
        int32_t first = m->events[i].first, second = m->events[i].second;

        assert_int_equal(mapper->loop.events[i].first,
                         first == gone ? release->reference : renamed(first, gone));
        assert_int_equal(mapper->loop.events[i].second,
                         second == gone ? release->reference : renamed(second, gone));
    }
}

static void check_culling(void *context, cairn_mapper *mapper, scan_references *h)
{
    snapshot *m = context;
    cairn_mapper_culling release;

    if (mapper->state.culled_keyframes == m->releases || m->key_count == 0)
        return;
    assert_int_equal(mapper->state.culled_keyframes, m->releases + 1);
    assert_int_equal(mapper->loop.unsolved_closures, 0);
    release = cairn_mapper_culling_at(mapper, m->releases);
    check_choice(m, &release);
    check_contraction(m, mapper, &release);
    check_names(m, mapper, &release);
    check_links(mapper);
    (void)h;
    m->releases++;
    m->seen++;
}

static void every_culled_keyframe_is_that_of_the_reference(void **state)
{
    cairn_mapper_params params = release_params();
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);

    (void)state;
    memset(&was, 0, sizeof was);
    run(mapper, 2 * SCANS, 1, &kept, remember, check_culling, &was);
    assert_true(was.seen > KEYFRAMES && was.bent > 10 && was.taken > 10);
    test_pool_free(&pool);
}

/* A chain solved without the keyframe between two others leaves these unchanged. */
static void attached_scans_stay_in_place(void **state)
{
    cairn_mapper_culling release = {4, 2, {1, 2, CAIRN_REAL(0.5)}};
    cairn_pose seen = {CAIRN_REAL(0.3), CAIRN_REAL(-0.1), CAIRN_REAL(0.2)}, at;
    int32_t key = 4;

    (void)state;
    at = seen;
    cairn_mapper_reattach(release, &key, &at);
    assert_int_equal(key, 2);
    assert_same_pose(at, cairn_pose_compose(release.reference_keyframe, seen));
    for (int32_t k = 0; k < 8; k++) {
        key = k;
        at = seen;
        cairn_mapper_reattach(release, &key, &at);
        if (k != 4) {
            assert_int_equal(key, k < 4 ? k : k - 1);
            assert_memory_equal(&at, &seen, sizeof at);
        }
    }
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_mapper *mapper;

    return cairn_mapper_create(&mapper, pool, context);
}

static void params_are_checked(void **state)
{
    cairn_mapper_params params = release_params(), plain = params;

    (void)state;
    plain.cull_keyframes = 0;
    assert_true(cairn_mapper_memory(&params) > cairn_mapper_memory(&plain));
#define REFUSED(field, value)                                                                      \
    do {                                                                                           \
        cairn_mapper_params bad = params;                                                          \
        bad.field = value;                                                                         \
        assert_int_equal(cairn_mapper_memory(&bad), 0);                                            \
        bad.cull_keyframes = 0;                                                                    \
        assert_true(cairn_mapper_memory(&bad) > 0);                                                \
    } while (0)
    REFUSED(loop.max_loops, 0);
    REFUSED(local_span, 0);
    REFUSED(max_keyframes, 11);
    /* gap, free ones of the window, the first one and one that may be culled */
    params.max_keyframes = 12;
    assert_true(cairn_mapper_memory(&params) > 0);
    REFUSED(max_keyframes, 11);
    REFUSED(local_span, 11);
    REFUSED(window, 11);
    REFUSED(loop.min_keyframe_gap, 9);
    params.scan.max_beams = params.scan.max_points = 8;
    params.scan.max_segments = 4;
    params.max_keyframe_points = 96;
    params.max_keyframe_segments = 48;
    params.loop.max_loops = params.loop.max_fill = 8;
    test_every_pool_size(create, &params, cairn_mapper_memory(&params));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_culled_keyframe_is_that_of_the_reference),
        cmocka_unit_test(it_runs_on_in_fixed_memory),
        cmocka_unit_test(without_culling_it_is_full),
        cmocka_unit_test(a_small_capacity_of_points_is_enough),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(attached_scans_stay_in_place),
        cmocka_unit_test(params_are_checked),
    };

    return cmocka_run_group_tests(tests, make_tour, end_tour);
}
