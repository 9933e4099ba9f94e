"""Simulated arenas with ground truth, in which every example runs without data."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ._base import (
    MAX_SEED,
    BadArgumentError,
    Float64,
    UnsupportedError,
    check_interruption,
    check_number,
    pose_of,
    set_fields,
    text,
)
from ._cairn import ffi, lib
from .logs import Log, Scan

EDGE_KINDS = ("wall", "furniture", "box", "rubble")
FAULT_BYTES = 200


def _need_simulator() -> None:
    if not lib.CAIRN2D_SIM:
        raise UnsupportedError("this build has no simulator; it needs Box2D (libbox2d-dev)")


def scenes() -> dict[str, str]:
    """Returns the scenes of `arena`.

    Returns
    -------
    dict
        Names, and what each is.

    Raises
    ------
    UnsupportedError
        The package was built without Box2D.
    """
    _need_simulator()
    return {
        text(lib.sim_scene_name(i)): text(lib.sim_scene_about(i)) for i in range(lib.SIM_SCENES)
    }


class Arena:
    """A simulated arena: walls, furniture and rubble. Made by `arena`.

    The same scene, seed and options give the same arena on every machine.

    Attributes
    ----------
    scene : str
        Name of the scene.
    seed : int
        Its seed.
    """

    def __init__(self, scene: str, options: Any) -> None:
        fault = ffi.new("char[]", FAULT_BYTES)
        made = lib.sim_arena_create(options, fault, FAULT_BYTES)
        if made == ffi.NULL:
            raise BadArgumentError(f"{scene}: {text(fault)}")
        self._arena = ffi.gc(made, lib.sim_arena_free)
        self.scene = scene
        self.seed = int(options.seed)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height, m."""
        options = lib.sim_arena_options_of(self._arena)
        return options.width, options.height

    @property
    def edges(self) -> Float64:
        """Sides of all bodies that are not discs, shape (n, 2, 2), m."""
        count = ffi.new("int32_t *")
        edges = lib.sim_arena_edges(self._arena, count)
        sides = [((e.a.x, e.a.y), (e.b.x, e.b.y)) for e in edges[0 : count[0]] if e.radius == 0]
        return np.array(sides, np.float64).reshape(-1, 2, 2)

    def drive(self, scans: int, *, seed: int | None = None, **options: Any) -> Log:
        """Drives a robot along a tour of the arena.

        Parameters
        ----------
        scans
            Number of scans.
        seed
            Seed of drive and noise; None: that of the arena.
        **options
            Fields of ``sim_survey_options``, such as ``beams``, ``fov`` (rad), ``range_max`` (m),
            ``noise`` (m), ``drive_distance`` (m), ``slip_turn``.

        Returns
        -------
        Log
            The scans with drifting odometry; its `Log.truth` has the true poses.
        """
        if scans < 1:
            raise BadArgumentError(f"scans is {scans}, expected at least 1")
        return self._survey(seed, {"drive": scans, **options}, (0.0, 0.0))

    def survey(
        self,
        places: int = 0,
        *,
        seed: int | None = None,
        disturb: tuple[float, float] = (0.0, 0.0),
        **options: Any,
    ) -> Log:
        """Takes scans at places of the arena, several headings at each.

        Parameters
        ----------
        places
            Number of places; 0: those of the scene.
        seed
            Seed of places and noise; None: that of the arena.
        disturb
            Uniform errors of the poses in the log: +- m in x and y, +- rad. (0, 0): the poses of
            drifting odometry.
        **options
            Fields of ``sim_survey_options``, such as ``headings``, ``beams``, ``crowd``.

        Returns
        -------
        Log
            The scans; its `Log.truth` has the true poses.
        """
        return self._survey(seed, {"places": places, "drive": 0, **options}, disturb)

    def _survey(
        self, seed: int | None, options: dict[str, Any], disturb: tuple[float, float]
    ) -> Log:
        settings = ffi.new("sim_survey_options *")
        settings[0] = lib.sim_survey_default_for(lib.sim_scene_find(self.scene.encode()))
        check_number("seed", self.seed if seed is None else seed, 0, MAX_SEED)
        settings.seed = self.seed if seed is None else seed
        set_fields(settings, options)
        settings.is_stopped = ffi.addressof(lib, "cairn_interruption_is_requested")
        fault = ffi.new("char[]", FAULT_BYTES)
        made = lib.sim_survey_create(self._arena, settings, fault, FAULT_BYTES)
        check_interruption()
        if made == ffi.NULL:
            raise BadArgumentError(f"{self.scene}: {text(fault)}")
        survey = ffi.gc(made, lib.sim_survey_free)
        count = ffi.new("int32_t *")
        scans = lib.sim_survey_scans(survey, count)
        poses = [pose_of(scans[i].odometry) for i in range(count[0])]
        if disturb != (0.0, 0.0):
            disturbed = ffi.new("sim_pose[]", count[0])
            lib.sim_survey_disturb(survey, settings.seed, *disturb, disturbed)
            poses = [pose_of(pose) for pose in disturbed]
        truth = np.array([tuple(pose_of(scans[i].truth)) for i in range(count[0])])
        owner = (survey, self._arena)
        log = [Scan._of(lib.sim_scan_input(scans + i), owner, poses[i]) for i in range(count[0])]
        return Log(log, f"{self.scene} {self.seed}", truth)

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draws the walls into axes of matplotlib, and returns the axes."""
        from ._draw import axes_of

        ax = axes_of(ax)
        sides = self.edges
        gap = np.full((len(sides), 1, 2), np.nan)
        lines = np.concatenate((sides, gap), axis=1).reshape(-1, 2)
        ax.plot(*lines.T, **{"color": "k", "linewidth": 1, **style})
        return ax

    def __repr__(self) -> str:
        width, height = self.size
        return f"Arena({self.scene!r}, seed={self.seed}, {width:.9g} x {height:.9g} m)"


def arena(
    scene: str = "rescue",
    seed: int = 1,
    *,
    size: tuple[float, float] = (0.0, 0.0),
    turn: float = math.nan,
    rubble: float = 1.0,
) -> Arena:
    """Builds a simulated arena.

    Parameters
    ----------
    scene
        Name of the scene: ``"rescue"``, ``"maze"``, ``"rooms"``, ``"apartment"``, ``"office"``,
        ``"corridor"``, ``"twins"``, ``"mirror"``, ``"round"``, ``"hospital"``
        or ``"joined"``.
    seed
        The same seed and options give the same arena.
    size
        Width and height, m; 0: those of the scene.
    turn
        Rotation of the scene in the world, rad; NaN: random.
    rubble
        Density of loose bodies, 0 to 3.

    Returns
    -------
    Arena
        The arena; `Arena.drive` and `Arena.survey` make logs in it.

    Raises
    ------
    UnsupportedError
        The package was built without Box2D.
    """
    _need_simulator()
    options = ffi.new("sim_arena_options *")
    options[0] = lib.sim_arena_default()
    options.scene = lib.sim_scene_find(scene.encode())
    if options.scene < 0:
        raise BadArgumentError(
            f"there is no scene {scene!r}, expected one of {', '.join(scenes())}"
        )
    check_number("seed", seed, 0, MAX_SEED)
    options.seed, (options.width, options.height) = seed, size
    options.turn, options.rubble = turn, rubble
    return Arena(scene, options)
