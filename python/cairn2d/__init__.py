"""Maps of robots from range scans, and contours of objects in images: cairn in Python."""

from __future__ import annotations

from ._base import (
    BadArgumentError,
    BadFormatError,
    BuildError,
    BusyError,
    CairnError,
    EmptyError,
    FileError,
    FullError,
    NoMemoryError,
    NotFiniteError,
    ParameterError,
    Pose,
    TruncatedError,
    UnsupportedError,
    lib,
    text,
)
from .graphs import GraphSolution, PoseGraph
from .grids import Grid, OccupancyGrid
from .logs import Log, LogInfo, Scan, from_ros, read, stream
from .mapping import FilterMapper, LoopEvent, Mapper, MapResult, ScanPose, map
from .matching import Fit, Hypothesis, IcpResult, MatchResult, fit, icp, match
from .simulation import Arena, arena, scenes

__version__: str = text(lib.cairn_version_text())
