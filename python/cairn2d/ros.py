"""A ROS 2 node that maps: ``python -m cairn2d.ros --ros-args -p NAME:=VALUE``.

Topics in: ``scan`` (sensor_msgs/LaserScan), ``odom`` (nav_msgs/Odometry) and, where tf2_msgs is
installed, ``tf_static`` for the mounting of the scanner; ``initialpose`` begins a new map at a
pose.
Topics out: ``map`` (nav_msgs/OccupancyGrid, transient local), ``pose``
(geometry_msgs/PoseWithCovarianceStamped), ``path`` (nav_msgs/Path), ``diagnostics``
(diagnostic_msgs/DiagnosticArray), and on ``tf``, where tf2_msgs is installed, the transform from
map to odometry (REP 105). Service: ``save_map`` (std_srvs/Trigger).

Parameters: ``map_frame``, ``odom_frame``, ``base_frame``; ``sensor_pose`` (x, y in m, theta in
rad); ``reliable`` (scans are never dropped); ``map_period`` (s); ``resolution``, ``range`` and
``clear`` (m); ``map_path``; ``keyframes``; ``odom_wait`` (s): how long a scan waits for odometry
that is later than it. Every number of ``cairn_mapper_params`` is a parameter too:
``keyframe_distance``, ``loop.min_consistent``.
"""

from __future__ import annotations

import collections
import math
import os
import sys
import time
from typing import Any

import numpy as np

from ._base import CairnError, Pose, checked, get_fields, pose_of, set_fields
from ._cairn import ffi, lib
from .logs import IDENTITY, Scan, from_ros
from .mapping import Mapper, default_params

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
# Most of the time that is spent on drawing the map, which takes longer as it grows.
DRAWING_SHARE = 0.2
# Beams that the defaults of the mapper are shown for before the first scan.
SHOWN_BEAMS = 541


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


def check_params(keyframes: int, values: dict[str, Any]) -> None:
    """Raises an exception when the mapper would refuse its parameters."""
    params = ffi.new("cairn_mapper_params *")
    params[0] = default_params(keyframes, SHOWN_BEAMS)
    set_fields(params, values)
    checked("mapper", params)


def stamp_ns(stamp: Any) -> int:
    """Returns a time of ROS in ns."""
    return int(stamp.sec) * NS + int(stamp.nanosec)


def heading(q: Any) -> float:
    """Returns the heading of a quaternion, rad."""
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def set_pose(target: Any, pose: Pose) -> None:
    """Sets a geometry_msgs/Pose."""
    target.position.x, target.position.y = pose.x, pose.y
    target.orientation.z, target.orientation.w = math.sin(pose.theta / 2), math.cos(pose.theta / 2)


def set_transform(target: Any, pose: Pose) -> None:
    """Sets a geometry_msgs/Transform."""
    target.translation.x, target.translation.y = pose.x, pose.y
    target.rotation.z, target.rotation.w = math.sin(pose.theta / 2), math.cos(pose.theta / 2)


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


