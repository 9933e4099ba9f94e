"""Files of logs: how they are read, and what is corrected that they say wrongly."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._base import PathLike, check, check_file, check_number, path_of, pose_in, text
from ._cairn import ffi, lib

# m: limit of the reader below which all ranges are (CAIRN_SCAN_EXTENT).
EVERY_RANGE = 1e5
# Limits of the corrections, as of the command.
LEAST_SCALE, MOST_SCALE = 1e-6, 1e6
LONGEST_SWEEP_S = 2.0


@dataclass
class LogFile:
    """A file of scans, and the settings of `read`, whose fields these are."""

    path: PathLike
    scan: str | None
    odom: str | None
    range_max: float
    range_sigma: float
    flip: bool
    range_scale: float
    angle_step: float
    sensor: ArrayLike | None
    sweep: float
    faults: list[str] = field(default_factory=list)

    def load(self) -> Any:
        """Returns the ``cairn_scan_log *``, corrected, which frees itself; sets the faults."""
        correction = self._correction()
        if self.range_scale == 1:
            log = self._load(self.range_max)
        else:
            # The limit of the file is known after it was read once; it is in m, or in the unit of
            # the ranges.
            log = self._load_every_range(0.0)
            quartile = ffi.new("double[3]")
            check(lib.cairn_scan_log_quartiles(log, quartile), self.name)
            limit = log.scans.record[0].scan.range_max
            correction.range_max = self.range_max or lib.cairn_scan_correction_limit(
                limit, quartile[1], self.range_scale
            )
        check(lib.cairn_scan_log_correct(log, correction), self.name)
        return log

    def load_unlimited(self) -> Any:
        """Returns the log with all ranges, whatever the file says of the maximum range."""
        log = self._load_every_range(self.range_max)
        check(lib.cairn_scan_log_correct(log, self._correction()), self.name)
        return log

    @property
    def name(self) -> str:
        """The path as a text."""
        return os.fspath(self.path)

    def _correction(self) -> Any:
        """Returns the ``cairn_scan_correction *``, without the limit of scaled ranges."""
        limits = (
            ("range_max", self.range_max, 0.0, EVERY_RANGE),
            ("range_scale", self.range_scale, LEAST_SCALE, MOST_SCALE),
            ("angle_step", self.angle_step, 0.0, np.pi),
            ("sweep", self.sweep, -LONGEST_SWEEP_S, LONGEST_SWEEP_S),
        )
        for name, value, lowest, highest in limits:
            check_number(name, value, lowest, highest)
        correction = ffi.new("cairn_scan_correction *", lib.cairn_scan_correction_none())
        correction.range_scale, correction.angle_step = self.range_scale, self.angle_step
        correction.sweep, correction.flips = self.sweep, self.flip
        if self.sensor is not None:
            pose = pose_in(self.sensor, "sensor")
            for number in pose:
                check_number("sensor", number, -EVERY_RANGE, EVERY_RANGE)
            correction.has_sensor, correction.base_sensor = 1, pose
        return correction

    def _load_every_range(self, range_max: float) -> Any:
        """Returns the log with all ranges, and the limit that it has with `range_max`."""
        first = self._load(range_max)
        limit = first.scans.record[0].scan.range_max
        log = self._load(EVERY_RANGE)
        for i in range(log.scans.count):
            log.scans.record[i].scan.range_max = limit
        return log

    def _load(self, range_max: float) -> Any:
        """Returns the log as it is."""
        faults: list[str] = []

        @ffi.callback("void(void *, const cairn_file_error *)")  # type: ignore[untyped-decorator]
        def on_fault(context: Any, fault: Any) -> None:
            faults.append(text(fault.text))

        params = ffi.new("cairn_scan_log_params *")
        params[0] = lib.cairn_scan_log_default()
        params.range_max, params.range_sigma = range_max, self.range_sigma
        params.on_fault = on_fault
        topics = [
            ffi.NULL if name is None else ffi.new("char[]", name.encode())
            for name in (self.scan, self.odom)
        ]
        params.scan_topic, params.odometry_topic = topics
        error, log = ffi.new("cairn_file_error *"), ffi.new("cairn_scan_log *")
        status = lib.cairn_scan_log_load(log, path_of(self.path), params, error)
        check_file(status, error, self.name)
        self.faults = faults
        return ffi.gc(log, lib.cairn_scan_log_free)
