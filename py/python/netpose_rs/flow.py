"""Motion between pictures by pyramidal block matching (thesis 4.5).

``match_points(previous, next, points)``: where (N, 2) pixels went. ``FlowTracker(width, height).update(image)``: motion from frame to
frame and from the key frame, and whether it is ambiguous by whole cells.
"""

from netpose_rs._core import FlowResult, FlowTracker, Matches, match_points

__all__ = ["FlowResult", "FlowTracker", "Matches", "match_points"]
