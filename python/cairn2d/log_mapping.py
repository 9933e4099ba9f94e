"""Logs to maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np

from ._base import (
    MAX_SEED,
    BadArgumentError,
    Bool,
    CairnError,
    EmptyError,
    Float64,
    FullError,
    Int64,
    PathLike,
    check_number,
    frame,
    set_fields,
)
from ._cairn import ffi, lib
from ._kept import Kept, PlacedResult, check_map_settings
from .filter_mapping import FilterMapper
from .graphs import PoseGraph
from .grids import Grid
from .logs import IDENTITY, Log, Scan
from .mapping import Mapper, OnlineMapper, check_sizes, odometry_of


@dataclass
class MapResult(PlacedResult):
    """A log that was mapped.

    Attributes
    ----------
    trajectory : ndarray
        Poses of the scans in the map, shape (scans, 3), m and rad.
    covariance : ndarray
        Shape (scans, 3, 3): covariance of each scan's registration; NaN without a match.
    support : ndarray
        Shape (scans,): share of the scan's points with a correspondence.
    verdicts : list of str
        How each pose was found, as in `ScanPose`.
    map_sigma : ndarray
        Shape (scans,): standard deviation of the position in the map, m: 0 unless the robot was
        lost on the way and no loop closure joins the scan past that; NaN for the particle filter
        and without loop closure.
    keyframes : ndarray
        Poses of the keyframes, shape (keyframes, 3).
    stamps_ns : ndarray
        Times of the scans, shape (scans,), ns.
    lines : ndarray
        Lines of the scans in their file, 0: none.
    graph : PoseGraph or None
        The pose graph of the keyframes; None for the particle filter and without loop closure.
    state : dict
        Counters: matches, predictions, loop closures.
    """

    trajectory: Float64
    covariance: Float64
    support: Float64
    verdicts: list[str]
    map_sigma: Float64
    keyframes: Float64
    stamps_ns: Int64
    lines: Int64
    graph: PoseGraph | None
    state: dict[str, Any]
    _kept: Kept = field(repr=False)
    _settings: tuple[float, float, float] = field(repr=False, default=(0.05, 30.0, 5.0))
    _grid: Grid | None = field(repr=False, default=None)

    @property
    def predicted(self) -> Bool:
        """Scans without a match, shape (scans,)."""
        return np.array([verdict == "predicted" for verdict in self.verdicts])

    def save(self, folder: PathLike) -> None:
        """Writes poses.csv, map.yaml, map.pgm and, with a pose graph, graph.g2o.

        All of them are written, or none. Files that the command or another result has left there
        are removed.

        Parameters
        ----------
        folder
            It is made when it is missing.
        """
        self._save(folder, self.graph)

    def to_pandas(self) -> Any:
        """Returns a data frame of the scans: stamp_ns, x, y, theta, support, verdict."""
        x, y, theta = self.trajectory.T
        return frame(
            {
                "stamp_ns": self.stamps_ns,
                "x": x,
                "y": y,
                "theta": theta,
                "support": self.support,
                "verdict": self.verdicts,
            }
        )

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws map and trajectory into axes of matplotlib, and returns the axes."""
        ax = self.grid.plot(ax)
        ax.plot(*self.trajectory.T[:2], **{"linewidth": 1, **style})
        return ax


Logs = Union[Log, Sequence[Log]]


def map(
    log: Logs,
    *,
    odometry: bool = True,
    keyframes: int = 4096,
    release: bool = False,
    loops: bool = True,
    window: int = 8,
    odometry_sigma: float = 0.0,
    sweep: float = 0.0,
    particles: int = 0,
    shape_prior: bool = False,
    seed: int = 1,
    resolution: float = 0.05,
    range: float = 30.0,
    clear: float = 5.0,
    **params: Any,
) -> MapResult:
    """Maps a log, scan by scan: online SLAM with loop closure, as ``cairn map`` does.

    Parameters
    ----------
    log
        The log, or several, which are mapped one after another, each from the last pose of the
        previous one.
    odometry
        False: the ranges alone are used; poses are then those of the sensor.
    keyframes
        Maximum number of keyframes.
    release
        Beyond `keyframes` the most redundant keyframes are removed.
    loops
        False: no loop closure and no pose graph.
    window
        Keyframes in the sliding window of the force field; 0: none.
    odometry_sigma
        Standard deviation of the odometry after 3 m, m, where it is known; turns count 3 m per
        rad. 0: learnt from the log.
    sweep
        Duration of a scan, first to last beam, s, for logs without it.
    particles
        Rao-Blackwellized particle filter of this many particles; 0: the mapper.
    shape_prior
        With `particles`: matches with the old map also start where the shapes of the scans are
        alike.
    seed
        Seed of the particle filter.
    resolution, range, clear
        Cell size of the map, maximum range of beams entered, and range up to which beams without
        return free cells, m.
    **params
        Further fields of ``cairn_mapper_params``, as of `Mapper`.

    Returns
    -------
    MapResult
        Trajectory, keyframes, pose graph and occupancy map.

    Examples
    --------
    >>> import cairn2d as cairn
    >>> result = cairn.map(cairn.arena("rooms", seed=1).drive(30))
    >>> result.trajectory.shape
    (30, 3)
    """
    check_map_settings(resolution, range, clear)
    logs = [log] if isinstance(log, Log) else list(log)
    job = _Job(
        logs=logs,
        odometry=odometry,
        keyframes=keyframes,
        release=release,
        loops=loops,
        window=window,
        odometry_sigma=odometry_sigma,
        sweep=sweep,
        particles=particles,
        shape_prior=shape_prior,
        seed=seed,
        params=params,
    )
    points = 0
    while (points := lib.cairn_capacity_keyframe_points(points)) > 0:
        mapper = job.run(points)
        if mapper is not None:
            return job.result(mapper, (resolution, range, clear))
    most = int(lib.CAIRN_CAPACITY_MAX_POINTS)
    raise FullError(f"{logs[0].path}: the keyframes have more than {most} points or segments")


