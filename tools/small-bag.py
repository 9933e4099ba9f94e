#!/usr/bin/env python3
"""Writes a bag of ROS 1 with two scans, their odometry and the mounting of the sensor to standard output: small-bag.py >FILE"""
import math
import struct
import sys

DATA, CONNECTION = 2, 7
FIRST_S = 5


def text(value):
    return struct.pack("<I", len(value)) + value.encode()


def fields(**values):
    """Fields of a header: name=value, each with its length."""
    pairs = [name.encode() + b"=" + value for name, value in values.items()]
    return b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)


def record(header, data):
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def connection(index, topic, kind):
    head = fields(op=bytes([CONNECTION]), conn=struct.pack("<I", index), topic=topic.encode())
    return record(head, fields(topic=topic.encode(), type=kind.encode(), md5sum=b"*", message_definition=b""))


def message(index, second, data):
    time = struct.pack("<II", second, 0)
    return record(fields(op=bytes([DATA]), conn=struct.pack("<I", index), time=time), data)


def head(second, frame):
    return struct.pack("<III", 0, second, 0) + text(frame)


def pose(x):
    return struct.pack("<7d", x, 0, 0, 0, 0, 0, 1)


def transform(parent, child, x):
    return struct.pack("<I", 1) + head(FIRST_S, parent) + text(child) + pose(x)


def odometry(second, x):
    return head(second, "odom") + text("base_link") + pose(x) + bytes(36 * 8 + 6 * 8 + 36 * 8)


def scan(second, wall):
    """A scan of a wall ahead, at a distance in m: 25 beams of 120 degrees."""
    step = math.radians(5)
    bearings = [(k - 12) * step for k in range(25)]
    ranges = [wall / math.cos(bearing) for bearing in bearings]
    numbers = struct.pack("<7f", bearings[0], bearings[-1], step, 0, 0, 0.1, 30)
    return head(second, "laser") + numbers + struct.pack("<I25fI", 25, *ranges, 0)


def main():
    out = [
        b"#ROSBAG V2.0\n",
        connection(0, "/tf_static", "tf2_msgs/TFMessage"),
        connection(1, "/scan", "sensor_msgs/LaserScan"),
        connection(2, "/odom", "nav_msgs/Odometry"),
        message(0, FIRST_S, transform("base_link", "laser", 0.2)),
    ]
    for k in range(2):
        out += [message(2, FIRST_S + k, odometry(FIRST_S + k, 0.5 * k)), message(1, FIRST_S + k, scan(FIRST_S + k, 3 - 0.5 * k))]
    sys.stdout.buffer.write(b"".join(out))


main()
