"""What people see during a run: a live display on a terminal, a line per iteration elsewhere."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from repaint_cli.cli import namesakes
from repaint_cli.cli.console import literal
from repaint_cli.cli.live import Pace, live
from repaint_cli.cli.printing import out, print_written
from repaint_cli.envs.output import PrintsInFile
from repaint_cli.errors import OutputError, RepaintError, RewardFailed, StoreError, Terminated
from repaint_cli.files.commands import command
from repaint_cli.kernels import compiling, training_clock
from repaint_cli.runs.carry_out import TrainedRun, Watcher
from repaint_cli.runs.comparison_words import duration
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.metrics import Report
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.record_parts import Alarm
from repaint_cli.zoo.teacher_card import interval_text


class Screen(Watcher):
    """Shows a training as it goes, what it wrote, and the next command worth typing."""

    def __init__(self) -> None:
        self._unfinished: Plan | None = None
        """The plan of a run that has begun and whose files are not all written."""
        self._training = False
        self._numbers, self._total, self._done = "", 0, 0
        self._pace, self._estimated = Pace(training_clock), False
        self._prints, self._prints_noted = PrintsInFile(), False

    def _left(self) -> float | None:
        return self._pace.left(self._total - self._done)

    def begin(self, experiment: Experiment) -> None:
        """Show what was noticed before a run, and how far it is."""
        for notice in experiment.notices:
            out.print(f"[yellow]warning:[/yellow] {literal(notice)}")
        plan, self._done = experiment.plan, experiment.learner.iteration
        if plan.ranked and plan.begun is None:
            by_lead = plan.target.transfer.kickstart_schedule == "auto"
            _print_notes([_decided(plan)] if by_lead else [])
            _print_notes([_measured(plan)])
        _print_notes(namesakes.of_used(file.path for file in plan.teachers))
        if plan.teacher_name:
            _print_notes(namesakes.of_planned(plan.teacher_name))
        self._unfinished, self._training, self._prints = plan, True, experiment.prints
        self._total = plan.task.ppo.n_iterations
        self._pace.begin()

    def show(self, report: Report, alarms: Sequence[Alarm]) -> None:
        """Show an iteration's numbers, and what looks wrong."""
        self._numbers, self._done = numbers_of(report), report.stats.iteration
        self._pace.add()
        if not out.is_terminal:
            out.print(f"iteration {self._done}/{self._total} · {self._numbers}")
            self._estimate()
        for alarm in alarms:
            out.print(f"[yellow]warning:[/yellow] {literal(alarm.text)}")
        if self._prints.example and not self._prints_noted:
            self._prints_noted = True
            example = f"such as '{self._prints.example}'"
            _print_notes([f"{_printed(self._prints)} so far, {example}, to {self._prints.path}"])

    def _estimate(self) -> None:
        """Print once how long the rest takes, where that is worth a line."""
        one, left = self._pace.iteration(), self._left()
        if one is None or left is None or self._estimated:
            return
        self._estimated = True
        if left >= Pace.LONG:
            n = self._total - self._done
            several = f"{n} more iterations of {duration(one)} take"
            out.print(f"{several if n > 1 else '1 more iteration takes'} about {duration(left)}")

    def end(self, experiment: Experiment, cause: BaseException | None) -> None:
        """Print after which iteration a run was interrupted."""
        if out.is_terminal and self._numbers:
            out.print(f"iteration {self._done}/{self._total} · {self._numbers}")
            self._numbers = ""
        if isinstance(cause, KeyboardInterrupt | Terminated):
            out.print(f"interrupted after iteration {experiment.learner.iteration}")
        if isinstance(cause, RewardFailed):
            k, file = experiment.learner.iteration, experiment.record.reward_file
            kept = f"iteration {k} is the last, and kept" if k else "no iteration is done"
            out.print(literal(f"the reward function failed: {kept}; mend {file} and go on"))
        goes_on = cause is None or (
            isinstance(cause, KeyboardInterrupt | RewardFailed) and experiment.learner.iteration > 0
        )
        self._training = not goes_on
        if not goes_on:
            self._count_prints()

    def _count_prints(self) -> None:
        """Print how much environments have printed, and where it is."""
        if self._prints.example:
            _print_notes([f"{_printed(self._prints)} to {self._prints.path}"])

    def finish(self, trained: TrainedRun, interrupted: bool) -> None:
        """Print what was written, and the next command."""
        self._unfinished = None
        plan = trained.plan
        for notice in trained.notices:
            out.print(f"[yellow]warning:[/yellow] {literal(notice)}")
        self._count_prints()
        if trained.teacher:
            _print_notes(namesakes.of_trained(trained.teacher))
        elif plan.teacher_name:
            _print_notes(namesakes.of_interrupted(plan.teacher_name))
        print_written(
            trained.written, plan.resume_command if interrupted else next_command(trained)
        )

    def run(self, train: Callable[..., TrainedRun], *args: object, **options: object) -> None:
        """Train; print the command that goes on with the run if it ends early."""
        try:
            with live(out, self._left, lambda: self._numbers, compiling):
                train(*args, watcher=self, **options)
        except OutputError as error:
            if not self._unfinished:
                raise
            raise OutputError(f"{error}; go on with: {self._unfinished.resume_command}") from error
        except BaseException as error:
            ended = not isinstance(error, RepaintError)
            ended = ended or isinstance(error, StoreError | RewardFailed)
            if self._unfinished and ended:  # others are of the task or its numbers, and come again
                hint = "next:" if self._training else "not all is drawn and kept; next:"
                out.print(f"{hint} [bold]{literal(self._unfinished.resume_command)}[/bold]")
            raise


