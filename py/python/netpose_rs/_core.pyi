from os import PathLike
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "__version__",
    "Camera",
    "Mesh",
    "Estimate",
    "Layer",
    "SectionPoses",
    "lattice_vectors",
    "peaks",
    "scores",
    "sections",
    "spectrum",
    "FlowResult",
    "FlowTracker",
    "Matches",
    "match_points",
    "Junctions",
    "detect",
    "SimFrame",
    "render",
    "scenarios",
    "Tracker",
    "estimate",
]

__version__: str

#: uint8, (H, W) grey or (H, W, 3) RGB. A C-contiguous grey array is read in place, without a copy; anything else is packed or converted
#: to grey once. The GIL is released while it is looked at: do not write into it from another thread meanwhile.
_Image = npt.NDArray[np.uint8]
_Method = Literal["lattice", "thesis"]

@final
class Camera:
    """A calibrated camera.

    fx, fy, cx, cy: pixels. width, height: pixels. distortion: OpenCV's order; 4 or 5 values are ``plumb_bob``, 8 are
    ``rational_polynomial``; 4 with ``model="equidistant"`` are a fisheye (Kannala-Brandt).
    Raises ValueError that names the value which is not finite or out of range, or a lens by which next to nothing of the picture has a ray.

    A value: ``==`` and ``hash`` go by the numbers, ``repr`` can be evaluated, ``pickle`` and ``copy`` make an equal one.
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
    def distortion(self) -> list[float]:
        """Coefficients of the lens, OpenCV's order; empty for a pinhole."""
    @property
    def model(self) -> str:
        """Name of the lens model as in ROS; a pinhole is a ``plumb_bob`` without coefficients."""
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
    """Two lattice vectors in the net plane. A side is knot to knot, metres; not the stretched mesh. A value, as ``Camera`` is."""

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
    """What one frame says. Pose and what follows from it are None unless ``status`` is ``"ok"``. Can be pickled, between equal versions
    of this package."""

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
    @property
    def sigma_px(self) -> npt.NDArray[np.float64]:
        """(N,) one standard deviation of each junction's pixel, each axis, px."""
    @property
    def states(self) -> list[Literal["seen", "hidden", "fouled", "missing", "inferred"]]:
        """What is known of each of the ``junctions``."""
    @property
    def track(self) -> int:
        """Number of the count of cells: frames of the same number have the same node as origin."""
    @property
    def connection(self) -> Literal["started", "followed", "doubted", "settled", "recognised", "restarted"]:
        """How that count goes on from the frames before; of frames with a pose, but ``doubted`` and ``settled`` of all. ``doubted``: named by
        the best guess, perhaps off by whole cells, under a number of its own. ``settled``: frames together told what one did not, and the
        count before the doubt goes on. ``recognised``: the net was lost, and what was seen of its cells before told which ones these are.
        ``restarted``: it was lost, and a new count began."""
    @property
    def twines(self) -> npt.NDArray[np.int64]:
        """(M, 3): each twine's first end (i, j), and 0 if it leads to (i + 1, j) or 1 to (i, j + 1). Those between named nodes in view;
        none from ``method="thesis"``."""
    @property
    def twine_states(self) -> list[Literal["present", "missing", "doubtful", "hidden", "fouled", "unknown"]]:
        """What is known of each of the ``twines``. ``doubtful``: looks gone, as some of a picture's thousands of twines do by chance."""
    @property
    def twine_llr(self) -> npt.NDArray[np.float64]:
        """(M,) log likelihood ratio of each, present to missing."""
    @property
    def twine_contrast(self) -> npt.NDArray[np.float64]:
        """(M,) how many standard deviations the neighbourhood's twines stand out from lines half a mesh aside."""
    @property
    def twine_width_px(self) -> npt.NDArray[np.float64]:
        """(M,) apparent width of each, px, growth included; NaN where the picture does not tell."""
    @property
    def shifts(self) -> list[tuple[int, int, float]]:
        """The likeliest shifts (i, j) in cells *per frame* of the names that this frame came with, and by how many deviations each stands
        out, best first: what does not repeat in the picture says so, over as many frames as were in doubt. Empty where there was nothing to
        compare with."""
    @property
    def log_odds(self) -> float | None:
        """Natural logarithm of the odds of the best of ``shifts`` to the second."""
    @property
    def layers(self) -> list[Layer]:
        """All nets that can be vouched for, nearest first, with ``layers=True``; empty without, and with no pose."""
    @property
    def sigma_range_m(self) -> float | None:
        """One standard deviation of the range, m."""
    @property
    def sigma_tilt(self) -> float | None:
        """One standard deviation of the normal's direction, root mean square over both axes, rad."""
    @property
    def sigma_xy_m(self) -> float | None:
        """One standard deviation of the place along the net, root mean square over both axes, m."""
    @property
    def crossing_angle(self) -> float | None:
        """From X to the second mesh direction at the optical axis, rad. None from ``method="thesis"``."""
    @property
    def sigma_crossing_angle(self) -> float | None:
        """One standard deviation of it, rad; None where it was held at the mesh's own."""
    @property
    def curvatures_per_m(self) -> tuple[float, float] | None:
        """Principal curvatures at the optical axis, 1/m, the larger magnitude first; positive bends away. None from ``method="thesis"``."""
    @property
    def sigma_curvatures_per_m(self) -> tuple[float, float] | None:
        """One standard deviation of each, 1/m; None where the net was held flat."""
    @property
    def mean_normal(self) -> npt.NDArray[np.float64] | None:
        """(3,) unit normal of the mean plane about the optical axis, camera frame; ``normal`` is that of the tangent plane on the
        axis. None from ``method="thesis"``, as the next two."""
    @property
    def mean_distance_m(self) -> float | None:
        """Perpendicular distance of the mean plane, m."""
    @property
    def cell_margin(self) -> float | None:
        """How much worse a drawing with the best of other cells (halves, doubles, thirds, sides swapped) explains the picture, as a share of
        what this one explains; in [-1, 1]. Of a followed net that of its first picture."""

