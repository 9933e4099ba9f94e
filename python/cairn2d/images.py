"""Images as grey levels, and axes to draw into them."""

from __future__ import annotations

import os
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    Float64,
    PathLike,
    UInt8,
    array,
    check_file,
    copy_of,
    path_of,
    pointer,
    view,
)
from ._cairn import ffi, lib

# Name of an image in messages, when it is an array.
ARRAY_NAME = b"image"

Image = Union[ArrayLike, PathLike]


def read_image(path: PathLike) -> UInt8:
    """Reads an image as 8-bit grey levels, shape (height, width).

    PBM, PGM and PPM are always read; PNG, JPEG and TIFF where cairn is built with their libraries
    (the wheel of ``make python-wheel``: no TIFF).
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


def raster(pixels: UInt8) -> Any:
    """Returns an image as C takes it; the array must be kept."""
    height, width = pixels.shape
    return (pointer(pixels, "const uint8_t *"), width, height, width)


def reals(values: Any, count: int, columns: int) -> Float64:
    """Returns a copy of `count` structs of `columns` numbers."""
    return copy_of(values, (int(count), columns), "<f8")


def image_axes(ax: Any) -> Any:
    """Returns axes with y down."""
    from ._draw import axes_of

    ax = axes_of(ax)
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    return ax
