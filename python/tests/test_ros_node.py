"""The ROS 2 node in the process of the test: messages are handed to its callbacks."""

import math
import os
import random
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("sensor_msgs")

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, ReliabilityPolicy
from sensor_msgs.msg import LaserScan

import cairn2d
import cairn2d.ros
from cairn2d._ros_parts import heading

# Apart from other tests that run at the same time.
DOMAIN = random.SystemRandom().randrange(60, 100)
NAMESPACE = f"/test_{os.getpid()}_{random.SystemRandom().randrange(10**6)}"
BEAMS = 181
PERIOD_NS = 100_000_000
CENTRE = cairn2d.Pose(0, 0, 0)


class Sink:
    """In the place of a publisher: keeps what is published."""

    def __init__(self):
        self.messages = []

    def publish(self, message):
        self.messages.append(message)


@pytest.fixture
def new_node(monkeypatch, tmp_path):
    """Makes nodes with parameters; what they publish is kept."""
    monkeypatch.syspath_prepend(Path(__file__).with_name("stand_in"))
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    nodes = []

    def make(*parameters):
        arguments = ["--ros-args", "-r", f"__ns:={NAMESPACE}"]
        arguments += ["-p", f"map_path:={tmp_path / 'map.yaml'}"]
        for parameter in parameters:
            arguments += ["-p", parameter]
        rclpy.init(args=arguments, domain_id=DOMAIN)
        node = cairn2d.ros.make_node()
        nodes.append(node)
        for name in ("map_out", "pose_out", "path_out", "diagnostics_out", "tf_out"):
            setattr(node, name, Sink())
        return node

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


def turn_of(theta):
    """Returns the quaternion of a heading."""
    return SimpleNamespace(x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2))


