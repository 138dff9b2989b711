"""Logs as DeepRacer writes them, for its community's tools: a folder as `deepracer-utils` reads it.

training-simtrace/{k}-iteration.csv                         every training step, k from 0
evaluation-{stamp}/evaluation-simtrace/0-iteration.csv      every step of `repaint eval`
logs/training/training-repaint-robomaker.log                the same steps as text, in one file
logs/evaluation/evaluation-{stamp}-repaint-robomaker.log
metrics/TrainingMetrics.json                                an entry per episode
model/model_metadata.json  ip/hyperparameters.json  reward_function.py
"""

import csv
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from time import time
from typing import Any

import numpy as np

from repaint_cli.envs.logs import LoggedRun
from repaint_cli.envs.racer.deepracer.model_files import hyperparameters, model_metadata
from repaint_cli.envs.racer.deepracer.simtrace_reader import TRAINING, training_files
from repaint_cli.envs.racer.deepracer.simtrace_text import COLUMNS, TextLog, text_line
from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.envs.racer.deepracer.training_metrics import TrainingMetrics
from repaint_cli.envs.racer.dynamics.car import STEP_SECONDS
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import DamagedFile, StoreError, reported_as
from repaint_cli.files.atomic import as_json, write_errors, write_text
from repaint_cli.files.limits import read_json, read_text

METRICS_FILE = "metrics/TrainingMetrics.json"
TEXT_FILE = "logs/training/training-repaint-robomaker.log"

EMPTY_LOG: Mapping[str, float] = {"clock": 0.0, "episodes": 0, "noted": 0, "text": 0}
"""How far a log is before anything was driven."""


