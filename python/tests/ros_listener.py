"""Listens to the node until a line or the end of standard input: ros_listener.py NAMESPACE.

It prints "ready" when it has found all publishers of the node. At the end it waits until the node
has drawn its map again, and prints what came: the poses, the last path, map, transform on /tf and
diagnostics.
"""

import json
import math
import sys
import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

WAIT_S = 60


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def pose_of(pose):
    return [pose.position.x, pose.position.y, turn_of(pose.orientation)]


def turn_of(q):
    return 2 * math.atan2(q.z, q.w)


def transform_of(stamped):
    t = stamped.transform
    frames = [stamped.header.frame_id, stamped.child_frame_id]
    return [*frames, t.translation.x, t.translation.y, turn_of(t.rotation)]


def status_of(message):
    (status,) = message.status
    values = {pair.key: int(pair.value) for pair in status.values}
    return {"level": status.level[0], "message": status.message, "values": values}


def main():
    rclpy.init()
    node = rclpy.create_node("listener", namespace=sys.argv[1])
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    came = {name: [] for name in ("poses", "path", "map", "transform", "diagnostics")}
    subscriptions = []
    for kind, topic, name, quality in (
        (PoseWithCovarianceStamped, "pose", "poses", keep_all),
        (Path, "path", "path", keep_all),
        (OccupancyGrid, "map", "map", latched),
        (TransformStamped, "tf", "transform", keep_all),
        (DiagnosticArray, "diagnostics", "diagnostics", keep_all),
    ):
        subscriptions.append(node.create_subscription(kind, topic, came[name].append, quality))
    end = time.monotonic() + WAIT_S
    while not all(subscription.get_publisher_count() > 0 for subscription in subscriptions):
        assert time.monotonic() < end, "no node"
        rclpy.spin_once(node, timeout_sec=0.02)
    print("ready", flush=True)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.readline(), ended.set()), daemon=True).start()
    while not ended.is_set():
        rclpy.spin_once(node, timeout_sec=0.02)
    # The map is drawn between two messages of the diagnostics.
    count, end = len(came["diagnostics"]) + 2, time.monotonic() + WAIT_S
    while len(came["diagnostics"]) < count or not came["map"]:
        assert time.monotonic() < end, "the node draws no map"
        rclpy.spin_once(node, timeout_sec=0.02)
    print(
        json.dumps(
            {
                "poses": [pose_of(message.pose.pose) for message in came["poses"]],
                "stamps": [stamp_of(message) for message in came["poses"]],
                "path": [pose_of(step.pose) for step in came["path"][-1].poses],
                "map": [came["map"][-1].info.width, came["map"][-1].info.height],
                "transform": transform_of(came["transform"][-1]),
                "diagnostics": status_of(came["diagnostics"][-1]),
            }
        )
    )
    node.destroy_node()
    rclpy.shutdown()


main()
