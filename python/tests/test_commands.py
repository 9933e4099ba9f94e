"""Every command of the program has its call in the package."""

import re

import cairn2d

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
    "info": ["Log"],
}
# Commands without a call, with the reason.
WITHOUT = {
    "replay": "it runs the robot program of the firmware folder, which no package holds",
}


def test_every_command_has_its_call(program):
    commands = re.findall(r"^  ([a-z]+)  +\S", program("cairn", "help"), re.M)
    assert "map" in commands
    for command in commands:
        if command in WITHOUT:
            continue
        for name in CALLS[command]:
            call = getattr(cairn2d, name)
            assert name in cairn2d.__all__
            assert call.__doc__


def test_every_public_name_is_documented():
    for name in cairn2d.__all__:
        assert getattr(cairn2d, name).__doc__, name
