"""Axes of symmetry of shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ._base import (
    Float64,
    Result,
    check,
    create,
    frame,
    new_params,
    run,
)
from ._cairn import ffi, lib
from .images import Image, image_axes, reals
from .models import trace

SYMMETRY_VERDICTS = ("single", "multiple", "circular")


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
        ax = image_axes(ax)
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

    Returns
    -------
    SymmetryResult
        The axes, the best first.
    """
    traced, _owned = trace(image, holes, max_gap, min_part)
    parts = traced.count - traced.holes
    outer = traced.outlines[0]
    shape = [outer]
    for i in range(parts, traced.count):
        hole = traced.outlines[i]
        if lib.cairn_polygon_contains(outer.points, outer.count, hole.points[0]):
            shape.append(hole)
    samples = int(params.get("outline_samples", 0))
    start = lib.cairn_image_capacity_self_similarity(samples, as_written)
    finder, _pool = create("self_similarity", new_params("self_similarity", params, start))
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
        reals(out.samples, out.sample_count, 2),
    )


def _axis(a: Any) -> Axis:
    ends = np.array([(end.x, end.y) for end in a.end])
    mirror = np.array([(v.x, v.y) for v in (a.mirror_point, a.mirror_direction)])
    return Axis(ends, a.dissimilarity, a.bend, a.skew, mirror)
