/* bench/graph: pose graphs from g2o files, and generated ones: chi2 before and after, time,
 * memory. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/bench_json.h"
#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "cairn/random.h"
#include "tools/options.h"

enum { MAX_FILES = 64 };

typedef struct settings {
    const char *data; /* NULL: the default */
    const char *solver;
    int32_t keep_all;
    int64_t generate; /* poses; 0: files */
    int64_t growth;   /* poses of the largest of four graphs; 0: none */
    int64_t repeat;   /* times that each of them is solved */
    int64_t wrong;    /* links added to a generated graph */
    uint64_t seed;
    const char *clean; /* the graph without wrong links; NULL: not known */
} settings;

typedef struct totals {
    int32_t files, outliers;
    double seconds;
} totals;

static cairn_pose noisy(cairn_pose pose, double sigma, cairn_random *random)
{
    cairn_real x = cairn_random_normal(random), y = cairn_random_normal(random),
               theta = cairn_random_normal(random);

    pose.x += (cairn_real)sigma * x;
    pose.y += (cairn_real)sigma * y;
    pose.theta += (cairn_real)(sigma / 2) * theta;
    return pose;
}

/* Generates a Manhattan-like graph: a robot drives parallel streets, one pose per metre, with a
 * loop-closure link to the neighbouring street every fourth metre; capacity for `more` further
 * links. */
static int generate(cairn_pose_graph_file *file, int32_t poses, int64_t more, uint64_t seed)
{
    const double sigma = 0.02;
    const cairn_sym3 information = {2500, 0, 0, 2500, 0, 10000};
    cairn_random random = cairn_random_seed(seed, 0);
    int32_t side = (int32_t)ceil(sqrt((double)poses));
    cairn_pose *truth = malloc((size_t)poses * sizeof *truth);

    memset(file, 0, sizeof *file);
    file->vertex = calloc((size_t)poses, sizeof *file->vertex);
    file->edge = calloc(2 * (size_t)poses + (size_t)more, sizeof *file->edge);
    if (truth == NULL || file->vertex == NULL || file->edge == NULL) {
        free(truth);
        return 0;
    }
    file->vertex_count = poses;
    for (int32_t i = 0; i < poses; i++) {
        int32_t row = i / side, column = row % 2 == 0 ? i % side : side - 1 - i % side;

        truth[i].x = (cairn_real)column;
        truth[i].y = (cairn_real)row;
        truth[i].theta = row % 2 == 0 ? 0 : CAIRN_PI;
        file->vertex[i].id = i;
        file->vertex[i].pose = truth[i];
        for (int32_t k = 0; k < 2; k++) {
            int32_t from = k == 0 ? i - 1 : i / side * side - 1 - i % side;
            cairn_pose_graph_file_edge *edge = &file->edge[file->edge_count];

            if (from < 0 || (k == 1 && column % 4 != 0))
                continue;
            edge->first = from;
            edge->second = i;
            edge->first_second = noisy(cairn_pose_between(truth[from], truth[i]), sigma, &random);
            edge->information = information;
            file->edge_count++;
            if (k == 0)
                file->vertex[i].pose =
                    cairn_pose_compose(file->vertex[from].pose, edge->first_second);
        }
    }
    free(truth);
    return 1;
}

/* Appends outlier links between random poses. */
static void add_wrong(cairn_pose_graph_file *file, int64_t wrong, uint64_t seed)
{
    const cairn_sym3 information = {2500, 0, 0, 2500, 0, 10000};
    cairn_random random = cairn_random_seed(seed, 1);

    for (int64_t k = 0; k < wrong; k++) {
        cairn_pose_graph_file_edge *edge = &file->edge[file->edge_count++];

        edge->first = cairn_random_below(&random, file->vertex_count - 1);
        edge->second =
            edge->first + 1 + cairn_random_below(&random, file->vertex_count - 1 - edge->first);
        edge->first_second.x = cairn_random_uniform(&random, -3, 3);
        edge->first_second.y = cairn_random_uniform(&random, -3, 3);
        edge->first_second.theta = cairn_random_uniform(&random, -CAIRN_PI, CAIRN_PI);
        edge->information = information;
    }
}

/* Sets a link: its ends and its measured relative pose. */
typedef struct named_link {
    int64_t first, second;
    double x, y, theta;
} named_link;

