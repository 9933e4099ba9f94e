"""Every command has its call and its line in the documentation, every option its keyword."""

import inspect
import re
from pathlib import Path

import pytest

import cairn2d
from cairn2d._cairn import ffi

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

SCANNER = {
    "--scan": "read.scan",
    "--odom": "read.odom",
    "--flip": "read.flip",
    "--range-scale": "read.range_scale",
    "--angle-step": "read.angle_step",
    "--sensor": "read.sensor",
}
READ = {"--range-max": "read.range_max", **SCANNER}
GRID = {"--resolution": "resolution", "--range": "range", "--clear": "clear"}
CANNY = {
    "--sigma": "cairn_vision_canny_params.sigma",
    "--low": "cairn_vision_canny_params.low",
    "--high": "cairn_vision_canny_params.high",
}
HALVE = "- the array may be halved before"
OBJECTS = {
    "--model": "shape",
    "--coco": "Detections.to_coco",
    "--masks": "Detection.mask",
    "--edges": "edge_map",
    "--min-strength": "min_strength",
    "--no-mirror": "mirror",
    "--max-side": HALVE,
    **CANNY,
}
SHAPES = {
    "--holes": "holes",
    "--gap": "max_gap",
    "--part": "min_part",
    "--max-side": HALVE,
}
# Of every option the keyword: of the command's own call, "call.keyword", a public method, or a
# field of a struct of parameters; or "-" and the reason why there is none.
OPTIONS = {
    "align": {
        **READ,
        **GRID,
        "--method": "method",
        "--as-written": "as_written",
        "--online": "online",
        "--spread": "spread",
        "--virtual": "method",
        "--no-poses": "method",
        "--headings": "headings",
        "--steps": "steps",
        "--spacing": "spacing",
        "--max-scans": "- a log may be cut: log[:500]",
        "--seed": "- the methods are deterministic",
    },
    "map": {
        **READ,
        **GRID,
        "--odometry-sigma": "odometry_sigma",
        "--no-odometry": "odometry",
        "--max-keys": "keyframes",
        "--release": "release",
        "--no-loops": "loops",
        "--window": "window",
        "--sweep": "sweep",
        "--keep-angle-step": "- a log is mapped with the step that it has, or that read() is given",
        "--filter": "particles",
        "--shape-prior": "shape_prior",
        "--seed": "seed",
        "--live": "stream.file",
        "--watch": "OnlineMapper.grid",
    },
    "eval map": {
        **READ,
        "--map": "MapResult.save",
        "--resolution": "resolution",
        "--range": "range",
        "--least": "least",
    },
    "eval poses": {},
    "eval relations": {"--log": "stamps_ns", **SCANNER},
    "graph": {"--keep-all": "PoseGraph.solve.keep_all", "--solver": "PoseGraph.solve.solver"},
    "match": {
        **READ,
        "--method": "method",
        "--as-written": "method",
        "--start": "start",
        "--window": "window",
        "--spacing": "spacing",
    },
    "merge": {
        "--reference": "reference",
        "--order": "order",
        "--scale": "scale",
        "--coarsen": "coarsen",
        "--min-score": "cairn_map_merge_params.min_score",
        "--start": "start",
        "--perception": "perception",
        "--as-written": "as_written",
        "--particles": "particles",
        "--seed": "seed",
    },
    "detect": {
        **OBJECTS,
        "--detections": "Detections.to_pandas",
        "--truth": "- curves of precision are for a set of images",
        "--curves": "- curves of precision are for a set of images",
        "--jobs": "- images may be searched in threads",
        "--min-score": "cairn_object_detect_params.min_score",
        "--method": "method",
        "--as-written": "as_written",
        "--nearest": "cairn_object_detect_params.nearest",
        "--matches": "cairn_object_detect_params.matches",
        "--bundles": "bundles",
        "--cuts": "cuts",
        "--modes": "cairn_object_detect_params.modes_only",
        "--appearance": "appearance",
        "--lambda": "cairn_object_detect_params.appearance_weight",
        "--candidates": "cairn_object_detect_params.candidates",
        "--overlap": "cairn_object_detect_params.overlap",
        "--occluded": "cairn_object_detect_params.occluded",
        "--verify": "cairn_object_detect_params.verify",
    },
    "group": {
        **OBJECTS,
        "--coco": "- a contour has no box",
        "--masks": "- a contour has no box",
        "--scale": "cairn_contour_search_params.min_size",
        "--rotation": "cairn_contour_search_params.min_turn",
        "--particles": "cairn_contour_grouping_params.particles",
        "--seed": "cairn_contour_grouping_params.seed",
        "--tokens": "tokens",
        "--paths": "cairn_shape_model_builder_params.max_paths",
        "--as-written": "as_written",
        "--strong": "strong",
        "--min-score": "cairn_contour_search_params.min_score",
        "--min-evidence": "cairn_contour_search_params.min_evidence",
    },
    "skeleton": {
        "--radius": "radii",
        "--learn": "learn",
        "--as-written": "as_written",
        "--weight": "as_written",
        "--min-log-odds": "cairn_skeleton_grouping_params.min_log_odds",
        "--min-strength": "min_strength",
        "--edges": "- edges of another detector lack normals; the command takes them of the image",
        "--sigma": "sigma",
        "--min-slope": "min_gradient",
        "--contrast": "cairn_skeleton_grouping_params.contrast_weight",
        "--max-side": HALVE,
        "--particles": "cairn_skeleton_grouping_params.particle_count",
        "--seed": "cairn_skeleton_grouping_params.seed",
        "--lines": "- a picture for the study of the method",
    },
    "model": {
        **SHAPES,
        "--svg": "ShapeModel.draw",
        "--parts": "ShapeModel.draw_parts",
        "--cuts": "ShapeModel.draw_parts.cuts",
        "--points": "cairn_shape_model_builder_params.outline_samples",
        "--samples": "cairn_shape_model_builder_params.path_samples",
        "--paths": "cairn_shape_model_builder_params.max_paths",
        "--grab": "grab",
        "--mirror": "ShapeModel.mirrored",
    },
    "symmetry": {
        **SHAPES,
        "--as-written": "as_written",
        "--mode": "as_written",
        "--points": "cairn_self_similarity_params.outline_samples",
        "--sheet": "SymmetryResult.plot",
    },
    "train": {
        "--boxes": "boxes",
        "--words": "cairn_appearance_train_params.words",
        "--negatives": "cairn_appearance_train_params.negatives",
        "--max-side": HALVE,
        "--cost": "cairn_appearance_train_params.cost",
        "--seed": "cairn_appearance_train_params.seed",
    },
    "info": {**READ, "--sweep": "read.sweep", "--check": "Log.check", "--scans": "Log.save"},
}
# Options of many commands that no call has, with the reason.
NOWHERE = {
    "-o": "results are saved by save(), or are arrays",
    "--json": "results have to_dict()",
    "--quiet": "nothing is printed",
    "--pool": "objects measure their memory",
    "--pictures": "results have plot()",
    "--report": "pages that play a run are made by the command alone",
    "--help": "help(call)",
    "--version": "__version__",
}


