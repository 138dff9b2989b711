"""A run: train, evaluate, record, checkpoint. Its folder is all that remains and all one needs."""

from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any

import torch

from repaint_cli.envs.racer.deepracer.simtrace import START, Simtrace, log_folders
from repaint_cli.envs.racer.deepracer.traces import driven, played
from repaint_cli.envs.simulator import RacerEnv
from repaint_cli.errors import CheckpointError, RepaintError, StoreError, telling_where
from repaint_cli.files.atomic import alone_in, as_json, write_text
from repaint_cli.learn import ppo, q_learning
from repaint_cli.learn.evaluation import evaluate, has_paths, spaces_of
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.transfer.courses import course_of
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.provenance import Origin, versions
from repaint_cli.runs import evaluations
from repaint_cli.runs.alarms import Alarm, alarms_of, reference_beside
from repaint_cli.runs.measuring import begin, check_episodes, inform
from repaint_cli.runs.metrics import Report, append_csv
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.resume import CHECKPOINT, Past, claim, find_past, save_checkpoint, settle
from repaint_cli.runs.teachers import load_staff, warm_start
from repaint_cli.tasks import trust
from repaint_cli.tasks.methods import METHODS
from repaint_cli.zoo import store
from repaint_cli.zoo.scoring import score
from repaint_cli.zoo.teacher_card import TeacherCard, read_card

BEST = "best"
"""Name of the best evaluated policy of a run so far, a teacher in the run's folder."""

ALGORITHMS = {"ppo": ppo.train, "q-learning": q_learning.train}
"""The loops that learn; that of PPO knows the other policy gradients, too."""


