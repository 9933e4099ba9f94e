"""All scans of a log at once, in any order: poses, covariances, and what cannot be known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ._base import (
    UNBOUNDED,
    BadArgumentError,
    Bool,
    EmptyError,
    Float64,
    FullError,
    Int64,
    PathLike,
    Result,
    check,
    create,
    error_of,
    frame,
    get_fields,
    new_fault,
    new_params,
    pose_of,
    run,
)
from ._cairn import ffi, lib
from .grids import Grid
from .logs import IDENTITY, Log, need_odometry
from .mapping import Kept, write_poses

METHODS = ("default", "gradient", "lum", "virtual", "places")
# Most points, and segments, of all scans together.
MAX_POINTS = 1 << 24
# m: scans within this distance by the log are one place.
PLACE_RADIUS_M = 0.5
MAX_PLACES = 256
HYPOTHESES_PER_PAIR = 34
MAX_CONSENSUS_HYPOTHESES = 1 << 20
CORNERS_PER_SEGMENT = 16
# Links per scan that Lu and Milios have memory for.
MAX_LINKS_PER_SCAN = 256
LUM_REBUILD_INTERVAL = 5


@dataclass
class AlignResult(Result):
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

    @property
    def grid(self) -> Grid:
        """The occupancy map of all scans."""
        if self._grid is None:
            self._grid = self._kept.grid(*self._settings)
        return self._grid

    def save(self, folder: PathLike) -> None:
        """Writes poses.csv, map.yaml and map.pgm.

        Parameters
        ----------
        folder
            It is made when it is missing.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write_poses(target / "poses.csv", self)
        self.grid.save(target / "map.yaml")

    def to_dict(self) -> dict[str, Any]:
        """Returns the fields as lists, dicts, numbers and texts."""
        names = ("trajectory", "covariance", "support", "verdicts", "initial", "stamps_ns", "lines")
        out = {name: getattr(self, name) for name in (*names, "state")}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in out.items()}

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

    def _repr_png_(self) -> bytes:
        return self.grid._repr_png_()


class _Job:
    """The scans of an alignment, and their fits."""

    def __init__(self, log: Log, spacing: float) -> None:
        self.log, self.spacing = log, spacing
        values = {"max_beams": max(log.beams, 1), "spacing": spacing}
        self.scan, self._pool = create("scan", new_params("scan", values))
        self.kept = Kept(max(len(log), 1))
        self.points = self.segments = 0
        self.point_counts: list[int] = []
        for i, view in self.fits():
            placed, scan = self.kept.keep(view), log[i]
            placed.line, placed.stamp_ns = scan.line, scan.stamp_ns
            placed.before = tuple(scan.odometry or IDENTITY)
            self.points += view.point_count
            self.segments += view.segment_count
            self.point_counts.append(int(view.point_count))
        if self.points == 0:
            raise EmptyError(f"{log.path}: no scan shows a wall, expected at least one")
        if max(self.points, self.segments) > MAX_POINTS:
            raise FullError(f"{log.path}: the scans have {self.points} points; widen spacing")

    def fits(self) -> Iterator[tuple[int, Any]]:
        """Fits the scans one after the other; each view is valid until the next one."""
        for i, scan in enumerate(self.log):
            fault = new_fault()
            status = lib.cairn_scan_begin(self.scan, scan._input, fault)
            self.check(status, i, fault)
            run(lambda budget: lib.cairn_scan_step(self.scan, budget))
            yield i, ffi.new("cairn_scan_view *", lib.cairn_scan_read(self.scan))

    def check(self, status: int, i: int, fault: Any = None) -> None:
        """Raises the exception of a scan that is refused."""
        if status < 0:
            line = self.log[i].line or None
            raise error_of(
                status, "the scan cannot be used", fault=fault, file=self.log.path, line=line
            )

    def before(self, i: int) -> tuple[float, float, float]:
        """Returns the initial pose of a scan."""
        pose = self.log[i].odometry or IDENTITY
        return pose.x, pose.y, pose.theta

    def aligner_params(self, spread: tuple[float, float]) -> dict[str, Any]:
        """Returns the aligner's params with capacities for the scans."""
        count = len(self.log)
        return {
            "max_scans": count,
            "max_segments": self.segments,
            "max_points": self.points,
            "max_hypotheses": 24 * count,
            "max_fill": 32 * count,
            "max_initial_error": spread[0],
            "max_initial_angle_error": min(spread[1], np.pi),
        }

    def place(self, i: int, pose: Any, verdict: str, low_confidence: bool) -> None:
        """Stores the pose of a scan."""
        scan = self.kept.scans + i
        scan.after, scan.low_confidence = pose, low_confidence
        scan.verdict = _constant(verdict)

    def place_aligned(self, i: int, pose: Any) -> None:
        """Stores the pose that the aligner has found."""
        blind = self.point_counts[i] == 0
        word = "placed" if pose.placed else "apart" if pose.component > 0 else "uncertain"
        self.place(i, pose.map_scan, "blind" if blind else word, not pose.placed)
        self.kept.scans[i].covariance = pose.covariance
        self.kept.scans[i].support = pose.support

    def result(self, state: dict[str, Any], settings: tuple[float, float, float]) -> AlignResult:
        """Returns what was found."""
        table = self.kept.table
        columns = [table[k].copy() for k in ("after", "covariance", "support")]
        return AlignResult(
            columns[0],
            columns[1],
            columns[2],
            self.kept.verdicts(),
            table["before"].copy(),
            table["stamp_ns"].copy(),
            table["line"].copy(),
            state,
            self.kept,
            settings,
        )


