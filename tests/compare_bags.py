"""Compares cairn's reader of bags with the PyPI package rosbags: compare_bags.py PROGRAM FOLDER

Writes bags by rosbags into FOLDER: ROS 1 (none, lz4, bz2), SQLite (none, zstd by message, zstd by file) and MCAP (none, zstd by chunk, zstd by file),
one with big-endian CDR, one split over two files, all with a latched /tf_static and a sensor rolled by half a turn. Each is read by rosbags and by
"PROGRAM --print BAG": the order of recording, the stamps, the bits of all ranges, bearings, odometry and mounting must be the same. Bags of a
CARMEN log of data/logs must be read as the log itself.
"""

import math
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

RANGE_MAX = np.float32(12)
SECOND = 10**9
LOG = Path(__file__).parent.parent / "data" / "logs" / "apartment.log"


def random_ranges(random, count):
    """Ranges with all that a scanner may write."""
    ranges = random.uniform(0.05, 14, count).astype(np.float32)
    ranges[random.integers(0, count, 3)] = np.inf
    ranges[random.integers(0, count, 3)] = np.nan
    ranges[random.integers(0, count, 2)] = -np.inf
    ranges[random.integers(0, count, 2)] = 0
    return ranges


class Recording:
    """The messages of a bag: (topic, type, time, message) in the order of the file."""

    def __init__(self, store, is_ros1):
        self.types = store.types
        self.is_ros1 = is_ros1
        self.messages = []

    def add(self, topic, kind, time, message):
        self.messages.append((topic, kind, time, message))

    def make(self, kind, *values):
        return self.types[kind](*values)

    def header(self, stamp, frame):
        time = self.make("builtin_interfaces/msg/Time", stamp // SECOND, stamp % SECOND)
        first = (0,) if self.is_ros1 else ()
        return self.make("std_msgs/msg/Header", *first, time, frame)

    def scan(self, stamp, first, step, range_max, ranges):
        """first, step: bearings, rad."""
        return self.make(
            "sensor_msgs/msg/LaserScan",
            self.header(stamp, "laser"),
            *(first, first + step * (len(ranges) - 1), step, 0.0, 0.1, 0.0, range_max),
            ranges,
            np.zeros(len(ranges), dtype=np.float32),
        )

    def odometry(self, stamp, x, y, theta):
        point = self.make("geometry_msgs/msg/Point", x, y, 0.0)
        half = theta / 2
        rotation = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))
        pose = self.make("geometry_msgs/msg/Pose", point, rotation)
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", zero, zero)
        return self.make(
            "nav_msgs/msg/Odometry",
            self.header(stamp, "odom"),
            "base_link",
            self.make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
            self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )

    def mounting(self, stamp, ahead, roll):
        """The pose of the sensor on the robot: m ahead, and rolled by `roll` rad."""
        transform = self.make(
            "geometry_msgs/msg/Transform",
            self.make("geometry_msgs/msg/Vector3", ahead, 0.0, 0.0),
            self.make("geometry_msgs/msg/Quaternion", math.sin(roll / 2), 0.0, 0.0, math.cos(roll / 2)),
        )
        link = self.make("geometry_msgs/msg/TransformStamped", self.header(stamp, "base_link"), "laser", transform)
        return self.make("tf2_msgs/msg/TFMessage", [link])


def random_scene(store, is_ros1, seed):
    """Random scans of a sensor that hangs upside down, 0.25 m ahead; recorded late, out of order, and often at the same time as another one."""
    scene = Recording(store, is_ros1)
    random = np.random.default_rng(seed)
    scene.add("/tf_static", "tf2_msgs/msg/TFMessage", 5 * SECOND, scene.mounting(5 * SECOND, 0.25, math.pi))
    for k in range(40):
        stamp = 10 * SECOND + k * 100_000_000 + int(random.integers(0, 10_000_000))
        scene.add("/odom", "nav_msgs/msg/Odometry", stamp, scene.odometry(stamp, 0.125 * k, 0.0, 0.0))
        recorded = stamp + int(random.integers(0, 3)) * 100_000_000
        recorded -= recorded % 50_000_000
        scan = scene.scan(stamp, -1.5, 0.1, float(RANGE_MAX), random_ranges(random, 30 + k % 3))
        scene.add("/scan", "sensor_msgs/msg/LaserScan", recorded, scan)
    return scene


def logged_scene(store, is_ros1, _):
    """The scans of LOG (FLASER n ranges, pose of the laser, pose of the robot, stamp): half a turn in steps of a degree, up to 8 m."""
    scene = Recording(store, is_ros1)
    scene.add("/tf_static", "tf2_msgs/msg/TFMessage", 0, scene.mounting(0, 0.0, 0.0))
    for line in LOG.read_text(encoding="utf-8").splitlines():
        if not line.startswith("FLASER "):
            continue
        fields = line.split()
        count = int(fields[1])
        ranges = np.array(fields[2 : 2 + count], dtype=np.float32)
        robot = [float(text) for text in fields[5 + count : 8 + count]]
        seconds, _, decimals = fields[8 + count].partition(".")
        stamp = int(seconds) * SECOND + int(decimals.ljust(9, "0"))
        scene.add("/odom", "nav_msgs/msg/Odometry", stamp, scene.odometry(stamp, *robot))
        scan = scene.scan(stamp, -math.pi / 2, math.pi / (count - 1), 8.0, ranges)
        scene.add("/scan", "sensor_msgs/msg/LaserScan", stamp, scan)
    return scene


def ros1_store():
    """Noetic with tf2_msgs, which rosbags leaves out."""
    store = get_typestore(Stores.ROS1_NOETIC)
    if "tf2_msgs/msg/TFMessage" not in store.types:
        from rosbags.typesys import get_types_from_msg

        text = "geometry_msgs/TransformStamped[] transforms"
        store.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    return store


