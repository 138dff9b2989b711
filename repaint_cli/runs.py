"""A run: train, evaluate, record, checkpoint. Its folder is all that remains and all one needs."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

from repaint_cli import checkpoint, zoo
from repaint_cli.alarms import Alarm, alarms_of, reference_beside
from repaint_cli.config import TransferConfig
from repaint_cli.errors import StoreError, telling_where
from repaint_cli.evaluate import evaluate, spaces_of
from repaint_cli.files import write_text
from repaint_cli.learn import q_learning, trainer
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.seeding import Purpose
from repaint_cli.measuring import check_episodes, inform, measure
from repaint_cli.methods import METHODS
from repaint_cli.metrics import COLUMNS, Report, append_csv
from repaint_cli.nets import ActorCritic
from repaint_cli.report.statistics import mean_ci
from repaint_cli.simtrace import Simtrace, log_folders
from repaint_cli.simulators import RacerEnv
from repaint_cli.tasks import TaskCard
from repaint_cli.teaching import load_staff, warm_start
from repaint_cli.traces import driven, played

CHECKPOINT = "checkpoint.safetensors"
"""All that the learner is after the last finished iteration."""

BEST = "best"
"""Name of the best evaluated policy of a run so far, a teacher in the run's folder."""

ALGORITHMS = {"ppo": trainer.train, "q-learning": q_learning.train}
"""The loops that learn; that of PPO knows the other policy gradients, too."""

SCORE_EPISODES = {"gymnasium": 100, "racer": 20}
"""Episodes in a teacher's score, by simulator."""


@dataclass(frozen=True)
class Plan:
    """All that is decided before a run starts."""

    task: TaskCard
    method: str
    seeds: list[int]
    folder: Path
    teachers: tuple[Path, ...] = ()
    acting: tuple[Path, ...] | None = None
    """Those whose own samples are learned from; all of them where absent."""
    algorithm: str = "ppo"
    """Who learns, by its name in `ALGORITHMS`."""

    @property
    def transfer(self) -> TransferConfig:
        """What the method leaves of the task's transfer settings."""
        return METHODS[self.method].apply(self.task.transfer)

    @property
    def target(self) -> TaskCard:
        """The task as the method and the algorithm carry it out."""
        transfer, select = self.transfer, self.task.select
        if self.algorithm != "ppo":
            transfer = transfer.model_copy(update={"phases": "ratio"})
        if select.rule == "auto" and (self.algorithm != "ppo" or not transfer.instance):
            select = select.model_copy(update={"rule": "zeta"})
        return self.task.model_copy(update={"transfer": transfer, "select": select})


