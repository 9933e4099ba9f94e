"""Relative poses of two scans: ICP, and matching without a guess."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._base import (
    BadArgumentError,
    Float64,
    Pose,
    Result,
    array,
    check,
    create,
    get_fields,
    new_fault,
    new_params,
    pointer,
    pose_in,
    pose_of,
    run,
    view,
)
from ._cairn import ffi, lib
from .logs import Scan

ICP_VERDICTS = (
    "running",
    "converged",
    "out of iterations",
    "too few pairs",
    "unobservable",
    "rolled back",
)
MATCH_VERDICTS = ("running", "found", "ambiguous", "none")
# Columns of an oriented point: x, y, and the unit tangent.
POINT_COLUMNS = 4


class Fit:
    """A scan with the segments and evenly spaced points that were fitted to it.

    Parameters
    ----------
    scan
        The scan.
    spacing
        Distance of the points along walls, m.
    **params
        Further fields of ``cairn_scan_params``.
    """

    def __init__(self, scan: Scan, spacing: float = 0.1, **params: Any) -> None:
        values = {"max_beams": max(scan.beams, 1), "spacing": spacing, **params}
        self.scan = scan
        self._object, self._pool = create("scan", new_params("scan", values))
        fault = new_fault()
        status = lib.cairn_scan_begin(self._object, scan._input, fault)
        check(status, "scan", fault=fault, file=scan.path, line=scan.line or None)
        run(lambda budget: lib.cairn_scan_step(self._object, budget), "scan")
        self.view = lib.cairn_scan_read(self._object)

    @property
    def points(self) -> Float64:
        """Evenly spaced points on the walls, shape (n, 4): x, y in m, and the unit tangent."""
        shape = (int(self.view.point_count), POINT_COLUMNS)
        return view(self.view.points, shape, "<f8", self)

    @property
    def segments(self) -> Float64:
        """Line segments, shape (n, 2, 2): both ends, m; free space is on their left."""
        return view(self.view.segments, (int(self.view.segment_count), 2, 2), "<f8", self)

    def dense(self) -> Any:
        """Returns every hit with its direction, as C takes it, and their number."""
        points = ffi.new("cairn_oriented_point[]", int(self.view.beam_count) + 1)
        return points, int(lib.cairn_scan_match_dense(ffi.addressof(self.view), points))

    def readings(self) -> Any:
        """Returns every hit with the direction of its segment, as C takes it, and their number."""
        points = ffi.new("cairn_oriented_point[]", int(self.view.beam_count) + 1)
        return points, int(lib.cairn_scan_match_readings(ffi.addressof(self.view), points))

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws segments and points into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        for segment in self.segments:
            ax.plot(*segment.T, **{"color": "tab:blue", **style})
        ax.plot(*self.points.T[:2], ".k", markersize=2)
        return ax


def fit(scan: Scan, spacing: float = 0.1, **params: Any) -> Fit:
    """Fits line segments and evenly spaced points to a scan.

    Parameters
    ----------
    scan
        The scan.
    spacing
        Distance of the points along walls, m.
    **params
        Further fields of ``cairn_scan_params``.

    Returns
    -------
    Fit
        Segments and points, in the frame of the robot.
    """
    return Fit(scan, spacing, **params)


@dataclass(frozen=True)
class IcpResult(Result):
    """Result of `icp`.

    Attributes
    ----------
    pose : Pose
        Pose of the source in the frame of the target, m and rad.
    covariance : ndarray
        Shape (3, 3) over (x, y, theta), m and rad, for independent errors of the points.
    verdict : str
        ``"converged"``, ``"out of iterations"``, ``"too few pairs"``, ``"unobservable"`` or
        ``"rolled back"``.
    overlap : float
        Share of the source's points that have a pair, 0 to 1.
    mean_distance, sigma : float
        Mean distance of the pairs, and robust standard deviation across the lines, m.
    observable : int
        Observable degrees of freedom, 0 to 3.
    weak_direction : ndarray
        Shape (3,): least observable direction over (x, y, theta times radius).
    pairs, iterations : int
        Inlier pairs of the last iteration, and iterations.
    """

    pose: Pose
    covariance: Float64
    verdict: str
    overlap: float
    mean_distance: float
    sigma: float
    observable: int
    weak_direction: Float64
    pairs: int
    iterations: int


Points = Union[Scan, Fit, ArrayLike]


def points_of(source: Points, name: str) -> NDArray[np.float64]:
    """Returns oriented points, shape (n, 4), of a scan, a fit or an array."""
    if isinstance(source, Scan):
        source = Fit(source)
    if isinstance(source, Fit):
        return source.points
    return array(source, np.float64, (None, POINT_COLUMNS), name)


def icp(
    target: Points, source: Points, start: ArrayLike = (0.0, 0.0, 0.0), **params: Any
) -> IcpResult:
    """Registers a scan against another one by iterative closest points.

    Parameters
    ----------
    target, source
        Scans, fits, or points of shape (n, 4): x, y in m, and the unit tangent of the wall.
    start
        Initial pose (x, y, theta) of the source in the frame of the target, m and rad.
    **params
        Fields of ``cairn_icp_params``.

    Returns
    -------
    IcpResult
        The relative pose, its covariance and a verdict.
    """
    fixed, moving = points_of(target, "target"), points_of(source, "source")
    values = {"max_target": max(len(fixed), 1), **params}
    aligner, _pool = create("icp", new_params("icp", values))
    kind, fault = "const cairn_oriented_point *", new_fault()
    status = lib.cairn_icp_add_target(aligner, pointer(fixed, kind), len(fixed), (0, 0, 0), fault)
    check(status, "target", fault=fault)
    begin = pose_in(start, "start")
    status = lib.cairn_icp_begin(
        aligner, pointer(moving, kind), len(moving), begin, ffi.NULL, fault
    )
    check(status, "source", fault=fault)
    run(lambda budget: lib.cairn_icp_step(aligner, budget), "icp")
    out = lib.cairn_icp_read(aligner)
    return IcpResult(
        pose_of(out.target_query),
        np.array(list(out.covariance)).reshape(3, 3),
        ICP_VERDICTS[out.verdict],
        out.overlap,
        out.mean_distance,
        out.sigma,
        int(out.observable_dof),
        np.array(list(out.weak_direction)),
        int(out.pairs),
        int(out.iterations),
    )


@dataclass(frozen=True)
class Hypothesis(Result):
    """A relative pose at which two scans agree.

    Attributes
    ----------
    pose : Pose
        Pose of the source in the frame of the target, m and rad.
    covariance : ndarray
        Shape (3, 3) over (x, y, theta), m and rad.
    log_odds : float
        Log odds against a chance similarity, nats.
    score, fit, overlap : float
        Rank, weighted and plain share of the source's points on the target's walls, 0 to 1.
    free_space_violation : float
        Share of the source's points in observed free space of the target.
    observable : int
        Observable degrees of freedom, 0 to 3.
    """

    pose: Pose
    covariance: Float64
    log_odds: float
    score: float
    fit: float
    overlap: float
    free_space_violation: float
    observable: int


@dataclass(frozen=True)
class MatchResult(Result):
    """Result of `match`.

    Attributes
    ----------
    verdict : str
        ``"found"``, ``"ambiguous"`` or ``"none"``.
    hypotheses : list of Hypothesis
        The best first.
    """

    verdict: str
    hypotheses: list[Hypothesis]
    _points: tuple[Float64, Float64] = field(repr=False)

    @property
    def pose(self) -> Pose | None:
        """The best relative pose; None when no hypothesis fits."""
        return self.hypotheses[0].pose if self.hypotheses else None

    def plot(self, ax: Any = None, hypothesis: int = 0) -> Any:
        """Draws both scans at a hypothesis into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        target, source = self._points
        ax.plot(*target.T, ".", markersize=3, label="target")
        if self.hypotheses:
            x, y, theta = self.hypotheses[hypothesis].pose
            c, s = np.cos(theta), np.sin(theta)
            source = source @ np.array([[c, s], [-s, c]]) + (x, y)
            ax.plot(*source.T, ".", markersize=3, label="source")
        ax.legend()
        return ax


