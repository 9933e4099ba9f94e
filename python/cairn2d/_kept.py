"""Scans that were placed: their data in memory of C, results that hold them, their files."""

from __future__ import annotations

import os
from collections.abc import Sequence
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
    check_number,
    path_of,
    text,
    view,
)
from ._cairn import ffi, lib
from .graphs import PoseGraph
from .grids import MOST_METRES, Grid


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
        "map_sigma": ("f8", ()),
        "low_confidence": ("u1", ()),
    },
)
PLACE = struct_type("cairn_scan_place", {"keyframe_scan": ("f8", (3,)), "keyframe": ("i4", ())})


# m: greatest range of beams, in place of infinity.
FARTHEST = float(np.finfo(np.float64).max)


def check_map_settings(resolution: float, range_: float, clear: float = 0.0) -> None:
    """Raises a `BadArgumentError` for settings, m, that give no map."""
    check_number("resolution", resolution, 0, MOST_METRES, above=True)
    check_number("range", range_, 0, above=True)
    check_number("clear", clear, 0)


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
        check_map_settings(resolution, range_, clear)
        if self.count == 0:
            raise EmptyError("no scan, expected at least one")
        scans = ffi.new("cairn_placed_scan_map *")
        scans.scan, scans.count, scans.resolution = self.scans, self.count, resolution
        scans.beams = lib.cairn_scan_map_default()
        scans.beams.max_range = min(range_, FARTHEST)
        scans.beams.max_free_range = min(clear, FARTHEST)
        file, error = ffi.new("cairn_map_file *"), ffi.new("cairn_file_error *")
        check_file(lib.cairn_placed_scan_map_make(scans, file, error), error)
        return Grid._of(file)


# What the command and this package write of a map into a folder.
MAP_FILES = (
    "poses.csv",
    "poses.tum",
    "graph.g2o",
    "map.pgm",
    "map.yaml",
    "map.svg",
    "errors.svg",
    "stages.svg",
    "transforms.yaml",
    "transforms.csv",
    "places.csv",
)


class OutputSet:
    """Files of a folder that are replaced together, or not at all.

    Parameters
    ----------
    folder
        It is made when it is missing.
    names
        The files.
    others
        Files that are removed when they are not among the names.
    """

    def __init__(self, folder: PathLike, names: Sequence[str], others: Sequence[str]) -> None:
        self.folder, self.names = os.fspath(folder), list(names)
        self.others = [name for name in others if name not in self.names]

    def __enter__(self) -> dict[str, Path]:
        """Returns for every name the path to write the file to."""
        error = ffi.new("cairn_file_error *")
        texts = [ffi.new("char[]", name.encode()) for name in self.names]
        made, folder = ffi.new("cairn_output_set **"), path_of(self.folder)
        status = lib.cairn_output_set_open(made, folder, texts, len(texts), error)
        check_file(status, error, self.folder)
        self._set = made[0]
        for name in self.others:
            if lib.cairn_output_set_remove(self._set, name.encode(), error) < 0:
                lib.cairn_output_set_discard(self._set)
                raise NoMemoryError(f"{self.folder}: no memory for its files")
        path = lib.cairn_output_set_path
        return {
            name: Path(os.fsdecode(ffi.string(path(self._set, i))))
            for i, name in enumerate(self.names)
        }

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            lib.cairn_output_set_discard(self._set)
            return
        error = ffi.new("cairn_file_error *")
        check_file(lib.cairn_output_set_commit(self._set, error), error, self.folder)


class PlacedResult(Result):
    """Scans at their poses, with the map that their beams make."""

    trajectory: Float64
    covariance: Float64
    support: Float64
    verdicts: list[str]
    map_sigma: Float64
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
        """Writes poses.csv, map.yaml and map.pgm: all of them, or none.

        Files that the command or another result has left there, such as a pose graph, are removed.

        Parameters
        ----------
        folder
            It is made when it is missing.
        """
        self._save(folder)

    def _save(self, folder: PathLike, graph: PoseGraph | None = None) -> None:
        """Writes the files, and graph.g2o with a graph."""
        names = ["poses.csv", "map.pgm", "map.yaml", *(["graph.g2o"] if graph is not None else [])]
        grid = self.grid
        with OutputSet(folder, names, MAP_FILES) as path:
            write_poses(path["poses.csv"], self)
            grid.save(path["map.yaml"])
            if graph is not None:
                graph.save(path["graph.g2o"])

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
        rows[i].map_sigma = float(result.map_sigma[i])
    error = ffi.new("cairn_file_error *")
    check_file(lib.cairn_pose_table_write(path_of(path), rows, count, error), error, str(path))
