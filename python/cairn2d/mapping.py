"""Online SLAM: scans in, poses and a map of keyframes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    EmptyError,
    Float64,
    NoMemoryError,
    ParameterError,
    Pose,
    Result,
    check,
    checked,
    create,
    error_of,
    get_fields,
    new_fault,
    pose_in,
    pose_of,
    set_fields,
    text,
)
from ._cairn import ffi, lib
from ._kept import Kept
from .graphs import PoseGraph
from .grids import Grid
from .logs import IDENTITY, Scan

LOOP_VERDICTS = (
    "accepted",
    "pending",
    "no match",
    "ambiguous",
    "free space violation",
    "outlier",
    "unlikely",
)


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
    error_probability : float
        Probability that an accepted closure is off by more than 0.2 m or 2 degrees.
    """

    first: int
    second: int
    relative: Pose
    verdict: str
    error_probability: float


OneMapper = TypeVar("OneMapper", bound="OnlineMapper")


class OnlineMapper:
    """What `Mapper` and `FilterMapper` share: scans in, the scans that were mapped, their map."""

    # Module of the C library that maps.
    _module: str

    @classmethod
    def _with(cls: type[OneMapper], params: Any) -> OneMapper:
        mapper = cls.__new__(cls)
        mapper._begin(params)
        return mapper

    def _begin(self, params: Any) -> None:
        checked(self._module, params)
        self._params = params
        self._object, self._pool = create(self._module, params)
        self._kept, self._culled = Kept(), 0

    def _front(self) -> Any:
        """Returns the ``cairn_mapper`` that matches the scans."""
        raise NotImplementedError

    def _capacity(self) -> int:
        """Returns the most keyframes."""
        raise NotImplementedError

    @property
    def keyframes(self) -> Float64:
        """Current poses of the keyframes, shape (keyframes, 3), m and rad."""
        raise NotImplementedError

    def add(self, scan: Scan, odometry: ArrayLike | None = None) -> ScanPose:
        """Maps a scan.

        Parameters
        ----------
        scan
            The scan.
        odometry
            Pose (x, y, theta) of the robot in the odometry frame; None: that of the scan.

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
        map_scan = getattr(lib, f"cairn_{self._module}_map")
        check_scan(map_scan(self._object, source, odometry, fault), scan, fault)
        self._keep(scan)

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
            text(lib.cairn_placed_scan_verdict(result.verdict)),
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

        Returns
        -------
        Grid
            The map.
        """
        self._kept.table["after"][:] = self._poses()
        return self._kept.grid(resolution, range, clear)

    @property
    def state(self) -> dict[str, Any]:
        """Counters over the life of the mapper: fields of ``cairn_mapper_state``."""
        return get_fields(lib.cairn_mapper_measure(self._front()))


class Mapper(OnlineMapper):
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

    _module = "mapper"

    def __init__(self, beams: int, *, keyframes: int = 1024, **params: Any) -> None:
        values = ffi.new("cairn_mapper_params *")
        values[0] = default_params(keyframes, beams)
        set_fields(values, params)
        self._begin(values)

    def _begin(self, params: Any) -> None:
        super()._begin(params)
        self._waiting: Scan | None = None

    def _front(self) -> Any:
        return self._object

    def _capacity(self) -> int:
        return int(self._params.max_keyframes)

    @property
    def params(self) -> dict[str, Any]:
        """All parameters: fields of ``cairn_mapper_params``, groups as dicts."""
        return get_fields(self._params[0])

    @property
    def memory(self) -> int:
        """Bytes of the mapper's pool."""
        return int(self._pool.bytes)

    def begin(self, scan: Scan, odometry: ArrayLike | None = None) -> None:
        """Takes a scan, as `add` does, whose work `step` then does in bounded pieces.

        Parameters
        ----------
        scan, odometry
            As of `add`.

        Raises
        ------
        BusyError
            The last scan is still being worked on; nothing was taken.
        """
        fault = new_fault()
        status = lib.cairn_mapper_add(self._object, scan._input, odometry_of(scan, odometry), fault)
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
        status = lib.cairn_mapper_step(self._object, budget)
        if status == lib.CAIRN_MORE:
            self._reattach()
            return None
        scan, self._waiting = self._waiting, None
        check_scan(status, scan)
        self._keep(scan)
        return self._last()

    def settle(self) -> None:
        """Decides all pending loop closures and optimizes the graph; more scans may follow."""
        budget = ffi.new("cairn_budget *")
        status = lib.CAIRN_MORE
        while status == lib.CAIRN_MORE:
            budget.left = lib.CAIRN_CAPACITY_SETTLE_UNITS
            status = check(lib.cairn_mapper_settle(self._object, budget), "mapper")
            self._reattach()

    def _poses(self) -> Float64:
        kept = self._kept
        check(lib.cairn_placed_scans_place(kept.scans, kept.places, kept.count, self._object))
        return kept.table["after"].copy()

    @property
    def map_odom(self) -> Pose:
        """Pose of the odometry frame in the map, as ROS calls the transform map to odom."""
        return pose_of(lib.cairn_mapper_map_odom(self._object))

    @property
    def keyframes(self) -> Float64:
        """Current poses of the keyframes, shape (keyframes, 3), m and rad."""
        count = int(lib.cairn_mapper_measure(self._object).keyframes)
        pose = lib.cairn_mapper_keyframe_pose
        poses = [tuple(pose_of(pose(self._object, i))) for i in range(count)]
        return np.array(poses, np.float64).reshape(-1, 3)

    @property
    def loops(self) -> list[LoopEvent]:
        """The last loop events, at most 64, the oldest first."""
        count = int(lib.cairn_mapper_measure(self._object).loop_events)
        events = [
            lib.cairn_mapper_loop_at(self._object, i) for i in range(max(count - 64, 0), count)
        ]
        return [
            LoopEvent(
                int(e.first),
                int(e.second),
                pose_of(e.first_second),
                LOOP_VERDICTS[e.verdict],
                float(e.error_probability),
            )
            for e in events
        ]

    @property
    def graph(self) -> PoseGraph:
        """The pose graph of the keyframes, without rejected links."""
        links = [
            link
            for link in (
                lib.cairn_mapper_link_at(self._object, i)
                for i in range(lib.cairn_mapper_link_count(self._object))
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
        keyframes = int(lib.cairn_mapper_measure(self._object).keyframes)
        return f"Mapper({len(self)} scans, {keyframes} keyframes)"


def check_sizes(keyframes: int, beams: int) -> None:
    """Raises a `ParameterError` for a number of keyframes or beams below 1."""
    if beams < 1 or keyframes < 1:
        name, value = ("beams", beams) if beams < 1 else ("keyframes", keyframes)
        raise ParameterError(
            f"mapper: {name} is {value}, expected at least 1", "mapper", name, value, 1, 2**20, ""
        )


def default_params(keyframes: int, beams: int) -> Any:
    """Returns the mapper's parameters for a number of keyframes and beams."""
    check_sizes(keyframes, beams)
    return lib.cairn_mapper_default_for(min(keyframes, 2**20), min(beams, 100_000))


def odometry_of(scan: Scan, odometry: ArrayLike | None) -> Any:
    """Returns the odometry of a scan as C takes it."""
    pose = scan.odometry if odometry is None else pose_in(odometry, "odometry")
    return ffi.NULL if pose is None else ffi.new("cairn_pose *", tuple(pose))


def check_scan(status: int, scan: Scan, fault: Any = None) -> None:
    """Raises the exception of a scan that is refused."""
    if status < 0:
        raise error_of(status, "scan", fault=fault, file=scan.path, line=scan.line or None)
