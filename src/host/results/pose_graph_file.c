/* g2o files: reading, validation, writing. Solving and drawing are in pose_graph_file_solve.c and
 * pose_graph_file_draw.c.
 *
 * Method
 * 1. Lines become vertices and edges that refer to vertices by id.
 * 2. Vertices are sorted by id, and ids of edges are resolved to indices by binary search.
 * 3. Connectivity is checked by union-find over the edges, which also gives a spanning tree.
 * 4. Without vertex lines, initial poses are composed along the spanning tree by breadth-first
 *    search. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "src/containers/counting_sort.h"
#include "src/containers/disjoint_sets.h"
#include "src/host/logs/carmen_log_reader.h"

/* Fields of the longest line, EDGE_SE2. */
enum { MAX_FIELDS = 12 };

typedef struct field_token {
    const char *text;
    size_t length;
} field_token;

/* An edge with ids that are not resolved yet. */
typedef struct raw_edge {
    int64_t first, second;
    cairn_pose_graph_file_edge edge;
} raw_edge;

/* State of the reader. */
typedef struct graph_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    cairn_pose_graph_file_vertex *vertex;
    raw_edge *edge;
    cairn_pose_graph_file_vertex *fix; /* ids and lines of FIX lines */
    int32_t vertices, vertex_capacity, edges, edge_capacity, fixes, fix_capacity;
} graph_reader;

static cairn_status bad_line(const graph_reader *reader, const char *what)
{
    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                cairn_line_reader_number(reader->lines), "%s", what);
}

/* Grows a dynamic array, whose capacity doubles, for one more element. */
static cairn_status reserve_element(const graph_reader *reader, void *array, int32_t count,
                                    int32_t *capacity, size_t size)
{
    int32_t new_capacity = *capacity == 0              ? 1024
                           : *capacity < INT32_MAX / 2 ? 2 * *capacity
                                                       : INT32_MAX;
    void *old, *grown;

    if (count < *capacity)
        return CAIRN_OK;
    memcpy(&old, array, sizeof old);
    grown = count < INT32_MAX ? realloc(old, (size_t)new_capacity * size) : NULL;
    if (grown == NULL)
        return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
    memcpy(array, &grown, sizeof grown);
    *capacity = new_capacity;
    return CAIRN_OK;
}

static cairn_status read_id(const graph_reader *reader, field_token token, int64_t *id)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    if (cairn_number_read_integer(token.text, token.length, id) && *id >= 0)
        return CAIRN_OK;
    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                cairn_line_reader_number(reader->lines),
                                "%s is not a vertex id, expected a whole number from 0",
                                cairn_token_text(shown, token.text, token.length));
}

static cairn_status read_numbers(const graph_reader *reader, const field_token *tokens,
                                 int32_t count, cairn_real *value)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    double number;

    for (int32_t k = 0; k < count; k++) {
        if (!cairn_number_read(tokens[k].text, tokens[k].length, &number))
            return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path,
                                        cairn_line_reader_number(reader->lines),
                                        "%s, expected a number",
                                        cairn_token_text(shown, tokens[k].text, tokens[k].length));
        value[k] = (cairn_real)number;
        if (!cairn_is_finite(value[k]))
            return cairn_file_error_set(reader->error, CAIRN_NOT_FINITE, reader->path,
                                        cairn_line_reader_number(reader->lines),
                                        "%s, expected a finite number",
                                        cairn_token_text(shown, tokens[k].text, tokens[k].length));
    }
    return CAIRN_OK;
}

/* Parses a VERTEX_SE2 line. */
static cairn_status read_vertex(graph_reader *reader, const field_token *tokens, int32_t count)
{
    cairn_pose_graph_file_vertex vertex = {.line = cairn_line_reader_number(reader->lines)};
    cairn_real value[3];
    cairn_status status;

    if (count != 5)
        return bad_line(reader,
                        "a VERTEX_SE2 with fields missing or too many, expected id x y theta");
    status = read_id(reader, tokens[1], &vertex.id);
    if (status == CAIRN_OK)
        status = read_numbers(reader, &tokens[2], 3, value);
    if (status == CAIRN_OK)
        status = reserve_element(reader, &reader->vertex, reader->vertices,
                                 &reader->vertex_capacity, sizeof vertex);
    if (status != CAIRN_OK)
        return status;
    vertex.pose.x = value[0];
    vertex.pose.y = value[1];
    vertex.pose.theta = value[2];
    reader->vertex[reader->vertices++] = vertex;
    return CAIRN_OK;
}