static int compare_links(const void *a, const void *b)
{
    const named_link *l = a, *m = b;

    if (l->first != m->first)
        return l->first < m->first ? -1 : 1;
    if (l->second != m->second)
        return l->second < m->second ? -1 : 1;
    if (l->x != m->x)
        return l->x < m->x ? -1 : 1;
    return l->y != m->y ? (l->y < m->y ? -1 : 1) : (l->theta > m->theta) - (l->theta < m->theta);
}

static named_link name_link(const cairn_pose_graph_file *file, int32_t e)
{
    const cairn_pose_graph_file_edge *edge = &file->edge[e];
    named_link link = {file->vertex[edge->first].id, file->vertex[edge->second].id,
                       (double)edge->first_second.x, (double)edge->first_second.y,
                       (double)edge->first_second.theta};

    return link;
}

/* Outlier links: those added to a generated graph, or absent from the clean one. NULL: not known,
 * or memory is insufficient. To be freed. */
static uint8_t *wrong_links(const settings *s, const cairn_pose_graph_file *file,
                            const cairn_pose_graph_file *clean)
{
    uint8_t *wrong = calloc((size_t)file->edge_count + 1, 1);
    named_link *links =
        clean != NULL ? malloc(((size_t)clean->edge_count + 1) * sizeof *links) : NULL;

    for (int32_t e = 0; wrong != NULL && clean == NULL && e < file->edge_count; e++)
        wrong[e] = e >= file->edge_count - s->wrong;
    if (links != NULL && wrong != NULL) {
        for (int32_t e = 0; e < clean->edge_count; e++)
            links[e] = name_link(clean, e);
        qsort(links, (size_t)clean->edge_count, sizeof *links, compare_links);
        for (int32_t e = 0; e < file->edge_count; e++) {
            named_link link = name_link(file, e);

            wrong[e] = bsearch(&link, links, (size_t)clean->edge_count, sizeof *links,
                               compare_links) == NULL;
        }
    }
    free(links);
    return wrong;
}

/* How many of the wrong and of the good links were dropped. */
static void print_dropped(const cairn_pose_graph_file *file,
                          const cairn_pose_graph_file_solution *out, const uint8_t *wrong)
{
    int32_t links[2] = {0, 0}, dropped[2] = {0, 0};

    for (int32_t e = 0; e < file->edge_count; e++) {
        links[wrong[e]]++;
        dropped[wrong[e]] += out->outlier[e] != 0;
    }
    bench_json_integer("wrong_links", links[1]);
    bench_json_number("wrong_dropped", links[1] > 0 ? (double)dropped[1] / links[1] : (double)NAN);
    bench_json_number("good_dropped", links[0] > 0 ? (double)dropped[0] / links[0] : (double)NAN);
}

static int solve(const settings *s, const char *name, const cairn_pose_graph_file *file,
                 const cairn_pose_graph_file *clean, totals *sum)
{
    uint8_t *wrong = s->wrong > 0 || clean != NULL ? wrong_links(s, file, clean) : NULL;
    cairn_pose_graph_file_solution out;
    double start = bench_seconds(), seconds;
    cairn_status status;

    memset(&out, 0, sizeof out);
    out.solver = strcmp(s->solver, "sparse") == 0 ? CAIRN_POSE_GRAPH_FILE_SPARSE
                                                  : CAIRN_POSE_GRAPH_FILE_BUILTIN;
    out.keep_all = s->keep_all;
    status = cairn_pose_graph_file_solve(file, &out);
    seconds = bench_seconds() - start;
    if (status != CAIRN_OK) {
        fprintf(stderr, "bench/graph: %s: %s\n", name, cairn_status_text(status));
        free(wrong);
        return status == CAIRN_UNSUPPORTED ? 3 : 2;
    }
    bench_json_begin("graph");
    bench_json_text("file", name);
    bench_json_text("solver", s->solver);
    bench_json_integer("poses", file->vertex_count);
    bench_json_integer("links", file->edge_count);
    bench_json_integer("fill", out.state.fill);
    bench_json_number("chi2_initial", out.chi2_initial);
    bench_json_number("chi2_final", (double)out.state.chi2);
    bench_json_integer("outliers", out.outliers);
    if (wrong != NULL)
        print_dropped(file, &out, wrong);
    free(wrong);
    bench_json_integer("iterations", out.state.iterations);
    bench_json_number("seconds", seconds);
    bench_json_integer("pool_bytes", (int64_t)out.pool_bytes);
    bench_json_end();
    sum->files++;
    sum->outliers += out.outliers;
    sum->seconds += seconds;
    cairn_pose_graph_file_solution_free(&out);
    return 0;
}

