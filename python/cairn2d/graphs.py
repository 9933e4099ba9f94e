"""Pose graphs: read, write and optimize."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    Bool,
    EmptyError,
    Float64,
    Int32,
    Int64,
    PathLike,
    Result,
    array,
    check,
    check_file,
    copy_of,
    frame,
    path_of,
)
from ._cairn import ffi, lib

VERDICTS = {
    "CAIRN_POSE_GRAPH_CONVERGED": "converged",
    "CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS": "out of iterations",
    "CAIRN_POSE_GRAPH_DISCONNECTED": "disconnected",
}


@dataclass
class PoseGraph(Result):
    """Poses and the relative poses measured between them.

    Attributes
    ----------
    poses : ndarray
        Shape (vertices, 3), m and rad.
    first, second : ndarray
        Shape (edges,): vertices of every edge.
    relative : ndarray
        Shape (edges, 3): pose of the second vertex in the frame of the first, m and rad.
    information : ndarray
        Shape (edges, 3, 3): inverse covariance of `relative`, 1/m^2, 1/(m rad), 1/rad^2.
    ids : ndarray
        Shape (vertices,): names of the vertices in a file.
    fixed : ndarray
        Shape (vertices,): True for a pose that is held.
    lines : ndarray
        Shape (edges,): lines of the edges in their file, 0: none.
    """

    poses: Float64
    first: Int32
    second: Int32
    relative: Float64
    information: Float64
    ids: Int64
    fixed: Bool
    lines: Int64
    chained: bool = field(default=False, repr=False)

    @classmethod
    def of(
        cls,
        poses: ArrayLike,
        edges: ArrayLike,
        relative: ArrayLike,
        information: ArrayLike,
        fixed: ArrayLike | None = None,
    ) -> PoseGraph:
        """Returns a graph of arrays.

        Parameters
        ----------
        poses
            Shape (vertices, 3), m and rad.
        edges
            Shape (edges, 2): vertices that each edge joins.
        relative
            Shape (edges, 3), m and rad.
        information
            Shape (edges, 3, 3).
        fixed
            Shape (vertices,); None: no pose is held.

        Returns
        -------
        PoseGraph
            The graph; its vertices are named by their index.
        """
        vertex = array(poses, np.float64, (None, 3), "poses")
        pairs = array(edges, np.int32, (None, 2), "edges")
        count = len(pairs)
        if count and not (pairs.min() >= 0 and pairs.max() < len(vertex)):
            raise BadArgumentError(f"edges name a vertex beyond the {len(vertex)} of the graph")
        held = np.zeros(len(vertex), bool) if fixed is None else np.asarray(fixed, bool)
        return cls(
            vertex,
            pairs[:, 0].copy(),
            pairs[:, 1].copy(),
            array(relative, np.float64, (count, 3), "relative"),
            array(information, np.float64, (count, 3, 3), "information"),
            np.arange(len(vertex), dtype=np.int64),
            held,
            np.zeros(count, np.int64),
        )

    @classmethod
    def read(cls, path: PathLike) -> PoseGraph:
        """Reads a graph in the plane from a g2o file, plain or gzipped.

        Parameters
        ----------
        path
            The file.

        Returns
        -------
        PoseGraph
            The graph.
        """
        file, error = ffi.new("cairn_pose_graph_file *"), ffi.new("cairn_file_error *")
        status = lib.cairn_pose_graph_file_read(file, path_of(path), error)
        check_file(status, error, os.fspath(path))
        return cls._of(ffi.gc(file, lib.cairn_pose_graph_file_free))

    @classmethod
    def _of(cls, file: Any) -> PoseGraph:
        vertices, edges = int(file.vertex_count), int(file.edge_count)
        vertex, edge = file.vertex, file.edge
        poses = np.array([[v.pose.x, v.pose.y, v.pose.theta] for v in vertex[0:vertices]])
        symmetric = np.array(
            [[getattr(e.information, name) for name in SYMMETRIC] for e in edge[0:edges]]
        ).reshape(edges, 6)
        return cls(
            poses.reshape(vertices, 3),
            np.array([e.first for e in edge[0:edges]], np.int32),
            np.array([e.second for e in edge[0:edges]], np.int32),
            np.array(
                [[e.first_second.x, e.first_second.y, e.first_second.theta] for e in edge[0:edges]]
            ).reshape(edges, 3),
            symmetric[:, UNFOLD].reshape(edges, 3, 3),
            np.array([v.id for v in vertex[0:vertices]], np.int64),
            np.array([v.fixed for v in vertex[0:vertices]], bool),
            np.array([e.line for e in edge[0:edges]], np.int64),
            bool(file.chained),
        )

    def _file(self) -> tuple[Any, list[Any]]:
        """Returns the graph as C takes it, and what must be kept alive."""
        file = ffi.new("cairn_pose_graph_file *")
        vertex = ffi.new("cairn_pose_graph_file_vertex[]", max(len(self.poses), 1))
        edge = ffi.new("cairn_pose_graph_file_edge[]", max(len(self.first), 1))
        for i, pose in enumerate(self.poses.tolist()):
            vertex[i].id, vertex[i].pose = int(self.ids[i]), tuple(pose)
            vertex[i].fixed = int(self.fixed[i])
        folded = self.information.reshape(-1, 9)[:, FOLD].tolist()
        for i, relative in enumerate(self.relative.tolist()):
            edge[i].first, edge[i].second = int(self.first[i]), int(self.second[i])
            edge[i].line, edge[i].first_second = int(self.lines[i]), tuple(relative)
            edge[i].information = dict(zip(SYMMETRIC, folded[i]))
        file.vertex, file.vertex_count = vertex, len(self.poses)
        file.edge, file.edge_count = edge, len(self.first)
        file.chained = self.chained
        return file, [vertex, edge]

    def save(self, path: PathLike) -> None:
        """Writes the graph as a g2o file. Numbers read back bit for bit.

        Parameters
        ----------
        path
            The file.
        """
        (file, _keep), error = self._file(), ffi.new("cairn_file_error *")
        status = lib.cairn_pose_graph_file_write(path_of(path), file, error)
        check_file(status, error, os.fspath(path))

    def solve(self, *, keep_all: bool = False, solver: str = "builtin") -> GraphSolution:
        """Optimizes the poses; constraints that contradict the others are rejected.

        Parameters
        ----------
        keep_all
            Least squares of all edges, without rejection of outliers.
        solver
            ``"builtin"``, or ``"sparse"`` (SuiteSparse, where it is installed).

        Returns
        -------
        GraphSolution
            The graph with the optimized poses, and what was rejected.
        """
        if solver not in ("builtin", "sparse"):
            raise BadArgumentError(f"solver is {solver!r}, expected 'builtin' or 'sparse'")
        if len(self.poses) == 0:
            raise EmptyError("the graph has no vertex, expected at least one")
        file, _keep = self._file()
        out = ffi.new("cairn_pose_graph_file_solution *")
        out.solver, out.keep_all = int(solver == "sparse"), keep_all
        check(lib.cairn_pose_graph_file_solve(file, out), "pose graph")
        try:
            return self._solution(out)
        finally:
            lib.cairn_pose_graph_file_solution_free(out)

    def _solution(self, out: Any) -> GraphSolution:
        poses = copy_of(out.pose, (len(self.poses), 3), "<f8")
        outliers = copy_of(out.outlier, (len(self.first),), "|u1").astype(bool)
        graph = dataclasses.replace(self, poses=poses)
        verdict = "singular"
        for name, words in VERDICTS.items():
            if out.state.verdict == getattr(lib, name):
                verdict = words
        return GraphSolution(
            graph,
            outliers,
            out.chi2_initial,
            float(out.state.chi2),
            out.chi2_all,
            int(out.state.iterations),
            verdict,
            bool(out.robust),
            bool(out.state.chordal),
        )

    def to_pandas(self) -> Any:
        """Returns a data frame of the edges: first, second, dx, dy, dtheta."""
        dx, dy, dtheta = self.relative.T
        columns = {"first": self.first, "second": self.second, "dx": dx, "dy": dy, "dtheta": dtheta}
        return frame(columns)

    def plot(self, ax: Any = None, outliers: Bool | None = None, **style: Any) -> Any:
        """Draws poses and edges into axes of matplotlib; outliers are red. Returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        red = np.zeros(len(self.first), bool) if outliers is None else outliers
        for chosen, colour in ((~red, "0.7"), (red, "tab:red")):
            a, b = self.poses[self.first[chosen], :2], self.poses[self.second[chosen], :2]
            gap = np.full((len(a), 1, 2), np.nan)
            lines = np.concatenate((a[:, None], b[:, None], gap), axis=1).reshape(-1, 2)
            ax.plot(*lines.T, color=colour, linewidth=0.8)
        ax.plot(*self.poses.T[:2], ".", **{"markersize": 3, "color": "tab:blue", **style})
        return ax


# Fields of cairn_sym3, and how they lie in a 3 x 3 matrix.
SYMMETRIC = ("xx", "xy", "xz", "yy", "yz", "zz")
UNFOLD = [0, 1, 2, 1, 3, 4, 2, 4, 5]
FOLD = [0, 1, 2, 4, 5, 8]


@dataclass
class GraphSolution(Result):
    """An optimized pose graph.

    Attributes
    ----------
    graph : PoseGraph
        The graph with the optimized poses.
    outliers : ndarray
        Shape (edges,): True for an edge that was rejected.
    chi2_initial, chi2, chi2_all : float
        Error of all edges before, of the inliers and of all edges after.
    iterations : int
        Iterations of the last optimization.
    verdict : str
        ``"converged"``, ``"out of iterations"``, ``"disconnected"`` or ``"singular"``.
    robust, chordal : bool
        Whether a robust kernel was needed, and whether the chordal initialization was better than
        the poses given.
    """

    graph: PoseGraph
    outliers: Bool
    chi2_initial: float
    chi2: float
    chi2_all: float
    iterations: int
    verdict: str
    robust: bool
    chordal: bool

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the optimized graph into axes of matplotlib, and returns the axes."""
        return self.graph.plot(ax, self.outliers, **style)
