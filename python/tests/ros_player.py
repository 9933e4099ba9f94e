"""Plays a log to the node: ros_player.py LOG SPEED NAMESPACE; prints what save_map answers.

SPEED 0: reliable, each scan after the pose of the one before. Else best effort at SPEED times the
rate of the log, evenly, but the first and the last scans at the rate of the log: "fast" is printed
where the others begin.
"""

import json
import math
import sys
import time

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger

import cairn2d

WAIT_S = 60
# Time in which the node finds the subscriptions that have found it.
DISCOVERY_S = 1
# Scans at the rate of the log at both ends.
SLOW_SCANS = 3


def period_ns(log):
    """Returns the mean time from scan to scan."""
    return int(log.stamps_ns[-1] - log.stamps_ns[0]) // (len(log) - 1)


def messages_of(scan, stamp, scan_time):
    """Returns the scan and the pose by odometry at a time in ns."""
    message, moved = LaserScan(), Odometry()
    for header in (message.header, moved.header):
        header.stamp.sec, header.stamp.nanosec = divmod(stamp, 10**9)
    message.header.frame_id = "laser"
    message.angle_min, message.angle_increment = scan.angle_min, scan.angle_step
    message.angle_max = scan.angle_min + scan.angle_step * (scan.beams - 1)
    message.scan_time = scan_time
    message.range_min, message.range_max = scan.range_min, scan.range_max
    message.ranges = scan.ranges.tolist()
    moved.pose.pose.position.x, moved.pose.pose.position.y = scan.odometry[:2]
    half = scan.odometry.theta / 2
    moved.pose.pose.orientation.z = math.sin(half)
    moved.pose.pose.orientation.w = math.cos(half)
    return message, moved


def main():
    path, speed, namespace = sys.argv[1], float(sys.argv[2]), sys.argv[3]
    log = cairn2d.read(path)
    rclpy.init()
    node = rclpy.create_node("player", namespace=namespace)
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
    effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    scans = node.create_publisher(LaserScan, "scan", effort if speed else keep_all)
    odometry = node.create_publisher(Odometry, "odom", keep_all)
    poses = []
    pose = node.create_subscription(PoseWithCovarianceStamped, "pose", poses.append, keep_all)
    save = node.create_client(Trigger, "save_map")

    def spin_until(ready, seconds):
        end = time.monotonic() + seconds
        while not ready() and (left := end - time.monotonic()) > 0:
            rclpy.spin_once(node, timeout_sec=min(left, 0.02))
        return ready()

    assert spin_until(lambda: scans.get_subscription_count() > 0, WAIT_S), "no node"
    assert spin_until(lambda: odometry.get_subscription_count() > 0, WAIT_S)
    assert spin_until(lambda: pose.get_publisher_count() > 0, WAIT_S)
    assert save.wait_for_service(WAIT_S)
    spin_until(lambda: False, DISCOVERY_S)
    period = period_ns(log)
    begin = due = time.monotonic()
    for i, scan in enumerate(log):
        if speed:
            message, moved = messages_of(scan, (i + 1) * period, period / 1e9)
        else:
            message, moved = messages_of(scan, scan.stamp_ns, 0.0)
        odometry.publish(moved)
        scans.publish(message)
        if not speed:
            assert spin_until(lambda n=i: len(poses) > n, WAIT_S), f"no pose of scan {i}"
            continue
        if i == SLOW_SCANS:
            print("fast", flush=True)
            begin = due = time.monotonic()
        is_fast = SLOW_SCANS <= i < len(log) - SLOW_SCANS
        due += period / 1e9 / (speed if is_fast else 1)
        if is_fast:
            played = (i + 1 - SLOW_SCANS) * period / 1e9
            reached = played / max(time.monotonic() - begin, 1e-9)
        spin_until(lambda: False, due - time.monotonic())
    saved = save.call_async(Trigger.Request())
    assert spin_until(saved.done, WAIT_S)
    answer = saved.result()
    print(
        json.dumps(
            {
                "saved": answer.message if answer.success else None,
                "speed": reached if speed else None,
            }
        )
    )
    node.destroy_node()
    rclpy.shutdown()


main()
