"""Which of several tracks a logged episode drove, which no column of a log says. Metres."""

from collections.abc import Sequence

import numpy as np

from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.envs.racer.track.track import Track

REVERSED = 0.5
"""What a track driven forwards is preferred by to one driven the other way, m."""


def track_driven(trace: Trace, tracks: Sequence[Track]) -> int:
    """Return which of some tracks an episode drove, from 0.

    It is the one on which the car was near the waypoints that the log names; of two that are one
    road driven either way, the one that it drove forwards.
    """
    if len(tracks) == 1:
        return 0
    gaps = []
    for track in tracks:
        ways = _waypoint_gap(trace, track), _waypoint_gap(trace, track.reversed()) + REVERSED
        gaps.append(min(ways))
    return int(np.argmin(gaps))


def _waypoint_gap(trace: Trace, track: Track) -> float:
    """Return the mean distance from a car to the waypoints that its log names, on a track."""
    points, _ = track.waypoints
    inside = trace.closest_waypoint < len(points)
    named = points[np.where(inside, trace.closest_waypoint, 0)]
    return float(np.hypot(*(trace.xy - named).T).mean()) if inside.all() else np.inf
