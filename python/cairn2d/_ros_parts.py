"""What the ROS 2 node is made of that needs no ROS: times, odometry, transforms, parameters."""

from __future__ import annotations

import collections
import difflib
import math
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from ._base import BadArgumentError, Float64, Pose, pose_of
from ._cairn import lib
from .logs import IDENTITY

# Names of parameters that are those of the node, with their defaults.
OWN: dict[str, Any] = {
    "map_frame": "map",
    "odom_frame": "odom",
    "base_frame": "base_link",
    "sensor_pose": [0.0, 0.0, 0.0],
    "reliable": False,
    "map_period": 2.0,
    "resolution": 0.05,
    "range": 30.0,
    "clear": 5.0,
    "map_path": "map.yaml",
    "keyframes": 4096,
    "odom_wait": 0.5,
}
# Those of them that are above 0, or at least 0.
POSITIVE, NOT_NEGATIVE = ("map_period", "resolution", "range"), ("clear", "odom_wait")
# Odometry that is kept for scans that come late.
KEPT_ODOMETRY = 4000
# A gap between two scans of more than this many scan periods has room for another scan.
LONG_GAP_PERIODS = 1.5
# A gap of less than this many scan periods ends with a scan that came late.
SHORT_GAP_PERIODS = 0.5
# The last gaps, of a scanner that does not tell its period: from this number of gaps their median
# is the period, when this share of them are whole multiples of it, up to this part of it.
GAPS, LEAST_GAPS, EVEN_SHARE, EVEN_TOLERANCE = 50, 20, 0.9, 0.1
NS = 10**9
# Scans that are refused one after another: the node does not map.
REFUSED_IN_A_ROW = 10
# Variances of a pose that no match gives: of x and y, m², and of the heading, rad².
UNKNOWN_POSITION, UNKNOWN_HEADING = 1e3, math.pi**2
# Places of x, y and the rotation about z among the six coordinates of a covariance of ROS.
PLANE = (0, 1, 5)


def flat(params: dict[str, Any], before: str = "") -> dict[str, Any]:
    """Returns nested parameters with dots in their names; only numbers."""
    out: dict[str, Any] = {}
    for name, value in params.items():
        if isinstance(value, dict):
            out |= flat(value, f"{before}{name}.")
        elif isinstance(value, (int, float)):
            out[before + name] = value
    return out


def nested(values: dict[str, Any]) -> dict[str, Any]:
    """Returns parameters with dots in their names as groups."""
    out: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split(".")
        inner = out
        for group in groups:
            inner = inner.setdefault(group, {})
        inner[last] = value
    return out


def check_own(own: dict[str, Any]) -> None:
    """Raises an exception when a parameter of the node itself is out of range."""
    for name in POSITIVE + NOT_NEGATIVE:
        value, above_zero = own[name], name in POSITIVE
        if not math.isfinite(value) or value < 0 or (value == 0 and above_zero):
            expected = "a number above 0" if above_zero else "a number of at least 0"
            raise BadArgumentError(f"{name} is {value:.9g}, expected {expected}")
    pose = list(own["sensor_pose"])
    if len(pose) != len(Pose._fields) or not all(map(math.isfinite, pose)):
        expected = "three finite numbers: x, y in m, theta in rad"
        raise BadArgumentError(f"sensor_pose is {pose}, expected {expected}")


def check_names(given: Iterable[str], known: Collection[str]) -> None:
    """Raises an exception when a parameter is given that there is not."""
    for name in given:
        if name not in known:
            nearest = difflib.get_close_matches(name, known, 1)
            hint = f"; the nearest is {nearest[0]}" if nearest else ""
            raise BadArgumentError(f"there is no parameter {name}{hint}")


def stamp_ns(stamp: Any) -> int:
    """Returns a time of ROS in ns."""
    return int(stamp.sec) * NS + int(stamp.nanosec)


def heading(q: Any) -> float:
    """Returns the heading of a quaternion, rad."""
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def map_covariance(covariance: Float64, turn: float) -> Float64:
    """Returns the covariance of a pose as ROS has it, shape (6, 6), in the frame of the map.

    Parameters
    ----------
    covariance
        Shape (3, 3) over (x, y, theta), m and rad; not finite: not known, which gives large
        variances.
    turn
        Heading in the map of the frame that `covariance` refers to, rad.
    """
    if np.all(np.isfinite(covariance)):
        c, s = math.cos(turn), math.sin(turn)
        rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        turned = rotation @ covariance @ rotation.T
    else:
        turned = np.diag([UNKNOWN_POSITION, UNKNOWN_POSITION, UNKNOWN_HEADING])
    out = np.zeros((6, 6))
    out[np.ix_(PLANE, PLANE)] = turned
    return out


