"""The ROS 2 node among real processes, in a domain of its own."""

import json
import math
import os
import random
import re
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
from cairn2d._ros_parts import (
    LossCounter,
    OdometryBuffer,
    Transforms,
    flat,
    heading,
    health,
    nested,
)
from cairn2d.ros import OWN, check_names, check_own

COUNT = 30
# Most time that the node takes to start, with the interpreter, and to end.
START_S, END_S = 60, 20
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


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("resolution", 0.0, "resolution is 0, expected a number above 0"),
        ("range", -1.0, "range is -1, expected a number above 0"),
        ("map_period", math.inf, "map_period is inf, expected a number above 0"),
        ("clear", -0.5, "clear is -0.5, expected a number of at least 0"),
        ("odom_wait", math.nan, "odom_wait is nan, expected a number of at least 0"),
        ("sensor_pose", [0, 1, 2, 3], "sensor_pose is [0, 1, 2, 3], expected three finite"),
        ("sensor_pose", [0, math.inf, 0], "sensor_pose is [0, inf, 0], expected three finite"),
    ],
)
def test_the_node_refuses_its_own_parameters_by_name(name, value, said):
    with pytest.raises(cairn2d.BadArgumentError, match=re.escape(said)):
        check_own({**OWN, name: value})


def test_the_defaults_of_the_node_are_in_range():
    check_own({**OWN, "clear": 0.0, "odom_wait": 0.0})


def test_a_parameter_that_there_is_not_is_refused_with_the_nearest():
    check_names(["range", "clear"], OWN)
    said = "there is no parameter resolutoin; the nearest is resolution"
    with pytest.raises(cairn2d.BadArgumentError, match=said):
        check_names(["range", "resolutoin"], OWN)


@pytest.mark.parametrize(
    ("counts", "level", "said"),
    [
        ((0, 0, 0), "OK", "mapping"),
        ((3, 0, 0), "WARN", "3 scans lost"),
        ((0, 2, 0), "WARN", "2 scans refused"),
        ((1, 9, 9), "WARN", "1 scans lost, 9 scans refused"),
        ((0, 12, 10), "ERROR", "12 scans refused, the last 10 without a break"),
    ],
)
def test_lost_and_refused_scans_are_warnings_and_refusals_in_a_row_an_error(counts, level, said):
    assert health(*counts) == (level, said)


def test_a_full_store_of_keyframes_is_an_error():
    level, said = health(0, 1, 1, full=40)
    assert level == "ERROR"
    assert said.startswith("the store of 40 keyframes is full, no scan is mapped")


def test_transforms_are_composed_up_to_a_frame_above():
    transforms = Transforms()
    transforms.add("base", "mast", cairn2d.Pose(1, 0, math.pi / 2))
    transforms.add("mast", "laser", cairn2d.Pose(0.5, 0, 0))
    assert transforms.between("base", "mast") == (1, 0, math.pi / 2)
    assert transforms.between("base", "laser") == pytest.approx((1, 0.5, math.pi / 2))
    assert transforms.between("laser", "laser") == (0, 0, 0)
    assert transforms.between("laser", "base") is None
    assert transforms.between("base", "camera") is None


def test_transforms_in_a_cycle_lead_nowhere():
    transforms = Transforms()
    transforms.add("a", "b", cairn2d.Pose(1, 0, 0))
    transforms.add("b", "a", cairn2d.Pose(1, 0, 0))
    assert transforms.between("base", "b") is None


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
    exceptions = types.ModuleType("rclpy.exceptions")
    exceptions.ParameterException = KeyError
    for module in (rclpy, executors, exceptions):
        monkeypatch.setitem(sys.modules, module.__name__, module)
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


@pytest.mark.parametrize(
    ("parameter", "said"),
    [
        ("keyframe_distance:=-1.0", "mapper: keyframe_distance is -1, expected "),
        ("resolution:=-1.0", "resolution is -1, expected a number above 0"),
        ("sensor_pose:=[0.0,1.0]", "sensor_pose is [0.0, 1.0], expected three finite numbers"),
        ("keyframes:=many", "'keyframes' to 'many'"),
        ("loop.nothing:=3", "there is no parameter loop.nothing"),
        ("nothing", "'-p nothing'"),
    ],
)
def test_a_parameter_out_of_range_ends_the_node_at_its_start(tmp_path, parameter, said):
    pytest.importorskip("rclpy")
    pytest.importorskip("sensor_msgs")
    command = [sys.executable, "-m", "cairn2d.ros", "--ros-args", "-p", parameter]
    environment = {**os.environ, "ROS_LOCALHOST_ONLY": "1", "ROS_LOG_DIR": str(tmp_path)}
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=START_S
    )
    assert done.returncode == 2
    # rcl writes lines of its own about arguments that it cannot read.
    (line,) = (line for line in done.stderr.splitlines() if "[rcl]" not in line)
    assert line.startswith("cairn2d.ros: ")
    assert said in line
