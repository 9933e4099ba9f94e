"""Logs whose scans are fitted by segments and points."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ._base import (
    EmptyError,
    FullError,
    create,
    error_of,
    new_fault,
    new_params,
    run,
)
from ._cairn import ffi, lib
from ._kept import Kept
from .logs import IDENTITY, Log


class FittedLog:
    """The scans of a log, each fitted by segments and points, and the poses found for them."""

    def __init__(self, log: Log, spacing: float) -> None:
        self.log, self.spacing = log, spacing
        values = {"max_beams": max(log.beams, 1), "spacing": spacing}
        self.scan, self._pool = create("scan", new_params("scan", values))
        self.kept = Kept(max(len(log), 1))
        self.points = self.segments = 0
        self.point_counts: list[int] = []
        for i, view in self.fits():
            placed, scan = self.kept.keep(view), log[i]
            placed.line, placed.stamp_ns = scan.line, scan.stamp_ns
            placed.before = tuple(scan.odometry or IDENTITY)
            self.points += view.point_count
            self.segments += view.segment_count
            self.point_counts.append(int(view.point_count))
        if self.points == 0:
            raise EmptyError(f"{log.path}: no scan shows a wall, expected at least one")
        if max(self.points, self.segments) > lib.CAIRN_CAPACITY_MAX_POINTS:
            raise FullError(f"{log.path}: the scans have {self.points} points; widen spacing")

    def fits(self) -> Iterator[tuple[int, Any]]:
        """Fits the scans one after the other; each view is valid until the next one."""
        for i, scan in enumerate(self.log):
            fault = new_fault()
            status = lib.cairn_scan_begin(self.scan, scan._input, fault)
            self.check(status, i, fault)
            run(lambda budget: lib.cairn_scan_step(self.scan, budget))
            yield i, ffi.new("cairn_scan_view *", lib.cairn_scan_read(self.scan))

    def check(self, status: int, i: int, fault: Any = None) -> None:
        """Raises the exception of a scan that is refused."""
        if status < 0:
            line = self.log[i].line or None
            raise error_of(
                status, "the scan cannot be used", fault=fault, file=self.log.path, line=line
            )

    def before(self, i: int) -> tuple[float, float, float]:
        """Returns the initial pose of a scan."""
        pose = self.log[i].odometry or IDENTITY
        return pose.x, pose.y, pose.theta

    @property
    def sizes(self) -> Any:
        """The sizes of the scans, a ``cairn_capacity_scans *``."""
        beams = self.log.beams
        return ffi.new("cairn_capacity_scans *", (len(self.log), beams, self.points, self.segments))

    def place(self, i: int, pose: Any, verdict: str, low_confidence: bool) -> None:
        """Stores the pose of a scan."""
        scan = self.kept.scans + i
        scan.after, scan.low_confidence = pose, low_confidence
        scan.verdict = constant(verdict)

    def place_aligned(self, i: int, pose: Any) -> None:
        """Stores the pose that the aligner has found."""
        blind = self.point_counts[i] == 0
        word = "placed" if pose.placed else "apart" if pose.component > 0 else "uncertain"
        self.place(i, pose.map_scan, "blind" if blind else word, not pose.placed)
        self.kept.scans[i].covariance = pose.covariance
        self.kept.scans[i].support = pose.support


_constants: dict[str, Any] = {}


def constant(word: str) -> Any:
    """Returns a verdict as a constant text of C."""
    if word not in _constants:
        _constants[word] = ffi.new("char[]", word.encode())
    return _constants[word]
