"""Contours, axes and objects in images."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._base import (
    BadArgumentError,
    Bool,
    Float64,
    Int32,
    NoMemoryError,
    PathLike,
    Pose,
    Result,
    UInt8,
    array,
    check,
    check_file,
    copy_of,
    create,
    frame,
    new_fault,
    new_params,
    path_of,
    pointer,
    run,
    set_fields,
    view,
)
from ._cairn import ffi, lib

# Bytes in a name of an input in messages, when it is an array.
ARRAY_NAME = b"image"
MAX_SIDE = 8192
# Pixels per region that the over-segmentation of a photograph needs at most.
PIXELS_PER_REGION = 32
HOLES = ("keep", "fill", "refuse")
SYMMETRY_VERDICTS = ("single", "multiple", "circular")
# Least strength of a contour between regions that is reported.
MIN_BOUNDARY_STRENGTH = 2.0

Image = Union[ArrayLike, PathLike]


def read_image(path: PathLike) -> UInt8:
    """Reads an image as 8-bit grey levels, shape (height, width).

    PBM, PGM and PPM are always read; PNG, JPEG and TIFF where cairn is built with their libraries.
    """
    image, error = ffi.new("cairn_vision_image *"), ffi.new("cairn_file_error *")
    check_file(lib.cairn_vision_read_grey(image, path_of(path), error), error, os.fspath(path))
    owned = ffi.gc(image, lib.cairn_vision_free)
    samples = ffi.cast("uint8_t *", image.samples)
    return view(samples, (int(image.height), int(image.width)), "|u1", owned)


def grey_of(image: Image, name: str = "image") -> UInt8:
    """Returns an image as grey levels: an array, or the path of a file."""
    if isinstance(image, (str, os.PathLike)):
        return read_image(image)
    values = np.asarray(image)
    if values.dtype == bool:
        values = np.where(values, 0, 255)
    if values.ndim == 3 and values.shape[2] in (3, 4):
        # Luma of red, green and blue (BT.601).
        values = np.rint(values[..., :3] @ np.array([0.299, 0.587, 0.114]))
    return array(values, np.uint8, (None, None), name)


def _raster(pixels: UInt8) -> Any:
    """Returns an image as C takes it; the array must be kept."""
    height, width = pixels.shape
    return (pointer(pixels, "const uint8_t *"), width, height, width)


def _reals(values: Any, count: int, columns: int) -> Float64:
    """Returns a copy of `count` structs of `columns` numbers."""
    return copy_of(values, (int(count), columns), "<f8")


# ---- Edges ----


def edgels(image: Image, **params: Any) -> Float64:
    """Finds sub-pixel edge points.

    Parameters
    ----------
    image
        Grey levels, shape (height, width), or a file.
    **params
        Fields of ``cairn_edgel_params``: ``sigma`` (px), ``min_gradient`` (grey levels per px).

    Returns
    -------
    ndarray
        Shape (n, 5): x, y in px, the unit normal towards the brighter side, and the gradient's
        magnitude in grey levels per px.
    """
    set_, count, _pool = _edgels(grey_of(image), params)
    return _reals(lib.cairn_edgel_list(set_, ffi.NULL), count, 5)


def _edgels(grey: UInt8, params: dict[str, Any]) -> tuple[Any, int, Any]:
    height, width = grey.shape
    # An edgel for each row and column of a pixel at most.
    sizes = {"max_width": width, "max_height": height, "max_edgels": 2 * width * height}
    set_, pool = create("edgel", new_params("edgel", {**sizes, **params}), "edgel_set")
    check(lib.cairn_edgel_begin(set_, _raster(grey)), "image")
    run(lambda budget: lib.cairn_edgel_step(set_, budget), "image")
    count = ffi.new("int32_t *")
    lib.cairn_edgel_list(set_, count)
    return set_, int(count[0]), pool


def edges(image: Image, **params: Any) -> UInt8:
    """Returns an edge map of an image: the pixels of its `edgels`.

    It serves `detect` and `contours` where no other edge detector is at hand; those of OpenCV or
    scikit-image may be used instead.

    Parameters
    ----------
    image
        Grey levels, shape (height, width), or a file.
    **params
        As of `edgels`.

    Returns
    -------
    ndarray
        Shape (height, width), uint8: twice the gradient's magnitude, 1 to 255; 0: no edge.
    """
    grey = grey_of(image)
    points = edgels(grey, **params)
    column, row = np.rint(points[:, :2]).astype(int).T
    height, width = grey.shape
    out = np.zeros(grey.shape, np.uint8)
    strength = np.clip(np.rint(2 * points[:, 4]), 1, 255).astype(np.uint8)
    at = (np.clip(row, 0, height - 1), np.clip(column, 0, width - 1))
    np.maximum.at(out, at, strength)
    return out


@dataclass(frozen=True)
class Polyline(Result):
    """Line segments that were fitted to points.

    Attributes
    ----------
    segments : ndarray
        Shape (n, 2, dim): both ends of each segment.
    labels : ndarray
        Shape (points,): segment of each point; -1: none.
    """

    segments: Float64
    labels: Int32

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the segments into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        for segment in self.segments:
            ax.plot(*segment.T[:2], **style)
        return ax


def polyline(points: ArrayLike, **params: Any) -> Polyline:
    """Fits line segments to points by expectation maximization; their number is unknown.

    Parameters
    ----------
    points
        Shape (n, 2) or (n, 3), m, in any order.
    **params
        Fields of ``cairn_polyline_params``, such as ``sigma`` (m).
    """
    values = np.ascontiguousarray(points, np.float64)
    if values.ndim != 2 or values.shape[1] not in (2, 3):
        raise BadArgumentError(f"points has the shape {values.shape}, expected (n, 2) or (n, 3)")
    count, dim = values.shape
    sizes = {"dim": dim, "max_points": max(count, 1), "max_segments": max(count, 1)}
    fit, _pool = create("polyline", new_params("polyline", {**sizes, **params}))
    fault = new_fault()
    status = lib.cairn_polyline_begin(fit, pointer(values, "const double *"), count, fault)
    check(status, "points", fault=fault)
    run(lambda budget: lib.cairn_polyline_step(fit, budget), "polyline")
    out = lib.cairn_polyline_read(fit)
    segments = [(list(s.a)[:dim], list(s.b)[:dim]) for s in out.segments[0 : out.segment_count]]
    labels = copy_of(out.label, (int(out.point_count),), "<i4")
    return Polyline(np.array(segments, np.float64).reshape(-1, 2, dim), labels)


# ---- Models ----


class ShapeModel:
    """The model of a shape: its outlines, and the discs along the axes of its parts."""

    def __init__(self, file: Any) -> None:
        self._file = ffi.gc(file, lib.cairn_shape_model_file_free)

    @classmethod
    def read(cls, path: PathLike) -> ShapeModel:
        """Reads a model, or builds one from a picture of the object."""
        file, error = ffi.new("cairn_shape_model_file *"), ffi.new("cairn_file_error *")
        image = ffi.new("cairn_shape_image_params *", lib.cairn_shape_image_default())
        builder = ffi.new(
            "cairn_shape_model_builder_params *", lib.cairn_shape_model_builder_default()
        )
        status = lib.cairn_shape_model_file_load(
            file, path_of(path), image, builder, ffi.NULL, error
        )
        check_file(status, error, os.fspath(path))
        return cls(file)

    def save(self, path: PathLike) -> None:
        """Writes the model. Numbers read back bit for bit."""
        error = ffi.new("cairn_file_error *")
        model = ffi.addressof(self._file, "model")
        status = lib.cairn_shape_model_file_write(model, path_of(path), error)
        check_file(status, error, os.fspath(path))

    def mirrored(self) -> ShapeModel:
        """Returns the mirror image of the model."""
        file = ffi.new("cairn_shape_model_file *")
        model = ffi.addressof(self._file, "model")
        check(lib.cairn_shape_model_file_copy(file, model), "model")
        lib.cairn_shape_model_file_mirror(file)
        return ShapeModel(file)

    @property
    def _model(self) -> Any:
        return ffi.addressof(self._file, "model")

    @property
    def size(self) -> float:
        """Size of the object in the units of the picture: the diagonal of its box."""
        return float(self._file.model.size)

    @property
    def outline(self) -> Float64:
        """Even samples of the outlines, shape (n, 4): x, y in sizes, and the unit tangent."""
        model = self._file.model
        return view(model.outline, (int(model.outline_count), 4), "<f8", self._file)

    @property
    def discs(self) -> Float64:
        """Discs along the axes, shape (n, 3): centre x, y and radius, in sizes."""
        model = self._file.model
        samples = model.samples[0 : model.sample_count]
        return np.array([(s.centre.x, s.centre.y, s.radius) for s in samples]).reshape(-1, 3)

    def to_dict(self) -> dict[str, Any]:
        """Returns size, outline and discs as plain values."""
        return {
            "size": self.size,
            "outline": self.outline.tolist(),
            "discs": self.discs.tolist(),
        }

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws outline and axes into axes of matplotlib, y down, and returns the axes."""
        ax = _image_axes(ax)
        ax.plot(*self.outline.T[:2], ".", **{"markersize": 2, "color": "k", **style})
        ax.scatter(*self.discs.T[:2], s=4, color="tab:red")
        return ax

    def __repr__(self) -> str:
        model = self._file.model
        return f"ShapeModel({model.path_count} paths, {model.outline_count} outline samples)"


