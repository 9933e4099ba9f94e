/* g2o files: reading, checking, writing. Solving and drawing are in pose_graph_file_solve.c and
 * pose_graph_file_draw.c.
 *
 * Method: lines become vertices and edges that hold ids; when all are there, vertices are sorted
 * by id and edges get indices. Pieces are found by union-find over the edges. */
#include "src/core/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "cairn/output.h"
#include "cairn/pose_graph_file.h"
#include "src/host/carmen_log_reader.h"

enum { FIELDS_MOST = 12 };

typedef struct token {
    const char *text;
    size_t length;
} token;

/* An edge before its ids are known to exist. */
typedef struct raw_edge {
    int64_t first, second;
    cairn_pose_graph_edge edge;
} raw_edge;

typedef struct graph_reader {
    cairn_line_reader *lines;
    const char *path;
    cairn_file_error *error;
    cairn_pose_graph_vertex *vertex;
    raw_edge *edge;
    cairn_pose_graph_vertex *fix; /* ids and lines of FIX */
    int32_t vertices, vertex_capacity, edges, edge_capacity, fixes, fix_capacity;
} graph_reader;

static cairn_status bad_line(const graph_reader *r, const char *what)
{
    return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path,
                                cairn_line_reader_number(r->lines), "%s", what);
}

/* Room for one more element of an array that doubles. */
static cairn_status make_room(const graph_reader *r, void *array, int32_t count, int32_t *capacity,
                              size_t size)
{
    int32_t more = *capacity == 0 ? 1024 : *capacity < INT32_MAX / 2 ? 2 * *capacity : INT32_MAX;
    void *old, *grown;

    if (count < *capacity)
        return CAIRN_OK;
    memcpy(&old, array, sizeof old);
    grown = count < INT32_MAX ? realloc(old, (size_t)more * size) : NULL;
    if (grown == NULL)
        return cairn_file_error_system(r->error, r->path, "read", ENOMEM);
    memcpy(array, &grown, sizeof grown);
    *capacity = more;
    return CAIRN_OK;
}

static cairn_status read_id(const graph_reader *r, token t, int64_t *id)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    if (cairn_number_read_integer(t.text, t.length, id) && *id >= 0)
        return CAIRN_OK;
    return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path,
                                cairn_line_reader_number(r->lines),
                                "%s is no vertex, expected a whole number from 0",
                                cairn_token_text(shown, t.text, t.length));
}

static cairn_status read_numbers(const graph_reader *r, const token *t, int32_t count,
                                 cairn_real *value)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    double number;

    for (int32_t k = 0; k < count; k++) {
        if (!cairn_number_read(t[k].text, t[k].length, &number))
            return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path,
                                        cairn_line_reader_number(r->lines), "%s, expected a number",
                                        cairn_token_text(shown, t[k].text, t[k].length));
        value[k] = (cairn_real)number;
        if (!cairn_is_finite(value[k]))
            return cairn_file_error_set(
                r->error, CAIRN_NOT_FINITE, r->path, cairn_line_reader_number(r->lines),
                "%s, expected a finite number", cairn_token_text(shown, t[k].text, t[k].length));
    }
    return CAIRN_OK;
}

static cairn_status read_vertex(graph_reader *r, const token *t, int32_t count)
{
    cairn_pose_graph_vertex vertex = {0, cairn_line_reader_number(r->lines), {0, 0, 0}, 0};
    cairn_real value[3];
    cairn_status status;

    if (count != 5)
        return bad_line(r, "a VERTEX_SE2 with fields missing or too many, expected id x y theta");
    status = read_id(r, t[1], &vertex.id);
    if (status == CAIRN_OK)
        status = read_numbers(r, &t[2], 3, value);
    if (status == CAIRN_OK)
        status = make_room(r, &r->vertex, r->vertices, &r->vertex_capacity, sizeof vertex);
    if (status != CAIRN_OK)
        return status;
    vertex.pose.x = value[0];
    vertex.pose.y = value[1];
    vertex.pose.theta = value[2];
    r->vertex[r->vertices++] = vertex;
    return CAIRN_OK;
}

