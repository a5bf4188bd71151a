"""Estimates of the whole program against the simulator's truth."""

import numpy as np
import pytest

import netpose_rs as npr

#: Range of the lattice estimator on a clean simulated net: its median is below 0.01 %, this is a wide margin for one picture.
RANGE_REL = 0.002
#: Angle between estimated and true normal, degrees, likewise.
NORMAL_DEG = 0.5
#: Place along the net modulo a cell, m: a fiftieth of a cell.
PLACE_M = 0.001
#: A knot is listed within this of its true place, px: the picture is 0.7 px sharp, and knots of the plain net are exact.
KNOT_PX = 0.7
#: Knots this near to the rim need not be listed: what they are found by is partly outside.
RIM_PX = 20.0


def turned(pose: np.ndarray, quarters: int) -> np.ndarray:
    """The pose of the same square net, its directions named otherwise."""
    cos, sin = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarters]
    turn = np.eye(4)
    turn[:2, :2] = [[cos, -sin], [sin, cos]]
    return pose @ turn


def against_truth(result: npr.Estimate, truth: npr.sim.SimFrame) -> tuple[float, float]:
    """Angle (rad) between the poses and distance (m) between the origins, modulo the ways to name directions and nodes."""
    assert result.pose is not None and truth.pose is not None
    cell = truth.mesh.sides[0]
    found = []
    for quarters in range(4):
        pose = turned(truth.pose, quarters)
        relative = np.linalg.inv(pose) @ result.pose
        angle = np.arccos(np.clip((np.trace(relative[:3, :3]) - 1) / 2, -1, 1))
        place = relative[:3, 3]
        place[:2] -= cell * np.round(place[:2] / cell)
        found.append((float(angle), float(np.linalg.norm(place))))
    return min(found)


@pytest.fixture(scope="module")
def result(plain: npr.sim.SimFrame) -> npr.Estimate:
    return npr.estimate(plain.image, plain.camera, plain.mesh)


def test_a_single_picture_gives_the_pose(plain: npr.sim.SimFrame, result: npr.Estimate) -> None:
    assert result.status == "ok" and 0.5 <= result.probability <= 1.0
    assert plain.range_m is not None and result.range_m is not None
    assert result.range_m == pytest.approx(plain.range_m, rel=RANGE_REL)
    assert result.normal is not None and plain.normal is not None
    assert np.degrees(np.arccos(min(1.0, float(result.normal @ plain.normal)))) < NORMAL_DEG
    assert result.distance_m == pytest.approx(result.range_m * result.normal[2])
    angle, place = against_truth(result, plain)
    assert np.degrees(angle) < NORMAL_DEG and place < PLACE_M + RANGE_REL * plain.range_m
    assert result.crossing_angle == pytest.approx(np.pi / 2, abs=np.radians(NORMAL_DEG))


