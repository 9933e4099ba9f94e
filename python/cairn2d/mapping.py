"""Online SLAM: logs to maps, scan by scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._base import (
    BadArgumentError,
    Bool,
    CairnError,
    EmptyError,
    Float64,
    FullError,
    Int64,
    NoMemoryError,
    ParameterError,
    PathLike,
    Pose,
    Result,
    check,
    check_file,
    checked,
    create,
    error_of,
    frame,
    get_fields,
    new_fault,
    path_of,
    pose_in,
    pose_of,
    set_fields,
    text,
    view,
)
from ._cairn import ffi, lib
from .graphs import PoseGraph
from .grids import Grid
from .logs import IDENTITY, Log, Scan

VERDICTS = ("first", "matched", "predicted", "blind")
LOOP_VERDICTS = (
    "accepted",
    "pending",
    "no match",
    "ambiguous",
    "free space violation",
    "outlier",
    "unlikely",
)
# Budget of a call that settles: few enough units that no culling event is overwritten unread.
SETTLE_UNITS = 5000
# Most points, and segments, of all keyframes together.
MAX_KEYFRAME_ELEMENTS = 1 << 24
# Points per keyframe that the first attempt has capacity for: keyframes in buildings have 100.
FIRST_CAPACITY = 160


def struct_type(name: str, fields: dict[str, tuple[str, tuple[int, ...]]]) -> np.dtype[Any]:
    """Returns some fields of a C struct as a type of numpy."""
    return np.dtype(
        {
            "names": list(fields),
            "formats": [np.dtype((kind, shape)) for kind, shape in fields.values()],
            "offsets": [ffi.offsetof(name, field) for field in fields],
            "itemsize": ffi.sizeof(name),
        }
    )


PLACED = struct_type(
    "cairn_placed_scan",
    {
        "line": ("i8", ()),
        "stamp_ns": ("i8", ()),
        "before": ("f8", (3,)),
        "after": ("f8", (3,)),
        "covariance": ("f8", (3, 3)),
        "support": ("f8", ()),
        "low_confidence": ("u1", ()),
    },
)
PLACE = struct_type("cairn_scan_place", {"keyframe_scan": ("f8", (3,)), "keyframe": ("i4", ())})


class Kept:
    """The scans of a map with their results, in memory of the C library."""

    def __init__(self, capacity: int = 256) -> None:
        self.count = 0
        self.capacity = capacity
        self.scans = self._new(capacity)
        self.places = ffi.new("cairn_scan_place[]", capacity)

    @staticmethod
    def _new(capacity: int) -> Any:
        scans = lib.cairn_placed_scans_new(capacity)
        if scans == ffi.NULL:
            raise NoMemoryError(f"no memory for {capacity} scans")
        return scans

    def __del__(self) -> None:
        if hasattr(self, "scans"):
            lib.cairn_placed_scans_free(self.scans, self.capacity)

    def reserve(self) -> None:
        """Makes space for one more scan."""
        if self.count < self.capacity:
            return
        capacity = 2 * self.capacity
        scans, places = self._new(capacity), ffi.new("cairn_scan_place[]", capacity)
        ffi.memmove(scans, self.scans, self.count * ffi.sizeof("cairn_placed_scan"))
        ffi.memmove(places, self.places, self.count * ffi.sizeof("cairn_scan_place"))
        # The arrays of the scans have moved on; only the structs are freed.
        lib.free(self.scans)
        self.scans, self.places, self.capacity = scans, places, capacity

    def keep(self, sensor_data: Any) -> Any:
        """Keeps the data of one more scan, a ``cairn_scan_view *``; returns its struct."""
        self.reserve()
        scan = self.scans + self.count
        if not lib.cairn_placed_scan_copy(scan, sensor_data):
            raise NoMemoryError("no memory for a scan")
        self.count += 1
        return scan

    @property
    def table(self) -> NDArray[Any]:
        """The scans as a structured array, without a copy."""
        if self.count == 0:
            return np.empty(0, PLACED)
        raw = view(self.scans, (self.count * PLACED.itemsize,), "|u1", self)
        return raw.view(PLACED)

    def verdicts(self) -> list[str]:
        """Returns the verdict of each scan."""
        return [text(self.scans[i].verdict) for i in range(self.count)]

    def grid(self, resolution: float, range_: float, clear: float) -> Grid:
        """Returns the map of all beams at the poses ``after``."""
        if self.count == 0:
            raise EmptyError("no scan, expected at least one")
        scans = ffi.new("cairn_scan_map *")
        scans.scan, scans.count = self.scans, self.count
        scans.resolution, scans.range, scans.clear = resolution, range_, clear
        file, error = ffi.new("cairn_map_file *"), ffi.new("cairn_file_error *")
        check_file(lib.cairn_scan_map_make(scans, file, error), error)
        return Grid._of(file)


@dataclass(frozen=True)
class ScanPose(Result):
    """Pose of a scan in the map.

    Attributes
    ----------
    pose : Pose
        x, y in m and the heading in rad, at the time of the match.
    covariance : ndarray
        Shape (3, 3) over (x, y, theta), m and rad; NaN without a match.
    verdict : str
        ``"first"``, ``"matched"``, ``"predicted"`` or ``"blind"`` (no surface in the scan).
    support : float
        Share of the scan's points with a correspondence, 0 to 1.
    keyframe : int
        Index of the reference keyframe.
    is_keyframe : bool
        Whether the scan became a keyframe.
    """

    pose: Pose
    covariance: Float64
    verdict: str
    support: float
    keyframe: int
    is_keyframe: bool


@dataclass(frozen=True)
class LoopEvent(Result):
    """A candidate of a loop closure.

    Attributes
    ----------
    first, second : int
        Keyframes, the older one first.
    relative : Pose
        Measured pose of the second in the frame of the first.
    verdict : str
        ``"accepted"``, ``"pending"``, ``"no match"``, ``"ambiguous"``, ``"free space violation"``,
        ``"outlier"`` or ``"unlikely"``.
    """

    first: int
    second: int
    relative: Pose
    verdict: str


class _Track:
    """What `Mapper` and `FilterMapper` share: the scans that were mapped, and their map."""

    _kept: Kept
    _culled: int

    def _front(self) -> Any:
        raise NotImplementedError

    def _poses(self) -> Float64:
        raise NotImplementedError

    def _keep(self, scan: Scan) -> None:
        """Keeps the result of the scan that the mapper has finished."""
        front, kept = self._front(), self._kept
        self._reattach()
        kept.reserve()
        placed, place = kept.scans + kept.count, kept.places + kept.count
        if not lib.cairn_placed_scan_take(placed, place, front):
            raise NoMemoryError("no memory for a scan")
        placed.line, placed.stamp_ns = scan.line, scan.stamp_ns
        placed.before = tuple(scan.odometry or IDENTITY)
        kept.count += 1

    def _last(self) -> ScanPose:
        """Returns the result of the last scan."""
        result = lib.cairn_mapper_read(self._front())
        placed = self._kept.scans[self._kept.count - 1]
        covariance = np.array(list(placed.covariance)).reshape(3, 3)
        return ScanPose(
            pose_of(result.map_scan),
            covariance,
            VERDICTS[result.verdict],
            float(result.overlap),
            int(result.keyframe),
            bool(result.is_keyframe),
        )

    def _reattach(self) -> None:
        """Moves scans of culled keyframes to the neighbours of these."""
        front, kept = self._front(), self._kept
        culled = lib.cairn_mapper_measure(front).culled_keyframes
        for event in range(self._culled, culled):
            culling = lib.cairn_mapper_culling_at(front, event)
            lib.cairn_scan_places_reattach(kept.places, kept.count, culling)
        self._culled = culled

    def __len__(self) -> int:
        """Number of scans that were mapped."""
        return self._kept.count

    @property
    def trajectory(self) -> Float64:
        """Current poses of all scans in the map, shape (scans, 3), m and rad."""
        return self._poses()

    def grid(self, resolution: float = 0.05, range: float = 30.0, clear: float = 5.0) -> Grid:
        """Returns the occupancy map of all scans at their current poses.

        Parameters
        ----------
        resolution
            Side of a cell, m.
        range
            Maximum range of beams entered into the map, m.
        clear
            Beams without return free cells when the scanner sees no farther, m.
        """
        self._kept.table["after"][:] = self._poses()
        return self._kept.grid(resolution, range, clear)

    @property
    def state(self) -> dict[str, Any]:
        """Counters over the life of the mapper: fields of ``cairn_mapper_state``."""
        return get_fields(lib.cairn_mapper_measure(self._front()))


class Mapper(_Track):
    """Online pose-graph SLAM: scans in, poses and a map of keyframes out.

    Parameters
    ----------
    beams
        Most beams of a scan.
    keyframes
        Capacity for keyframes.
    **params
        Fields of ``cairn_mapper_params`` by name; groups are dicts: ``loop={"max_loops": 0}``.

    Raises
    ------
    ParameterError
        A parameter is out of range; its ``field``, ``lowest`` and ``highest`` say which and where.

    Examples
    --------
    >>> import cairn2d as cairn
    >>> log = cairn.arena("rooms", seed=1).drive(30)
    >>> mapper = cairn.Mapper(beams=log.beams)
    >>> for scan in log:
    ...     pose = mapper.add(scan)
    >>> mapper.settle()
    >>> mapper.trajectory.shape
    (30, 3)
    """

    def __init__(self, beams: int, *, keyframes: int = 1024, **params: Any) -> None:
        values = ffi.new("cairn_mapper_params *")
        values[0] = default_params(keyframes, beams)
        set_fields(values, params)
        self._begin(values)

    @classmethod
    def _with(cls, params: Any) -> Mapper:
        mapper = cls.__new__(cls)
        mapper._begin(params)
        return mapper

    def _begin(self, params: Any) -> None:
        checked("mapper", params)
        self._params = params
        self._mapper, self._pool = create("mapper", params)
        self._kept, self._culled = Kept(), 0
        self._waiting: Scan | None = None

    def _front(self) -> Any:
        return self._mapper

    @property
    def params(self) -> dict[str, Any]:
        """All parameters: fields of ``cairn_mapper_params``, groups as dicts."""
        return get_fields(self._params[0])

    @property
    def memory(self) -> int:
        """Bytes of the mapper's pool."""
        return int(self._pool.bytes)

    def begin(self, scan: Scan, odometry: ArrayLike | None = None) -> None:
        """Takes a scan whose work `step` then does in bounded pieces.

        Parameters
        ----------
        scan
            The scan.
        odometry
            Pose (x, y, theta) of the robot in the odometry frame; None: that of the scan.

        Raises
        ------
        BusyError
            The last scan is still being worked on; nothing was taken.
        """
        fault = new_fault()
        status = lib.cairn_mapper_add(self._mapper, scan._input, odometry_of(scan, odometry), fault)
        check_scan(status, scan, fault)
        self._waiting = scan

    def step(self, units: int = 1000) -> ScanPose | None:
        """Does some work on the scan of `begin`.

        Parameters
        ----------
        units
            Budget: a unit is at most about 200 instructions of a microcontroller.

        Returns
        -------
        ScanPose or None
            The pose when the scan is done; None: work is left.
        """
        if self._waiting is None:
            raise EmptyError("no scan is being worked on, expected begin() before step()")
        budget = ffi.new("cairn_budget *", {"left": units})
        status = lib.cairn_mapper_step(self._mapper, budget)
        if status == lib.CAIRN_MORE:
            self._reattach()
            return None
        scan, self._waiting = self._waiting, None
        check_scan(status, scan)
        self._keep(scan)
        return self._last()

    def add(self, scan: Scan, odometry: ArrayLike | None = None) -> ScanPose:
        """Maps a scan; parameters as of `begin`.

        Returns
        -------
        ScanPose
            The pose of the scan in the map.
        """
        self._map(scan, odometry_of(scan, odometry))
        return self._last()

    def _map(self, scan: Scan, odometry: Any, source: Any = None) -> None:
        fault = new_fault()
        source = scan._input if source is None else source
        check_scan(lib.cairn_mapper_map(self._mapper, source, odometry, fault), scan, fault)
        self._keep(scan)

    def settle(self) -> None:
        """Decides all pending loop closures and optimizes the graph; more scans may follow."""
        budget = ffi.new("cairn_budget *")
        status = lib.CAIRN_MORE
        while status == lib.CAIRN_MORE:
            budget.left = SETTLE_UNITS
            status = check(lib.cairn_mapper_settle(self._mapper, budget), "mapper")
            self._reattach()

    def _poses(self) -> Float64:
        kept = self._kept
        poses = np.empty((kept.count, 3))
        for i in range(kept.count):
            pose = lib.cairn_scan_place_pose(self._mapper, kept.places + i)
            poses[i] = pose.x, pose.y, pose.theta
        return poses

    @property
    def map_odom(self) -> Pose:
        """Pose of the odometry frame in the map, as ROS calls the transform map to odom."""
        return pose_of(lib.cairn_mapper_map_odom(self._mapper))

    @property
    def keyframes(self) -> Float64:
        """Current poses of the keyframes, shape (keyframes, 3), m and rad."""
        count = int(lib.cairn_mapper_measure(self._mapper).keyframes)
        pose = lib.cairn_mapper_keyframe_pose
        poses = [tuple(pose_of(pose(self._mapper, i))) for i in range(count)]
        return np.array(poses, np.float64).reshape(-1, 3)

    @property
    def loops(self) -> list[LoopEvent]:
        """The last loop events, at most 64, the oldest first."""
        count = int(lib.cairn_mapper_measure(self._mapper).loop_events)
        events = [
            lib.cairn_mapper_loop_at(self._mapper, i) for i in range(max(count - 64, 0), count)
        ]
        return [
            LoopEvent(
                int(e.first), int(e.second), pose_of(e.first_second), LOOP_VERDICTS[e.verdict]
            )
            for e in events
        ]

    @property
    def graph(self) -> PoseGraph:
        """The pose graph of the keyframes, without rejected links."""
        links = [
            link
            for link in (
                lib.cairn_mapper_link_at(self._mapper, i)
                for i in range(lib.cairn_mapper_link_count(self._mapper))
            )
            if not link.is_outlier
        ]
        information = []
        for link in links:
            s = link.information
            information.append([[s.xx, s.xy, s.xz], [s.xy, s.yy, s.yz], [s.xz, s.yz, s.zz]])
        return PoseGraph.of(
            self.keyframes,
            np.array([(link.first, link.second) for link in links], np.int32).reshape(-1, 2),
            np.array([pose_of(link.first_second) for link in links]).reshape(-1, 3),
            np.array(information, np.float64).reshape(-1, 3, 3),
        )

    def __repr__(self) -> str:
        keyframes = int(lib.cairn_mapper_measure(self._mapper).keyframes)
        return f"Mapper({len(self)} scans, {keyframes} keyframes)"


