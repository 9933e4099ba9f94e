"""Pictures: PNG without other packages, axes of matplotlib."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np

from ._base import UInt8


def png(pixels: UInt8) -> bytes:
    """Returns an image as a PNG.

    Parameters
    ----------
    pixels
        Shape (height, width) or (height, width, 3), the top row first.
    """
    height, width = pixels.shape[:2]
    colour = 2 if pixels.ndim == 3 else 0
    rows = np.ascontiguousarray(pixels, np.uint8).reshape(height, -1)
    raw = np.hstack((np.zeros((height, 1), np.uint8), rows)).tobytes()

    def chunk(name: bytes, data: bytes) -> bytes:
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(raw, 6))
        + chunk(b"IEND", b"")
    )


def axes_of(ax: Any, unit: str = "m") -> Any:
    """Returns axes of matplotlib with equal scales: the given ones, or new ones.

    Parameters
    ----------
    ax
        Axes; None: new ones.
    unit
        Unit of x and y, which labels axes without labels.

    Raises
    ------
    ImportError
        matplotlib is not installed.
    """
    if ax is None:
        import matplotlib.pyplot as plt

        _, ax = plt.subplots()
    ax.set_aspect("equal")
    if not ax.get_xlabel():
        ax.set_xlabel(f"x ({unit})")
    if not ax.get_ylabel():
        ax.set_ylabel(f"y ({unit})")
    return ax
