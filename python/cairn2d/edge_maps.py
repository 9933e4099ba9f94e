"""Edge points of images, and edge maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._base import (
    BadArgumentError,
    Float64,
    UInt8,
    check,
    check_file,
    create,
    new_params,
    pointer,
    run,
    set_fields,
)
from ._cairn import ffi, lib
from .images import ARRAY_NAME, Image, grey_of, raster, reals, vision_image


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
    set_, count, _pool = edgel_set(grey_of(image), params)
    return reals(lib.cairn_edgel_list(set_, ffi.NULL), count, 5)


def edgel_set(grey: UInt8, params: dict[str, Any]) -> tuple[Any, int, Any]:
    """Returns a ``cairn_edgel_set *``, its number of edgels, and the pool, which must be kept."""
    height, width = grey.shape
    start = lib.cairn_image_capacity_edgel(width, height)
    set_, pool = create("edgel", new_params("edgel", params, start), "edgel_set")
    check(lib.cairn_edgel_begin(set_, raster(grey)), "image")
    run(lambda budget: lib.cairn_edgel_step(set_, budget), "image")
    count = ffi.new("int32_t *")
    lib.cairn_edgel_list(set_, count)
    return set_, int(count[0]), pool


DETECTORS = ("edgels", "canny")


def edges(image: Image, detector: str = "edgels", **params: Any) -> UInt8:
    """Returns an edge map of an image.

    It serves `detect` and `contours` where no other edge detector is available; those of OpenCV or
    scikit-image may be used instead.

    Parameters
    ----------
    image
        Grey levels, shape (height, width), or a file.
    detector
        ``"edgels"``: the pixels of `edgels`. ``"canny"``: that of the command (Canny 1986).
    **params
        As of `edgels`; with ``"canny"`` ``sigma`` (px), and ``low`` and ``high`` (grey levels per
        px), the thresholds of the hysteresis.

    Returns
    -------
    ndarray
        Shape (height, width), uint8: twice the gradient's magnitude, 1 to 255; 0: no edge.

    Raises
    ------
    UnsupportedError
        ``"canny"``: cairn's library for OpenCV is not installed.
    """
    if detector not in DETECTORS:
        raise BadArgumentError(f"detector is {detector!r}, expected 'edgels' or 'canny'")
    grey = grey_of(image)
    if detector == "canny":
        return _canny(grey, params)
    points = edgels(grey, **params)
    column, row = np.rint(points[:, :2]).astype(int).T
    height, width = grey.shape
    out = np.zeros(grey.shape, np.uint8)
    strength = np.clip(np.rint(2 * points[:, 4]), 1, 255).astype(np.uint8)
    at = (np.clip(row, 0, height - 1), np.clip(column, 0, width - 1))
    np.maximum.at(out, at, strength)
    return out


def _canny(grey: UInt8, params: dict[str, Any]) -> UInt8:
    settings = ffi.new("cairn_vision_canny_params *", lib.cairn_vision_canny_default())
    set_fields(settings, params)
    out, error = np.zeros(grey.shape, np.uint8), ffi.new("cairn_file_error *")
    source, target = vision_image(grey), pointer(out, "uint8_t *")
    check_file(lib.cairn_vision_canny(source, settings, target, ARRAY_NAME, error), error)
    return out