def _image_axes(ax: Any) -> Any:
    """Returns axes with y down."""
    from ._draw import axes_of

    ax = axes_of(ax)
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    return ax


def _trace(image: Image, holes: str, max_gap: float, min_part: float) -> tuple[Any, Any]:
    """Traces the outlines of the object in a picture."""
    if holes not in HOLES:
        raise BadArgumentError(f"holes is {holes!r}, expected one of {', '.join(HOLES)}")
    grey, traced = grey_of(image), ffi.new("cairn_shape_image *")
    params, error = ffi.new("cairn_shape_image_params *"), ffi.new("cairn_file_error *")
    params.holes, params.max_gap, params.min_part = HOLES.index(holes), max_gap, min_part
    status = lib.cairn_shape_image_trace(traced, _raster(grey), params, ARRAY_NAME, error)
    check_file(status, error)
    return traced, ffi.gc(traced, lib.cairn_shape_image_free)


def model(
    image: Image,
    *,
    holes: str = "keep",
    max_gap: float = 0.1,
    min_part: float = 0.01,
    **params: Any,
) -> ShapeModel:
    """Builds the model of a shape from a silhouette or a drawing.

    Parameters
    ----------
    image
        Dark object on light ground or the other way round, shape (height, width); a mask (bool,
        True: the object); or the path of a picture or a model.
    holes
        ``"keep"``, ``"fill"`` or ``"refuse"``.
    max_gap
        Largest gap of a drawing that is closed, share of its diagonal.
    min_part
        Smallest part that is kept, share of the largest one's area.
    **params
        Fields of ``cairn_shape_model_builder_params``, such as ``max_paths``.
    """
    if isinstance(image, (str, os.PathLike)) and lib.cairn_shape_model_file_is(path_of(image)):
        return ShapeModel.read(image)
    traced, owned = _trace(image, holes, max_gap, min_part)
    builder = ffi.new("cairn_shape_model_builder_params *")
    builder[0] = lib.cairn_shape_model_builder_default()
    set_fields(builder, params)
    file, error = ffi.new("cairn_shape_model_file *"), ffi.new("cairn_file_error *")
    status = lib.cairn_shape_model_file_build(
        file, traced.outlines, traced.count, builder, ARRAY_NAME, error
    )
    check_file(status, error)
    del owned
    return ShapeModel(file)


