/* bench/pairs: scan matching of two scans, with or without a prior.
 *
 * Pairs are drawn from drives through simulated arenas, whose truth is exact, or from a real log
 * with reference poses. A match is right within 0.10 m in x and in y and 0.03 rad. The start is the
 * truth disturbed uniformly: E 0.1 m 10 degrees, T 0.3 m 20, X 0.5 m 45; `none` starts at the
 * identity and searches everything. The ceiling is the share of pairs that point-to-line ICP at
 * full resolution, started at the truth, leaves there. Unrelated pairs (--strangers) are scans that
 * share nothing: of two arenas, or of places far apart in a log. With --union a place is matched
 * with all others of its arena: where scenes repeat themselves (twins, mirror, corridor) the
 * verdict must say so. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_pairs.h"
#include "bench/bench_reliability.h"
#include "cairn/icp.h"
#include "cairn/output.h"
#include "cairn/random.h"
#include "sim/arena.h"
#include "src/host/base/degrees.h"
#include "src/scans/scan_match_variants.h"
#include "tools/options.h"

enum { WHOLE = 3, MAX_STAGES = 5 }; /* of the stages */

typedef struct settings {
    bench_pairs_settings of;
    const char *data, *start, *method;
    int64_t unrelated;
    int32_t each, ablate, reliability;
    cairn_scan_match_mode mode;
} settings;

typedef struct start_kind {
    const char *name;
    double metres, radians; /* negative: none */
} start_kind;

static const char *const STAGE_NAMES[MAX_STAGES] = {"icp", "lcs", "colinear", "segments",
                                                    "all but colinear"};
static const cairn_scan_match_mode STAGES[MAX_STAGES] = {
    CAIRN_SCAN_MATCH_SHAPE_COMMON, CAIRN_SCAN_MATCH_SHAPE_COLINEAR, CAIRN_SCAN_MATCH_SHAPE_SEGMENTS,
    CAIRN_SCAN_MATCH_SHAPE, CAIRN_SCAN_MATCH_SHAPE_LINES};

static const start_kind STARTS[] = {{"E", 0.1, 10 * CAIRN_DEGREE},
                                    {"T", 0.3, 20 * CAIRN_DEGREE},
                                    {"X", 0.5, 45 * CAIRN_DEGREE},
                                    {"none", -1, -1}};

/* What one match gave. */
typedef struct outcome {
    int32_t right, verdict, count, rank; /* rank of the right hypothesis from 1, 0: none is right */
    double metres, radians, ratio, inside, ms;
    int64_t units;
} outcome;

/* ---- Matching ---- */

typedef struct matcher {
    cairn_scan_match *match;
    cairn_icp *icp;
    void *memory;
    size_t pool_bytes;
} matcher;

static int start_matcher(const settings *s, const bench_views *views, matcher *m)
{
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_icp_params icp = cairn_icp_default();
    cairn_pool pool;
    int32_t points, dense, parts = s->of.unions ? BENCH_PAIRS_PLACES : 1;
    size_t bytes;

    bench_views_most(views, &points, &dense);
    params.mode = s->mode;
    params.max_query = points;
    params.max_target = parts * points;
    params.max_dense = parts * dense;
    params.max_views = parts;
    icp.max_target = parts * dense;
    icp.gate_start = CAIRN_REAL(0.2);
    bytes = cairn_scan_match_memory(&params) + cairn_icp_memory(&icp) + CAIRN_ALIGN;
    m->pool_bytes = cairn_scan_match_memory(&params);
    m->memory = malloc(bytes);
    return m->memory != NULL && cairn_pool_init(&pool, m->memory, bytes) == CAIRN_OK &&
           cairn_scan_match_create(&m->match, &pool, &params) == CAIRN_OK &&
           cairn_icp_create(&m->icp, &pool, &icp) == CAIRN_OK;
}

