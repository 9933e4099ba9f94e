/* pose_graph_file: pose graphs as g2o files, solved and drawn.
 *
 *   VERTEX_SE2 id x y theta
 *   EDGE_SE2 id id x y theta  i11 i12 i13 i22 i23 i33      second seen from first, and its
 *   information matrix FIX id ...
 *
 * plain or gzipped, in any order; blank lines and lines that begin with # are passed over. A
 * file without any VERTEX_SE2 gets its poses from its edges, those between consecutive numbers
 * first. */
#ifndef CAIRN_POSE_GRAPH_FILE_H
#define CAIRN_POSE_GRAPH_FILE_H

#include "cairn/file_error.h"
#include "cairn/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_pose_graph_vertex {
    int64_t id;   /* as in the file, >= 0 */
    int64_t line; /* where it is named first */
    cairn_pose pose;
    int32_t fixed; /* 1: FIX */
} cairn_pose_graph_vertex;

typedef struct cairn_pose_graph_edge {
    int32_t first, second; /* indices of vertices */
    int64_t line;
    cairn_pose first_second;
    cairn_sym3 information;
} cairn_pose_graph_edge;

typedef struct cairn_pose_graph_file {
    cairn_pose_graph_vertex *vertex; /* [vertex_count] by ascending id */
    cairn_pose_graph_edge *edge;     /* [edge_count] in the order of the file */
    int32_t vertex_count, edge_count;
    int32_t chained; /* 1: the poses come from the edges */
} cairn_pose_graph_file;

/* Reads a graph into memory that _free gives back. Refused, with the line: CAIRN_BAD_FORMAT: not
 * numbers, fields missing or too many, a vertex twice, an edge or FIX of a vertex that is not
 * there, an edge of a vertex with itself, an information matrix that is not positive definite, a
 * vertex that no edges join to the first one; CAIRN_NOT_FINITE; CAIRN_UNSUPPORTED: other
 * elements of g2o. CAIRN_EMPTY: no edge. CAIRN_IO, CAIRN_TRUNCATED, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_read(cairn_pose_graph_file *file, const char *path,
                                                      cairn_file_error *error);

/* Writes the whole graph, or nothing. Numbers read back as the same bits. CAIRN_NOT_FINITE,
 * CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_write(const char *path,
                                                       const cairn_pose_graph_file *file,
                                                       cairn_file_error *error);

void cairn_pose_graph_file_free(cairn_pose_graph_file *file);

/* ---- Solving ---- */

typedef int32_t cairn_pose_graph_file_solver;
enum {
    CAIRN_POSE_GRAPH_BUILTIN = 0, /* block_solver */
    CAIRN_POSE_GRAPH_SPARSE = 1   /* SuiteSparse, see sparse_solver.h */
};

typedef struct cairn_pose_graph_solution {
    /* in */
    cairn_pose_graph_file_solver solver;
    /* in: 1: no link is dropped */
    int32_t keep_all;
    /* [vertex_count] */
    cairn_pose *pose;
    /* [edge_count] 1: dropped */
    uint8_t *outlier;
    int32_t outliers;
    /* 1: least squares of all links did not explain them, and the robust kernel was used */
    int32_t robust;
    /* of the last solution; chi2 is that of the links that are kept */
    cairn_pose_graph_state state;
    /* of all links at the poses of the file */
    double chi2_initial;
    /* of all links at the poses found */
    double chi2_all;
    /* of graph and solver */
    size_t pool_bytes;
} cairn_pose_graph_solution;

/* Solves a graph: least squares first; when its chi2 is beyond what good links give by chance
 * (six standard deviations of chi2 with 3 links - 3 poses degrees of freedom), again with the
 * kernel of Geman and McClure from the poses of the file, and then by least squares of the links
 * that are within 99.9 % there. The graph's own poses stay as they are. CAIRN_UNSUPPORTED:
 * SuiteSparse is not installed. CAIRN_NOT_FINITE: a cost overflows. CAIRN_NO_MEMORY, also where
 * the factor would have more than 2^26 blocks. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_solve(const cairn_pose_graph_file *file,
                                                       cairn_pose_graph_solution *solution);

void cairn_pose_graph_solution_free(cairn_pose_graph_solution *solution);

/* Draws the graph before and after as an SVG picture: links grey, dropped ones red. CAIRN_IO,
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_draw(const char *path,
                                                      const cairn_pose_graph_file *file,
                                                      const cairn_pose_graph_solution *solution,
                                                      const char *title, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
