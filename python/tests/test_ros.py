"""What the ROS 2 node is made of, without ROS."""

import math
import re
import sys
import types
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import cairn2d
import cairn2d.ros
from cairn2d._ros_parts import (
    OWN,
    LossCounter,
    OdometryBuffer,
    Transforms,
    check_names,
    check_own,
    flat,
    health,
    nested,
)


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
