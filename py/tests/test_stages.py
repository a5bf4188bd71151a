"""Every stage called alone, held against the simulator's truth."""

import numpy as np
import pytest

import netpose_rs as npr
from conftest import noted

#: A contour junction lies within this of the true knot, px.
JUNCTION_PX = 2.0
#: Whole cells between the ends of a short motion must not be lost: half a cell is 12 px.
SHIFT_PX = 0.3

NAN = float("nan")


def test_scenarios_have_names_and_descriptions() -> None:
    names = [name for name, description in npr.sim.scenarios() if description]
    assert "plain" in names and len(names) == len(set(names)) > 10


def test_a_simulated_frame_has_its_truth(plain: npr.sim.SimFrame) -> None:
    assert plain.image.shape == (480, 848) and plain.image.dtype == np.uint8
    assert plain.image is plain.image
    assert plain.mesh.sides == (0.05, 0.05) and plain.camera.width == 848
    assert plain.range_m == pytest.approx(1.2)
    assert plain.crossing_angle == pytest.approx(np.pi / 2) and plain.curvatures_per_m == (0.0, 0.0)
    assert len(plain.nodes) == len(plain.lattice) == len(plain.visible) > 100
    # Nodes are where pose, mesh and camera put them.
    pose = plain.pose
    assert pose is not None and plain.normal is not None
    assert pose[:3, 2] == pytest.approx(plain.normal)
    points = np.column_stack([plain.lattice * 0.05, np.zeros(len(plain.lattice))]) @ pose[:3, :3].T + pose[:3, 3]
    pixels = points[:, :2] / points[:, 2:] * 600 + [424, 240]
    assert plain.nodes == pytest.approx(pixels, abs=1e-6)


def test_same_seed_same_bytes(plain: npr.sim.SimFrame) -> None:
    assert np.array_equal(npr.sim.render("plain").image, plain.image)
    assert not np.array_equal(npr.sim.render("plain", seed=99).image, plain.image)
    assert npr.sim.render("strafe", 1).timestamp_ns - npr.sim.render("strafe").timestamp_ns == 100_000_000


def test_random_scenes_and_scenes_without_a_net() -> None:
    assert npr.sim.render("study-hung-3").crossing_angle is not None
    water = npr.sim.render("study-negative-3")
    assert water.pose is None and water.range_m is None and water.normal is None and water.nodes.shape == (0, 2)
    assert water.lattice.shape == (0, 2) and water.visible.shape == (0,)


def test_unknown_scenarios_are_named() -> None:
    with pytest.raises(ValueError, match="scenario.*atlantis"):
        npr.sim.render("atlantis")
    with pytest.raises(OverflowError, match=noted("frame")):
        npr.sim.render("plain", -1)
    with pytest.raises(TypeError, match=noted("seed")):
        npr.sim.render("plain", seed=0.5)  # type: ignore[arg-type]


def test_spectrum_peaks_lie_at_the_lattices_wave_vectors(plain: npr.sim.SimFrame) -> None:
    spectrum = npr.fft.spectrum(plain.image)
    assert spectrum.shape == plain.image.shape and spectrum.dtype == np.uint8
    peaks = npr.fft.peaks(spectrum)
    assert peaks.shape[1] == 3 and len(peaks) > 2
    scores = npr.fft.scores(spectrum)
    assert scores.shape[1] == 7 and np.all(np.diff(scores[:, 6]) <= 0)
    best = scores[:8, :2] / [plain.image.shape[1], plain.image.shape[0]]
    # The plain net faces the camera: its cell is f * cell / range.
    assert plain.range_m is not None
    cell_px = plain.camera.fx * plain.mesh.sides[0] / plain.range_m
    assert np.abs(np.hypot(*best.T) * cell_px - 1).min() < 0.03


def test_a_wave_has_its_peak_where_it_should() -> None:
    # 40 cycles across the width and 15 down the height.
    v, u = np.mgrid[:240, :320]
    wave = (128 + 100 * np.cos(2 * np.pi * (40 * u / 320 + 15 * v / 240))).astype(np.uint8)
    spectrum = npr.fft.spectrum(wave, blur=False).astype(int)
    spectrum[120 - 4 : 120 + 5, 160 - 4 : 160 + 5] = 0
    row, column = divmod(int(spectrum.argmax()), 320)
    assert (abs(column - 160), abs(row - 120)) == (40, 15)
    # Both ends of it are alike, and the other diagonal is empty.
    assert spectrum[120 + 15, 160 + 40] == spectrum[120 - 15, 160 - 40] > spectrum[120 - 15, 160 + 40]


