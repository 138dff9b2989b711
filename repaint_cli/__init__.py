"""REPAINT: train teacher policies, keep them in a zoo, transfer them to new tasks.

    import repaint_cli as repaint

    scratch = repaint.train("reacher", iterations=20, seeds=range(3))
    student = repaint.transfer("reacher", ["reacher-gentle"], iterations=20, seeds=range(3))
    student.run.returns  # mean return of each evaluation, (S, K): seeds, iterations

The commands as functions, which return records of arrays and files, and print nothing; what goes
wrong is a `repaint_cli.errors.RepaintError`.
"""

import repaint_cli.process  # noqa: I001  # guards `python -m repaint_cli`, so it is first
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import repaint_cli.envs.racer.registration  # noqa: F401  # Gymnasium knows the racer by this
from repaint_cli.errors import UsageError

if TYPE_CHECKING:
    from repaint_cli.engines.options import EngineOptions, RunsWatcher
    from repaint_cli.runs.carry_out import TrainedRun, Watcher
    from repaint_cli.runs.compare import ComparedRuns, EvaluatedRun, OnComparison, OnEvaluatedRun
    from repaint_cli.runs.evaluate import Evaluation, OnEpisodes
    from repaint_cli.tasks.card import TaskCard
    from repaint_cli.tasks.similarity import OnFit, Similarities
    from repaint_cli.zoo.acting import LoadedTeacher

__version__ = "0.2.0"

Name: TypeAlias = str | Path
AnyTask: TypeAlias = "Name | TaskCard"
"""A task's name, the path of its card, or the card."""


def load_task(name: AnyTask) -> "TaskCard":
    """Read a task's card: a shipped one by name, or your own by its path (`my-task.toml`).

    `card.with_settings(["ppo.gamma=0.9"])` has another setting.
    """
    from repaint_cli.tasks.card_files import read_task

    return read_task(str(name)) if isinstance(name, Name) else name


def load_teacher(name: Name) -> "LoadedTeacher":
    """Load a teacher from the zoo by name, or from its file; `teacher.act(observations)` acts."""
    from repaint_cli.zoo import acting, store

    return acting.LoadedTeacher.read(store.find(str(name)))


def train(
    task: AnyTask,
    *,
    iterations: int | None = None,
    settings: Sequence[str] = (),
    seeds: Sequence[int] = (0,),
    name: str | None = None,
    replace: bool = False,
    folder: Name | None = None,
    keep: int = 1,
    track: Sequence[str] = (),
    device: str = "cpu",
    watcher: "Watcher | None" = None,
) -> "TrainedRun":
    """Train a teacher from scratch and put its best evaluated policy into the user's zoo.

    `settings` are of the card, as `section.key=value`, and so many `iterations`; `seeds` (S,) are
    trained side by side. The teacher's `name` is the task's where absent, which may be replaced in
    your zoo; another only with `replace`. The run has a new `folder` below runs/ where absent, and
    keeps so many checkpoints. `track` shows its curves in "tensorboard", "wandb" or "mlflow", too.
    Policies act and learn on a `device`: "cpu", "cuda" or "auto". `watcher` follows the training.
    """
    from repaint_cli.runs import owner, start
    from repaint_cli.runs.carry_out import carry_out

    what = _card(task, settings, iterations), seeds, name, replace, folder, keep, device
    run = owner.new_run(start.plan_teacher(*what))
    return carry_out(run, watcher, track=_listed(track, "trackers"))


def transfer(
    task: AnyTask,
    teachers: Sequence[Name] = (),
    *,
    method: str | None = None,
    algorithm: str = "ppo",
    auto: bool | None = None,
    view: str | None = None,
    instances_from: Sequence[Name] = (),
    iterations: int | None = None,
    settings: Sequence[str] = (),
    seeds: Sequence[int] = (0,),
    folder: Name | None = None,
    keep: int = 1,
    track: Sequence[str] = (),
    device: str = "cpu",
    watcher: "Watcher | None" = None,
) -> "TrainedRun":
    """Transfer teachers to a task, with REPAINT or with a method to compare it with.

    `method` is a name in `tasks.methods.METHODS`, the default of the `algorithm`, "ppo" or
    "q-learning", where absent. `auto`: measurements decide how teachers are used, the default where
    nothing says it. `view` of teachers: "none", "mirror", "both", "auto", `auto`'s default.
    `instances_from`: whose samples are learned from. See `train`.
    """
    from repaint_cli.runs import carry_out, owner, start
    from repaint_cli.tasks.presets import automatic, says_how

    by_hand, card = _listed(settings, "settings"), _card(task, settings, iterations)
    if auto or (auto is None and not says_how(by_hand, method, algorithm != "ppo", instances_from)):
        card, view = automatic(card, by_hand, algorithm, method), view or "auto"
    named, acting = (_listed(names, "teachers") for names in (teachers, instances_from))
    who = card, named, seeds, method, algorithm, acting
    plan = start.plan_transfer(*who, folder, keep, view, device)
    return carry_out.carry_out(owner.new_run(plan), watcher, track=_listed(track, "trackers"))


