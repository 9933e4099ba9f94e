"""The results of the package are those of the programs, bit for bit."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

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
    for hypothesis, expected in zip(result.hypotheses, hypotheses):
        pose = [expected[name] for name in ("x", "y", "theta")]
        assert hypothesis.pose == pytest.approx(pose, rel=1e-8, abs=1e-12)
        assert hypothesis.score == pytest.approx(expected["score"], rel=1e-8)
        assert hypothesis.observable == expected["observable"]
        covariance = np.array(expected["covariance"], np.float64)
        assert hypothesis.covariance.ravel() == pytest.approx(covariance, rel=1e-8)


def test_graph_writes_the_file_of_the_program(program, data, tmp_path):
    path = data / "graphs/apartment.g2o"
    program("cairn", "graph", path, "-o", tmp_path / "c.g2o", "--quiet")
    cairn2d.PoseGraph.read(path).solve().graph.save(tmp_path / "python.g2o")
    assert (tmp_path / "c.g2o").read_bytes() == (tmp_path / "python.g2o").read_bytes()


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        ((), {}),
        (("--perception", "images"), {"perception": "images"}),
        (("--scale", "0.06,0.06,0.06"), {"scale": [0.06] * 3}),
    ],
)
def test_merge_writes_the_map_of_the_program(program, data, tmp_path, options, keywords):
    maps = [data / f"maps/robot{i}.yaml" for i in (1, 2, 3)]
    program("cairn", "merge", *maps, "-o", tmp_path, "--quiet", *options)
    result = cairn2d.merge(maps, **keywords)
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


# Of numbers that the files of the command hold with two and four decimals.
TWO, FOUR = 0.0051, 0.000051


def run_on_edges(program, command, data, folder, *options) -> tuple[np.ndarray, Path, dict]:
    """Runs a command on the edges of the mug; returns the edges, the model and the JSON."""
    image, shape = data / "images/mug.pgm", data / "shapes/mug.shape"
    edges = cairn2d.edges(image)
    write_pgm(folder / "edges.pgm", edges)
    given = ("--model", shape, "--edges", folder / "edges.pgm", "-o", folder, "--quiet")
    program("cairn", command, image, *given, *options)
    return edges, shape, json.loads((folder / "mug.json").read_text())


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        ((), {}),
        (("--no-mirror", "--min-score", 1), {"mirror": False, "min_score": 1}),
        (("--method", "parts"), {"method": "parts"}),
        (
            ("--method", "parts", "--bundles", "none", "--min-score", -100),
            {"method": "parts", "bundles": "none", "min_score": -100},
        ),
        (("--as-written",), {"as_written": True}),
    ],
)
def test_detect_finds_the_boxes_of_the_program(program, data, tmp_path, options, keywords):
    edges, shape, written = run_on_edges(program, "detect", data, tmp_path, *options)
    found = written["detections"]
    detections = cairn2d.detect(edges, shape, **keywords)
    assert len(detections) == len(found) > 0
    for detection, expected in zip(detections, found):
        assert detection.score == pytest.approx(expected["score"], abs=FOUR)
        assert np.allclose(detection.box, expected["box"], rtol=0, atol=TWO)
        assert detection.mirrored == expected["mirrored"]
        assert detection.size == pytest.approx(expected["size"], abs=TWO)
        outline = np.array(expected["outline"], float).reshape(-1, 3)[:, :2]
        assert np.allclose(detection.outline, outline, rtol=0, atol=TWO)


def test_fragments_by_hand_are_those_of_the_program(program, data, tmp_path):
    cuts = [(0, 20, 0), (20, 40, 1), (40, 60, 2)]
    (tmp_path / "cuts").write_text("".join(f"{a} {b} {c}\n" for a, b, c in cuts))
    options = ("--method", "parts", "--cuts", tmp_path / "cuts")
    edges, shape, written = run_on_edges(program, "detect", data, tmp_path, *options)
    detections = cairn2d.detect(edges, shape, method="parts", cuts=cuts)
    assert [d.score for d in detections] == pytest.approx(
        [d["score"] for d in written["detections"]], abs=FOUR
    )
    picture = ("--svg", tmp_path / "c.svg", "--parts", tmp_path / "parts.svg")
    given = (*picture, "--cuts", tmp_path / "cuts", "-o", tmp_path / "c.shape", "--quiet")
    program("cairn", "model", shape, *given)
    model = cairn2d.ShapeModel.read(shape)
    model.draw(tmp_path / "python.svg", "mug.shape")
    model.draw_parts(tmp_path / "python-parts.svg", cuts, "mug.shape")
    assert (tmp_path / "python.svg").read_bytes() == (tmp_path / "c.svg").read_bytes()
    assert (tmp_path / "python-parts.svg").read_bytes() == (tmp_path / "parts.svg").read_bytes()


def test_appearance_lowers_the_scores_of_the_program(program, data, tmp_path):
    images = [data / f"images/{name}.pgm" for name in ("mug", "swan")]
    box = json.loads(images[0].with_suffix(".json").read_text())["box"]
    try:
        look = cairn2d.train(images, [[box], np.empty((0, 4))], words=16)
    except cairn2d.UnsupportedError as error:
        pytest.skip(str(error))
    look.save(tmp_path / "look")
    options = ("--appearance", tmp_path / "look", "--lambda", 2)
    edges, shape, written = run_on_edges(program, "detect", data, tmp_path, *options)
    detections = cairn2d.detect(
        edges, shape, appearance=look, image=images[0], appearance_weight=2.0
    )
    scores = [detection.score for detection in detections]
    assert scores == pytest.approx([d["score"] for d in written["detections"]], abs=FOUR)
    assert scores != [detection.score for detection in cairn2d.detect(edges, shape)]


def test_edges_by_canny_are_those_of_the_command(program, data, tmp_path):
    image, shape = data / "images/mug.pgm", data / "shapes/mug.shape"
    try:
        edges = cairn2d.edges(image, "canny", sigma=1.2, low=2.0, high=6.0)
    except cairn2d.UnsupportedError as error:
        pytest.skip(str(error))
    options = ("--sigma", 1.2, "--low", 2, "--high", 6)
    program("cairn", "detect", image, "--model", shape, "-o", tmp_path, "--quiet", *options)
    written = json.loads((tmp_path / "mug.json").read_text())
    scores = [detection.score for detection in cairn2d.detect(edges, shape)]
    assert scores == pytest.approx([d["score"] for d in written["detections"]], abs=FOUR)


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        ((), {}),
        (("--tokens", "edgels", "--no-mirror"), {"tokens": "edgels", "mirror": False}),
        (
            ("--as-written", "--scale", "130:160", "--strong", 0.8),
            {"as_written": True, "min_size": 130, "max_size": 160, "strong": 0.8},
        ),
    ],
)
def test_contours_are_those_of_the_program(program, data, tmp_path, options, keywords):
    edges, shape, written = run_on_edges(program, "group", data, tmp_path, *options)
    contours = cairn2d.contours(edges, shape, **keywords)
    assert len(contours) == len(written["objects"]) > 0
    for contour, expected in zip(contours, written["objects"]):
        assert contour.score == pytest.approx(expected["evidence"], abs=TWO)
        assert contour.matched == pytest.approx(expected["score"], abs=FOUR)
        assert contour.size == pytest.approx(expected["size"], abs=TWO)
        assert contour.pose[:2] == pytest.approx((expected["x"], expected["y"]), abs=TWO)
        assert np.degrees(contour.pose.theta) == pytest.approx(expected["turn_deg"], abs=TWO)
        assert contour.mirrored == expected["mirrored"]
        lines = np.array([segment["line"] for segment in expected["segments"]]).reshape(-1, 2, 2)
        assert np.allclose(contour.segments, lines, rtol=0, atol=TWO)


def test_symmetry_finds_the_axes_of_the_program(program, data, tmp_path):
    picture = data / "shapes/mug-silhouette.pgm"
    program("cairn", "symmetry", picture, "-o", tmp_path, "--quiet")
    axes = json.loads((tmp_path / "mug-silhouette.json").read_text())["axes"]
    result = cairn2d.symmetry(picture)
    assert len(result.axes) == len(axes) > 0
    for axis, expected in zip(result.axes, axes):
        assert axis.dissimilarity == pytest.approx(expected["dissimilarity"], abs=0.51e-6)
        assert np.allclose(axis.ends, expected["ends"], rtol=0, atol=TWO)
        assert np.degrees(axis.bend) == pytest.approx(expected["bend_deg"], abs=TWO)
        assert axis.skew == pytest.approx(expected["skew"], abs=FOUR)


def without_straight_points(boundary: cairn2d.Boundary) -> np.ndarray:
    """Returns the corners at which a contour ends or changes its direction."""
    points = boundary.points
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    is_corner = (before != after).all(axis=1) | (before == after).all(axis=1)
    if not boundary.closed:
        is_corner[[0, -1]] = True
    return points[is_corner]


@pytest.mark.parametrize("learns", [False, True])
def test_skeleton_finds_the_parts_of_the_program(program, data, tmp_path, learns):
    image = data / "images/swan.pgm"
    options, keywords = [], {}
    if learns:
        folder = tmp_path / "drawings"
        folder.mkdir()
        drawings = [data / f"shapes/{name}-drawing.pgm" for name in ("swan", "mug")]
        for drawing in drawings:
            shutil.copy(drawing, folder)
        options, keywords = ["--learn", folder], {"learn": drawings}
    program("cairn", "skeleton", image, "-o", tmp_path, "--quiet", *options)
    written = json.loads((tmp_path / "swan.json").read_text())
    result = cairn2d.skeleton(image, **keywords)
    assert result.radii == pytest.approx((written["min_radius"], written["max_radius"]), abs=TWO)
    assert len(result.parts) == len(written["parts"]) > 0
    for part, expected in zip(result.parts, written["parts"]):
        assert part.log_odds == pytest.approx(expected["log_odds"], abs=TWO)
        assert part.object == expected["object"]
        assert np.allclose(part.discs, expected["axis"], rtol=0, atol=TWO)
    assert len(result.boundaries) == len(written["contours"]) > 0
    for boundary, expected in zip(result.boundaries, written["contours"]):
        assert boundary.strength == pytest.approx(expected["strength"], abs=TWO)
        assert boundary.closed == expected["closed"]
        assert np.array_equal(without_straight_points(boundary), expected["points"])


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


def test_the_sources_of_a_bag_are_those_of_the_program(program, tmp_path):
    path = tmp_path / "small.bag"
    path.write_bytes(subprocess.check_output([sys.executable, ROOT / "tools/small-bag.py"]))
    found = json.loads(program("cairn", "info", path, "--json"))["sources"]
    sources = cairn2d.read(path).info.sources
    for name in ("scans", "odometry"):
        topic = getattr(sources, name).to_dict()
        assert topic == {key: value for key, value in found[name].items() if key != "frame"}
    assert sources.odometry_frame == found["odometry"]["frame"] == "odom"
    mounting = sources.mounting.to_dict()
    assert np.degrees(mounting.pop("tilt")) == found["mounting"].pop("tilt_deg") == 0
    assert mounting == found["mounting"]
    assert [topic.to_dict() for topic in sources.topics] == found["topics"]
    assert len(sources.topics) == 3


def test_info_counts_what_the_program_counts(program, data):
    log = data / "logs/office.log"
    found = json.loads(program("cairn", "info", log, "--json"))
    info = cairn2d.read(log).info
    assert info.kind == found["kind"] == "carmen"
    assert info.taken == (found["taken"] or "")
    counts = ("scans", "ignored", "min_beams", "max_beams", "backward_stamps")
    assert {name: getattr(info, name) for name in counts} == {name: found[name] for name in counts}
    assert info.faults == found["damaged"]
    assert info.duration == pytest.approx(found["duration_s"], rel=1e-8)
    assert info.path_length == pytest.approx(found["path_m"], rel=1e-8)
    assert info.path_turn == pytest.approx(np.radians(found["turn_deg"]), rel=1e-8)
    assert info.range_max == pytest.approx(found["range_max_m"], rel=1e-6)
    sensor = found["sensor"]
    assert info.sensor == pytest.approx(list(sensor.values()), abs=1e-8)
    assert info.origin == tuple(found["origin_m"])


CORRECTIONS = [
    (("--flip", "--range-scale", 0.5), {"flip": True, "range_scale": 0.5}),
    (
        ("--angle-step", 0.9, "--sensor", "0.1,-0.2,15", "--sweep", -0.04),
        {"angle_step": np.radians(0.9), "sensor": (0.1, -0.2, np.radians(15)), "sweep": -0.04},
    ),
    (("--range-scale", 2, "--range-max", 7), {"range_scale": 2, "range_max": 7}),
]


@pytest.mark.parametrize(("options", "keywords"), CORRECTIONS)
def test_a_corrected_log_gives_the_files_of_the_program(program, data, tmp_path, options, keywords):
    log = data / "logs/apartment.log"
    program("cairn", "map", log, "-o", tmp_path / "c", "--quiet", "--no-loops", *options)
    result = cairn2d.map(cairn2d.read(log, **keywords), loops=False)
    result.save(tmp_path / "python")
    same_files(tmp_path / "c", tmp_path / "python")
    plain = cairn2d.map(cairn2d.read(log), loops=False)
    assert not np.array_equal(plain.trajectory, result.trajectory)


@pytest.mark.parametrize(
    ("options", "keywords", "fault"),
    [
        ((), {}, None),
        (("--flip",), {"flip": True}, "flip"),
        (("--range-scale", 1000), {"range_scale": 1000}, "range_scale"),
        (("--sensor", "0,0,40"), {"sensor": (0, 0, np.radians(40))}, "sensor"),
    ],
)
def test_the_check_of_the_scanner_finds_what_the_program_finds(
    program, data, options, keywords, fault
):
    path = data / "logs/apartment.log"
    text = program("cairn", "info", path, "--check", "--json", "--quiet", *options)
    expected = json.loads(text)["check"]
    check = cairn2d.read(path, **keywords).check()
    assert check.faults == [found["fault"] for found in expected["faults"]]
    for name in ("pairs", "turns", "walls", "repeated"):
        assert getattr(check, name) == expected[name]
    assert check.constant == expected["equal_stamps"]
    assert check.median_range == pytest.approx(expected["median_range"], rel=1e-8)
    assert check.range_scale == pytest.approx(expected["range_scale"], rel=1e-8)
    degrees = 180 / np.pi
    estimates = {
        "turn_ratio": (check.turn_ratio, 1),
        "distance_ratio": (check.distance_ratio, 1),
        "angle_step_deg": (check.step_ratio, check.angle_step * degrees),
        "overlap_angle_step_deg": (check.overlap_step_ratio, check.angle_step * degrees),
        "sweep_s": (check.sweep_found, 1),
        "sensor_x_m": (check.x, 1),
        "sensor_theta_deg": (check.theta, degrees),
    }
    for name, (estimate, unit) in estimates.items():
        if expected[name] is None:
            assert estimate is None
        else:
            assert estimate.value * unit == pytest.approx(expected[name]["value"], rel=1e-8)
            assert estimate.sigma * unit == pytest.approx(expected[name]["sigma"], rel=1e-8)
    if fault is not None:
        assert fault in check.faults
        assert set(check.corrections) <= set(check.faults)
        assert fault in check.corrections


def test_a_log_is_saved_as_the_table_of_the_program(program, data, drive, tmp_path):
    log = data / "logs/rescue.log"
    program("cairn", "info", log, "--scans", tmp_path / "c.csv")
    cairn2d.read(log).save(tmp_path / "python.csv")
    assert (tmp_path / "python.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()
    cairn2d.Log(list(cairn2d.read(log))).save(tmp_path / "copy.csv")
    assert (tmp_path / "copy.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()
    drive.save(tmp_path / "drive.csv")
    again = cairn2d.read(tmp_path / "drive.csv", range_max=drive[0].range_max)
    for first, second in zip(again, drive):
        assert np.array_equal(first.ranges, second.ranges, equal_nan=True)
    assert np.allclose(again.odometry, drive.odometry, atol=1e-9)


def write_pgm(path: Path, pixels: np.ndarray) -> None:
    height, width = pixels.shape
    path.write_bytes(f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