/* Parses an EDGE_SE2 line and checks that its information matrix is positive definite. */
static cairn_status read_edge(graph_reader *reader, const field_token *tokens, int32_t count)
{
    cairn_real value[9];
    cairn_sym3 inverse;
    cairn_status status;
    raw_edge raw;

    memset(&raw, 0, sizeof raw);
    if (count != 12)
        return bad_line(reader,
                        "an EDGE_SE2 with fields missing or too many, expected two ids, x y "
                        "theta and six numbers of "
                        "the information matrix");
    status = read_id(reader, tokens[1], &raw.first);
    if (status == CAIRN_OK)
        status = read_id(reader, tokens[2], &raw.second);
    if (status == CAIRN_OK)
        status = read_numbers(reader, &tokens[3], 9, value);
    if (status != CAIRN_OK)
        return status;
    if (raw.first == raw.second)
        return bad_line(reader, "an edge from a vertex to itself, expected two vertices");
    raw.edge.line = cairn_line_reader_number(reader->lines);
    raw.edge.first_second.x = value[0];
    raw.edge.first_second.y = value[1];
    raw.edge.first_second.theta = value[2];
    raw.edge.information.xx = value[3];
    raw.edge.information.xy = value[4];
    raw.edge.information.xz = value[5];
    raw.edge.information.yy = value[6];
    raw.edge.information.yz = value[7];
    raw.edge.information.zz = value[8];
    if (!cairn_sym3_inverse(raw.edge.information, &inverse))
        return bad_line(reader,
                        "an information matrix that is singular or has a negative eigenvalue, "
                        "expected a positive "
                        "definite one");
    status =
        reserve_element(reader, &reader->edge, reader->edges, &reader->edge_capacity, sizeof raw);
    if (status == CAIRN_OK)
        reader->edge[reader->edges++] = raw;
    return status;
}

/* Parses a FIX line. */
static cairn_status read_fix(graph_reader *reader, const field_token *tokens, int32_t count)
{
    cairn_pose_graph_file_vertex fix = {.line = cairn_line_reader_number(reader->lines),
                                        .fixed = 1};
    cairn_status status = CAIRN_OK;

    if (count < 2)
        return bad_line(reader, "FIX without a vertex, expected its id");
    for (int32_t k = 1; k < count && status == CAIRN_OK; k++) {
        status = read_id(reader, tokens[k], &fix.id);
        if (status == CAIRN_OK)
            status = reserve_element(reader, &reader->fix, reader->fixes, &reader->fix_capacity,
                                     sizeof fix);
        if (status == CAIRN_OK)
            reader->fix[reader->fixes++] = fix;
    }
    return status;
}

static int is_word(field_token token, const char *word)
{
    return token.length == strlen(word) && memcmp(token.text, word, token.length) == 0;
}

static cairn_status read_line(graph_reader *reader, const char *line, size_t length)
{
    const char *end = line + length;
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    field_token tokens[MAX_FIELDS + 1];
    int32_t count = 0;

    while (count <= MAX_FIELDS &&
           (tokens[count].length = cairn_token_next(&line, end, &tokens[count].text)) > 0)
        count++;
    if (count == 0 || tokens[0].text[0] == '#')
        return CAIRN_OK;
    if (is_word(tokens[0], "VERTEX_SE2"))
        return read_vertex(reader, tokens, count);
    if (is_word(tokens[0], "EDGE_SE2"))
        return read_edge(reader, tokens, count);
    if (is_word(tokens[0], "FIX"))
        return read_fix(reader, tokens, count);
    return cairn_file_error_set(reader->error, CAIRN_UNSUPPORTED, reader->path,
                                cairn_line_reader_number(reader->lines),
                                "%s, expected VERTEX_SE2, EDGE_SE2 or FIX",
                                cairn_token_text(shown, tokens[0].text, tokens[0].length));
}

