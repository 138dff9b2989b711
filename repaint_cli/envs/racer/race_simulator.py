"""Our racing simulator where an episode is a race of several laps: for evaluations."""

from typing import Any, Self

import numpy as np

from repaint_cli.envs.episodes import Column, Episodes
from repaint_cli.envs.racer.dynamics.car import STEP_SECONDS
from repaint_cli.envs.racer.dynamics.race import RaceRules
from repaint_cli.envs.racer.names import RACE_RECORDS
from repaint_cli.envs.racer.outcomes import outcomes
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.tracks import labels_of
from repaint_cli.settings import EvalConfig


class RaceSimulator(RacerSimulator):
    """The racer whose evaluated episodes are races; `RacerSimulator.racing` makes it, no card."""

    race: RaceRules
    """Laps and penalties."""

    @classmethod
    def of(cls, env: RacerSimulator, config: EvalConfig) -> Self:
        """Return a card's racer under the rules in [eval]."""
        rules = RaceRules(
            config.laps, config.off_track_penalty, config.crash_penalty, config.max_resets,
            config.reset_behind,
        )  # fmt: skip
        return cls(**dict(env), race=rules)

    def race_rules(self) -> RaceRules:
        """Return them; see `RacerSimulator.race_rules`."""
        return self.race

    def settled(self) -> Self:
        """Return itself: the time limit of a lap is the card's, or follows."""
        return self

    def longest_episode(self) -> int:
        """Return the time limit of a race: that of its laps together, in steps."""
        return self.race.laps * super().longest_episode()

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None, both_directions: bool
    ) -> dict[str, Any] | None:
        """Return that all races start at the line; see `Simulator.start_options`."""
        options = super().start_options(n_seeds, n_envs, iteration, both_directions) or {}
        return options | {"lap_fraction": [0.0] * (n_seeds * n_envs)}

    @property
    def records(self) -> tuple[str, ...]:
        """What of the infos of a step is worth keeping, by name."""
        return (*super().records, *RACE_RECORDS)

    def columns(self, episodes: Episodes, s: int) -> list[Column]:
        """Return the times of races and of their best laps, and how often cars were put back."""
        times, resets, _ = _races(episodes)
        lap_times = [times[s, e][~np.isnan(times[s, e])] for e in range(times.shape[1])]
        best = [own.min() if len(own) else np.nan for own in lap_times]
        whole = [own.sum() if len(own) == self.race.laps else np.nan for own in lap_times]
        return [
            Column("total, s", np.array(whole)),
            Column("best lap, s", np.array(best)),
            Column("finished", np.array(whole), "count"),
            Column("resets", resets[s]),
        ]

    def outcomes(self, episodes: Episodes) -> dict[str, Any]:
        """Return the times of all laps (s), resets and penalties (s), as JSON."""
        times, resets, penalties = _races(episodes)
        laps = [[own[~np.isnan(own)].tolist() for own in row] for row in times]
        race = {"lap_times": laps, "resets": resets.tolist(), "penalties": penalties.tolist()}
        return outcomes(episodes, labels_of(self.tracks), times) | race


def _races(episodes: Episodes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the time of each lap with its penalties (s), resets, and penalties (s) in all.

    The times are (S, E, L), nan where a lap was not completed; the others (S, E).
    """
    resets, penalties = episodes.last("resets"), episodes.last("penalties")
    laps, paid = episodes.records["laps"], episodes.records["penalties"]  # (T, S, E)
    n_laps = int(np.nanmax(laps, initial=1))
    marks = np.zeros((*laps.shape[1:], n_laps + 1))
    for lap in range(1, n_laps + 1):
        done = laps >= lap
        at = done.argmax(0)
        seconds = (at + 1) * STEP_SECONDS + np.take_along_axis(paid, at[None], 0)[0]
        marks[..., lap] = np.where(done.any(0), seconds, np.nan)
    assert resets is not None
    assert penalties is not None
    return np.diff(marks), resets, penalties
