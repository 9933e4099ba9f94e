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
    text,
)
from ._cairn import lib
from .alignment import AlignResult, align
from .appearance import Appearance, train
from .contour_search import Contour, contours
from .detection import Detection, Detections, detect
from .edge_maps import edgels, edges
from .evaluation import (
    MapQuality,
    PoseErrors,
    RelationErrors,
    eval_map,
    eval_poses,
    eval_relations,
)
from .filter_mapping import FilterMapper
from .graphs import GraphSolution, PoseGraph
from .grids import Grid, OccupancyGrid
from .images import read_image
from .log_mapping import MapResult, map
from .log_sources import LogSources, LogTopic, Mounting
from .logs import Log, LogInfo, Scan, from_ros, read, stream
from .mapping import LoopEvent, Mapper, ScanPose
from .matching import Fit, Hypothesis, IcpResult, MatchResult, fit, icp, match
from .merging import MergeResult, PlacedMap, merge
from .models import ShapeModel, model, outlines, silhouette
from .polylines import Polyline, polyline
from .scanner_checks import Estimate, ScannerCheck
from .simulation import Arena, arena, scenes
from .skeletons import Boundary, Part, SkeletonResult, skeleton
from .symmetries import Axis, SymmetryResult, symmetry

__version__: str = text(lib.cairn_version_text())

__all__ = [
    "AlignResult",
    "Appearance",
    "Arena",
    "Axis",
    "BadArgumentError",
    "BadFormatError",
    "Boundary",
    "BuildError",
    "BusyError",
    "CairnError",
    "Contour",
    "Detection",
    "Detections",
    "EmptyError",
    "Estimate",
    "FileError",
    "FilterMapper",
    "Fit",
    "FullError",
    "GraphSolution",
    "Grid",
    "Hypothesis",
    "IcpResult",
    "Log",
    "LogInfo",
    "LogSources",
    "LogTopic",
    "LoopEvent",
    "MapQuality",
    "MapResult",
    "Mapper",
    "MatchResult",
    "MergeResult",
    "Mounting",
    "NoMemoryError",
    "NotFiniteError",
    "OccupancyGrid",
    "ParameterError",
    "Part",
    "PlacedMap",
    "Polyline",
    "Pose",
    "PoseErrors",
    "PoseGraph",
    "RelationErrors",
    "Scan",
    "ScanPose",
    "ScannerCheck",
    "ShapeModel",
    "SkeletonResult",
    "SymmetryResult",
    "TruncatedError",
    "UnsupportedError",
    "align",
    "arena",
    "contours",
    "detect",
    "edgels",
    "edges",
    "eval_map",
    "eval_poses",
    "eval_relations",
    "fit",
    "from_ros",
    "icp",
    "map",
    "match",
    "merge",
    "model",
    "outlines",
    "polyline",
    "read",
    "read_image",
    "scenes",
    "silhouette",
    "skeleton",
    "stream",
    "symmetry",
    "train",
]