static int read_file(cairn_pose_graph_file *file, const char *path)
{
    cairn_file_error error;

    if (cairn_pose_graph_file_read(file, path, &error) == CAIRN_OK)
        return 0;
    fprintf(stderr, "bench/graph: %s\n", error.text);
    return error.status == CAIRN_IO ? 3 : 2;
}

/* clean_path: NULL when it is not known. */
static int solve_file(const settings *s, const char *path, const char *clean_path, totals *sum)
{
    cairn_pose_graph_file file, clean;
    int code = read_file(&file, path);

    if (code != 0)
        return code;
    code = clean_path != NULL ? read_file(&clean, clean_path) : 0;
    if (code == 0) {
        code =
            solve(s, cairn_output_path_name(path), &file, clean_path != NULL ? &clean : NULL, sum);
        if (clean_path != NULL)
            cairn_pose_graph_file_free(&clean);
    }
    cairn_pose_graph_file_free(&file);
    return code;
}

static int solve_data(const settings *s, totals *sum)
{
    static const struct {
        const char *name, *clean;
    } files[] = {
        {"intel.g2o", NULL},
        {"MIT.g2o", NULL},
        {"CSAIL.g2o", NULL},
        {"manhattanOlson3500.g2o", NULL},
        {"csail_two_robots/CSAIL_outliers.g2o", "csail_two_robots/CSAIL.g2o"},
    };
    const char *data = s->data != NULL ? s->data : "../shared/data";
    int code = 0;

    for (size_t k = 0; k < sizeof files / sizeof *files && code == 0; k++) {
        char path[1024], clean[1024];

        snprintf(path, sizeof path, "%s/posegraphs/%s", data, files[k].name);
        if (files[k].clean != NULL)
            snprintf(clean, sizeof clean, "%s/posegraphs/%s", data, files[k].clean);
        code = solve_file(s, path, files[k].clean != NULL ? clean : NULL, sum);
    }
    return code;
}

static int solve_generated(const settings *s, totals *sum)
{
    cairn_pose_graph_file file;
    int code = 2;

    if (generate(&file, (int32_t)s->generate, s->wrong, s->seed)) {
        add_wrong(&file, s->wrong, s->seed);
        code = solve(s, "generated", &file, NULL, sum);
    } else {
        fprintf(stderr, "bench/graph: no memory for %d poses\n", (int)s->generate);
    }
    cairn_pose_graph_file_free(&file);
    return code;
}

/* ---- Growth of time and memory ---- */

enum { SIZES = 4, MAX_REPEATS = 99 };

/* Processor time of one solution, < 0: refused. */
static double cpu_seconds(const settings *s, const cairn_pose_graph_file *file,
                          cairn_pose_graph_file_solution *out)
{
    clock_t start;
    cairn_status status;

    memset(out, 0, sizeof *out);
    out->solver = strcmp(s->solver, "sparse") == 0 ? CAIRN_POSE_GRAPH_FILE_SPARSE
                                                   : CAIRN_POSE_GRAPH_FILE_BUILTIN;
    start = clock();
    status = cairn_pose_graph_file_solve(file, out);
    if (status != CAIRN_OK) {
        fprintf(stderr, "bench/graph: %d poses: %s\n", (int)file->vertex_count,
                cairn_status_text(status));
        return -1;
    }
    cairn_pose_graph_file_solution_free(out);
    return (double)(clock() - start) / CLOCKS_PER_SEC;
}

/* Medians of graphs of an eighth, a fourth, half and all of the poses, solved in turn, and the
 * exponents between the ends. */
