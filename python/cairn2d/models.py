"""Outlines of objects in silhouettes and drawings, and models of their shapes."""

from __future__ import annotations

import os
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    Float64,
    PathLike,
    UInt8,
    array,
    check,
    check_file,
    path_of,
    pointer,
    set_fields,
    view,
)
from ._cairn import ffi, lib
from .images import (
    ARRAY_NAME,
    Image,
    grey_of,
    image_axes,
    raster,
    reals,
    vision_image,
)

HOLES = ("keep", "fill", "refuse")


class ShapeModel:
    """The model of a shape: its outlines, and the discs along the axes of its parts."""

    def __init__(self, file: Any) -> None:
        self._file = ffi.gc(file, lib.cairn_shape_model_file_free)

    @classmethod
    def read(cls, path: PathLike) -> ShapeModel:
        """Reads a model, or builds one from a picture of the object.

        Parameters
        ----------
        path
            A model, or a picture.

        Returns
        -------
        ShapeModel
            The model.
        """
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
        """Writes the model. Numbers read back bit for bit.

        Parameters
        ----------
        path
            The file.
        """
        error = ffi.new("cairn_file_error *")
        model = ffi.addressof(self._file, "model")
        status = lib.cairn_shape_model_file_write(model, path_of(path), error)
        check_file(status, error, os.fspath(path))

    def draw(self, path: PathLike, title: str = "model") -> None:
        """Writes a picture of outline, axes and radii (SVG).

        Parameters
        ----------
        path
            The file.
        title
            Title of the picture.
        """
        error = ffi.new("cairn_file_error *")
        status = lib.cairn_shape_model_file_draw(self._model, title.encode(), path_of(path), error)
        check_file(status, error, os.fspath(path))

    def draw_parts(
        self, path: PathLike, cuts: ArrayLike | None = None, title: str = "model"
    ) -> None:
        """Writes a picture of the fragments of the outline by part bundles (SVG).

        Parameters
        ----------
        path
            The file.
        cuts
            Fragments by hand, shape (n, 3): first and last sample of the outline, and bundle; None:
            by rule.
        title
            Title of the picture.
        """
        error, by_hand = ffi.new("cairn_file_error *"), cuts_of(cuts)
        status = lib.cairn_shape_model_file_draw_parts(
            self._model,
            ffi.NULL if by_hand is None else by_hand,
            0 if by_hand is None else len(by_hand),
            title.encode(),
            path_of(path),
            error,
        )
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
        ax = image_axes(ax)
        ax.plot(*self.outline.T[:2], ".", **{"markersize": 2, "color": "k", **style})
        ax.scatter(*self.discs.T[:2], s=4, color="tab:red")
        return ax

    def __repr__(self) -> str:
        model = self._file.model
        return f"ShapeModel({model.path_count} paths, {model.outline_count} outline samples)"


def cuts_of(cuts: ArrayLike | None) -> Any:
    """Returns fragments by hand as C takes them; None without."""
    if cuts is None:
        return None
    rows = array(cuts, np.int32, (None, 3), "cuts")
    return ffi.new("cairn_part_bundle_cut[]", [tuple(row) for row in rows.tolist()])


def trace(image: Image, holes: str, max_gap: float, min_part: float) -> tuple[Any, Any]:
    """Traces the outlines of the object in a picture."""
    if holes not in HOLES:
        raise BadArgumentError(f"holes is {holes!r}, expected one of {', '.join(HOLES)}")
    grey, traced = grey_of(image), ffi.new("cairn_shape_image *")
    params, error = ffi.new("cairn_shape_image_params *"), ffi.new("cairn_file_error *")
    params[0] = lib.cairn_shape_image_default()
    params.holes, params.max_gap, params.min_part = HOLES.index(holes), max_gap, min_part
    status = lib.cairn_shape_image_trace(traced, raster(grey), params, ARRAY_NAME, error)
    check_file(status, error)
    return traced, ffi.gc(traced, lib.cairn_shape_image_free)


def model(
    image: Image,
    *,
    holes: str = "keep",
    max_gap: float = 0.1,
    min_part: float = 0.01,
    grab: ArrayLike | None = None,
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
    grab
        Left, top, width and height, px: the image is a photograph, and the object in this box is
        cut out of it (GrabCut of OpenCV); None: a picture of the object alone.
    **params
        Fields of ``cairn_shape_model_builder_params``, such as ``max_paths``.

    Returns
    -------
    ShapeModel
        The model.

    Raises
    ------
    UnsupportedError
        With `grab`: cairn's library for OpenCV is not installed.
    """
    if grab is not None:
        image = silhouette(image, grab)
    if isinstance(image, (str, os.PathLike)) and lib.cairn_shape_model_file_is(path_of(image)):
        return ShapeModel.read(image)
    traced, owned = trace(image, holes, max_gap, min_part)
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


def silhouette(image: Image, box: ArrayLike) -> UInt8:
    """Cuts an object out of a photograph (GrabCut of OpenCV).

    Parameters
    ----------
    image
        Grey levels, shape (height, width); colours, shape (height, width, 3), red first; or a file.
    box
        Left, top, width and height, px: all outside of it is background.

    Returns
    -------
    ndarray
        Shape (height, width), uint8: 0 the object, 255 the rest.

    Raises
    ------
    UnsupportedError
        cairn's library for OpenCV is not installed.
    """
    corners = array(box, np.int32, (4,), "box")
    photo, _keep = _photo(image)
    made, error = ffi.new("cairn_vision_image *"), ffi.new("cairn_file_error *")
    where = pointer(corners, "const int32_t *")
    status = lib.cairn_vision_grab(made, photo, where, ARRAY_NAME, error)
    check_file(status, error)
    owned = ffi.gc(made, lib.cairn_vision_free)
    samples = ffi.cast("uint8_t *", made.samples)
    return view(samples, (int(made.height), int(made.width)), "|u1", owned)


def _photo(image: Image) -> tuple[Any, Any]:
    """Returns an image with its colours as a ``cairn_vision_image *``, and what keeps it."""
    if isinstance(image, (str, os.PathLike)):
        photo, error = ffi.new("cairn_vision_image *"), ffi.new("cairn_file_error *")
        check_file(lib.cairn_vision_read(photo, path_of(image), error), error, os.fspath(image))
        owned = ffi.gc(photo, lib.cairn_vision_free)
        if photo.sample_bytes > 1:
            check(lib.cairn_vision_make_grey(photo), os.fspath(image))
        return photo, owned
    pixels = np.asarray(image)
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4):
        pixels = array(pixels, np.uint8, (None, None, None), "image")
        # The library takes blue first.
        pixels = np.ascontiguousarray(pixels[..., 2::-1])
    else:
        pixels = grey_of(pixels)
    return vision_image(pixels), pixels


def outlines(
    image: Image, *, holes: str = "keep", max_gap: float = 0.1, min_part: float = 0.01
) -> list[Float64]:
    """Traces the outlines of an object in a silhouette or a drawing.

    Parameters
    ----------
    image, holes, max_gap, min_part
        As of `model`.

    Returns
    -------
    list of ndarray
        Shape (n, 2) each, px; components by descending area, then holes.
    """
    traced, _owned = trace(image, holes, max_gap, min_part)
    return [reals(c.points, c.count, 2) for c in traced.outlines[0 : traced.count]]


Shape = Union[ShapeModel, ArrayLike, PathLike]


def model_of(shape: Shape) -> ShapeModel:
    """Returns a model as it is, or that of a picture."""
    return shape if isinstance(shape, ShapeModel) else model(shape)
