"""What was taken of a bag: its topics and frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ._base import Result, text
from ._cairn import ffi


@dataclass(frozen=True)
class LogTopic(Result):
    """A topic of a bag.

    Attributes
    ----------
    topic, type : str
        Its name, and the type of its messages.
    messages, used : int
        Its messages in the bag, and those of which a scan, a pose or transforms were read.
    """

    topic: str
    type: str
    messages: int
    used: int


@dataclass(frozen=True)
class Mounting(Result):
    """Where the pose of the sensor on the robot is from.

    Attributes
    ----------
    topic : str or None
        Topic of the transform at the sensor; None: none was used.
    base_frame, sensor_frame : str
        Frames of the robot and of the scans.
    known : bool
        False: no transforms lead from one to the other, the sensor is taken to be at the robot's
        origin.
    upside_down : bool
        Whether the sensor is upside down.
    moves : bool
        Whether a transform on the way to the sensor moves: its first value was taken.
    tilt : float
        Angle of the scan's plane to the level, rad.
    """

    topic: str | None
    base_frame: str
    sensor_frame: str
    known: bool
    upside_down: bool
    moves: bool
    tilt: float


@dataclass(frozen=True)
class LogSources(Result):
    """What was taken of a bag, as ``cairn info --json`` says it.

    Attributes
    ----------
    scans : LogTopic
        Topic of the scans.
    odometry : LogTopic or None
        Topic of the odometry, which may be one of transforms; None: no odometry.
    odometry_frame : str or None
        Frame of the odometry; None: no odometry.
    mounting : Mounting
        Where the pose of the sensor is from.
    topics : list of LogTopic
        All topics of the bag, in the order of their first messages.
    """

    scans: LogTopic
    odometry: LogTopic | None
    odometry_frame: str | None
    mounting: Mounting
    topics: list[LogTopic]


def sources_of(sources: Any) -> LogSources | None:
    """Returns a ``cairn_scan_log_sources *``; None for NULL."""
    if sources == ffi.NULL:
        return None
    topics = [
        LogTopic(text(t.name), text(t.type), int(t.messages), int(t.used))
        for t in sources.topics[0 : sources.topic_count]
    ]
    mounting = Mounting(
        topics[sources.mounting].topic if sources.mounting >= 0 else None,
        text(sources.base_frame),
        text(sources.sensor_frame),
        bool(sources.is_mounted),
        bool(sources.upside_down),
        bool(sources.moves),
        float(sources.tilt),
    )
    return LogSources(
        topics[sources.scans],
        topics[sources.odometry] if sources.odometry >= 0 else None,
        text(sources.odometry_frame) or None,
        mounting,
        topics,
    )
