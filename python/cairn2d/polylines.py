"""Line segments that are fitted to points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    Float64,
    Int32,
    Result,
    check,
    copy_of,
    create,
    new_fault,
    new_params,
    pointer,
    run,
)
from ._cairn import lib


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

    Returns
    -------
    Polyline
        The segments, and the segment of each point.
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
