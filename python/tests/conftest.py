"""What the tests share: the programs whose results are the reference, and small inputs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Callable

import pytest

import cairn2d

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
# The folder of the programs.
BUILD = Path(os.environ.get("CAIRN_BUILD", ROOT / "build"))

Program = Callable[..., str]

PACKAGE = str(Path(cairn2d.__file__).parent) + os.sep
# Events of Python at which a process is started or a temporary file made.
STARTED = {
    "os.exec",
    "os.fork",
    "os.forkpty",
    "os.posix_spawn",
    "os.spawn",
    "os.system",
    "subprocess.Popen",
    "tempfile.mkdtemp",
    "tempfile.mkstemp",
}
# Of these events those that the package caused.
beneath: list[str] = []


def notice(event: str, arguments: Any) -> None:
    """Notices an event that the package causes; what matplotlib does for it is left out."""
    if event not in STARTED:
        return
    frame: Any = sys._getframe()
    while frame and "matplotlib" not in frame.f_code.co_filename:
        if frame.f_code.co_filename.startswith(PACKAGE):
            beneath.append(event)
            return
        frame = frame.f_back


sys.addaudithook(notice)


@pytest.fixture(autouse=True)
def nothing_is_started_beneath():
    """In no test the package starts a process or makes a temporary file."""
    beneath.clear()
    yield
    assert beneath == []


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs a program of the build and returns what it prints."""

    def run(name: str, *arguments: object) -> str:
        path = BUILD / name
        if not path.exists():
            pytest.skip(f"{path} is not built")
        command = [str(path), *(str(argument) for argument in arguments)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of small inputs of the repository."""
    if not DATA.is_dir():
        pytest.skip("the small inputs lie in the repository")
    return DATA


@pytest.fixture(scope="session")
def drive() -> cairn2d.Log:
    """A short drive through an apartment."""
    try:
        return cairn2d.arena("apartment", seed=4).drive(40)
    except cairn2d.UnsupportedError as error:
        pytest.skip(str(error))
