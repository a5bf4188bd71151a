"""The spectrum of a net and its peaks (thesis 4.3).

``spectrum(image)``: centred log magnitude, uint8, as large as the image, the constant bin at ``(width // 2, height // 2)``.
``peaks(spectrum)``: (N, 3), ``kx, ky`` (cycles per image width and height) and level (Algorithm 2).
``scores(spectrum)``: (N, 7), best first, ``kx, ky`` refined by their multiples, then the parts ``peak, beam, pattern, absent``
and their sum (Algorithm 3).
``sections(image, camera, mesh)``: what every section makes of it: wave vectors, lattice vectors, both poses of one cell, confidences.
``lattice_vectors(k1, k2)``: (2, 2), rows in px, of two wave vectors in cycles per pixel.
"""

from netpose_rs._core import SectionPoses, lattice_vectors, peaks, scores, sections, spectrum

__all__ = ["SectionPoses", "lattice_vectors", "peaks", "scores", "sections", "spectrum"]
