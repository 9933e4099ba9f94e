"""Values that make no sense are refused with their name before any work."""

import numpy as np
import pytest

import cairn2d


def test_a_picture_of_floats_is_refused_and_not_taken_for_black():
    image = np.linspace(0, 1, 100).reshape(10, 10)
    for call in (cairn2d.edges, cairn2d.edgels, cairn2d.skeleton, cairn2d.symmetry):
        with pytest.raises(cairn2d.BadArgumentError, match="255"):
            call(image)
    with pytest.raises(cairn2d.BadArgumentError, match="255"):
        cairn2d.edges(np.dstack([image] * 3))
    assert cairn2d.edges(np.rint(255 * image)).shape == (10, 10)


def test_numbers_that_a_type_does_not_hold_are_refused_and_do_not_wrap():
    square = np.zeros((40, 40), bool)
    square[10:30, 8:32] = True
    for value in (300, -1, 0.5, np.nan):
        with pytest.raises(cairn2d.BadArgumentError, match="edges has values"):
            cairn2d.contours(np.full((20, 20), value), square)
    with pytest.raises(cairn2d.BadArgumentError, match="edges has values"):
        cairn2d.PoseGraph.of(np.zeros((2, 3)), [[0, 0.5]], np.zeros((1, 3)), [np.eye(3)])


def test_cells_of_a_grid_are_unknown_or_a_percentage():
    for value in (-2, 101, 0.5):
        with pytest.raises(cairn2d.BadArgumentError, match="occupancy has values"):
            cairn2d.Grid(np.full((4, 5), value))
    assert cairn2d.Grid([[-1, 0, 100]]).shape == (1, 3)


def test_a_beam_has_two_coordinates():
    grid = cairn2d.OccupancyGrid(20, 20, 0.5, (0, 0))
    with pytest.raises(cairn2d.BadArgumentError, match="start"):
        grid.add_beam((1, 2, 3), (1, 2), True)
    with pytest.raises(cairn2d.BadArgumentError, match="end"):
        grid.add_beam((1, 2), 1, True)
    with pytest.raises(cairn2d.BadArgumentError, match="origin"):
        cairn2d.OccupancyGrid(20, 20, 0.5, (0, 0, 0))


def test_corrections_of_a_scanner_are_refused_by_their_names(data):
    path = data / "logs/rescue.log"
    wrong = {
        "range_max": -1,
        "range_scale": 0,
        "angle_step": -0.1,
        "sweep": 3,
        "sensor": (np.nan, 0, 0),
    }
    for name, value in wrong.items():
        with pytest.raises(cairn2d.BadArgumentError, match=name):
            cairn2d.read(path, **{name: value})


def test_a_log_without_scans_is_neither_checked_nor_saved(tmp_path):
    log = cairn2d.Log([], "nothing")
    for call in (log.check, lambda: log.save(tmp_path / "scans.csv")):
        with pytest.raises(cairn2d.EmptyError, match="nothing has no scan"):
            call()


def test_scans_of_different_bearings_make_no_table(drive, tmp_path):
    log = cairn2d.Log([drive[0], cairn2d.Scan(np.ones(5, np.float32))])
    with pytest.raises(cairn2d.BadFormatError, match="bearings"):
        log.save(tmp_path / "scans.csv")
    assert list(tmp_path.iterdir()) == []


MAP_SETTINGS = [
    {"resolution": -1},
    {"resolution": 0},
    {"resolution": np.nan},
    {"range": 0},
    {"range": -3},
    {"clear": -1},
]


@pytest.mark.parametrize(
    "settings",
    [
        *MAP_SETTINGS,
        {"particles": -1},
        {"sweep": np.nan},
        {"sweep": np.inf},
        {"seed": -1},
        {"window": -1},
    ],
)
def test_settings_of_a_map_are_refused_before_any_scan_is_mapped(drive, settings):
    # Reading a scan would fail in another way.
    log = cairn2d.Log([object()], "never mapped")
    name = next(iter(settings))
    with pytest.raises(cairn2d.BadArgumentError, match=f"^{name} is"):
        cairn2d.map(log, **settings)
    assert len(cairn2d.map(drive[:2]).trajectory) == 2


@pytest.mark.parametrize(
    "settings", [*MAP_SETTINGS, {"headings": -1}, {"steps": 0}, {"spread": (-0.1, 1)}]
)
def test_settings_of_an_alignment_are_refused_before_any_scan_is_aligned(settings):
    name = next(iter(settings))
    with pytest.raises(cairn2d.BadArgumentError, match=f"^{name} is"):
        cairn2d.align(cairn2d.Log([object()], "never aligned"), **settings)


