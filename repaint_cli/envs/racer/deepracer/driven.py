"""Logged episodes on a track: what a log says, and where the car stood. SI units.

What a log says of a step is taken from it, the rest of a reward's argument is measured on the track
as in training. **T** steps of an episode; progress is in percent.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.deepracer.params import CarState
from repaint_cli.envs.racer.deepracer.simtrace_reader import LoggedEpisode, read_episodes
from repaint_cli.envs.racer.deepracer.which_track import track_driven
from repaint_cli.envs.racer.dynamics.car import CAR_POINTS, FRONT_OFFSET, STEP_SECONDS
from repaint_cli.envs.racer.dynamics.progress import progress_since
from repaint_cli.envs.racer.dynamics.starts import OPEN_START
from repaint_cli.envs.racer.track.geometry import NDIST, WHEELS_ON, Floats, measure
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.errors import CardError, NotFound, some

ASTRAY = 0.05
"""Of the steps that end no episode, the share off the road from which on a log is of another track;
on its own track there are hardly any."""
JUMP = 4.0
"""Of what a car can drive in a step, times from which on it did not drive."""
CLOCK = 2e-4
"""Our steps take 1/15 s, written with four digits; DeepRacer's vary by more, s."""


@dataclass(frozen=True)
class DrivenEpisode:
    """A logged episode, measured on a track."""

    log: Path
    """The file that holds it."""
    logged: LoggedEpisode
    """What that says."""
    road: Track
    """The track, in the direction that the car drives it."""
    is_reversed: bool
    """Whether that is the reverse direction."""
    measures: Floats
    """`geometry.locate`'s answers, (T, 6)."""
    paid: NDArray[np.bool_]
    """Which steps a reward is paid for, (T,)."""

    @property
    def status(self) -> str:
        """How it ended, a name in STATUS where it ended; a whole lap is one, whatever follows."""
        return "lap_complete" if self.logged.trace.progress[-1] >= 100 else self.logged.trace.status

    @property
    def was_put_back(self) -> bool:
        """Whether a mishap within it ended nothing, as in a race: the car jumped back."""
        trace = self.logged.trace
        moved = np.hypot(*np.diff(trace.xy, axis=0).T)
        fastest = max(trace.throttle.max(initial=0.0), 1.0)
        return bool((moved > JUMP * fastest * STEP_SECONDS).any())

    @property
    def first_progress(self) -> float:
        """Progress before the first step, that of a car which stands where the episode starts.

        In an evaluation that drives lap after lap, the second begins at 0.
        """
        if self.logged.steps[0] > 1:
            return 0.0
        road, progress = self.road, self.logged.trace.progress[:1] / 100
        start = (self.measures[:1, NDIST] - progress) % 1 if road.closed else np.zeros(1)
        base, yaw = road.pose_at(start if road.closed else start + OPEN_START / road.length)
        front = _located(base, yaw, road)[:, NDIST]
        return float(progress_since(front, start, np.zeros(1))[0])

    def state(self, t: int) -> CarState:
        """Return the car after a step, without other cars."""
        logged, trace = self.logged, self.logged.trace
        is_last = t == len(trace) - 1
        return CarState(
            road=self.road,
            is_reversed=self.is_reversed,
            front=trace.xy[t],
            yaw=float(np.deg2rad(trace.yaw[t])),
            chosen=np.array([np.deg2rad(trace.steer[t]), trace.throttle[t]]),
            measures=self.measures[t],
            progress=float(trace.progress[t]),
            steps=int(logged.steps[t]),
            seconds=float(logged.seconds[t] - logged.seconds[0]) + STEP_SECONDS,
            crashed=is_last and trace.status == "crashed",
            poses=np.empty((0, 4)),
            objects_along=np.empty(0),
            objects_speed=0.0,
            encounter=np.zeros(6),
        )


def read_driven(path: Path, tracks: Sequence[Track]) -> list[DrivenEpisode]:
    """Read the episodes of a log, and measure each on that of a card's tracks that it drove.

    Raises:
        CheckpointError: the file cannot be read or is damaged.
        NotFound: it holds no episode.
        CardError: an episode is of another track.
    """
    episodes = read_episodes(path)
    if not episodes:
        raise NotFound(
            f"{path}: expected a simtrace (.csv) or a text with lines SIM_TRACE_LOG:…, found no "
            "step of an episode"
        )
    roads = [(track, track.reversed()) for track in tracks]
    clocks = (np.abs(np.diff(episode.seconds) - STEP_SECONDS) for episode in episodes)
    ours = all(clock.max(initial=0) < CLOCK for clock in clocks)
    which = [_which_track(path, episode, tracks) for episode in episodes]
    driven = [_driven(path, one, roads[t], ours) for one, t in zip(episodes, which, strict=True)]
    for t in sorted(set(which)):
        own = [one for one, of in zip(driven, which, strict=True) if of == t]
        _check_track(path, own, tracks[t])
    return driven


def _which_track(path: Path, logged: LoggedEpisode, tracks: Sequence[Track]) -> int:
    """Return which of a card's tracks an episode drove, from 0.

    Raises:
        CardError: none of them is as long as the log says.
    """
    if (which := track_driven(logged, tracks)) is not None:
        return which
    named = some([f"'{track.name}', {track.length:.2f} m" for track in tracks], between=" and ")
    raise CardError(
        f"{path}: its track is {logged.track_length:.2f} m long, and the card's, {named}; name the "
        "log's track in [env]"
    )


def _driven(
    path: Path, logged: LoggedEpisode, roads: tuple[Track, Track], ours: bool
) -> DrivenEpisode:
    """Measure an episode on the road in the direction in which its progress grows."""
    measures, is_reversed = _measured(logged, roads[0]), False
    ways = np.diff(measures[:, NDIST]), np.diff(logged.trace.progress) / 100
    along, progress = (way - np.round(way) for way in ways)  # over the start line, or the lap's end
    if (along * progress).sum() < 0:
        measures, is_reversed = _measured(logged, roads[1]), True
    paid = ~logged.unpaid
    if ours:  # our first step is called "prepare" for the tools' sake
        paid[0] = True
    return DrivenEpisode(path, logged, roads[is_reversed], is_reversed, measures, paid)


def _measured(logged: LoggedEpisode, road: Track) -> Floats:
    """Return where the car stood on a road after each step, (T, 6)."""
    yaw = np.deg2rad(logged.trace.yaw)
    base = logged.trace.xy - FRONT_OFFSET * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    return _located(base, yaw, road)


def _located(base: Floats, yaw: Floats, road: Track) -> Floats:
    """Return `geometry.locate`'s answers, (T, 6), for bases (T, 2) and headings (T,) on a road."""
    states = np.hstack([base, yaw[:, None], np.zeros((len(yaw), 2))])
    fronts, measures = np.zeros((len(yaw), 2)), np.zeros((len(yaw), 6))
    rows = np.arange(len(yaw))
    measure(rows, states, CAR_POINTS, *road.lines, *road.outline, fronts, measures)
    return measures


def _check_track(path: Path, driven: Sequence[DrivenEpisode], track: Track) -> None:
    """Check that the cars were on the road in nearly all steps that ended no episode.

    Raises:
        CardError: they were not.
    """
    off = [(one.measures[:, WHEELS_ON] == 0)[:-1][one.paid[:-1]] for one in driven]
    share = np.concatenate(off).mean() if sum(map(len, off)) else 0.0
    if share > ASTRAY:
        raise CardError(
            f"{path}: in {share:.0%} of its steps the car is off the card's track, '{track.name}'; "
            "name the log's track in [env]"
        )
