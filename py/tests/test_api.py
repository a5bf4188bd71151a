"""The contract's Python names, and errors that name the argument."""

import numpy as np
import pytest

import netpose_rs as npr

CAMERA = (600.0, 600.0, 424.0, 240.0, 848, 480)


def camera() -> npr.Camera:
    return npr.Camera(*CAMERA)


def test_grey_water_is_no_net() -> None:
    result = npr.estimate(np.full((480, 848), 90, np.uint8), camera(), npr.Mesh.square(0.05))
    assert result.status == "no_net"
    assert result.pose is None and result.range_m is None and result.covariance is None
    assert result.junctions.shape == (0, 2) and result.lattice.shape == (0, 2)


@pytest.mark.parametrize("fx", [0.0, -600.0, float("nan"), float("inf")])
def test_bad_focal_length_is_named(fx: float) -> None:
    with pytest.raises(ValueError, match="fx"):
        npr.Camera(fx, *CAMERA[1:])


@pytest.mark.parametrize("distortion", [[0.1], [0.1, 0.2, 0.3], [0.0] * 9])
def test_distortion_of_unknown_length(distortion: list[float]) -> None:
    with pytest.raises(ValueError, match="coefficients"):
        npr.Camera(*CAMERA, distortion=distortion)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 848), np.float64),
        np.zeros((480, 848), np.uint16),
        np.zeros((480, 848, 4), np.uint8),
        np.zeros(848, np.uint8),
        "picture.png",
    ],
)
def test_wrong_image_type_names_the_argument(image: object) -> None:
    with pytest.raises(TypeError, match="image"):
        npr.estimate(image, camera(), npr.Mesh.square(0.05))  # type: ignore[arg-type]


def test_wrong_image_size() -> None:
    with pytest.raises(ValueError, match="848x480.*100x50"):
        npr.estimate(np.zeros((50, 100), np.uint8), camera(), npr.Mesh.square(0.05))


def test_time_must_go_forward() -> None:
    tracker = npr.Tracker(camera(), npr.Mesh.square(0.05))
    image = np.zeros((480, 848), np.uint8)
    tracker.update(image, 2_000)
    with pytest.raises(ValueError, match="1999"):
        tracker.update(image, 1_999)
    tracker.update(image, 2_001)


def test_mesh_text() -> None:
    assert npr.Mesh.parse("50x40mm").sides == pytest.approx((0.05, 0.04))
    assert npr.Mesh.parse("50x50mm@60deg").angle == pytest.approx(np.pi / 3)
    with pytest.raises(ValueError, match="50 furlongs"):
        npr.Mesh.parse("50 furlongs")
