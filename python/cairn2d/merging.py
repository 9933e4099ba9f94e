"""Maps of several robots merged into one, without a guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    Float64,
    PathLike,
    Pose,
    Result,
    UInt8,
    check,
    check_file,
    check_number,
    create,
    frame,
    new_fault,
    new_params,
    pointer,
    pose_in,
    pose_of,
    run,
    text,
)
from ._cairn import ffi, lib
from .grids import MOST_METRES, Grid


@dataclass(frozen=True)
class PlacedMap(Result):
    """One map of a merging.

    Attributes
    ----------
    pose : Pose
        Pose of the map's frame in that of the reference, m and rad; the best one found for a map
        that was rejected.
    placed : bool
        Whether the map is part of the merged map.
    verdict : str
        ``"placed"``, or why it was rejected.
    support, competing_support : float
        Log-likelihood ratio of the pose and of its best competitor, nats.
    error_probability : float
        Probability that the pose is wrong, 0 to 1.
    rank : int
        Order of merging; 0: the reference.
    """

    pose: Pose
    placed: bool
    verdict: str
    support: float
    competing_support: float
    error_probability: float
    rank: int


@dataclass
class MergeResult(Result):
    """Maps that were merged.

    Attributes
    ----------
    grid : Grid
        The merged map in the frame of the reference.
    maps : list of PlacedMap
        What became of each map.
    downsampling : int
        Cells of the side of a cell in which the maps were compared.
    """

    grid: Grid
    maps: list[PlacedMap]
    downsampling: int

    @property
    def poses(self) -> Float64:
        """Poses of the maps in the frame of the reference, shape (maps, 3), m and rad."""
        return np.array([placed.pose for placed in self.maps])

    def to_pandas(self) -> Any:
        """Returns a data frame of the maps: x, y, theta, placed, verdict, error_probability."""
        x, y, theta = self.poses.T
        names = ("placed", "verdict", "support", "error_probability", "rank")
        columns = {name: [getattr(m, name) for m in self.maps] for name in names}
        return frame({"x": x, "y": y, "theta": theta, **columns})

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the merged map into axes of matplotlib, and returns the axes."""
        return self.grid.plot(ax, **style)

    def _repr_png_(self) -> bytes:
        return self.grid._repr_png_()


Map = Union[Grid, str, "PathLike"]
# Cells of a side that are downsampled to one.
MOST_COARSENED = 64
PERCEPTIONS = ("evidence", "images")


def merge(
    maps: Sequence[Map],
    *,
    reference: int = 0,
    order: Sequence[int] | None = None,
    scale: Sequence[float] | None = None,
    coarsen: int = 0,
    start: Sequence[ArrayLike | None] | None = None,
    perception: str = "evidence",
    as_written: bool = False,
    particles: int | None = None,
    seed: int = 1,
    **params: Any,
) -> MergeResult:
    """Merges occupancy maps; nothing is known of their relative poses.

    Parameters
    ----------
    maps
        Grids, or paths of map files (YAML).
    reference
        Index of the map whose frame is that of the result.
    order
        All indices, the reference first: the order of merging.
    scale
        Side of a cell of each map, m, in place of that of the map; None: that of the maps.
    coarsen
        Downsamples this many cells to one; 0: as needed.
    start
        For each map an initial estimate (x, y, theta) of its pose, m and rad, or None.
    perception
        Scoring of pose hypotheses: ``"evidence"``, the log-likelihood ratio, or ``"images"``, Psi
        and gamma of the thesis (9.5, 9.6), which is that of `as_written`.
    as_written
        Chapter 9 of the thesis as written.
    particles
        Particles of the filter; None: 100, as written 50.
    seed
        Seed of the random numbers.
    **params
        Further fields of ``cairn_map_merge_params``, such as ``min_score`` (nats).

    Returns
    -------
    MergeResult
        The merged map, and the pose and verdict of each map.
    """
    grids = [m if isinstance(m, Grid) else Grid.read(m) for m in maps]
    if scale is not None:
        if len(scale) != len(grids):
            raise BadArgumentError(f"scale has {len(scale)} values, expected {len(grids)}")
        for side in scale:
            check_number("scale", side, 0, MOST_METRES, above=True)
        grids = [_scaled(grid, side) for grid, side in zip(grids, scale)]
    check_number("coarsen", coarsen, 0, MOST_COARSENED)
    if start is not None and len(start) != len(grids):
        raise BadArgumentError(f"start has {len(start)} poses, expected {len(grids)}")
    if perception not in PERCEPTIONS:
        raise BadArgumentError(f"perception is {perception!r}, expected 'evidence' or 'images'")
    most = lib.CAIRN_CAPACITY_MAX_MAPS
    if not 1 <= len(grids) <= most:
        raise BadArgumentError(f"there are {len(grids)} maps, expected 1 to {most}")
    if not 0 <= reference < len(grids):
        raise BadArgumentError(f"reference is {reference}, expected 0 to {len(grids) - 1}")
    if as_written and (start is not None or coarsen):
        raise BadArgumentError("start or coarsen as written: the thesis has no such thing")
    default = lib.cairn_map_merge_as_written() if as_written else lib.cairn_map_merge_default()
    if perception == "images" and not as_written:
        params = {"perception": lib.CAIRN_MAP_MERGE_IMAGES, **params}
    values = {"particles": particles or (default.particles if as_written else 100), "seed": seed}
    job = _Job(grids, reference, order, start, as_written, {**values, **params})
    if as_written:
        coarsen = 1
    side = max(max(grid.shape) for grid in grids)
    k = coarsen or lib.cairn_map_merge_next_coarsening(0, side)
    job.once(k)
    if not coarsen:
        while not job.is_confident() and (k := lib.cairn_map_merge_next_coarsening(k, side)) > 0:
            job.once(k)
    return MergeResult(job.draw(), [_placed(p) for p in job.placed], job.downsampling)