def outlines(
    image: Image, *, holes: str = "keep", max_gap: float = 0.1, min_part: float = 0.01
) -> list[Float64]:
    """Traces the outlines of an object in a silhouette or a drawing; parameters as of `model`.

    Returns
    -------
    list of ndarray
        Shape (n, 2) each, px; components by descending area, then holes.
    """
    traced, _owned = _trace(image, holes, max_gap, min_part)
    return [_reals(c.points, c.count, 2) for c in traced.outlines[0 : traced.count]]


# ---- Symmetry ----


@dataclass(frozen=True)
class Axis(Result):
    """An axis that divides a shape into two similar arcs.

    Attributes
    ----------
    ends : ndarray
        Shape (2, 2): both ends on the outline, px.
    dissimilarity : float
        Ranking score, relative to the greatest inner distance; 0: equal arcs.
    bend : float
        Change of the axis direction from end to end, rad.
    skew : float
        Tangent of the angle between the ribs and the normal of the axis.
    mirror : ndarray
        Shape (2, 2): a point of the best mirror line, px, and its unit direction.
    """

    ends: Float64
    dissimilarity: float
    bend: float
    skew: float
    mirror: Float64


@dataclass(frozen=True)
class SymmetryResult(Result):
    """Axes of a shape.

    Attributes
    ----------
    axes : list of Axis
        The best first.
    verdict : str
        ``"single"``, ``"multiple"`` (the first `ties` are as good) or ``"circular"``.
    ties : int
        Axes that tie with the best, itself included.
    rotation_order : int
        A turn by 1/n maps the shape to itself; 1: none, 0: any angle.
    outline : ndarray
        Even samples of the outline, shape (n, 2), px.
    """

    axes: list[Axis]
    verdict: str
    ties: int
    rotation_order: int
    outline: Float64

    def to_pandas(self) -> Any:
        """Returns a data frame of the axes: dissimilarity, bend, skew."""
        names = ("dissimilarity", "bend", "skew")
        return frame({name: [getattr(axis, name) for axis in self.axes] for name in names})

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws outline and tied axes into axes of matplotlib, y down, and returns the axes."""
        ax = _image_axes(ax)
        ax.plot(*np.vstack((self.outline, self.outline[:1])).T, "k", linewidth=1)
        for axis in self.axes[: max(self.ties, 1)]:
            ax.plot(*axis.ends.T, **{"color": "tab:red", **style})
        return ax


def symmetry(
    image: Image,
    *,
    as_written: bool = False,
    holes: str = "keep",
    max_gap: float = 0.1,
    min_part: float = 0.01,
    **params: Any,
) -> SymmetryResult:
    """Finds the axes of symmetry of a shape, also of a skewed, bent or articulated one.

    Parameters
    ----------
    image
        A silhouette, a mask or a drawing, as of `model`; of several parts the largest is taken.
    as_written
        The method of the thesis.
    holes, max_gap, min_part
        As of `model`.
    **params
        Fields of ``cairn_self_similarity_params``, such as ``outline_samples``.
    """
    traced, _owned = _trace(image, holes, max_gap, min_part)
    parts = traced.count - traced.holes
    outer = traced.outlines[0]
    shape = [outer]
    for i in range(parts, traced.count):
        hole = traced.outlines[i]
        if lib.cairn_polygon_contains(outer.points, outer.count, hole.points[0]):
            shape.append(hole)
    start = (
        lib.cairn_self_similarity_as_written()
        if as_written
        else lib.cairn_self_similarity_default()
    )
    values = dict(params)
    samples = int(values.get("outline_samples", start.outline_samples))
    values.setdefault("max_vertices", min(samples, start.max_vertices))
    finder, _pool = create("self_similarity", new_params("self_similarity", values, start))
    check(
        lib.cairn_self_similarity_begin(finder, ffi.new("cairn_curve[]", shape), len(shape)),
        "no outline with an area",
    )
    run(lambda budget: lib.cairn_self_similarity_step(finder, budget), "symmetry")
    out = lib.cairn_self_similarity_read(finder)
    return SymmetryResult(
        [_axis(out.axes[i]) for i in range(out.count)],
        SYMMETRY_VERDICTS[out.verdict],
        int(out.tie_count),
        int(out.rotation_order),
        _reals(out.samples, out.sample_count, 2),
    )


def _axis(a: Any) -> Axis:
    ends = np.array([(end.x, end.y) for end in a.end])
    mirror = np.array([(v.x, v.y) for v in (a.mirror_point, a.mirror_direction)])
    return Axis(ends, a.dissimilarity, a.bend, a.skew, mirror)


# ---- Skeletons ----


@dataclass(frozen=True)
class Part(Result):
    """A symmetric part: a piece of a medial axis with the contours on both sides.

    Attributes
    ----------
    discs : ndarray
        Shape (n, 3): centre x, y and radius along the axis, px.
    contacts : ndarray
        Shape (n, 2, 2): contact points on both contours, px.
    observed : ndarray
        Shape (n, 2): False where no edge is at a contact point.
    log_odds : float
        Log odds against clutter, nats.
    object : int
        Index of the object that the part belongs to.
    """

    discs: Float64
    contacts: Float64
    observed: Bool
    log_odds: float
    object: int


@dataclass(frozen=True)
class Boundary(Result):
    """A contour between two regions.

    Attributes
    ----------
    points : ndarray
        Shape (n, 2): corners of pixels, px.
    strength : float
        Rank: contrast of both sides.
    closed : bool
        Whether the last point connects to the first.
    """

    points: Float64
    strength: float
    closed: bool


@dataclass(frozen=True)
class SkeletonResult(Result):
    """Symmetric parts of an image, and contours between its regions.

    Attributes
    ----------
    parts : list of Part
        By decreasing log odds.
    boundaries : list of Boundary
        By decreasing strength; empty as written.
    radii : tuple of float
        Range of the radii, px.
    shape : tuple of int
        Height and width of the image.
    """

    parts: list[Part]
    boundaries: list[Boundary]
    radii: tuple[float, float]
    shape: tuple[int, int]

    @property
    def objects(self) -> int:
        """Number of objects."""
        return len({part.object for part in self.parts})

    def to_pandas(self) -> Any:
        """Returns a data frame of the parts: object, log_odds, length in discs, mean radius."""
        return frame(
            {
                "object": [part.object for part in self.parts],
                "log_odds": [part.log_odds for part in self.parts],
                "discs": [len(part.discs) for part in self.parts],
                "radius": [float(part.discs[:, 2].mean()) for part in self.parts],
            }
        )

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws axes (red) and contours (blue) into axes of matplotlib, and returns the axes."""
        ax = _image_axes(ax)
        for part in self.parts:
            ax.plot(*part.discs.T[:2], **{"color": "tab:red", **style})
            for side in (0, 1):
                ax.plot(*part.contacts[:, side].T, color="tab:blue", linewidth=1)
        return ax