static int is_right(cairn_pose truth, cairn_pose estimate)
{
    return fabs((double)(estimate.x - truth.x)) < 0.10 &&
           fabs((double)(estimate.y - truth.y)) < 0.10 &&
           fabs((double)cairn_wrap_angle(estimate.theta - truth.theta)) < 0.03;
}

/* The frame of the pair's target and a view in it. */
static cairn_pose seen_from_target(const bench_collection *c, const bench_pair *p, int32_t view)
{
    return cairn_pose_between(c->views.at[p->target].truth, c->views.at[view].truth);
}

/* Point-to-line ICP at full resolution from the truth: 1 when it stays. */
static int stays(matcher *m, const bench_collection *c, const bench_pair *p)
{
    const cairn_scan_match_part *query = &c->views.at[p->query].part;
    cairn_pose truth = seen_from_target(c, p, p->query);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    cairn_icp_clear_target(m->icp);
    for (int32_t i = p->first; i < p->end; i++) {
        const cairn_scan_match_part *part = &c->views.at[i].part;

        if (i != p->query && cairn_icp_add_target(m->icp, part->dense, part->dense_count,
                                                  seen_from_target(c, p, i), NULL) != CAIRN_OK)
            return 0;
    }
    if (cairn_icp_begin(m->icp, query->dense, query->dense_count, truth, NULL, NULL) != CAIRN_OK ||
        cairn_icp_step(m->icp, &budget) != CAIRN_OK)
        return 0;
    return is_right(truth, cairn_icp_read(m->icp).target_query);
}

/* e^T c^-1 e; -1 when c has no inverse. */
static double normalised(const double c[9], const double e[3])
{
    double m00 = c[4] * c[8] - c[5] * c[7], m01 = c[2] * c[7] - c[1] * c[8],
           m02 = c[1] * c[5] - c[2] * c[4];
    double m11 = c[0] * c[8] - c[2] * c[6], m12 = c[2] * c[3] - c[0] * c[5],
           m22 = c[0] * c[4] - c[1] * c[3];
    double determinant =
        c[0] * m00 + c[1] * (c[5] * c[6] - c[3] * c[8]) + c[2] * (c[3] * c[7] - c[4] * c[6]);

    if (!(determinant > 0))
        return -1;
    return (m00 * e[0] * e[0] + m11 * e[1] * e[1] + m22 * e[2] * e[2] +
            2 * (m01 * e[0] * e[1] + m02 * e[0] * e[2] + m12 * e[1] * e[2])) /
           determinant;
}

static void compare(const bench_pair *p, cairn_pose truth, const cairn_scan_match_result *result,
                    outcome *out)
{
    const cairn_scan_match_hypothesis *h = result->hypotheses;
    double e[3], c[9];

    for (int32_t k = result->count - 1; k >= 0; k--)
        if (is_right(truth, h[k].target_query))
            out->rank = k + 1;
    if (result->count == 0)
        return;
    out->right = out->rank == 1;
    e[0] = (double)(h->target_query.x - truth.x);
    e[1] = (double)(h->target_query.y - truth.y);
    e[2] = (double)cairn_wrap_angle(h->target_query.theta - truth.theta);
    for (int k = 0; k < 9; k++)
        c[k] = (double)h->covariance[k];
    out->metres = hypot(e[0], e[1]);
    out->radians = fabs(e[2]);
    out->inside = normalised(c, e) <= 7.815; /* 95 % of chi squared of 3 degrees of freedom */
    out->ratio = p->bound[0] > 0 ? out->metres / sqrt(p->bound[0] + p->bound[4]) : (double)NAN;
}

static cairn_status set_target(matcher *m, const bench_collection *c, const bench_pair *p)
{
    cairn_status status = CAIRN_OK;

    cairn_scan_match_clear_target(m->match);
    for (int32_t i = p->first; i < p->end && status == CAIRN_OK; i++)
        if (i != p->query)
            status = cairn_scan_match_add_target(m->match, &c->views.at[i].part,
                                                 seen_from_target(c, p, i), NULL);
    return status;
}

