/* bench/graph: pose graphs from g2o files, and generated ones: chi2 before and after, time, memory. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "cairn/random.h"
#include "tools/options.h"

enum { FILES_MOST = 64 };

typedef struct settings {
    const char *data, *solver;
    int32_t keep_all;
    int64_t generate; /* poses; 0: files */
    uint64_t seed;
} settings;

typedef struct totals {
    int32_t files, outliers;
    double seconds;
} totals;

static cairn_pose noisy(cairn_pose pose, double sigma, cairn_random *random)
{
    cairn_real x = cairn_random_normal(random), y = cairn_random_normal(random), theta = cairn_random_normal(random);

    pose.x += (cairn_real)sigma * x;
    pose.y += (cairn_real)sigma * y;
    pose.theta += (cairn_real)(sigma / 2) * theta;
    return pose;
}

/* A robot that drives a square of streets up and down, one pose a metre, and every fourth metre sees the street beside. */
static int generate(cairn_pose_graph_file *file, int32_t poses, uint64_t seed)
{
    const double sigma = 0.02;
    const cairn_sym3 information = {2500, 0, 0, 2500, 0, 10000};
    cairn_random random = cairn_random_seed(seed, 0);
    int32_t side = (int32_t)ceil(sqrt((double)poses));
    cairn_pose *truth = malloc((size_t)poses * sizeof *truth);

    memset(file, 0, sizeof *file);
    file->vertex = calloc((size_t)poses, sizeof *file->vertex);
    file->edge = calloc(2 * (size_t)poses, sizeof *file->edge);
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
            cairn_pose_graph_edge *edge = &file->edge[file->edge_count];

            if (from < 0 || (k == 1 && column % 4 != 0))
                continue;
            edge->first = from;
            edge->second = i;
            edge->first_second = noisy(cairn_pose_between(truth[from], truth[i]), sigma, &random);
            edge->information = information;
            file->edge_count++;
            if (k == 0)
                file->vertex[i].pose = cairn_pose_compose(file->vertex[from].pose, edge->first_second);
        }
    }
    free(truth);
    return 1;
}

static int solve(const settings *s, const char *name, const cairn_pose_graph_file *file, totals *sum)
{
    cairn_pose_graph_solution out;
    double start = bench_seconds(), seconds;
    cairn_status status;

    memset(&out, 0, sizeof out);
    out.solver = strcmp(s->solver, "sparse") == 0 ? CAIRN_POSE_GRAPH_SPARSE : CAIRN_POSE_GRAPH_BUILTIN;
    out.keep_all = s->keep_all;
    status = cairn_pose_graph_file_solve(file, &out);
    seconds = bench_seconds() - start;
    if (status != CAIRN_OK) {
        fprintf(stderr, "bench/graph: %s: %s\n", name, cairn_status_text(status));
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
    bench_json_integer("iterations", out.state.iterations);
    bench_json_number("seconds", seconds);
    bench_json_integer("pool_bytes", (int64_t)out.pool_bytes);
    bench_json_end();
    sum->files++;
    sum->outliers += out.outliers;
    sum->seconds += seconds;
    cairn_pose_graph_solution_free(&out);
    return 0;
}

static int solve_file(const settings *s, const char *path, totals *sum)
{
    cairn_pose_graph_file file;
    cairn_file_error error;
    int code;

    if (cairn_pose_graph_file_read(&file, path, &error) != CAIRN_OK) {
        fprintf(stderr, "bench/graph: %s\n", error.text);
        return error.status == CAIRN_IO ? 3 : 2;
    }
    code = solve(s, cairn_path_name(path), &file, sum);
    cairn_pose_graph_file_free(&file);
    return code;
}

static int solve_data(const settings *s, totals *sum)
{
    static const char *const names[] = {"intel.g2o", "MIT.g2o", "CSAIL.g2o", "manhattanOlson3500.g2o",
                                        "csail_two_robots/CSAIL_outliers.g2o"};
    int code = 0;

    for (size_t k = 0; k < sizeof names / sizeof *names && code == 0; k++) {
        char path[1024];

        snprintf(path, sizeof path, "%s/posegraphs/%s", s->data, names[k]);
        code = solve_file(s, path, sum);
    }
    return code;
}

static int solve_generated(const settings *s, totals *sum)
{
    cairn_pose_graph_file file;
    int code = 2;

    if (generate(&file, (int32_t)s->generate, s->seed))
        code = solve(s, "generated", &file, sum);
    else
        fprintf(stderr, "bench/graph: no memory for %d poses\n", (int)s->generate);
    cairn_pose_graph_file_free(&file);
    return code;
}

int main(int argc, char **argv)
{
    settings s = {"../shared/data", "builtin", 0, 0, 1};
    const option table[] = {
        OPTION_TEXT("--data", &s.data, "DIR", "folder of the data sets (../shared/data)"),
        OPTION_TEXT("--solver", &s.solver, "NAME", "builtin, or sparse: SuiteSparse"),
        OPTION_FLAG("--keep-all", &s.keep_all, "least squares of all links"),
        OPTION_INTEGER("--generate", &s.generate, 2, 4000000, "N", "a generated graph of N poses, no files"),
        OPTION_SEED("--seed", &s.seed, "of the generated graph"),
    };
    const option_set set = {"bench/graph", "[FILE.g2o ...] [options]",
                            "Solves pose graphs: the files given, or those of the data sets.", table,
                            sizeof table / sizeof *table};
    const char *words[FILES_MOST];
    size_t count = FILES_MOST;
    option_result result = options_read(&set, argc, argv, words, &count);
    totals sum = {0, 0, 0};
    int code = 0;

    if (result != OPTIONS_READ)
        return (int)result;
    if (s.generate > 0)
        code = solve_generated(&s, &sum);
    else if (count == 0)
        code = solve_data(&s, &sum);
    for (size_t k = 0; k < count && code == 0; k++)
        code = solve_file(&s, words[k], &sum);
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
