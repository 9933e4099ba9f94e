"""Edge segments of an edge map, and outlines that were found on them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._base import (
    Bool,
    Float64,
    check_file,
)
from ._cairn import ffi, lib
from .images import ARRAY_NAME, Image, grey_of, raster


class Tokens:
    """The edge segments of an edge map.

    Parameters
    ----------
    strengths
        The edge map.
    min_strength
        Weaker pixels are no edges.
    edgels
        Edgels in place of segments.
    strong
        As written: particles start near the ends of chains of this many times the mean strength;
        None: not as written.
    """

    def __init__(
        self,
        strengths: Image,
        min_strength: int,
        edgels: bool = False,
        strong: float | None = None,
    ) -> None:
        self.strengths = grey_of(strengths, "edges")
        error = ffi.new("cairn_file_error *")
        tokens = ffi.new("cairn_contour_search_tokens *")
        image, kind = raster(self.strengths), int(edgels)
        if strong is None:
            status = lib.cairn_contour_search_run_tokens(
                tokens, image, min_strength, kind, ARRAY_NAME, error
            )
        else:
            status = lib.cairn_contour_search_run_tokens_as_written(
                tokens, image, min_strength, kind, strong, ARRAY_NAME, error
            )
        check_file(status, error)
        self.tokens = ffi.gc(tokens, lib.cairn_contour_search_run_free_tokens)


def places_of(outline: Any, first: int, count: int) -> tuple[Float64, Bool]:
    places = outline[first : first + count]
    points = [(p.point.position.x, p.point.position.y) for p in places]
    return np.array(points).reshape(-1, 2), np.array([p.segment >= 0 for p in places], bool)