/* Matches a pair; 0 on failure. */
static int run_pair(matcher *m, const bench_collection *c, const bench_pair *p,
                    const start_kind *kind, cairn_random *random, outcome *out)
{
    const bench_view *query = &c->views.at[p->query];
    cairn_pose truth = seen_from_target(c, p, p->query), start = cairn_pose_identity();
    cairn_scan_match_window window = {(cairn_real)kind->metres, (cairn_real)kind->radians};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_match_result result;
    double begun;

    memset(out, 0, sizeof *out);
    out->metres = out->radians = (double)INFINITY; /* without a hypothesis */
    if (kind->metres >= 0) {
        start.x = truth.x + cairn_random_uniform(random, -window.distance, window.distance);
        start.y = truth.y + cairn_random_uniform(random, -window.distance, window.distance);
        start.theta = cairn_wrap_angle(truth.theta +
                                       cairn_random_uniform(random, -window.angle, window.angle));
    }
    begun = bench_seconds();
    if (set_target(m, c, p) != CAIRN_OK ||
        cairn_scan_match_begin(m->match, &query->part, start, kind->metres >= 0 ? &window : NULL,
                               NULL) != CAIRN_OK ||
        cairn_scan_match_step(m->match, &budget) != CAIRN_OK)
        return 0;
    out->ms = 1e3 * (bench_seconds() - begun);
    result = cairn_scan_match_read(m->match);
    out->units = cairn_scan_match_measured(m->match).units;
    out->verdict = result.verdict;
    out->count = result.count;
    compare(p, truth, &result, out);
    return 1;
}

static void print_each(const settings *s, const bench_collection *c, const bench_pair *p,
                       const outcome *o, const cairn_scan_match_result *r, int ceiling,
                       int is_unrelated)
{
    bench_json_begin("pairs");
    bench_json_text("start", s->start);
    bench_json_integer("stranger", is_unrelated);
    bench_json_integer("target", c->views.at[p->target].scan);
    bench_json_integer("query", c->views.at[p->query].scan);
    bench_json_integer("right", o->right);
    bench_json_integer("rank", o->rank);
    bench_json_integer("ceiling", ceiling);
    bench_json_integer("verdict", o->verdict);
    bench_json_number("trans_m", o->metres);
    bench_json_number("rot_deg", o->radians / CAIRN_DEGREE);
    bench_json_number("inside", o->inside);
    bench_json_number("ratio", o->ratio);
    bench_json_integer("units", o->units);
    bench_json_number("ms", o->ms);
    if (r->count > 0) {
        bench_json_number("overlap", (double)r->hypotheses[0].overlap);
        bench_json_number("contradiction", (double)r->hypotheses[0].free_space_violation);
        bench_json_number("score", (double)r->hypotheses[0].score);
        bench_json_number("sd_m", sqrt((double)(r->hypotheses[0].covariance[0] +
                                                r->hypotheses[0].covariance[4])));
        bench_json_number("sd_deg", sqrt((double)r->hypotheses[0].covariance[8]) / CAIRN_DEGREE);
        bench_json_number("evidence", (double)r->hypotheses[0].log_odds);
        bench_json_number("sigma", (double)r->hypotheses[0].sigma);
        bench_json_number("weak_ratio", (double)r->hypotheses[0].weak_ratio);
        bench_json_integer("paired", r->hypotheses[0].pairs);
        bench_json_number("second", r->count > 1 ? (double)r->hypotheses[1].score : 0);
    }
    bench_json_end();
}

/* ---- Output ---- */

typedef struct row {
    int32_t pairs, right, ceiling, both, inside, evaluated, found, found_right, ambiguous, none,
        listed;
    int32_t unrelated, unrelated_none;
    double *metres, *degrees, *ratios, *ms, *units; /* [pairs] */
    int32_t ratio_count;
    bench_reliability reliability; /* of the best hypotheses, by their log odds */
} row;