@dataclass
class _Job:
    """The settings of `map`, and its passes over the logs."""

    logs: list[Log]
    odometry: bool
    keyframes: int
    release: bool
    loops: bool
    window: int
    odometry_sigma: float
    sweep: float
    particles: int
    shape_prior: bool
    seed: int
    params: dict[str, Any]

    def __post_init__(self) -> None:
        check_number("particles", self.particles, 0)
        check_number("seed", self.seed, 0, MAX_SEED)
        check_number("window", self.window, 0)
        if not np.isfinite(self.sweep):
            raise BadArgumentError(f"sweep is {self.sweep}, expected a finite number of seconds")
        self.scans = [(scan, i) for i, log in enumerate(self.logs) for scan in log]
        if not self.scans:
            raise EmptyError("the log has no scan, expected at least one")
        for value, name in ((self.release, "release"), (not self.loops, "loops=False")):
            if value and self.particles > 0:
                raise BadArgumentError(f"{name} with particles, expected one of them")
        if self.shape_prior and self.particles == 0:
            raise BadArgumentError("shape_prior without particles, expected both")
        if self.release and not self.loops:
            raise BadArgumentError("release with loops=False: culling needs the pose graph")
        self.odometry = self.odometry and any(log.has_odometry for log in self.logs)
        if self.odometry_sigma > 0 and not self.odometry:
            raise BadArgumentError("odometry_sigma without odometry, expected both")

    def mapper_params(self, points: int) -> Any:
        """Returns the mapper's params with a capacity of `points` points per keyframe."""
        count, beams = len(self.scans), max(log.beams for log in self.logs)
        check_sizes(self.keyframes, beams)
        params = ffi.new("cairn_mapper_params *")
        mapping = ffi.new(
            "cairn_capacity_mapping *",
            (self.keyframes, self.release, self.window, not self.loops),
        )
        params[0] = lib.cairn_capacity_mapper(mapping, count, beams, points)
        params.odometry_sigma = self.odometry_sigma
        set_fields(params, self.params)
        return params

    def new_mapper(self, points: int) -> OnlineMapper:
        """Returns the mapper of one pass."""
        params = self.mapper_params(points)
        if self.particles <= 0:
            return Mapper._with(params)
        values = ffi.new("cairn_filter_mapper_params *")
        values[0] = lib.cairn_filter_mapper_default()
        values.front = params[0]
        values.particles, values.seed = self.particles, self.seed
        values.shape_prior = self.shape_prior
        return FilterMapper._with(values)

    def run(self, points: int) -> OnlineMapper | None:
        """Maps all scans; None: the capacity for points is too small."""
        mapper = self.new_mapper(points)
        most = mapper._capacity()
        last = 0
        for scan, log in self.scans:
            try:
                mapper._map(scan, self.pose(scan, log == last), self.input(scan))
            except FullError:
                if mapper.state["keyframes"] < most:
                    return None
                raise FullError(
                    f"{self.logs[log].path}: needs more than {most} keyframes; raise keyframes"
                ) from None
            except CairnError as error:
                if error.file is None:
                    error.file = self.logs[log].path
                    error.args = (f"{error.file}:{scan.line}: {error}",)
                raise
            last = log
        if isinstance(mapper, Mapper):
            mapper.settle()
        return mapper

    def pose(self, scan: Scan, same_log: bool) -> Any:
        """Returns the odometry of a scan; none for the first scan of a further log."""
        if not self.odometry or not same_log:
            return ffi.NULL
        return odometry_of(scan, None)

    def input(self, scan: Scan) -> Any:
        """Returns a scan as the mapper's input."""
        if self.odometry and not (self.sweep > 0 and scan.beams > 1):
            return scan._input
        source = ffi.new("cairn_scan_input *")
        source[0] = scan._input[0]
        if self.sweep > 0 and scan.beams > 1:
            source.time_step = self.sweep / (scan.beams - 1)
        if not self.odometry:
            # The mounting would add information from the poses of the log.
            source.base_sensor = tuple(IDENTITY)
        return source

    def result(self, mapper: OnlineMapper, settings: tuple[float, float, float]) -> MapResult:
        """Returns what the mapper has found."""
        kept, poses = mapper._kept, mapper.trajectory
        table = kept.table
        table["after"][:] = poses
        graph = mapper.graph if isinstance(mapper, Mapper) and self.loops else None
        return MapResult(
            poses,
            table["covariance"].copy(),
            table["support"].copy(),
            kept.verdicts(),
            table["map_sigma"].copy(),
            mapper.keyframes,
            table["stamp_ns"].copy(),
            table["line"].copy(),
            graph,
            mapper.state,
            kept,
            settings,
        )