/* ---- Vertices ---- */

static int compare_vertices(const void *a, const void *b)
{
    const cairn_pose_graph_file_vertex *first = a, *second = b;

    if (first->id != second->id)
        return first->id < second->id ? -1 : 1;
    return first->line < second->line ? -1 : first->line > second->line;
}

/* Returns the index of a vertex by binary search; -1: unknown. */
static int32_t find_vertex(const graph_reader *reader, int64_t id)
{
    int32_t low = 0, high = reader->vertices;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (reader->vertex[middle].id < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low < reader->vertices && reader->vertex[low].id == id ? low : -1;
}

/* Collects the distinct vertices that the edges refer to. */
static cairn_status collect_vertices(graph_reader *reader)
{
    int32_t kept = 0;

    for (int32_t e = 0; e < 2 * reader->edges; e++) {
        cairn_pose_graph_file_vertex vertex = {.id = e % 2 == 0 ? reader->edge[e / 2].first
                                                                : reader->edge[e / 2].second,
                                               .line = reader->edge[e / 2].edge.line};
        cairn_status status = reserve_element(reader, &reader->vertex, reader->vertices,
                                              &reader->vertex_capacity, sizeof vertex);

        if (status != CAIRN_OK)
            return status;
        reader->vertex[reader->vertices++] = vertex;
    }
    qsort(reader->vertex, (size_t)reader->vertices, sizeof *reader->vertex, compare_vertices);
    for (int32_t v = 0; v < reader->vertices; v++)
        if (kept == 0 || reader->vertex[kept - 1].id != reader->vertex[v].id)
            reader->vertex[kept++] = reader->vertex[v];
    reader->vertices = kept;
    return CAIRN_OK;
}

/* Sorts the vertices by id and checks for duplicates. */
static cairn_status sort_vertices(graph_reader *reader)
{
    qsort(reader->vertex, (size_t)reader->vertices, sizeof *reader->vertex, compare_vertices);
    for (int32_t v = 1; v < reader->vertices; v++)
        if (reader->vertex[v].id == reader->vertex[v - 1].id)
            return cairn_file_error_set(
                reader->error, CAIRN_BAD_FORMAT, reader->path, reader->vertex[v].line,
                "duplicate vertex %lld, expected unique ids (first on line %lld)",
                (long long)reader->vertex[v].id, (long long)reader->vertex[v - 1].line);
    return CAIRN_OK;
}

static cairn_status report_missing_vertex(const graph_reader *reader, int64_t line,
                                          const char *what, int64_t id)
{
    return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, line,
                                "%s vertex %lld, expected one that a VERTEX_SE2 line gives", what,
                                (long long)id);
}

/* Replaces ids by indices of vertices. */
static cairn_status resolve_ids(graph_reader *reader)
{
    for (int32_t e = 0; e < reader->edges; e++) {
        raw_edge *raw = &reader->edge[e];

        raw->edge.first = find_vertex(reader, raw->first);
        raw->edge.second = find_vertex(reader, raw->second);
        if (raw->edge.first < 0 || raw->edge.second < 0)
            return report_missing_vertex(reader, raw->edge.line, "an edge with",
                                         raw->edge.first < 0 ? raw->first : raw->second);
    }
    for (int32_t f = 0; f < reader->fixes; f++) {
        int32_t v = find_vertex(reader, reader->fix[f].id);

        if (v < 0)
            return report_missing_vertex(reader, reader->fix[f].line, "FIX of", reader->fix[f].id);
        reader->vertex[v].fixed = 1;
    }
    return CAIRN_OK;
}

/* ---- Connected components and composed poses ---- */

/* Marks the edges of a spanning forest, edges between consecutive ids first. *components: the
 * number of connected components. */
