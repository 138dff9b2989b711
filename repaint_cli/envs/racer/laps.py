"""How long a lap takes, whether one is possible, and what was mended in the track's file."""

from collections.abc import Sequence
from math import ceil

import numpy as np

from repaint_cli.envs.racer.actions import Actions, beyond_the_car, speeds_of
from repaint_cli.envs.racer.dynamics.car import STEP_SECONDS
from repaint_cli.envs.racer.dynamics.encounters import BODY_WIDTH
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.tracks import labels_of

LEAST_LIMIT = 1500
"""Of an episode, steps, where the card says none."""


def time_limit(tracks: Sequence[str], actions: Actions) -> int:
    """Return one and a half times what the longest lap takes at the slowest action, or more.

    In steps.
    """
    slowest, _ = speeds_of(actions)
    longest = max(_lap_steps(track, slowest) for track in tracks)
    return max(LEAST_LIMIT, ceil(1.5 * longest))


def doubts_about(
    tracks: Sequence[str], actions: Actions, limit: int, objects: ObjectSettings
) -> list[str]:
    """Return sentences about actions beyond the car, and what makes a lap of a track impossible."""
    lines = [beyond_the_car(actions)]
    for track, label in zip(tracks, labels_of(tracks), strict=True):
        where = f"on track '{label}' " if len(tracks) > 1 else ""
        doubts = _too_long(track, actions, limit), _no_way_past(track, objects)
        lines += [f"{where}{line}" for line in doubts if line]
    return [line for line in lines if line]


def _too_long(track: str, actions: Actions, limit: int) -> str | None:
    """Return a sentence where a lap takes longer than an episode may, `limit` steps."""
    slowest, fastest = speeds_of(actions)
    for speed, which, what in (
        (fastest, "fastest", "no lap can be finished"),
        (slowest, "slowest", "a lap at the slowest action cannot be finished"),
    ):
        if (steps := ceil(_lap_steps(track, speed))) > limit:
            return (
                f"{what}: it takes {steps:,} steps at the {which} action's {speed:g} m/s, and "
                f"env.max_steps is {limit:,}; leave max_steps out, and it follows from the track"
            )
    return None


def _lap_steps(track: str, speed: float) -> float:
    """Return how many steps a lap of the centre line takes at a speed, m/s."""
    return load_track(track).length / (speed * STEP_SECONDS)


def notes_on(names: Sequence[str]) -> list[str]:
    """Return a sentence for each track's file in which something was mended."""
    labels = labels_of(names)
    notes = [load_track(name).note for name in names]
    return [f"track '{a}': {note}" for a, note in zip(labels, notes, strict=True) if note]


def _no_way_past(name: str, objects: ObjectSettings) -> str | None:
    """Return a sentence where a car cannot pass an object that is in the middle of a lane."""
    if not objects.n:
        return None
    track = load_track(name)
    width = float(np.hypot(*(track.inner - track.outer).T).min())
    room, what = 0.75 * width - objects.body[1] / 2, "box" if objects.boxes else "bot"
    if room > BODY_WIDTH:
        return None
    return (
        f"no car can pass a {what} where the road is {width:.2f} m wide: {max(room, 0):.2f} m is "
        f"left beside it, and the car has {BODY_WIDTH:.2f} m"
    )
