"""Edge points of images, and edge maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._base import (
    Float64,
    UInt8,
    check,
    create,
    new_params,
    run,
)
from ._cairn import ffi, lib
from .images import Image, grey_of, raster, reals


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


def edges(image: Image, **params: Any) -> UInt8:
    """Returns an edge map of an image: the pixels of its `edgels`.

    It serves `detect` and `contours` where no other edge detector is available; those of OpenCV or
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