class Experiment:
    """A run while it runs; `run` yields a report after every iteration."""

    def __init__(self, plan: Plan) -> None:
        """Try the task, make the student, load the teachers, and only then claim the folder.

        Raises:
            CardError: the task cannot be rolled out as its card says.
            TeacherMismatch: a teacher does not fit the task.
            CheckpointError: a teacher's file is damaged.
            StoreError: the folder exists or cannot be made.
        """
        self.plan, task, method = plan, plan.target, METHODS[plan.method]
        spaces = spaces_of(task)
        task.check_rollout()
        check_episodes(task)
        if plan.algorithm == "q-learning":
            q_learning.check(task, spaces)
        student = ActorCritic(spaces, task.net, len(plan.seeds))
        self.learner = Learner.fresh(student, plan.seeds, task.ppo.learning_rate)
        paths = plan.teachers if method.needs_teacher else ()
        beside = int(plan.algorithm == "q-learning")
        self.staff = load_staff(paths, plan.acting, task, spaces, len(plan.seeds), beside)
        if method.warm_start:
            warm_start(student, self.staff, task)
        self.reports: list[Report] = []
        self.alarms: list[Alarm] = []
        beside_it = reference_beside(plan.folder, task, plan.algorithm)
        self.reference = beside_it if self.staff.teachers else None
        self.best_return = float("-inf")
        self._logs: list[Simtrace] = []
        self._claim_folder()

    def _claim_folder(self) -> None:
        folder = self.plan.folder
        try:
            folder.mkdir(parents=True)
        except FileExistsError as error:
            raise StoreError(f"{folder} exists already; name another with --run") from error
        except OSError as error:
            raise StoreError(f"cannot make {folder}: {error.strerror}") from error
        self._write_record("running")
        write_text(folder / "metrics.csv", ",".join(COLUMNS) + "\n")
        if isinstance(self.plan.task.env, RacerEnv):
            self._logs = [
                Simtrace(path, self.plan.task) for path in log_folders(folder, self.plan.seeds)
            ]

    def run(self) -> Iterator[Report]:
        """Train, evaluate, record and checkpoint, one iteration at a time.

        Whenever this stops, also by Ctrl-C, the last finished iteration is on disk.
        """
        started, state = perf_counter(), "interrupted"
        learner, task = self.learner, self.plan.target
        try:
            if task.automatic and self.staff.teachers:
                measure(task, learner, self.staff.teachers)
            for stats in ALGORITHMS[self.plan.algorithm](task, learner, self.staff.teachers):
                k = stats.iteration
                with telling_where(learner.seeds, f"evaluation after iteration {k}"):
                    played = evaluate(learner.student, task, learner.seeds, task.eval.episodes, k)
                inform(task, learner, stats, played)
                report = Report(stats, played, perf_counter() - started)
                self._record(report)
                yield report
            state = "finished"
        finally:
            if self.reports and state != "finished":  # forget a half-done iteration
                checkpoint.load_learner(self.plan.folder / CHECKPOINT, learner)
            self._write_record(state, seconds=round(perf_counter() - started, 1))

    def _record(self, report: Report) -> None:
        folder = self.plan.folder
        for s, log in enumerate(self._logs):
            self._log_drives(log, report, s)
        checkpoint.save_learner(folder / CHECKPOINT, self.learner, {"task": self.plan.task.name})
        rows = [
            row | {"seed": seed} for row, seed in zip(report.rows, self.plan.seeds, strict=True)
        ]
        append_csv(folder / "metrics.csv", rows)
        self.alarms += alarms_of(report, self.reports, self.reference, self.plan.target.select.rule)
        self.reports.append(replace(report, stats=replace(report.stats, rollout=None)))
        means = report.evaluation.returns.mean(1)
        s = int(means.argmax())
        if means[s] > self.best_return:
            zoo.add(self.learner.student, s, self._card(BEST, s), folder)
            self.best_return = float(means[s])

    def _log_drives(self, log: Simtrace, report: Report, s: int) -> None:
        """Log how a seed's car drove, in training and evaluation."""
        env, stats = self.plan.task.env, report.stats
        assert isinstance(env, RacerEnv)
        if stats.rollout:
            log.train(stats.iteration, driven(stats.rollout, env, s))
        log.evaluate(stats.iteration, played(report.evaluation, env, s))

    def _write_record(self, state: str, **more: Any) -> None:
        plan = self.plan
        record = {
            "schema_version": 2,
            "state": state,
            "algorithm": plan.algorithm,
            "method": plan.method,
            "teachers": self.staff.record,
            "automatic": plan.target.automatic and bool(self.staff.teachers),
            "seeds": plan.seeds,
            "task": plan.task.model_dump(mode="json"),
            "transfer": plan.transfer.model_dump(mode="json"),
            "versions": versions(),
            "iterations": len(self.reports),
            "alarms": [alarm.record() for alarm in self.alarms],
        } | more
        write_text(plan.folder / "run.json", json.dumps(record, indent=2) + "\n")

    @property
    def newest_alarms(self) -> list[Alarm]:
        """What looked wrong in the last iteration."""
        last = self.reports[-1].stats.iteration if self.reports else 0
        return [alarm for alarm in self.alarms if alarm.iteration == last]

    def policies(self) -> list[Path]:
        """Write each seed's last policy as a teacher file of its own; return where they are."""
        return [
            zoo.add(self.learner.student, s, self._card(f"seed-{seed}", s), self.plan.folder)
            for s, seed in enumerate(self.plan.seeds)
        ]

    def best_teacher(self, name: str, folder: Path) -> Path:
        """Score the best evaluated policy on fresh seeds and write it as a teacher."""
        network, card = zoo.load_teacher(self.plan.folder / f"{BEST}.safetensors")
        scored = {"name": name, "score": score(network, self.plan.task, card.seed)}
        return zoo.add(network, 0, card.model_copy(update=scored), folder)

    def _card(self, name: str, s: int) -> zoo.TeacherCard:
        spaces = self.learner.student.spaces
        return zoo.TeacherCard(
            name=name,
            task=self.plan.task,
            obs_shape=spaces.obs_shape,
            n_actions=spaces.n_actions,
            discrete=spaces.discrete,
            n_beams=spaces.n_beams,
            algorithm=self.plan.algorithm,
            method=self.plan.method,
            seed=self.plan.seeds[s],
            iteration=self.learner.iteration,
            env_steps=int(self.learner.env_steps[s]),
            versions=versions(),
            parents=tuple(str(teacher["sha256"]) for teacher in self.staff.record),
            created=datetime.now(UTC).isoformat(timespec="seconds"),
        )


def score(network: ActorCritic, task: TaskCard, seed: int) -> zoo.Score:
    """Evaluate one policy on seeds that no training or evaluation has used."""
    episodes = SCORE_EPISODES[task.env.simulator]
    played = evaluate(network, task, [seed], episodes, purpose=Purpose.SCORE)
    mean, low, high = mean_ci(played.returns[0])
    laps = progress = None
    if played.progress is not None:
        progress, laps = float(played.progress.mean()), int((played.progress >= 100).sum())
    return zoo.Score(mean=mean, low=low, high=high, episodes=episodes, progress=progress, laps=laps)


def versions() -> dict[str, str]:
    """Return the versions of what results depend on."""
    found = {}
    for name in ("repaint-rl", "torch", "gymnasium", "mujoco", "envpool", "numpy", "numba"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def stamp() -> str:
    """Return the local time as a folder's name, to the second."""
    return datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