static cairn_status read_edge(graph_reader *r, const token *t, int32_t count)
{
    cairn_real value[9];
    cairn_sym3 inverse;
    cairn_status status;
    raw_edge raw;

    memset(&raw, 0, sizeof raw);
    if (count != 12)
        return bad_line(r, "an EDGE_SE2 with fields missing or too many, expected two ids, x y "
                           "theta and six numbers of "
                           "the information matrix");
    status = read_id(r, t[1], &raw.first);
    if (status == CAIRN_OK)
        status = read_id(r, t[2], &raw.second);
    if (status == CAIRN_OK)
        status = read_numbers(r, &t[3], 9, value);
    if (status != CAIRN_OK)
        return status;
    if (raw.first == raw.second)
        return bad_line(r, "an edge from a vertex to itself, expected two vertices");
    raw.edge.line = cairn_line_reader_number(r->lines);
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
        return bad_line(r, "an information matrix that is singular or has a negative eigenvalue, "
                           "expected a positive "
                           "definite one");
    status = make_room(r, &r->edge, r->edges, &r->edge_capacity, sizeof raw);
    if (status == CAIRN_OK)
        r->edge[r->edges++] = raw;
    return status;
}

static cairn_status read_fix(graph_reader *r, const token *t, int32_t count)
{
    cairn_pose_graph_vertex fix = {0, cairn_line_reader_number(r->lines), {0, 0, 0}, 1};
    cairn_status status = CAIRN_OK;

    if (count < 2)
        return bad_line(r, "FIX without a vertex, expected its id");
    for (int32_t k = 1; k < count && status == CAIRN_OK; k++) {
        status = read_id(r, t[k], &fix.id);
        if (status == CAIRN_OK)
            status = make_room(r, &r->fix, r->fixes, &r->fix_capacity, sizeof fix);
        if (status == CAIRN_OK)
            r->fix[r->fixes++] = fix;
    }
    return status;
}

static int is_word(token t, const char *word)
{
    return t.length == strlen(word) && memcmp(t.text, word, t.length) == 0;
}

static cairn_status read_line(graph_reader *r, const char *line, size_t length)
{
    const char *end = line + length;
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    token t[FIELDS_MOST + 1];
    int32_t count = 0;

    while (count <= FIELDS_MOST &&
           (t[count].length = cairn_token_next(&line, end, &t[count].text)) > 0)
        count++;
    if (count == 0 || t[0].text[0] == '#')
        return CAIRN_OK;
    if (is_word(t[0], "VERTEX_SE2"))
        return read_vertex(r, t, count);
    if (is_word(t[0], "EDGE_SE2"))
        return read_edge(r, t, count);
    if (is_word(t[0], "FIX"))
        return read_fix(r, t, count);
    return cairn_file_error_set(r->error, CAIRN_UNSUPPORTED, r->path,
                                cairn_line_reader_number(r->lines),
                                "%s, expected VERTEX_SE2, EDGE_SE2 or FIX",
                                cairn_token_text(shown, t[0].text, t[0].length));
}

/* ---- Vertices ---- */

static int compare_vertices(const void *a, const void *b)
{
    const cairn_pose_graph_vertex *x = a, *y = b;

    if (x->id != y->id)
        return x->id < y->id ? -1 : 1;
    return x->line < y->line ? -1 : x->line > y->line;
}