@pytest.mark.parametrize(
    ("name", "value"),
    [("neighbourhood", 0), ("neighbourhood", 1), ("cluster", NAN), ("cluster", -1.0), ("threshold", 300), ("threshold", 0.5)],
)
def test_peaks_name_what_is_wrong(name: str, value: float) -> None:
    spectrum = np.zeros((60, 80), np.uint8)
    for find in (npr.fft.peaks, npr.fft.scores):
        with pytest.raises((ValueError, TypeError, OverflowError), match=noted(name)):
            find(spectrum, **{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value"), [("ellipse", NAN), ("ellipse", 0.0), ("constant_radius", NAN), ("constant_radius", -1.0)]
)
def test_scores_name_what_is_wrong(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        npr.fft.scores(np.zeros((60, 80), np.uint8), **{name: value})  # type: ignore[arg-type]


def test_sections_see_the_net_one_by_one(plain: npr.sim.SimFrame) -> None:
    seen = npr.fft.sections(plain.image, plain.camera, plain.mesh)
    count = len(seen.chosen)
    assert count > 4 and seen.probability is not None and seen.probability > 0.5
    assert seen.centres.shape == (count, 2) and seen.confidence.shape == (count, 2)
    # Lattice vectors are the inverse transpose of wave vectors.
    assert seen.basis @ seen.waves.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(2), (count, 2, 2)), abs=1e-6)
    # A peak is read to a few hundredths of a bin, of some ten: each cell's distance is right to a few percent.
    chosen = seen.poses[np.arange(count), seen.chosen]
    assert plain.range_m is not None
    assert np.median(chosen[:, 2, 3]) == pytest.approx(plain.range_m, rel=0.03)
    water = npr.fft.sections(np.full_like(plain.image, 90), plain.camera, plain.mesh)
    assert water.poses.shape[1:] == (2, 4, 4) and (water.probability or 0) < 0.5
    with pytest.raises(ValueError, match="image"):
        npr.fft.sections(plain.image[:100], plain.camera, plain.mesh)


def test_lattice_vectors_are_dual_to_wave_vectors() -> None:
    k = np.array([[0.03, 0.004], [-0.006, 0.04]])
    assert npr.fft.lattice_vectors((0.03, 0.004), (-0.006, 0.04)) @ k.T == pytest.approx(np.eye(2))
    with pytest.raises(ValueError, match="k1, k2.*parallel"):
        npr.fft.lattice_vectors((0.1, 0.0), (0.2, 0.0))
    with pytest.raises(ValueError, match="k2"):
        npr.fft.lattice_vectors((0.1, 0.0), (NAN, 0.2))
    with pytest.raises((TypeError, ValueError), match=noted("k1")):
        npr.fft.lattice_vectors((0.1, 0.0, 0.3), (0.0, 0.2))  # type: ignore[arg-type]


