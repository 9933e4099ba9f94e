"""SLAM by a particle filter, in which every particle has a map of its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._base import (
    BadArgumentError,
    Float64,
    get_fields,
    set_fields,
)
from ._cairn import ffi, lib
from .mapping import OnlineMapper


class FilterMapper(OnlineMapper):
    """SLAM by a Rao-Blackwellized particle filter: every particle has a map of its own.

    Parameters
    ----------
    beams
        Most beams of a scan.
    particles
        Number of particles.
    keyframes
        Capacity for keyframes.
    **params
        Fields of ``cairn_filter_mapper_params``; ``front`` is the group of the mapper's.
    """

    _module = "filter_mapper"

    def __init__(
        self, beams: int, *, particles: int = 30, keyframes: int = 1024, **params: Any
    ) -> None:
        values = ffi.new("cairn_filter_mapper_params *")
        if min(beams, particles, keyframes) < 1:
            raise BadArgumentError("beams, particles and keyframes are expected above 0")
        values[0] = lib.cairn_filter_mapper_default_for(keyframes, beams, particles)
        set_fields(values, params)
        self._begin(values)

    def _front(self) -> Any:
        return lib.cairn_filter_mapper_front(self._object)

    def _capacity(self) -> int:
        return int(self._params.front.max_keyframes)

    @property
    def keyframes(self) -> Float64:
        """Poses of the keyframes of the most likely path, shape (keyframes, 3), m and rad."""
        return self.path()

    @property
    def particles(self) -> int:
        """Current number of particles."""
        return int(lib.cairn_filter_mapper_count(self._object))

    def path(self, particle: int | None = None) -> Float64:
        """Returns the poses of the keyframes of a particle's path, shape (keyframes, 3).

        Parameters
        ----------
        particle
            Index of the particle; None: that of the most likely path.
        """
        if particle is None:
            particle = lib.cairn_filter_mapper_best(self._object)
        capacity = int(lib.cairn_filter_mapper_measure(self._object).keyframes)
        poses = np.empty((max(capacity, 1), 3))
        out = ffi.cast("cairn_pose *", ffi.from_buffer(poses))
        count = lib.cairn_filter_mapper_path(self._object, particle, out, capacity)
        return poses[:count]

    def _poses(self) -> Float64:
        kept, path = self._kept, self.path()
        poses = np.empty((kept.count, 3))
        for i in range(kept.count):
            place = kept.places[i]
            keyframe = tuple(path[place.keyframe].tolist())
            pose = lib.cairn_pose_compose(keyframe, place.keyframe_scan)
            poses[i] = pose.x, pose.y, pose.theta
        return poses

    @property
    def filter_state(self) -> dict[str, Any]:
        """Counters of the particle filter: fields of ``cairn_filter_mapper_state``."""
        return get_fields(lib.cairn_filter_mapper_measure(self._object))

    def __repr__(self) -> str:
        return f"FilterMapper({len(self)} scans, {self.particles} particles)"