def skeleton(
    image: Image,
    *,
    radii: tuple[float, float] | None = None,
    as_written: bool = False,
    sigma: float = 1.5,
    min_gradient: float = 2.0,
    min_strength: float = MIN_BOUNDARY_STRENGTH,
    **params: Any,
) -> SkeletonResult:
    """Groups contours and medial axes of the symmetric parts of an image, without a model.

    Parameters
    ----------
    image
        Grey levels, shape (height, width); colours, shape (height, width, 3), red first; or a file.
    radii
        Range of half the width of parts, px; None: proposed from the image.
    as_written
        The method of the thesis, chapter 3.
    sigma, min_gradient
        Blur in px and least gradient of an edge in grey levels per px.
    min_strength
        Least strength of a reported contour between regions.
    **params
        Fields of ``cairn_skeleton_grouping_params``, such as ``min_log_odds``.
    """
    grey = grey_of(image)
    height, width = grey.shape
    if max(height, width) > MAX_SIDE:
        raise BadArgumentError(f"the image has {width} x {height} pixels, expected {MAX_SIDE}")
    set_, count, _edgel_pool = _edgels(grey, {"sigma": sigma, "min_gradient": min_gradient})
    start = (
        lib.cairn_skeleton_grouping_as_written()
        if as_written
        else lib.cairn_skeleton_grouping_default()
    )
    sizes = {"max_width": width, "max_height": height, "max_edgels": 2 * width * height}
    values = new_params("skeleton_grouping", {**sizes, **params}, start)
    grouping, _pool = create("skeleton_grouping", values)
    source = ffi.new("cairn_skeleton_grouping_input *")
    source.edgels, source.count = lib.cairn_edgel_list(set_, ffi.NULL), count
    source.width, source.height = width, height
    source.min_radius, source.max_radius = radii or (0.0, 0.0)
    check(lib.cairn_skeleton_grouping_begin(grouping, source), "image")
    run(lambda budget: lib.cairn_skeleton_grouping_step(grouping, budget), "skeleton")
    out = lib.cairn_skeleton_grouping_read(grouping)
    parts = [_part(out, out.parts[i]) for i in range(out.part_count)]
    colours = None if isinstance(image, (str, os.PathLike)) else np.asarray(image)
    boundaries = [] if as_written else _boundaries(grey, colours, min_strength)
    return SkeletonResult(parts, boundaries, (out.min_radius, out.max_radius), (height, width))