class Experiment:
    """A run while it runs; `run` yields a report after every iteration."""

    def __init__(self, plan: Plan, *, resume: bool = False) -> None:
        """Try the task, make the student, load the teachers, and only then claim the folder.

        Args:
            plan: what to do.
            resume: whether the folder holds the beginning of this very run, to go on from.

        Raises:
            CardError: the task cannot be rolled out as its card says.
            TeacherMismatch: a teacher does not fit the task.
            CheckpointError: a teacher's file or the run's own is damaged, or of another run.
            StoreError: the folder exists or cannot be made.
        """
        self.plan, task, method = plan, plan.target, METHODS[plan.method]
        if resume:
            trust.check(task, plan.folder)
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
        self.course = course_of(task, self.staff.teachers, len(plan.seeds))
        if method.warm_start:
            warm_start(student, self.staff, task)
        beside_it = reference_beside(plan.folder, task, plan.algorithm)
        self.reference = beside_it if self.staff.teachers else None
        self.past = Past()
        self.notices: list[str] = []
        """What whoever resumed should know."""
        self._logs: list[Simtrace] = []
        self.newest_alarms: list[Alarm] = []
        """What looked wrong in the last iteration."""
        self._origin = Origin.now()
        if resume:
            self._origin = Origin.of(read_run(plan.folder).record)
            torch.set_num_threads(self._origin.threads)  # sums in another order are other sums
            self.past = find_past(plan, self.staff, self.learner, self.course)
            changed = self._origin.go_on(self.learner.iteration)
            self.notices = [*self.past.notices, *changed]
        else:
            claim(plan.folder, self._record_of("running"))
            trust.remember(task)

    @property
    def alarms(self) -> list[Alarm]:
        """What looked wrong, iteration by iteration."""
        return self.past.alarms

    def run(self) -> Iterator[Report]:
        """Train, evaluate, record and checkpoint, one iteration at a time.

        Whenever this stops, also by Ctrl-C, the last finished iteration is on disk.

        Raises:
            StoreError: another process is at this run, or the disk is full.
        """
        with alone_in(self.plan.folder):
            yield from self._run()

    def _run(self) -> Iterator[Report]:
        learner, task = self.learner, self.plan.target
        started, state = perf_counter() - self.past.seconds, "interrupted"
        if isinstance(task.env, RacerEnv):
            places = log_folders(self.plan.folder, self.plan.seeds)
            self._logs = [Simtrace(path, self.plan.task, resumed=True) for path in places]
        self._settle()
        self._write_record("running")
        try:
            begin(task, learner, self.course)
            for stats in ALGORITHMS[self.plan.algorithm](task, learner, self.course):
                k = stats.iteration
                with telling_where(learner.seeds, f"evaluation after iteration {k}"):
                    episodes = evaluate(learner.student, task, learner.seeds, task.eval.episodes, k)
                inform(learner, self.course, stats, episodes)
                report = Report(stats, episodes, perf_counter() - started)
                self._record(report)
                yield report
            state = "finished"
        finally:
            self.past.seconds = perf_counter() - started
            if state != "finished":
                self._forget_half_done()
            self._write_record(state)

    def _record(self, report: Report) -> None:
        """Put an iteration on disk; it counts once its checkpoint is there."""
        folder, past, k = self.plan.folder, self.past, report.stats.iteration
        for s, log in enumerate(self._logs):
            self._log_drives(log, report, s)
        if has_paths(self.plan.task):
            evaluations.keep(folder, k, report.evaluation)
        rows = [
            row | {"seed": seed} for row, seed in zip(report.rows, self.plan.seeds, strict=True)
        ]
        append_csv(folder / "metrics.csv", rows)
        rule = self.plan.target.select.rule
        self.newest_alarms = alarms_of(report, past.returns, self.reference, rule)
        past.see(k, report.evaluation.returns, self.newest_alarms)
        past.seconds, past.logs = report.seconds, [log.position for log in self._logs]
        save_checkpoint(self.plan, self.staff, self.learner, self.course, past)
        self._keep_best()

    def _keep_best(self) -> None:
        """Write the best evaluated policy if it is the last one, and not there yet."""
        path, (k, s) = self.plan.folder / f"{BEST}.safetensors", self.past.best
        if 0 < k == self.learner.iteration and not _is_of(path, k):
            store.add(self.learner.student, s, self._card(BEST, s), self.plan.folder)

    def _settle(self) -> None:
        """Make the folder tell of the finished iterations, all of them and no more."""
        k = self.learner.iteration
        settle(self.plan.folder, self.past, k, len(self.plan.seeds))
        for log, position in zip(
            self._logs, self.past.logs or [START] * len(self._logs), strict=True
        ):
            log.go_back(k, position)
        self._keep_best()

    def _forget_half_done(self) -> None:
        """Go back to the last iteration that is on disk as a whole."""
        if (self.plan.folder / CHECKPOINT).is_file():
            seconds = self.past.seconds
            self.past = find_past(self.plan, self.staff, self.learner, self.course)
            self.past.seconds = seconds
        else:
            self.learner.iteration = 0  # what it has learned is nowhere
        with suppress(RepaintError):  # a full disk, say; whoever resumes does it again
            self._settle()

    def _log_drives(self, log: Simtrace, report: Report, s: int) -> None:
        """Log how a seed's car drove, in training and evaluation."""
        env, stats = self.plan.task.env, report.stats
        assert isinstance(env, RacerEnv)
        if stats.rollout:
            log.train(stats.iteration, driven(stats.rollout, env, s))
        log.evaluate(stats.iteration, played(report.evaluation, env, s))

    def _record_of(self, state: str) -> dict[str, Any]:
        """Return run.json."""
        return {
            "schema_version": 3,
            "state": state,
            **self.plan.record(),
            "teachers": self.staff.record,
            "automatic": self.plan.target.automatic and bool(self.staff.teachers),
            **self._origin.record(),
            "iterations": self.learner.iteration,
            "seconds": round(self.past.seconds, 1),
            "alarms": [alarm.record() for alarm in self.alarms],
        }

    def _write_record(self, state: str) -> None:
        write_text(self.plan.folder / "run.json", as_json(self._record_of(state)))

    def policies(self) -> list[Path]:
        """Write each seed's last policy as a teacher file of its own; return where they are."""
        return [
            store.add(self.learner.student, s, self._card(f"seed-{seed}", s), self.plan.folder)
            for s, seed in enumerate(self.plan.seeds)
        ]

    def best_teacher(self, name: str, folder: Path, replace: bool) -> Path:
        """Score the best evaluated policy on fresh seeds and write it as a teacher.

        Raises:
            StoreError: another has that name by now, or the folder cannot be written.
        """
        best = self.plan.folder / f"{BEST}.safetensors"
        network, card = store.load_teacher(best)
        scored = {"name": name, "score": score(network, self.plan.task, card.seed)}
        try:
            return store.add(network, 0, card.model_copy(update=scored), folder, replace=replace)
        except StoreError as error:
            raise StoreError(f"{error}; the policy is kept in {best}") from error

    def _card(self, name: str, s: int) -> TeacherCard:
        spaces = self.learner.student.spaces
        return TeacherCard(
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


def _is_of(path: Path, k: int) -> bool:
    """Tell whether a policy's file is of iteration k."""
    with suppress(CheckpointError):
        return read_card(path).iteration == k
    return False
