"""What a reward pays for the steps that logs hold.

**T** steps of an episode. SI units, progress in percent.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from repaint_cli.envs.logs import Replay, ReplayedEpisode
from repaint_cli.envs.output import CountedPrints, captured, output_to
from repaint_cli.envs.racer.deepracer.driven import DrivenEpisode, read_driven
from repaint_cli.envs.racer.deepracer.log_files import LogFile, find_logs
from repaint_cli.envs.racer.deepracer.params import params_of
from repaint_cli.envs.racer.deepracer.reward_file import RewardFunction
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS, reward_terms
from repaint_cli.envs.racer.names import STATUS, TERMS
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_tracks
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.errors import CardError, NotFound

OBJECT_KEYS = re.compile(r"""['"](closest_objects|objects?_[a-z_]+)['"]""")
"""The keys of `params` about other cars and boxes, in a function's text."""
Pay = Callable[[DrivenEpisode], Floats]
"""Returns what an episode is paid, (T,); 0 in steps that are not paid."""


def replay(
    env: RacerSimulator,
    logs: Sequence[Path],
    weights: Mapping[str, float],
    code: tuple[str, str] | None,
) -> Replay:
    """Pay the episodes of logs by another reward; see `LogFormat.replay`."""
    files, notes = find_logs(logs)
    tracks = load_tracks(env.tracks, env.waypoints)
    pay: Pay = FunctionPay(*code) if code else TermsPay(weights, TERMS)
    output, parts = CountedPrints(), list[tuple[ReplayedEpisode, Floats, Floats]]()
    n_races = 0
    with output_to(output), captured():
        for file in files:
            driven = read_driven(file.path, tracks)
            parts += [_replayed(file, episode, pay) for episode in driven]
            n_races += sum(episode.was_put_back for episode in driven)
    keys = sorted(set(OBJECT_KEYS.findall(code[1]))) if code else []
    if keys or env.objects.n:
        named = f": {', '.join(keys)} in params say that there are none" if keys else ""
        notes.append(f"logs hold no other cars and no boxes{named}")
    if n_races:
        notes.append(
            f"{n_races} episodes are races in which the car was put back; a log does not say why, "
            "so the mishaps within are not paid as such"
        )
    if output.example:
        name = code[0] if code else ""
        notes.append(f"{name} prints {output.n_lines:,} lines, such as '{output.example}'")
    episodes, logged, new = zip(*parts, strict=True)
    if not sum(map(len, logged)):
        raise NotFound(f"expected steps that a reward is paid for, found none in {logs[0]}")
    notes += output.warnings
    return Replay(list(episodes), np.concatenate(logged), np.concatenate(new), notes)


def _replayed(
    file: LogFile, episode: DrivenEpisode, pay: Pay
) -> tuple[ReplayedEpisode, Floats, Floats]:
    """Return an episode with what it was and is paid, and both for each step that is paid."""
    trace, paid = episode.logged.trace, episode.paid
    logged, new = trace.reward[paid], pay(episode)[paid]
    outcome = ReplayedEpisode(
        log=file.label,
        number=episode.logged.number,
        steps=int(paid.sum()),
        progress=float(trace.progress[-1]),
        ended=episode.status.replace("_", " "),
        whole=episode.status == "lap_complete",
        logged=float(logged.sum()),
        new=float(new.sum()),
    )
    return outcome, logged, new


class FunctionPay:
    """Pays what a reward function says; each folder of logs has a copy of its module."""

    def __init__(self, name: str, source: str) -> None:
        self._name, self._source = name, source
        self._copies = dict[Path, RewardFunction]()

    def __call__(self, episode: DrivenEpisode) -> Floats:
        """Return what the function pays for an episode, (T,).

        Raises:
            CardError: the text does not run or has no such function.
            RewardFailed: the function failed in a step.
        """
        folder = episode.log.parent
        if folder not in self._copies:
            self._copies[folder] = RewardFunction(self._name, self._source)
        function = self._copies[folder]
        where = f"episode {episode.logged.number} in {episode.log.name}"
        rewards = np.zeros(len(episode.paid))
        for t in np.flatnonzero(episode.paid).tolist():
            rewards[t] = function(params_of(episode.state(t)), where)
        return rewards


class TermsPay:
    """Pays w·φ, the weighted reward terms of a car that is alone."""

    def __init__(self, weights: Mapping[str, float], known: frozenset[str]) -> None:
        """Keep the weights.

        Raises:
            CardError: a term needs bots, which no log holds.
        """
        self._weights = {name: weight for name, weight in weights.items() if weight}
        if unknown := sorted(self._weights.keys() - known):
            raise CardError(
                f"expected reward terms of {', '.join(sorted(known))}, found {unknown[0]:.60}: "
                "logs hold no other cars; leave it out"
            )

    def __call__(self, episode: DrivenEpisode) -> Floats:
        """Return what the terms pay for an episode, (T,)."""
        trace = episode.logged.trace
        status = np.full(len(trace), IN_PROGRESS)
        if trace.status in STATUS:
            status[-1] = STATUS.index(trace.status)
        begun = np.where(trace.progress[:-1] >= 100, 0.0, trace.progress[:-1])  # lap after lap
        gained = trace.progress - np.concatenate([[episode.first_progress], begun])
        terms = reward_terms(episode.measures, gained, status)
        total = np.zeros(len(trace))
        for name, weight in self._weights.items():
            total += weight * terms[name]
        return total * episode.paid
