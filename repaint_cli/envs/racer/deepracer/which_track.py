"""Which of several tracks a logged episode drove, which no column of a log says. Metres."""

from collections.abc import Sequence

import numpy as np

from repaint_cli.envs.racer.deepracer.simtrace_reader import LoggedEpisode
from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.envs.racer.track.track import Track

OTHER_LENGTH = 0.01
"""Of a track: from this share on, a log that says another length is of another track."""
REVERSED = 0.5
"""What a track driven forwards is preferred by to one driven the other way, m."""


def track_driven(logged: LoggedEpisode, tracks: Sequence[Track]) -> int | None:
    """Return which of some tracks an episode drove, from 0; None where none is as long.

    Of several it is the one on which the car was near the waypoints that the log names; of two that
    are one road driven either way, the one that it drove forwards.
    """
    length = logged.track_length
    fits = [
        t for t, one in enumerate(tracks) if abs(length - one.length) <= OTHER_LENGTH * one.length
    ]
    if len(fits) < 2:
        return fits[0] if fits else None
    return min(fits, key=lambda t: _gap(logged.trace, tracks[t]))


def _gap(trace: Trace, track: Track) -> float:
    """Return how far a car was from the waypoints of a track, driven either way."""
    return min(_waypoint_gap(trace, track), _waypoint_gap(trace, track.reversed()) + REVERSED)


def _waypoint_gap(trace: Trace, track: Track) -> float:
    """Return the mean distance from a car to the waypoints that its log names, on a track."""
    points, _ = track.waypoints
    inside = trace.closest_waypoint < len(points)
    named = points[np.where(inside, trace.closest_waypoint, 0)]
    return float(np.hypot(*(trace.xy - named).T).mean()) if inside.all() else np.inf