def write_ros1(path, seed, compression, make=random_scene):
    store = ros1_store()
    writer = rosbag1.Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for topic, kind, time, message in make(store, True, seed).messages:
            if topic not in connections:
                latching = 1 if topic == "/tf_static" else None
                connections[topic] = writer.add_connection(
                    topic, kind, typestore=store, latching=latching
                )
            writer.write(connections[topic], time, store.serialize_ros1(message, kind))
    return path


def write_ros2(path, seed, storage, mode=None, compression=None, little_endian=True, part=None, make=random_scene):
    """part: (k, n), the k-th of n parts of the recording."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = rosbag2.Writer(path, version=8, storage_plugin=storage)
    if mode is not None:
        writer.set_compression(mode, compression)
    messages = make(store, False, seed).messages
    if part is not None:
        share = -(-len(messages) // part[1])
        messages = messages[part[0] * share : (part[0] + 1) * share]
    with writer:
        connections = {}
        for topic, kind, time, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = store.serialize_cdr(message, kind, little_endian=little_endian)
            writer.write(connections[topic], time, raw)
    return path


def write_split(folder, seed):
    """A folder of two files, the halves of a recording."""
    folder.mkdir()
    names = ["split_0.mcap", "split_1.mcap"]
    for k, name in enumerate(names):
        part = write_ros2(folder.parent / f"part{k}", seed, rosbag2.StoragePlugin.MCAP, part=(k, 2))
        next(part.glob("*.mcap")).rename(folder / name)
    paths = "".join(f"    - {name}\n" for name in names)
    text = f"rosbag2_bagfile_information:\n  version: 8\n  relative_file_paths:\n{paths}"
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
    return folder


def expected_scans(path, store):
    """The lines of PROGRAM --print, by rosbags."""
    scans, odometry = [], []
    with AnyReader([path], default_typestore=store) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/scan":
                scans.append((time, message))
            elif connection.topic == "/odom":
                stamp = message.header.stamp
                odometry.append((stamp.sec * SECOND + stamp.nanosec, message.pose.pose.position.x))
    odometry = dict(odometry)
    lines = []
    for _, scan in scans:
        stamp = scan.header.stamp.sec * SECOND + scan.header.stamp.nanosec
        ranges = np.array(scan.ranges, dtype=np.float32)
        # what a record promises: no return is +inf, -inf is an invalid reading
        ranges[ranges >= RANGE_MAX] = np.inf
        ranges[np.isneginf(ranges)] = np.nan
        bits = ["7fc00000" if math.isnan(r) else struct.pack(">f", r).hex() for r in ranges]
        # upside down: the bearings are mirrored
        first, step = np.float32(-scan.angle_min), np.float32(-scan.angle_increment)
        lines.append(f"{stamp} {first:.9g} {step:.9g} {odometry[stamp]:.6f} 0.250000 {' '.join(bits)}")
    return lines


def printed(program, path):
    run = subprocess.run([program, "--print", str(path)], capture_output=True, text=True, check=False)
    return run.stdout.splitlines() if run.returncode == 0 else [run.stderr.strip()]


def compare(program, path, expected):
    got = printed(program, path)
    name = path.name if path.is_file() else f"{path.name}/"
    if got == expected:
        print(f"{name:16} {len(got)} scans, the same")
        return True
    for k, (a, b) in enumerate(zip(got, expected)):
        if a != b:
            print(f"{path}: scan {k}:\n  {a[:120]}\n  {b[:120]}")
            break
    print(f"{path}: {len(got)} scans, expected {len(expected)}")
    return False


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    ros1, ros2 = ros1_store(), get_typestore(Stores.ROS2_HUMBLE)
    compression = rosbag1.Writer.CompressionFormat
    mode, zstd = rosbag2.CompressionMode, rosbag2.CompressionFormat.ZSTD
    sqlite, mcap = rosbag2.StoragePlugin.SQLITE3, rosbag2.StoragePlugin.MCAP
    bags = [
        (write_ros1(folder / "none.bag", 1, None), ros1),
        (write_ros1(folder / "lz4.bag", 2, compression.LZ4), ros1),
        (write_ros1(folder / "bz2.bag", 3, compression.BZ2), ros1),
        (write_ros2(folder / "sqlite", 4, sqlite), ros2),
        (write_ros2(folder / "sqlite-message", 5, sqlite, mode.MESSAGE, zstd), ros2),
        (write_ros2(folder / "sqlite-file", 6, sqlite, mode.FILE, zstd), ros2),
        (write_ros2(folder / "mcap", 7, mcap), ros2),
        (write_ros2(folder / "mcap-chunk", 8, mcap, mode.STORAGE, zstd), ros2),
        (write_ros2(folder / "mcap-file", 9, mcap, mode.FILE, zstd), ros2),
        (write_ros2(folder / "big-endian", 10, sqlite, little_endian=False), ros2),
    ]
    same = [compare(program, path, expected_scans(path, store)) for path, store in bags]
    # rosbags writes no split bags: the halves are compared with the whole
    same.append(compare(program, write_split(folder / "split", 7), expected_scans(folder / "mcap", ros2)))
    logged = printed(program, LOG)
    same.append(compare(program, write_ros1(folder / "log.bag", 0, None, logged_scene), logged))
    same.append(compare(program, write_ros2(folder / "log", 0, mcap, make=logged_scene), logged))
    print(f"{sum(same)} of {len(same)} bags read as rosbags reads them")
    return 0 if all(same) else 1


if __name__ == "__main__":
    sys.exit(main())
