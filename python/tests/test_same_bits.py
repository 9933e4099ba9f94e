"""The results of the package are those of the programs, bit for bit."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import cairn2d


def same_files(first: Path, second: Path) -> None:
    names = sorted(path.name for path in second.iterdir())
    assert names
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        ((), {}),
        (("--no-odometry",), {"odometry": False}),
        (("--no-loops", "--window", 0), {"loops": False, "window": 0}),
        (("--release", "--max-keys", 40), {"release": True, "keyframes": 40}),
        (("--filter", 4, "--seed", 3), {"particles": 4, "seed": 3}),
        (
            ("--resolution", 0.1, "--range", 5, "--sweep", 0.05),
            {"resolution": 0.1, "range": 5, "sweep": 0.05},
        ),
    ],
)
def test_map_writes_the_files_of_the_program(program, data, tmp_path, options, keywords):
    log = data / "logs/apartment.log"
    program("cairn", "map", log, "-o", tmp_path / "c", "--quiet", *options)
    result = cairn2d.map(cairn2d.read(log), **keywords)
    result.save(tmp_path / "python")
    same_files(tmp_path / "c", tmp_path / "python")


def test_several_logs_are_mapped_one_after_another(program, data, tmp_path):
    log = data / "logs/rescue.log"
    program("cairn", "map", log, log, "-o", tmp_path / "c", "--quiet")
    one = cairn2d.read(log)
    cairn2d.map([one, one]).save(tmp_path / "python")
    same_files(tmp_path / "c", tmp_path / "python")


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        ((), {}),
        (("--virtual",), {"method": "virtual"}),
        (("--method", "gradient", "--steps", 4), {"method": "gradient", "steps": 4}),
        (("--method", "lum", "--steps", 4), {"method": "lum", "steps": 4}),
        (("--spread", "0.3,20"), {"spread": (0.3, np.radians(20))}),
    ],
)
def test_align_writes_the_files_of_the_program(program, data, tmp_path, options, keywords):
    log = data / "logs/rescue.log"
    program("cairn", "align", log, "-o", tmp_path / "c", "--quiet", *options)
    cairn2d.align(cairn2d.read(log), **keywords).save(tmp_path / "python")
    same_files(tmp_path / "c", tmp_path / "python")


def test_places_without_poses_are_those_of_the_program(program, tmp_path):
    program(
        "cairn-arena",
        "rooms",
        "--seed",
        3,
        "--places",
        4,
        "--headings",
        1,
        "--fov",
        360,
        "-o",
        tmp_path / "arena",
    )
    log = tmp_path / "arena/scans.log"
    program("cairn", "align", log, "--no-poses", "--headings", 1, "-o", tmp_path / "c", "--quiet")
    result = cairn2d.align(cairn2d.read(log), method="places", headings=1)
    result.save(tmp_path / "python")
    same_files(tmp_path / "c", tmp_path / "python")


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        ((), {}),
        (("--method", "shape"), {"method": "shape"}),
        (("--as-written",), {"method": "as written"}),
        (
            ("--start", "0.1,0,20", "--window", "0.5,25"),
            {"start": (0.1, 0, np.radians(20)), "window": (0.5, np.radians(25))},
        ),
    ],
)
def test_match_finds_the_poses_of_the_program(program, data, options, keywords):
    log = data / "logs/apartment.log"
    found = json.loads(program("cairn", "match", f"{log}:0", f"{log}:3", "--json", *options))
    scans = cairn2d.read(log)
    result = cairn2d.match(scans[0], scans[3], **keywords)
    assert result.verdict == found["verdict"]
    hypotheses = found["hypotheses"]
    assert len(result.hypotheses) == len(hypotheses)
    numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", json.dumps(hypotheses))]
    for hypothesis in result.hypotheses:
        for value in hypothesis.pose[:2]:
            assert min(abs(number - value) for number in numbers) < 1e-6


def test_graph_writes_the_file_of_the_program(program, data, tmp_path):
    path = data / "graphs/apartment.g2o"
    program("cairn", "graph", path, "-o", tmp_path / "c.g2o", "--quiet")
    cairn2d.PoseGraph.read(path).solve().graph.save(tmp_path / "python.g2o")
    assert (tmp_path / "c.g2o").read_bytes() == (tmp_path / "python.g2o").read_bytes()


def test_merge_writes_the_map_of_the_program(program, data, tmp_path):
    maps = [data / f"maps/robot{i}.yaml" for i in (1, 2, 3)]
    program("cairn", "merge", *maps, "-o", tmp_path, "--quiet")
    result = cairn2d.merge(maps)
    result.grid.save(tmp_path / "python.yaml")
    assert (tmp_path / "python.pgm").read_bytes() == (tmp_path / "map.pgm").read_bytes()
    table = np.genfromtxt(tmp_path / "transforms.csv", delimiter=",", names=True)
    for i, name in enumerate(("x", "y", "theta")):
        assert np.allclose(table[name], result.poses[:, i], rtol=1e-8)


def test_model_writes_the_file_of_the_program(program, data, tmp_path):
    picture = data / "shapes/swan-drawing.pgm"
    program("cairn", "model", picture, "-o", tmp_path / "c.shape", "--quiet")
    cairn2d.ShapeModel.read(picture).save(tmp_path / "python.shape")
    cairn2d.model(cairn2d.read_image(picture)).save(tmp_path / "array.shape")
    for name in ("python.shape", "array.shape"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "c.shape").read_bytes()


def run_on_edges(program, command, data, folder) -> tuple[np.ndarray, Path, str]:
    """Runs a command on the edges of the mug; returns the edges, the model and the JSON."""
    image, shape = data / "images/mug.pgm", data / "shapes/mug.shape"
    edges = cairn2d.edges(image)
    write_pgm(folder / "edges.pgm", edges)
    options = ("--model", shape, "--edges", folder / "edges.pgm", "-o", folder, "--quiet")
    program("cairn", command, image, *options)
    return edges, shape, (folder / "mug.json").read_text()


def test_detect_finds_the_boxes_of_the_program(program, data, tmp_path):
    edges, shape, text = run_on_edges(program, "detect", data, tmp_path)
    found = json.loads(text)["detections"]
    detections = cairn2d.detect(edges, shape)
    assert len(detections) == len(found) > 0
    for detection, expected in zip(detections, found):
        assert detection.score == pytest.approx(expected["score"], abs=1e-4)
        assert np.allclose(detection.box, expected["box"], atol=1e-2)


def test_contours_are_those_of_the_program(program, data, tmp_path):
    edges, shape, text = run_on_edges(program, "group", data, tmp_path)
    contours = cairn2d.contours(edges, shape)
    assert len(contours) == text.count('"evidence"') > 0
    values = [float(x) for x in re.findall(r'"evidence": (-?[\d.e]+)', text)]
    for contour in contours:
        assert min(abs(contour.score - value) for value in values) < 1e-2


def test_symmetry_finds_the_axes_of_the_program(program, data, tmp_path):
    picture = data / "shapes/mug-silhouette.pgm"
    program("cairn", "symmetry", picture, "-o", tmp_path, "--quiet")
    text = (tmp_path / "mug-silhouette.json").read_text()
    result = cairn2d.symmetry(picture)
    values = [float(x) for x in re.findall(r'"dissimilarity": ([\d.e-]+)', text)]
    assert len(values) == len(result.axes)
    assert np.allclose([axis.dissimilarity for axis in result.axes], values, atol=1e-5)


def test_skeleton_finds_the_parts_of_the_program(program, data, tmp_path):
    image = data / "images/swan.pgm"
    line = program("cairn", "skeleton", image, "-o", tmp_path)
    result = cairn2d.skeleton(image)
    assert f"{len(result.parts)} part" in line
    assert f"{len(result.boundaries)} contour" in line
    values = [
        float(x)
        for x in re.findall(r'"log_odds": (-?[\d.e]+)', (tmp_path / "swan.json").read_text())
    ]
    for part in result.parts:
        assert min(abs(part.log_odds - value) for value in values) < 1e-2


def test_evaluations_print_the_figures_of_the_program(program, data, tmp_path):
    log, truth = data / "logs/apartment.log", data / "logs/apartment.truth.csv"
    program("cairn", "map", log, "-o", tmp_path, "--quiet")
    true = np.genfromtxt(truth, delimiter=",", names=True)
    poses = np.genfromtxt(
        tmp_path / "poses.csv", delimiter=",", names=True, dtype=None, encoding=None
    )
    table = np.column_stack([poses[name] for name in ("x", "y", "theta")])
    expected = json.loads(
        program("cairn", "eval", "poses", tmp_path / "poses.csv", truth, "--json")
    )
    found = cairn2d.eval_poses(table, np.column_stack([true[name] for name in ("x", "y", "theta")]))
    assert found.x == pytest.approx(expected["e_x_m"], rel=1e-8)
    assert found.distance_most == pytest.approx(expected["distance_most_m"], rel=1e-8)
    expected = json.loads(
        program("cairn", "eval", "map", log, tmp_path / "poses.csv", "--json", "--quiet")
    )
    quality = cairn2d.eval_map(cairn2d.read(log), table)
    assert quality.entropy == pytest.approx(expected["entropy"], rel=1e-8)
    assert quality.log_likelihood == pytest.approx(expected["log_likelihood"], rel=1e-8)
    assert quality.beams == expected["beams"]


def test_info_counts_what_the_program_counts(program, data):
    line = program("cairn", "info", data / "logs/office.log")
    info = cairn2d.read(data / "logs/office.log").info
    assert str(info.scans) in line
    assert info.kind == "carmen"


def write_pgm(path: Path, pixels: np.ndarray) -> None:
    height, width = pixels.shape
    path.write_bytes(f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
