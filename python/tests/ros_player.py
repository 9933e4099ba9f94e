"""Plays a log to the node, prints the poses that come back: ros_player.py LOG COUNT RATE NAMESPACE.

The last transform on /tf comes with them, by the stand-in of tf2_msgs where it is on the path.

RATE 0: reliable, each scan after the pose of the one before; else best effort, scans a second.
"""

import json
import math
import sys
import time

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger

import cairn2d

WAIT_S = 60
# Time from scan to scan of the log that is played best effort; its own times are uneven.
PERIOD_NS = 100_000_000


def set_stamp(stamp, ns):
    stamp.sec, stamp.nanosec = divmod(ns, 10**9)


def as_pose(stamped):
    t = stamped.transform
    turn = 2 * math.atan2(t.rotation.z, t.rotation.w)
    return [stamped.header.frame_id, stamped.child_frame_id, t.translation.x, t.translation.y, turn]


def main():
    path, count, rate = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    log = cairn2d.read(path)[:count]
    rclpy.init()
    node = rclpy.create_node("player", namespace=sys.argv[4])
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
    effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    scans = node.create_publisher(LaserScan, "scan", effort if rate else keep_all)
    odometry = node.create_publisher(Odometry, "odom", keep_all)
    poses, maps, transforms = [], [], []
    node.create_subscription(PoseWithCovarianceStamped, "pose", lambda m: poses.append(m), keep_all)
    node.create_subscription(OccupancyGrid, "map", lambda m: maps.append(m), latched)
    node.create_subscription(TransformStamped, "tf", lambda m: transforms.append(m), 50)
    save = node.create_client(Trigger, "save_map")

    def spin_until(ready, seconds):
        end = time.monotonic() + seconds
        while not ready() and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.02)
        return ready()

    assert spin_until(lambda: scans.get_subscription_count() > 0, WAIT_S), "no node"
    assert spin_until(lambda: odometry.get_subscription_count() > 0, WAIT_S)
    assert spin_until(lambda: node.count_publishers("pose") > 0, WAIT_S)
    assert save.wait_for_service(WAIT_S)
    for i, scan in enumerate(log):
        message, moved = LaserScan(), Odometry()
        for header in (message.header, moved.header):
            set_stamp(header.stamp, (i + 1) * PERIOD_NS if rate else scan.stamp_ns)
        message.header.frame_id = "laser"
        message.angle_min, message.angle_increment = scan.angle_min, scan.angle_step
        message.angle_max = scan.angle_min + scan.angle_step * (scan.beams - 1)
        message.scan_time = PERIOD_NS / 1e9 if rate else 0.0
        message.range_min, message.range_max = scan.range_min, scan.range_max
        message.ranges = scan.ranges.tolist()
        moved.pose.pose.position.x, moved.pose.pose.position.y = scan.odometry[:2]
        half = scan.odometry.theta / 2
        moved.pose.pose.orientation.z = math.sin(half)
        moved.pose.pose.orientation.w = math.cos(half)
        odometry.publish(moved)
        # Every third scan is lost on the way.
        if not rate or i % 3 != 2:
            scans.publish(message)
        if rate:
            spin_until(lambda: False, 1 / rate)
        else:
            assert spin_until(lambda n=i: len(poses) > n, WAIT_S), f"no pose of scan {i}"
    spin_until(lambda: len(maps) > 0, WAIT_S)
    saved = save.call_async(Trigger.Request())
    assert spin_until(saved.done, WAIT_S)
    print(
        json.dumps(
            {
                "poses": [
                    (
                        m.pose.pose.position.x,
                        m.pose.pose.position.y,
                        2 * math.atan2(m.pose.pose.orientation.z, m.pose.pose.orientation.w),
                    )
                    for m in poses
                ],
                "transform": as_pose(transforms[-1]) if transforms else None,
                "stamps": [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in poses],
                "map": [maps[-1].info.width, maps[-1].info.height] if maps else None,
                "saved": saved.result().message if saved.result().success else None,
            }
        )
    )
    node.destroy_node()
    rclpy.shutdown()


main()