def health(lost: int, refused: int, in_a_row: int, full: int = 0) -> tuple[str, str]:
    """Returns the level of the diagnostics, ``"OK"``, ``"WARN"`` or ``"ERROR"``, and their message.

    Parameters
    ----------
    lost
        Scans that were lost.
    refused, in_a_row
        Scans that were refused, and those since the last one that was mapped.
    full
        Keyframes of a full store; 0: there is room.
    """
    if full:
        said = f"the store of {full} keyframes is full, no scan is mapped"
        return "ERROR", f"{said}: raise keyframes, or begin a new map by initialpose"
    parts = [f"{lost} scans lost"] if lost else []
    parts += [f"{refused} scans refused"] if refused else []
    if in_a_row >= REFUSED_IN_A_ROW:
        return "ERROR", ", ".join([*parts, f"the last {in_a_row} without a break"])
    return ("WARN", ", ".join(parts)) if parts else ("OK", "mapping")


class OdometryBuffer:
    """Poses by odometry in the order of their times, interpolated at those of scans."""

    def __init__(self) -> None:
        self.poses: collections.deque[tuple[int, Pose]] = collections.deque(maxlen=KEPT_ODOMETRY)

    def add(self, time: int, pose: Pose) -> None:
        """Adds a pose; one that is not later than the last is left out."""
        if not self.poses or time > self.poses[-1][0]:
            self.poses.append((time, pose))

    def covers(self, time: int) -> bool:
        """Returns whether odometry has come that is not earlier than a time."""
        return bool(self.poses) and self.poses[-1][0] >= time

    def at(self, time: int) -> Pose | None:
        """Returns the pose at a time, by a constant twist between two; the nearest one outside."""
        if not self.poses:
            return None
        before = self.poses[0]
        for after in self.poses:
            if after[0] == time:
                return after[1]
            if after[0] > time:
                return self._between(before, after, time)
            before = after
        return before[1]

    @staticmethod
    def _between(before: tuple[int, Pose], after: tuple[int, Pose], time: int) -> Pose:
        if after[0] <= before[0]:
            return after[1]
        share = (time - before[0]) / (after[0] - before[0])
        motion = lib.cairn_pose_between(tuple(before[1]), tuple(after[1]))
        part = lib.cairn_twist_exp(lib.cairn_twist_log(motion), share)
        return pose_of(lib.cairn_pose_compose(tuple(before[1]), part))


class Transforms:
    """Transforms between the frames of a robot: of each frame its pose in its parent."""

    def __init__(self) -> None:
        self.parents: dict[str, tuple[str, Pose]] = {}

    def add(self, parent: str, frame: str, pose: Pose) -> None:
        """Takes the pose of a frame in its parent."""
        self.parents[frame] = parent, pose

    def between(self, above: str, frame: str) -> Pose | None:
        """Returns the pose of a frame in one above it; None: no transforms lead up to that."""
        pose, passed = IDENTITY, set()
        while frame != above:
            if frame in passed or frame not in self.parents:
                return None
            passed.add(frame)
            parent, parent_frame = self.parents[frame]
            pose, frame = parent_frame @ pose, parent
        return pose


class LossCounter:
    """Counts the scans that were lost, from the gaps between their times.

    A gap tells of lost scans only where the period of the scanner is known: by its messages, or
    since its scans come evenly. Scans that come at once after a long gap were late, not lost: the
    next gap of one period decides.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.missing = 0
        self.last: int | None = None
        self.gaps: collections.deque[int] = collections.deque(maxlen=GAPS)

    def add(self, time: int, period: float = 0.0) -> int:
        """Takes the time of a scan; returns how many are now known to be lost before it.

        Parameters
        ----------
        time
            ns.
        period
            Time from scan to scan, ns; 0: not known.
        """
        gap = 0 if self.last is None else time - self.last
        self.last = time
        if gap <= 0:
            return 0
        self.gaps.append(gap)
        period = period if period > 0 else self._even_period()
        if period <= 0:
            self.missing = 0
            return 0
        if gap > LONG_GAP_PERIODS * period:
            self.missing += round(gap / period) - 1
            return 0
        if self.missing and gap < SHORT_GAP_PERIODS * period:
            self.missing -= 1
            return 0
        lost, self.missing = self.missing, 0
        self.lost += lost
        return lost

    def _even_period(self) -> float:
        """Returns the median of the last gaps, ns; 0: they are few or uneven."""
        if len(self.gaps) < LEAST_GAPS:
            return 0.0
        gaps = np.array(self.gaps)
        period = float(np.median(gaps))
        periods = gaps / period
        even = np.abs(periods - np.round(periods)) <= EVEN_TOLERANCE
        return period if np.mean(even) >= EVEN_SHARE else 0.0
