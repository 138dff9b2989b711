"""The policies to evaluate, a run's or a teacher's, and the task to evaluate them in."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from repaint_cli.errors import CardError, NotFound, TeacherMismatch
from repaint_cli.files.provenance import stamp
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.policies import weights
from repaint_cli.policies.devices import device_named, make_deterministic
from repaint_cli.policies.mirror import PolicyNetwork
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.runs.checkpoint import NETWORKS, load_networks
from repaint_cli.runs.folder import RUNS, RunFolder
from repaint_cli.runs.reader import RecordedRun, newest_named, newest_run, read_run
from repaint_cli.tasks import trust
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store, view_names
from repaint_cli.zoo.teacher_card import TeacherCard
from repaint_cli.zoo.views import view_of


@dataclass(frozen=True)
class Policies:
    """S policies to evaluate."""

    name: str
    """Of a run or a teacher, for people."""
    network: PolicyNetwork
    """The policies."""
    seeds: list[int]
    """Their run seeds, (S,)."""
    card: TaskCard
    """The task to evaluate them in."""
    folder: Path
    """Where to write the evaluation."""
    teacher: TeacherCard | None = None
    """The teacher, if it is one."""
    run_folder: Path = RUNS
    """The run's folder, if they are a run's."""

    def to(self, device: str) -> "Policies":
        """Return them on a device by its name; see `device_named`."""
        device = device_named(device)
        make_deterministic(device)
        return replace(self, network=self.network.to(device))


def find_policies(policy: str | Path | None, card: TaskCard | None = None) -> Policies:
    """Find a run's last policies by its folder, or a teacher's by its name or file.

    Args:
        policy: a run's folder, a teacher's name, or its file; the newest run where absent.
        card: the task to play; the policies' own where absent.

    Raises:
        NotFound: there is no such run or teacher.
        CheckpointError: the file is damaged.
        TeacherMismatch: the policies do not fit the task.
        CardError: the task would run code that a teacher's file brings along.
    """
    folder = newest_run() if policy is None else Path(policy)
    if policy is None or RunFolder(folder).is_run() or _is_no_teacher(folder):
        return _of_run(read_run(folder), card)
    try:
        return _of_teacher(str(policy), card)
    except NotFound as error:
        raise NotFound(f"{error}{newest_named()}") from error


def _is_no_teacher(folder: Path) -> bool:
    """Return whether a path can only be a run's, though there may be none."""
    if folder.is_dir():
        return str(folder) not in store.teachers()
    return len(folder.parts) > 1 and folder.suffix != store.SUFFIX


def _of_run(run: RecordedRun, card: TaskCard | None) -> Policies:
    network = last_policies(run)
    if card and spaces_of(card) != network.spaces:
        raise TeacherMismatch(
            f"the policies in {run.folder} have {network.spaces}, "
            f"task '{card.name}' has {spaces_of(card)}"
        )
    name = f"{run.task.name} · {run.label} · iteration {run.returns.shape[1]}"
    return Policies(name, network, run.seeds, card or run.task, run.folder, run_folder=run.folder)


def _of_teacher(name: str, card: TaskCard | None) -> Policies:
    file = view_names.find(name)
    network, teacher = store.read_teacher(file.path)
    if card:
        store.check_fits([teacher], card, spaces_of(card))
    code = teacher.task.code_at_risk()
    if code and not card:
        raise CardError(
            f"'{teacher.name}' was trained with {code}, which is never run from a teacher's file; "
            "name the task: --task my-task.toml"
        )
    target = card or teacher.task
    target.check_symmetry(network.spaces)
    played = view_of(network, teacher, file, target).policy
    name = view_names.with_view(teacher.name, file.view)
    title = name if target == teacher.task else f"{name} on {target.name}"
    folder = RUNS / target.name / f"eval-{name.replace(':', '-')}-{stamp()}"
    return Policies(title, played, [teacher.seed], target, folder, teacher)


def last_policies(run: RecordedRun) -> ActorCritic:
    """Return a run's last policies.

    Raises:
        CardError: the run brings along code that is not trusted.
        CheckpointError: its checkpoint is damaged.
    """
    trust.check(run.task, run.folder)
    path, like, seeds = run.files.checkpoint, (spaces_of(run.task), run.task.net), len(run.seeds)
    weights.check_networks(path, *like, seeds, str(path), NETWORKS)
    network = ActorCritic(*like, seeds)
    load_networks(path, network)
    return network


def with_settings(
    policies: Policies,
    episodes: int | None,
    noise: str | None,
    race: bool,
    settings: Sequence[str],
) -> Policies:
    """Return the policies with other settings of their task.

    Args:
        policies: which.
        episodes: how many in an evaluation; as the task has it where absent.
        noise: "none" or "paper"; as the task has it where absent.
        race: whether they race under the rules in [eval], in a folder of its own.
        settings: others, which make it an evaluation of its own, in a folder of its own.

    Raises:
        CardError: a setting is out of range, or the task has no races.
        TeacherMismatch: the policies do not fit the task any more.
    """
    given = {"episodes": episodes, "noise": noise}
    options = [f"eval.{key}={value}" for key, value in given.items() if value is not None]
    card = policies.card.with_settings([*options, *settings])
    if settings:
        if spaces_of(card) != policies.network.spaces:
            raise TeacherMismatch(
                f"the policies have {policies.network.spaces}, the task so set has "
                f"{spaces_of(card)}"
            )
        network = policies.network
        if any(setting.startswith("net.precision=") for setting in settings):
            network = network.in_precision(card.net.precision)
        name = f"{policies.name} · {', '.join(settings)}"
        folder = RUNS / card.name / f"eval-set-{stamp()}"
        policies = replace(policies, name=name, network=network, folder=folder)
    policies = replace(policies, card=card.model_copy(update={"env": card.env.for_replay()}))
    return _racing(policies) if race else policies


def _racing(policies: Policies) -> Policies:
    """Return the policies in races."""
    card = policies.card
    return replace(
        policies,
        name=f"{policies.name} · race of {card.eval.laps} lap{'s' * (card.eval.laps != 1)}",
        card=card.model_copy(update={"env": card.env.racing(card.eval)}),
        folder=RUNS / card.name / f"eval-race-{stamp()}",
    )
