"""Starts the node: ros2 launch cairn2d_ros map.launch.py."""

from launch import LaunchDescription  # type: ignore[import-not-found, import-untyped, unused-ignore]
from launch_ros.actions import Node  # type: ignore[import-not-found, import-untyped, unused-ignore]


def generate_launch_description() -> LaunchDescription:
    """Returns what is started."""
    topics = [("scan", "/scan"), ("odom", "/odom")]
    params = [{"base_frame": "base_link", "odom_frame": "odom", "resolution": 0.05}]
    node = Node(package="cairn2d_ros", executable="map", remappings=topics, parameters=params)
    return LaunchDescription([node])
