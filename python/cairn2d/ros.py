"""A ROS 2 node that maps: ``python -m cairn2d.ros --ros-args -p NAME:=VALUE``.

Topics in: ``scan`` (sensor_msgs/LaserScan), ``odom`` (nav_msgs/Odometry); ``initialpose`` begins
a new map at a pose. Where tf2_msgs is installed, ``tf_static`` for the mounting of the scanner, and
``tf`` for odometry where no ``odom`` is published. Whether odometry is used, and which, is decided
at the first scan of a map; without it the poses are those of the scanner.
Topics out: ``map`` (nav_msgs/OccupancyGrid, transient local), ``pose``
(geometry_msgs/PoseWithCovarianceStamped), ``path`` (nav_msgs/Path), ``diagnostics``
(diagnostic_msgs/DiagnosticArray), and with odometry on ``tf`` the transform from map to odometry
(REP 105). Service: ``save_map`` (std_srvs/Trigger).

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

from ._base import CairnError, FullError, Pose, checked, get_fields, set_fields
from ._cairn import ffi
from ._ros_parts import (
    NS,
    OWN,
    LossCounter,
    OdometryBuffer,
    Transforms,
    check_names,
    check_own,
    flat,
    heading,
    health,
    map_covariance,
    nested,
    stamp_ns,
)
from .logs import IDENTITY, Scan, from_ros
from .mapping import Mapper, default_params

# Messages that are kept until the node takes them: unless `reliable`, and of fixed transforms.
SCANS_DEPTH, ODOMETRY_DEPTH, TRANSFORMS_DEPTH = 10, 50, 100
# Most of the time that is spent on drawing the map, which takes longer as it grows.
DRAWING_SHARE = 0.2
# Beams that the defaults of the mapper are shown for before the first scan.
SHOWN_BEAMS = 541


def check_params(keyframes: int, values: dict[str, Any]) -> None:
    """Raises an exception when the mapper refuses its parameters."""
    params = ffi.new("cairn_mapper_params *")
    params[0] = default_params(keyframes, SHOWN_BEAMS)
    set_fields(params, values)
    checked("mapper", params)


def ends_and_pose(transform: Any) -> tuple[str, str, Pose]:
    """Returns parent, child and pose of a geometry_msgs/TransformStamped."""
    place, turn = transform.transform.translation, transform.transform.rotation
    pose = Pose(place.x, place.y, heading(turn))
    return transform.header.frame_id, transform.child_frame_id, pose


def set_pose(target: Any, pose: Pose) -> None:
    """Sets a geometry_msgs/Pose."""
    target.position.x, target.position.y = pose.x, pose.y
    target.orientation.z, target.orientation.w = math.sin(pose.theta / 2), math.cos(pose.theta / 2)


def set_transform(target: Any, pose: Pose) -> None:
    """Sets a geometry_msgs/Transform."""
    target.translation.x, target.translation.y = pose.x, pose.y
    target.rotation.z, target.rotation.w = math.sin(pose.theta / 2), math.cos(pose.theta / 2)


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
    from rcl_interfaces.msg import ParameterDescriptor  # type: ignore[import-not-found, import-untyped, unused-ignore]
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
            self.own = {name: self.declared(name, value) for name, value in OWN.items()}
            self.values = self._mapper_values()
            check_names(self._parameter_overrides, self._parameters)
            check_own(self.own)
            check_params(int(self.own["keyframes"]), nested(self.values))
            self.sensor = Pose(*(float(v) for v in self.own["sensor_pose"]))
            self.static, self.mounted = Transforms(), dict[str, Pose]()
            self.start = IDENTITY
            self.mapper: Mapper | None = None
            self.topic_odometry, self.tf_odometry = OdometryBuffer(), OdometryBuffer()
            # Of these the one that the map uses, decided at its first scan; None: neither.
            self.odometry: OdometryBuffer | None = None
            self.late_odometry, self.losses = False, LossCounter()
            self.waiting: collections.deque[Any] = collections.deque()
            self.path, self.verdicts = Path(), collections.Counter[str]()
            self.refused_in_a_row, self.full = 0, 0
            self.scans_drawn, self.draw_from = 0, 0.0
            reliable = bool(self.own["reliable"])
            keep_all = QoSProfile(
                history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE
            )
            best_effort = ReliabilityPolicy.BEST_EFFORT
            scans = QoSProfile(depth=SCANS_DEPTH, reliability=best_effort)
            odometry = QoSProfile(depth=ODOMETRY_DEPTH, reliability=best_effort)
            if reliable:
                scans = odometry = keep_all
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            all_latched = QoSProfile(
                depth=TRANSFORMS_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL
            )
            self.create_subscription(LaserScan, "scan", self.on_scan, scans)
            self.odometry_in = self.create_subscription(
                Odometry, "odom", self.on_odometry, odometry
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
                transforms = keep_all if reliable else TRANSFORMS_DEPTH
                self.create_subscription(TFMessage, "tf", self.on_transforms, transforms)
                self.create_subscription(TFMessage, "tf_static", self.on_static, all_latched)
            self.create_service(Trigger, "save_map", self.on_save)
            self.create_timer(float(self.own["map_period"]), self.on_timer)
            self.create_timer(0.05, self.map_waiting)

        def declared(self, name: str, default: Any) -> Any:
            """Declares a parameter, which cannot be set while the node runs; returns its value."""
            read_only = ParameterDescriptor(read_only=True)
            return self.declare_parameter(name, default, read_only).value

        def _mapper_values(self) -> dict[str, Any]:
            """Declares the mapper's parameters; returns those that were set."""
            defaults = flat(get_fields(default_params(OWN["keyframes"], SHOWN_BEAMS)))
            out = {}
            for name, value in defaults.items():
                if name in OWN or name.startswith("scan.max_"):
                    continue
                given = self.declared(name, value)
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
            self.waiting.append((message, at, self.get_clock().now().nanoseconds))
            self.map_waiting()

        def on_odometry(self, message: Any) -> None:
            """Takes a pose by odometry."""
            position, q = message.pose.pose.position, message.pose.pose.orientation
            pose = Pose(position.x, position.y, heading(q))
            self.add_odometry(self.topic_odometry, message.header.stamp, pose)

        def on_transforms(self, message: Any) -> None:
            """Takes poses by odometry from the transforms."""
            for transform in message.transforms:
                parent, frame, odom_frame = ends_and_pose(transform)
                frame_base = self.static.between(frame, self.own["base_frame"])
                if parent == self.own["odom_frame"] and frame_base is not None:
                    odom_base = odom_frame @ frame_base
                    self.add_odometry(self.tf_odometry, transform.header.stamp, odom_base)

        def add_odometry(self, buffer: OdometryBuffer, stamp: Any, pose: Pose) -> None:
            """Takes a pose by odometry."""
            buffer.add(stamp_ns(stamp), pose)
            if self.begun() and self.odometry is None and not self.late_odometry:
                self.late_odometry = True
                self.get_logger().warning(
                    "odometry came after the map had begun without it; it is not used before a "
                    "new map begins"
                )
            self.map_waiting()

        def on_static(self, message: Any) -> None:
            """Takes fixed transforms, those of the mounting of the scanner among them."""
            for transform in message.transforms:
                self.static.add(*ends_and_pose(transform))
            for frame, before in self.mounted.items():
                after = self.mounting(frame)
                if after != before:
                    self.get_logger().warning(
                        f"the mounting of '{frame}' changes from {tuple(before)} to "
                        f"{tuple(after)}; the scans before were mapped by the first"
                    )
                self.mounted[frame] = after

        def mounting(self, frame: str) -> Pose:
            """Returns the pose of a scanner on the robot."""
            base = self.own["base_frame"]
            known = None if frame == base else self.static.between(base, frame)
            return self.sensor if known is None else known

        def on_initial_pose(self, message: Any) -> None:
            """Begins a new map at a pose."""
            pose = message.pose.pose
            self.start = Pose(pose.position.x, pose.position.y, heading(pose.orientation))
            self.mapper, self.late_odometry = None, False
            self.refused_in_a_row, self.full, self.scans_drawn = 0, 0, 0
            self.mounted.clear()
            self.path.poses = []
            self.get_logger().info(f"a new map begins at {tuple(self.start)}")

        # ---- Work ----

        def map_waiting(self) -> None:
            """Maps the scans that need not wait any longer."""
            now = self.get_clock().now().nanoseconds
            while self.waiting:
                message, at, came = self.waiting[0]
                odometry = self.awaited()
                late = now - came > float(self.own["odom_wait"]) * NS
                if odometry is not None and not odometry.covers(at) and not late:
                    return
                self.waiting.popleft()
                self.map_scan(message, at)

        def begun(self) -> bool:
            """Returns whether the map has a scan."""
            return self.mapper is not None and len(self.mapper) > 0

        def awaited(self) -> OdometryBuffer | None:
            """Returns the odometry that scans wait for; None: they do not wait."""
            if self.begun():
                return self.odometry
            published = self.count_publishers(self.odometry_in.topic_name) > 0
            if published or self.topic_odometry.poses or not self.tf_odometry.poses:
                return self.topic_odometry
            return self.tf_odometry

        def map_scan(self, message: Any, at: int) -> None:
            """Maps a scan and publishes its pose."""
            first = not self.begun()
            if first:
                known = (o for o in (self.topic_odometry, self.tf_odometry) if o.poses)
                self.odometry = next(known, None)
            try:
                pose = None if self.odometry is None else self.odometry.at(at)
                sensor = self.mounting(message.header.frame_id) if pose else IDENTITY
                scan = from_ros(message, sensor=sensor, odometry=pose)
                mapper = self.mapper_for(scan)
                result = mapper.add(scan)
            except CairnError as error:
                self.refuse(error, len(message.ranges))
                return
            if first:
                self.say_beginning(message.header.frame_id, sensor)
            self.verdicts[result.verdict] += 1
            self.refused_in_a_row = 0
            if pose:
                self.mounted[message.header.frame_id] = sensor
            map_robot = self.start @ result.pose if self.start != IDENTITY else result.pose
            self.publish_pose(message.header.stamp, map_robot, result.covariance)
            if self.tf_out is not None and self.odometry is not None:
                self.publish_tf(message.header.stamp)

        def say_beginning(self, frame: str, sensor: Pose) -> None:
            """Says what a map begins with."""
            if self.odometry is None:
                taken = f"without odometry: its poses are those of '{frame}'"
            else:
                topic = self.odometry_in.topic_name
                source = topic if self.odometry is self.topic_odometry else "the transforms"
                taken = f"with odometry of {source} and '{frame}' at {tuple(sensor)} on the robot"
            self.get_logger().info(f"the map begins {taken}")

        def refuse(self, error: CairnError, beams: int) -> None:
            """Counts a scan that was not mapped, and says why; a full store is said once."""
            self.verdicts["refused"] += 1
            self.refused_in_a_row += 1
            mapper = self.mapper if isinstance(error, FullError) else None
            if mapper is None or beams > mapper.params["scan"]["max_beams"]:
                self.get_logger().error(f"the scan cannot be used: {error}")
            elif not self.full:
                self.full = int(mapper.state["keyframes"])
                self.get_logger().error(self.health()[1])

        def health(self) -> tuple[str, str]:
            """Returns the level and the message of the diagnostics."""
            refused = self.verdicts["refused"]
            return health(self.losses.lost, refused, self.refused_in_a_row, self.full)

        def mapper_for(self, scan: Scan) -> Mapper:
            """Returns the mapper, made for the beams of the first scan."""
            if self.mapper is None:
                keyframes = int(self.own["keyframes"])
                self.mapper = Mapper(scan.beams, keyframes=keyframes, **nested(self.values))
            return self.mapper

        # ---- Out ----

        def publish_pose(self, stamp: Any, pose: Pose, covariance: Any) -> None:
            """Publishes a pose in the map, and the path with it.

            The covariance is that over the axes of the start.
            """
            out = PoseWithCovarianceStamped()
            out.header.stamp, out.header.frame_id = stamp, self.own["map_frame"]
            set_pose(out.pose.pose, pose)
            turned = map_covariance(covariance, self.start.theta)
            out.pose.covariance = turned.ravel().tolist()
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
            try:
                self.publish_map()
            except CairnError as error:
                self.get_logger().error(f"the map cannot be drawn: {error}")
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
            level, status.message = self.health()
            status.level = getattr(DiagnosticStatus, level)
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
                # What the timer publishes next is the settled map.
                self.scans_drawn, self.draw_from = 0, 0.0
                path = os.path.abspath(self.own["map_path"])
                self.grid().save(path)
                response.success, response.message = True, path
            except CairnError as error:
                response.success, response.message = False, str(error)
            return response

    return MapNode()


def refused(error: Exception) -> int:
    """Says why the node cannot start; returns its exit code."""
    print(f"cairn2d.ros: {error}", file=sys.stderr)
    return 2


def main(arguments: list[str] | None = None) -> int:
    """Runs the node until it is interrupted."""
    try:
        import rclpy  # type: ignore[import-not-found, import-untyped, unused-ignore]
        from rclpy.exceptions import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
            ParameterException,
        )
        from rclpy.executors import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
            ExternalShutdownException,
        )
    except ImportError as error:
        return refused(ImportError(f"{error}; the node needs rclpy and the messages"))
    try:
        rclpy.init(args=arguments)
    except RuntimeError as error:
        # Arguments that ROS cannot read.
        return refused(error)
    try:
        node = make_node()
    except (CairnError, ImportError, ParameterException) as error:
        rclpy.try_shutdown()
        return refused(error)
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
