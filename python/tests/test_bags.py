"""Bags of ROS 2, written by the PyPI package rosbags."""

import sys

import numpy as np
import pytest
from conftest import ROOT

import cairn2d


def test_a_bag_is_read_as_it_was_written(drive, tmp_path):
    pytest.importorskip("rosbags")
    folder = ROOT / "python/notebooks"
    if not folder.is_dir():
        pytest.skip("the writer of bags lies in the repository")
    sys.path.insert(0, str(folder))
    try:
        import bags
    finally:
        sys.path.remove(str(folder))
    written = drive[:10]
    bags.write_bag(written, tmp_path / "bag")
    log = cairn2d.read(tmp_path / "bag")
    assert (len(log), log.info.kind, log.faults) == (10, "bag", [])
    for scan, expected in zip(log, written):
        returns = np.where(expected.ranges >= expected.range_max, np.inf, expected.ranges)
        assert np.array_equal(scan.ranges, returns, equal_nan=True)
        assert np.allclose(scan.bearings, expected.bearings, atol=1e-6)
        assert scan.sensor == pytest.approx(expected.sensor, abs=1e-12)
    start = cairn2d.Pose(*log.info.origin, 0)
    poses = [start @ scan.odometry for scan in log]
    assert np.allclose(poses, written.odometry, rtol=0, atol=1e-9)
    assert len(cairn2d.map(log).trajectory) == 10
