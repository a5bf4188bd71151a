"""Camera and Mesh: what goes in comes out, and what is wrong is named."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import netpose_rs as npr
from conftest import noted

CAMERA = (600.0, 610.0, 424.0, 240.0, 848, 480)

YAML = """\
image_width: 848
image_height: 480
camera_name: test
camera_matrix: {rows: 3, cols: 3, data: [600.0, 0.0, 424.0, 0.0, 610.0, 240.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.001, -0.002, 0.0]}
"""


def test_a_camera_keeps_its_numbers() -> None:
    camera = npr.Camera(*CAMERA)
    assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height) == CAMERA
    assert camera.distortion == []
    assert "fx=600" in repr(camera)


@pytest.mark.parametrize(
    ("distortion", "model", "expected"),
    [
        ([-0.2, 0.05, 0.001, -0.002], None, "plumb_bob"),
        ([-0.2, 0.05, 0.001, -0.002, 0.01], "plumb_bob", "plumb_bob"),
        ([0.3, 0.1, 0.0, 0.0, 0.01, 0.6, 0.2, 0.02], None, "rational_polynomial"),
        ([-0.02, 0.004, -0.001, 0.0], "equidistant", "equidistant"),
    ],
)
def test_lens_models(distortion: list[float], model: str | None, expected: str) -> None:
    camera = npr.Camera(*CAMERA, distortion=distortion, model=model)  # type: ignore[arg-type]
    assert camera.model == expected
    assert camera.distortion[: len(distortion)] == distortion
    again = npr.Camera(*CAMERA, distortion=np.array(distortion), model=model)  # type: ignore[arg-type]
    assert again.distortion == camera.distortion


def test_yaml_of_camera_calibration(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(YAML)
    for path in (file, str(file)):
        camera = npr.Camera.from_yaml(path)
        assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height) == CAMERA
        assert camera.distortion == [-0.2, 0.05, 0.001, -0.002, 0.0]


def test_bad_yaml_names_file_and_field(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(YAML.replace("[600.0", "[.nan"))
    with pytest.raises(ValueError, match=r"bad\.yaml"):
        npr.Camera.from_yaml(file)
    with pytest.raises(ValueError, match=r"missing\.yaml"):
        npr.Camera.from_yaml(tmp_path / "missing.yaml")


@pytest.mark.parametrize(
    ("at", "name", "value"),
    [
        (0, "fx", 0.0),
        (0, "fx", -600.0),
        (0, "fx", float("nan")),
        (1, "fy", float("inf")),
        (2, "cx", float("nan")),
        (3, "cy", float("nan")),
        (4, "width", 0),
        (5, "height", 0),
    ],
)
def test_a_bad_value_is_named(at: int, name: str, value: float) -> None:
    numbers = list(CAMERA)
    numbers[at] = value
    with pytest.raises(ValueError, match=name):
        npr.Camera(*numbers)  # type: ignore[arg-type]


def test_wrong_types_are_named() -> None:
    with pytest.raises(TypeError, match=noted("fx")):
        npr.Camera("wide", *CAMERA[1:])  # type: ignore[arg-type]
    with pytest.raises(OverflowError, match=noted("width")):
        npr.Camera(*CAMERA[:4], -848, 480)


@pytest.mark.parametrize("distortion", [[0.1], [0.1, 0.2, 0.3], [0.0] * 9])
def test_distortion_of_unknown_length(distortion: list[float]) -> None:
    with pytest.raises(ValueError, match="coefficients"):
        npr.Camera(*CAMERA, distortion=distortion)


def test_distortion_that_is_no_number() -> None:
    with pytest.raises(ValueError, match="distortion"):
        npr.Camera(*CAMERA, distortion=[0.1, float("nan"), 0.0, 0.0])
    with pytest.raises(ValueError, match="distortion"):
        npr.Camera(*CAMERA, distortion=[0.1] * 4, model="spherical")  # type: ignore[arg-type]


def test_meshes() -> None:
    assert npr.Mesh.square(0.05).sides == (0.05, 0.05)
    assert npr.Mesh.rectangular(0.05, 0.04).sides == (0.05, 0.04)
    assert npr.Mesh.rectangular(0.05, 0.04).angle == pytest.approx(np.pi / 2)
    oblique = npr.Mesh.oblique(0.05, 0.04, 1.2)
    assert (oblique.sides, oblique.angle) == ((0.05, 0.04), 1.2)
    assert repr(oblique) == "Mesh.oblique(0.05, 0.04, 1.2)"


@pytest.mark.parametrize(
    ("text", "sides", "angle"),
    [
        ("50mm", (0.05, 0.05), 90),
        ("5cm", (0.05, 0.05), 90),
        ("0.05m", (0.05, 0.05), 90),
        ("0.05", (0.05, 0.05), 90),
        ("50x40mm", (0.05, 0.04), 90),
        ("50x50mm@60deg", (0.05, 0.05), 60),
    ],
)
def test_mesh_text(text: str, sides: tuple[float, float], angle: float) -> None:
    mesh = npr.Mesh.parse(text)
    assert mesh.sides == pytest.approx(sides)
    assert np.degrees(mesh.angle) == pytest.approx(angle)


def test_bad_meshes() -> None:
    with pytest.raises(ValueError, match="50 furlongs"):
        npr.Mesh.parse("50 furlongs")
    for bad in (0.0, -0.05, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="side|cell"):
            npr.Mesh.square(bad)
        with pytest.raises(ValueError, match="side"):
            npr.Mesh.rectangular(0.05, bad)
    with pytest.raises(ValueError, match="angle"):
        npr.Mesh.oblique(0.05, 0.05, float("nan"))


CAMERAS = [
    npr.Camera(*CAMERA),
    npr.Camera(600.1, 1 / 3, -1e-7, 1e5, 1, 1),
    npr.Camera(*CAMERA, distortion=[-0.2, 0.05, 0.001, -0.002, 0.01]),
    npr.Camera(*CAMERA, distortion=[0.3, 0.1, 0.0, 0.0, 0.01, 0.6, 0.2, 0.02]),
    npr.Camera(*CAMERA, distortion=[0.0, 0.0, 0.0, 0.0], model="equidistant"),
]
MESHES = [npr.Mesh.square(0.05), npr.Mesh.rectangular(0.1, 1 / 30), npr.Mesh.oblique(0.05, 0.04, 1.2)]


@pytest.mark.parametrize("value", CAMERAS + MESHES, ids=repr)
def test_cameras_and_meshes_are_values(value: npr.Camera | npr.Mesh) -> None:
    again = [copy.copy(value), copy.deepcopy(value)]
    again += [pickle.loads(pickle.dumps(value, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)]
    again.append(eval(repr(value), {"Camera": npr.Camera, "Mesh": npr.Mesh}))
    for other in again:
        assert other == value and hash(other) == hash(value) and repr(other) == repr(value)
    others = [other for other in CAMERAS + MESHES if other is not value]
    assert all(other != value for other in others) and len(set(CAMERAS + MESHES)) == len(CAMERAS + MESHES)
    assert value != "camera" and value is not None


def test_a_lens_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"distortion coefficients are \[1000000\.0, .*plumb_bob"):
        npr.Camera(*CAMERA, distortion=[1e6, 0.0, 0.0, 0.0])
    file = tmp_path / "bad.yaml"
    file.write_text(YAML.replace("[-0.2,", "[1e6,"))
    with pytest.raises(ValueError, match=r"bad\.yaml: distortion_coefficients is \[1000000\.0, "):
        npr.Camera.from_yaml(file)
