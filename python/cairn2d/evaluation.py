"""Quality of maps and poses."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    EmptyError,
    Float64,
    Int64,
    NoMemoryError,
    PathLike,
    Result,
    array,
    check,
    check_file,
    check_number,
    copy_of,
    path_of,
    pointer,
)
from ._cairn import ffi, lib
from ._fitted import FittedLog
from ._kept import FARTHEST, check_map_settings
from .logs import Log

QUADRANTS = ("nw", "ne", "se", "sw")


@dataclass(frozen=True)
class PoseErrors(Result):
    """Errors of poses against ground truth.

    Attributes
    ----------
    x, y : float
        Mean absolute errors after the best rigid alignment, m.
    theta : float
        Mean absolute error of the headings, rad.
    distance_mean, distance_most : float
        Mean and greatest distance after that alignment, m.
    first_x, first_y, first_theta : float
        Mean absolute errors after alignment of the first poses, m and rad.
    count : int
        Poses compared.
    """

    x: float
    y: float
    theta: float
    distance_mean: float
    distance_most: float
    first_x: float
    first_y: float
    first_theta: float
    count: int


def _poses(values: ArrayLike, name: str) -> tuple[Float64, Any]:
    poses = array(values, np.float64, (None, 3), name)
    return poses, pointer(poses, "cairn_pose *")


def eval_poses(estimate: ArrayLike, truth: ArrayLike) -> PoseErrors:
    """Compares poses with the true ones.

    Parameters
    ----------
    estimate, truth
        Shape (n, 3), m and rad, of the same scans.

    Returns
    -------
    PoseErrors
        Mean and greatest errors, m and rad.
    """
    poses, estimated = _poses(estimate, "estimate")
    others, true = _poses(truth, "truth")
    if len(poses) != len(others):
        raise BadArgumentError(f"{len(poses)} poses and {len(others)} true ones, expected as many")
    if len(poses) == 0:
        raise EmptyError("no poses, expected at least one")
    first = ffi.new("cairn_map_quality_pose_errors *")
    status = lib.cairn_map_quality_pose_errors_of(estimated, true, len(poses), first)
    check(status, "poses")
    motion = lib.cairn_pose_fit(estimated, true, ffi.NULL, len(poses), 1)
    x = y = theta = mean = most = 0.0
    share = 1 / len(poses)
    for pose, other in zip(poses.tolist(), others.tolist()):
        moved = lib.cairn_pose_compose(motion, tuple(pose))
        dx, dy = moved.x - other[0], moved.y - other[1]
        distance = float(np.hypot(dx, dy))
        x += share * abs(dx)
        y += share * abs(dy)
        theta += share * abs(lib.cairn_wrap_angle(moved.theta - other[2]))
        mean += distance / len(poses)
        most = max(most, distance)
    return PoseErrors(x, y, theta, mean, most, first.x, first.y, first.theta, len(poses))


@dataclass(frozen=True)
class RelationErrors(Result):
    """Errors of relative poses against reference relations (Kuemmerle et al. 2009).

    Attributes
    ----------
    distance_mean, distance_sd, distance_squared : float
        Mean, standard deviation (m) and mean square (m^2) of the translation errors.
    angle_mean, angle_sd, angle_squared : float
        Likewise of the rotations, rad and rad^2.
    count, left_out : int
        Relations used, and those without both scans.
    """

    distance_mean: float
    distance_sd: float
    distance_squared: float
    angle_mean: float
    angle_sd: float
    angle_squared: float
    count: int
    left_out: int


def eval_relations(poses: ArrayLike, relations: PathLike, stamps_ns: ArrayLike) -> RelationErrors:
    """Compares relative poses with reference relations.

    Parameters
    ----------
    poses
        Shape (n, 3): poses of the sensor at the scans, m and rad.
    relations
        A file of lines ``t1 t2 x y z roll pitch yaw`` or ``a b x y theta``.
    stamps_ns
        Shape (n,): times of the scans, ns.

    Returns
    -------
    RelationErrors
        Errors of the relations of which both scans are there.
    """
    values, _ = _poses(poses, "poses")
    stamps: Int64 = array(stamps_ns, np.int64, (len(values),), "stamps_ns")
    row, count = ffi.new("cairn_relation_table_row **"), ffi.new("int32_t *")
    error = ffi.new("cairn_file_error *")
    status = lib.cairn_relation_table_read(row, count, path_of(relations), error)
    check_file(status, error, os.fspath(relations))
    rows = ffi.gc(row[0], lib.cairn_relation_table_free)
    times = pointer(stamps, "const int64_t *")
    if lib.cairn_relation_table_find(rows, count[0], times, len(stamps)) < 0:
        raise NoMemoryError(f"no memory for {len(values)} poses")
    sums = ffi.new("cairn_map_quality_relation_sums *")
    listed = values.tolist()
    for r in rows[0 : count[0]]:
        if 0 <= r.first < len(listed) and 0 <= r.second < len(listed):
            first, second = tuple(listed[r.first]), tuple(listed[r.second])
            status = lib.cairn_map_quality_relation_add(sums, r.reference, first, second)
            check(status, "relation", file=os.fspath(relations), line=int(r.line))
    if sums.count == 0:
        raise EmptyError(f"no scan is in {os.fspath(relations)}, expected relations between scans")
    e = lib.cairn_map_quality_relation_errors_of(sums)
    return RelationErrors(
        e.distance_mean,
        e.distance_sd,
        e.distance_squared,
        e.angle_mean,
        e.angle_sd,
        e.angle_squared,
        int(sums.count),
        int(count[0] - sums.count),
    )


@dataclass(frozen=True)
class MapQuality(Result):
    """Quality of the map of a log at given poses.

    Attributes
    ----------
    entropy : float
        Entropy of the occupancy grid, nats; lower is better, at one resolution.
    log_likelihood : float
        Log-likelihood of all beams, nats; higher is better.
    quadrant_entropy : ndarray
        Shape (4,): north-west, north-east, south-east, south-west.
    cells : int
        Observed cells.
    beams, hits : int
        Beams, and those that end on a surface.
    """

    entropy: float
    log_likelihood: float
    quadrant_entropy: Float64
    cells: int
    beams: int
    hits: int


def eval_map(
    log: Log,
    poses: ArrayLike | None = None,
    *,
    resolution: float = 0.05,
    range: float = 30.0,
    least: float = 1e-3,
) -> MapQuality:
    """Enters all beams of a log into an occupancy grid and measures it.

    Parameters
    ----------
    log
        The scans.
    poses
        Shape (scans, 3), m and rad; None: those of the log.
    resolution, range
        Cell size and maximum range of beams entered, m.
    least
        Probability of an outlier beam.

    Returns
    -------
    MapQuality
        Entropy of the map, and likelihood of its beams.
    """
    check_map_settings(resolution, range)
    check_number("least", least, 0, 1, above=True)
    at = log.odometry if poses is None else array(poses, np.float64, (len(log), 3), "poses")
    job = FittedLog(log, lib.cairn_scan_default().spacing)
    job.kept.table["after"][:] = at
    scans = ffi.new("cairn_placed_scan_map *")
    scans.scan, scans.count = job.kept.scans, job.kept.count
    scans.resolution = resolution
    scans.beams.max_range, scans.beams.max_free_range = min(range, FARTHEST), FARTHEST
    error, params = ffi.new("cairn_file_error *"), ffi.new("cairn_occupancy_grid_params *")
    check_file(lib.cairn_placed_scan_map_layout(scans, params, error), error)
    made = ffi.new("cairn_heap_grid *")
    check_file(lib.cairn_placed_scan_map_grid(scans, params, made, error), error)
    try:
        return _measure(scans, params, made.grid, least)
    finally:
        lib.free(made.memory)


def _measure(scans: Any, params: Any, grid: Any, least: float) -> MapQuality:
    entropy = ffi.new("cairn_map_quality_entropy *")
    check(lib.cairn_map_quality_entropy_add(grid, 0, params.height, entropy), "entropy")
    start, end = ffi.new("cairn_vec2 *"), ffi.new("cairn_vec2 *")
    hit, value = ffi.new("int32_t *"), ffi.new("cairn_real *")
    entry = ffi.addressof(scans, "beams")
    total, beams, hits = 0.0, 0, 0
    for k in np.arange(scans.count).tolist():
        scan = ffi.new("cairn_scan_map_scan *", lib.cairn_placed_scan_beams(scans.scan + k))
        transform = lib.cairn_transform_of(scan.map_scan)
        for i in np.arange(scan.beam_count).tolist():
            if not lib.cairn_scan_map_beam(entry, scan, i, transform, start, end, hit):
                continue
            status = lib.cairn_map_quality_beam_likelihood(
                grid, start[0], end[0], hit[0], least, value
            )
            check(status, "beam")
            total += value[0]
            beams += 1
            hits += hit[0]
    if beams == 0 or entropy.cells == 0:
        raise EmptyError("no beam lies in the map, expected at least one")
    quadrants = copy_of(entropy.quadrant, (len(QUADRANTS),), "<f8")
    return MapQuality(entropy.total, total, quadrants, int(entropy.cells), beams, hits)