def match(
    target: Scan,
    source: Scan,
    *,
    start: ArrayLike | None = None,
    window: tuple[float, float] | None = None,
    method: str = "default",
    spacing: float = 0.1,
    **params: Any,
) -> MatchResult:
    """Matches two scans without a guess: ranked relative poses and a verdict.

    Parameters
    ----------
    target, source
        The scans.
    start
        Prior pose (x, y, theta) of the source in the frame of the target; None: global search.
    window
        Half sizes of the search about `start`, m and rad; None: 1 m and 30 degrees.
    method
        ``"default"`` (correlative), ``"shape"`` (sequences of tangent directions), or
        ``"as written"``, the method of the thesis.
    spacing
        Distance of the points along walls, m.
    **params
        Further fields of ``cairn_scan_match_params``.

    Returns
    -------
    MatchResult
        Ranked relative poses, and a verdict.
    """
    if method not in ("default", "shape", "as written"):
        raise BadArgumentError(f"method is {method!r}, expected 'default', 'shape' or 'as written'")
    if window is not None and start is None:
        raise BadArgumentError("window without start, expected both or none")
    written = method == "as written"
    sides = [_Side(Fit(scan, spacing), written) for scan in (target, source)]
    target_part, source_part = (side.part for side in sides)
    start_params = lib.cairn_capacity_scan_match(
        target_part.count, target_part.dense_count, source_part.count, written
    )
    values: dict[str, Any] = {}
    if not written:
        modes = {"default": lib.CAIRN_SCAN_MATCH_CORRELATIVE, "shape": lib.CAIRN_SCAN_MATCH_SHAPE}
        values = {"mode": modes[method], "spacing": spacing}
    values |= params
    object_, _pool = create("scan_match", new_params("scan_match", values, start_params))
    fault = new_fault()
    status = lib.cairn_scan_match_add_target(object_, sides[0].part, (0, 0, 0), fault)
    check(status, "target", fault=fault)
    half = [1.0, np.radians(30)] if window is None else list(window)
    if written and window is None:
        half[1] = 2 * np.pi / 180
    area = ffi.NULL if start is None else ffi.new("cairn_scan_match_window *", half)
    begin = (0.0, 0.0, 0.0) if start is None else pose_in(start, "start")
    status = lib.cairn_scan_match_begin(object_, sides[1].part, begin, area, fault)
    check(status, "source", fault=fault)
    run(lambda budget: lib.cairn_scan_match_step(object_, budget), "match")
    out = lib.cairn_scan_match_read(object_)
    found = [_hypothesis(out.hypotheses[i]) for i in range(out.count)]
    points = tuple(side.fit.points[:, :2].copy() for side in sides)
    return MatchResult(MATCH_VERDICTS[out.verdict], found, (points[0], points[1]))


class _Side:
    """One of the two scans, as the matcher takes it."""

    def __init__(self, fitted: Fit, written: bool) -> None:
        self.fit = fitted
        self.part = ffi.new("cairn_scan_match_part *")
        if written:
            points, count = fitted.readings()
            self._keep = points
            self.part.points, self.part.count = points, count
            return
        self.part[0] = lib.cairn_scan_match_part_of(ffi.addressof(fitted.view))
        self._keep, self.part.dense_count = fitted.dense()
        self.part.dense = self._keep


def _hypothesis(found: Any) -> Hypothesis:
    values = get_fields(found)
    return Hypothesis(
        pose_of(found.target_query),
        values["covariance"].reshape(3, 3),
        values["log_odds"],
        values["score"],
        values["fit"],
        values["overlap"],
        values["free_space_violation"],
        int(values["observable_dof"]),
    )
