/* pose_graph_file: pose graphs as g2o files: reading, writing, solving and drawing.
 *
 *   VERTEX_SE2 id x y theta
 *   EDGE_SE2 id id x y theta  i11 i12 i13 i22 i23 i33
 *   FIX id ...
 *
 * An edge is the relative pose of the second vertex in the frame of the first, with its information
 * matrix (upper triangle). Units are m and rad. Files are plain or gzipped, lines in any order.
 * Blank lines and lines that begin with # are skipped. In a file without any VERTEX_SE2 the initial
 * poses are composed along a spanning tree of the edges, with edges between consecutive ids
 * first. */
#ifndef CAIRN_POSE_GRAPH_FILE_H
#define CAIRN_POSE_GRAPH_FILE_H

#include "cairn/file_error.h"
#include "cairn/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A vertex of the graph. */
typedef struct cairn_pose_graph_file_vertex {
    int64_t id;      /* as in the file, >= 0 */
    int64_t line;    /* of its first occurrence, from 1 */
    cairn_pose pose; /* m, m, rad */
    int32_t fixed;   /* 1: FIX, the pose is held constant */
} cairn_pose_graph_file_vertex;

/* An edge (constraint) of the graph. */
typedef struct cairn_pose_graph_file_edge {
    int32_t first, second;   /* indices of vertices */
    int64_t line;            /* from 1 */
    cairn_pose first_second; /* relative pose of the second in the frame of the first */
    cairn_sym3 information;  /* 1/m^2, 1/rad^2, 1/(m rad) */
} cairn_pose_graph_file_edge;

/* A pose graph on the heap. */
typedef struct cairn_pose_graph_file {
    cairn_pose_graph_file_vertex *vertex; /* [vertex_count] by ascending id */
    cairn_pose_graph_file_edge *edge;     /* [edge_count] in the order of the file */
    /* number of vertices and of edges */
    int32_t vertex_count, edge_count;
    int32_t chained; /* 1: the initial poses were composed from the edges */
} cairn_pose_graph_file;

/* Reads a graph, to be freed by cairn_pose_graph_file_free(). CAIRN_BAD_FORMAT with the line: a
 * field that is no number, missing or surplus fields, a duplicate vertex, an edge or FIX of an
 * unknown vertex, an edge from a vertex to itself, an information matrix that is not positive
 * definite, a graph that is not connected; CAIRN_NOT_FINITE; CAIRN_UNSUPPORTED: other elements of
 * g2o. CAIRN_EMPTY: no edge. CAIRN_IO, CAIRN_TRUNCATED, CAIRN_NO_MEMORY. On failure there is
 * nothing to free.
 *
 * file: set to the graph
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_read(cairn_pose_graph_file *file, const char *path,
                                                      cairn_file_error *error);

/* Writes a graph atomically. Numbers read back bit-exactly. CAIRN_NOT_FINITE, CAIRN_IO,
 * CAIRN_NO_MEMORY.
 *
 * path: target
 * file: the graph */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_write(const char *path,
                                                       const cairn_pose_graph_file *file,
                                                       cairn_file_error *error);

/* Frees the arrays.
 *
 * file: graph that was read */
void cairn_pose_graph_file_free(cairn_pose_graph_file *file);

/* ---- Solving ---- */

/* The linear solver. */
typedef int32_t cairn_pose_graph_file_solver;
enum {
    CAIRN_POSE_GRAPH_FILE_BUILTIN = 0, /* block_solver */
    CAIRN_POSE_GRAPH_FILE_SPARSE = 1   /* SuiteSparse, see sparse_solver.h */
};

/* Settings and results of solving a graph. */
typedef struct cairn_pose_graph_file_solution {
    /* input: the linear solver */
    cairn_pose_graph_file_solver solver;
    /* input: 1: outliers are not rejected */
    int32_t keep_all;
    /* [vertex_count] optimized poses: m, m, rad */
    cairn_pose *pose;
    /* [edge_count] 1: the edge was rejected as an outlier */
    uint8_t *outlier;
    /* rejected edges */
    int32_t outliers;
    /* 1: plain least squares failed the chi-squared test, and the robust kernel was used */
    int32_t robust;
    /* state of the last optimization; its chi2 is that of the inlier edges */
    cairn_pose_graph_state state;
    /* chi2 of all edges at the initial poses */
    double chi2_initial;
    /* chi2 of all edges at the optimized poses */
    double chi2_all;
    /* memory of graph and solver, bytes */
    size_t pool_bytes;
} cairn_pose_graph_file_solution;

/* Optimizes the poses of a graph by pose_graph_robust, which rejects outlier edges; with keep_all
 * none are. The graph's own poses do not change.
 *
 * CAIRN_UNSUPPORTED: SuiteSparse is not installed; CAIRN_NOT_FINITE: a cost overflows;
 * CAIRN_NO_MEMORY, also when the factor has more than 2^26 blocks. On failure there is nothing to
 * free.
 *
 * file: the graph, which is not changed
 * solution: solver and keep_all are read; all other fields are set */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_solve(const cairn_pose_graph_file *file,
                                                       cairn_pose_graph_file_solution *solution);

/* Frees the arrays.
 *
 * solution: solution of cairn_pose_graph_file_solve() */
void cairn_pose_graph_file_solution_free(cairn_pose_graph_file_solution *solution);

/* Draws the graph before and after optimization as an SVG picture: edges grey, outliers red.
 * CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * path: target, an SVG file
 * file: the graph
 * solution: its solution
 * title: title of the picture */
CAIRN_CHECKED cairn_status cairn_pose_graph_file_draw(
    const char *path, const cairn_pose_graph_file *file,
    const cairn_pose_graph_file_solution *solution, const char *title, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
