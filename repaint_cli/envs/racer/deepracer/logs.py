"""A racing run's logs in DeepRacer's layout, a folder per seed."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from repaint_cli.envs.episodes import Episodes, Steps
from repaint_cli.envs.logs import EpisodeLog, LogFormat, LoggedRun, Replay
from repaint_cli.envs.racer.deepracer.simtrace import Simtrace
from repaint_cli.envs.racer.deepracer.traces import Trace, traces_of
from repaint_cli.envs.racer.simulator import RacerSimulator


class DeepRacerLog(EpisodeLog):
    """A seed's log."""

    def __init__(self, simtrace: Simtrace, env: RacerSimulator, scale: float) -> None:
        self._simtrace, self._env, self._scale = simtrace, env, scale

    @property
    def position(self) -> dict[str, float]:
        """How far the log is, for `go_back`."""
        return self._simtrace.position

    def go_back(self, k: int, position: Mapping[str, float]) -> None:
        """Remove what was logged after iteration k; see `EpisodeLog.go_back`."""
        self._simtrace.go_back(k, position)

    def log_training(self, k: int, steps: Steps, s: int) -> None:
        """Log what seed s did in the rollout of iteration k, from 1."""
        self._simtrace.train(k, self._traces(steps, s))

    def log_evaluation(self, k: int, steps: Steps, s: int) -> None:
        """Log the evaluation of seed s after iteration k."""
        self._simtrace.evaluate(k, self._traces(steps, s))

    def _traces(self, steps: Steps, s: int) -> list[Trace]:
        return traces_of(steps, self._env.actions, s, self._scale)


class DeepRacerLogs(LogFormat):
    """DeepRacer's layout, as its community's tools read it."""

    def __init__(self, env: RacerSimulator) -> None:
        self._env = env

    def folders(self, run: Path, seeds: Sequence[int]) -> list[Path]:
        """Return where a run keeps each seed's log, (S,)."""
        return [run / "deepracer" / f"seed-{seed}" for seed in seeds]

    def open(self, folder: Path, run: LoggedRun) -> DeepRacerLog:
        """Begin a run's own log in its folder, or go on with it; see `LogFormat.open`."""
        simtrace = Simtrace(folder, self._env, run, resumed=True)
        return DeepRacerLog(simtrace, self._env, run.scale)

    def log_episodes(
        self, folder: Path, run: LoggedRun, episodes: Episodes, s: int, stamp: str
    ) -> list[Path]:
        """Log evaluated episodes of seed s on their own; see `LogFormat.log_episodes`."""
        traces = traces_of(episodes.steps, self._env.actions, s, run.scale)
        return Simtrace(folder, self._env, run).evaluate_alone(stamp, traces)

    def draw_training(
        self, run: Path, seeds: Sequence[int], progress: np.ndarray | None, title: str
    ) -> list[Path]:
        """Draw where the first seed's car drove in training; see `LogFormat.draw_training`."""
        from repaint_cli.envs.racer.figures import draw_training

        log = self.folders(run, seeds)[0]
        if progress is None:  # a damaged metrics.csv
            return []
        return draw_training(self._env, run, log, progress[0], title)

    def replay(
        self, logs: Sequence[Path], weights: Mapping[str, float], code: tuple[str, str] | None
    ) -> Replay:
        """Pay the episodes of logs by another reward; see `LogFormat.replay`."""
        from repaint_cli.envs.racer.deepracer.replay import replay

        return replay(self._env, logs, weights, code)