@final
class Layer:
    """One of several nets in a picture. The origin of one that is not followed is the node nearest to the optical axis, in each
    picture anew. Can be pickled, between equal versions of this package."""

    @property
    def probability(self) -> float:
        """In [0, 1]: that there is this net and the pose is right; never below the threshold for ``"ok"``."""
    @property
    def followed(self) -> bool:
        """Whether it is the net that the estimate itself tells of."""
    @property
    def range_m(self) -> float:
        """From the camera centre to the net along the optical axis, m."""
    @property
    def distance_m(self) -> float:
        """Perpendicular distance, m."""
    @property
    def normal(self) -> npt.NDArray[np.float64]:
        """(3,) unit normal of the net in the camera frame, positive z."""
    @property
    def pose(self) -> npt.NDArray[np.float64]:
        """(4, 4) net to camera."""
    @property
    def covariance(self) -> npt.NDArray[np.float64]:
        """(6, 6), rotation (rad) then translation (m), perturbation in the camera frame."""
    @property
    def sigma_range_m(self) -> float:
        """One standard deviation of the range, m."""
    @property
    def sigma_tilt(self) -> float:
        """One standard deviation of the normal's direction, root mean square over both axes, rad."""
    @property
    def sigma_xy_m(self) -> float:
        """One standard deviation of the place along the net, root mean square over both axes, m."""
    @property
    def crossing_angle(self) -> float | None:
        """From X to the second mesh direction at the optical axis, rad. None from ``method="thesis"``."""
    @property
    def sigma_crossing_angle(self) -> float | None:
        """One standard deviation of it, rad; None where it was held at the mesh's own."""
    @property
    def curvatures_per_m(self) -> tuple[float, float] | None:
        """Principal curvatures at the optical axis, 1/m, the larger magnitude first; positive bends away. None from ``method="thesis"``."""
    @property
    def sigma_curvatures_per_m(self) -> tuple[float, float] | None:
        """One standard deviation of each, 1/m; None where the net was held flat."""
    @property
    def mean_normal(self) -> npt.NDArray[np.float64] | None:
        """(3,) unit normal of the mean plane about the optical axis, camera frame; ``normal`` is that of the tangent plane on the
        axis. None from ``method="thesis"``, as the next two."""
    @property
    def mean_distance_m(self) -> float | None:
        """Perpendicular distance of the mean plane, m."""
    @property
    def cell_margin(self) -> float | None:
        """How much worse a drawing with the best of other cells (halves, doubles, thirds, sides swapped) explains the picture, as a share of
        what this one explains; in [-1, 1]. Of a followed net that of its first picture."""

