"""Occupancy grids and map files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._base import (
    BadArgumentError,
    Bool,
    Float64,
    PathLike,
    Pose,
    UInt8,
    array,
    check,
    check_file,
    check_number,
    create,
    new_fault,
    new_params,
    path_of,
    pointer,
    pose_in,
    pose_of,
    run,
    view,
)
from ._cairn import ffi, lib
from .logs import Scan

# Pixels of a map's image, and the greatest and least value of its cells.
OCCUPIED, UNKNOWN, FREE = 0, 205, 254
OCCUPIED_CELL, UNKNOWN_CELL = 100, -1
# Numbers of a map file beside its origin.
NUMBERS = ("resolution", "negate", "occupied_threshold", "free_threshold", "mode")
# m: greatest side of a cell.
MOST_METRES = 1e5
MODES = ("trinary", "scale", "raw")


class Grid:
    """A map of occupied, free and unknown cells, as map_server of ROS reads it.

    Parameters
    ----------
    occupancy
        Shape (height, width), the lowest row first: -1 unknown, 0 free to 100 occupied.
    resolution
        Side of a cell, m.
    origin
        Pose (x, y, theta) of the lower left corner, m and rad.
    """

    def __init__(
        self, occupancy: ArrayLike, resolution: float = 0.05, origin: ArrayLike = (0, 0, 0)
    ) -> None:
        cells = array(occupancy, np.int8, (None, None), "occupancy")
        if cells.size and not (cells.min() >= UNKNOWN_CELL and cells.max() <= OCCUPIED_CELL):
            raise BadArgumentError(
                f"occupancy has values from {cells.min()} to {cells.max()}, "
                f"expected {UNKNOWN_CELL} to {OCCUPIED_CELL}"
            )
        file = self._new()
        check(lib.cairn_map_file_allocate(file, cells.shape[1], cells.shape[0]), "grid")
        self._own(file)
        check_number("resolution", resolution, 0, MOST_METRES, above=True)
        pose = pose_in(origin, "origin")
        if not np.all(np.isfinite(pose)):
            raise BadArgumentError(f"origin is {pose}, expected finite numbers")
        file.resolution, file.origin = resolution, pose
        self.occupancy[:] = cells
        check(lib.cairn_map_file_draw(file), "grid")

    @staticmethod
    def _new() -> Any:
        file = ffi.new("cairn_map_file *")
        file[0] = lib.cairn_map_file_default()
        return file

    def _own(self, file: Any) -> None:
        """Takes a map file, which is freed with its last array."""
        self._file = ffi.gc(file, lib.cairn_map_file_free)
        shape = (int(file.height), int(file.width))
        self.occupancy: NDArray[np.int8] = view(file.occupancy, shape, "|i1", self._file)
        self.pixels: UInt8 = view(file.pixel, shape, "|u1", self._file)

    @classmethod
    def _of(cls, file: Any) -> Grid:
        grid = cls.__new__(cls)
        grid._own(file)
        return grid

    @classmethod
    def read(cls, path: PathLike) -> Grid:
        """Reads a map: YAML with PGM or PNG.

        Parameters
        ----------
        path
            The YAML file.

        Returns
        -------
        Grid
            The map.

        Raises
        ------
        CairnError
            The map cannot be read; its ``file`` and ``line`` say where.
        """
        file, error = ffi.new("cairn_map_file *"), ffi.new("cairn_file_error *")
        check_file(lib.cairn_map_file_read(file, path_of(path), error), error, os.fspath(path))
        return cls._of(file)

    def copy(self) -> Grid:
        """Returns a map with memory of its own."""
        return Grid._restore(*self._state())

    def _state(self) -> tuple[dict[str, Any], NDArray[np.int8], UInt8]:
        """Returns the numbers of the map file, and its cells and pixels."""
        numbers = {name: getattr(self._file, name) for name in NUMBERS}
        return {**numbers, "origin": tuple(self.origin)}, self.occupancy, self.pixels

    @staticmethod
    def _restore(numbers: dict[str, Any], occupancy: NDArray[np.int8], pixels: UInt8) -> Grid:
        """Returns the map of a state."""
        file, (height, width) = Grid._new(), occupancy.shape
        check(lib.cairn_map_file_allocate(file, width, height), "grid")
        grid = Grid._of(file)
        for name, value in numbers.items():
            setattr(file, name, value)
        grid.occupancy[:], grid.pixels[:] = occupancy, pixels
        return grid

    def __reduce__(self) -> tuple[Any, ...]:
        return Grid._restore, self._state()

    def save(self, path: PathLike) -> None:
        """Writes the map: a YAML file and beside it a PGM image of the same name.

        With the ending ``.png`` the image is a PNG.

        Parameters
        ----------
        path
            The YAML file, or a PNG beside which the YAML file is written.
        """
        target, kind = Path(path), lib.CAIRN_MAP_FILE_PGM
        if target.suffix == ".png":
            target, kind = target.with_suffix(".yaml"), lib.CAIRN_MAP_FILE_PNG
        error = ffi.new("cairn_file_error *")
        status = lib.cairn_map_file_write(self._file, path_of(target), kind, error)
        check_file(status, error, os.fspath(path))

    @property
    def resolution(self) -> float:
        """Side of a cell, m."""
        return float(self._file.resolution)

    @property
    def origin(self) -> Pose:
        """Pose of the lower left corner of cell (0, 0), m and rad."""
        return pose_of(self._file.origin)

    @property
    def mode(self) -> str:
        """How pixels are interpreted: ``"trinary"``, ``"scale"`` or ``"raw"``."""
        return MODES[self._file.mode]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return int(self._file.height), int(self._file.width)

    @property
    def occupied(self) -> Bool:
        """Cells that are occupied by the thresholds of the map, shape (height, width)."""
        occupied: Bool = self.occupancy >= 100 * self._file.occupied_threshold
        return occupied

    @property
    def free(self) -> Bool:
        """Cells that are free by the thresholds of the map, shape (height, width)."""
        limit = 100 * self._file.free_threshold
        free: Bool = (self.occupancy >= 0) & (self.occupancy <= limit)
        return free

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top in m, as ``imshow`` of matplotlib takes them."""
        (x, y, _), (height, width) = self.origin, self.shape
        return x, x + width * self.resolution, y, y + height * self.resolution

    def to_dict(self) -> dict[str, Any]:
        """Returns resolution, origin and occupancy as plain values."""
        return {
            "resolution": self.resolution,
            "origin": list(self.origin),
            "occupancy": self.occupancy.tolist(),
        }

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the map into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        options = {"cmap": "gray", "vmin": 0, "vmax": 255, "interpolation": "nearest", **style}
        ax.imshow(self.pixels, extent=self.extent, origin="lower", **options)
        return ax

    def _repr_png_(self) -> bytes:
        from ._draw import png

        return png(self.pixels[::-1])

    def __repr__(self) -> str:
        height, width = self.shape
        return f"Grid({width} x {height} cells of {self.resolution:.9g} m)"


