/* cairn graph: robust optimization of a pose graph. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "tools/cairn_tool.h"

#define PROGRAM "cairn graph"

typedef struct settings {
    const char *graph, *output, *solver;
    int32_t report, keep_all, json, quiet;
} settings;

static option_result read_settings(settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->output, "FILE", "the graph with the optimized poses (g2o)"),
        OPTION_FLAG("--report", &s->report,
                    "lists every outlier link, and draws the graph before and after the "
                    "optimization beside the output "
                    "(FILE.svg)"),
        OPTION_FLAG("--keep-all", &s->keep_all, "least squares of all links, no outlier rejection"),
        OPTION_TEXT("--solver", &s->solver, "NAME",
                    "linear solver: builtin, or sparse (SuiteSparse)"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no summary"),
    };
    const option_set set = {PROGRAM, "FILE.g2o -o FILE.g2o [options]",
                            "Optimizes a pose graph in the plane (g2o: VERTEX_SE2, EDGE_SE2, FIX), "
                            "from the poses of the "
                            "file or from a chordal initialization, whichever has the smaller "
                            "error. Outlier links are "
                            "found with a robust kernel, listed and left out.",
                            table, sizeof table / sizeof *table};
    const char *words[1] = {NULL};
    size_t count = 1;
    option_result result = options_read(&set, argc, argv, words, &count);

    if (result != OPTIONS_READ)
        return result;
    if (count < 1)
        return (option_result)options_refuse(PROGRAM, "no graph, expected %s", set.synopsis);
    if (s->output == NULL && s->report)
        return (option_result)options_refuse(PROGRAM,
                                             "--report without -o, expected an output file");
    if (strcmp(s->solver, "builtin") != 0 && strcmp(s->solver, "sparse") != 0)
        return (option_result)options_refuse(PROGRAM, "--solver %s, expected builtin or sparse",
                                             s->solver);
    s->graph = words[0];
    return OPTIONS_READ;
}

static const char *verdict_text(const cairn_pose_graph_state *state)
{
    switch (state->verdict) {
    case CAIRN_POSE_GRAPH_CONVERGED:
        return "converged";
    case CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS:
        return "out of iterations";
    case CAIRN_POSE_GRAPH_DISCONNECTED:
        return "disconnected without the outlier links";
    default:
        return "singular";
    }
}

static void print_summary(const settings *s, const cairn_pose_graph_file *file,
                          const cairn_pose_graph_file_solution *out, double seconds)
{
    printf("poses      %" PRId32 "%s\n"
           "links      %" PRId32 "\n"
           "chi2       %.9g -> %.9g\n"
           "outliers   %" PRId32 "%s\n"
           "initial    %s\n"
           "iterations %" PRId32 " (%s)\n"
           "seconds    %.3f\n"
           "memory     %zu bytes (%s)\n",
           file->vertex_count, file->chained ? " (composed from the links: the file has none)" : "",
           file->edge_count, out->chi2_initial, (double)out->state.chi2, out->outliers,
           out->outliers > 0 ? " links rejected; chi2 is that of the inliers" : "",
           out->state.chordal ? "chordal" : "as given", out->state.iterations,
           verdict_text(&out->state), seconds, out->pool_bytes, s->solver);
}

static void print_outliers(const settings *s, const cairn_pose_graph_file *file,
                           const cairn_pose_graph_file_solution *out)
{
    for (int32_t e = 0; e < file->edge_count; e++)
        if (out->outlier[e])
            printf("%s:%" PRId64 ": link %" PRId64 " -> %" PRId64 " rejected\n", s->graph,
                   file->edge[e].line, file->vertex[file->edge[e].first].id,
                   file->vertex[file->edge[e].second].id);
}

static void print_json(const settings *s, const cairn_pose_graph_file *file,
                       const cairn_pose_graph_file_solution *out, double seconds)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_text(&json, "graph", s->graph);
    cairn_json_write_integer(&json, "poses", file->vertex_count);
    cairn_json_write_boolean(&json, "composed", file->chained);
    cairn_json_write_integer(&json, "links", file->edge_count);
    cairn_json_write_number(&json, "chi2_initial", out->chi2_initial);
    cairn_json_write_number(&json, "chi2_final", (double)out->state.chi2);
    cairn_json_write_text(&json, "initial", out->state.chordal ? "chordal" : "given");
    cairn_json_write_integer(&json, "iterations", out->state.iterations);
    cairn_json_write_text(&json, "verdict", verdict_text(&out->state));
    cairn_json_write_number(&json, "seconds", seconds);
    cairn_json_write_integer(&json, "pool_bytes", (int64_t)out->pool_bytes);
    cairn_json_write_text(&json, "solver", s->solver);
    cairn_json_write_array(&json, "outliers");
    for (int32_t e = 0; e < file->edge_count; e++) {
        if (!out->outlier[e])
            continue;
        cairn_json_write_object(&json, NULL);
        cairn_json_write_integer(&json, "line", file->edge[e].line);
        cairn_json_write_integer(&json, "first", file->vertex[file->edge[e].first].id);
        cairn_json_write_integer(&json, "second", file->vertex[file->edge[e].second].id);
        cairn_json_write_object_end(&json);
    }
    cairn_json_write_array_end(&json);
    cairn_json_write_end(&json);
}

/* Returns the path of the picture, "map.g2o" -> "map.svg", on the heap; NULL: no memory. */
static char *picture_path(const char *output)
{
    size_t length = strlen(output);
    char *path = malloc(length + 5);

    if (length > 4 && strcmp(output + length - 4, ".g2o") == 0)
        length -= 4;
    if (path != NULL)
        snprintf(path, length + 5, "%.*s.svg", (int)length, output);
    return path;
}