def _scaled(grid: Grid, side: float) -> Grid:
    """Returns a map with cells of another side, m; its thresholds and pixels stay."""
    scaled = grid.copy()
    scaled._file.resolution = side
    return scaled


class _Job:
    """The maps of a merging, and its passes with coarser and coarser cells."""

    def __init__(
        self,
        grids: list[Grid],
        reference: int,
        order: Sequence[int] | None,
        start: Sequence[ArrayLike | None] | None,
        as_written: bool,
        values: dict[str, Any],
    ) -> None:
        self.grids, self.reference, self.order, self.start = grids, reference, order, start
        self.as_written, self.values = as_written, values
        self.fine = [classes(grid) for grid in grids]
        self.placed: list[Any] = []
        self.result: Any = None
        self.downsampling = 0

    def once(self, k: int) -> None:
        """Merges with k by k cells downsampled to one, and keeps the better result."""
        cells = [coarse(fine, k) for fine in self.fine]
        sizes = [c.size for c in cells]
        start = lib.cairn_capacity_map_merge(len(cells), sum(sizes), max(sizes), self.as_written)
        merge_, _pool = create("map_merge", new_params("map_merge", self.values, start))
        for grid, c in zip(self.grids, cells):
            fault = new_fault()
            map_ = ffi.new("cairn_map_merge_map *")
            _set_map(map_, grid, c, k)
            check(lib.cairn_map_merge_add(merge_, map_, fault), "map", fault=fault)
        for i, guess in enumerate(self.start or ()):
            if guess is not None and i != self.reference:
                check(lib.cairn_map_merge_guess(merge_, i, pose_in(guess, "start")), "start")
        order = ffi.NULL if self.order is None else ffi.new("int32_t[]", list(self.order))
        if self.order is not None and len(self.order) != len(cells):
            raise BadArgumentError(f"order has {len(self.order)} maps, expected {len(cells)}")
        check(lib.cairn_map_merge_begin(merge_, self.reference, order), "order")
        run(lambda budget: lib.cairn_map_merge_step(merge_, budget), "merge")
        result = lib.cairn_map_merge_read(merge_)
        if self.is_better(result):
            self.result, self.downsampling = result, k
            self.placed = [lib.cairn_map_merge_of(merge_, i) for i in range(len(cells))]

    def is_better(self, result: Any) -> bool:
        """Returns whether a result places more maps, or as many with more support."""
        if self.result is None:
            return True
        results = [ffi.new("cairn_map_merge_result *", r) for r in (result, self.result)]
        return bool(lib.cairn_map_merge_is_better(*results))

    def is_confident(self) -> bool:
        """Returns whether every map is placed with a small error probability."""
        return all(
            lib.cairn_map_merge_is_sure(ffi.new("cairn_map_merge_placed *", p)) for p in self.placed
        )

    def draw(self) -> Grid:
        """Returns all placed maps in the cells of the reference; ties are occupied."""
        resolution = self.grids[self.reference].resolution
        maps = ffi.new("cairn_map_merge_map[]", len(self.grids))
        for map_, grid, fine in zip(maps, self.grids, self.fine):
            _set_map(map_, grid, fine)
        placed = ffi.new("cairn_map_merge_placed[]", self.placed)
        file, error = ffi.new("cairn_map_file *"), ffi.new("cairn_file_error *")
        make = lib.cairn_merged_map_make
        check_file(make(maps, placed, len(maps), resolution, file, error), error)
        return Grid._of(file)


def classes(grid: Grid) -> UInt8:
    """Returns the cells of a map as occupied, free or unknown."""
    out = np.empty(grid.shape, np.uint8)
    lib.cairn_merged_map_classify(grid._file, pointer(out, "uint8_t *"))
    return out


def coarse(fine: UInt8, k: int) -> UInt8:
    """Returns a grid downsampled by k; occupied cells win over free ones."""
    height, width = fine.shape
    out = np.empty(((height - 1) // k + 1, (width - 1) // k + 1), np.uint8)
    target = ffi.new("cairn_raster_u8 *")
    target.data, target.width = pointer(out, "uint8_t *"), out.shape[1]
    target.height, target.stride = out.shape[0], out.shape[1]
    check(lib.cairn_map_merge_coarsen(_view(fine), k, target[0]), "coarsen")
    return out


def _view(cells: UInt8) -> Any:
    height, width = cells.shape
    return (pointer(cells, "const uint8_t *"), width, height, width)


def _set_map(map_: Any, grid: Grid, cells: UInt8, k: int = 1) -> None:
    """Sets a ``cairn_map_merge_map`` to the cells of a grid, k by k downsampled to one."""
    map_.cells = _view(cells)
    map_.resolution, map_.origin = grid.resolution * k, tuple(grid.origin)


def _placed(p: Any) -> PlacedMap:
    placed = p.verdict == lib.CAIRN_MAP_MERGE_PLACED
    words = text(lib.cairn_map_merge_verdict_text(p.verdict))
    return PlacedMap(
        pose_of(p.reference_map),
        placed,
        words,
        p.support,
        p.competing_support,
        p.error_probability,
        int(p.rank),
    )