def test_a_pose_is_a_rotation_and_a_translation_with_a_covariance(result: npr.Estimate) -> None:
    pose, covariance = result.pose, result.covariance
    assert pose is not None and covariance is not None and result.normal is not None
    assert pose.shape == (4, 4) and covariance.shape == (6, 6)
    assert pose[:3, :3] @ pose[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    assert np.array_equal(pose[3], [0, 0, 0, 1])
    assert pose[:3, 2] == pytest.approx(result.normal)
    assert covariance == pytest.approx(covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert result.sigma_range_m is not None and 0 < result.sigma_range_m < 0.01
    assert result.sigma_tilt is not None and 0 < result.sigma_tilt < 0.02
    assert result.sigma_xy_m is not None and 0 < result.sigma_xy_m < 0.01


def test_junctions_are_the_knots_by_name(plain: npr.sim.SimFrame, result: npr.Estimate) -> None:
    found, names = result.junctions, result.lattice
    offsets = np.linalg.norm(found[:, None] - plain.nodes[None], axis=2)
    nearest = offsets.argmin(axis=1)
    assert offsets.min(axis=1).max() < KNOT_PX
    height, width = plain.image.shape
    u, v = plain.nodes.T
    inner = (u > RIM_PX) & (v > RIM_PX) & (u < width - RIM_PX) & (v < height - RIM_PX)
    assert np.isin(np.flatnonzero(inner), nearest).mean() > 0.99
    # One and the same turn and shift takes the names given to the true ones.
    rows = np.column_stack([names, np.ones(len(names))])
    named, *_ = np.linalg.lstsq(rows, plain.lattice[nearest].astype(float), rcond=None)
    assert rows @ named == pytest.approx(plain.lattice[nearest], abs=1e-6)
    assert named == pytest.approx(np.round(named), abs=1e-6)
    assert abs(np.linalg.det(named[:2])) == pytest.approx(1)


def test_a_flat_square_net_is_held_flat_and_square(plain: npr.sim.SimFrame, result: npr.Estimate) -> None:
    assert result.crossing_angle == pytest.approx(np.pi / 2) and result.sigma_crossing_angle is None
    assert result.curvatures_per_m == (0.0, 0.0) and result.sigma_curvatures_per_m is None
    assert result.mean_normal == pytest.approx(result.normal) and result.mean_distance_m == pytest.approx(result.distance_m)
    # Twice and half the mesh explain next to nothing of a clean picture.
    assert result.cell_margin is not None and 0.3 < result.cell_margin <= 1.0


def test_a_hung_net_has_angle_and_curvatures_with_sigmas() -> None:
    frame = npr.sim.render("hung")
    result = npr.estimate(frame.image, frame.camera, frame.mesh)
    assert result.status == "ok" and frame.crossing_angle is not None and frame.curvatures_per_m is not None
    assert result.crossing_angle is not None and result.sigma_crossing_angle is not None
    assert result.curvatures_per_m is not None and result.sigma_curvatures_per_m is not None
    # Four deviations: one picture.
    assert abs(result.crossing_angle - frame.crossing_angle) < 4 * result.sigma_crossing_angle
    for found, true, sigma in zip(
        result.curvatures_per_m, frame.curvatures_per_m, result.sigma_curvatures_per_m, strict=True
    ):
        assert 0 < sigma < 0.3 and abs(found - true) < 4 * sigma
    assert result.normal is not None and result.mean_normal is not None
    assert 0 < np.degrees(np.arccos(float(result.normal @ result.mean_normal))) < 10


def test_junctions_have_sigmas_and_states(plain: npr.sim.SimFrame, result: npr.Estimate) -> None:
    assert len(result.states) == len(result.junctions) == len(result.sigma_px)
    assert set(result.states) == {"seen"}
    assert result.twines.shape == (len(result.twine_states), 3) and set(result.twines[:, 2]) == {0, 1}
    present = np.array(result.twine_states) == "present"
    # All but what the picture's end cuts through.
    assert present.mean() > 0.8 and (result.twine_llr[present] > 0).all() and result.twine_contrast[present].min() > 1
    width = np.nanmedian(result.twine_width_px[present])
    # 2 mm of twine and some blur.
    assert plain.range_m is not None and 1 < width / (0.002 * plain.camera.fx / plain.range_m) < 2.5
    nearest = np.linalg.norm(result.junctions[:, None] - plain.nodes[None], axis=2).min(axis=1)
    # Drawn twine has no shading, for which sigma makes allowance: errors are a sixth of what is said, and none is far beyond it.
    rms = np.sqrt(np.mean((nearest / result.sigma_px) ** 2) / 2)
    assert 0.05 < rms < 1.2


def test_the_thesis_method_is_there_too(plain: npr.sim.SimFrame) -> None:
    result = npr.estimate(plain.image, plain.camera, plain.mesh, method="thesis")
    # 5 % is what its tables reach; it may refuse.
    if result.status == "ok":
        assert result.range_m == pytest.approx(plain.range_m, rel=0.05)
    assert result.crossing_angle is None and result.curvatures_per_m is None


def test_a_tracker_counts_cells() -> None:
    frames = [npr.sim.render("strafe", k) for k in range(4)]
    tracker = npr.Tracker(frames[0].camera, frames[0].mesh)
    results = [tracker.update(f.image, f.timestamp_ns) for f in frames]
    assert [r.status for r in results] == ["ok"] * 4
    assert len({r.track for r in results}) == 1
    # What the vote said of each frame but the first: the same cells as predicted, by far.
    assert results[0].shifts == [] and results[0].log_odds is None
    for r in results[1:]:
        (i, j, z), (_, _, second) = r.shifts[:2]
        assert r.log_odds is not None and r.log_odds > 5 and z > 1.5 * second
        assert r.connection == "followed" and (i, j) == (0, 0) or r is results[1]
    first, last = results[0].pose, results[-1].pose
    true_first, true_last = frames[0].pose, frames[-1].pose
    assert first is not None and last is not None and true_first is not None and true_last is not None
    # The camera's way in its own first frame: whole cells would show, they are 50 mm.
    way, true_way = (a[:3, 3] - b[:3, 3] for a, b in ((last, first), (true_last, true_first)))
    assert way == pytest.approx(true_way, abs=0.005)


def test_a_prior_carries_the_count_over_steps_of_most_of_a_cell() -> None:
    # Every eighth frame of the middle of the sequence: steps of one to two cells.
    frames = [npr.sim.render("strafe", k) for k in range(40, 65, 8)]
    tracker = npr.Tracker(frames[0].camera, frames[0].mesh)
    results = [tracker.update(frames[0].image, frames[0].timestamp_ns)]
    covariance = np.diag([1e-3] * 3 + [2e-3] * 3) ** 2
    for before, now in zip(frames, frames[1:], strict=False):
        assert before.pose is not None and now.pose is not None
        motion = now.pose @ np.linalg.inv(before.pose)
        results.append(tracker.update_with_prior(now.image, now.timestamp_ns, motion, covariance))
    assert [r.status for r in results] == ["ok"] * len(frames)
    assert [r.connection for r in results] == ["started"] + ["followed"] * (len(frames) - 1)
    places = [(-p[:3, :3].T @ p[:3, 3]) for r in results if (p := r.pose) is not None]
    true_places = [(-p[:3, :3].T @ p[:3, 3]) for f in frames if (p := f.pose) is not None]
    for place, true_place in zip(places, true_places, strict=True):
        # Whole cells would show, they are 50 mm.
        way, true_way = np.linalg.norm(place - places[0]), np.linalg.norm(true_place - true_places[0])
        assert way == pytest.approx(true_way, abs=0.005)


def test_what_is_no_prior_is_refused(plain: npr.sim.SimFrame) -> None:
    tracker = npr.Tracker(plain.camera, plain.mesh)
    motion, covariance = np.eye(4), np.eye(6)
    lost, blind = motion.copy(), covariance.copy()
    lost[1, 3], blind[2, 4] = np.nan, np.inf
    with pytest.raises(ValueError, match="motion: row 1, column 3 is nan"):
        tracker.update_with_prior(plain.image, 0, lost, covariance)
    with pytest.raises(ValueError, match="covariance: row 2, column 4 is inf"):
        tracker.update_with_prior(plain.image, 0, motion, blind)
    with pytest.raises(ValueError, match="motion"):
        tracker.update_with_prior(plain.image, 0, 2 * motion, covariance)
    with pytest.raises(ValueError, match="covariance"):
        tracker.update_with_prior(plain.image, 0, motion, -covariance)
    with pytest.raises(ValueError, match="covariance"):
        tracker.update_with_prior(plain.image, 0, motion, np.eye(5))
    with pytest.raises(TypeError, match="motion"):
        tracker.update_with_prior(plain.image, 0, motion.astype(np.float32), covariance)


def test_the_same_picture_gives_the_same_answer(plain: npr.sim.SimFrame, result: npr.Estimate) -> None:
    again = npr.estimate(plain.image, plain.camera, plain.mesh)
    assert again.probability == result.probability
    assert again.pose is not None and result.pose is not None and np.array_equal(again.pose, result.pose)
    assert np.array_equal(again.junctions, result.junctions)
    colour = npr.estimate(np.repeat(plain.image[..., None], 3, axis=2), plain.camera, plain.mesh)
    assert colour.pose is not None and np.array_equal(colour.pose, result.pose)


def test_a_net_behind_a_net_is_a_layer_of_its_own(plain: npr.sim.SimFrame) -> None:
    double = npr.sim.render("study-layers-2")
    result = npr.estimate(double.image, double.camera, double.mesh, layers=True)
    front, back = result.layers
    assert front.range_m < back.range_m and double.range_m is not None
    # The nearest net is the simulator's first; each is noise to the other.
    assert front.range_m == pytest.approx(double.range_m, rel=5 * RANGE_REL)
    assert [layer.followed for layer in result.layers].count(True) == 1
    followed = front if front.followed else back
    assert followed.range_m == result.range_m and followed.probability == result.probability
    assert back.pose.shape == (4, 4) and back.covariance.shape == (6, 6) and back.normal.shape == (3,)
    assert "followed=" in repr(back)
    # One net is one layer; without the flag none are listed.
    assert len(npr.estimate(plain.image, plain.camera, plain.mesh, layers=True).layers) == 1
    assert npr.estimate(plain.image, plain.camera, plain.mesh).layers == []
