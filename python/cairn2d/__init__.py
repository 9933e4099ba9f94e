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
from .alignment import AlignResult, align
from .evaluation import (
    MapQuality,
    PoseErrors,
    RelationErrors,
    eval_map,
    eval_poses,
    eval_relations,
)
from .graphs import GraphSolution, PoseGraph
from .grids import Grid, OccupancyGrid
from .logs import Log, LogInfo, Scan, from_ros, read, stream
from .mapping import FilterMapper, LoopEvent, Mapper, MapResult, ScanPose, map
from .matching import Fit, Hypothesis, IcpResult, MatchResult, fit, icp, match
from .merging import MergeResult, PlacedMap, merge
from .shapes import (
    Appearance,
    Axis,
    Boundary,
    Contour,
    Detection,
    Detections,
    Part,
    Polyline,
    ShapeModel,
    SkeletonResult,
    SymmetryResult,
    contours,
    detect,
    edgels,
    edges,
    model,
    outlines,
    polyline,
    read_image,
    skeleton,
    symmetry,
    train,
)
from .simulation import Arena, arena, scenes

__version__: str = text(lib.cairn_version_text())