@final
class Tracker:
    """Follows one net through the frames of one camera."""

    def __new__(
        cls, camera: Camera, mesh: Mesh, *, method: _Method | None = None, layers: bool = False
    ) -> Tracker:
        """With ``layers`` every picture that shows a net is searched for a second one, before or behind it; it takes as
        long again as looking for the first from scratch."""
    def update(self, image: _Image, timestamp_ns: int) -> Estimate:
        """The next frame. Raises ValueError for an image of another size than the camera's, or a time that does not come
        after the frame before; TypeError for another dtype or shape."""
    def update_with_prior(
        self,
        image: _Image,
        timestamp_ns: int,
        motion: npt.NDArray[np.float64],
        covariance: npt.NDArray[np.float64],
    ) -> Estimate:
        """The same with the camera's motion since the last update as the vehicle knows it.

        motion: (4, 4), from the camera frame of the last update to that of this one: a resting point is at
        ``motion @ X_before``. covariance: (6, 6), rotation (rad) then translation (m), perturbation in the camera frame of now. It
        decides which cell a step led to where the picture does not tell; a prior that the picture contradicts decides nothing.
        Raises ValueError for what is no motion or no covariance."""

def estimate(
    image: _Image, camera: Camera, mesh: Mesh, *, method: _Method | None = None, layers: bool = False
) -> Estimate:
    """One image, no state. ``layers`` as of ``Tracker``."""

# Stages: documented in the modules fft, junction, flow and sim.

def spectrum(image: _Image, *, window: bool = True, logarithm: bool = True, blur: bool = True) -> npt.NDArray[np.uint8]: ...
def peaks(
    spectrum: _Image, *, neighbourhood: int = 16, threshold: int = 20, cluster: float = 10.0
) -> npt.NDArray[np.float64]: ...
def scores(
    spectrum: _Image,
    *,
    ellipse: float = 0.25,
    constant_radius: float = 4.0,
    neighbourhood: int = 16,
    threshold: int = 20,
    cluster: float = 10.0,
) -> npt.NDArray[np.float64]: ...
def lattice_vectors(k1: tuple[float, float], k2: tuple[float, float]) -> npt.NDArray[np.float64]: ...
@final
class SectionPoses:
    """The net as the sections of one picture see it, one by one. N is 0 where nothing is like a net."""

    @property
    def probability(self) -> float | None:
        """That the picture shows a net and its pose is right. None if nothing was found."""
    @property
    def centres(self) -> npt.NDArray[np.float64]:
        """(N, 2) pixels (u, v) of the sections' centres."""
    @property
    def waves(self) -> npt.NDArray[np.float64]:
        """(N, 2, 2) the two wave vectors, rows in cycles per pixel; first the one dual to the net's X side."""
    @property
    def basis(self) -> npt.NDArray[np.float64]:
        """(N, 2, 2) the two lattice vectors, rows in pixels, X side first."""
    @property
    def confidence(self) -> npt.NDArray[np.float64]:
        """(N, 2) value of each vector over its rival's; inf without one."""
    @property
    def poses(self) -> npt.NDArray[np.float64]:
        """(N, 2, 4, 4) both poses of one cell, net to camera, metres; the origin is on the section's central ray."""
    @property
    def chosen(self) -> npt.NDArray[np.int64]:
        """(N,) which of the two has the sign of tilt that all sections agree on."""