class FilterMapper(_Track):
    """SLAM by a Rao-Blackwellized particle filter: every particle has a map of its own.

    Parameters
    ----------
    beams
        Most beams of a scan.
    particles
        Number of particles.
    keyframes
        Capacity for keyframes.
    **params
        Fields of ``cairn_filter_mapper_params``; ``front`` is the group of the mapper's.
    """

    def __init__(
        self, beams: int, *, particles: int = 30, keyframes: int = 1024, **params: Any
    ) -> None:
        values = ffi.new("cairn_filter_mapper_params *")
        if min(beams, particles, keyframes) < 1:
            raise BadArgumentError("beams, particles and keyframes are expected above 0")
        values[0] = lib.cairn_filter_mapper_default_for(keyframes, beams, particles)
        set_fields(values, params)
        self._begin(values)

    @classmethod
    def _with(cls, params: Any) -> FilterMapper:
        mapper = cls.__new__(cls)
        mapper._begin(params)
        return mapper

    def _begin(self, params: Any) -> None:
        checked("filter_mapper", params)
        self._params = params
        self._filter, self._pool = create("filter_mapper", params)
        self._kept, self._culled = Kept(), 0

    def _front(self) -> Any:
        return lib.cairn_filter_mapper_front(self._filter)

    def add(self, scan: Scan, odometry: ArrayLike | None = None) -> ScanPose:
        """Maps a scan.

        Parameters
        ----------
        scan
            The scan.
        odometry
            Pose (x, y, theta) of the robot in the odometry frame; None: that of the scan.
        """
        self._map(scan, odometry_of(scan, odometry))
        return self._last()

    def _map(self, scan: Scan, odometry: Any, source: Any = None) -> None:
        fault = new_fault()
        source = scan._input if source is None else source
        status = lib.cairn_filter_mapper_map(self._filter, source, odometry, fault)
        check_scan(status, scan, fault)
        self._keep(scan)

    @property
    def particles(self) -> int:
        """Current number of particles."""
        return int(lib.cairn_filter_mapper_count(self._filter))

    def path(self, particle: int | None = None) -> Float64:
        """Returns the poses of the keyframes of a particle's path, shape (keyframes, 3).

        Parameters
        ----------
        particle
            Index of the particle; None: that of the most likely path.
        """
        if particle is None:
            particle = lib.cairn_filter_mapper_best(self._filter)
        capacity = int(lib.cairn_filter_mapper_measure(self._filter).keyframes)
        poses = np.empty((max(capacity, 1), 3))
        out = ffi.cast("cairn_pose *", ffi.from_buffer(poses))
        count = lib.cairn_filter_mapper_path(self._filter, particle, out, capacity)
        return poses[:count]

    def _poses(self) -> Float64:
        kept, path = self._kept, self.path()
        poses = np.empty((kept.count, 3))
        for i in range(kept.count):
            place = kept.places[i]
            keyframe = tuple(path[place.keyframe].tolist())
            pose = lib.cairn_pose_compose(keyframe, place.keyframe_scan)
            poses[i] = pose.x, pose.y, pose.theta
        return poses

    @property
    def filter_state(self) -> dict[str, Any]:
        """Counters of the particle filter: fields of ``cairn_filter_mapper_state``."""
        return get_fields(lib.cairn_filter_mapper_measure(self._filter))

    def __repr__(self) -> str:
        return f"FilterMapper({len(self)} scans, {self.particles} particles)"


