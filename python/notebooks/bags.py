"""Writes a log as a bag of ROS 2, by the PyPI package rosbags: what a robot would have recorded."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import cairn2d

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types


def header(ns: int, frame: str):
    """Returns a header."""
    stamp = T["builtin_interfaces/msg/Time"](*divmod(ns, 10**9))
    return T["std_msgs/msg/Header"](stamp, frame)


def transform(pose: cairn2d.Pose):
    """Returns position and orientation of a pose in the plane."""
    half = pose.theta / 2
    turn = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(half), math.cos(half))
    return T["geometry_msgs/msg/Vector3"](pose.x, pose.y, 0.0), turn


def write_bag(log: cairn2d.Log, folder: Path) -> None:
    """Writes the scans as /scan, and the odometry as /tf."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        names = {"/scan": "sensor_msgs/msg/LaserScan", "/tf": "tf2_msgs/msg/TFMessage"}
        topics = {
            name: writer.add_connection(name, kind, typestore=STORE) for name, kind in names.items()
        }
        for i, scan in enumerate(log):
            ns = scan.stamp_ns or (i + 1) * 10**8
            robot = T["geometry_msgs/msg/Transform"](*transform(scan.odometry))
            moved = T["geometry_msgs/msg/TransformStamped"](header(ns, "odom"), "base_link", robot)
            mount = T["geometry_msgs/msg/Transform"](*transform(scan.sensor))
            sensor = T["geometry_msgs/msg/TransformStamped"](
                header(ns, "base_link"), "laser", mount
            )
            swept = T["sensor_msgs/msg/LaserScan"](
                header(ns, "laser"),
                scan.angle_min,
                scan.angle_min + scan.angle_step * (scan.beams - 1),
                scan.angle_step,
                0.0,
                0.0,
                scan.range_min,
                scan.range_max,
                np.asarray(scan.ranges, np.float32),
                np.zeros(0, np.float32),
            )
            tree = T["tf2_msgs/msg/TFMessage"]([moved, sensor])
            for name, message in (("/tf", tree), ("/scan", swept)):
                data = STORE.serialize_cdr(message, names[name])
                writer.write(topics[name], ns, data)
