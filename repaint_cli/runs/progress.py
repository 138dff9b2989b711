"""How far a run is beside its learner: a part of every checkpoint, read when the run goes on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CheckpointError
from repaint_cli.runs.alarms import IN_A_ROW


@dataclass
class RunProgress:
    """How far a run is beside its learner; its size does not grow with the iterations."""

    seconds: float = 0.0
    """How long the run has taken."""
    best_score: tuple[float, ...] = ()
    """Of the best evaluated policy so far; see `scores`."""
    best: tuple[int, int] = (0, 0)
    """After which iteration it was evaluated, and which of the seeds it is, from 0."""
    returns: list[np.ndarray] = field(default_factory=list)
    """Evaluated returns (S, E) after the last iterations, as many as alarms look back."""
    lengths: list[np.ndarray] = field(default_factory=list)
    """Mean lengths (S,) of their episodes, steps."""
    logs: list[Mapping[str, float]] = field(default_factory=list)
    """How far each seed's log of its episodes is."""
    remembered: list[str] | None = field(default_factory=list)
    """Variables in which a reward function keeps something; None where that was not noted."""
    notices: list[str] = field(default_factory=list)
    """Warnings from reading it."""
    source: Path | None = None
    """The checkpoint that it was read from."""

    def add_evaluation(self, k: int, episodes: Episodes, best: str) -> None:
        """Take in the evaluated episodes after iteration k; `best` is the card's `eval.best`."""
        self.returns = [*self.returns, episodes.returns][1 - IN_A_ROW :]
        self.lengths = [*self.lengths, episodes.lengths.mean(1)][1 - IN_A_ROW :]
        own = scores(episodes, best)
        s = max(range(len(own)), key=own.__getitem__)
        if own[s] > self.best_score:
            self.best_score, self.best = own[s], (k, s)

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "seconds": self.seconds,
            "best_score": self.best_score,
            "best": self.best,
            "returns": [returns.tolist() for returns in self.returns],
            "lengths": [lengths.tolist() for lengths in self.lengths],
            "logs": self.logs,
            "remembered": self.remembered,
        }

    @classmethod
    def from_notes(cls, notes: Mapping[str, Any], source: Path) -> "RunProgress":
        """Return the progress in a checkpoint's notes, as `as_json` wrote it.

        Raises:
            CheckpointError: a part is absent or malformed.
        """
        try:
            past = notes["past"]
            k, s = map(int, past["best"])
            remembered = past.get("remembered")
            return cls(
                seconds=float(past["seconds"]),
                best_score=tuple(map(float, past.get("best_score") or [past["best_return"]])),
                best=(k, s),
                returns=[np.array(returns, np.float64) for returns in past["returns"]],
                lengths=[np.array(own, np.float64) for own in past.get("lengths", [])],
                logs=[{str(n): float(x) for n, x in log.items()} for log in past["logs"]],
                remembered=None if remembered is None else [*map(str, remembered)],
                source=source,
            )
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise CheckpointError(f"{source} tells nothing of its past: {error!s:.200}") from error


def scores(episodes: Episodes, best: str) -> list[tuple[float, ...]]:
    """Return by what each of S policies is compared with others, the first number first.

    Args:
        episodes: evaluated ones.
        best: "return", "progress", or "lap_time": how many laps, and then how fast they are. The
            mean return decides between equal ones.
    """
    means = episodes.returns.mean(1)
    columns = [means]
    if best == "progress":
        assert episodes.progress is not None
        columns = [episodes.progress.mean(1), means]
    elif best == "lap_time":
        times = episodes.lap_times
        assert times is not None
        n_laps = (~np.isnan(times)).sum(1)
        columns = [n_laps, -np.nansum(times, 1) / np.maximum(n_laps, 1), means]
    return [tuple(map(float, row)) for row in np.stack(columns, 1)]
