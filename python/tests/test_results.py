"""Results as plain values, and their arrays."""

import json

import numpy as np
import pytest

import cairn2d


@pytest.fixture(scope="module")
def results(drive, data):
    """Results of all kinds."""
    log = cairn2d.read(data / "logs/rescue.log")
    mapper = cairn2d.Mapper(beams=drive.beams)
    poses = [mapper.add(scan) for scan in drive[:10]]
    mapped = cairn2d.map(drive[:10])
    swan, shape = data / "images/swan.pgm", data / "shapes/swan.shape"
    edges = cairn2d.edges(swan)
    detections = cairn2d.detect(edges, shape)
    skeleton = cairn2d.skeleton(swan)
    symmetry = cairn2d.symmetry(data / "shapes/swan-silhouette.pgm")
    match = cairn2d.match(drive[0], drive[1])
    relative = cairn2d.Pose(1, 2, 3)
    topic = cairn2d.LogTopic("/scan", "sensor_msgs/LaserScan", 2, 2)
    mounting = cairn2d.Mounting(None, "base_link", "laser", False, False, False, 0.0)
    return [
        poses[-1],
        cairn2d.LoopEvent(0, 1, relative, "accepted", 0.004),
        mapped,
        mapped.grid,
        mapped.graph,
        mapped.graph.solve(),
        cairn2d.align(drive[:4]),
        match,
        match.hypotheses[0],
        cairn2d.icp(drive[0], drive[1]),
        cairn2d.merge([data / f"maps/robot{i}.yaml" for i in (1, 2)]),
        cairn2d.PlacedMap(relative, True, "placed", 1.0, 0.5, 0.1, 0),
        cairn2d.eval_poses(drive.truth, drive.odometry),
        cairn2d.eval_map(drive[:4]),
        cairn2d.RelationErrors(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1, 0),
        log.info,
        topic,
        mounting,
        cairn2d.LogSources(topic, None, None, mounting, [topic]),
        log.check(),
        cairn2d.ShapeModel.read(shape),
        detections,
        detections[0],
        cairn2d.contours(edges, shape)[0],
        skeleton,
        skeleton.parts[0],
        skeleton.boundaries[0],
        symmetry,
        symmetry.axes[0],
        cairn2d.polyline(np.random.default_rng(1).random((30, 2))),
    ]


def test_every_result_is_plain_values_of_json(results):
    for result in results:
        values = json.loads(json.dumps(result.to_dict()))
        assert values
    public = [getattr(cairn2d, name) for name in cairn2d.__all__]
    kinds = {kind for kind in public if isinstance(kind, type) and hasattr(kind, "to_dict")}
    assert kinds == {type(result) for result in results}


def test_every_result_is_shown_in_few_lines(results):
    for result in results:
        shown = repr(result)
        assert type(result).__name__ in shown
        assert shown.count("\n") < 60, shown


def test_a_map_as_plain_values_has_its_graph(results):
    mapped = next(r for r in results if isinstance(r, cairn2d.MapResult))
    values = mapped.to_dict()
    assert values["graph"]["relative"] == mapped.graph.relative.tolist()
    assert values["trajectory"] == mapped.trajectory.tolist()
    assert not [name for name in values if name.startswith("_")]


def test_an_optimized_graph_keeps_that_it_is_chained(data):
    graph = cairn2d.PoseGraph.read(data / "graphs/apartment.g2o")
    graph.chained = True
    assert graph.solve().graph.chained
