"""The ROS 2 node among real processes, in a domain of its own."""

import json
import math
import os
import random
import signal
import subprocess
import sys
import types
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import cairn2d
import cairn2d.ros
from cairn2d.ros import LossCounter, OdometryBuffer, flat, heading, nested

COUNT = 30
END_S = 20
# Time from scan to scan in ros_player.py, best effort.
PERIOD_NS = 100_000_000
# tf2_msgs, of which there is no wheel.
STAND_IN = Path(__file__).with_name("stand_in")


def lost_at(times, period=0.0):
    """Returns the scans that are said to be lost, by the index of the scan at which they are."""
    losses = LossCounter()
    said = {i: lost for i, t in enumerate(times) if (lost := losses.add(t, period))}
    assert losses.lost == sum(said.values())
    return said


def test_lost_scans_are_counted_by_the_period_of_the_messages():
    assert lost_at([0, 20, 30, 40, 70, 70, 80], 10) == {2: 1, 6: 2}
    assert lost_at([0, 20, 50, 60], 10) == {3: 3}


def test_lost_scans_of_an_even_scanner_are_counted_from_their_times():
    rng = np.random.default_rng(3)
    times = np.arange(200) * 100 + rng.uniform(-2, 2, 200)
    kept = np.setdiff1d(np.arange(200), [50, 80, 81, 82, 120])
    said = lost_at(times[kept].tolist())
    # The scans after 51, 83 and 121.
    assert said == {kept.tolist().index(i): lost for i, lost in ((52, 1), (84, 3), (122, 1))}
    # A fifth of all scans.
    kept = np.arange(200)[np.arange(200) % 5 != 4]
    assert sum(lost_at(times[kept].tolist()).values()) > 30


@pytest.mark.parametrize("name", ["apartment", "office", "people", "rescue"])
def test_no_scan_of_a_log_with_uneven_times_is_said_to_be_lost(data, name):
    times = [scan.stamp_ns for scan in cairn2d.read(data / f"logs/{name}.log")]
    gaps = np.diff(times)
    assert np.ptp(gaps) > 0.5 * np.median(gaps)
    assert lost_at(times) == {}


def test_scans_that_come_late_are_not_lost():
    even = list(range(0, 500, 10))
    late = [*even, 506, 510, 520, 575, 576, 577, 578, 579, 580, 590, 600]
    assert lost_at(late) == lost_at(late, 10) == {}
    for period in (0, 10):
        assert lost_at([*late, 630, 640], period) == {len(late) + 1: 2}


def test_few_scans_tell_no_period():
    assert lost_at([0, 10, 20, 40, 50]) == {}


def test_the_package_of_ros_has_the_version_of_the_library():
    manifest = Path(__file__).parents[1] / "ros/package.xml"
    assert ElementTree.parse(manifest).find("version").text == cairn2d.__version__


def test_odometry_is_interpolated_at_the_times_of_scans():
    buffer = OdometryBuffer()
    assert buffer.at(5) is None
    buffer.add(10, cairn2d.Pose(0, 0, 0))
    buffer.add(20, cairn2d.Pose(1, 0, 0))
    buffer.add(15, cairn2d.Pose(9, 9, 9))
    assert buffer.at(5) == (0, 0, 0)
    assert buffer.at(20) == (1, 0, 0)
    assert buffer.at(12) == pytest.approx((0.2, 0, 0))
    assert buffer.at(30) == (1, 0, 0)
    assert buffer.covers(20)
    assert not buffer.covers(21)


def test_parameters_with_dots_are_groups():
    values = {"a": 1, "loop": {"b": 2.5}}
    assert flat(values) == {"a": 1, "loop.b": 2.5}
    assert nested(flat(values)) == values


@pytest.mark.parametrize("interrupted", [True, False])
def test_a_callback_that_an_interrupt_cuts_short_ends_the_node_whole(monkeypatch, interrupted):
    def spin(node):
        raise RuntimeError("publisher's context is invalid")

    rclpy = types.ModuleType("rclpy")
    rclpy.init = rclpy.try_shutdown = lambda args=None: None
    rclpy.spin, rclpy.ok = spin, lambda: not interrupted
    executors = types.ModuleType("rclpy.executors")
    executors.ExternalShutdownException = KeyError
    monkeypatch.setitem(sys.modules, "rclpy", rclpy)
    monkeypatch.setitem(sys.modules, "rclpy.executors", executors)
    node = types.SimpleNamespace(destroy_node=lambda: None)
    monkeypatch.setattr(cairn2d.ros, "make_node", lambda: node)
    if interrupted:
        assert cairn2d.ros.main([]) == 0
    else:
        with pytest.raises(RuntimeError, match="invalid"):
            cairn2d.ros.main([])


