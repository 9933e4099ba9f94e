"""Times the package against the program: one JSON object a line.

    make python-bench [RUNS=7]
    python - BUILD [RUNS] <python/bench.py

BUILD is the folder of the programs. 600 scans of 541 beams are read, mapped and written by both, in
turn, and the medians of RUNS (7) runs are compared, by the clock and by processor time. Then a
thread counts alone and while a map is made, and two maps are made one after the other and in two
threads.
"""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Callable

import cairn2d

SCANS, BEAMS = 600, 541
ARENA = ["office", "--seed", "7", "--drive", str(SCANS), "--beams", str(BEAMS), "--fov", "270"]


def timed(work: Callable[[], object], who: int) -> tuple[float, float]:
    """Returns the seconds of a call by the clock, and of the processor."""
    before, start = resource.getrusage(who), time.perf_counter()
    work()
    seconds, after = time.perf_counter() - start, resource.getrusage(who)
    return seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def compare(build: Path, folder: Path, runs: int) -> None:
    """Compares package and program on one log."""
    log = folder / "arena" / "scans.log"
    command = [str(build / "cairn"), "map", str(log), "-o", str(folder / "c"), "--quiet"]

    def by_package() -> None:
        cairn2d.map(cairn2d.read(log)).save(folder / "python")

    def by_program() -> None:
        subprocess.run(command, check=True)

    figures: dict[str, list[tuple[float, float]]] = {"program": [], "package": []}
    for _ in range(runs):
        figures["program"].append(timed(by_program, resource.RUSAGE_CHILDREN))
        figures["package"].append(timed(by_package, resource.RUSAGE_SELF))
    medians = {
        name: [statistics.median(pair[i] for pair in pairs) for i in (0, 1)]
        for name, pairs in figures.items()
    }
    program, package = medians["program"], medians["package"]
    print(
        json.dumps(
            {
                "bench": "python",
                "scans": SCANS,
                "beams": BEAMS,
                "runs": runs,
                "program_s": round(program[0], 3),
                "package_s": round(package[0], 3),
                "ratio": round(package[0] / program[0], 3),
                "program_cpu_s": round(program[1], 3),
                "package_cpu_s": round(package[1], 3),
                "cpu_ratio": round(package[1] / program[1], 3),
            }
        )
    )


def count_for(stop: threading.Event, counted: list[int]) -> None:
    """Counts until it is stopped."""
    n = 0
    while not stop.is_set():
        n += 1
    counted[0] = n


def counting_speed(work: Callable[[], object]) -> float:
    """Returns how many times a second a thread counts while work is done."""
    stop, counted = threading.Event(), [0]
    thread = threading.Thread(target=count_for, args=(stop, counted))
    start = time.perf_counter()
    thread.start()
    work()
    stop.set()
    thread.join()
    return counted[0] / (time.perf_counter() - start)


def threads(folder: Path) -> None:
    """Measures a thread beside a map, and two maps in two threads."""
    log = cairn2d.read(folder / "arena" / "scans.log")[:200]

    def work() -> None:
        cairn2d.map(log)

    def work_twice() -> None:
        both = [threading.Thread(target=work) for _ in range(2)]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()

    alone = counting_speed(lambda: time.sleep(2))
    beside = counting_speed(work)
    one, two = timed(work, resource.RUSAGE_SELF)[0], timed(work_twice, resource.RUSAGE_SELF)[0]
    print(
        json.dumps(
            {
                "bench": "python threads",
                "counting_beside_map": round(beside / alone, 3),
                "two_maps_over_one": round(two / one, 3),
            }
        )
    )


def main() -> None:
    """Runs both benches."""
    build, runs = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 7
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arena = [str(build / "cairn-arena"), *ARENA, "-o", str(folder / "arena")]
        subprocess.run(arena, check=True, stdout=subprocess.DEVNULL)
        compare(build, folder, runs)
        threads(folder)


if __name__ == "__main__":
    main()