_constants: dict[str, Any] = {}


def _constant(word: str) -> Any:
    """Returns a verdict as a constant text of C."""
    if word not in _constants:
        _constants[word] = ffi.new("char[]", word.encode())
    return _constants[word]


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
        The method as printed in the thesis (``"lum"``, ``"places"``).
    online
        Scan after scan, each against all before (``"gradient"``).
    spacing
        Distance of the points along walls, m; None: 0.1, with ``"lum"`` 0.03.
    resolution, range, clear
        Cell size of the map, maximum range of beams entered, and range up to which beams without
        return free cells, m.

    Examples
    --------
    >>> import cairn2d as cairn
    >>> log = cairn.arena("rescue", seed=7).survey(places=3, disturb=(0.2, 0.2))
    >>> cairn.align(log).trajectory.shape
    (12, 3)
    """
    if method not in METHODS:
        raise BadArgumentError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
    if as_written and method not in ("lum", "places"):
        raise BadArgumentError(f"as_written with method {method!r}, expected 'lum' or 'places'")
    if online and method != "gradient":
        raise BadArgumentError(f"online with method {method!r}, expected 'gradient'")
    if headings == 0:
        need_odometry(log)
    if spacing is None:
        spacing = 0.03 if method == "lum" else 0.1
    job = _Job(log, spacing)
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
    return job.result(state, (resolution, range, clear))


def _by_default(job: _Job, spread: tuple[float, float]) -> dict[str, Any]:
    params = new_params("aligner", job.aligner_params(spread))
    aligner, _pool = create("aligner", params)
    for i, view in job.fits():
        fault = new_fault()
        job.check(lib.cairn_aligner_add_scan(aligner, view, job.before(i), fault), i, fault)
    check(lib.cairn_aligner_begin(aligner), job.log.path)
    run(lambda budget: lib.cairn_aligner_step(aligner, budget), job.log.path)
    for i in range_of(job):
        job.place_aligned(i, lib.cairn_aligner_pose_of(aligner, i))
    return get_fields(lib.cairn_aligner_read(aligner))


def range_of(job: _Job) -> range:
    """Returns the indices of the scans."""
    return range(len(job.log))


def _by_virtual(job: _Job, spread: tuple[float, float]) -> dict[str, Any]:
    params = new_params("virtual_align", {"aligner": job.aligner_params(spread)})
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
            scan.verdict = _constant("guessed")
    return get_fields(lib.cairn_virtual_align_read(aligner))


def _by_field(job: _Job, steps: int, online: bool) -> dict[str, Any]:
    values = {
        "max_scans": len(job.log),
        "max_segments": job.segments,
        "max_corners": CORNERS_PER_SEGMENT * job.segments,
        "max_points": job.points,
        "max_steps": steps,
    }
    params = new_params("force_field", values, lib.cairn_force_field_as_written())
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


def _by_lum(job: _Job, steps: int, as_written: bool) -> dict[str, Any]:
    count = len(job.log)
    links = min(count * (count - 1) // 2, count * MAX_LINKS_PER_SCAN) + 1
    hits = min(count * job.log.beams, MAX_POINTS)
    values = {
        "max_scans": count,
        "max_points": hits if as_written else job.points,
        "max_links": links,
        "max_fill": links,
        "max_iterations": steps,
    }
    if not as_written:
        values |= {"rebuild_interval": LUM_REBUILD_INTERVAL, "sequential_registration": 1}
    start = lib.cairn_lum_as_written() if as_written else lib.cairn_lum_default()
    lum, _pool = create("lum", new_params("lum", values, start))
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


def _by_places(job: _Job, headings: int, as_written: bool) -> dict[str, Any]:
    places, poses = _group(job, headings, as_written)
    count, points, beams = places[-1] + 1, _most(places, job.point_counts), 0
    beams = _most(places, [scan.beams for scan in job.log])
    start = lib.cairn_place_map_as_written() if as_written else lib.cairn_place_map_default()
    wanted = HYPOTHESES_PER_PAIR * (count * (count - 1) // 2)
    values: dict[str, Any] = {
        "max_places": count,
        "max_scans": len(job.log),
        "max_place_points": beams if as_written or points == 0 else points,
        "max_place_beams": beams,
    }
    if wanted > start.consensus.max_hypotheses:
        values["consensus"] = {"max_hypotheses": min(wanted, MAX_CONSENSUS_HYPOTHESES)}
    if not as_written:
        default = lib.cairn_aligner_default()
        spread = (default.max_initial_error, default.max_initial_angle_error)
        values["match"] = {"spacing": job.spacing}
        values["decoupled"] = lib.CAIRN_PLACE_MAP_JOINTLY
        values["aligner"] = job.aligner_params(spread)
    map_, _pool = create("place_map", new_params("place_map", values, start))
    for i, view in job.fits():
        fault = new_fault()
        status = lib.cairn_place_map_add_scan(map_, places[i], view, tuple(poses[i]), fault)
        job.check(status, i, fault)
    check(lib.cairn_place_map_begin(map_), job.log.path)
    run(lambda budget: lib.cairn_place_map_step(map_, budget), job.log.path)
    for i in range_of(job):
        _read_place(job, map_, i, places[i], as_written)
    return get_fields(lib.cairn_place_map_read(map_))


def _read_place(job: _Job, map_: Any, i: int, index: int, as_written: bool) -> None:
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


def _group(job: _Job, headings: int, as_written: bool) -> tuple[list[int], list[Any]]:
    """Returns the place of every scan, and its pose there."""
    places: list[int] = []
    poses: list[Any] = []
    if headings > 0 and len(job.log) % headings:
        raise BadArgumentError(
            f"{job.log.path} holds {len(job.log)} scans, expected a multiple of headings {headings}"
        )
    first, place = 0, -1
    for i in range_of(job):
        if headings > 0:
            begins = i % headings == 0
        else:
            a, b = job.before(first), job.before(i)
            begins = i == 0 or float(np.hypot(b[0] - a[0], b[1] - a[1])) > PLACE_RADIUS_M
        if begins:
            first, place = i, place + 1
        places.append(place)
        poses.append(_pose_in_place(job, first, i, headings, as_written))
    if not 2 <= place + 1 <= MAX_PLACES:
        raise BadArgumentError(
            f"{job.log.path} holds {place + 1} places, expected 2 to {MAX_PLACES}"
        )
    return places, poses


def _pose_in_place(job: _Job, first: int, i: int, headings: int, as_written: bool) -> Any:
    if headings > 0:
        turn = lib.cairn_wrap_angle((i - first) * 2 * np.pi / headings)
        return (0.0, 0.0, turn)
    start = (0.0, 0.0, job.before(first)[2] if as_written else 0.0)
    between = lib.cairn_pose_between(job.before(first), job.before(i))
    return pose_of(lib.cairn_pose_compose(start, between))


def _most(places: list[int], counts: list[int]) -> int:
    """Returns the greatest sum of counts of a place."""
    return int(np.bincount(places, counts).max())