def _part(out: Any, part: Any) -> Part:
    points = out.points[part.first : part.first + part.count]
    return Part(
        np.array([(p.centre.x, p.centre.y, p.radius) for p in points]),
        np.array([[(c.x, c.y) for c in p.contact] for p in points]),
        np.array([[edgel >= 0 for edgel in p.edgel] for p in points]),
        part.log_odds,
        int(part.object),
    )


def _boundaries(grey: UInt8, colours: NDArray[Any] | None, min_strength: float) -> list[Boundary]:
    height, width = grey.shape
    regions = (width * height + PIXELS_PER_REGION - 1) // PIXELS_PER_REGION
    values = {
        "max_width": width,
        "max_height": height,
        "max_regions": regions,
        "max_corners": 2 * width * height + 3 * regions,
        "min_strength": min_strength,
    }
    finder, _pool = create("boundary", new_params("boundary", values))
    samples, channels = grey, 1
    if colours is not None and colours.ndim == 3 and colours.dtype == np.uint8:
        # The library takes blue first.
        samples, channels = np.ascontiguousarray(colours[..., 2::-1]), 3
    source = ffi.new("cairn_boundary_image *")
    source.samples = pointer(samples, "const uint8_t *")
    source.width, source.height = width, height
    source.channels, source.stride = channels, width * channels
    check(lib.cairn_boundary_begin(finder, source), "image")
    run(lambda budget: lib.cairn_boundary_step(finder, budget), "boundary")
    out = lib.cairn_boundary_read(finder)
    corners = copy_of(out.corners, (int(out.corner_count), 2), "<i2").astype(np.float64) - 0.5
    return [
        Boundary(corners[c.first : c.first + c.count], c.strength, bool(c.closed))
        for c in out.contours[0 : out.contour_count]
    ]


