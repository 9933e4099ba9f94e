"""The ROS 2 node among real processes, in a domain of its own."""

import json
import math
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import cairn2d
from cairn2d.ros import LossCounter, OdometryBuffer, flat, heading, nested

COUNT = 30
END_S = 20


def test_lost_scans_are_counted_from_their_times():
    losses = LossCounter()
    assert [losses.add(t) for t in (0, 10, 20, 30, 60, 70, 70)] == [0, 0, 0, 0, 2, 0, 0]
    assert losses.lost == 2


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


def play(data: Path, tmp_path: Path, rate: int, *parameters: str) -> tuple[dict, str]:
    """Runs the node and the player; returns what came back, and the log of the node."""
    pytest.importorskip("rclpy")
    pytest.importorskip("sensor_msgs")
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(random.SystemRandom().randrange(60, 100)),
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_LOG_DIR": str(tmp_path / "log"),
    }
    command = [sys.executable, "-m", "cairn2d.ros", "--ros-args"]
    for parameter in (f"map_path:={tmp_path / 'map.yaml'}", "map_period:=0.5", *parameters):
        command += ["-p", parameter]
    with open(tmp_path / "node.txt", "w") as output:
        node = subprocess.Popen(command, env=environment, stdout=output, stderr=output)
        try:
            player = [sys.executable, str(Path(__file__).with_name("ros_player.py"))]
            player += [str(data / "logs/apartment.log"), str(COUNT), str(rate)]
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
    found, _said = play(data, tmp_path, 0, "reliable:=true")
    mapper = cairn2d.Mapper(beams=cairn2d.read(data / "logs/apartment.log").beams, keyframes=4096)
    expected = []
    for scan in cairn2d.read(data / "logs/apartment.log")[:COUNT]:
        # The heading goes through a quaternion.
        z, w = math.sin(scan.odometry.theta / 2), math.cos(scan.odometry.theta / 2)
        turn = type("Quaternion", (), {"x": 0.0, "y": 0.0, "z": z, "w": w})
        pose = cairn2d.Pose(*scan.odometry[:2], heading(turn))
        expected.append(mapper.add(scan, pose).pose)
    poses = np.array(found["poses"])
    assert np.array_equal(poses[:, :2], np.array(expected)[:, :2])
    turns = poses[:, 2] - np.array(expected)[:, 2]
    assert np.abs(np.sin(turns / 2)).max() < 1e-12
    assert found["map"]
    assert found["saved"] == str(tmp_path / "map.yaml")
    assert cairn2d.Grid.read(tmp_path / "map.yaml").occupied.sum() > 100


def test_scans_lost_on_the_way_are_counted_and_said(data, tmp_path):
    found, said = play(data, tmp_path, 20, "keyframe_distance:=0.4")
    assert 0 < len(found["poses"]) <= 2 * COUNT // 3
    assert "scans lost" in said


def test_a_parameter_out_of_range_ends_the_node_at_its_start():
    pytest.importorskip("rclpy")
    pytest.importorskip("sensor_msgs")
    command = [sys.executable, "-m", "cairn2d.ros", "--ros-args", "-p", "keyframe_distance:=-1.0"]
    environment = {**os.environ, "ROS_DOMAIN_ID": "59", "ROS_LOCALHOST_ONLY": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "keyframe_distance is -1" in done.stderr
