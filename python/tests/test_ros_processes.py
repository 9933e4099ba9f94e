"""The ROS 2 node in a process of its own; with a player and a listener where a log is played."""

import csv
import json
import math
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import cairn2d
from cairn2d._ros_parts import heading

pytest.importorskip("rclpy")
pytest.importorskip("sensor_msgs")

HERE = Path(__file__).parent
# tf2_msgs, of which there is no wheel.
STAND_IN = HERE / "stand_in"
# Scans that are played reliably, and those that are played at 20 times the rate of the log.
RELIABLE_SCANS, FAST_SCANS, SPEED = 30, 120, 20
# Most time that a process takes to start, with the interpreter, to play, and to end.
START_S, PLAY_S, END_S = 60, 300, 60
# Time for which the node is held while the log is played fast, and before that.
HELD_S, BEFORE_HELD_S = 1.5, 0.3


class Processes:
    """Starts the processes of a test, and ends those that it leaves running."""

    def __init__(self, folder):
        self.folder = folder
        self.running = []
        # Apart from other tests that run at the same time in the same domain.
        self.namespace = f"/test_{os.getpid()}_{random.SystemRandom().randrange(10**6)}"
        self.environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(random.SystemRandom().randrange(60, 100)),
            "ROS_LOCALHOST_ONLY": "1",
            "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONPATH": os.pathsep.join([str(STAND_IN), *sys.path]),
        }

    def start(self, *arguments, **files):
        """Starts Python."""
        command = [sys.executable, *(str(argument) for argument in arguments)]
        process = subprocess.Popen(command, env=self.environment, text=True, **files)
        self.running.append(process)
        return process

    def end(self):
        """Ends what still runs; a process that is held is let go first."""
        for process in self.running:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.wait()


@pytest.fixture
def processes(tmp_path):
    started = Processes(tmp_path)
    yield started
    started.end()


def play(processes, log, speed, *parameters):
    """Plays a log to the node; returns what the player and the listener print, and the node says.

    Where the log is played fast, the node is held for a moment, as a busy machine holds it.
    """
    folder, namespace = processes.folder, processes.namespace
    options = ["--ros-args", "-r", f"__ns:={namespace}"]
    for parameter in (f"map_path:={folder / 'map.yaml'}", "map_period:=0.5", *parameters):
        options += ["-p", parameter]
    pipe = subprocess.PIPE
    with open(folder / "node.txt", "w") as said:
        node = processes.start("-m", "cairn2d.ros", *options, stdout=said, stderr=said)
    listener = processes.start(HERE / "ros_listener.py", namespace, stdin=pipe, stdout=pipe)
    assert listener.stdout.readline() == "ready\n", (folder / "node.txt").read_text()
    player = processes.start(HERE / "ros_player.py", log, speed, namespace, stdout=pipe)
    if speed:
        assert player.stdout.readline() == "fast\n"
        time.sleep(BEFORE_HELD_S)
        node.send_signal(signal.SIGSTOP)
        time.sleep(HELD_S)
        node.send_signal(signal.SIGCONT)
    played, _ = player.communicate(timeout=PLAY_S)
    assert player.returncode == 0, (folder / "node.txt").read_text()
    heard, _ = listener.communicate("end\n", timeout=END_S)
    assert listener.returncode == 0
    node.send_signal(signal.SIGINT)
    node.wait(END_S)
    said = (folder / "node.txt").read_text()
    assert node.returncode == 0, said
    return json.loads(played), json.loads(heard), said


def through_quaternion(theta):
    """Returns a heading as it comes out of the message."""
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(theta / 2), "w": math.cos(theta / 2)}
    return heading(type("Quaternion", (), turn))


def kept_heading(theta):
    """Returns a heading near this one that comes out of the message as it went in."""
    theta = through_quaternion(theta)
    while through_quaternion(theta) != theta:
        theta = math.nextafter(theta, 0)
    return theta


def write_head(source, target, count):
    """Writes the first scans of a CARMEN log; their headings are those of quaternions."""
    lines = []
    for line in source.read_text().splitlines():
        fields = line.split()
        if fields[0] != "FLASER":
            continue
        # laser_x laser_y laser_theta odom_x odom_y odom_theta stamp host ltotal
        for place in (-7, -4):
            fields[place] = repr(kept_heading(float(fields[place])))
        lines.append(" ".join(fields))
    assert len(lines) >= count
    target.write_text("\n".join(lines[:count]) + "\n")