# ---- Objects of a class, and contours of a known object ----


@dataclass(frozen=True)
class Detection(Result):
    """An object that was found in an image.

    Attributes
    ----------
    box : ndarray
        Shape (4,): left, top, right, bottom, px.
    score : float
        Linear score in nats, not calibrated; greater is better.
    outline : ndarray
        Shape (n, 2): the model's outline, deformed to the image, px.
    observed : ndarray
        Shape (n,): False where no edge is along the outline.
    mirrored : bool
        Whether it is an instance of the mirrored model.
    size : float
        Diagonal of the model's box, px.
    figures : dict
        The figures that the score is made of.
    """

    box: Float64
    score: float
    outline: Float64
    observed: Bool
    mirrored: bool
    size: float
    figures: dict[str, float] = field(default_factory=dict)

    def mask(self, shape: tuple[int, int]) -> Bool:
        """Returns the pixels inside the outline, by the even-odd rule.

        Parameters
        ----------
        shape
            Height and width of the image.
        """
        height, width = shape
        columns, inside = np.arange(width), np.zeros(shape, bool)
        a, b = self.outline, np.roll(self.outline, -1, axis=0)
        for row in range(height):
            crossing = (a[:, 1] > row) != (b[:, 1] > row)
            p, q = a[crossing], b[crossing]
            x = p[:, 0] + (row - p[:, 1]) / (q[:, 1] - p[:, 1]) * (q[:, 0] - p[:, 0])
            inside[row] = (columns[:, None] < x).sum(axis=1) % 2 == 1
        return inside


class Detections(Sequence[Detection]):
    """Objects found in an image, the best first."""

    def __init__(self, found: list[Detection], shape: tuple[int, int]) -> None:
        self._found = found
        self.shape = shape

    def __getitem__(self, index: Any) -> Any:
        return self._found[index]

    def __len__(self) -> int:
        return len(self._found)

    def to_dict(self) -> dict[str, Any]:
        """Returns the detections as plain values."""
        return {"shape": list(self.shape), "detections": [d.to_dict() for d in self._found]}

    def to_coco(self, image_id: int = 0, category_id: int = 1) -> list[dict[str, Any]]:
        """Returns the detections as results of COCO: bbox, score, segmentation."""
        out = []
        for d in self._found:
            left, top, right, bottom = d.box.tolist()
            out.append(
                {
                    "image_id": image_id,
                    "category_id": category_id,
                    "bbox": [left, top, right - left, bottom - top],
                    "score": d.score,
                    "segmentation": [d.outline.ravel().tolist()],
                }
            )
        return out

    def to_pandas(self) -> Any:
        """Returns a data frame: left, top, right, bottom, score, mirrored."""
        boxes = np.array([d.box for d in self._found]).reshape(-1, 4).T
        columns = dict(zip(("left", "top", "right", "bottom"), boxes))
        scores = {name: [getattr(d, name) for d in self._found] for name in ("score", "mirrored")}
        return frame({**columns, **scores})

    def plot(self, ax: Any = None, image: Image | None = None, **style: Any) -> Any:
        """Draws outlines and scores, over the image when it is given, and returns the axes."""
        ax = _image_axes(ax)
        if image is not None:
            ax.imshow(grey_of(image), cmap="gray")
        for d in self._found:
            ax.plot(*np.vstack((d.outline, d.outline[:1])).T, **{"color": "tab:red", **style})
            ax.text(d.box[0], d.box[1], f"{d.score:.1f}", color="tab:red")
        return ax

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{d.score:.2f}</td><td>{np.array2string(d.box, precision=1)}</td></tr>"
            for d in self._found
        )
        return f"<table><tr><th>score</th><th>box (px)</th></tr>{rows}</table>"

    def __repr__(self) -> str:
        return f"Detections({len(self)} found)"


