from os import PathLike
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt

__all__ = ["Camera", "Estimate", "Mesh", "Tracker", "estimate"]

#: uint8, (H, W) grey or (H, W, 3) RGB. Grey with contiguous rows is read in place, anything else is converted once.
Image = npt.NDArray[np.uint8]
Method = Literal["lattice"]

@final
class Camera:
    """A calibrated camera.

    fx, fy, cx, cy: pixels. width, height: pixels. distortion: OpenCV's order; 4 or 5 values are ``plumb_bob``, 8 are
    ``rational_polynomial``; 4 with ``model="equidistant"`` are a fisheye (Kannala-Brandt).
    Raises ValueError that names the value which is not finite or out of range.
    """

    def __new__(
        cls,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        width: int,
        height: int,
        distortion: list[float] | npt.NDArray[np.float64] | None = None,
        model: Literal["plumb_bob", "rational_polynomial", "equidistant"] | None = None,
    ) -> Camera: ...
    @staticmethod
    def from_yaml(path: str | PathLike[str]) -> Camera:
        """ROS ``camera_info`` YAML or Kalibr camchain YAML. Raises ValueError that names file, field and value."""
    @property
    def fx(self) -> float: ...
    @property
    def fy(self) -> float: ...
    @property
    def cx(self) -> float: ...
    @property
    def cy(self) -> float: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...

@final
class Mesh:
    """Two lattice vectors in the net plane. A side is knot to knot, metres; not the stretched mesh."""

    @staticmethod
    def square(cell: float) -> Mesh: ...
    @staticmethod
    def rectangular(a: float, b: float) -> Mesh: ...
    @staticmethod
    def oblique(a: float, b: float, angle: float) -> Mesh:
        """angle: radians between the sides, in (0, pi)."""
    @staticmethod
    def parse(text: str) -> Mesh:
        """``50mm``, ``5cm``, ``0.05m``, ``0.05`` (metres), ``50x40mm``, ``50x50mm@60deg``."""
    @property
    def sides(self) -> tuple[float, float]: ...
    @property
    def angle(self) -> float: ...

@final
class Estimate:
    """What one frame says. Pose and what follows from it are None unless ``status`` is ``"ok"``."""

    @property
    def status(self) -> Literal["ok", "no_net"]: ...
    @property
    def probability(self) -> float:
        """In [0, 1]: that this frame shows a net and that the pose is right."""
    @property
    def range_m(self) -> float | None:
        """From the camera centre to the net along the optical axis, m."""
    @property
    def distance_m(self) -> float | None:
        """Perpendicular distance, m."""
    @property
    def normal(self) -> npt.NDArray[np.float64] | None:
        """(3,) unit normal of the net in the camera frame, positive z."""
    @property
    def pose(self) -> npt.NDArray[np.float64] | None:
        """(4, 4) net to camera."""
    @property
    def covariance(self) -> npt.NDArray[np.float64] | None:
        """(6, 6), rotation (rad) then translation (m), perturbation in the camera frame."""
    @property
    def junctions(self) -> npt.NDArray[np.float64]:
        """(N, 2) pixels (u, v), lens distortion included."""
    @property
    def lattice(self) -> npt.NDArray[np.int64]:
        """(N, 2) lattice indices (i, j) of ``junctions``; the lowest int32 where a junction has no name."""

@final
class Tracker:
    """Follows one net through the frames of one camera."""

    def __new__(cls, camera: Camera, mesh: Mesh, *, method: Method | None = None) -> Tracker: ...
    def update(self, image: Image, timestamp_ns: int) -> Estimate:
        """The next frame. Raises ValueError for an image of another size than the camera's, or a time that does not come
        after the frame before; TypeError for another dtype or shape."""

def estimate(image: Image, camera: Camera, mesh: Mesh, *, method: Method | None = None) -> Estimate:
    """One image, no state."""