def commands_of(program) -> list[str]:
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


def test_every_option_has_its_keyword_or_a_reason_why_not(program):
    names = [name for name in commands_of(program) if name not in {"eval", *WITHOUT}]
    names += [name for name in OPTIONS if name.startswith("eval ")]
    assert set(names) == set(OPTIONS)
    for name in names:
        text = program("cairn", *name.split(), "--help")
        options = set(re.findall(r"^  (-o|--[a-z-]+)", text, re.M))
        assert "--help" in options
        known = set(OPTIONS[name]) | set(NOWHERE)
        assert options <= known, (name, options - known)
        assert set(OPTIONS[name]) <= options, (name, set(OPTIONS[name]) - options)


def parameters(call) -> set[str]:
    return set(inspect.signature(call).parameters)


@pytest.mark.parametrize("command", OPTIONS)
def test_the_keyword_of_every_option_exists(command):
    own = command.replace("eval ", "eval_").replace("group", "contours")
    for option, way in OPTIONS[command].items():
        names = way.split(".")
        if way.startswith("- "):
            assert len(way) > 10
        elif names[0].startswith("cairn_"):
            assert names[1] in dict(ffi.typeof(names[0]).fields), (option, way)
        elif len(names) == 1:
            assert way in parameters(getattr(cairn2d, own)), (option, way)
        else:
            found = cairn2d.Mapper if names[0] == "OnlineMapper" else getattr(cairn2d, names[0])
            for name in names[1:]:
                if name in parameters(found):
                    break
                found = getattr(found, name)
            assert callable(found)


def test_every_command_has_its_line_in_the_documentation(program):
    if not PAGE.is_file():
        pytest.skip("the page lies in the repository")
    lines = re.findall(r"^\| (`cairn[^|]*) \| (.*) \|$", PAGE.read_text(), re.M)
    page = {command: said for names, said in lines for command in re.findall(r"cairn (\w+)", names)}
    assert sorted(page) == sorted(commands_of(program))
    for command, said in page.items():
        named = set(re.findall(r"\w+", said))
        assert said.startswith("none") if command in WITHOUT else named & set(CALLS[command])


def test_every_public_name_is_documented():
    for name in cairn2d.__all__:
        assert getattr(cairn2d, name).__doc__, name


def sections(call) -> str:
    return inspect.getdoc(call) or ""


def test_every_public_call_documents_its_parameters_and_what_it_returns():
    public = {name: getattr(cairn2d, name) for name in cairn2d.__all__}
    calls = {name: call for name, call in public.items() if inspect.isfunction(call)}
    for kind, owner in public.items():
        if not inspect.isclass(owner):
            continue
        for name, member in inspect.getmembers(owner):
            of_package = (getattr(member, "__module__", None) or "").startswith("cairn2d")
            is_call = inspect.isfunction(member) or inspect.ismethod(member)
            if is_call and of_package and not name.startswith("_"):
                calls[f"{kind}.{name}"] = member
    for name, call in calls.items():
        given = [p for p in parameters(call) if p not in ("self", "cls", "style")]
        text = sections(call)
        # One line says it all of drawing and of plain values.
        if name.rpartition(".")[2] in ("plot", "to_pandas", "to_dict"):
            continue
        if given:
            assert "Parameters\n----------" in text, name
            for parameter in given:
                assert re.search(rf"^(\S+, )*\**{parameter}\b", text, re.M), (name, parameter)
        result = inspect.signature(call).return_annotation
        if result not in (None, "None") and "." not in name:
            assert re.search(r"^(Returns|Yields)\n-+$", text, re.M), name