static int solve_growing(const settings *s)
{
    static double seconds[SIZES][MAX_REPEATS];
    cairn_pose_graph_file file[SIZES];
    cairn_pose_graph_file_solution out[SIZES];
    double median[SIZES], octaves = log((double)(1 << (SIZES - 1)));
    int made = 1;

    for (int32_t k = 0; k < SIZES; k++)
        made = generate(&file[k], (int32_t)(s->growth >> (SIZES - 1 - k)), 0, s->seed) && made;
    for (int32_t r = 0; r < s->repeat && made; r++)
        for (int32_t k = 0; k < SIZES && made; k++) {
            seconds[k][r] = cpu_seconds(s, &file[k], &out[k]);
            made = seconds[k][r] >= 0;
        }
    for (int32_t k = 0; k < SIZES && made; k++) {
        median[k] = bench_median(seconds[k], (size_t)s->repeat);
        bench_json_begin("graph");
        bench_json_text("solver", s->solver);
        bench_json_integer("poses", file[k].vertex_count);
        bench_json_integer("links", file[k].edge_count);
        bench_json_integer("fill", out[k].state.fill);
        bench_json_number("chi2_final", (double)out[k].state.chi2);
        bench_json_integer("iterations", out[k].state.iterations);
        bench_json_number("seconds", median[k]);
        bench_json_number("microseconds_per_pose", 1e6 * median[k] / file[k].vertex_count);
        bench_json_integer("pool_bytes", (int64_t)out[k].pool_bytes);
        bench_json_end();
    }
    if (made) {
        bench_json_begin("graph");
        bench_json_integer("sizes", SIZES);
        bench_json_integer("repeat", s->repeat);
        bench_json_number("exponent_seconds", log(median[SIZES - 1] / median[0]) / octaves);
        bench_json_number("exponent_bytes",
                          log((double)out[SIZES - 1].pool_bytes / (double)out[0].pool_bytes) /
                              octaves);
        bench_json_true("summary");
        bench_json_end();
    }
    for (int32_t k = 0; k < SIZES; k++)
        cairn_pose_graph_file_free(&file[k]);
    return made ? 0 : 2;
}

/* Rejects options that --growth does not use. */
static int growth_is_alone(const settings *s, size_t files)
{
    const struct {
        int given;
        const char *name;
    } others[] = {{files > 0, "files"},        {s->data != NULL, "--data"},
                  {s->keep_all, "--keep-all"}, {s->generate > 0, "--generate"},
                  {s->wrong > 0, "--wrong"},   {s->clean != NULL, "--clean"}};

    for (size_t k = 0; k < sizeof others / sizeof *others; k++)
        if (others[k].given) {
            fprintf(stderr, "bench/graph: --growth does not go with %s\n", others[k].name);
            return 0;
        }
    return 1;
}

int main(int argc, char **argv)
{
    settings s = {NULL, "builtin", 0, 0, 0, 5, 0, 1, NULL};
    const option table[] = {
        OPTION_TEXT("--data", &s.data, "DIR", "folder of the data sets (../shared/data)"),
        OPTION_TEXT("--solver", &s.solver, "NAME", "builtin, or sparse: SuiteSparse"),
        OPTION_FLAG("--keep-all", &s.keep_all, "least squares of all links"),
        OPTION_INTEGER("--generate", &s.generate, 2, 4000000, "N",
                       "a generated graph of N poses, no files"),
        OPTION_INTEGER("--growth", &s.growth, 16, 4000000, "N",
                       "generated graphs of N / 8, N / 4, N / 2 and N poses"),
        OPTION_INTEGER("--repeat", &s.repeat, 1, MAX_REPEATS, "N",
                       "times that each of these is solved (5)"),
        OPTION_INTEGER("--wrong", &s.wrong, 0, 4000000, "N",
                       "wrong links added to the generated graph"),
        OPTION_TEXT("--clean", &s.clean, "FILE.g2o",
                    "the graph of the files without their wrong links"),
        OPTION_SEED("--seed", &s.seed, "of the generated graph"),
    };
    const option_set set = {"bench/graph", "[FILE.g2o ...] [options]",
                            "Solves pose graphs: the files given, or those of the data sets.",
                            table, sizeof table / sizeof *table};
    const char *words[MAX_FILES];
    size_t count = MAX_FILES;
    option_result result = options_read(&set, argc, argv, words, &count);
    totals sum = {0, 0, 0};
    int code = 0;

    if (result != OPTIONS_READ)
        return (int)result;
    if (s.growth > 0)
        return growth_is_alone(&s, count) ? solve_growing(&s) : (int)OPTIONS_BAD;
    if (s.generate > 0)
        code = solve_generated(&s, &sum);
    else if (count == 0)
        code = solve_data(&s, &sum);
    for (size_t k = 0; k < count && code == 0; k++)
        code = solve_file(&s, words[k], s.clean, &sum);
    if (code != 0)
        return code;
    bench_json_begin("graph");
    bench_json_integer("files", sum.files);
    bench_json_integer("outliers", sum.outliers);
    bench_json_number("seconds", sum.seconds);
    bench_json_true("summary");
    bench_json_end();
    return 0;
}