def sections(image: _Image, camera: Camera, mesh: Mesh) -> SectionPoses: ...
@final
class Junctions:
    """Junctions of one picture by the contours of its meshes."""

    @property
    def pixels(self) -> npt.NDArray[np.float64]:
        """(N, 2) pixels (u, v)."""
    @property
    def lattice(self) -> npt.NDArray[np.int64]:
        """(N, 2) lattice indices (i, j): the given pose's, or without one counted from some junction. The lowest int32 where
        a junction has no name."""
    @property
    def sigma_px(self) -> npt.NDArray[np.float64]:
        """(N,) one standard deviation of the pixel, each axis."""
    @property
    def boxes(self) -> npt.NDArray[np.float64]:
        """(M, 4, 2) corners, px, of the meshes they were found from."""

def detect(
    image: _Image, camera: Camera | None = None, mesh: Mesh | None = None, pose: npt.NDArray[np.float64] | None = None
) -> Junctions: ...
@final
class Matches:
    """Where points of one picture are in the next."""

    @property
    def pixels(self) -> npt.NDArray[np.float64]:
        """(N, 2) pixels in the next picture."""
    @property
    def scores(self) -> npt.NDArray[np.float32]:
        """(N,) normalised correlation, -1 to 1."""
    @property
    def found(self) -> npt.NDArray[np.bool_]:
        """(N,) whether the match was found and found its way back."""

def match_points(previous: _Image, next: _Image, points: npt.NDArray[np.float64]) -> Matches: ...
@final
class FlowResult:
    """What an update of the tracker tells."""

    @property
    def status(self) -> Literal["started", "tracked", "ambiguous", "lost"]: ...
    @property
    def agreed(self) -> int:
        """Points that agree with the motion."""
    @property
    def spread_px(self) -> float:
        """Robust standard deviation of their residuals per axis, px."""
    @property
    def step(self) -> npt.NDArray[np.float64] | None:
        """(3, 3) homography from the frame before, pixels to pixels."""
    @property
    def from_key(self) -> npt.NDArray[np.float64] | None:
        """(3, 3) homography from the key frame, pixels to pixels."""

@final
class FlowTracker:
    """Follows points through frames of one size by pyramidal block matching."""

    def __new__(cls, width: int, height: int) -> FlowTracker: ...
    def update(self, image: _Image) -> FlowResult: ...

@final
class SimFrame:
    """A simulated frame with its truth: that of the nearest net, None or empty where there is none."""

    @property
    def image(self) -> npt.NDArray[np.uint8]:
        """(H, W). One array, the same at every access."""
    @property
    def camera(self) -> Camera: ...
    @property
    def mesh(self) -> Mesh: ...
    @property
    def timestamp_ns(self) -> int: ...
    @property
    def range_m(self) -> float | None: ...
    @property
    def normal(self) -> npt.NDArray[np.float64] | None: ...
    @property
    def crossing_angle(self) -> float | None:
        """Angle between the mesh directions at the optical axis, rad."""
    @property
    def curvatures_per_m(self) -> tuple[float, float] | None:
        """Principal curvatures at the optical axis, 1/m, the larger magnitude first."""
    @property
    def pose(self) -> npt.NDArray[np.float64] | None:
        """(4, 4) net to camera; the origin is the scene's node (0, 0)."""
    @property
    def nodes(self) -> npt.NDArray[np.float64]:
        """(N, 2) pixels of all knots in the picture."""
    @property
    def lattice(self) -> npt.NDArray[np.int64]:
        """(N, 2) their lattice indices."""
    @property
    def visible(self) -> npt.NDArray[np.bool_]:
        """(N,) whether nothing is in front of them."""

def scenarios() -> list[tuple[str, str]]: ...
def render(scenario: str, frame: int = 0, seed: int | None = None) -> SimFrame: ...