@pytest.mark.parametrize("settings", MAP_SETTINGS)
def test_settings_of_a_mappers_grid_are_refused(drive, settings):
    mapper = cairn2d.Mapper(beams=drive.beams)
    mapper.add(drive[0])
    name = next(iter(settings))
    with pytest.raises(cairn2d.BadArgumentError, match=f"^{name} is"):
        mapper.grid(**settings)


def test_seeds_below_zero_are_refused_by_name():
    with pytest.raises(cairn2d.BadArgumentError, match=r"^seed is -1"):
        cairn2d.arena("rooms", seed=-1)
    with pytest.raises(cairn2d.BadArgumentError, match=r"^seed is -2"):
        cairn2d.arena("rooms").drive(2, seed=-2)


@pytest.mark.parametrize("settings", [*MAP_SETTINGS[:5], {"least": 0}, {"least": 2}])
def test_settings_of_an_evaluation_are_refused_by_name(settings):
    name = next(iter(settings))
    with pytest.raises(cairn2d.BadArgumentError, match=f"^{name} is"):
        cairn2d.eval_map(cairn2d.Log([object()], "never read"), **settings)


@pytest.mark.parametrize(
    "settings",
    [
        {"coarsen": -1},
        {"coarsen": 65},
        {"scale": [0.1]},
        {"scale": [0.1, 0]},
        {"start": [None] * 3},
        {"perception": "neither"},
    ],
)
def test_settings_of_a_merging_are_refused_by_name(data, settings):
    maps = [data / f"maps/robot{i}.yaml" for i in (1, 2)]
    with pytest.raises(cairn2d.BadArgumentError, match=f"^{next(iter(settings))} "):
        cairn2d.merge(maps, **settings)


def test_a_grid_lies_at_a_finite_place():
    cells = np.zeros((2, 2), np.int8)
    with pytest.raises(cairn2d.BadArgumentError, match=r"^origin"):
        cairn2d.Grid(cells, 0.05, (np.nan, 0, 0))
    for resolution in (0, -1, np.inf, np.nan):
        with pytest.raises(cairn2d.BadArgumentError, match=r"^resolution is"):
            cairn2d.Grid(cells, resolution)


def test_a_graph_without_vertices_is_not_solved():
    graph = cairn2d.PoseGraph.of(
        np.empty((0, 3)), np.empty((0, 2)), np.empty((0, 3)), np.empty((0, 3, 3))
    )
    with pytest.raises(cairn2d.EmptyError, match="vertex"):
        graph.solve()


SQUARE = np.zeros((60, 60), bool)
SQUARE[20:40, 15:45] = True


@pytest.mark.parametrize(
    ("call", "settings", "words"),
    [
        (cairn2d.detect, {"method": "both"}, "method"),
        (cairn2d.detect, {"as_written": True, "method": "evidence"}, "as_written"),
        (cairn2d.detect, {"as_written": True, "mirror": True}, "mirror with as_written"),
        (cairn2d.detect, {"bundles": "two"}, "bundles"),
        (cairn2d.detect, {"image": SQUARE}, "appearance"),
        (cairn2d.detect, {"cuts": [[0, 1]]}, "cuts"),
        (cairn2d.contours, {"as_written": True}, "min_size"),
        (cairn2d.contours, {"as_written": True, "mirror": True}, "mirror"),
        (
            cairn2d.contours,
            {"as_written": True, "min_size": 9, "max_size": 9, "min_turn": 0},
            "min_turn with as_written",
        ),
        (cairn2d.contours, {"strong": 1}, "strong"),
        (cairn2d.contours, {"tokens": "points"}, "tokens"),
    ],
)
def test_settings_of_a_search_are_refused_by_name(call, settings, words):
    with pytest.raises(cairn2d.BadArgumentError, match=words):
        call(np.zeros((60, 60), np.uint8), SQUARE, **settings)


def test_settings_of_a_skeleton_and_of_edges_are_refused_by_name():
    with pytest.raises(cairn2d.BadArgumentError, match="radii and learn"):
        cairn2d.skeleton(SQUARE, radii=(3, 9), learn=[SQUARE])
    with pytest.raises(cairn2d.EmptyError, match="learn"):
        cairn2d.skeleton(SQUARE, learn=[])
    with pytest.raises(cairn2d.BadArgumentError, match="detector"):
        cairn2d.edges(SQUARE, "sobel")
