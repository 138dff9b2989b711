"""A run: train, evaluate, record, checkpoint. All that it leaves is in its folder."""

import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.logs import EpisodeLog
from repaint_cli.envs.output import PrintsInFile
from repaint_cli.errors import RepaintError, RewardFailed, locate_divergence
from repaint_cli.files.lease import Lease
from repaint_cli.files.provenance import versions
from repaint_cli.kernels import training_clock
from repaint_cli.learn import ppo, q_learning
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.seeding import Purpose
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.courses import course_of
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.runs import evaluations
from repaint_cli.runs.alarms import alarms_of, alarms_until, reference_of
from repaint_cli.runs.checkpoint import restore, save_checkpoint, settle
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.measuring import first_length, inform_course, measurements_of
from repaint_cli.runs.metrics import Report, append_csv, start_csv
from repaint_cli.runs.notices import forgotten, notices_of
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.policies import is_of_iteration, write_policy
from repaint_cli.runs.progress import RunProgress
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.record_parts import Alarm
from repaint_cli.runs.teachers import RunTeachers, warm_start
from repaint_cli.tasks import trust
from repaint_cli.tasks.card import TaskCard

TRAINERS = {"ppo": ppo.train, "q-learning": q_learning.train}
"""The training loops; that of PPO serves the other policy gradients, too."""

RECORD_SECONDS = 2.0
"""How old run.json may become: written each iteration, it would slow down very short ones."""


