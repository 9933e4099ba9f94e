"""How objects of a class look: visual words."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._base import (
    BadArgumentError,
    NoMemoryError,
    PathLike,
    array,
    check_file,
    path_of,
    pointer,
    set_fields,
)
from ._cairn import ffi, lib
from .images import ARRAY_NAME, Image, grey_of


class Appearance:
    """How objects of a class look: visual words and a support vector machine."""

    def __init__(self, model: Any) -> None:
        self._model = ffi.gc(model, lib.cairn_appearance_file_free)

    @classmethod
    def read(cls, path: PathLike) -> Appearance:
        """Reads a model that was trained.

        Parameters
        ----------
        path
            The file.

        Returns
        -------
        Appearance
            The model.
        """
        model, error = ffi.new("cairn_appearance_model *"), ffi.new("cairn_file_error *")
        status = lib.cairn_appearance_file_read(model, path_of(path), error)
        check_file(status, error, os.fspath(path))
        return cls(model)

    def save(self, path: PathLike) -> None:
        """Writes the model.

        Parameters
        ----------
        path
            The file.
        """
        error = ffi.new("cairn_file_error *")
        status = lib.cairn_appearance_file_write(self._model, path_of(path), error)
        check_file(status, error, os.fspath(path))


def train(images: Sequence[Image], boxes: Sequence[ArrayLike], **params: Any) -> Appearance:
    """Trains the appearance of a class.

    Parameters
    ----------
    images
        Grey levels, shape (height, width) each, or files.
    boxes
        For each image the boxes of all objects of the class in it, shape (n, 4): left, top, right,
        bottom, px; n = 0: a negative example.
    **params
        Fields of ``cairn_appearance_train_params``: ``words``, ``negatives``, ``cost``, ``seed``.

    Returns
    -------
    Appearance
        The model, which `detect` takes.

    Raises
    ------
    UnsupportedError
        cairn's library for OpenCV (features2d and ml) is not installed.
    """
    if len(images) != len(boxes):
        raise BadArgumentError(f"{len(images)} images and boxes of {len(boxes)}, expected as many")
    trainer = ffi.gc(lib.cairn_appearance_trainer_new(), lib.cairn_appearance_trainer_free)
    if trainer == ffi.NULL:
        raise NoMemoryError("no memory for a trainer")
    error = ffi.new("cairn_file_error *")
    for image, own in zip(images, boxes):
        grey = grey_of(image)
        rows = array(np.asarray(own, np.float64).reshape(-1, 4), np.float64, (None, 4), "boxes")
        status = lib.cairn_appearance_trainer_add(
            trainer,
            pointer(grey, "const uint8_t *"),
            grey.shape[1],
            grey.shape[0],
            pointer(rows, "const double *"),
            len(rows),
            ARRAY_NAME,
            error,
        )
        check_file(status, error)
    settings = ffi.new("cairn_appearance_train_params *", lib.cairn_appearance_train_default())
    set_fields(settings, params)
    model = ffi.new("cairn_appearance_model *")
    check_file(lib.cairn_appearance_train(model, trainer, settings, ARRAY_NAME, error), error)
    return Appearance(model)