def play(log: Path, tmp_path: Path, count: int, rate: int, *parameters: str) -> tuple[dict, str]:
    """Runs the node and the player; returns what came back, and the log of the node."""
    pytest.importorskip("rclpy")
    pytest.importorskip("sensor_msgs")
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(random.SystemRandom().randrange(60, 100)),
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_LOG_DIR": str(tmp_path / "log"),
        "PYTHONPATH": os.pathsep.join([str(STAND_IN), *sys.path]),
    }
    # Apart from other tests that run at the same time in the same domain.
    namespace = f"/test_{os.getpid()}_{rate}"
    command = [sys.executable, "-m", "cairn2d.ros", "--ros-args", "-r", f"__ns:={namespace}"]
    for parameter in (f"map_path:={tmp_path / 'map.yaml'}", "map_period:=0.5", *parameters):
        command += ["-p", parameter]
    with open(tmp_path / "node.txt", "w") as output:
        node = subprocess.Popen(command, env=environment, stdout=output, stderr=output)
        try:
            player = [sys.executable, str(Path(__file__).with_name("ros_player.py"))]
            player += [str(log), str(count), str(rate), namespace]
            done = subprocess.run(
                player, env=environment, capture_output=True, text=True, check=False
            )
        finally:
            node.send_signal(signal.SIGINT)
            node.wait(END_S)
    said = (tmp_path / "node.txt").read_text()
    assert done.returncode == 0, done.stderr + said
    assert node.returncode == 0, said
    return json.loads(done.stdout), said


def test_a_log_played_reliably_gives_the_bits_of_the_mapper(data, tmp_path):
    path = data / "logs/apartment.log"
    found, _said = play(path, tmp_path, COUNT, 0, "reliable:=true")
    log = cairn2d.read(path)
    mapper = cairn2d.Mapper(beams=log.beams, keyframes=4096)
    expected = []
    for scan in log[:COUNT]:
        # The heading goes through a quaternion.
        z, w = math.sin(scan.odometry.theta / 2), math.cos(scan.odometry.theta / 2)
        turn = type("Quaternion", (), {"x": 0.0, "y": 0.0, "z": z, "w": w})
        pose = cairn2d.Pose(*scan.odometry[:2], heading(turn))
        expected.append(mapper.add(scan, pose).pose)
    poses = np.array(found["poses"])
    assert np.array_equal(poses[:, :2], np.array(expected)[:, :2])
    turns = poses[:, 2] - np.array(expected)[:, 2]
    assert np.abs(np.sin(turns / 2)).max() < 1e-12
    frames, transform = found["transform"][:2], found["transform"][2:]
    assert frames == ["map", "odom"]
    assert transform == pytest.approx(tuple(mapper.map_odom), abs=1e-12)
    assert found["map"]
    assert found["saved"] == str(tmp_path / "map.yaml")
    assert cairn2d.Grid.read(tmp_path / "map.yaml").occupied.sum() > 100


def test_scans_lost_on_the_way_are_counted_and_said(data, tmp_path):
    found, said = play(data / "logs/apartment.log", tmp_path, COUNT, 20, "keyframe_distance:=0.4")
    assert 0 < len(found["poses"]) <= 2 * COUNT // 3
    # Up to the last scan that came one period after another, which shows what was lost before.
    stamps = found["stamps"]
    last = max(i for i in range(1, len(stamps)) if stamps[i] - stamps[i - 1] == PERIOD_NS)
    lost = (stamps[last] - stamps[0]) // PERIOD_NS - last
    assert lost > 0
    assert f"scans lost, {lost} in all" in said


def test_a_parameter_out_of_range_ends_the_node_at_its_start():
    pytest.importorskip("rclpy")
    pytest.importorskip("sensor_msgs")
    command = [sys.executable, "-m", "cairn2d.ros", "--ros-args", "-p", "keyframe_distance:=-1.0"]
    environment = {**os.environ, "ROS_DOMAIN_ID": "59", "ROS_LOCALHOST_ONLY": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "keyframe_distance is -1" in done.stderr
