"""All scans of a log at once, in any order: poses, covariances, and what cannot be known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._base import (
    UNBOUNDED,
    BadArgumentError,
    Bool,
    Float64,
    Int64,
    check,
    check_number,
    create,
    frame,
    get_fields,
    new_fault,
    new_params,
    run,
)
from ._cairn import ffi, lib
from ._fitted import FittedLog, constant
from ._kept import Kept, PlacedResult, check_map_settings
from .grids import Grid
from .logs import Log, need_odometry

METHODS = ("default", "gradient", "lum", "virtual", "places")


@dataclass
class AlignResult(PlacedResult):
    """Scans that were aligned.

    Attributes
    ----------
    trajectory : ndarray
        Poses of the scans in the map, shape (scans, 3), m and rad.
    covariance : ndarray
        Shape (scans, 3, 3) over (x, y, theta); NaN where the method has none.
    support : ndarray
        Shape (scans,): log-likelihood ratio of the pose given all other scans, nats; NaN where the
        method has none.
    verdicts : list of str
        ``"placed"``, ``"uncertain"``, ``"apart"`` (in another connected component), ``"blind"``
        (no surface in the scan), ``"aligned"`` or ``"guessed"``.
    map_sigma : ndarray
        Shape (scans,): NaN, as `covariance` is that of the pose in the map.
    initial : ndarray
        Poses before, shape (scans, 3), m and rad.
    stamps_ns, lines : ndarray
        Times of the scans in ns, and their lines in the file.
    state : dict
        Counts and verdict of the method.
    """

    trajectory: Float64
    covariance: Float64
    support: Float64
    verdicts: list[str]
    map_sigma: Float64
    initial: Float64
    stamps_ns: Int64
    lines: Int64
    state: dict[str, Any]
    _kept: Kept = field(repr=False)
    _settings: tuple[float, float, float] = field(repr=False, default=(0.05, 30.0, 5.0))
    _grid: Grid | None = field(repr=False, default=None)

    @property
    def placed(self) -> Bool:
        """Scans whose pose is known, shape (scans,)."""
        return np.array([verdict in ("placed", "aligned") for verdict in self.verdicts])

    def to_pandas(self) -> Any:
        """Returns a data frame of the scans: x, y, theta, support, verdict."""
        x, y, theta = self.trajectory.T
        columns = {"x": x, "y": y, "theta": theta, "support": self.support}
        return frame({**columns, "verdict": self.verdicts})

    def plot(self, ax: Any = None) -> Any:
        """Draws the map, poses that are known (blue) and those that are not (red)."""
        ax = self.grid.plot(ax)
        for chosen, style in ((self.placed, "tab:blue"), (~self.placed, "tab:red")):
            ax.plot(*self.trajectory[chosen].T[:2], ".", color=style)
        return ax


def align(
    log: Log,
    *,
    method: str = "default",
    spread: tuple[float, float] = (0.6, np.radians(35)),
    headings: int = 0,
    steps: int | None = None,
    as_written: bool = False,
    online: bool = False,
    spacing: float | None = None,
    resolution: float = 0.05,
    range: float = 30.0,
    clear: float = 5.0,
) -> AlignResult:
    """Aligns all scans of a log at once; their order does not matter.

    Parameters
    ----------
    log
        The scans; their odometry is the initial estimate.
    method
        ``"default"``: pairwise registration, clusters, joint least squares of poses and walls.
        ``"virtual"``: then also hypotheses of lines and rectangles for scans that remain.
        ``"gradient"``: force field simulation as in the thesis. ``"lum"``: Lu and Milios.
        ``"places"``: without initial poses; whole places are matched, all with all.
    spread
        Bound of the error of the initial poses, m and rad (``"default"``, ``"virtual"``).
    headings
        Scans per place at evenly spaced headings (``"places"``); 0: scans within 0.5 m by the log
        are one place.
    steps
        Most iterations (``"gradient"``, ``"lum"``); None: 50, as written 500 with ``"lum"``.
    as_written
        The method as printed in the thesis (``"lum"``, ``"places"``; ``"gradient"`` always is).
    online
        Scan after scan, each against all before (``"gradient"``).
    spacing
        Distance of the points along walls, m; None: 0.1, with ``"lum"`` 0.03.
    resolution, range, clear
        Cell size of the map, maximum range of beams entered, and range up to which beams without
        return free cells, m.

    Returns
    -------
    AlignResult
        Poses, covariances and verdicts of the scans, and their map.

    Examples
    --------
    >>> import cairn2d as cairn
    >>> log = cairn.arena("rescue", seed=7).survey(places=3, disturb=(0.2, 0.2))
    >>> cairn.align(log).trajectory.shape
    (12, 3)
    """
    if method not in METHODS:
        raise BadArgumentError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
    if as_written and method not in ("gradient", "lum", "places"):
        raise BadArgumentError(
            f"as_written with method {method!r}, expected 'gradient', 'lum' or 'places'"
        )
    if online and method != "gradient":
        raise BadArgumentError(f"online with method {method!r}, expected 'gradient'")
    check_map_settings(resolution, range, clear)
    check_number("headings", headings, 0)
    if steps is not None:
        check_number("steps", steps, 1)
    for bound in spread:
        check_number("spread", bound, 0, above=True)
    if headings == 0:
        need_odometry(log)
    if spacing is None:
        spacing = 0.03 if method == "lum" else 0.1
    job = FittedLog(log, spacing)
    if method == "default":
        state = _by_default(job, spread)
    elif method == "virtual":
        state = _by_virtual(job, spread)
    elif method == "gradient":
        state = _by_field(job, 50 if steps is None else steps, online)
    elif method == "lum":
        most = (500 if as_written else 50) if steps is None else steps
        state = _by_lum(job, most, as_written)
    else:
        state = _by_places(job, headings, as_written)
    return _result(job, state, (resolution, range, clear))


def _result(
    job: FittedLog, state: dict[str, Any], settings: tuple[float, float, float]
) -> AlignResult:
    """Returns what was found."""
    table = job.kept.table
    columns = [table[k].copy() for k in ("after", "covariance", "support")]
    return AlignResult(
        columns[0],
        columns[1],
        columns[2],
        job.kept.verdicts(),
        table["map_sigma"].copy(),
        table["before"].copy(),
        table["stamp_ns"].copy(),
        table["line"].copy(),
        state,
        job.kept,
        settings,
    )


def _by_default(job: FittedLog, spread: tuple[float, float]) -> dict[str, Any]:
    params = new_params("aligner", {}, lib.cairn_capacity_aligner(job.sizes, *spread))
    aligner, _pool = create("aligner", params)
    for i, view in job.fits():
        fault = new_fault()
        job.check(lib.cairn_aligner_add_scan(aligner, view, job.before(i), fault), i, fault)
    check(lib.cairn_aligner_begin(aligner), job.log.path)
    run(lambda budget: lib.cairn_aligner_step(aligner, budget), job.log.path)
    for i in range_of(job):
        job.place_aligned(i, lib.cairn_aligner_pose_of(aligner, i))
    return get_fields(lib.cairn_aligner_read(aligner))


def range_of(job: FittedLog) -> range:
    """Returns the indices of the scans."""
    return range(len(job.log))


def _by_virtual(job: FittedLog, spread: tuple[float, float]) -> dict[str, Any]:
    start = lib.cairn_virtual_align_default()
    start.aligner = lib.cairn_capacity_aligner(job.sizes, *spread)
    params = new_params("virtual_align", {}, start)
    aligner, _pool = create("virtual_align", params)
    for i, view in job.fits():
        fault = new_fault()
        job.check(lib.cairn_virtual_align_add_scan(aligner, view, job.before(i), fault), i, fault)
    check(lib.cairn_virtual_align_begin(aligner), job.log.path)
    run(lambda budget: lib.cairn_virtual_align_step(aligner, budget), job.log.path)
    for i in range_of(job):
        pose = lib.cairn_virtual_align_pose_of(aligner, i)
        job.place_aligned(i, pose.aligned)
        scan = job.kept.scans[i]
        apart = pose.moved and pose.aligned.component != 0
        if apart and scan.low_confidence and job.point_counts[i] > 0:
            scan.verdict = constant("guessed")
    return get_fields(lib.cairn_virtual_align_read(aligner))


def _by_field(job: FittedLog, steps: int, online: bool) -> dict[str, Any]:
    params = new_params("force_field", {}, lib.cairn_capacity_force_field(job.sizes, steps))
    force, _pool = create("force_field", params)
    for i, view in job.fits():
        fault = new_fault()
        status = lib.cairn_force_field_add_scan(force, view, ffi.NULL, job.before(i), fault)
        job.check(status, i, fault)
        if online:
            lib.cairn_force_field_restart(force)
            _iterate_field(force)
    if not online:
        _iterate_field(force)
    for i in range_of(job):
        blind = job.point_counts[i] == 0
        job.place(i, lib.cairn_force_field_pose(force, i), "blind" if blind else "aligned", blind)
    return get_fields(lib.cairn_force_field_read(force))


def _iterate_field(force: Any) -> None:
    budget = ffi.new("cairn_budget *")
    running = lib.CAIRN_FORCE_FIELD_RUNNING
    while True:
        budget.left = UNBOUNDED
        check(lib.cairn_force_field_iterate(force, budget), "force field")
        if lib.cairn_force_field_read(force).verdict != running:
            return


def _by_lum(job: FittedLog, steps: int, as_written: bool) -> dict[str, Any]:
    params = new_params("lum", {}, lib.cairn_capacity_lum(job.sizes, steps, as_written))
    lum, _pool = create("lum", params)
    for i, view in job.fits():
        points, number = _hits(view) if as_written else (view.points, view.point_count)
        fault = new_fault()
        status = lib.cairn_lum_add_scan(lum, points, number, job.before(i), fault)
        job.check(status, i, fault)
    check(lib.cairn_lum_begin(lum), job.log.path)
    run(lambda budget: lib.cairn_lum_step(lum, budget), job.log.path)
    for i in range_of(job):
        blind = job.point_counts[i] == 0
        apart = not blind and not lib.cairn_lum_is_connected(lum, i)
        word = "blind" if blind else "apart" if apart else "aligned"
        job.place(i, lib.cairn_lum_pose(lum, i), word, blind or apart)
    return get_fields(lib.cairn_lum_read(lum))


def _hits(view: Any) -> tuple[Any, int]:
    """Returns the ends of the beams with a return as oriented points."""
    hits = [
        ((beam.to.x, beam.to.y), (1.0, 0.0))
        for beam in view.beams[0 : view.beam_count]
        if beam.kind == lib.CAIRN_SCAN_BEAM_HIT
    ]
    return ffi.new("cairn_oriented_point[]", hits or 1), len(hits)


def _by_places(job: FittedLog, headings: int, as_written: bool) -> dict[str, Any]:
    sizes, places, poses = _group(job, headings, as_written)
    start = lib.cairn_capacity_place_map(sizes, job.sizes, job.spacing)
    map_, _pool = create("place_map", new_params("place_map", {}, start))
    for i, view in job.fits():
        fault = new_fault()
        status = lib.cairn_place_map_add_scan(map_, places[i], view, poses[i], fault)
        job.check(status, i, fault)
    check(lib.cairn_place_map_begin(map_), job.log.path)
    run(lambda budget: lib.cairn_place_map_step(map_, budget), job.log.path)
    for i in range_of(job):
        _read_place(job, map_, i, places[i], as_written)
    return get_fields(lib.cairn_place_map_read(map_))


def _read_place(job: FittedLog, map_: Any, i: int, index: int, as_written: bool) -> None:
    """Stores the pose of a scan; scans of other components have frames of their own."""
    place = lib.cairn_place_map_place_of(map_, index)
    own = as_written or bool(lib.cairn_place_map_scan_is_aligned(map_, i))
    word = "placed"
    if job.point_counts[i] == 0:
        word = "blind"
    elif place.component > 0:
        word = "apart"
    elif place.ambiguous or not own:
        word = "uncertain"
    low = place.component > 0 or bool(place.ambiguous) or not own
    job.place(i, lib.cairn_place_map_scan_pose(map_, i), word, low)
    scan = job.kept.scans[i]
    if not as_written:
        scan.support = place.support
    if place.component > 0:
        scan.beam_count = scan.point_count = scan.segment_count = 0


def _group(job: FittedLog, headings: int, as_written: bool) -> tuple[Any, list[int], list[Any]]:
    """Returns the sizes of the places, the place of every scan, and its pose there."""
    if headings > 0 and len(job.log) % headings:
        raise BadArgumentError(
            f"{job.log.path} holds {len(job.log)} scans, expected a multiple of headings {headings}"
        )
    group = ffi.new(
        "cairn_place_map_grouping *", {"headings": headings, "keep_heading": int(as_written)}
    )
    sizes = ffi.new("cairn_capacity_places *", {"as_written": int(as_written)})
    pose = ffi.new("cairn_pose *")
    places: list[int] = []
    poses: list[Any] = []
    for i in range_of(job):
        points, beams = job.point_counts[i], job.log[i].beams
        place = int(lib.cairn_place_map_group(group, job.before(i), pose))
        lib.cairn_capacity_add_scan(sizes, place, points, beams)
        places.append(place)
        poses.append((pose.x, pose.y, pose.theta))
    if not 2 <= group.places <= lib.CAIRN_CAPACITY_MAX_PLACES:
        raise BadArgumentError(
            f"{job.log.path} holds {group.places} places, "
            f"expected 2 to {lib.CAIRN_CAPACITY_MAX_PLACES}"
        )
    return sizes, places, poses