def distances(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """From each point to the nearest node."""
    return np.asarray(np.linalg.norm(points[:, None] - nodes[None], axis=2).min(axis=1))


def test_junctions_are_knots(plain: npr.sim.SimFrame) -> None:
    alone = npr.junction.detect(plain.image)
    told = npr.junction.detect(plain.image, plain.camera, plain.mesh, plain.pose)
    for found in (alone, told):
        count = len(found.pixels)
        assert count > 0.5 * len(plain.nodes)
        assert found.lattice.shape == (count, 2) and found.sigma_px.shape == (count,) and found.boxes.shape[1:] == (4, 2)
        assert np.median(distances(found.pixels, plain.nodes)) < JUNCTION_PX
        assert np.all(found.sigma_px > 0)
    # With a pose they have the names that the pose gives.
    unnamed = np.iinfo(np.int32).min
    named = told.lattice[:, 0] != unnamed
    assert named.mean() > 0.5
    # Without one they are counted from some junction: one turn and shift takes those names to the true ones, for nearly all.
    known = alone.lattice[:, 0] != unnamed
    truth = plain.lattice[np.linalg.norm(alone.pixels[:, None] - plain.nodes[None], axis=2).argmin(axis=1)][known]
    rows = np.column_stack([alone.lattice[known], np.ones(known.sum())])
    turn = np.round(np.linalg.lstsq(rows, truth.astype(float), rcond=None)[0])
    assert np.all(rows @ turn == truth, axis=1).mean() > 0.95
    by_name = {tuple(index): pixel for index, pixel in zip(plain.lattice, plain.nodes, strict=True)}
    # Some lie just outside the picture, where truth lists none.
    pairs = zip(told.pixels[named], told.lattice[named], strict=True)
    offsets = [np.linalg.norm(p - by_name[tuple(i)]) for p, i in pairs if tuple(i) in by_name]
    assert len(offsets) > 0.5 * len(plain.nodes) and np.median(offsets) < JUNCTION_PX


def test_junctions_want_camera_mesh_and_pose_together(plain: npr.sim.SimFrame) -> None:
    with pytest.raises(ValueError, match="all three or none"):
        npr.junction.detect(plain.image, plain.camera)
    for pose, words in (
        (2 * np.eye(4), "pose.*rotation"),
        (np.eye(3), r"pose.*\(4, 4\)"),
        (np.full((4, 4), NAN), "pose.*finite"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "pose.*rotation"),
    ):
        with pytest.raises(ValueError, match=words):
            npr.junction.detect(plain.image, plain.camera, plain.mesh, pose)
    with pytest.raises(TypeError, match="^pose: .*float64.*float32"):
        npr.junction.detect(plain.image, plain.camera, plain.mesh, np.eye(4, dtype=np.float32))
    # However the pose lies in memory.
    assert plain.pose is not None
    told = npr.junction.detect(plain.image, plain.camera, plain.mesh, plain.pose)
    again = npr.junction.detect(plain.image, plain.camera, plain.mesh, np.asfortranarray(plain.pose))
    assert np.array_equal(told.pixels, again.pixels)


def test_points_are_found_where_they_went(plain: npr.sim.SimFrame) -> None:
    shifted = np.roll(plain.image, (2, 3), axis=(0, 1))
    points = np.array([[300.0, 200.0], [400.0, 250.0], [500.5, 300.25]])
    matches = npr.flow.match_points(plain.image, shifted, points)
    assert matches.found.all() and matches.found.dtype == bool
    assert matches.scores.shape == (3,) and matches.scores.min() > 0.9
    # A point on a regular net is found modulo a cell.
    assert plain.range_m is not None
    cell_px = plain.camera.fx * plain.mesh.sides[0] / plain.range_m
    rest = (matches.pixels - points - [3.0, 2.0]) / cell_px
    assert np.abs(rest - np.round(rest)).max() < 0.01
    backwards = npr.flow.match_points(plain.image, shifted, points[::-1])
    assert np.array_equal(backwards.pixels[::-1], matches.pixels)
    assert npr.flow.match_points(plain.image, shifted, np.zeros((0, 2))).pixels.shape == (0, 2)


def test_points_that_are_none_are_named(plain: npr.sim.SimFrame) -> None:
    for points, error in (
        (np.zeros((3, 3)), ValueError),
        (np.array([[10.0, NAN]]), ValueError),
        (np.array([[np.inf, 1.0]]), ValueError),
        (np.zeros((3, 2), np.float32), TypeError),
        (np.zeros(2), TypeError),
        ([[1.0, 2.0]], TypeError),
    ):
        with pytest.raises(error, match="^points: "):
            npr.flow.match_points(plain.image, plain.image, points)  # type: ignore[arg-type]


def test_a_flow_tracker_follows_a_moving_camera() -> None:
    frames = [npr.sim.render("strafe", k) for k in range(3)]
    tracker = npr.flow.FlowTracker(848, 480)
    results = [tracker.update(frame.image) for frame in frames]
    assert results[0].status == "started" and results[0].step is None
    for before, frame, result in zip(frames, frames[1:], results[1:], strict=False):
        assert result.status in ("tracked", "ambiguous")
        assert result.step is not None and result.step.shape == (3, 3) and result.agreed > 20
        # Knots seen in both frames went where the homography takes them.
        now = {tuple(index): pixel for index, pixel in zip(frame.lattice, frame.nodes, strict=True)}
        both = [(pixel, now[tuple(i)]) for i, pixel in zip(before.lattice, before.nodes, strict=True) if tuple(i) in now]
        old, new = (np.array(pixels) for pixels in zip(*both, strict=True))
        moved = np.column_stack([old, np.ones(len(old))]) @ result.step.T
        assert np.median(np.linalg.norm(moved[:, :2] / moved[:, 2:] - new, axis=1)) < SHIFT_PX
        assert np.isfinite(result.spread_px)
    assert results[-1].from_key is not None


@pytest.mark.parametrize(("width", "height"), [(0, 480), (848, 0)])
def test_a_flow_tracker_wants_a_size(width: int, height: int) -> None:
    with pytest.raises(ValueError, match=r"0"):
        npr.flow.FlowTracker(width, height)
    with pytest.raises(OverflowError, match=noted("width")):
        npr.flow.FlowTracker(-1, 480)
    with pytest.raises(ValueError, match="width.*16384"):
        npr.flow.FlowTracker(2**31, 480)
