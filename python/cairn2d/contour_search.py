"""The contour of a known object among the edges of an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ._base import (
    BadArgumentError,
    Bool,
    Float64,
    Pose,
    Result,
    check_file,
    set_fields,
)
from ._cairn import ffi, lib
from ._tokens import Tokens, places_of
from .images import ARRAY_NAME, Image, image_axes
from .models import Shape, model_of


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
        ax = image_axes(ax)
        ax.plot(*self.outline.T, ":", color="tab:blue")
        for segment in self.segments:
            ax.plot(*segment.T, **{"color": "tab:red", **style})
        return ax


# Of the thesis: chains of this multiple of the mean strength, near whose ends particles start.
STRONG = 1.0


def contours(
    edge_map: Image,
    shape: Shape,
    *,
    mirror: bool | None = None,
    min_strength: int = 1,
    tokens: str = "segments",
    as_written: bool = False,
    strong: float | None = None,
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
        Whether the mirrored model is searched, too; None: True, as written False.
    min_strength
        Weaker pixels are no edges, 1 to 255.
    tokens
        ``"segments"`` or ``"edgels"``.
    as_written
        The method of the thesis: particles move along the longest path of the model, at the
        geometric mean of `min_size` and `max_size`, which must be given.
    strong
        As written: particles start near the ends of chains of this many times the mean strength;
        None: 1.
    **params
        Fields of ``cairn_contour_search_params``: ``min_size`` and ``max_size`` (px), ``min_turn``
        and ``max_turn`` (rad) and ``min_evidence`` (nats), these three not as written; ``grouping``
        is a group with ``particles`` and ``seed``.

    Returns
    -------
    list of Contour
        The contours that were found, the best first.
    """
    if tokens not in ("segments", "edgels"):
        raise BadArgumentError(f"tokens is {tokens!r}, expected 'segments' or 'edgels'")
    if as_written and mirror:
        raise BadArgumentError("mirror with as_written: the thesis has no mirror images")
    if as_written and not {"min_size", "max_size"} <= set(params):
        raise BadArgumentError(
            "as_written without min_size and max_size: the thesis sets the object's size by hand"
        )
    unused = {"min_evidence", "min_score", "min_turn", "max_turn"} & set(params)
    if as_written and unused:
        raise BadArgumentError(f"{min(unused)} with as_written: the thesis has no such parameter")
    if strong is not None and not as_written:
        raise BadArgumentError("strong without as_written, expected with it")
    source = model_of(shape)
    start = (STRONG if strong is None else strong) if as_written else None
    found = Tokens(edge_map, min_strength, tokens == "edgels", start)
    height, width = found.strengths.shape
    settings = ffi.new("cairn_contour_search_params *")
    if as_written:
        settings[0] = lib.cairn_contour_search_as_written(width, height)
    else:
        settings[0] = lib.cairn_contour_search_default(width, height)
        settings.mirror = mirror is not False
    set_fields(settings, params)
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
    outline, observed = places_of(out.outline, o.first_outline, o.outline_count)
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