@dataclass
class Experiment:
    """A run while it runs; `owner` makes it and holds its folder, `run` yields each iteration."""

    plan: Plan
    """What to do."""
    teachers: RunTeachers
    """The teachers to learn from."""
    learner: Learner
    """The students, as far as they are."""
    course: Course
    """How the transfer proceeds, as far as it has."""
    record: RunRecord
    """What run.json holds, or will hold."""
    reference: np.ndarray | None
    """Evaluated mean returns (S, K) of a run from scratch beside this one."""
    progress: RunProgress = field(default_factory=RunProgress)
    """What else changes from iteration to iteration."""
    notices: list[str] = field(default_factory=list)
    """Warnings for whoever began or resumed the run."""
    newest_alarms: list[Alarm] = field(default_factory=list)
    """What looked wrong in the last iteration."""
    prints: PrintsInFile = field(default_factory=PrintsInFile)
    """What environments have printed meanwhile."""
    lease: Lease | None = None
    """On its folder, where that is held."""
    _recorded: float = 0.0
    _logs: list[EpisodeLog] = field(default_factory=list)

    @classmethod
    def resume(cls, plan: Plan) -> "Experiment":
        """Check the plan, and go back to the last finished iteration in its folder.

        Nothing is written before `run`.

        Raises:
            CardError: the task cannot be rolled out as its card says, or its code is not trusted.
            TeacherMismatch: a teacher does not fit the task.
            CheckpointError: a teacher's file or the run's own is damaged, or of another run.
        """
        trust.check(plan.target, plan.folder)
        experiment, begun = cls.prepare(plan), plan.begun
        assert begun is not None
        progress = restore(plan, experiment.teachers, experiment.learner, experiment.course)
        record, k = experiment.record, experiment.learner.iteration
        record.versions = begun.versions
        record.resumed, record.iterations = list(begun.resumed), k
        record.alarms = alarms_until(k, plan.files, begun)
        experiment.notices += [*progress.notices, *record.go_on_with(versions())]
        experiment.notices += experiment.learner.bring_streams_back(experiment.card)
        experiment.notices += forgotten(experiment.card, progress)
        experiment.notices += plan.notices
        record.mended += [k] if plan.mended else []
        if k:  # else it begins anew, after what teachers played
            experiment.progress = progress
        return experiment

    @classmethod
    def prepare(cls, plan: Plan) -> "Experiment":
        """Check the plan, make the student and load the teachers: all that needs no folder.

        Raises:
            CardError: the task cannot be rolled out as its card says.
            TeacherMismatch: a teacher does not fit the task.
            CheckpointError: a teacher's file is damaged.
        """
        spaces, teachers = plan.check()
        teachers, card = teachers.to(plan.device), teachers.target
        student = ActorCritic(spaces, card.net, len(plan.seeds), plan.device)
        joint = card.transfer.joint
        learner = Learner.fresh(student, plan.seeds, card.ppo.learning_rate, joint=joint)
        learner.env_steps += sum(one.steps for one in plan.ranked)
        if card.transfer.start == "teacher":
            warm_start(student, teachers)
            learner.episode_lengths += first_length(plan)
        reference = None
        if teachers.teachers:
            reference = reference_of(plan.folder, card, plan.algorithm)
        course = course_of(card, teachers.teachers, len(plan.seeds), measurements_of(plan))
        record, notices = plan.new_record(teachers), notices_of(plan, teachers)
        progress = RunProgress(seconds=sum(one.seconds for one in plan.ranked))
        return cls(plan, teachers, learner, course, record, reference, progress, notices)

    @property
    def card(self) -> TaskCard:
        """The target task as it is carried out."""
        return self.teachers.target

    def write_first(self, files: RunFolder) -> None:
        """Write the first files of a new run into its folder."""
        self.record.write(files)
        start_csv(files.metrics)

    def run(self) -> Iterator[Report]:
        """Train, evaluate, record and checkpoint, one iteration at a time.

        Whenever this stops, also by Ctrl-C, the last finished iteration is on disk.

        Raises:
            StoreError: the disk is full.
        """
        learner, card = self.learner, self.card
        started, outcome = training_clock() - self.progress.seconds, "interrupted"
        if logs := card.env.logs:
            places = logs.folders(self.plan.folder, self.plan.seeds)
            self._logs = [logs.open(path, card.logged) for path in places]
        self._settle()
        self._write_record("running")
        try:
            for stats in TRAINERS[self.plan.algorithm](card, learner, self.course):
                k = stats.iteration
                with locate_divergence(learner.seeds, f"evaluation after iteration {k}"):
                    episodes = self._evaluate(k)
                inform_course(learner, self.course, stats, episodes)
                report = Report(stats, episodes, training_clock() - started)
                self.save(report)
                yield report
            outcome = "finished"
        except RewardFailed as error:
            self.record.failure = str(error)
            raise
        except Exception:
            outcome = "failed"
            raise
        finally:
            self.progress.seconds = training_clock() - started
            if outcome != "finished":
                self._restore_last_iteration()
            self._write_record(outcome)
            learner.close()

    def _evaluate(self, k: int) -> Episodes:
        """Evaluate the students after iteration k."""
        learner, n = self.learner, self.card.eval.episodes
        functions = learner.functions_of(Purpose.EVALUATE, n)
        return evaluate(learner.student, self.card, learner.seeds, n, k, functions=functions)

    def save(self, report: Report) -> None:
        """Put an iteration on disk; it counts once its checkpoint is there."""
        files, progress, k = self.plan.files, self.progress, report.stats.iteration
        if self.lease:
            self.lease.renew(self.plan.folder)
        for s, log in enumerate(self._logs):
            if report.stats.rollout:
                log.log_training(k, report.stats.rollout.steps, s)
            log.log_evaluation(k, report.evaluation.steps, s)
        if paths := self.card.env.paths:
            evaluations.write(files.evaluation(k), k, report.evaluation, paths.records)
        rows = zip(report.rows, self.plan.seeds, strict=True)
        append_csv(files.metrics, [row | {"seed": seed} for row, seed in rows])
        self.newest_alarms = alarms_of(
            report, progress.returns, progress.lengths, self.reference, self.card.select.rule,
            self.learner.student.normalizer,
        )  # fmt: skip
        self.record.add_alarms(self.newest_alarms, files)
        progress.remembered = sorted({*(progress.remembered or ()), *self.learner.remembered()})
        progress.add_evaluation(k, report.evaluation, self.card.eval.best)
        progress.seconds, progress.logs = report.seconds, [log.position for log in self._logs]
        save_checkpoint(self.plan, self.teachers, self.learner, self.course, progress)
        self._keep_best()
        if monotonic() - self._recorded > RECORD_SECONDS:
            self._write_record("running")

    def _keep_best(self) -> None:
        """Write the best evaluated policy if it is the last one, and not there yet."""
        path, (k, s) = self.plan.files.best, self.progress.best
        if 0 < k == self.learner.iteration and not is_of_iteration(path, k):
            write_policy(path, self.plan, self.teachers, self.learner, s)

    def _settle(self) -> None:
        """Leave exactly the finished iterations in the folder."""
        k = self.learner.iteration
        settle(self.plan, self.progress, k)
        for log, position in zip(
            self._logs, self.progress.logs or [{}] * len(self._logs), strict=True
        ):
            log.go_back(k, position)
        self._keep_best()

    def _restore_last_iteration(self) -> None:
        """Go back to the last iteration that is on disk as a whole."""
        seconds = self.progress.seconds
        self.progress = restore(self.plan, self.teachers, self.learner, self.course)
        self.progress.seconds = seconds
        done = self.learner.iteration
        self.record.alarms = [alarm for alarm in self.record.alarms if alarm.iteration <= done]
        with suppress(RepaintError):  # such as a full disk; resuming does it again
            self._settle()

    def _write_record(self, state: str) -> None:
        self.record.state, self.record.iterations = state, self.learner.iteration
        self.record.seconds = round(self.progress.seconds, 1)
        self.record.host, self._recorded = socket.gethostname(), monotonic()
        self.record.write(self.plan.files)

    def policies(self) -> list[Path]:
        """Write each seed's last policy as a teacher file of its own; return where they are."""
        return [
            write_policy(self.plan.files.policy(seed), self.plan, self.teachers, self.learner, s)
            for s, seed in enumerate(self.plan.seeds)
        ]
