"""Runs in MLflow: one a seed, in an experiment for the task.

MLFLOW_TRACKING_URI and MLFLOW_EXPERIMENT_NAME say where, as for all that MLflow tracks.
"""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.trackers.tracker import TrackedRun, TrackerWithIds

QUIET = {
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",  # a training does not wait for minutes
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
    "MLFLOW_DISABLE_TELEMETRY": "true",
}
"""Settings of ours where the user has none."""
MOST_PARAMS = 100
"""In a request."""
LONGEST_PARAM = 500
"""Characters that every server takes."""


class MLflow(TrackerWithIds):
    """A run of MLflow for each seed."""

    title = "MLflow"

    def __init__(self, run: TrackedRun) -> None:
        super().__init__(run)
        self._client: Any = None

    @classmethod
    def place(cls, files: RunFolder) -> Path:
        """Return the file of its ids."""
        return files.path / "mlflow.json"

    def open(self) -> int:
        """Begin runs, or go on with those whose ids are kept, if they are in this store."""
        for name, value in QUIET.items():
            os.environ.setdefault(name, value)
        from mlflow.tracking import MlflowClient

        self._client = MlflowClient()
        if not self._goes_on():
            self._begin()
        self.keep(self.kept)
        return self.kept

    def _goes_on(self) -> bool:
        """Go on with the kept runs; return False where one of them is not there."""
        try:
            active = [self._client.get_run(name).info.lifecycle_stage for name in self.ids.values()]
        except Exception:  # of many kinds, for another store or none
            return False
        if not active or set(active) != {"active"}:
            return False
        for name in self.ids.values():
            self._client.update_run(name, status="RUNNING")
        return True

    def _begin(self) -> None:
        from mlflow.entities import Param

        experiment = os.environ.get("MLFLOW_EXPERIMENT_NAME") or f"repaint-{self.run.task}"
        known = self._client.get_experiment_by_name(experiment)
        place = known.experiment_id if known else self._client.create_experiment(experiment)
        params = [Param(name, value[:LONGEST_PARAM]) for name, value in _flat(self.run.settings)]
        for seed in self.run.seeds:
            tags = {"seed": str(seed), "group": self.run.title, "mlflow.source.name": "repaint"}
            begun = self._client.create_run(
                place, tags=tags, run_name=f"{self.run.title} seed-{seed}"
            )
            self.ids[str(seed)] = begun.info.run_id
            for i in range(0, len(params), MOST_PARAMS):
                self._client.log_batch(begun.info.run_id, params=params[i : i + MOST_PARAMS])
        self.kept = 0

    def write(self, k: int, numbers: Mapping[int, Mapping[str, float]], when: float) -> None:
        """Write an iteration as a step."""
        from mlflow.entities import Metric

        for seed, values in numbers.items():
            metrics = [Metric(name, value, int(1000 * when), k) for name, value in values.items()]
            self._client.log_batch(self.ids[str(seed)], metrics=metrics)
        self.keep(k)

    def close(self, finished: bool) -> None:
        """Say how the runs ended."""
        for name in self.ids.values():
            self._client.set_terminated(name, "FINISHED" if finished else "KILLED")


def _flat(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield settings of all sections as `section.key` and its text; those that are absent not."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        elif value is not None:
            yield f"{prefix}{name}", str(value)