static int draw(const settings *s, const cairn_pose_graph_file *file,
                const cairn_pose_graph_file_solution *out)
{
    char *path = picture_path(s->output);
    cairn_file_error error;
    cairn_status status;

    if (path == NULL)
        return TOOL_FAILED;
    status = cairn_pose_graph_file_draw(path, file, out, cairn_output_path_name(s->graph), &error);
    free(path);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

static int write_all(const settings *s, cairn_pose_graph_file *file,
                     const cairn_pose_graph_file_solution *out)
{
    cairn_file_error error;
    int code = TOOL_OK;

    if (s->output == NULL)
        return TOOL_OK;
    if (s->report)
        code = draw(s, file, out);
    if (code != TOOL_OK)
        return code;
    for (int32_t v = 0; v < file->vertex_count; v++)
        file->vertex[v].pose = out->pose[v];
    return cairn_pose_graph_file_write(s->output, file, &error) == CAIRN_OK ? TOOL_OK
                                                                            : tool_report(&error);
}

int tool_graph(int argc, char **argv)
{
    settings s = {.solver = "builtin"};
    cairn_pose_graph_file_solution out;
    option_result result = read_settings(&s, argc, argv);
    cairn_pose_graph_file file;
    cairn_file_error error;
    cairn_status status;
    double start;
    int code;

    if (result != OPTIONS_READ)
        return (int)result;
    if (cairn_pose_graph_file_read(&file, s.graph, &error) != CAIRN_OK)
        return tool_report(&error);
    memset(&out, 0, sizeof out);
    out.solver = strcmp(s.solver, "sparse") == 0 ? CAIRN_POSE_GRAPH_FILE_SPARSE
                                                 : CAIRN_POSE_GRAPH_FILE_BUILTIN;
    out.keep_all = s.keep_all;
    start = tool_seconds();
    status = cairn_pose_graph_file_solve(&file, &out);
    if (status != CAIRN_OK) {
        (void)options_refuse(
            PROGRAM, "%s: %s", s.graph,
            status == CAIRN_UNSUPPORTED
                ? "SuiteSparse is not installed (tools/deps.sh solver), expected --solver builtin"
                : cairn_status_text(status));
        code = tool_exit_code(status);
    } else {
        double seconds = tool_seconds() - start;

        code = write_all(&s, &file, &out);
        if (code == TOOL_OK && s.json)
            print_json(&s, &file, &out, seconds);
        else if (code == TOOL_OK && !s.quiet)
            print_summary(&s, &file, &out, seconds);
        if (code == TOOL_OK && s.report && !s.json)
            print_outliers(&s, &file, &out);
    }
    cairn_pose_graph_file_solution_free(&out);
    cairn_pose_graph_file_free(&file);
    return code;
}
