"""Let a run's or a teacher's policies play, and write how it went."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError, TeacherMismatch
from repaint_cli.files.atomic import check_writable, write_text
from repaint_cli.learn.evaluation import evaluate, spaces_of
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies import weights
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.provenance import stamp
from repaint_cli.runs.checkpoint import NETWORKS, load_networks
from repaint_cli.runs.figures import draw_trajectories
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.reader import FinishedRun, newest_run, read_run
from repaint_cli.runs.start import seed_list
from repaint_cli.tasks import trust
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard

ROOT = Path("runs")
"""Where evaluations are written that belong to no run."""


@dataclass(frozen=True)
class Policies:
    """S policies to evaluate."""

    name: str
    """Of a run or a teacher, for people."""
    network: ActorCritic
    """The policies."""
    seeds: list[int]
    """Their run seeds, (S,)."""
    card: TaskCard
    """The task to evaluate them in."""
    folder: Path
    """Where to write the evaluation."""
    teacher: TeacherCard | None = None
    """The teacher, if it is one."""
    run_folder: Path = ROOT
    """The run's folder, if they are a run's."""


@dataclass(frozen=True)
class Evaluation:
    """How policies did."""

    policies: Policies
    """Which, and in which task."""
    episode_seeds: list[int]
    """What the episodes were drawn from, (S,)."""
    episodes: Episodes
    """Returns, lengths, actions and more, as arrays."""
    written: list[Path]
    """The files that tell of it."""

    def film(self, n_episodes: int | None = None) -> Path:
        """Film the first seed's first episodes; return the file.

        Args:
            n_episodes: how many; the simulator's own number where absent.

        Raises:
            CardError: the film shows observations, which the evaluation did not keep.
            RenderError: no renderer works here.
            StoreError: the file cannot be written.
        """
        card, path = self.policies.card, RunFolder(self.policies.folder).film
        if card.env.films_observations and self.episodes.observations is None:
            raise CardError("expected an evaluation that keeps observations: for_film=True")
        wanted = min(n_episodes or card.env.filmed_episodes, card.eval.episodes)
        card.env.film(self.episodes, path, self.policies.name, wanted)
        return path


def find_policies(name: str | None, card: TaskCard | None = None) -> Policies:
    """Find a run's last policies by its folder, or a teacher's by its name or file.

    Args:
        name: of a run or a teacher; the newest run where absent.
        card: the task to play; the policies' own where absent.

    Raises:
        NotFound: there is no such run or teacher.
        CheckpointError: the file is damaged.
        TeacherMismatch: the policies do not fit the task.
        CardError: the task would run code that a teacher's file brings along.
    """
    folder = newest_run(ROOT) if name is None else Path(name)
    is_run = RunFolder(folder).is_run()
    if name is None or is_run or (folder.is_dir() and name not in store.teachers()):
        return _of_run(read_run(folder), card)
    return _of_teacher(name, card)


def _of_run(run: FinishedRun, card: TaskCard | None) -> Policies:
    network = last_policies(run)
    if card and spaces_of(card) != network.spaces:
        raise TeacherMismatch(
            f"the policies in {run.folder} have {network.spaces}, "
            f"task '{card.name}' has {spaces_of(card)}"
        )
    name = f"{run.task.name} · {run.label} · iteration {run.returns.shape[1]}"
    return Policies(name, network, run.seeds, card or run.task, run.folder, run_folder=run.folder)


def _of_teacher(name: str, card: TaskCard | None) -> Policies:
    network, teacher = store.load_teacher(store.find(name))
    if card:
        store.check_fits([teacher], card, spaces_of(card))
    code = teacher.task.code_at_risk()
    if code and not card:
        raise CardError(
            f"'{teacher.name}' was trained with {code}, which is never run from a teacher's file; "
            "name the task: --task my-task.toml"
        )
    target = card or teacher.task
    title = teacher.name if target == teacher.task else f"{teacher.name} on {target.name}"
    folder = ROOT / target.name / f"eval-{teacher.name}-{stamp()}"
    return Policies(title, network, [teacher.seed], target, folder, teacher)


def last_policies(run: FinishedRun) -> ActorCritic:
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


def check_simulator(
    card: TaskCard, noise: str | None, log_folder: Path | None, colour: str
) -> None:
    """Check that a task's simulator has what is asked for.

    Raises:
        CardError: it has no noise, no logs, or no such colour.
    """
    known = {
        "--noise": not noise or card.env.has_noise,
        "--simtrace": not log_folder or card.env.logs is not None,
        "--colour": not colour or colour in card.env.colours,
    }
    for option, fits in known.items():
        if not fits:
            raise CardError(
                f"expected {option} with a racing task, found '{card.name}'; leave it out"
            )


def adjusted(policies: Policies, options: Sequence[str], settings: Sequence[str]) -> Policies:
    """Return the policies with other settings of their task.

    Args:
        policies: which.
        options: settings of the evaluation, as `section.key=value`.
        settings: others, which make it an evaluation of its own, in a folder of its own.

    Raises:
        CardError: a setting is out of range.
        TeacherMismatch: the policies do not fit the task any more.
    """
    card = policies.card.with_settings([*options, *settings])
    if settings:
        if spaces_of(card) != policies.network.spaces:
            raise TeacherMismatch(
                f"the policies have {policies.network.spaces}, the task so set has "
                f"{spaces_of(card)}"
            )
        name = f"{policies.name} · {', '.join(settings)}"
        folder = ROOT / card.name / f"eval-set-{stamp()}"
        policies = replace(policies, name=name, folder=folder)
    return replace(policies, card=card.model_copy(update={"env": card.env.for_film()}))


def play(
    policies: Policies,
    seed: int | None = None,
    *,
    for_film: bool = False,
    log_folder: Path | None = None,
    colour: str = "",
) -> Evaluation:
    """Evaluate policies; write eval.json, their paths where they have any, and logs if asked for.

    Args:
        policies: which, and in which task.
        seed: of the episodes; the policies' own where absent.
        for_film: whether to keep the observations that a film shows.
        log_folder: where to log the episodes in the simulator's format.
        colour: what colours the paths; "" is the simulator's default.

    Raises:
        StoreError: a file cannot be written.
    """
    card, n = policies.card, policies.card.eval.episodes
    seeds = policies.seeds if seed is None else seed_list(seed, 1) * len(policies.seeds)
    if log_folder:
        check_writable(log_folder)  # better now than after the episodes
    episodes = evaluate(
        policies.network, card, seeds, n, purpose=Purpose.SCORE,
        keep_observations=for_film and card.env.films_observations,
    )  # fmt: skip
    files = RunFolder(policies.folder)
    written = [files.eval_record]
    write_text(written[0], json.dumps(_summary(policies, episodes, seeds), indent=2) + "\n")
    panels, title = [(f"{n} episodes", episodes)], f"{policies.name} · seed {seeds[0]}"
    if draw_trajectories(card, panels, files.eval_trajectories, title, colour):
        written.append(files.eval_trajectories)
    if log_folder:
        written += _log(policies, episodes, log_folder)
    return Evaluation(policies, seeds, episodes, written)


def _log(policies: Policies, episodes: Episodes, folder: Path) -> list[Path]:
    """Log episodes in the simulator's format, several seeds in a folder each; return the files."""
    logs, files, now = policies.card.env.logs, [], stamp().replace("-", "")
    assert logs is not None
    for s, seed in enumerate(policies.seeds):
        place = folder if len(policies.seeds) == 1 else folder / f"seed-{seed}"
        files += logs.log_episodes(place, policies.card.logged, episodes, s, now)
    return files


def _summary(policies: Policies, episodes: Episodes, seeds: list[int]) -> dict[str, Any]:
    """Return the numbers as JSON: returns, lengths and how much each reward term paid.

    `seeds` are those of the policies, `episode_seeds` what their episodes were drawn from.
    """
    card, terms = policies.card, episodes.terms.mean((0, 1))
    return {
        "policy": policies.name,
        "task": card.name,
        "env": card.env.model_dump(mode="json"),
        "eval": card.eval.model_dump(mode="json"),
        "seeds": policies.seeds,
        "episode_seeds": seeds,
        "returns": episodes.returns.tolist(),
        "lengths": episodes.lengths.tolist(),
        "mean_terms": dict(zip(card.reward, terms.tolist(), strict=True)),
    } | card.env.outcomes(episodes)