def make_node() -> Any:
    """Returns the node; rclpy is initialized."""
    from diagnostic_msgs.msg import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
        DiagnosticArray,
        DiagnosticStatus,
        KeyValue,
    )
    from geometry_msgs.msg import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
        PoseStamped,
        PoseWithCovarianceStamped,
        TransformStamped,
    )
    from nav_msgs.msg import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
        OccupancyGrid,
        Odometry,
        Path,
    )
    from rclpy.node import Node  # type: ignore[import-not-found, import-untyped, unused-ignore]
    from rclpy.qos import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
        DurabilityPolicy,
        HistoryPolicy,
        QoSProfile,
        ReliabilityPolicy,
    )
    from sensor_msgs.msg import LaserScan  # type: ignore[import-not-found, import-untyped, unused-ignore]
    from std_srvs.srv import Trigger  # type: ignore[import-not-found, import-untyped, unused-ignore]

    try:
        from tf2_msgs.msg import TFMessage  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        TFMessage = None

    class MapNode(Node):  # type: ignore[misc, unused-ignore]
        """The node."""

        def __init__(self) -> None:
            super().__init__("cairn")
            self.own = {k: self.declare_parameter(k, v).value for k, v in OWN.items()}
            self.values = self._mapper_values()
            check_params(int(self.own["keyframes"]), nested(self.values))
            self.sensor = Pose(*(float(v) for v in self.own["sensor_pose"]))
            self.start = IDENTITY
            self.mapper: Mapper | None = None
            self.odometry, self.losses = OdometryBuffer(), LossCounter()
            self.waiting: collections.deque[Any] = collections.deque()
            self.path, self.verdicts = Path(), collections.Counter[str]()
            self.scans_drawn, self.draw_from = 0, 0.0
            reliable = bool(self.own["reliable"])
            keep_all = QoSProfile(
                history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE
            )
            sensor = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            quality = keep_all if reliable else sensor
            self.create_subscription(LaserScan, "scan", self.on_scan, quality)
            self.create_subscription(
                Odometry, "odom", self.on_odometry, keep_all if reliable else 50
            )
            self.create_subscription(
                PoseWithCovarianceStamped, "initialpose", self.on_initial_pose, 1
            )
            self.map_out = self.create_publisher(OccupancyGrid, "map", latched)
            self.pose_out = self.create_publisher(
                PoseWithCovarianceStamped, "pose", keep_all if reliable else 10
            )
            self.path_out = self.create_publisher(Path, "path", 1)
            self.diagnostics_out = self.create_publisher(DiagnosticArray, "diagnostics", 10)
            self.tf_out = None
            if TFMessage is not None:
                self.tf_out = self.create_publisher(TFMessage, "tf", 50)
                self.create_subscription(TFMessage, "tf_static", self.on_static, latched)
            self.create_service(Trigger, "save_map", self.on_save)
            self.create_timer(float(self.own["map_period"]), self.on_timer)
            self.create_timer(0.05, self.map_waiting)
            self.scan_frame = ""

        def _mapper_values(self) -> dict[str, Any]:
            """Declares the mapper's parameters; returns those that were set."""
            defaults = flat(get_fields(default_params(OWN["keyframes"], SHOWN_BEAMS)))
            out = {}
            for name, value in defaults.items():
                if name in OWN or name.startswith("scan.max_"):
                    continue
                given = self.declare_parameter(name, value).value
                if given != value:
                    out[name] = given
            return out

        # ---- In ----

        def on_scan(self, message: Any) -> None:
            """Takes a scan; it waits for odometry that is not earlier."""
            at = stamp_ns(message.header.stamp)
            lost = self.losses.add(at, message.scan_time * NS)
            if lost:
                self.get_logger().warning(f"{lost} scans lost, {self.losses.lost} in all")
            self.scan_frame = message.header.frame_id
            self.waiting.append((message, at, self.get_clock().now().nanoseconds))
            self.map_waiting()

        def on_odometry(self, message: Any) -> None:
            """Takes a pose by odometry."""
            position, q = message.pose.pose.position, message.pose.pose.orientation
            pose = Pose(position.x, position.y, heading(q))
            self.odometry.add(stamp_ns(message.header.stamp), pose)
            self.map_waiting()

        def on_static(self, message: Any) -> None:
            """Takes the mounting of the scanner from the static transforms."""
            for transform in message.transforms:
                ends = (transform.header.frame_id, transform.child_frame_id)
                if ends == (self.own["base_frame"], self.scan_frame):
                    t = transform.transform
                    self.sensor = Pose(t.translation.x, t.translation.y, heading(t.rotation))

        def on_initial_pose(self, message: Any) -> None:
            """Begins a new map at a pose."""
            pose = message.pose.pose
            self.start = Pose(pose.position.x, pose.position.y, heading(pose.orientation))
            self.mapper = None
            self.path.poses = []
            self.get_logger().info(f"a new map begins at {tuple(self.start)}")

        # ---- Work ----

        def map_waiting(self) -> None:
            """Maps the scans that need not wait any longer."""
            now = self.get_clock().now().nanoseconds
            while self.waiting:
                message, at, came = self.waiting[0]
                late = now - came > float(self.own["odom_wait"]) * NS
                if not self.odometry.covers(at) and not late:
                    return
                self.waiting.popleft()
                self.map_scan(message, at)

        def map_scan(self, message: Any, at: int) -> None:
            """Maps a scan and publishes its pose."""
            try:
                pose = self.odometry.at(at)
                scan = from_ros(message, sensor=self.sensor if pose else IDENTITY, odometry=pose)
                mapper = self.mapper_for(scan)
                result = mapper.add(scan)
            except CairnError as error:
                self.get_logger().error(f"the scan cannot be used: {error}")
                self.verdicts["refused"] += 1
                return
            self.verdicts[result.verdict] += 1
            map_robot = self.start @ result.pose if self.start != IDENTITY else result.pose
            self.publish_pose(message.header.stamp, map_robot, result.covariance)
            if self.tf_out is not None:
                self.publish_tf(message.header.stamp)

        def mapper_for(self, scan: Scan) -> Mapper:
            """Returns the mapper, made for the beams of the first scan."""
            if self.mapper is None:
                keyframes = int(self.own["keyframes"])
                self.mapper = Mapper(scan.beams, keyframes=keyframes, **nested(self.values))
            return self.mapper

        # ---- Out ----

        def publish_pose(self, stamp: Any, pose: Pose, covariance: Any) -> None:
            """Publishes a pose, and the path with it."""
            out = PoseWithCovarianceStamped()
            out.header.stamp, out.header.frame_id = stamp, self.own["map_frame"]
            set_pose(out.pose.pose, pose)
            # x, y and the rotation about z of the six of ROS.
            places = np.array([0, 1, 5])
            matrix = np.zeros((6, 6))
            matrix[np.ix_(places, places)] = np.nan_to_num(covariance)
            out.pose.covariance = matrix.ravel().tolist()
            self.pose_out.publish(out)
            step = PoseStamped()
            step.header, step.pose = out.header, out.pose.pose
            self.path.poses.append(step)

        def publish_tf(self, stamp: Any) -> None:
            """Publishes the transform from map to odometry."""
            assert self.mapper is not None
            out = TransformStamped()
            out.header.stamp, out.header.frame_id = stamp, self.own["map_frame"]
            out.child_frame_id = self.own["odom_frame"]
            set_transform(out.transform, self.start @ self.mapper.map_odom)
            assert self.tf_out is not None
            self.tf_out.publish(TFMessage(transforms=[out]))

        def on_timer(self) -> None:
            """Publishes map, path and diagnostics."""
            self.publish_diagnostics()
            begin = time.monotonic()
            if self.mapper is None or len(self.mapper) == self.scans_drawn:
                return
            if begin < self.draw_from:
                return
            self.publish_map()
            end = time.monotonic()
            self.draw_from = end + (end - begin) * (1 / DRAWING_SHARE - 1)

        def publish_map(self) -> None:
            """Publishes the map, and the path at the current poses."""
            assert self.mapper is not None
            self.scans_drawn = len(self.mapper)
            grid = self.grid()
            out = OccupancyGrid()
            out.header.stamp = self.get_clock().now().to_msg()
            out.header.frame_id = self.own["map_frame"]
            out.info.map_load_time = out.header.stamp
            out.info.resolution = grid.resolution
            out.info.height, out.info.width = grid.shape
            set_pose(out.info.origin, self.start @ grid.origin)
            out.data = grid.occupancy.ravel().tolist()
            self.map_out.publish(out)
            self.path.header = out.header
            for step, pose in zip(self.path.poses, self.mapper.trajectory.tolist()):
                set_pose(step.pose, self.start @ Pose(*pose))
            self.path_out.publish(self.path)

        def grid(self) -> Any:
            """Returns the map."""
            assert self.mapper is not None
            return self.mapper.grid(self.own["resolution"], self.own["range"], self.own["clear"])

        def publish_diagnostics(self) -> None:
            """Publishes verdicts and lost scans."""
            status = DiagnosticStatus(name="cairn: mapper", hardware_id="cairn")
            status.level = DiagnosticStatus.WARN if self.losses.lost else DiagnosticStatus.OK
            status.message = f"{self.losses.lost} scans lost" if self.losses.lost else "mapping"
            values = {**self.verdicts, "lost": self.losses.lost, "waiting": len(self.waiting)}
            if self.mapper is not None:
                values |= {name: self.mapper.state[name] for name in ("keyframes", "loops")}
            status.values = [KeyValue(key=str(k), value=str(v)) for k, v in values.items()]
            out = DiagnosticArray(status=[status])
            out.header.stamp = self.get_clock().now().to_msg()
            self.diagnostics_out.publish(out)

        def on_save(self, request: Any, response: Any) -> Any:
            """Settles the graph and writes the map."""
            try:
                if self.mapper is None:
                    raise CairnError("there is no scan yet")
                self.mapper.settle()
                path = os.path.abspath(self.own["map_path"])
                self.grid().save(path)
                response.success, response.message = True, path
            except CairnError as error:
                response.success, response.message = False, str(error)
            return response

    return MapNode()


def main(arguments: list[str] | None = None) -> int:
    """Runs the node until it is interrupted."""
    try:
        import rclpy  # type: ignore[import-not-found, import-untyped, unused-ignore]
        from rclpy.executors import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
            ExternalShutdownException,
        )
    except ImportError as error:
        print(f"cairn2d.ros: {error}; the node needs rclpy and the messages", file=sys.stderr)
        return 1
    rclpy.init(args=arguments)
    try:
        node = make_node()
    except CairnError as error:
        print(f"cairn2d.ros: {error}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        # An interrupt shuts the context down while a callback publishes.
        if rclpy.ok():
            raise
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