def resume(
    folder: Name,
    *,
    iterations: int | None = None,
    name: str | None = None,
    replace: bool = False,
    track: Sequence[str] = (),
    device: str | None = None,
    watcher: "Watcher | None" = None,
    for_teacher: bool | None = None,
) -> "TrainedRun":
    """Go on with a run as it began, to its end or for so many iterations in all.

    `for_teacher` is True for a run of `train` alone, False for one of `transfer`. See `train`.
    """
    from repaint_cli.runs.carry_out import carry_out
    from repaint_cli.runs.owner import resumed_run

    run = resumed_run(Path(folder), iterations, name, replace, for_teacher, device)
    return carry_out(run, watcher, track=_listed(track, "trackers"))


def evaluate(
    policy: Name | None = None,
    *,
    task: "AnyTask | None" = None,
    episodes: int | None = None,
    noise: str | None = None,
    race: bool = False,
    settings: Sequence[str] = (),
    seed: int | None = None,
    keep_observations: bool = False,
    log_folder: Name | None = None,
    colour: str = "",
    device: str = "cpu",
    on_episodes: "OnEpisodes | None" = None,
) -> "Evaluation":
    """Let a policy play with its most likely actions; write eval.json and a figure of its paths.

    `policy` is a run's folder, a teacher's name or file, the newest run where absent; task, number
    of episodes and seed are its own where absent; `keep_observations` is for race films. Simulators
    may have noise ("none", "paper"), races, logs, or colours of paths. First comes `on_episodes`.
    """
    from repaint_cli.runs.evaluate import check_simulator, evaluate_policy
    from repaint_cli.runs.find_policies import find_policies, with_settings

    named = find_policies(policy, None if task is None else load_task(task))
    policies = with_settings(named, episodes, noise, race, _listed(settings, "settings")).to(device)
    check_simulator(policies.card, noise, logs := Path(log_folder) if log_folder else None, colour)
    return evaluate_policy(policies, seed, keep_observations, logs, colour, on_episodes)


def similarity(*names: AnyTask, on_fit: "OnFit | None" = None) -> "Similarities":
    """Compare tasks by the cosine of their reward weights.

    One task, card or teacher is compared with all shipped tasks, no name stands for those. Weights
    of a reward function are fitted; `on_fit` is called with its task's name and the fit.
    """
    from repaint_cli.tasks.similarity import similarities_of
    from repaint_cli.zoo.tasks import tasks_to_compare

    return similarities_of(tasks_to_compare(names), on_fit)


def train_methods(
    task: AnyTask,
    methods: Sequence[str],
    teachers: Sequence[Name] = (),
    seeds: Sequence[int] = (0, 1, 2),
    jobs: "int | EngineOptions" = 1,
    watcher: "RunsWatcher | None" = None,
    into: Name | None = None,
) -> Iterator[Path]:
    """Train several methods on the same seeds; yield the runs' folders as they finish.

    `methods` are names in `tasks.methods.METHODS`, `teachers` for those that use any; `jobs`, how
    many train at a time, or an engine's options; `into`, their folder. Who fails is named at last.
    """
    from repaint_cli.engines import train_methods as runs

    named = _listed(methods, "methods"), _listed(teachers, "teachers")
    return runs.train_methods(load_task(task), *named, seeds, jobs, watcher, into)


def compare(
    folders: Sequence[Name],
    *,
    reference: Name | None = None,
    target: float | Sequence[float] | None = None,
    picture: Name | None = None,
    report: Name | None = None,
    on_comparison: "OnComparison | None" = None,
    replace: bool = False,
) -> "ComparedRuns":
    """Compare runs of one task by returns, and by what they took to reach targets.

    `reference` is the run or method that others are compared with, scratch where absent, `target`
    returns to reach, shares of what it converged to where absent. Curves are drawn in `picture`, or
    with tables and a page in the folder `report`; `replace` allows for files of others there.
    """
    from repaint_cli.runs.compare import compare_runs

    runs = [*map(Path, _listed(folders, "folders"))]
    return compare_runs(runs, reference, target, picture, report, on_comparison, replace)


def play_runs(
    folders: Sequence[Name],
    picture: Name = "compare-trajectories.png",
    on_run: "OnEvaluatedRun | None" = None,
    replace: bool = False,
) -> "list[EvaluatedRun]":
    """Let the last policies of runs on one track play, and draw their first seeds' paths.

    `on_run` is called with each run as it was evaluated; `replace` is as in `compare`.
    """
    from repaint_cli.runs.compare import compare_paths

    return compare_paths([*map(Path, _listed(folders, "folders"))], Path(picture), on_run, replace)


def _card(task: AnyTask, settings: Sequence[str], iterations: int | None) -> "TaskCard":
    options = [] if iterations is None else [f"ppo.n_iterations={iterations}"]
    return load_task(task).with_settings([*options, *_listed(settings, "settings")])


def _listed(names: Sequence[Name], what: str) -> list[str]:
    if isinstance(names, Name):
        raise UsageError(f"expected a list of {what}, found '{names}' alone")
    return [*map(str, names)]
