"""Virtual nets with known pose.

``scenarios()`` lists names and descriptions; ``render(name, frame, seed)`` draws a frame and gives its exact truth. Random scenes have
names too: ``render("study-planar-17")``, ``"study-hung-17"``, ``"study-negative-17"``.
"""

from netpose_rs._core import SimFrame, render, scenarios

__all__ = ["SimFrame", "render", "scenarios"]
