"""Estimates: images as they come, errors that name the argument."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import netpose_rs as npr
from conftest import noted

CAMERA = (600.0, 600.0, 424.0, 240.0, 848, 480)


def camera() -> npr.Camera:
    return npr.Camera(*CAMERA)


def mesh() -> npr.Mesh:
    return npr.Mesh.square(0.05)


@pytest.mark.parametrize("grey", [0, 90, 255])
def test_grey_water_is_no_net(grey: int) -> None:
    result = npr.estimate(np.full((480, 848), grey, np.uint8), camera(), mesh())
    assert result.status == "no_net"
    assert 0.0 <= result.probability < 0.5
    for value in (
        result.pose,
        result.range_m,
        result.distance_m,
        result.normal,
        result.covariance,
        result.sigma_range_m,
        result.sigma_tilt,
        result.sigma_xy_m,
        result.crossing_angle,
        result.sigma_crossing_angle,
        result.curvatures_per_m,
        result.sigma_curvatures_per_m,
        result.mean_normal,
        result.mean_distance_m,
        result.cell_margin,
        result.log_odds,
    ):
        assert value is None
    assert result.junctions.shape == (0, 2) and result.lattice.shape == (0, 2)
    assert result.twines.shape == (0, 3) and result.twine_states == [] and result.twine_width_px.shape == (0,)
    assert result.sigma_px.shape == (0,) and result.states == [] and result.shifts == []
    assert result.junctions.dtype == np.float64 and result.lattice.dtype == np.int64
    assert "no_net" in repr(result)


#: Every function that takes an image, with the name of that argument.
TAKES_AN_IMAGE: list[tuple[str, Any]] = [
    ("image", lambda image: npr.estimate(image, camera(), mesh())),
    ("image", lambda image: npr.Tracker(camera(), mesh()).update(image, 0)),
    ("image", npr.fft.spectrum),
    ("spectrum", npr.fft.peaks),
    ("spectrum", npr.fft.scores),
    ("image", npr.junction.detect),
    ("previous", lambda image: npr.flow.match_points(image, np.zeros((480, 848), np.uint8), np.zeros((1, 2)))),
    ("next", lambda image: npr.flow.match_points(np.zeros((480, 848), np.uint8), image, np.zeros((1, 2)))),
    ("image", lambda image: npr.flow.FlowTracker(848, 480).update(image)),
]


@pytest.mark.parametrize(("name", "call"), TAKES_AN_IMAGE)
@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 848), np.float64),
        np.zeros((480, 848), np.uint16),
        np.zeros((480, 848), np.int8),
        np.zeros((480, 848), bool),
        np.zeros((480, 848, 4), np.uint8),
        np.zeros(848, np.uint8),
        [[0, 1], [2, 3]],
        "picture.png",
        None,
    ],
    ids=["float64", "uint16", "int8", "bool", "rgba", "one-dimensional", "list", "path", "None"],
)
def test_wrong_dtype_or_shape_names_the_argument(name: str, call: Any, image: object) -> None:
    with pytest.raises(TypeError, match=f"^{name}: .*uint8"):
        call(image)


@pytest.mark.parametrize(("name", "call"), TAKES_AN_IMAGE)
@pytest.mark.parametrize("shape", [(0, 0), (0, 848), (480, 0), (0, 0, 3)])
def test_an_empty_image_names_the_argument(name: str, call: Any, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=name):
        call(np.zeros(shape, np.uint8))


@pytest.mark.parametrize(("name", "call"), TAKES_AN_IMAGE)
def test_a_small_image_is_worked_on_or_refused_by_name(name: str, call: Any) -> None:
    for shape in ((1, 1), (1, 30), (7, 5)):
        try:
            call(np.zeros(shape, np.uint8))
        except ValueError as error:
            assert name in str(error) or (name == "previous" and "next" in str(error))


def test_wrong_image_size() -> None:
    with pytest.raises(ValueError, match="image: .*848x480.*100x50"):
        npr.estimate(np.zeros((50, 100), np.uint8), camera(), mesh())
    with pytest.raises(ValueError, match="image: .*100x50.*848x480"):
        npr.flow.FlowTracker(848, 480).update(np.zeros((50, 100), np.uint8))
    with pytest.raises(ValueError, match="next: "):
        npr.flow.match_points(np.zeros((480, 848), np.uint8), np.zeros((50, 100), np.uint8), np.zeros((1, 2)))


def test_what_is_larger_than_memory_is_refused() -> None:
    with pytest.raises(ValueError, match="image: .*pixels"):
        npr.estimate(np.broadcast_to(np.uint8(7), (2**31, 2**31)), camera(), mesh())
    for cell in (1e300, 50.0, 1e-9):
        with pytest.raises(ValueError, match="mesh side"):
            npr.Mesh.square(cell)


def test_time_must_go_forward() -> None:
    tracker = npr.Tracker(camera(), mesh())
    image = np.zeros((480, 848), np.uint8)
    tracker.update(image, 2_000)
    for time in (1_999, 2_000, -5):
        with pytest.raises(ValueError, match=f"timestamp_ns: .*{time}.*2000"):
            tracker.update(image, time)
    tracker.update(image, 2_001)
    with pytest.raises(TypeError, match=noted("timestamp_ns")):
        tracker.update(image, 1.5)  # type: ignore[arg-type]
    with pytest.raises(OverflowError, match=noted("timestamp_ns")):
        tracker.update(image, 2**63)


def test_methods_are_named() -> None:
    image = np.zeros((480, 848), np.uint8)
    for method in ("lattice", "thesis"):
        assert npr.estimate(image, camera(), mesh(), method=method).status == "no_net"
    with pytest.raises(ValueError, match="method.*wishes"):
        npr.estimate(image, camera(), mesh(), method="wishes")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=noted("camera")):
        npr.estimate(image, "camera.yaml", mesh())  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=noted("mesh")):
        npr.estimate(image, camera(), 0.05)  # type: ignore[arg-type]


def test_how_an_array_lies_in_memory_does_not_matter(plain: npr.sim.SimFrame) -> None:
    image = plain.image
    locked = image.copy()
    locked.flags.writeable = False
    wide = np.zeros((image.shape[0], 2 * image.shape[1]), np.uint8)
    wide[:, ::2] = image
    padded = np.zeros((image.shape[0], image.shape[1] + 13), np.uint8)
    padded[:, : image.shape[1]] = image
    expected = npr.fft.spectrum(image)
    for same in (
        locked,
        np.asfortranarray(image),
        image[::-1].copy()[::-1],
        wide[:, ::2],
        padded[:, : image.shape[1]],
        np.repeat(image[..., None], 3, axis=2),
        np.asfortranarray(np.repeat(image[..., None], 3, axis=2)),
    ):
        assert np.array_equal(npr.fft.spectrum(same), expected)


def test_colour_is_weighed_as_everywhere(plain: npr.sim.SimFrame) -> None:
    # ITU-R BT.601: red 0.299, green 0.587, blue 0.114. Of one channel only, in whole grey levels.
    ramp = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    for channel, weight in enumerate((0.299, 0.587, 0.114)):
        colour = np.zeros((4, 256, 3), np.uint8)
        colour[..., channel] = ramp
        grey = np.round(weight * ramp).astype(np.uint8)
        off = npr.fft.spectrum(colour, window=False, blur=False).astype(int) - npr.fft.spectrum(grey, window=False, blur=False)
        # The spectra of two ramps that differ by at most one level here and there.
        assert np.abs(off).mean() < 8


def fields(value: Any) -> dict[str, Any]:
    return {name: getattr(value, name) for name in dir(value) if not name.startswith("_")}


def test_results_can_be_sent_to_another_process(plain: npr.sim.SimFrame) -> None:
    found = npr.estimate(plain.image, plain.camera, plain.mesh, layers=True)
    none = npr.estimate(np.zeros_like(plain.image), plain.camera, plain.mesh)
    assert found.status == "ok" and len(found.layers) == 1 and none.status == "no_net"
    flat = npr.estimate(plain.image, plain.camera, plain.mesh, method="thesis")
    for value in (found, none, flat, found.layers[0]):
        for again in (pickle.loads(pickle.dumps(value)), pickle.loads(pickle.dumps(value, 0)), copy.deepcopy(value)):
            assert type(again) is type(value) and repr(again) == repr(value)
            for name, expected in fields(value).items():
                if name == "layers":
                    assert [repr(layer) for layer in again.layers] == [repr(layer) for layer in expected]
                else:
                    np.testing.assert_array_equal(getattr(again, name), expected, err_msg=name)
