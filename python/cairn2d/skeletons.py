"""Symmetric parts of images, and contours between regions, without a model."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._base import (
    BadArgumentError,
    Bool,
    EmptyError,
    Float64,
    Result,
    UInt8,
    check,
    copy_of,
    create,
    frame,
    new_params,
    pointer,
    run,
)
from ._cairn import ffi, lib
from .edge_maps import edgel_set
from .images import Image, grey_of, image_axes
from .models import Shape, model_of

MAX_SIDE = 8192


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
        ax = image_axes(ax)
        for part in self.parts:
            ax.plot(*part.discs.T[:2], **{"color": "tab:red", **style})
            for side in (0, 1):
                ax.plot(*part.contacts[:, side].T, color="tab:blue", linewidth=1)
        return ax


def skeleton(
    image: Image,
    *,
    radii: tuple[float, float] | None = None,
    learn: Sequence[Shape] | None = None,
    as_written: bool = False,
    sigma: float = 1.5,
    min_gradient: float = 2.0,
    min_strength: float | None = None,
    **params: Any,
) -> SkeletonResult:
    """Groups contours and medial axes of the symmetric parts of an image, without a model.

    Parameters
    ----------
    image
        Grey levels, shape (height, width); colours, shape (height, width, 3), red first; or a file.
    radii
        Range of half the width of parts, px; None: proposed from the image.
    learn
        Silhouettes or drawings of objects, or their models, in the scale of the image, of which the
        range of the radii is learnt; None: as `radii` says.
    as_written
        The method of the thesis, chapter 3.
    sigma, min_gradient
        Blur in px and least gradient of an edge in grey levels per px.
    min_strength
        Least strength of a reported contour between regions; None: 2.
    **params
        Fields of ``cairn_skeleton_grouping_params``, such as ``min_log_odds``.

    Returns
    -------
    SkeletonResult
        Parts with their axes, and contours between regions.
    """
    if learn is not None:
        if radii is not None:
            raise BadArgumentError("radii and learn, expected one of them")
        radii = learn_radii(learn)
    grey = grey_of(image)
    height, width = grey.shape
    if max(height, width) > MAX_SIDE:
        raise BadArgumentError(f"the image has {width} x {height} pixels, expected {MAX_SIDE}")
    set_, count, _edgel_pool = edgel_set(grey, {"sigma": sigma, "min_gradient": min_gradient})
    start = lib.cairn_image_capacity_skeleton(width, height, as_written)
    values = new_params("skeleton_grouping", params, start)
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


def learn_radii(shapes: Sequence[Shape]) -> tuple[float, float]:
    """Returns the 5 % and 95 % quantiles of the radii along the axes of objects, px."""
    radii = [model.discs[:, 2] * model.size for model in map(model_of, shapes)]
    values = np.sort(np.concatenate(radii)) if radii else np.empty(0)
    if values.size == 0:
        raise EmptyError("learn holds no outlines, expected silhouettes or drawings")
    tail = values.size // 20
    least = max(1.0, float(values[tail]))
    return least, max(least, float(values[-1 - tail]))


def _part(out: Any, part: Any) -> Part:
    points = out.points[part.first : part.first + part.count]
    return Part(
        np.array([(p.centre.x, p.centre.y, p.radius) for p in points]),
        np.array([[(c.x, c.y) for c in p.contact] for p in points]),
        np.array([[edgel >= 0 for edgel in p.edgel] for p in points]),
        part.log_odds,
        int(part.object),
    )


def _boundaries(
    grey: UInt8, colours: NDArray[Any] | None, min_strength: float | None
) -> list[Boundary]:
    height, width = grey.shape
    start = lib.cairn_image_capacity_boundary(width, height)
    values = {} if min_strength is None else {"min_strength": min_strength}
    finder, _pool = create("boundary", new_params("boundary", values, start))
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