def default_params(keyframes: int, beams: int) -> Any:
    """Returns the mapper's parameters for a number of keyframes and beams."""
    if beams < 1 or keyframes < 1:
        name, value = ("beams", beams) if beams < 1 else ("keyframes", keyframes)
        raise ParameterError(
            f"mapper: {name} is {value}, expected at least 1", "mapper", name, value, 1, 2**20, ""
        )
    return lib.cairn_mapper_default_for(min(keyframes, 2**20), min(beams, 100_000))


def odometry_of(scan: Scan, odometry: ArrayLike | None) -> Any:
    """Returns the odometry of a scan as C takes it."""
    pose = scan.odometry if odometry is None else pose_in(odometry, "odometry")
    return ffi.NULL if pose is None else ffi.new("cairn_pose *", tuple(pose))


def check_scan(status: int, scan: Scan, fault: Any = None) -> None:
    """Raises the exception of a scan that is refused."""
    if status < 0:
        raise error_of(status, "scan", fault=fault, line=scan.line or None, file=None)


@dataclass
class MapResult(Result):
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
    keyframes: Float64
    stamps_ns: Int64
    lines: Int64
    graph: PoseGraph | None
    state: dict[str, Any]
    _kept: Kept = field(repr=False)
    _settings: tuple[float, float, float] = field(repr=False, default=(0.05, 30.0, 5.0))
    _grid: Grid | None = field(repr=False, default=None)

    @property
    def grid(self) -> Grid:
        """The occupancy map of all scans."""
        if self._grid is None:
            self._grid = self._kept.grid(*self._settings)
        return self._grid

    @property
    def predicted(self) -> Bool:
        """Scans without a match, shape (scans,)."""
        return np.array([verdict == "predicted" for verdict in self.verdicts])

    def save(self, folder: PathLike) -> None:
        """Writes poses.csv, map.yaml, map.pgm and, with a pose graph, graph.g2o.

        Parameters
        ----------
        folder
            It is made when it is missing.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write_poses(target / "poses.csv", self)
        self.grid.save(target / "map.yaml")
        if self.graph is not None:
            self.graph.save(target / "graph.g2o")

    def to_dict(self) -> dict[str, Any]:
        """Returns the fields as lists, dicts, numbers and texts."""
        fields = ("trajectory", "covariance", "support", "verdicts", "keyframes", "stamps_ns")
        out = {name: getattr(self, name) for name in (*fields, "lines", "state")}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in out.items()}

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

    def _repr_png_(self) -> bytes:
        return self.grid._repr_png_()


def write_poses(path: Path, result: Any) -> None:
    """Writes the table of poses of a result as ``cairn map`` and ``cairn align`` do."""
    count = len(result.trajectory)
    rows = ffi.new("cairn_pose_table_row[]", max(count, 1))
    for i in range(count):
        rows[i] = lib.cairn_pose_table_row_of(i, tuple(result.trajectory[i].tolist()))
        rows[i].line, rows[i].stamp_ns = int(result.lines[i]), int(result.stamps_ns[i])
        rows[i].covariance = result.covariance[i].ravel().tolist()
        rows[i].support = float(result.support[i])
        rows[i].verdict = result.verdicts[i].encode()
    error = ffi.new("cairn_file_error *")
    check_file(lib.cairn_pose_table_write(path_of(path), rows, count, error), error, str(path))


Logs = Union[Log, Sequence[Log]]


def map(
    log: Logs,
    *,
    odometry: bool = True,
    keyframes: int = 4096,
    release: bool = False,
    loops: bool = True,
    window: int = 8,
    sweep: float = 0.0,
    particles: int = 0,
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
    sweep
        Duration of a scan, first to last beam, s, for logs without it.
    particles
        Rao-Blackwellized particle filter of this many particles; 0: the mapper.
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
    logs = [log] if isinstance(log, Log) else list(log)
    job = _Job(logs, odometry, keyframes, release, loops, window, sweep, particles, seed, params)
    capacity, most = FIRST_CAPACITY, 2 * int(lib.cairn_mapper_default().scan.max_points)
    while capacity < most:
        mapper = job.run(capacity)
        if mapper is not None:
            return job.result(mapper, (resolution, range, clear))
        capacity *= 2
    raise FullError(
        f"{logs[0].path}: the keyframes have more than {MAX_KEYFRAME_ELEMENTS} points or segments"
    )


@dataclass
class _Job:
    """The settings of `map`, and its passes over the logs."""

    logs: list[Log]
    odometry: bool
    keyframes: int
    release: bool
    loops: bool
    window: int
    sweep: float
    particles: int
    seed: int
    params: dict[str, Any]

    def __post_init__(self) -> None:
        self.scans = [(scan, i) for i, log in enumerate(self.logs) for scan in log]
        if not self.scans:
            raise EmptyError("the log has no scan, expected at least one")
        for value, name in ((self.release, "release"), (not self.loops, "loops=False")):
            if value and self.particles > 0:
                raise BadArgumentError(f"{name} with particles, expected one of them")
        if self.release and not self.loops:
            raise BadArgumentError("release with loops=False: culling needs the pose graph")
        self.odometry = self.odometry and any(log.has_odometry for log in self.logs)

    def mapper_params(self, points: int) -> Any:
        """Returns the mapper's params with a capacity of `points` points per keyframe."""
        count, beams = len(self.scans), max(log.beams for log in self.logs)
        params = ffi.new("cairn_mapper_params *")
        params[0] = default_params(min(self.keyframes, count), beams)
        params.cull_keyframes = self.release and self.keyframes < count
        params.window = self.window
        if not self.loops:
            params.loop.max_loops = params.local_span = 0
        params.field.potential = 1
        if 0 < self.window <= params.window_free:
            params.window_free = self.window - 1
        all_points = params.max_keyframes * points
        params.max_keyframe_points = min(all_points + params.scan.max_points, MAX_KEYFRAME_ELEMENTS)
        params.max_keyframe_segments = min(
            all_points // 4 + params.scan.max_segments, MAX_KEYFRAME_ELEMENTS
        )
        set_fields(params, self.params)
        return params

    def new_mapper(self, points: int) -> Mapper | FilterMapper:
        """Returns the mapper of one pass."""
        params = self.mapper_params(points)
        if self.particles <= 0:
            return Mapper._with(params)
        values = ffi.new("cairn_filter_mapper_params *")
        values[0] = lib.cairn_filter_mapper_default()
        values.front = params[0]
        values.particles, values.seed = self.particles, self.seed
        return FilterMapper._with(values)

    def run(self, points: int) -> Mapper | FilterMapper | None:
        """Maps all scans; None: the capacity for points is too small."""
        mapper = self.new_mapper(points)
        most = int(
            mapper._params.max_keyframes
            if self.particles <= 0
            else mapper._params.front.max_keyframes
        )
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
                error.file = self.logs[log].path
                error.args = (f"{error.file}:{scan.line}: the scan cannot be used: {error}",)
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

    def result(
        self, mapper: Mapper | FilterMapper, settings: tuple[float, float, float]
    ) -> MapResult:
        """Returns what the mapper has found."""
        kept, poses = mapper._kept, mapper.trajectory
        table = kept.table
        table["after"][:] = poses
        graph = mapper.graph if isinstance(mapper, Mapper) and self.loops else None
        keyframes = mapper.keyframes if isinstance(mapper, Mapper) else mapper.path()
        return MapResult(
            poses,
            table["covariance"].copy(),
            table["support"].copy(),
            kept.verdicts(),
            keyframes,
            table["stamp_ns"].copy(),
            table["line"].copy(),
            graph,
            mapper.state,
            kept,
            settings,
        )