class Appearance:
    """How objects of a class look: visual words and a support vector machine."""

    def __init__(self, model: Any) -> None:
        self._model = ffi.gc(model, lib.cairn_appearance_file_free)

    @classmethod
    def read(cls, path: PathLike) -> Appearance:
        """Reads a model that was trained."""
        model, error = ffi.new("cairn_appearance_model *"), ffi.new("cairn_file_error *")
        status = lib.cairn_appearance_file_read(model, path_of(path), error)
        check_file(status, error, os.fspath(path))
        return cls(model)

    def save(self, path: PathLike) -> None:
        """Writes the model."""
        error = ffi.new("cairn_file_error *")
        status = lib.cairn_appearance_file_write(self._model, path_of(path), error)
        check_file(status, error, os.fspath(path))


def train(images: Sequence[Image], boxes: Sequence[ArrayLike], **params: Any) -> Appearance:
    """Trains the appearance of a class.

    Parameters
    ----------
    images
        Grey levels, shape (height, width) each, or files.
    boxes
        For each image the boxes of all objects of the class in it, shape (n, 4): left, top, right,
        bottom, px; n = 0: a negative example.
    **params
        Fields of ``cairn_appearance_train_params``: ``words``, ``negatives``, ``cost``, ``seed``.

    Raises
    ------
    UnsupportedError
        cairn's library for OpenCV (features2d and ml) is not installed.
    """
    if len(images) != len(boxes):
        raise BadArgumentError(f"{len(images)} images and boxes of {len(boxes)}, expected as many")
    trainer = ffi.gc(lib.cairn_appearance_trainer_new(), lib.cairn_appearance_trainer_free)
    if trainer == ffi.NULL:
        raise NoMemoryError("no memory for a trainer")
    error = ffi.new("cairn_file_error *")
    for image, own in zip(images, boxes):
        grey = grey_of(image)
        rows = array(np.asarray(own, np.float64).reshape(-1, 4), np.float64, (None, 4), "boxes")
        status = lib.cairn_appearance_trainer_add(
            trainer,
            pointer(grey, "const uint8_t *"),
            grey.shape[1],
            grey.shape[0],
            pointer(rows, "const double *"),
            len(rows),
            ARRAY_NAME,
            error,
        )
        check_file(status, error)
    settings = ffi.new("cairn_appearance_train_params *", lib.cairn_appearance_train_default())
    set_fields(settings, params)
    model = ffi.new("cairn_appearance_model *")
    check_file(lib.cairn_appearance_train(model, trainer, settings, ARRAY_NAME, error), error)
    return Appearance(model)


Shape = Union[ShapeModel, ArrayLike, PathLike]


def model_of(shape: Shape) -> ShapeModel:
    """Returns a model as it is, or that of a picture."""
    return shape if isinstance(shape, ShapeModel) else model(shape)


class _Tokens:
    """The edge segments of an edge map."""

    def __init__(self, strengths: Image, min_strength: int, edgels_: bool) -> None:
        self.strengths = grey_of(strengths, "edges")
        error = ffi.new("cairn_file_error *")
        tokens = ffi.new("cairn_contour_search_tokens *")
        status = lib.cairn_contour_search_run_tokens(
            tokens, _raster(self.strengths), min_strength, int(edgels_), ARRAY_NAME, error
        )
        check_file(status, error)
        self.tokens = ffi.gc(tokens, lib.cairn_contour_search_run_free_tokens)


def _places(outline: Any, first: int, count: int) -> tuple[Float64, Bool]:
    places = outline[first : first + count]
    points = [(p.point.position.x, p.point.position.y) for p in places]
    return np.array(points).reshape(-1, 2), np.array([p.segment >= 0 for p in places], bool)


def detect(
    edge_map: Image, shape: Shape, *, mirror: bool = True, min_strength: int = 1, **params: Any
) -> Detections:
    """Detects objects of a class by one model of their outline.

    Parameters
    ----------
    edge_map
        Edge strengths, shape (height, width), 0: no edge, to 255: of `edges` or another detector.
    shape
        The model, or a silhouette or drawing of an object.
    mirror
        Whether the mirrored model is searched, too.
    min_strength
        Weaker pixels are no edges, 1 to 255.
    **params
        Fields of ``cairn_object_detect_params``, such as ``min_score`` or ``occluded``.
    """
    source, tokens = model_of(shape), _Tokens(edge_map, min_strength, False)
    height, width = tokens.strengths.shape
    settings = ffi.new("cairn_object_detect_params *")
    settings[0] = lib.cairn_object_detect_default(width, height)
    set_fields(settings, {"mirror": mirror, **params})
    error, made = ffi.new("cairn_file_error *"), ffi.new("cairn_object_detect_run_image **")
    status = lib.cairn_object_detect_run_make(made, tokens.tokens, settings, ARRAY_NAME, error)
    check_file(status, error)
    field_ = ffi.gc(made[0], lib.cairn_object_detect_run_free_image)
    out = ffi.new("cairn_object_detections *")
    status = lib.cairn_object_detect_run(out, field_, source._model, ARRAY_NAME, error)
    check_file(status, error)
    try:
        found = [_detection(out, out.found[i], (height, width)) for i in range(out.count)]
    finally:
        lib.cairn_object_detect_run_free(out)
    return Detections(found, (height, width))