def same_places(found, expected):
    """Compares poses: positions bit for bit; between the headings lies a quaternion."""
    found, expected = np.array(found), np.array(expected)
    assert np.array_equal(found[:, :2], expected[:, :2])
    assert np.abs(np.sin((found[:, 2] - expected[:, 2]) / 2)).max() < 1e-12


def test_a_log_played_reliably_gives_the_bits_of_cairn_map(program, data, tmp_path, processes):
    head = tmp_path / "head.log"
    write_head(data / "logs/apartment.log", head, RELIABLE_SCANS)
    played, heard, said = play(processes, head, 0, "reliable:=true")
    log = cairn2d.read(head)
    mapper = cairn2d.Mapper(beams=log.beams, keyframes=4096)
    online = [mapper.add(scan).pose for scan in log]
    same_places(heard["poses"], online)
    assert heard["transform"][:2] == ["map", "odom"]
    assert heard["transform"][2:] == pytest.approx(tuple(mapper.map_odom), abs=1e-12)
    # What is published after save_map is the settled map, as the program writes it.
    program("cairn", "map", head, "-o", tmp_path / "program", "--quiet")
    with open(tmp_path / "program/poses.csv", encoding="utf-8") as file:
        rows = [[float(row[name]) for name in ("x", "y", "theta")] for row in csv.DictReader(file)]
    assert len(rows) == RELIABLE_SCANS
    assert not np.array_equal(rows, online)
    same_places(heard["path"], rows)
    assert played["saved"] == str(tmp_path / "map.yaml")
    for name in ("map.yaml", "map.pgm"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "program" / name).read_bytes()
    height, width = cairn2d.Grid.read(tmp_path / "map.yaml").shape
    assert heard["map"] == [width, height]
    assert heard["diagnostics"]["message"] == "mapping"
    assert "scans lost" not in said


def test_scans_lost_at_20_times_the_rate_are_counted_and_said(data, tmp_path, processes):
    head = tmp_path / "head.log"
    write_head(data / "logs/apartment.log", head, FAST_SCANS)
    played, heard, said = play(processes, head, SPEED)
    assert played["speed"] > 0.8 * SPEED
    stamps = cairn2d.read(head).stamps_ns
    period = int(stamps[-1] - stamps[0]) // (FAST_SCANS - 1)
    first, last = (heard["stamps"][i] // period for i in (0, -1))
    assert last == FAST_SCANS
    values = heard["diagnostics"]["values"]
    mapped = sum(values.get(name, 0) for name in ("first", "matched", "predicted", "blind"))
    lost = values["lost"]
    # More than the node keeps while it is held.
    assert lost >= 10
    assert mapped + lost == last - first + 1
    assert f"scans lost, {lost} in all" in said
    assert heard["diagnostics"]["level"] == 1
    assert heard["diagnostics"]["message"] == f"{lost} scans lost"


@pytest.mark.parametrize(
    ("parameter", "said"),
    [
        ("keyframe_distance:=-1.0", "mapper: keyframe_distance is -1, expected "),
        ("resolution:=-1.0", "resolution is -1, expected a number above 0"),
        ("sensor_pose:=[0.0,1.0]", "sensor_pose is [0.0, 1.0], expected three finite numbers"),
        ("keyframes:=many", "'keyframes' to 'many'"),
        ("loop.nothing:=3", "there is no parameter loop.nothing"),
        ("nothing", "'-p nothing'"),
    ],
)
def test_a_parameter_out_of_range_ends_the_node_at_its_start(tmp_path, parameter, said):
    command = [sys.executable, "-m", "cairn2d.ros", "--ros-args", "-p", parameter]
    environment = {**os.environ, "ROS_LOCALHOST_ONLY": "1", "ROS_LOG_DIR": str(tmp_path)}
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=START_S
    )
    assert done.returncode == 2
    # rcl writes lines of its own about arguments that it cannot read.
    (line,) = (line for line in done.stderr.splitlines() if "[rcl]" not in line)
    assert line.startswith("cairn2d.ros: ")
    assert said in line
