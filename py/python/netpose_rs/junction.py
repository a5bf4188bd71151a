"""Junctions from the contours of meshes (thesis 4.4).

``detect(image)`` takes the cells' size from the picture; ``detect(image, camera, mesh, pose)`` from a predicted pose (4, 4), net to
camera, and then names junctions by their lattice indices in that pose's net frame.
"""

from netpose_rs._core import Junctions, detect

__all__ = ["Junctions", "detect"]