def _print_notes(notes: Iterable[str]) -> None:
    for note in notes:
        out.print(f"note: {literal(note)}")


def _printed(prints: PrintsInFile) -> str:
    """Return how much environments, and reward functions in them, have printed."""
    n = max(1, prints.n_lines)  # a line may be without its end
    return f"the environment printed {n:,} line{'s' * (n > 1)}"


def _decided(plan: Plan) -> str:
    """Return how an automatic transfer uses its teachers, and what to type for the card's way."""
    by_number = sorted((which, one.name) for one in plan.ranked for which in one.teachers)
    first, *others = [name for _, name in by_number]
    names, transfer = " and ".join((first, *others)), plan.target.transfer
    how = f"students imitate {names}, as long as a teacher is ahead"
    if transfer.start == "teacher":
        how = f"students start from {first}"
        how += f", and imitate {' and '.join(others)}" if others else ""
    elif not transfer.iterations:
        how = f"no student learns from {names}, who is not ahead of chance"
    return f"automatic: {how} (--method repaint: as the card says)"


def _measured(plan: Plan) -> str:
    """Return what was measured before a run, and who earned most."""
    steps, n = sum(one.steps for one in plan.ranked), len(plan.ranked) - 1
    best, basis = (
        interval_text(one.mean, one.low, one.high) for one in (plan.ranked[0], plan.ranked[-1])
    )
    return (
        f"{n} view{'s' * (n > 1)} of teachers, and untrained policies, played {steps:,} "
        f"steps, which count; {plan.ranked[0].name} earns {best}, an untrained policy {basis}"
    )


def next_command(trained: TrainedRun) -> str:
    """Return the next command worth typing after a run that was trained to its end."""
    policy = str(trained.run.folder)
    if trained.teacher and not trained.plan.task.reward_code:  # never run from a teacher's file
        policy = str(trained.plan.teacher_name)
    return command("repaint eval {} --render-offscreen", policy)


def numbers_of(report: Report) -> str:
    """Return an iteration's numbers in a line of at most 78 characters."""
    stats, episodes = report.stats, report.evaluation
    speed = stats.metrics["steps_per_second"][0]
    parts = [stats.phase, f"{speed:,.0f} steps/s", f"return {episodes.returns.mean():.4g}"]
    if episodes.progress is not None:
        parts.append(f"progress {episodes.progress.mean():.0f} %")
    if "kept_fraction" in stats.metrics:
        parts.append(f"kept {np.mean(stats.metrics['kept_fraction']):.2f}")
    return " · ".join(parts)