static int32_t find_vertex(const graph_reader *r, int64_t id)
{
    int32_t low = 0, high = r->vertices;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (r->vertex[middle].id < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low < r->vertices && r->vertex[low].id == id ? low : -1;
}

/* The vertices that edges name, each once. */
static cairn_status vertices_of_edges(graph_reader *r)
{
    int32_t kept = 0;

    for (int32_t e = 0; e < 2 * r->edges; e++) {
        cairn_pose_graph_vertex vertex = {e % 2 == 0 ? r->edge[e / 2].first : r->edge[e / 2].second,
                                          r->edge[e / 2].edge.line,
                                          {0, 0, 0},
                                          0};
        cairn_status status =
            make_room(r, &r->vertex, r->vertices, &r->vertex_capacity, sizeof vertex);

        if (status != CAIRN_OK)
            return status;
        r->vertex[r->vertices++] = vertex;
    }
    qsort(r->vertex, (size_t)r->vertices, sizeof *r->vertex, compare_vertices);
    for (int32_t v = 0; v < r->vertices; v++)
        if (kept == 0 || r->vertex[kept - 1].id != r->vertex[v].id)
            r->vertex[kept++] = r->vertex[v];
    r->vertices = kept;
    return CAIRN_OK;
}

static cairn_status sort_vertices(graph_reader *r)
{
    qsort(r->vertex, (size_t)r->vertices, sizeof *r->vertex, compare_vertices);
    for (int32_t v = 1; v < r->vertices; v++)
        if (r->vertex[v].id == r->vertex[v - 1].id)
            return cairn_file_error_set(
                r->error, CAIRN_BAD_FORMAT, r->path, r->vertex[v].line,
                "vertex %lld again, expected each once (first on line %lld)",
                (long long)r->vertex[v].id, (long long)r->vertex[v - 1].line);
    return CAIRN_OK;
}

static cairn_status missing(const graph_reader *r, int64_t line, const char *what, int64_t id)
{
    return cairn_file_error_set(r->error, CAIRN_BAD_FORMAT, r->path, line,
                                "%s vertex %lld, expected one that a VERTEX_SE2 line gives", what,
                                (long long)id);
}

/* Ids become indices. */
static cairn_status resolve(graph_reader *r)
{
    for (int32_t e = 0; e < r->edges; e++) {
        raw_edge *raw = &r->edge[e];

        raw->edge.first = find_vertex(r, raw->first);
        raw->edge.second = find_vertex(r, raw->second);
        if (raw->edge.first < 0 || raw->edge.second < 0)
            return missing(r, raw->edge.line, "an edge with",
                           raw->edge.first < 0 ? raw->first : raw->second);
    }
    for (int32_t f = 0; f < r->fixes; f++) {
        int32_t v = find_vertex(r, r->fix[f].id);

        if (v < 0)
            return missing(r, r->fix[f].line, "FIX of", r->fix[f].id);
        r->vertex[v].fixed = 1;
    }
    return CAIRN_OK;
}

/* ---- Pieces and chained poses ---- */

static int32_t root_of(int32_t *root, int32_t v)
{
    while (root[v] != v) {
        root[v] = root[root[v]];
        v = root[v];
    }
    return v;
}

/* 1 when the edge joins two pieces. */
static int join(int32_t *root, const cairn_pose_graph_edge *edge)
{
    int32_t a = root_of(root, edge->first), b = root_of(root, edge->second);

    if (a == b)
        return 0;
    root[a > b ? a : b] = a > b ? b : a;
    return 1;
}

/* Marks a spanning tree, of edges between consecutive ids as far as they go; *pieces: how many
 * there are. */
static void span(const graph_reader *r, int32_t *root, uint8_t *in_tree, int32_t *pieces)
{
    *pieces = r->vertices;
    for (int32_t v = 0; v < r->vertices; v++)
        root[v] = v;
    for (int round = 0; round < 2; round++)
        for (int32_t e = 0; e < r->edges; e++) {
            int64_t apart = r->edge[e].first - r->edge[e].second;

            if ((round == 1 || apart == 1 || apart == -1) && join(root, &r->edge[e].edge)) {
                in_tree[e] = 1;
                --*pieces;
            }
        }
}

/* Poses along the tree, from the first vertex at the origin: neighbours of the vertices that
 * have one, in turn. */
static void chain(const graph_reader *r, const uint8_t *in_tree, int32_t *start, int32_t *list,
                  int32_t *queue, int32_t *via)
{
    int32_t known = 1;

    memset(start, 0, ((size_t)r->vertices + 1) * sizeof *start);
    for (int32_t e = 0; e < r->edges; e++)
        if (in_tree[e]) {
            start[r->edge[e].edge.first]++;
            start[r->edge[e].edge.second]++;
        }
    for (int32_t v = 0, sum = 0; v <= r->vertices; v++) {
        sum += start[v];
        start[v] = sum;
    }
    for (int32_t e = r->edges - 1; e >= 0; e--)
        if (in_tree[e]) {
            list[--start[r->edge[e].edge.first]] = e;
            list[--start[r->edge[e].edge.second]] = e;
        }
    queue[0] = 0;
    via[0] = -1;
    for (int32_t at = 0; at < known; at++)
        for (int32_t k = start[queue[at]]; k < start[queue[at] + 1]; k++) {
            const cairn_pose_graph_edge *edge = &r->edge[list[k]].edge;
            int32_t from = queue[at], to = edge->first == from ? edge->second : edge->first;
            cairn_pose step =
                edge->first == from ? edge->first_second : cairn_pose_inverse(edge->first_second);

            if (list[k] == via[from])
                continue;
            r->vertex[to].pose = cairn_pose_compose(r->vertex[from].pose, step);
            via[to] = list[k];
            queue[known++] = to;
        }
}

static cairn_status join_up(graph_reader *r, int32_t chained)
{
    size_t vertices = (size_t)r->vertices, edges = (size_t)r->edges;
    int32_t *root = malloc((vertices + 1) * sizeof *root),
            *queue = malloc((vertices + 1) * sizeof *queue);
    int32_t *list = malloc(2 * (edges + 1) * sizeof *list),
            *via = malloc((vertices + 1) * sizeof *via), pieces;
    uint8_t *in_tree = calloc(edges + 1, 1);
    cairn_status status = CAIRN_OK;

    if (root == NULL || queue == NULL || list == NULL || via == NULL || in_tree == NULL) {
        status = cairn_file_error_system(r->error, r->path, "read", ENOMEM);
    } else {
        span(r, root, in_tree, &pieces);
        for (int32_t v = 0; v < r->vertices && pieces > 1; v++)
            if (root_of(root, v) != 0) {
                status = cairn_file_error_set(
                    r->error, CAIRN_BAD_FORMAT, r->path, r->vertex[v].line,
                    "the graph is in %d pieces: no edges join vertex %lld to vertex %lld, "
                    "expected one piece",
                    (int)pieces, (long long)r->vertex[v].id, (long long)r->vertex[0].id);
                break;
            }
        if (status == CAIRN_OK && chained)
            chain(r, in_tree, root, list, queue, via);
    }
    free(root);
    free(queue);
    free(list);
    free(via);
    free(in_tree);
    return status;
}

static cairn_status finish(graph_reader *r, cairn_pose_graph_file *file)
{
    int32_t chained = r->vertices == 0;
    cairn_status status;

    if (r->edges == 0)
        return cairn_file_error_set(r->error, CAIRN_EMPTY, r->path, 0,
                                    "no EDGE_SE2 line, expected a graph as g2o has it");
    status = chained ? vertices_of_edges(r) : sort_vertices(r);
    if (status == CAIRN_OK)
        status = resolve(r);
    if (status == CAIRN_OK)
        status = join_up(r, chained);
    if (status != CAIRN_OK)
        return status;
    file->edge = malloc((size_t)r->edges * sizeof *file->edge);
    if (file->edge == NULL)
        return cairn_file_error_system(r->error, r->path, "read", ENOMEM);
    for (int32_t e = 0; e < r->edges; e++)
        file->edge[e] = r->edge[e].edge;
    file->vertex = r->vertex;
    r->vertex = NULL;
    file->vertex_count = r->vertices;
    file->edge_count = r->edges;
    file->chained = chained;
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_file_read(cairn_pose_graph_file *file, const char *path,
                                        cairn_file_error *error)
{
    graph_reader r;
    cairn_status status;
    const char *line;
    size_t length;

    memset(file, 0, sizeof *file);
    memset(&r, 0, sizeof r);
    r.path = path;
    r.error = error;
    status = cairn_line_reader_open(&r.lines, path, error);
    if (status != CAIRN_OK)
        return status;
    while ((status = cairn_line_reader_next(r.lines, &line, &length, error)) == CAIRN_OK) {
        status = read_line(&r, line, length);
        if (status != CAIRN_OK)
            break;
    }
    if (status == CAIRN_FULL)
        status = bad_line(&r, "a line without end, expected a graph as g2o has it");
    if (status == CAIRN_EMPTY)
        status = finish(&r, file);
    cairn_line_reader_close(r.lines);
    free(r.vertex);
    free(r.edge);
    free(r.fix);
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
        const cairn_pose_graph_vertex *vertex = &file->vertex[v];
        const cairn_real value[3] = {vertex->pose.x, vertex->pose.y, vertex->pose.theta};

        cairn_output_print(output, "VERTEX_SE2 %lld", (long long)vertex->id);
        print_numbers(output, value, 3);
        cairn_output_print(output, "\n");
        if (vertex->fixed)
            cairn_output_print(output, "FIX %lld\n", (long long)vertex->id);
    }
    for (int32_t e = 0; e < file->edge_count; e++) {
        const cairn_pose_graph_edge *edge = &file->edge[e];
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
