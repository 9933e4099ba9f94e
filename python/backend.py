"""Build backend of cairn2d: scikit-build-core on a folder that holds cairn's sources as well.

In cairn's repository the sources lie beside this folder. They are copied, with this folder, to
where the package is built. In an unpacked sdist they lie in the folder `cairn`: nothing is copied.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scikit_build_core import build as backend

HERE = Path(__file__).resolve().parent
# What the extension module is built from, relative to the repository.
SOURCES = ["CMakeLists.txt", "include", "src", "sim", "tools/page.sh", "packaging/cmake"]
LICENSES = ["LICENSE", "LICENSES"]
NOT_COPIED = shutil.ignore_patterns("__pycache__", ".*_cache", "*.egg-info", "build", "dist")


def copy(source: Path, target: Path) -> None:
    """Copies a file or a folder."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target, ignore=NOT_COPIED)
    else:
        shutil.copy2(source, target)


@contextlib.contextmanager
def whole_folder() -> Iterator[None]:
    """Changes to a folder with the package, cairn's sources and the licences."""
    if (HERE / "cairn").is_dir():
        yield
        return
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "cairn2d"
        copy(HERE, whole)
        for name in SOURCES:
            copy(HERE.parent / name, whole / "cairn" / name)
        for name in LICENSES:
            copy(HERE.parent / name, whole / name)
        os.chdir(whole)
        try:
            yield
        finally:
            os.chdir(before)


def build_wheel(directory: str, settings: Any = None, metadata: str | None = None) -> str:
    """Builds the wheel; returns its name."""
    directory = os.path.abspath(directory)
    with whole_folder():
        return backend.build_wheel(directory, settings, metadata)


def build_sdist(directory: str, settings: Any = None) -> str:
    """Builds the source distribution; returns its name."""
    directory = os.path.abspath(directory)
    with whole_folder():
        return backend.build_sdist(directory, settings)


def prepare_metadata_for_build_wheel(directory: str, settings: Any = None) -> str:
    """Writes the metadata of the wheel without building it; returns the folder's name."""
    directory = os.path.abspath(directory)
    with whole_folder():
        return backend.prepare_metadata_for_build_wheel(directory, settings)


def get_requires_for_build_wheel(settings: Any = None) -> list[str]:
    """Returns what building a wheel needs: CMake and Ninja where the system has none."""
    with whole_folder():
        return backend.get_requires_for_build_wheel(settings)


def get_requires_for_build_sdist(settings: Any = None) -> list[str]:
    """Returns what building a source distribution needs."""
    with whole_folder():
        return backend.get_requires_for_build_sdist(settings)