/* Adds the best hypothesis as a decision that is wrong with the probability of its log odds. */
static void add_decision(row *r, const cairn_scan_match_result *result, int wrong)
{
    if (result->count > 0)
        bench_reliability_add(&r->reliability,
                              1 / (1 + exp((double)result->hypotheses[0].log_odds)), wrong);
}

static void count_pair(row *r, const outcome *o)
{
    r->metres[r->pairs] = o->metres;
    r->degrees[r->pairs] = o->radians / CAIRN_DEGREE;
    r->ms[r->pairs] = o->ms;
    r->units[r->pairs] = (double)o->units;
    if (o->right && isfinite(o->ratio))
        r->ratios[r->ratio_count++] = o->ratio;
    r->pairs++;
    r->right += o->right;
    r->listed += o->rank > 0;
    r->found += o->verdict == CAIRN_SCAN_MATCH_FOUND;
    r->found_right += o->verdict == CAIRN_SCAN_MATCH_FOUND && o->right;
    r->ambiguous += o->verdict == CAIRN_SCAN_MATCH_AMBIGUOUS;
    r->none += o->verdict == CAIRN_SCAN_MATCH_NONE;
    if (o->verdict != CAIRN_SCAN_MATCH_NONE && o->count > 0) {
        r->evaluated++;
        r->inside += o->inside > 0;
    }
}

static double share(int32_t part, int32_t whole)
{
    return whole > 0 ? (double)part / whole : (double)NAN;
}

static void print_row(const settings *s, const char *name, const start_kind *kind, row *r,
                      size_t pool_bytes)
{
    size_t n = (size_t)r->pairs;
    double median_units = bench_median(r->units, n);

    bench_json_begin("pairs");
    bench_json_text("data", name);
    bench_json_text("method", s->method);
    if (s->mode != CAIRN_SCAN_MATCH_CORRELATIVE)
        bench_json_text("stages", STAGE_NAMES[s->mode - 1]);
    bench_json_text("start", kind->name);
    bench_json_integer("pairs", r->pairs);
    bench_json_number("success", share(r->right, r->pairs));
    bench_json_number("ceiling", share(r->ceiling, r->pairs));
    bench_json_number("listed", share(r->listed, r->pairs));
    bench_json_number("median_trans_m", bench_median(r->metres, n));
    bench_json_number("median_rot_deg", bench_median(r->degrees, n));
    bench_json_number("ratio_to_bound", bench_median(r->ratios, (size_t)r->ratio_count));
    bench_json_number("ms_median", bench_median(r->ms, n));
    bench_json_number("ms_p99", n > 0 ? r->ms[(n - 1) * 99 / 100] : (double)NAN);
    bench_json_number("ops_median", median_units);
    bench_json_number("ops_worst_over_median",
                      n > 0 ? r->units[n - 1] / median_units : (double)NAN);
    bench_json_number("inside95", share(r->inside, r->evaluated));
    bench_json_number("found", share(r->found, r->pairs));
    bench_json_number("found_right", share(r->found_right, r->found));
    bench_json_number("ambiguous", share(r->ambiguous, r->pairs));
    bench_json_number("none", share(r->none, r->pairs));
    bench_json_number("strangers_none", share(r->unrelated_none, r->unrelated));
    bench_json_integer("pool_bytes", (int64_t)pool_bytes);
    bench_json_true("summary");
    bench_json_end();
}

