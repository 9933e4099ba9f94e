"""The package of ROS 2 by which colcon installs the node and its launch file."""

from xml.etree import ElementTree

from setuptools import setup

NAME = "cairn2d_ros"

setup(
    name=NAME,
    version=ElementTree.parse("package.xml").find("version").text,
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/map.launch.py"]),
    ],
    entry_points={"console_scripts": ["map = cairn2d.ros:main"]},
)