class Simtrace:
    """One car's log folder; its clock runs on from episode to episode, in simulated seconds."""

    def __init__(
        self, folder: Path, env: RacerSimulator, run: LoggedRun, *, resumed: bool = False
    ) -> None:
        """Write what does not change; the folder may hold earlier logs of the same settings.

        Args:
            folder: where.
            env: what is driven.
            run: the facts of the run that its log holds.
            resumed: whether the folder is the run's own, as `go_back` needs it.

        Raises:
            StoreError: the folder cannot be written, or holds logs of other settings.
        """
        self.folder = folder
        self._per_iteration = run.ppo.n_episodes or 0
        self._lengths = [load_track(name).length for name in env.tracks]
        self._clock, self._episodes = 0.0, 0
        self._metrics = TrainingMetrics(folder / METRICS_FILE)
        self._text = TextLog(folder / TEXT_FILE)
        self._noted: list[dict[str, Any]] = []
        self._write_settings(env, run, resumed)

    @property
    def position(self) -> dict[str, float]:
        """How far the log is, for `go_back`."""
        return {
            "clock": self._clock, "episodes": self._episodes, "noted": self._metrics.count,
            "text": self._text.size,
        }  # fmt: skip

    def go_back(self, k: int, position: Mapping[str, float]) -> None:
        """Remove what was logged after iteration k, when the log was at `position`.

        Raises:
            CheckpointError: TrainingMetrics.json is damaged.
            StoreError: a file cannot be changed.
        """
        position = {**EMPTY_LOG, **position}
        self._metrics.cut(int(position["noted"]))
        self._text.cut(int(position["text"]))
        self._noted, self._clock = [], position["clock"]
        self._episodes = int(position["episodes"])
        for iteration, file in training_files(self.folder):
            if iteration > k:
                with write_errors(file):
                    file.unlink()

    def train(self, k: int, traces: Sequence[Trace]) -> None:
        """Log the training episodes of iteration k, from 1.

        Episodes are numbered as if every iteration had as many, also one in which only the teacher
        drove, since the tools divide by that number.
        """
        first = max(self._episodes, (k - 1) * self._per_iteration)
        table, lines = self._tables(traces, first, "training")
        write_text(self.folder / TRAINING / f"{k - 1}-iteration.csv", table)
        self._text.append(lines)
        self._episodes = first + len(traces)
        self._write_metrics()

    def evaluate(self, k: int, traces: Sequence[Trace]) -> None:
        """Log the evaluation after iteration k, in the metrics alone like DeepRacer."""
        for trace in traces:
            self._note(max(self._episodes, k * self._per_iteration), trace, "evaluation")
        self._write_metrics()

    def evaluate_alone(self, stamp: str, traces: Sequence[Trace]) -> list[Path]:
        """Log the episodes of `repaint eval`; return the files.

        A folder without a training gets them in place of one: that is what tools open first.

        Args:
            stamp: 14 digits, the time.
            traces: an episode each.
        """
        places = [f"evaluation-{stamp}/evaluation-simtrace/0-iteration.csv"]
        alone = not self._holds_training()
        if alone:
            places.append(f"{TRAINING}/0-iteration.csv")
        table, lines = self._tables(traces, 0, "evaluation")
        for place in places:
            write_text(self.folder / place, table)
        places.append(f"logs/evaluation/evaluation-{stamp}-repaint-robomaker.log")
        write_text(self.folder / places[-1], lines)
        if alone:
            self._write_metrics()
            places.append(METRICS_FILE)
        return [self.folder / place for place in places]

    def _holds_training(self) -> bool:
        """Tell whether the folder's log is of a training, and not of an earlier evaluation."""
        try:
            noted = read_json(self.folder / METRICS_FILE)["metrics"]
            return any(item["phase"] == "training" for item in noted)
        except (DamagedFile, LookupError, TypeError):
            return (self.folder / TRAINING).is_dir()

    def _write_settings(self, env: RacerSimulator, run: LoggedRun, known: bool) -> None:
        deep = run.n_convolutions > 3
        texts = {
            "model/model_metadata.json": as_json(model_metadata(env.actions, env.sensors, deep)),
            "ip/hyperparameters.json": as_json(hyperparameters(run.ppo)),
            "reward_function.py": run.reward_function,
        }
        for place, text in texts.items():
            path = self.folder / place
            there, used = None, (self.folder / TRAINING).is_dir()
            if os.path.lexists(path) and (used or text is not None) and not known:
                used = True
                with reported_as(StoreError):
                    there = read_text(path)
            if used and not known and there != text:
                raise StoreError(
                    f"{self.folder} holds logs of other settings: its {place} differs; "
                    "name another folder"
                )
        for place, text in texts.items():
            if text is not None:
                write_text(self.folder / place, text)

    def _tables(self, traces: Sequence[Trace], first: int, phase: str) -> tuple[str, str]:
        """Return the steps of some episodes as CSV and as text, and note the episodes."""
        table, lines = io.StringIO(), list[str]()
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(COLUMNS)
        for i, trace in enumerate(traces):
            rows = list(self._rows(first + i, trace))
            writer.writerows(rows)
            lines += map(text_line, rows)
            self._note(first + i + 1, trace, phase, trial=i + 1)
        return table.getvalue(), "".join(lines)

    def _rows(self, episode: int, trace: Trace) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of an episode; the first is "prepare", where the tools start the clock."""
        last, now = len(trace) - 1, f"{time():.3f}"
        length = self._lengths[trace.track]
        for t in range(len(trace)):
            status = trace.status if t == last else "in_progress" if t else "prepare"
            yield (
                episode, f"{t + 1:.1f}", f"{trace.x[t]:.4f}", f"{trace.y[t]:.4f}",
                f"{trace.yaw[t]:.4f}", f"{trace.steer[t]:.2f}", f"{trace.throttle[t]:.2f}",
                trace.action[t], f"{trace.reward[t]:.6g}",
                t == last and trace.status != "in_progress", bool(trace.all_wheels_on_track[t]),
                f"{trace.progress[t]:.4f}", trace.closest_waypoint[t], f"{length:.4f}",
                f"{self._clock + t * STEP_SECONDS:.4f}", status, "0.0", trace.crashes[t], now,
            )  # fmt: skip

    def _note(self, episode: int, trace: Trace, phase: str, trial: int | None = None) -> None:
        """Add an episode to the metrics, and its time to the clock."""
        seconds = len(trace) * STEP_SECONDS
        self._noted.append({
            "reward_score": round(float(trace.reward.sum()), 4),
            "metric_time": round(1000 * (self._clock + seconds)),
            "start_time": round(1000 * self._clock),
            "elapsed_time_in_milliseconds": round(1000 * seconds),
            "episode": episode,
            "trial": trial or self._per_iteration or episode,
            "phase": phase,
            "completion_percentage": int(np.clip(trace.progress[-1], 0, 100)),
            "episode_status": trace.status.replace("_", " ").capitalize(),
        })  # fmt: skip
        self._clock += seconds

    def _write_metrics(self) -> None:
        """Put the episodes on disk that have been noted since the last time."""
        if self._noted:
            self._metrics.append(self._noted)
        self._noted = []
