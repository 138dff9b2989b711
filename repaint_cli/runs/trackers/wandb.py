"""Runs in Weights & Biases: one a seed, in a group of its own; its settings are the user's.

WANDB_MODE=offline writes to the run's folder alone, for `wandb sync`.
"""

import secrets
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from repaint_cli.errors import RepaintError
from repaint_cli.process import standing_in
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.trackers.tracker import TrackedRun, TrackerWithIds

PROJECT = "repaint"
"""Where WANDB_PROJECT and the user's settings name none."""
INIT_SECONDS = 20.0
FINISH_SECONDS = 60.0
"""Waiting for a network; what was not sent by then is in the run's folder."""


class WandB(TrackerWithIds):
    """A run of W&B for each seed."""

    title = "Weights & Biases"

    def __init__(self, run: TrackedRun) -> None:
        super().__init__(run)
        self._runs = dict[int, Any]()

    @classmethod
    def place(cls, files: RunFolder) -> Path:
        """Return the file of its ids."""
        return files.path / "wandb.json"

    def open(self) -> int:
        """Begin runs, or go on with those whose ids are kept.

        Raises:
            RepaintError: nobody is logged in.
        """
        with TemporaryDirectory() as empty, standing_in(empty):  # where it finds no settings
            import wandb

            settings = wandb.setup().settings
        if settings.mode in ("online", "shared") and not wandb.login(prompt=False, verify=False):
            raise RepaintError("nobody is logged in: wandb login, or export WANDB_MODE=offline")
        for seed in self.run.seeds:
            wanted = self.ids.get(str(seed)) or secrets.token_hex(4)
            self._runs[seed] = self._begin(wandb, seed, wanted, settings.project or PROJECT)
            self.ids[str(seed)] = wanted
        self.keep(self.kept)
        return self.kept

    def _begin(self, wandb: Any, seed: int, name: str, project: str) -> Any:
        return wandb.init(
            project=project, group=self.run.title, name=f"{self.run.title} seed-{seed}",
            config={**self.run.settings, "seed": seed}, id=name, resume="allow",
            dir=str(self.run.files.path.absolute()), reinit="create_new",
            settings=wandb.Settings(
                silent=True, console="off", disable_git=True, disable_code=True,
                init_timeout=INIT_SECONDS, finish_timeout=FINISH_SECONDS,
            ),
        )  # fmt: skip

    def write(self, k: int, numbers: Mapping[int, Mapping[str, float]], when: float) -> None:
        """Write an iteration as a step."""
        for seed, run in self._runs.items():
            run.log(dict(numbers[seed]), step=k)
        self.keep(k)

    def close(self, finished: bool) -> None:
        """Send what is not sent yet."""
        for run in self._runs.values():
            run.finish(exit_code=0 if finished else 1)