static void mark_spanning_forest(const graph_reader *reader, int32_t *root, uint8_t *in_tree,
                                 int32_t *components)
{
    *components = reader->vertices;
    disjoint_sets_reset(root, reader->vertices);
    for (int round = 0; round < 2; round++)
        for (int32_t e = 0; e < reader->edges; e++) {
            int64_t id_difference = reader->edge[e].first - reader->edge[e].second;

            if ((round == 1 || id_difference == 1 || id_difference == -1) &&
                disjoint_sets_unite(root, reader->edge[e].edge.first,
                                    reader->edge[e].edge.second)) {
                in_tree[e] = 1;
                --*components;
            }
        }
}

/* Composes the initial poses along the spanning tree by breadth-first search, with the first vertex
 * at the origin. start, list: adjacency of the tree by compressed rows; via: the edge to a
 * vertex. */
static void compose_poses(const graph_reader *reader, const uint8_t *in_tree, int32_t *start,
                          int32_t *list, int32_t *queue, int32_t *via)
{
    int32_t reached = 1;

    counting_sort_reset(start, 0, reader->vertices + 1);
    for (int32_t e = 0; e < reader->edges; e++)
        if (in_tree[e]) {
            counting_sort_count(start, reader->edge[e].edge.first);
            counting_sort_count(start, reader->edge[e].edge.second);
        }
    counting_sort_sum(start, 0, reader->vertices + 1);
    for (int32_t e = reader->edges - 1; e >= 0; e--)
        if (in_tree[e]) {
            list[counting_sort_place(start, reader->edge[e].edge.first)] = e;
            list[counting_sort_place(start, reader->edge[e].edge.second)] = e;
        }
    queue[0] = 0;
    via[0] = -1;
    for (int32_t at = 0; at < reached; at++)
        for (int32_t k = start[queue[at]]; k < start[queue[at] + 1]; k++) {
            const cairn_pose_graph_file_edge *edge = &reader->edge[list[k]].edge;
            int32_t from = queue[at], to = edge->first == from ? edge->second : edge->first;
            cairn_pose step =
                edge->first == from ? edge->first_second : cairn_pose_inverse(edge->first_second);

            if (list[k] == via[from])
                continue;
            reader->vertex[to].pose = cairn_pose_compose(reader->vertex[from].pose, step);
            via[to] = list[k];
            queue[reached++] = to;
        }
}

/* Checks that the graph is connected and, if `chained`, composes its initial poses. */
static cairn_status check_connected(graph_reader *reader, int32_t chained)
{
    size_t vertices = (size_t)reader->vertices, edges = (size_t)reader->edges;
    int32_t *root = malloc((vertices + 1) * sizeof *root),
            *queue = malloc((vertices + 1) * sizeof *queue);
    int32_t *list = malloc(2 * (edges + 1) * sizeof *list),
            *via = malloc((vertices + 1) * sizeof *via), components;
    uint8_t *in_tree = calloc(edges + 1, 1);
    cairn_status status = CAIRN_OK;

    if (root == NULL || queue == NULL || list == NULL || via == NULL || in_tree == NULL) {
        status = cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
    } else {
        mark_spanning_forest(reader, root, in_tree, &components);
        for (int32_t v = 0; v < reader->vertices && components > 1; v++)
            if (disjoint_sets_root(root, v) != 0) {
                status = cairn_file_error_set(
                    reader->error, CAIRN_BAD_FORMAT, reader->path, reader->vertex[v].line,
                    "the graph has %d connected components: no edges join vertex %lld to vertex "
                    "%lld, expected a connected graph",
                    (int)components, (long long)reader->vertex[v].id,
                    (long long)reader->vertex[0].id);
                break;
            }
        if (status == CAIRN_OK && chained)
            compose_poses(reader, in_tree, root, list, queue, via);
    }
    free(root);
    free(queue);
    free(list);
    free(via);
    free(in_tree);
    return status;
}

