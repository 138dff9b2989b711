"""REPAINT: train teacher policies, keep them in a zoo, transfer them to new tasks.

    import repaint_cli as repaint

    teacher = repaint.train("cartpole", iterations=3)
    student = repaint.transfer("cartpole", ["cartpole"], iterations=3)
    student.run.returns  # evaluated mean returns, (S, K): seeds, iterations

What the commands do, as functions that return records of arrays and files and print nothing. Each
raises a `repaint_cli.errors.RepaintError` with a line that says what was wanted, what was found and
what to do. Importing this is quick: torch comes with the first call that needs it.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repaint_cli.runs.carry_out import TrainedRun, Watcher
    from repaint_cli.runs.compare import ComparedRuns, EvaluatedRun
    from repaint_cli.runs.evaluate import Evaluation
    from repaint_cli.tasks.card import TaskCard
    from repaint_cli.tasks.reward_fit import Fit
    from repaint_cli.tasks.similarity import Similarities
    from repaint_cli.zoo.acting import LoadedTeacher

__version__ = "0.2.0"


def load_task(name: "str | Path | TaskCard") -> "TaskCard":
    """Read a task's card: a shipped one by name, or your own by its path (`my-task.toml`).

    `card.with_settings(["ppo.gamma=0.9"])` changes a setting of it.
    """
    from repaint_cli.tasks.card import TaskCard
    from repaint_cli.tasks.card_files import read_task

    return name if isinstance(name, TaskCard) else read_task(str(name))


def load_teacher(name: str | Path) -> "LoadedTeacher":
    """Load a teacher from the zoo by name, or from its file; `teacher.act(observations)` acts."""
    from repaint_cli.zoo.acting import LoadedTeacher
    from repaint_cli.zoo.store import find

    return LoadedTeacher.read(find(str(name)))


def train(
    task: "str | Path | TaskCard",
    *,
    iterations: int | None = None,
    settings: Sequence[str] = (),
    seeds: int = 1,
    seed: int = 0,
    name: str | None = None,
    replace: bool = False,
    folder: Path | None = None,
    keep: int = 1,
    tensorboard: bool = False,
    watcher: "Watcher | None" = None,
) -> "TrainedRun":
    """Train a teacher from scratch and put its best evaluated policy into the user's zoo.

    Args:
        task: a task's name, a card's path, or a card.
        iterations: of training; the card's where absent.
        settings: of the card, as `section.key=value`.
        seeds: how many to train side by side.
        seed: the first of them; the others follow it.
        name: of the teacher; the task's where absent.
        replace: whether it may replace a teacher of this name.
        folder: of the run; a new one below runs/ where absent.
        keep: how many checkpoints to keep.
        tensorboard: whether to write TensorBoard events, too.
        watcher: who follows the training.
    """
    from repaint_cli.runs.carry_out import carry_out
    from repaint_cli.runs.start import plan_teacher, seed_list

    card = load_task(task).with_settings([*_iterations(iterations), *settings])
    plan = plan_teacher(card, seed_list(seed, seeds), name, replace, folder, keep)
    return carry_out(plan, watcher, tensorboard=tensorboard)


def transfer(
    task: "str | Path | TaskCard",
    teachers: Sequence[str] = (),
    *,
    method: str | None = None,
    algorithm: str = "ppo",
    instances_from: Sequence[str] = (),
    iterations: int | None = None,
    settings: Sequence[str] = (),
    seeds: int = 1,
    seed: int = 0,
    folder: Path | None = None,
    keep: int = 1,
    tensorboard: bool = False,
    watcher: "Watcher | None" = None,
) -> "TrainedRun":
    """Transfer teachers to a task, with REPAINT or with a method to compare it with.

    `teachers` are names or files, none for the method `scratch`; `method` is a name in
    `tasks.methods.METHODS`, the algorithm's default where absent; `algorithm` is "ppo" or
    "q-learning"; `instances_from` names those teachers whose own samples are learned from, all
    where empty. The rest is as in `train`.
    """
    from repaint_cli.runs.carry_out import carry_out
    from repaint_cli.runs.start import plan_transfer, seed_list

    card = load_task(task).with_settings([*_iterations(iterations), *settings])
    plan = plan_transfer(
        card, teachers, seed_list(seed, seeds), method, algorithm, instances_from, folder, keep
    )
    return carry_out(plan, watcher, tensorboard=tensorboard)


def resume(
    folder: str | Path,
    *,
    iterations: int | None = None,
    name: str | None = None,
    replace: bool = False,
    tensorboard: bool = False,
    watcher: "Watcher | None" = None,
    for_teacher: bool | None = None,
) -> "TrainedRun":
    """Go on with a run as it began, perhaps for more iterations: how many in all.

    `for_teacher` says whether it must be a run of `train` or of `transfer`; either where absent.
    The rest is as in `train`.
    """
    from repaint_cli.runs.carry_out import carry_out
    from repaint_cli.runs.start import plan_resume

    plan = plan_resume(Path(folder), iterations, name, replace, for_teacher=for_teacher)
    return carry_out(plan, watcher, resume=True, tensorboard=tensorboard)


def evaluate(
    policy: str | Path | None = None,
    *,
    task: "str | Path | TaskCard | None" = None,
    episodes: int | None = None,
    noise: str | None = None,
    settings: Sequence[str] = (),
    seed: int | None = None,
    for_film: bool = False,
    log_folder: Path | None = None,
    colour: str = "",
) -> "Evaluation":
    """Let a policy play with its most likely actions; write eval.json and a figure of its paths.

    What is absent is the newest run's, the policy's or its card's own.

    Args:
        policy: a run's folder, a teacher's name, or its file.
        task: to play.
        episodes: how many.
        noise: "none" or "paper", where the simulator has noise.
        settings: of the card, as `section.key=value`.
        seed: of the episodes.
        for_film: whether to keep what `evaluation.film()` shows.
        log_folder: where to log the episodes, where the simulator has a format of logs.
        colour: what colours the paths.
    """
    from repaint_cli.runs.evaluate import check_simulator, evaluate_policy
    from repaint_cli.runs.find_policies import find_policies, with_settings

    card = None if task is None else load_task(task)
    named = {"eval.episodes": episodes, "eval.noise": noise}
    options = [f"{key}={value}" for key, value in named.items() if value is not None]
    policies = with_settings(find_policies(policy, card), options, settings)
    check_simulator(policies.card, noise, log_folder, colour)
    return evaluate_policy(policies, seed, for_film=for_film, log_folder=log_folder, colour=colour)


def similarity(*names: str, on_fit: "Callable[[str, Fit], object] | None" = None) -> "Similarities":
    """Compare tasks by the cosine of their reward weights.

    One task, card or teacher is compared with all shipped tasks; no name means all of those. A
    reward function's weights are fitted; `on_fit` is called with its task's name and the fit.
    """
    from repaint_cli.tasks.card_files import shipped_tasks
    from repaint_cli.tasks.similarity import similarities_of
    from repaint_cli.zoo.tasks import read_task_or_teacher

    cards = [read_task_or_teacher(name) for name in names or shipped_tasks()]
    if len(cards) == 1:
        cards += [read_task_or_teacher(n) for n in shipped_tasks() if n != cards[0].name]
    return similarities_of(cards, on_fit)


def train_methods(
    task: "str | Path | TaskCard",
    methods: Sequence[str],
    teachers: Sequence[str] = (),
    seeds: Sequence[int] = (0, 1, 2),
    jobs: int = 1,
) -> "Iterator[Path]":
    """Train several methods on the same seeds; yield the runs' folders as they finish.

    Args:
        task: a task's name, a card's path, or a card.
        methods: names in `tasks.methods.METHODS`.
        teachers: names or files of teachers, for those methods that use any.
        seeds: the run seeds, (S,).
        jobs: how many runs at a time, each in a process of its own.
    """
    from repaint_cli.runs.train_methods import plan_methods, train_plans

    return train_plans(plan_methods(load_task(task), methods, teachers, list(seeds)), jobs)


def compare(
    folders: Sequence[str | Path],
    *,
    reference: str = "scratch",
    target: float | None = None,
    picture: Path | None = None,
    report: Path | None = None,
) -> "ComparedRuns":
    """Compare runs of one task by returns, and by what they took to reach a target.

    Args:
        folders: of the runs.
        reference: the run or method that the others are compared with.
        target: the score to reach; the reference's best mean where absent.
        picture: of the curves; compare.png where absent.
        report: a folder for figures, tables and a page that explains them, in place of a picture.
    """
    from repaint_cli.runs.compare import compare_runs

    return compare_runs([Path(f) for f in folders], reference, target, picture, report)


def play_runs(
    folders: Sequence[str | Path], picture: Path = Path("compare-trajectories.png")
) -> "list[EvaluatedRun]":
    """Let the last policies of runs play, and draw the first seeds' paths side by side.

    The runs share a track, or an environment with paths.
    """
    from repaint_cli.runs.compare import compare_paths

    return compare_paths([Path(f) for f in folders], picture)


def _iterations(n: int | None) -> list[str]:
    return [] if n is None else [f"ppo.n_iterations={n}"]
