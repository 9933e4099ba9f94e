"""Objects of a class in images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    Bool,
    Float64,
    Result,
    check_file,
    frame,
    pointer,
    set_fields,
)
from ._cairn import ffi, lib
from ._tokens import Tokens, places_of
from .appearance import Appearance
from .images import ARRAY_NAME, Image, grey_of, image_axes
from .models import Shape, cuts_of, model_of


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
        """Returns the detections as results of COCO: bbox, score, segmentation.

        Parameters
        ----------
        image_id, category_id
            Numbers of the image and of the class.

        Returns
        -------
        list of dict
            One dict for each detection, px.
        """
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
        ax = image_axes(ax)
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


METHODS = ("evidence", "parts")
BUNDLES = ("rule", "one", "none")


def detect(
    edge_map: Image,
    shape: Shape,
    *,
    mirror: bool | None = None,
    min_strength: int = 1,
    method: str | None = None,
    as_written: bool = False,
    bundles: str = "rule",
    cuts: ArrayLike | None = None,
    appearance: Appearance | None = None,
    image: Image | None = None,
    **params: Any,
) -> Detections:
    """Detects objects of a class by one model of their outline.

    Parameters
    ----------
    edge_map
        Edge strengths, shape (height, width), 0: no edge, to 255: of `edges` or another detector.
    shape
        The model, or a silhouette or drawing of an object.
    mirror
        Whether the mirrored model is searched, too; None: True, as written False.
    min_strength
        Weaker pixels are no edges, 1 to 255.
    method
        ``"evidence"``: log-likelihood ratio of the edges at every position and size. ``"parts"``:
        voting by fragments of the outline. None: ``"evidence"``, as written ``"parts"``.
    as_written
        Method ``"parts"`` as in the thesis: all configurations, boxes of the fragments.
    bundles
        ``"rule"``; ``"one"``: the longest fragment of each bundle; ``"none"``: each fragment is a
        bundle (``"parts"``).
    cuts
        Fragments by hand, shape (n, 3): first and last sample of the outline, and bundle
        (``"parts"``); None: by rule.
    appearance
        Model of `train`: detections of another appearance score less, by
        ``appearance_weight``; it needs `image`.
    image
        The image itself, grey levels, shape (height, width), for the appearance.
    **params
        Fields of ``cairn_object_detect_params``, such as ``min_score`` or ``occluded``.

    Returns
    -------
    Detections
        The objects that were found, the best first.

    Raises
    ------
    UnsupportedError
        With `appearance`: cairn's library for OpenCV (features2d and ml) is not installed.
    """
    method = ("parts" if as_written else "evidence") if method is None else method
    if method not in METHODS:
        raise BadArgumentError(f"method is {method!r}, expected 'evidence' or 'parts'")
    if as_written and method != "parts":
        raise BadArgumentError("as_written with method 'evidence', expected 'parts'")
    if as_written and mirror:
        raise BadArgumentError("mirror with as_written: the thesis has no mirror images")
    if bundles not in BUNDLES:
        raise BadArgumentError(f"bundles is {bundles!r}, expected one of {', '.join(BUNDLES)}")
    if (appearance is None) != (image is None):
        raise BadArgumentError("appearance and image, expected both or none")
    source, tokens = model_of(shape), Tokens(edge_map, min_strength)
    height, width = tokens.strengths.shape
    settings = ffi.new("cairn_object_detect_params *")
    if as_written:
        settings[0] = lib.cairn_object_detect_as_written(width, height)
    else:
        settings[0] = lib.cairn_object_detect_default(width, height)
    settings.method, settings.bundles = METHODS.index(method), BUNDLES.index(bundles)
    set_fields(settings, {"mirror": mirror is not False and not as_written, **params})
    by_hand = cuts_of(cuts)
    if by_hand is not None:
        settings.cuts, settings.cut_count = by_hand, len(by_hand)
    words = None if appearance is None else _words(appearance, image, (height, width))
    settings.appearance = ffi.NULL if words is None else words.field
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


def _words(appearance: Appearance, image: Any, shape: tuple[int, int]) -> Any:
    """Returns the visual words of an image, a ``cairn_appearance_image *``."""
    grey = grey_of(image)
    if grey.shape != shape:
        raise BadArgumentError(
            f"image has the shape {grey.shape}, expected that of the edges {shape}"
        )
    words, error = ffi.new("cairn_appearance_image *"), ffi.new("cairn_file_error *")
    status = lib.cairn_appearance_image_make(
        words,
        appearance._model,
        pointer(grey, "const uint8_t *"),
        grey.shape[1],
        grey.shape[0],
        ARRAY_NAME,
        error,
    )
    check_file(status, error)
    return ffi.gc(words, lib.cairn_appearance_image_free)


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
    outline, observed = places_of(out.outline, d.first_outline, d.outline_count)
    height, width = shape
    box = np.clip([d.left, d.top, d.right, d.bottom], 0, [width, height, width, height])
    figures = {name: float(getattr(d, name)) for name in FIGURES}
    return Detection(box, d.score, outline, observed, bool(d.mirrored), d.size, figures)
