"""Where is the net? Pose, junctions and motion of a fish net from one underwater camera.

Camera frame: x right, y down, z forward. Pixels (u, v): the centre of the top-left pixel is (0, 0). Metres, radians, nanoseconds.
The net is the plane Z = 0 of its frame, X along the first mesh direction, Z away from the camera; poses are net to camera.
"""

from netpose_rs import fft, flow, junction, sim
from netpose_rs._core import Camera, Estimate, Layer, Mesh, Tracker, __version__, estimate

__all__ = ["__version__", "Camera", "Estimate", "Layer", "Mesh", "Tracker", "estimate", "fft", "flow", "junction", "sim"]