/* All pairs from one kind of start, and the unrelated pairs without a start. */
static int run_start(const settings *s, const char *name, const bench_collection *c,
                     const start_kind *kind)
{
    size_t n = (size_t)c->pair_count + 1;
    cairn_random random = cairn_random_seed((uint64_t)s->of.seed, 6);
    settings labelled = *s;
    row r;
    matcher m = {NULL, NULL, NULL, 0};
    double *values = malloc(5 * n * sizeof *values);
    int done = values != NULL && start_matcher(s, &c->views, &m);

    memset(&r, 0, sizeof r);
    labelled.start = kind->name;
    if (done) {
        r.metres = values;
        r.degrees = values + n;
        r.ratios = values + 2 * n;
        r.ms = values + 3 * n;
        r.units = values + 4 * n;
    }
    for (int32_t i = 0; i < c->pair_count && done; i++) {
        const bench_pair *p = &c->pairs[i];
        int ceiling = stays(&m, c, p);
        cairn_scan_match_result result;
        outcome o;

        done = run_pair(&m, c, p, kind, &random, &o);
        if (!done)
            break;
        count_pair(&r, &o);
        r.ceiling += ceiling;
        result = cairn_scan_match_read(m.match);
        add_decision(&r, &result, !o.right);
        if (s->each)
            print_each(&labelled, c, p, &o, &result, ceiling, 0);
    }
    for (int32_t i = 0; i < c->unrelated_count && done && (kind->metres < 0 || s->unrelated); i++) {
        cairn_scan_match_result result;
        outcome o;

        done = run_pair(&m, c, &c->unrelated[i], kind, &random, &o);
        r.unrelated++;
        r.unrelated_none += o.verdict == CAIRN_SCAN_MATCH_NONE;
        result = cairn_scan_match_read(m.match);
        if (done)
            add_decision(&r, &result, 1);
        if (s->each && done)
            print_each(&labelled, c, &c->unrelated[i], &o, &result, 0, 1);
    }
    if (done && s->reliability)
        bench_reliability_table(&r.reliability);
    else if (done)
        print_row(s, name, kind, &r, m.pool_bytes);
    else
        fprintf(stderr, "bench/pairs: no memory, or a match was refused\n");
    free(values);
    free(m.memory);
    return done;
}

static int run_collection(const settings *s, const char *name, bench_collection *c)
{
    int done = 1;

    for (size_t i = 0; i < sizeof STARTS / sizeof *STARTS; i++) {
        if (s->start != NULL && strcmp(s->start, STARTS[i].name) != 0)
            continue;
        for (int32_t k = s->ablate ? 0 : WHOLE; k < (s->ablate ? MAX_STAGES : WHOLE + 1) && done;
             k++) {
            settings one = *s;

            if (s->mode != CAIRN_SCAN_MATCH_CORRELATIVE)
                one.mode = STAGES[k];
            done = run_start(&one, name, c, &STARTS[i]);
        }
    }
    return done;
}

static int run_data(const settings *s, const char *name)
{
    bench_collection c;
    int collected = bench_pairs_collect(&s->of, &c), done = 0;

    if (collected)
        done = run_collection(s, name, &c);
    bench_pairs_free(&c);
    return collected ? !done : 3;
}

static int is_start(const char *name)
{
    for (size_t k = 0; k < sizeof STARTS / sizeof *STARTS; k++)
        if (strcmp(name, STARTS[k].name) == 0)
            return 1;
    return 0;
}

/* Default of --partners; the reference poses of fr079 lie closer. */
enum { PARTNERS = 10, FR079_PARTNERS = 59 };

/* A log of the data sets by its name: DIR/slam/NAME.clf.gz with NAME.corrected.txt. */
static int run_named(const settings *s, const char *name)
{
    char log[4096], truth[4096];
    settings one = *s;

    snprintf(log, sizeof log, "%s/slam/%s.clf.gz", s->data, name);
    snprintf(truth, sizeof truth, "%s/slam/%s.corrected.txt", s->data, name);
    one.of.log = log;
    one.of.truth = truth;
    if (one.of.partners == 0)
        one.of.partners = strcmp(name, "fr079") == 0 ? FR079_PARTNERS : PARTNERS;
    return run_data(&one, name);
}

