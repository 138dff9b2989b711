"""What `repaint eval` does: find a policy, let it play, print, draw and film."""

import json
import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from repaint_cli.cli.episode_table import table
from repaint_cli.cli.option_values import seed_list
from repaint_cli.cli.screen import out
from repaint_cli.cli.session import say_written
from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError, RenderError, TeacherMismatch, UsageError
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
from repaint_cli.tasks import trust
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store


@dataclass(frozen=True)
class Subject:
    """Policies to examine."""

    name: str
    network: ActorCritic
    seeds: list[int]
    task: TaskCard
    folder: Path
    """Where to write what is found."""
    following: str
    """The next command worth typing."""


def subject(what: str | None, task: str | None, root: Path) -> Subject:
    """Find a run's last policies, or a teacher's policy, by name.

    Raises:
        NotFound: there is nothing of this name.
        CheckpointError: its file is damaged.
        TeacherMismatch: the policy does not fit the task.
    """
    card = read_task(task) if task else None
    folder = newest_run(root) if what is None else Path(what)
    is_run = RunFolder(folder).is_run()
    if what is None or is_run or (folder.is_dir() and what not in store.teachers()):
        run = read_run(folder)
        network = policies(run)
        if card and spaces_of(card) != network.spaces:
            raise TeacherMismatch(
                f"the policies in {folder} have {network.spaces}, "
                f"task '{card.name}' has {spaces_of(card)}"
            )
        name = f"{run.task.name} · {run.label} · iteration {run.returns.shape[1]}"
        following = f"repaint compare {shlex.quote(str(folder.parent))}/*"
        return Subject(name, network, run.seeds, card or run.task, folder, following)
    path = store.find(str(what))
    network, teacher = store.load_teacher(path)
    if card:
        store.check_fits([teacher], card, spaces_of(card))
    code = teacher.task.code_at_risk()
    if code and not card:
        raise CardError(
            f"'{teacher.name}' was trained with {code}, which is never run from a teacher's file; "
            "name the task: --task my-task.toml"
        )
    target = card or teacher.task
    name = teacher.name if target == teacher.task else f"{teacher.name} on {target.name}"
    folder = root / target.name / f"eval-{teacher.name}-{stamp()}"
    named = shlex.quote(str(task if teacher.task.reward_code else what))
    following = f"repaint similarity {named}"
    return Subject(name, network, [teacher.seed], target, folder, following)


def policies(run: FinishedRun) -> ActorCritic:
    """Return a run's last policies.

    Raises:
        CardError: it brings along code that is not trusted.
        CheckpointError: its checkpoint is damaged.
    """
    trust.check(run.task, run.folder)
    path, like = run.files.checkpoint, (spaces_of(run.task), run.task.net)
    seeds = len(run.seeds)
    weights.check_networks(path, *like, seeds, str(path), NETWORKS)
    network = ActorCritic(*like, seeds)
    load_networks(path, network)
    return network


def adjusted(who: Subject, changes: list[str], settings: list[str] | None) -> Subject:
    """Return the policies with the settings of their task that the options ask for.

    Args:
        who: the policies.
        changes: all settings, as `section.key=value`.
        settings: those of --set among them, which make it an evaluation of its own.

    Raises:
        CardError: a setting is out of range.
        TeacherMismatch: the policies do not fit the task any more.
    """
    task = who.task.with_settings(changes)
    if settings and spaces_of(task) != who.network.spaces:
        raise TeacherMismatch(
            f"the policies have {who.network.spaces}, the task so set has {spaces_of(task)}"
        )
    if settings:  # another evaluation than the run's or teacher's own
        name = f"{who.name} · {', '.join(settings)}"
        who = replace(who, name=name, folder=Path("runs") / task.name / f"eval-set-{stamp()}")
    return replace(who, task=task.model_copy(update={"env": task.env.for_film()}))


def check_options(
    task: TaskCard,
    n_filmed: int | None,
    noise: str | None,
    simtrace: Path | None,
    colour: str | None,
) -> None:
    """Check options that not every simulator knows.

    Raises:
        UsageError: an option asks for nothing.
        CardError: an option asks for what the task's simulator has not.
    """
    if n_filmed is not None and n_filmed < 1:
        raise UsageError(f"expected --video-episodes of at least 1, found {n_filmed}")
    env = task.env
    known = {
        "--noise": not noise or env.has_noise,
        "--simtrace": not simtrace or env.logs is not None,
        "--colour": not colour or colour in env.colours,
    }
    for option, fits in known.items():
        if not fits:
            raise CardError(
                f"expected {option} with a racing task, found '{task.name}'; leave it out"
            )


def examine(
    who: Subject,
    seed: int | None,
    n_filmed: int | None,
    render: bool,
    simtrace: Path | None,
    colour: str,
) -> None:
    """Evaluate, print a table, and write eval.json, eval-trajectories.png and what is asked for."""
    task, n_episodes = who.task, who.task.eval.episodes
    seeds = who.seeds if seed is None else seed_list(seed, 1) * len(who.seeds)
    if simtrace:
        check_writable(simtrace)  # better now than after the races
    observed = render and task.env.films_observations
    played = evaluate(
        who.network, task, seeds, n_episodes, purpose=Purpose.SCORE, keep_observations=observed
    )
    out.print(table(who.name, who.seeds, task.env, played))
    written = [who.folder / "eval.json"]
    write_text(written[0], json.dumps(summary(who, played, seeds), indent=2) + "\n")
    drawn = who.folder / "eval-trajectories.png"
    title = f"{who.name} · seed {seeds[0]}"
    if draw_trajectories(task, [(f"{n_episodes} episodes", played)], drawn, title, colour):
        written.append(drawn)
    if simtrace:
        written += log_episodes(task, played, who.seeds, simtrace)
    if render:
        wanted = min(n_filmed or task.env.filmed_episodes, n_episodes)
        try:
            task.env.film(played, who.folder / "video.mp4", who.name, wanted)
            written.append(who.folder / "video.mp4")
        except RenderError:
            say_written(written, who.following)
            raise
    say_written(written, who.following)


def log_episodes(task: TaskCard, played: Episodes, seeds: list[int], folder: Path) -> list[Path]:
    """Log episodes in the simulator's format, several seeds in a folder each; return the files."""
    logs, files, now = task.env.logs, [], stamp().replace("-", "")
    assert logs is not None
    for s, seed in enumerate(seeds):
        place = folder if len(seeds) == 1 else folder / f"seed-{seed}"
        files += logs.log_episodes(place, task.logged, played, s, now)
    return files


def summary(who: Subject, played: Episodes, seeds: list[int]) -> dict[str, object]:
    """Return the numbers as JSON: returns, lengths and how much each reward term paid.

    `seeds` are those of the policies, `episode_seeds` what their episodes were drawn from.
    """
    weights = who.task.reward
    terms = played.terms.mean((0, 1))
    return {
        "policy": who.name,
        "task": who.task.name,
        "env": who.task.env.model_dump(mode="json"),
        "eval": who.task.eval.model_dump(mode="json"),
        "seeds": who.seeds,
        "episode_seeds": seeds,
        "returns": played.returns.tolist(),
        "lengths": played.lengths.tolist(),
        "mean_terms": dict(zip(weights, terms.tolist(), strict=True)),
    } | who.task.env.outcomes(played)