def transform(parent, child, x=0.0, y=0.0, theta=0.0, stamp=0):
    """Returns a stand-in of a message with one transform."""
    header = SimpleNamespace(
        frame_id=parent, stamp=SimpleNamespace(sec=stamp // 10**9, nanosec=stamp % 10**9)
    )
    moved = SimpleNamespace(translation=SimpleNamespace(x=x, y=y), rotation=turn_of(theta))
    one = SimpleNamespace(header=header, child_frame_id=child, transform=moved)
    return SimpleNamespace(transforms=[one])


def room(sensor=CENTRE):
    """Returns the ranges to the walls of a room of 6 x 4 m, from a sensor in it."""
    along = sensor.theta + np.linspace(-math.pi / 2, math.pi / 2, BEAMS)
    c, s = np.cos(along), np.sin(along)
    with np.errstate(divide="ignore"):
        x = np.where(c > 0, (4 - sensor.x) / c, (-2 - sensor.x) / c)
        y = np.where(s > 0, (2.5 - sensor.y) / s, (-1.5 - sensor.y) / s)
    return np.minimum(np.abs(x), np.abs(y))


def laser(index, ranges=None):
    """Returns a scan."""
    message = LaserScan()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod((index + 1) * PERIOD_NS, 10**9)
    message.header.frame_id = "laser"
    message.angle_min, message.angle_max = -math.pi / 2, math.pi / 2
    message.angle_increment = math.pi / (BEAMS - 1)
    message.scan_time = PERIOD_NS / 1e9
    message.range_min, message.range_max = 0.05, 30.0
    message.ranges = (room() if ranges is None else ranges).tolist()
    return message


def moved(index, x=0.0, y=0.0, theta=0.0):
    """Returns a pose by odometry at the time of a scan."""
    message = Odometry()
    message.header.stamp = laser(index).header.stamp
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z = math.sin(theta / 2)
    message.pose.pose.orientation.w = math.cos(theta / 2)
    return message


def feed(node, index, ranges=None, pose=(0.0, 0.0, 0.0)):
    """Gives a scan with odometry to the node."""
    node.on_odometry(moved(index, *pose))
    node.on_scan(laser(index, ranges))


def covariance_of(message):
    """Returns the covariance of x, y and the rotation about z."""
    places = np.ix_([0, 1, 5], [0, 1, 5])
    return np.array(message.pose.covariance).reshape(6, 6)[places]


def test_the_covariance_of_a_blind_scan_is_large(new_node):
    node = new_node()
    for i in range(3):
        feed(node, i)
    feed(node, 3, np.full(BEAMS, np.inf))
    assert node.verdicts == {"first": 1, "matched": 2, "blind": 1}
    first, matched, _, blind = map(covariance_of, node.pose_out.messages)
    for unknown in (first, blind):
        assert np.array_equal(unknown, np.diag([1e3, 1e3, math.pi**2]))
    assert 0 < matched[0, 0] < 1e-3
    assert 0 < matched[2, 2] < 1e-3


def test_the_covariance_is_turned_with_the_start(new_node):
    covariances = []
    for theta in (0.0, math.pi / 2):
        node = new_node()
        start = PoseWithCovarianceStamped()
        start.pose.pose.orientation.z = math.sin(theta / 2)
        start.pose.pose.orientation.w = math.cos(theta / 2)
        node.on_initial_pose(start)
        for i in range(2):
            feed(node, i)
        covariances.append(covariance_of(node.pose_out.messages[1]))
        rclpy.shutdown()
    straight, turned = covariances
    assert straight[0, 0] != pytest.approx(straight[1, 1], rel=0.05)
    assert turned[0, 0] == pytest.approx(straight[1, 1], rel=1e-9)
    assert turned[1, 1] == pytest.approx(straight[0, 0], rel=1e-9)
    assert turned[0, 1] == pytest.approx(-straight[0, 1], rel=1e-6)
    assert turned[0, 2] == pytest.approx(-straight[1, 2], rel=1e-6)
    assert turned[2, 2] == straight[2, 2]


def test_a_mounting_that_comes_before_the_first_scan_is_used(new_node):
    node = new_node()
    node.on_static(transform("base_link", "laser", 0.3, -0.1, 0.5))
    mounted = cairn2d.Pose(0.3, -0.1, 0.5)
    assert node.mounting("laser") == pytest.approx(mounted)
    # The robot turns on the spot, and odometry does not tell it.
    turned = cairn2d.Pose(0, 0, 0.2)
    feed(node, 0, room(mounted))
    feed(node, 1, room(turned @ mounted))
    found = node.pose_out.messages[1].pose.pose
    assert (found.position.x, found.position.y) == pytest.approx((0, 0), abs=0.01)
    assert heading(found.orientation) == pytest.approx(0.2, abs=0.01)


def test_a_mounting_is_composed_along_the_chain_of_transforms(new_node):
    node = new_node("sensor_pose:=[9.0, 9.0, 0.0]")
    node.on_static(transform("mast", "laser", 0.1, 0.0, 0.25))
    assert node.mounting("laser") == (9, 9, 0)
    node.on_static(transform("other", "camera", 5.0))
    node.on_static(transform("base_link", "mast", 0.2, 0.0, math.pi / 2))
    assert node.mounting("laser") == pytest.approx((0.2, 0.1, math.pi / 2 + 0.25))
    assert node.mounting("camera") == (9, 9, 0)
    assert node.mounting("base_link") == (9, 9, 0)


def test_a_mounting_that_changes_while_mapping_is_said(new_node, capfd):
    node = new_node()
    feed(node, 0)
    node.on_static(transform("base_link", "camera", 1.0))
    assert "mounting of" not in capfd.readouterr().err
    node.on_static(transform("base_link", "laser", 0.3))
    assert "the mounting of 'laser' changes from (0.0, 0.0, 0.0) to (0.3, 0.0, 0.0)" in (
        capfd.readouterr().err
    )


@pytest.mark.parametrize("reliable", [False, True])
def test_scans_and_odometry_are_taken_best_effort_unless_reliable(new_node, reliable):
    node = new_node(f"reliable:={reliable}")
    taken = {subscription.topic_name: subscription for subscription in node.subscriptions}
    for topic in ("scan", "odom"):
        quality = taken[f"{NAMESPACE}/{topic}"].qos_profile
        assert (quality.reliability == ReliabilityPolicy.BEST_EFFORT) != reliable, topic
        assert (quality.history == HistoryPolicy.KEEP_ALL) == reliable, topic


def test_a_parameter_that_is_set_while_the_node_runs_is_refused(new_node):
    node = new_node("resolution:=0.1")
    for name, value in (("resolution", 0.2), ("keyframe_distance", 0.3)):
        (result,) = node.set_parameters([Parameter(name, value=value)])
        assert not result.successful
    assert node.get_parameter("resolution").value == node.own["resolution"] == 0.1


def test_a_map_that_cannot_be_drawn_is_said_and_the_node_goes_on(new_node, capfd):
    node = new_node("resolution:=0.00001")
    feed(node, 0)
    node.on_timer()
    assert "the map cannot be drawn: map: " in capfd.readouterr().err
    feed(node, 1)
    assert len(node.pose_out.messages) == 2
    assert node.map_out.messages == []


def status_of(node):
    """Returns the level and the message of the diagnostics, and their values."""
    node.publish_diagnostics()
    (status,) = node.diagnostics_out.messages[-1].status
    return status.level, status.message, {pair.key: pair.value for pair in status.values}


def test_refused_scans_are_warned_of_and_ten_in_a_row_are_an_error(new_node):
    node = new_node()
    feed(node, 0)
    assert status_of(node)[:2] == (DiagnosticStatus.OK, "mapping")
    bad = laser(1)
    bad.range_max = 0.0
    for _ in range(9):
        node.on_odometry(moved(1))
        node.on_scan(bad)
    assert status_of(node)[:2] == (DiagnosticStatus.WARN, "9 scans refused")
    node.on_scan(bad)
    level, message, values = status_of(node)
    assert level == DiagnosticStatus.ERROR
    assert message.startswith("10 scans refused, the last 10")
    assert values["refused"] == "10"
    feed(node, 2)
    assert status_of(node)[:2] == (DiagnosticStatus.WARN, "10 scans refused")


def test_a_scan_with_more_beams_than_the_first_is_no_full_store(new_node, capfd):
    node = new_node()
    feed(node, 0)
    feed(node, 1, np.ones(BEAMS + 1))
    assert "the scan cannot be used: scan: count: more beams" in capfd.readouterr().err
    assert status_of(node)[:2] == (DiagnosticStatus.WARN, "1 scans refused")


def test_a_full_store_of_keyframes_is_said_once_and_the_map_can_be_saved(new_node, capfd):
    node = new_node("keyframes:=2", "keyframe_distance:=0.1")
    for i in range(4):
        at = cairn2d.Pose(0.3 * i, 0, 0)
        feed(node, i, room(at), at)
    level, message, _ = status_of(node)
    assert level == DiagnosticStatus.ERROR
    assert message.startswith("the store of 2 keyframes is full")
    assert capfd.readouterr().err.count("the store of 2 keyframes is full") == 1
    saved = node.on_save(None, SimpleNamespace())
    assert saved.success, saved.message
    # A new map begins.
    node.on_initial_pose(PoseWithCovarianceStamped())
    feed(node, 4)
    assert node.verdicts["first"] == 2
    assert "full" not in status_of(node)[1]


def test_a_map_that_begins_without_odometry_goes_on_without(new_node, capfd):
    node = new_node("odom_wait:=0.0")
    node.on_static(transform("base_link", "laser", 0.3, 0.0, math.pi))
    for i in range(2):
        node.on_scan(laser(i))
        node.map_waiting()
    assert "without odometry" in capfd.readouterr().err
    for i in range(2, 5):
        node.on_odometry(moved(i, 5.0 * i, 0.0, 1.0))
        node.on_scan(laser(i))
    # The poses are those of the scanner, which stands still.
    assert len(node.pose_out.messages) == 5
    for message in node.pose_out.messages:
        place = message.pose.pose
        assert (place.position.x, place.position.y) == pytest.approx((0, 0), abs=0.01)
        assert heading(place.orientation) == pytest.approx(0, abs=0.01)
    assert node.tf_out.messages == []
    assert capfd.readouterr().err.count("is not used before a new map begins") == 1


def test_scans_of_a_map_without_odometry_do_not_wait(new_node):
    node = new_node("odom_wait:=1000.0")
    node.on_scan(laser(0))
    assert node.pose_out.messages == []
    node.own["odom_wait"] = 0.0
    node.map_waiting()
    node.own["odom_wait"] = 1000.0
    node.on_scan(laser(1))
    assert len(node.pose_out.messages) == 2


def test_the_first_scan_waits_for_odometry_and_the_map_uses_it(new_node, capfd):
    node = new_node("odom_wait:=1000.0")
    node.on_scan(laser(0))
    feed(node, 1)
    assert len(node.pose_out.messages) == len(node.tf_out.messages) == 2
    assert f"with odometry of {NAMESPACE}/odom" in capfd.readouterr().err
    # A new map decides anew.
    node.on_initial_pose(PoseWithCovarianceStamped())
    feed(node, 2)
    assert len(node.tf_out.messages) == 3


def test_odometry_is_taken_from_the_transforms_where_none_is_published(new_node, capfd):
    node = new_node("odom_wait:=1000.0")
    node.on_static(transform("base_footprint", "base_link", 0.0, 0.0, 0.0))
    node.on_static(transform("base_link", "laser", 0.3, 0.0, 0.0))
    mounted = cairn2d.Pose(0.3, 0, 0)
    for i in range(3):
        robot = cairn2d.Pose(0.2 * i, 0, 0.1 * i)
        stamp = (i + 1) * PERIOD_NS
        for frames in (("map", "odom"), ("odom", "gripper"), ("base_link", "base_footprint")):
            node.on_transforms(transform(*frames, 7.0, 7.0, 1.0, stamp))
        node.on_scan(laser(i, room(robot @ mounted)))
        assert len(node.pose_out.messages) == i
        node.on_transforms(transform("odom", "base_footprint", *robot, stamp))
        assert len(node.pose_out.messages) == i + 1
        place = node.pose_out.messages[-1].pose.pose
        assert (place.position.x, place.position.y) == pytest.approx(robot[:2], abs=0.01)
        assert heading(place.orientation) == pytest.approx(robot.theta, abs=0.01)
    assert "with odometry of the transforms" in capfd.readouterr().err
    assert len(node.tf_out.messages) == 3
    map_odom = node.tf_out.messages[-1].transform.translation
    assert (map_odom.x, map_odom.y) == pytest.approx((0, 0), abs=0.01)


def test_odometry_that_is_published_goes_before_the_transforms(new_node, capfd):
    node = new_node("odom_wait:=1000.0")
    node.on_transforms(transform("odom", "base_link", 9.0, 9.0, 1.0, 0))
    node.on_odometry(moved(0))
    node.on_transforms(transform("odom", "base_link", 9.0, 9.0, 1.0, 10 * PERIOD_NS))
    node.on_scan(laser(1))
    assert node.pose_out.messages == []
    feed(node, 2)
    assert f"with odometry of {NAMESPACE}/odom" in capfd.readouterr().err
    # A publisher that has not published yet.
    node.on_initial_pose(PoseWithCovarianceStamped())
    assert node.awaited() is node.topic_odometry
    node.topic_odometry.poses.clear()
    assert node.awaited() is node.tf_odometry
    publisher = node.create_publisher(Odometry, "odom", 1)
    assert node.awaited() is node.topic_odometry
    node.destroy_publisher(publisher)


def test_the_settled_map_is_published_after_it_is_saved(new_node):
    node = new_node()
    feed(node, 0)
    for drawn in (1, 1):
        node.draw_from = 0.0
        node.on_timer()
        assert len(node.map_out.messages) == len(node.path_out.messages) == drawn
    assert node.on_save(None, SimpleNamespace()).success
    node.on_timer()
    assert len(node.map_out.messages) == len(node.path_out.messages) == 2