int main(int argc, char **argv)
{
    static const char *const names[] = {"intel", "fr079", "aces"};
    settings s = {.of = {.pairs = 500, .seed = 1, .overlap = 0.3},
                  .data = "../shared/data",
                  .method = "correlative"};
    const option table[] = {
        OPTION_FLAG("--simulated", &s.of.simulated, "pairs of simulated arenas"),
        OPTION_FLAG("--places", &s.of.places,
                    "simulated: full circles at 16 places an arena, pairs that overlap enough"),
        OPTION_NUMBER("--overlap", &s.of.overlap, 0, 1, "SHARE",
                      "... share of the points of the second that the first sees"),
        OPTION_FLAG("--union", &s.of.unions,
                    "simulated: every one of the 16 places with all others of its arena"),
        OPTION_TEXT("--scene", &s.of.scene, "NAME",
                    "scene of the arenas (rescue, apartment and office in turn)"),
        OPTION_TEXT("--log", &s.of.log, "FILE",
                    "one CARMEN log; without --truth the name of one in DIR/slam (all three)"),
        OPTION_TEXT("--truth", &s.of.truth, "FILE",
                    "its reference poses, \"scan x y theta\" a line"),
        OPTION_TEXT("--data", &s.data, "DIR", "folder of the data sets (../shared/data)"),
        OPTION_TEXT("--start", &s.start, "NAME", "E, T, X or none (all)"),
        OPTION_TEXT("--method", &s.method, "NAME", "correlative or shape (correlative)"),
        OPTION_INTEGER("--pairs", &s.of.pairs, 1, 100000, "N", "pairs"),
        OPTION_INTEGER("--partners", &s.of.partners, 0, 1000, "N",
                       "the second scan is one of the next N with a reference pose (10; fr079 59)"),
        OPTION_INTEGER("--seed", &s.of.seed, 0, 9e15, "N",
                       "of the arenas, the pairs and their starts"),
        OPTION_INTEGER("--strangers", &s.unrelated, 0, 1, "N",
                       "1: pairs that share nothing at every start, not at none only"),
        OPTION_FLAG("--noise", &s.of.noise,
                    "overwrite the poses of the log with noise: nothing may change"),
        OPTION_FLAG("--ablate", &s.ablate, "the method shape after each of its stages"),
        OPTION_FLAG("--each", &s.each, "a line for every pair"),
        OPTION_FLAG("--reliability", &s.reliability,
                    "a table in Markdown instead: how often the best pose is wrong, by the "
                    "probability that its log odds state"),
    };
    const option_set set = {"bench/pairs",
                            "--simulated | [--log NAME | --log FILE --truth FILE] [options]",
                            "Scan matching of two scans, with or without a prior.", table,
                            sizeof table / sizeof *table};
    size_t words = 0;
    option_result result;
    int code = 0;

    result = options_read(&set, argc, argv, NULL, &words);
    if (result != OPTIONS_READ)
        return result;
    if (s.ablate)
        s.method = "shape";
    if (strcmp(s.method, "shape") == 0)
        s.mode = CAIRN_SCAN_MATCH_SHAPE;
    s.of.places |= s.of.unions;
    if (s.of.log == NULL && s.of.truth != NULL)
        return options_refuse("bench/pairs", "--truth without --log, expected both");
    if (s.start != NULL && !is_start(s.start))
        return options_refuse("bench/pairs", "--start is '%s', expected E, T, X or none", s.start);
    if (strcmp(s.method, "correlative") != 0 && strcmp(s.method, "shape") != 0)
        return options_refuse("bench/pairs", "--method is '%s', expected correlative or shape",
                              s.method);
    if (s.of.scene != NULL && sim_scene_find(s.of.scene) < 0)
        return options_refuse("bench/pairs", "--scene is '%s', expected one of cairn-arena's",
                              s.of.scene);
    if (s.of.log != NULL && s.of.truth == NULL && !s.of.simulated && !s.of.places)
        return run_named(&s, s.of.log);
    if (s.of.simulated || s.of.places || s.of.log != NULL) {
        s.of.partners = s.of.partners > 0 ? s.of.partners : PARTNERS;
        return run_data(&s, s.of.unions      ? "unions"
                            : s.of.places    ? "places"
                            : s.of.simulated ? "simulated"
                                             : cairn_output_path_name(s.of.log));
    }
    for (size_t i = 0; i < sizeof names / sizeof *names && code == 0; i++)
        code = run_named(&s, names[i]);
    return code;
}
