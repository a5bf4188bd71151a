"""Every stage called alone, held against the simulator's truth."""

import numpy as np
import pytest

import netpose_rs as npr

#: Range of the lattice estimator on a clean simulated net: its median is below 0.01 %, this is a wide margin for one picture.
RANGE_REL = 0.002
#: Angle between estimated and true normal, degrees, likewise.
NORMAL_DEG = 0.5
#: A contour junction lies within this of the true knot, px.
JUNCTION_PX = 2.0


@pytest.fixture(scope="module")
def plain() -> npr.sim.SimFrame:
    return npr.sim.render("plain")


def test_scenarios_have_names_and_descriptions() -> None:
    names = [name for name, description in npr.sim.scenarios() if description]
    assert "plain" in names and len(names) == len(set(names)) > 10


def test_same_seed_same_bytes(plain: npr.sim.SimFrame) -> None:
    assert np.array_equal(npr.sim.render("plain").image, plain.image)
    assert not np.array_equal(npr.sim.render("plain", seed=99).image, plain.image)


def test_colour_and_strided_arrays_mean_the_same(plain: npr.sim.SimFrame) -> None:
    grey = npr.estimate(plain.image, plain.camera, plain.mesh)
    colour = npr.estimate(np.repeat(plain.image[..., None], 3, axis=2), plain.camera, plain.mesh)
    strided = npr.estimate(np.asfortranarray(plain.image), plain.camera, plain.mesh)
    assert colour.range_m == grey.range_m == strided.range_m


def test_spectrum_peaks_lie_at_the_lattices_wave_vectors(plain: npr.sim.SimFrame) -> None:
    spectrum = npr.fft.spectrum(plain.image)
    assert spectrum.shape == plain.image.shape and spectrum.dtype == np.uint8
    assert len(npr.fft.peaks(spectrum)) > 2
    best = npr.fft.scores(spectrum)[:8, :2] / [plain.image.shape[1], plain.image.shape[0]]
    # The plain net faces the camera: its cell is f * cell / range.
    cell_px = plain.camera.fx * plain.mesh.sides[0] / plain.range_m
    assert np.abs(np.hypot(*best.T) * cell_px - 1).min() < 0.03


def test_lattice_vectors_are_dual_to_wave_vectors() -> None:
    k = np.array([[0.03, 0.004], [-0.006, 0.04]])
    assert npr.fft.lattice_vectors(tuple(k[0]), tuple(k[1])) @ k.T == pytest.approx(np.eye(2))
    with pytest.raises(ValueError, match="parallel"):
        npr.fft.lattice_vectors((0.1, 0.0), (0.2, 0.0))


def test_junctions_want_camera_mesh_and_pose_together(plain: npr.sim.SimFrame) -> None:
    with pytest.raises(ValueError, match="all three or none"):
        npr.junction.detect(plain.image, plain.camera)
    with pytest.raises(ValueError, match="rotation"):
        npr.junction.detect(plain.image, plain.camera, plain.mesh, 2 * np.eye(4))


def test_flow_finds_a_shift(plain: npr.sim.SimFrame) -> None:
    shifted = np.roll(plain.image, (2, 3), axis=(0, 1))
    points = np.array([[300.0, 200.0], [400.0, 250.0]])
    matches = npr.flow.match_points(plain.image, shifted, points)
    assert matches.found.all()
    # A point on a regular net is found modulo a cell.
    cell_px = plain.camera.fx * plain.mesh.sides[0] / plain.range_m
    rest = (matches.pixels - points - [3.0, 2.0]) / cell_px
    assert np.abs(rest - np.round(rest)).max() < 0.01
    with pytest.raises(ValueError, match="points"):
        npr.flow.match_points(plain.image, shifted, np.zeros((3, 3)))