FIGURES = (
    "rigid_evidence",
    "deformed_evidence",
    "edge_proximity",
    "tangent_deviation",
    "deformation",
    "grouped_evidence",
    "outline_coverage",
)


def _detection(out: Any, d: Any, shape: tuple[int, int]) -> Detection:
    outline, observed = _places(out.outline, d.first_outline, d.outline_count)
    height, width = shape
    box = np.clip([d.left, d.top, d.right, d.bottom], 0, [width, height, width, height])
    figures = {name: float(getattr(d, name)) for name in FIGURES}
    return Detection(box, d.score, outline, observed, bool(d.mirrored), d.size, figures)


@dataclass(frozen=True)
class Contour(Result):
    """The contour of a known object.

    Attributes
    ----------
    pose : Pose
        Position in px and rotation in rad, clockwise as the image is seen.
    size : float
        Diagonal of the object's box, px.
    score : float
        Linear score in nats, not calibrated.
    matched : float
        Share of the outline that edges match.
    segments : ndarray
        Shape (n, 2, 2): the edge segments of the contour, px.
    outline : ndarray
        Shape (m, 2): the predicted outline, px.
    observed : ndarray
        Shape (m,): False where the outline is predicted alone.
    mirrored : bool
        Whether it is an instance of the mirrored model.
    """

    pose: Pose
    size: float
    score: float
    matched: float
    segments: Float64
    outline: Float64
    observed: Bool
    mirrored: bool

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws outline and segments into axes of matplotlib, y down, and returns the axes."""
        ax = _image_axes(ax)
        ax.plot(*self.outline.T, ":", color="tab:blue")
        for segment in self.segments:
            ax.plot(*segment.T, **{"color": "tab:red", **style})
        return ax


def contours(
    edge_map: Image,
    shape: Shape,
    *,
    mirror: bool = True,
    min_strength: int = 1,
    tokens: str = "segments",
    **params: Any,
) -> list[Contour]:
    """Finds which edges are the contour of a known object.

    Parameters
    ----------
    edge_map
        Edge strengths, shape (height, width), 0: no edge, to 255.
    shape
        The model, or a silhouette or drawing of the object.
    mirror
        Whether the mirrored model is searched, too.
    min_strength
        Weaker pixels are no edges, 1 to 255.
    tokens
        ``"segments"`` or ``"edgels"``.
    **params
        Fields of ``cairn_contour_search_params``: ``min_size`` and ``max_size`` (px), ``min_turn``
        and ``max_turn`` (rad), ``min_evidence`` (nats); ``grouping`` is a group.
    """
    if tokens not in ("segments", "edgels"):
        raise BadArgumentError(f"tokens is {tokens!r}, expected 'segments' or 'edgels'")
    source, found = model_of(shape), _Tokens(edge_map, min_strength, tokens == "edgels")
    height, width = found.strengths.shape
    settings = ffi.new("cairn_contour_search_params *")
    settings[0] = lib.cairn_contour_search_default(width, height)
    set_fields(settings, {"mirror": mirror, **params})
    error, out = ffi.new("cairn_file_error *"), ffi.new("cairn_contour_search_result *")
    status = lib.cairn_contour_search_run(
        out, found.tokens, source._model, settings, ARRAY_NAME, error
    )
    check_file(status, error)
    try:
        return [_contour(found.tokens, out, out.objects[i]) for i in range(out.object_count)]
    finally:
        lib.cairn_contour_search_run_free(out)


def _contour(tokens: Any, out: Any, o: Any) -> Contour:
    lines = []
    for index in out.segments[o.found.first : o.found.first + o.found.count]:
        line = tokens.lines[index]
        lines.append(((line.a.x, line.a.y), (line.b.x, line.b.y)))
    outline, observed = _places(out.outline, o.first_outline, o.outline_count)
    return Contour(
        Pose(o.found.origin.x, o.found.origin.y, o.found.turn),
        o.found.size,
        o.found.evidence,
        o.found.score,
        np.array(lines).reshape(-1, 2, 2),
        outline,
        observed,
        bool(o.mirrored),
    )
