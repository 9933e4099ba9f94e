"""Prints fingerprints of results, which are the same on every machine: fingerprints.py DATA.

DATA is the folder of the small inputs of the repository. The simulated arenas are left out: their
bits are those of Box2D.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import numpy as np

import cairn2d


def show(name: str, *arrays: np.ndarray) -> None:
    """Prints the hash of arrays."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    print(name, found.hexdigest())


def main() -> None:
    """Maps, aligns, merges and detects."""
    data = Path(sys.argv[1])
    mapped = cairn2d.map(cairn2d.read(data / "logs/apartment.log"))
    show("map", mapped.trajectory, mapped.covariance, mapped.grid.pixels)
    aligned = cairn2d.align(cairn2d.read(data / "logs/rescue.log"))
    show("align", aligned.trajectory, aligned.covariance, aligned.grid.pixels)
    solved = cairn2d.PoseGraph.read(data / "graphs/apartment.g2o").solve()
    show("graph", solved.graph.poses)
    maps = [cairn2d.Grid.read(data / f"maps/robot{i}.yaml") for i in (1, 3)]
    show("merge", cairn2d.merge(maps).grid.pixels)
    mug = cairn2d.ShapeModel.read(data / "shapes/mug.shape")
    edges = cairn2d.edges(cairn2d.read_image(data / "images/mug.pgm"))
    for found in cairn2d.detect(edges, mug):
        show("detect", np.array([found.score]), found.outline)


if __name__ == "__main__":
    main()
