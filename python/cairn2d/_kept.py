"""Scans that were placed: their data in memory of C, results that hold them, their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._base import (
    EmptyError,
    Float64,
    Int64,
    NoMemoryError,
    PathLike,
    Result,
    check_file,
    path_of,
    text,
    view,
)
from ._cairn import ffi, lib
from .grids import Grid


def struct_type(name: str, fields: dict[str, tuple[str, tuple[int, ...]]]) -> np.dtype[Any]:
    """Returns some fields of a C struct as a type of numpy."""
    return np.dtype(
        {
            "names": list(fields),
            "formats": [np.dtype((kind, shape)) for kind, shape in fields.values()],
            "offsets": [ffi.offsetof(name, field) for field in fields],
            "itemsize": ffi.sizeof(name),
        }
    )


PLACED = struct_type(
    "cairn_placed_scan",
    {
        "line": ("i8", ()),
        "stamp_ns": ("i8", ()),
        "before": ("f8", (3,)),
        "after": ("f8", (3,)),
        "covariance": ("f8", (3, 3)),
        "support": ("f8", ()),
        "low_confidence": ("u1", ()),
    },
)
PLACE = struct_type("cairn_scan_place", {"keyframe_scan": ("f8", (3,)), "keyframe": ("i4", ())})


class Kept:
    """The scans of a map with their results, in memory of the C library."""

    def __init__(self, capacity: int = 256) -> None:
        self.count = 0
        self.capacity = capacity
        self.scans = self._new(capacity)
        self.places = ffi.new("cairn_scan_place[]", capacity)

    @staticmethod
    def _new(capacity: int) -> Any:
        scans = lib.cairn_placed_scans_new(capacity)
        if scans == ffi.NULL:
            raise NoMemoryError(f"no memory for {capacity} scans")
        return scans

    def __del__(self) -> None:
        if hasattr(self, "scans"):
            lib.cairn_placed_scans_free(self.scans, self.capacity)

    def reserve(self) -> None:
        """Makes space for one more scan."""
        if self.count < self.capacity:
            return
        capacity = 2 * self.capacity
        scans, places = self._new(capacity), ffi.new("cairn_scan_place[]", capacity)
        ffi.memmove(scans, self.scans, self.count * ffi.sizeof("cairn_placed_scan"))
        ffi.memmove(places, self.places, self.count * ffi.sizeof("cairn_scan_place"))
        # The arrays of the scans have moved on; only the structs are freed.
        lib.free(self.scans)
        self.scans, self.places, self.capacity = scans, places, capacity

    def keep(self, sensor_data: Any) -> Any:
        """Keeps the data of one more scan, a ``cairn_scan_view *``; returns its struct."""
        self.reserve()
        scan = self.scans + self.count
        if not lib.cairn_placed_scan_copy(scan, sensor_data):
            raise NoMemoryError("no memory for a scan")
        self.count += 1
        return scan

    @property
    def table(self) -> NDArray[Any]:
        """The scans as a structured array, without a copy."""
        if self.count == 0:
            return np.empty(0, PLACED)
        raw = view(self.scans, (self.count * PLACED.itemsize,), "|u1", self)
        return raw.view(PLACED)

    def verdicts(self) -> list[str]:
        """Returns the verdict of each scan."""
        return [text(self.scans[i].verdict) for i in range(self.count)]

    def grid(self, resolution: float, range_: float, clear: float) -> Grid:
        """Returns the map of all beams at the poses ``after``."""
        if self.count == 0:
            raise EmptyError("no scan, expected at least one")
        scans = ffi.new("cairn_scan_map *")
        scans.scan, scans.count = self.scans, self.count
        scans.resolution, scans.range, scans.clear = resolution, range_, clear
        file, error = ffi.new("cairn_map_file *"), ffi.new("cairn_file_error *")
        check_file(lib.cairn_scan_map_make(scans, file, error), error)
        return Grid._of(file)


class PlacedResult(Result):
    """Scans at their poses, with the map that their beams make."""

    trajectory: Float64
    covariance: Float64
    support: Float64
    verdicts: list[str]
    stamps_ns: Int64
    lines: Int64
    _kept: Kept
    _settings: tuple[float, float, float]
    _grid: Grid | None

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

    def _repr_png_(self) -> bytes:
        return self.grid._repr_png_()


def write_poses(path: Path, result: PlacedResult) -> None:
    """Writes the table of poses of a result as ``cairn map`` and ``cairn align`` do."""
    count = len(result.trajectory)
    rows = ffi.new("cairn_pose_table_row[]", max(count, 1))
    for i in range(count):
        rows[i] = lib.cairn_pose_table_row_of(i, tuple(result.trajectory[i].tolist()))
        rows[i].line, rows[i].stamp_ns = int(result.lines[i]), int(result.stamps_ns[i])
        rows[i].covariance = result.covariance[i].ravel().tolist()
        rows[i].support = float(result.support[i])
        rows[i].verdict = result.verdicts[i].encode()
    error = ffi.new("cairn_file_error *")
    check_file(lib.cairn_pose_table_write(path_of(path), rows, count, error), error, str(path))
