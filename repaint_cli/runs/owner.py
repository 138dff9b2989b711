"""The owner of a run: chooses its folder, locks, reads, and unlocks it when all is written."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

from repaint_cli.files.atomic import check_writable
from repaint_cli.files.lease import Lease, take
from repaint_cli.files.lock import Locked
from repaint_cli.files.paths import user_zoo
from repaint_cli.files.provenance import stamp
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.find_policies import Policies
from repaint_cli.runs.folder import RUNS, RunFolder
from repaint_cli.runs.new_folder import claimed, make_new
from repaint_cli.runs.newest_rows import NewestRows
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.start import plan_resume
from repaint_cli.runs.status import silence_of
from repaint_cli.tasks import trust


@contextmanager
def new_run(plan: Plan, driver: str = "") -> Iterator[Experiment]:
    """Check a plan, and only then make the run's folder; hold it as long as the block lasts.

    `driver` names the command that the run is of, if that trains several.

    Raises:
        CardError: the task cannot be rolled out as its card says.
        TeacherMismatch: a teacher does not fit the task.
        CheckpointError: a teacher's file is damaged.
        StoreError: the folder exists or cannot be made, or the zoo cannot be written.
    """
    _check_zoo(plan)
    experiment, lease = Experiment.prepare(plan), Lease.of_this_process(driver)

    def begin(files: RunFolder) -> None:
        experiment.write_first(files)
        lease.write(files.path)

    with (
        claimed(plan.folder, begin, numbered=plan.numbered) as files,
        lease.held(files.path),
    ):
        experiment.plan, experiment.lease = replace(plan, folder=files.path), lease
        trust.allow_if_possible(experiment.card)
        yield experiment


@contextmanager
def resumed_run(
    folder: Path,
    iterations: int | None = None,
    teacher_name: str | None = None,
    replace_teacher: bool = False,
    for_teacher: bool | None = None,
    device: str | None = None,
    driver: str = "",
) -> Iterator[Experiment]:
    """Hold a run's folder as long as the block lasts, and only then read it; see `plan_resume`.

    Raises:
        Locked: another process holds the folder.
        RepaintError: the run cannot go on; see `plan_resume` and `Experiment.resume`.
    """
    if not RunFolder(folder).is_run():
        read_run(folder, to_resume=True)  # which says so
    with RunFolder(folder).locked():
        lease = _taken(RunFolder(folder), driver)
        with lease.held(folder):
            plan = plan_resume(
                folder, iterations, teacher_name, replace_teacher, for_teacher, device
            )
            _check_zoo(plan)
            experiment = Experiment.resume(plan)
            experiment.lease, experiment.record.attempt = lease, lease.attempt
            yield experiment


def _taken(files: RunFolder, driver: str) -> Lease:
    """Take the lease on a run, before it is read.

    Raises:
        Locked: a process on another machine holds it, and gave a sign not long ago.
        CheckpointError: run.json is damaged.
    """
    record = RunRecord.read(files)
    silent = silence_of(NewestRows.read(files.metrics, len(record.seeds)).pace)
    return take(files.path, driver, record.attempt + 1, silent)


def begun_run(plan: Plan, driver: str = "") -> AbstractContextManager[Experiment]:
    """Hold the run that is in a plan's folder, which goes on as it began; a new one otherwise.

    Raises:
        RepaintError: see `new_run` and `resumed_run`.
    """
    if plan.files.is_run():
        return resumed_run(plan.folder, driver=driver)
    return new_run(plan, driver)


def _check_zoo(plan: Plan) -> None:
    """Check that a plan's teacher can be written: better now than after an hour of training.

    Raises:
        StoreError: the zoo cannot be written.
    """
    if plan.teacher_name:
        check_writable(user_zoo())


@contextmanager
def evaluation_folder(policies: Policies) -> Iterator[RunFolder]:
    """Hold the folder that an evaluation is written to as long as the block lasts.

    It is the run's; or a new one where the policies are no run's, other settings were tried, or
    another process trains or evaluates the run.

    Raises:
        StoreError: the folder cannot be made.
    """
    run, apart = policies.run_folder, policies.folder
    with ExitStack() as stack:
        if policies.folder == run:
            try:
                stack.enter_context(RunFolder(run).locked())
            except Locked:
                apart = RUNS / policies.card.name / f"eval-{run.name}-{stamp()}"
            else:
                yield RunFolder(run)
                return
        yield RunFolder(make_new(apart))