/* Builds the graph from the lines. */
static cairn_status build_graph(graph_reader *reader, cairn_pose_graph_file *file)
{
    int32_t chained = reader->vertices == 0;
    cairn_status status;

    if (reader->edges == 0)
        return cairn_file_error_set(reader->error, CAIRN_EMPTY, reader->path, 0,
                                    "no EDGE_SE2 line, expected a g2o pose graph");
    status = chained ? collect_vertices(reader) : sort_vertices(reader);
    if (status == CAIRN_OK)
        status = resolve_ids(reader);
    if (status == CAIRN_OK)
        status = check_connected(reader, chained);
    if (status != CAIRN_OK)
        return status;
    file->edge = malloc((size_t)reader->edges * sizeof *file->edge);
    if (file->edge == NULL)
        return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
    for (int32_t e = 0; e < reader->edges; e++)
        file->edge[e] = reader->edge[e].edge;
    file->vertex = reader->vertex;
    reader->vertex = NULL;
    file->vertex_count = reader->vertices;
    file->edge_count = reader->edges;
    file->chained = chained;
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_file_read(cairn_pose_graph_file *file, const char *path,
                                        cairn_file_error *error)
{
    graph_reader reader;
    cairn_status status;
    const char *line;
    size_t length;

    memset(file, 0, sizeof *file);
    memset(&reader, 0, sizeof reader);
    reader.path = path;
    reader.error = error;
    status = cairn_line_reader_open(&reader.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(reader.lines, &line, &length, error)) == CAIRN_OK) {
        status = read_line(&reader, line, length);
        if (status != CAIRN_OK)
            break;
    }
    if (status == CAIRN_FULL)
        status = bad_line(&reader, "the line is too long, expected a g2o pose graph");
    if (status == CAIRN_EMPTY)
        status = build_graph(&reader, file);
    cairn_line_reader_close(reader.lines);
    free(reader.vertex);
    free(reader.edge);
    free(reader.fix);
    return status;
}

void cairn_pose_graph_file_free(cairn_pose_graph_file *file)
{
    free(file->vertex);
    free(file->edge);
    memset(file, 0, sizeof *file);
}

/* ---- Writing ---- */

static void print_numbers(cairn_output *output, const cairn_real *value, int32_t count)
{
    char text[CAIRN_NUMBER_TEXT_BYTES];

    for (int32_t k = 0; k < count; k++)
        cairn_output_print(output, " %s", cairn_number_write(text, value[k]));
}

cairn_status cairn_pose_graph_file_write(const char *path, const cairn_pose_graph_file *file,
                                         cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status;

    for (int32_t v = 0; v < file->vertex_count; v++)
        if (!cairn_pose_is_finite(file->vertex[v].pose))
            return cairn_file_error_set(
                error, CAIRN_NOT_FINITE, path, 0,
                "vertex %lld has a pose that is not finite, expected finite ones",
                (long long)file->vertex[v].id);
    status = cairn_output_open(&output, path, error);
    if (status != CAIRN_OK)
        return status;
    for (int32_t v = 0; v < file->vertex_count; v++) {
        const cairn_pose_graph_file_vertex *vertex = &file->vertex[v];
        const cairn_real value[3] = {vertex->pose.x, vertex->pose.y, vertex->pose.theta};

        cairn_output_print(output, "VERTEX_SE2 %lld", (long long)vertex->id);
        print_numbers(output, value, 3);
        cairn_output_print(output, "\n");
        if (vertex->fixed)
            cairn_output_print(output, "FIX %lld\n", (long long)vertex->id);
    }
    for (int32_t e = 0; e < file->edge_count; e++) {
        const cairn_pose_graph_file_edge *edge = &file->edge[e];
        const cairn_real value[9] = {
            edge->first_second.x, edge->first_second.y, edge->first_second.theta,
            edge->information.xx, edge->information.xy, edge->information.xz,
            edge->information.yy, edge->information.yz, edge->information.zz};

        cairn_output_print(output, "EDGE_SE2 %lld %lld", (long long)file->vertex[edge->first].id,
                           (long long)file->vertex[edge->second].id);
        print_numbers(output, value, 9);
        cairn_output_print(output, "\n");
    }
    return cairn_output_commit(output, error);
}
