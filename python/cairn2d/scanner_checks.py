"""What is set wrongly of the scanner of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ._base import Pose, Result, check, pose_of
from ._cairn import ffi, lib

# Names of the faults, in the order of cairn_scanner_check_fault.
FAULTS = (
    "range_scale",
    "flip",
    "angle_step",
    "sweep",
    "sensor",
    "odometry_distance",
    "odometry_turn",
    "stamps",
    "repeated",
)


class Estimate(NamedTuple):
    """An estimate with its standard deviation."""

    value: float
    sigma: float


@dataclass(frozen=True)
class ScannerCheck(Result):
    """What is set wrongly of the scanner of a log, as ``cairn info --check`` finds it.

    Estimates are None where the log does not determine them.

    Attributes
    ----------
    faults : list of str
        What was found, clearly significant and large enough to matter: ``"range_scale"``,
        ``"flip"``, ``"angle_step"``, ``"sweep"``, ``"sensor"``, ``"odometry_distance"``,
        ``"odometry_turn"``, ``"stamps"`` (they go backward, or stand still) or ``"repeated"`` (the
        same scan again and again).
    corrections : dict
        What mends them: keywords of `read`.
    scans, pairs, turns, walls : int
        Scans, pairs of scans that were matched, those with a turn, and straight walls measured.
    has_odometry : bool
        False: there is none, or it never moves.
    moved, repeated : int
        Scans after a motion by the odometry, and those of them with the ranges of the scan before.
    backward, constant : int
        Scans with a stamp earlier than that of the scan before, and with the same stamp.
    median_range, angle_step, sweep : float
        Median of the returns (m), angle from beam to beam (rad) and duration of a scan (s; 0:
        unknown), as logged.
    sensor : Pose
        Pose of the sensor on the robot, as logged, m and rad.
    range_scale : float
        Factor that makes the ranges metres.
    turn_ratio : Estimate or None
        Turns of the scans per turn of the odometry, as logged.
    step_ratio : Estimate or None
        True angle from beam to beam per logged one, from the bend of walls.
    overlap_step_ratio : Estimate or None
        The same from overlapping scans of the map, which is made only where walls are bent by less
        than 1 %; it must then agree for the fault to be found.
    sweep_found : Estimate or None
        Duration of a scan, s.
    distance_ratio, turn_scale : Estimate or None
        Motions and turns of the scans per those of the odometry, after all corrections before.
    x, y, theta : Estimate or None
        Pose of the sensor on the robot, m and rad.
    """

    faults: list[str]
    corrections: dict[str, Any]
    scans: int
    pairs: int
    turns: int
    walls: int
    has_odometry: bool
    moved: int
    repeated: int
    backward: int
    constant: int
    median_range: float
    angle_step: float
    sweep: float
    sensor: Pose
    range_scale: float
    turn_ratio: Estimate | None
    step_ratio: Estimate | None
    overlap_step_ratio: Estimate | None
    sweep_found: Estimate | None
    distance_ratio: Estimate | None
    turn_scale: Estimate | None
    x: Estimate | None
    y: Estimate | None
    theta: Estimate | None


def check_scanner(log: Any, path: str) -> ScannerCheck:
    """Checks a ``cairn_scan_log *``."""
    found = ffi.new("cairn_scanner_check_result *")
    check(lib.cairn_scanner_check_run(found, log, ffi.NULL), path)
    faults = [name for i, name in enumerate(FAULTS) if lib.cairn_scanner_check_has(found, i)]
    return ScannerCheck(
        faults,
        _corrections(found, faults),
        int(found.scans),
        int(found.pairs),
        int(found.turns),
        int(found.walls),
        bool(found.has_odometry),
        int(found.moved),
        int(found.repeated),
        int(found.backward),
        int(found.constant),
        found.median_range,
        found.angle_step,
        found.sweep,
        pose_of(found.base_sensor),
        found.range_scale,
        _estimate(found.turn),
        _estimate(found.step),
        _estimate(found.overlap_step),
        _estimate(found.sweep_found),
        _estimate(found.distance),
        _estimate(found.turn_scale),
        _estimate(found.x),
        _estimate(found.y),
        _estimate(found.theta),
    )


def _estimate(value: Any) -> Estimate | None:
    return Estimate(value.value, value.sigma) if value.is_known else None


def _corrections(found: Any, faults: list[str]) -> dict[str, Any]:
    """Returns the keywords of `read` that mend the faults."""
    logged = found.base_sensor
    sensor = Pose(
        *(
            estimate.value if estimate.is_known else before
            for estimate, before in (
                (found.x, logged.x),
                (found.y, logged.y),
                (found.theta, logged.theta),
            )
        )
    )
    step = found.overlap_step if found.overlap_step.is_known else found.step
    mended_by = {
        "range_scale": found.range_scale,
        "flip": True,
        "angle_step": step.value * found.angle_step,
        "sweep": found.sweep_found.value,
        "sensor": sensor,
    }
    return {name: value for name, value in mended_by.items() if name in faults}