class OccupancyGrid:
    """An occupancy grid that counts hits and lengths of beams (beam penetration).

    Parameters
    ----------
    width, height
        Cells.
    resolution
        Side of a cell, m.
    origin
        Lower left corner (x, y) of cell (0, 0), m.
    """

    def __init__(
        self,
        width: int = 400,
        height: int = 400,
        resolution: float = 0.05,
        origin: ArrayLike = (-10.0, -10.0),
    ) -> None:
        x, y = array(origin, np.float64, (2,), "origin")
        values = {"width": width, "height": height, "resolution": resolution, "origin": (x, y)}
        self._params = new_params("occupancy_grid", values)
        self._grid, self._pool = create("occupancy_grid", self._params)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return int(self._params.height), int(self._params.width)

    def add_beam(self, start: ArrayLike, end: ArrayLike, hit: bool) -> None:
        """Adds a beam.

        Parameters
        ----------
        start, end
            Both ends (x, y) in the frame of the grid, m.
        hit
            Whether the beam ends on a surface.
        """
        a = array(start, np.float64, (2,), "start")
        b = array(end, np.float64, (2,), "end")
        check(lib.cairn_occupancy_grid_add_beam(self._grid, tuple(a), tuple(b), int(hit)), "beam")

    def add(self, scan: Scan, pose: ArrayLike) -> None:
        """Adds a scan.

        Parameters
        ----------
        scan
            The scan.
        pose
            Pose (x, y, theta) of the robot in the map, m and rad.
        """
        from .matching import Fit

        fitted = Fit(scan)
        fault = new_fault()
        beams, count = fitted.view.beams, fitted.view.beam_count
        status = lib.cairn_occupancy_grid_begin_scan(self._grid, beams, count, pose_in(pose), fault)
        check(status, "scan", fault=fault)
        run(lambda budget: lib.cairn_occupancy_grid_step(self._grid, budget))

    @property
    def probability(self) -> Float64:
        """Probability that a beam stops in a cell, shape (height, width); -1: not observed."""
        height, width = self.shape
        probability = lib.cairn_occupancy_grid_probability
        return np.array(
            [[probability(self._grid, x, y) for x in range(width)] for y in range(height)]
        )

    def grid(self, occupied: float = 0.25, free: float = 0.1) -> Grid:
        """Returns the map of occupied, free and unknown cells.

        Parameters
        ----------
        occupied, free
            Cells whose probability is at or above `occupied` are occupied, at or below `free` free,
            and the others unknown.

        Returns
        -------
        Grid
            The map.
        """
        height, width = self.shape
        classes = np.empty((height, width), np.uint8)
        out = ffi.new("cairn_raster_u8 *")
        out.data, out.width, out.height = pointer(classes, "uint8_t *"), width, height
        out.stride = width
        check(lib.cairn_occupancy_grid_classify(self._grid, (occupied, free), 0, out[0]), "grid")
        cells = np.select([classes == OCCUPIED, classes == FREE], [100, 0], -1)
        params = self._params
        return Grid(cells, params.resolution, (params.origin.x, params.origin.y, 0))
