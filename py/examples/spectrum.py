"""A picture of a net, its spectrum with the peaks found, the junctions, and the pose.

    python examples/spectrum.py                                           a virtual net
    python examples/spectrum.py IMAGE --camera camera.yaml --cell 50mm    a picture of yours (needs matplotlib to read it)

Prints what was found; with matplotlib installed, also draws it to spectrum.png (or --out FILE).
"""

import argparse
from typing import Any

import numpy as np

import netpose_rs as npr


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", nargs="?", help="a picture; without it a virtual net is drawn")
    parser.add_argument("--camera", help="ROS camera_info or Kalibr YAML of the picture")
    parser.add_argument("--cell", default="50mm", help="mesh, knot to knot")
    parser.add_argument("--scenario", default="plain", help="virtual net; npr.sim.scenarios() names them")
    parser.add_argument("--out", default="spectrum.png")
    arguments = parser.parse_args()

    if arguments.image:
        if not arguments.camera:
            parser.error("a picture needs --camera FILE")
        image, camera, mesh = read(arguments.image), npr.Camera.from_yaml(arguments.camera), npr.Mesh.parse(arguments.cell)
    else:
        frame = npr.sim.render(arguments.scenario)
        image, camera, mesh = frame.image, frame.camera, frame.mesh

    spectrum = npr.fft.spectrum(image)
    waves = npr.fft.scores(spectrum)[:6, :2]
    result = npr.estimate(image, camera, mesh)
    # With a pose the junctions are named by it; without one, the contours of the meshes still show where some are.
    junctions = result.junctions if result.pose is not None else npr.junction.detect(image).pixels

    print(result)
    if result.normal is not None and result.sigma_range_m is not None:
        tilt = np.degrees(np.arccos(result.normal[2]))
        print(f"range {result.range_m:.4f} m (sd {1e3 * result.sigma_range_m:.2f} mm), tilt {tilt:.2f} degrees")
    print(f"{len(junctions)} junctions; strongest waves (cycles per image width and height):")
    for kx, ky in waves:
        print(f"  {kx:8.2f} {ky:8.2f}")
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        return

    height, width = image.shape[:2]
    figure, (left, right) = plt.subplots(1, 2, figsize=(14, 4.5), constrained_layout=True)
    left.imshow(image, cmap="gray", vmin=0, vmax=255)
    left.plot(*junctions.T, ".", color="orange", markersize=3)
    left.set_title(repr(result), fontsize=9)
    if result.pose is not None:
        draw_axes(left, camera, result.pose, length=2 * mesh.sides[0])
    left.set_xlim(-0.5, width - 0.5)
    left.set_ylim(height - 0.5, -0.5)
    # Frequency 0 is in the middle; a wave and its opposite are the same one.
    half_width, half_height = width // 2, height // 2
    extent = (-half_width - 0.5, width - half_width - 0.5, height - half_height - 0.5, -half_height - 0.5)
    right.imshow(spectrum, cmap="magma", extent=extent)
    right.plot(*np.vstack([waves, -waves]).T, "o", color="cyan", markersize=9, fillstyle="none")
    right.set(title="spectrum and its strongest waves", xlabel="cycles per width", ylabel="cycles per height")
    figure.savefig(arguments.out, dpi=110)
    print(f"drawn to {arguments.out}")


def read(path: str) -> np.ndarray:
    """A picture as uint8, (H, W) or (H, W, 3)."""
    from matplotlib.image import imread

    pixels = imread(path)
    if pixels.dtype != np.uint8:
        pixels = (255 * pixels).round().astype(np.uint8)
    return np.ascontiguousarray(pixels[..., :3] if pixels.ndim == 3 else pixels)


def draw_axes(axes: Any, camera: npr.Camera, pose: np.ndarray, length: float) -> None:
    """The net's X (red), Y (green) and Z (blue) at its origin, lens distortion left out."""
    ends = pose[:3, :3] * length + pose[:3, 3:]
    points = np.column_stack([pose[:3, 3], ends])
    u = camera.fx * points[0] / points[2] + camera.cx
    v = camera.fy * points[1] / points[2] + camera.cy
    for k, color in enumerate(("red", "lime", "deepskyblue"), start=1):
        axes.plot([u[0], u[k]], [v[0], v[k]], color=color, linewidth=2)


if __name__ == "__main__":
    main()
