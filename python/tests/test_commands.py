"""Every command of the program has its call in the package, and its line in the documentation."""

import re
from pathlib import Path

import pytest

import cairn2d

PAGE = Path(__file__).parents[2] / "docs/python.md"

CALLS = {
    "align": ["align"],
    "map": ["map", "Mapper", "FilterMapper", "stream"],
    "eval": ["eval_map", "eval_poses", "eval_relations"],
    "graph": ["PoseGraph"],
    "match": ["match", "icp"],
    "merge": ["merge"],
    "detect": ["detect"],
    "group": ["contours"],
    "skeleton": ["skeleton"],
    "model": ["model", "ShapeModel"],
    "symmetry": ["symmetry"],
    "train": ["train"],
    "info": ["read", "Log"],
}
# Commands without a call, with the reason.
WITHOUT = {
    "replay": "it runs the robot program of the firmware folder, which no package holds",
}


def commands_of(program):
    commands = re.findall(r"^  ([a-z]+)  +\S", program("cairn", "help"), re.M)
    assert "map" in commands
    return commands


def test_every_command_has_its_call(program):
    assert sorted(commands_of(program)) == sorted({**CALLS, **WITHOUT})
    for command in CALLS:
        for name in CALLS[command]:
            call = getattr(cairn2d, name)
            assert name in cairn2d.__all__
            assert call.__doc__


def test_every_command_has_its_line_in_the_documentation(program):
    if not PAGE.is_file():
        pytest.skip("the page lies in the repository")
    lines = re.findall(r"^\| (`cairn[^|]*) \| (.*) \|$", PAGE.read_text(), re.M)
    told = {command: said for names, said in lines for command in re.findall(r"cairn (\w+)", names)}
    assert sorted(told) == sorted(commands_of(program))
    for command, said in told.items():
        named = set(re.findall(r"\w+", said))
        assert said.startswith("none") if command in WITHOUT else named & set(CALLS[command])


def test_every_public_name_is_documented():
    for name in cairn2d.__all__:
        assert getattr(cairn2d, name).__doc__, name
