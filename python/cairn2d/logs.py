"""Range scans and logs of them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    EmptyError,
    Float32,
    Float64,
    Int64,
    PathLike,
    Pose,
    Result,
    UnsupportedError,
    array,
    check_file,
    frame,
    path_of,
    pointer,
    pose_in,
    pose_of,
    text,
    view,
)
from ._cairn import ffi, lib
from ._log_files import LogFile
from .log_sources import LogSources, sources_of
from .scanner_checks import ScannerCheck, check_scanner

IDENTITY = Pose(0.0, 0.0, 0.0)
KINDS = ("carmen", "csv", "urg", "csm", "bag")
# Share of returns below which the limit of the ranges is unreliable.
FEW_RETURNS = 0.1


class Scan:
    """One sweep of a range scanner.

    Parameters
    ----------
    ranges
        Shape (beams,), m. ``inf`` means no return, ``nan`` or a value <= 0 an invalid reading.
    angle_min, angle_step
        Bearing of the first beam, and from beam to beam, rad.
    angles
        Shape (beams,), rad: bearings in place of `angle_min` and `angle_step`.
    range_min, range_max, range_sigma
        Limits of valid ranges and the standard deviation of a range, m.
    time_step
        Time from beam to beam, s; 0: unknown.
    stamp_ns
        Time of the first beam, ns.
    sensor
        Pose (x, y, theta) of the sensor on the robot, m and rad.
    motion
        Pose of the robot at the last beam in its frame at the first beam.
    odometry
        Pose of the robot in the odometry frame at the first beam; None: not known.
    line
        Line of the scan in its file, from 1; 0: none.
    path
        The file, which errors name; None: none.
    """

    def __init__(
        self,
        ranges: ArrayLike,
        angle_min: float = -np.pi / 2,
        angle_step: float = np.pi / 180,
        *,
        angles: ArrayLike | None = None,
        range_min: float = 0.0,
        range_max: float = 80.0,
        range_sigma: float = 0.01,
        time_step: float = 0.0,
        stamp_ns: int = 0,
        sensor: ArrayLike = IDENTITY,
        motion: ArrayLike = IDENTITY,
        odometry: ArrayLike | None = None,
        line: int = 0,
        path: str | None = None,
    ) -> None:
        self.ranges: Float32 = array(ranges, np.float32, (None,), "ranges")
        self.angles: Float32 | None = None
        if angles is not None:
            self.angles = array(angles, np.float32, (len(self.ranges),), "angles")
        self.odometry = None if odometry is None else Pose(*pose_in(odometry, "odometry"))
        self.line, self.path = line, path
        self._owner: Any = None
        self._input = ffi.new("cairn_scan_input *")
        self._input.range = pointer(self.ranges, "const float *")
        if self.angles is not None:
            self._input.angle = pointer(self.angles, "const float *")
        self._input.count = len(self.ranges)
        self._input.angle_min, self._input.angle_step = angle_min, angle_step
        self._input.range_min, self._input.range_max = range_min, range_max
        self._input.range_sigma, self._input.time_step = range_sigma, time_step
        self._input.stamp_ns = stamp_ns
        self._input.base_sensor = pose_in(sensor, "sensor")
        self._input.motion = pose_in(motion, "motion")

    @classmethod
    def _of(
        cls, source: Any, owner: Any, odometry: Pose | None, line: int = 0, path: str | None = None
    ) -> Scan:
        """Returns the scan of a ``cairn_scan_input`` whose arrays belong to `owner`."""
        scan = cls.__new__(cls)
        count = int(source.count)
        scan.ranges = view(source.range, (count,), "<f4", owner)
        scan.angles = None
        if source.angle != ffi.NULL:
            scan.angles = view(source.angle, (count,), "<f4", owner)
        scan.odometry, scan.line, scan.path, scan._owner = odometry, line, path, owner
        scan._input = ffi.new("cairn_scan_input *")
        scan._input[0] = source
        return scan

    @property
    def beams(self) -> int:
        """Number of beams."""
        return len(self.ranges)

    @property
    def bearings(self) -> Float32:
        """Bearing of every beam in the frame of the sensor, shape (beams,), rad."""
        if self.angles is not None:
            return self.angles
        return np.float32(self.angle_min) + np.arange(self.beams, dtype=np.float32) * np.float32(
            self.angle_step
        )

    @property
    def angle_min(self) -> float:
        """Bearing of the first beam, rad."""
        return float(self._input.angle_min)

    @property
    def angle_step(self) -> float:
        """Angle from beam to beam, rad."""
        return float(self._input.angle_step)

    @property
    def range_min(self) -> float:
        """Least valid range, m."""
        return float(self._input.range_min)

    @property
    def range_max(self) -> float:
        """Greatest valid range, m; a beam without return is free up to it."""
        return float(self._input.range_max)

    @property
    def stamp_ns(self) -> int:
        """Time of the first beam, ns."""
        return int(self._input.stamp_ns)

    @property
    def sensor(self) -> Pose:
        """Pose of the sensor on the robot, m and rad."""
        return pose_of(self._input.base_sensor)

    @property
    def points(self) -> Float64:
        """Ends of the beams with a return in the frame of the robot, shape (hits, 2), m."""
        ranges, bearings = self.ranges.astype(np.float64), self.bearings.astype(np.float64)
        hit = np.isfinite(ranges) & (ranges > self.range_min) & (ranges <= self.range_max)
        x, y, theta = self.sensor
        along = bearings[hit] + theta
        return np.column_stack((x + ranges[hit] * np.cos(along), y + ranges[hit] * np.sin(along)))

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the points of the scan into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        ax.plot(*self.points.T, ".", **{"markersize": 2, **style})
        ax.plot(*self.sensor[:2], "^")
        return ax

    def __repr__(self) -> str:
        where = f", line {self.line}" if self.line else ""
        return f"Scan({self.beams} beams, stamp_ns={self.stamp_ns}{where})"


@dataclass(frozen=True)
class LogInfo(Result):
    """Summary of a log.

    Attributes
    ----------
    kind : str
        ``"carmen"``, ``"csv"``, ``"urg"``, ``"csm"``, ``"bag"`` or ``"scans"``.
    scans, faults, ignored : int
        Scans, malformed records left out, and messages of other kinds.
    min_beams, max_beams : int
        Fewest and most beams of a scan.
    duration : float
        Time from the earliest to the latest scan, s.
    backward_stamps : int
        Scans with a stamp earlier than the scan before.
    path_length, path_turn : float
        Path over the odometry poses, m, and the sum of its rotations, rad.
    range_max : float
        Maximum range of scans without one of their own, m.
    sensor : Pose or None
        The sensor's pose on the robot where it is the same in all scans.
    origin : tuple of float
        x and y, m: all poses are relative to this place.
    taken : str
        What was taken of a bag.
    sources : LogSources or None
        The same by topics and frames; None: no bag.
    """

    kind: str
    scans: int
    faults: int
    ignored: int
    min_beams: int
    max_beams: int
    duration: float
    backward_stamps: int
    path_length: float
    path_turn: float
    range_max: float
    sensor: Pose | None
    origin: tuple[float, float]
    taken: str
    sources: LogSources | None


class Log(Sequence[Scan]):
    """Scans in the order of their recording: a sequence of `Scan`.

    Parameters
    ----------
    scans
        The scans.
    path
        Name of the log in messages.
    truth
        True poses of the robot at the scans, shape (scans, 3), m and rad; None: not known.
    """

    def __init__(
        self, scans: Iterable[Scan], path: str = "scans", truth: ArrayLike | None = None
    ) -> None:
        self._scans = list(scans)
        self._log: Any = None
        self._file: LogFile | None = None
        self.path = path
        self.faults: list[str] = []
        self.truth: Float64 | None = None
        if truth is not None:
            self.truth = array(truth, np.float64, (len(self._scans), 3), "truth")

    @classmethod
    def _of(cls, log: Any, file: LogFile) -> Log:
        """Returns a log that the C library has read of a file."""
        records, known = log.scans.record, bool(log.has_odometry)
        scans = [
            Scan._of(
                records[i].scan,
                log,
                pose_of(records[i].robot) if known else None,
                int(records[i].line),
                file.name,
            )
            for i in range(log.scans.count)
        ]
        out = cls(scans, file.name)
        out._log, out._file, out.faults = log, file, file.faults
        return out

    @overload
    def __getitem__(self, index: int) -> Scan: ...
    @overload
    def __getitem__(self, index: slice) -> Log: ...

    def __getitem__(self, index: int | slice) -> Scan | Log:
        if isinstance(index, slice):
            truth = None if self.truth is None else self.truth[index]
            return Log(self._scans[index], self.path, truth)
        return self._scans[index]

    def __len__(self) -> int:
        return len(self._scans)

    def __iter__(self) -> Iterator[Scan]:
        return iter(self._scans)

    @property
    def beams(self) -> int:
        """Most beams of a scan."""
        return max((scan.beams for scan in self._scans), default=0)

    @property
    def has_odometry(self) -> bool:
        """Whether all scans have a pose by odometry."""
        return bool(self._scans) and all(scan.odometry is not None for scan in self._scans)

    @property
    def odometry(self) -> Float64:
        """Poses of the robot by odometry, shape (scans, 3), m and rad; NaN where not known."""
        unknown = Pose(np.nan, np.nan, np.nan)
        poses = [scan.odometry or unknown for scan in self._scans]
        return np.array(poses, np.float64).reshape(-1, 3)

    @property
    def stamps_ns(self) -> Int64:
        """Times of the scans, shape (scans,), ns."""
        return np.array([scan.stamp_ns for scan in self._scans], np.int64)

    @property
    def info(self) -> LogInfo:
        """Summary of the log, as ``cairn info`` prints it."""
        if self._log is None:
            return self._count()
        info, kind = self._log.scans.info, KINDS[self._log.kind]
        return LogInfo(
            kind,
            int(info.scans),
            int(info.faults),
            int(info.ignored),
            int(info.min_beams),
            int(info.max_beams),
            (info.latest_ns - info.earliest_ns) * 1e-9,
            int(info.backward_stamps),
            info.odometry_length,
            info.odometry_turn,
            info.range_max,
            pose_of(info.base_sensor) if info.fixed_mounting else None,
            (info.origin[0], info.origin[1]),
            text(self._log.taken),
            sources_of(self._log.sources),
        )

    def _count(self) -> LogInfo:
        """Summary of scans that were not read from a file."""
        stamps, poses = self.stamps_ns, self.odometry
        step = np.diff(poses, axis=0)
        turn = np.abs((step[:, 2] + np.pi) % (2 * np.pi) - np.pi)
        mountings = {scan.sensor for scan in self._scans}
        known = self.has_odometry
        return LogInfo(
            "scans",
            len(self),
            0,
            0,
            min((scan.beams for scan in self._scans), default=0),
            self.beams,
            float(stamps.max() - stamps.min()) * 1e-9 if len(self) else 0.0,
            int(np.sum(np.diff(stamps) < 0)),
            float(np.sum(np.hypot(step[:, 0], step[:, 1]))) if known else 0.0,
            float(np.sum(turn)) if known else 0.0,
            max((scan.range_max for scan in self._scans), default=0.0),
            mountings.pop() if len(mountings) == 1 else None,
            (0.0, 0.0),
            "",
            None,
        )

    def check(self) -> ScannerCheck:
        """Finds what is set wrongly of the scanner, as ``cairn info --check`` does.

        Returns
        -------
        ScannerCheck
            Faults, and the keywords of `read` that mend them.
        """
        self._need_scans()
        # With so few returns the unit of the ranges, or their limit, may be wrong.
        if (
            self._file is not None
            and self._file.range_scale == 1
            and self._share_of_returns() < FEW_RETURNS
        ):
            return check_scanner(self._file.load_unlimited(), self.path)
        log, _keep = self._struct()
        return check_scanner(log, self.path)

    def save(self, path: PathLike) -> None:
        """Writes the scans as a table of ranges (CSV), as ``cairn info --scans`` does.

        `read` takes it: times, poses of the sensor where all scans have odometry, and the ranges
        with all bits.

        Parameters
        ----------
        path
            The file.

        Raises
        ------
        BadFormatError
            The scans differ in their bearings.
        """
        self._need_scans()
        (log, _keep), error = self._struct(), ffi.new("cairn_file_error *")
        status = lib.cairn_scan_table_write(log, path_of(path), error)
        check_file(status, error, os.fspath(path))

    def _need_scans(self) -> None:
        if not self._scans:
            raise EmptyError(f"{self.path} has no scan, expected at least one")

    def _struct(self) -> tuple[Any, Any]:
        """Returns the scans as a ``cairn_scan_log *``, and what must be kept alive."""
        if self._log is not None:
            return self._log, None
        log = ffi.new("cairn_scan_log *")
        records = ffi.new("cairn_carmen_log_record[]", len(self._scans))
        for record, scan in zip(records, self._scans):
            record.kind, record.count = lib.CAIRN_CARMEN_LOG_SCAN, scan.beams
            record.line, record.stamp_ns = scan.line, scan.stamp_ns
            record.robot = tuple(scan.odometry or IDENTITY)
            record.scan, record.range = scan._input[0], scan._input.range
        log.scans.record, log.scans.count = records, len(self._scans)
        log.has_odometry = int(self.has_odometry)
        return log, records

    def _share_of_returns(self) -> float:
        """Returns the share of returns among the valid ranges; 1 when all are returns."""
        ranges = np.concatenate([scan.ranges for scan in self._scans])
        none = int(np.isinf(ranges).sum())
        returns = int((ranges > 0).sum()) - int(np.isposinf(ranges).sum())
        return returns / (returns + none) if none else 1.0

    def to_pandas(self) -> Any:
        """Returns a data frame: stamp_ns, beams, and the pose by odometry."""
        x, y, theta = self.odometry.T
        beams = [scan.beams for scan in self._scans]
        return frame({"stamp_ns": self.stamps_ns, "beams": beams, "x": x, "y": y, "theta": theta})

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the path by odometry into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        ax.plot(*self.odometry.T[:2], **style)
        return ax

    def _repr_html_(self) -> str:
        return self.info._repr_html_()

    def __repr__(self) -> str:
        return f"Log({self.path!r}, {len(self)} scans, {self.beams} beams)"


def read(
    path: PathLike,
    *,
    scan: str | None = None,
    odom: str | None = None,
    range_max: float = 0.0,
    range_sigma: float = 0.01,
    flip: bool = False,
    range_scale: float = 1.0,
    angle_step: float = 0.0,
    sensor: ArrayLike | None = None,
    sweep: float = 0.0,
) -> Log:
    """Reads all scans of a file: CARMEN, table of ranges (CSV), URG, CSM, a bag of ROS 1 or 2.

    The format is that of the content. What is damaged is left out and listed in `Log.faults`.

    Parameters
    ----------
    path
        A file, plain or gzipped, or the folder of a bag.
    scan, odom
        Topics of scans and odometry in a bag (``"/tf"``: the transforms); None: the only one.
    range_max
        Ranges at or above it are no returns, m; 0: the maximum range of the file.
    range_sigma
        Standard deviation of the ranges, m.
    flip
        The scanner is upside down: bearings change their sign.
    range_scale
        Factor of all ranges: 0.001 for a log in mm.
    angle_step
        Angle between neighbouring beams, rad; the middle beam keeps its bearing. 0: of the log.
    sensor
        Pose (x, y, theta) of the sensor on the robot, m and rad; None: that of the log.
    sweep
        Duration of a scan, first to last beam, s, for logs without it; below 0: the last beam is
        measured first.

    Returns
    -------
    Log
        The scans.

    Raises
    ------
    CairnError
        The file cannot be read or has no scan, or a topic must be named.

    Notes
    -----
    What a log says wrongly of its scanner is found by `Log.check`, whose ``corrections`` are
    keywords of this function.
    """
    file = LogFile(
        path, scan, odom, range_max, range_sigma, flip, range_scale, angle_step, sensor, sweep
    )
    return Log._of(file.load(), file)


def from_ros(
    message: Any, *, sensor: ArrayLike = IDENTITY, odometry: ArrayLike | None = None
) -> Scan:
    """Returns the scan of a message ``sensor_msgs/LaserScan`` of ROS 1 or 2.

    Ranges at or above ``range_max`` are no returns, as in bags.

    Parameters
    ----------
    message
        The message, or an object with its fields.
    sensor
        Pose (x, y, theta) of the sensor on the robot, m and rad.
    odometry
        Pose (x, y, theta) of the robot in the odometry frame at the stamp of the message, m and
        rad; None: not known.

    Returns
    -------
    Scan
        The scan, with ranges of its own.
    """
    ranges = np.array(message.ranges, np.float32)
    range_max = float(message.range_max)
    if not range_max > 0:
        raise BadArgumentError(f"range_max of the message is {range_max}, expected m above 0")
    ranges[ranges >= np.float32(range_max)] = np.inf
    stamp = message.header.stamp
    seconds = getattr(stamp, "sec", None)
    if seconds is None:
        nanoseconds = int(stamp.secs) * 10**9 + int(stamp.nsecs)
    else:
        nanoseconds = int(seconds) * 10**9 + int(stamp.nanosec)
    return Scan(
        ranges,
        float(message.angle_min),
        float(message.angle_increment),
        range_min=max(float(message.range_min), 0.0),
        range_max=range_max,
        time_step=max(float(message.time_increment), 0.0),
        stamp_ns=nanoseconds,
        sensor=sensor,
        odometry=odometry,
    )


def stream(file: int, name: str = "standard input", **params: float) -> Iterator[Scan]:
    """Reads scans while they come: CARMEN, or a LaserScan as JSON a line.

    Parameters
    ----------
    file
        Descriptor of an open file; it is duplicated, and stays open.
    name
        Its name in messages.
    **params
        ``range_max`` and ``range_sigma`` as for `read`, m.

    Yields
    ------
    Scan
        Each scan as soon as its line has come.
    """
    settings = ffi.new("cairn_scan_log_params *")
    settings[0] = lib.cairn_scan_log_default()
    for key, value in params.items():
        if key not in ("range_max", "range_sigma"):
            raise TypeError(f"there is no parameter {key}; expected range_max or range_sigma")
        setattr(settings, key, value)
    error, opened = ffi.new("cairn_file_error *"), ffi.new("cairn_scan_log_stream **")
    check_file(
        lib.cairn_scan_log_stream_open(opened, os.dup(file), name.encode(), settings, error), error
    )
    source = ffi.gc(opened[0], lib.cairn_scan_log_stream_close)
    record, known = ffi.new("cairn_carmen_log_record *"), ffi.new("int32_t *")
    while True:
        status = lib.cairn_scan_log_stream_next(source, record, known, error)
        if status == lib.CAIRN_EMPTY:
            return
        check_file(status, error, name)
        if record.kind != lib.CAIRN_CARMEN_LOG_SCAN:
            continue
        yield _copy(record, bool(known[0]), name)


def _copy(record: Any, has_odometry: bool, path: str) -> Scan:
    """Returns a scan with arrays of its own."""
    source = record.scan
    shape = (int(source.count),)
    angles = None
    if source.angle != ffi.NULL:
        angles = view(source.angle, shape, "<f4", None).copy()
    return Scan(
        view(source.range, shape, "<f4", None).copy(),
        source.angle_min,
        source.angle_step,
        angles=angles,
        range_min=source.range_min,
        range_max=source.range_max,
        range_sigma=source.range_sigma,
        time_step=source.time_step,
        stamp_ns=source.stamp_ns,
        sensor=pose_of(source.base_sensor),
        motion=pose_of(source.motion),
        odometry=pose_of(record.robot) if has_odometry else None,
        line=int(record.line),
        path=path,
    )


def need_odometry(log: Log) -> None:
    """Raises an exception when a log has no poses."""
    if not log.has_odometry:
        raise UnsupportedError(f"{log.path} has no odometry, expected poses of its scans")
