"""What `repaint eval` does: find a policy, let it play, print, draw and film."""

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from repaint_cli.cli.episode_table import racing_summary, table
from repaint_cli.cli.options import customize, seed_list
from repaint_cli.cli.screen import out
from repaint_cli.cli.session import say_written
from repaint_cli.envs.racer.deepracer import traces
from repaint_cli.envs.racer.deepracer.simtrace import Simtrace
from repaint_cli.envs.simulator import GymEnv, RacerEnv
from repaint_cli.errors import CardError, RenderError, TeacherMismatch
from repaint_cli.files.atomic import check_writable, write_text
from repaint_cli.learn.evaluation import Episodes, evaluate, spaces_of
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies import weights
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.provenance import stamp
from repaint_cli.runs.checkpoint import NETWORKS, load_networks
from repaint_cli.runs.figures import Colour, draw_trajectories, film
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.reader import FinishedRun, newest_run, read_run
from repaint_cli.tasks import trust
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.task import TaskCard
from repaint_cli.zoo import store

FILMED = {"gymnasium": 5, "racer": 1}
"""Episodes in a video, by simulator."""


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
    code = trust.code_of(teacher.task)
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


def adjusted(
    who: Subject, settings: list[str] | None, n_episodes: int | None, noise: str | None
) -> Subject:
    """Return the policies with the settings of their task that the options ask for.

    Raises:
        CardError: a setting is out of range.
        TeacherMismatch: the policies do not fit the task any more.
    """
    task = customize(who.task, settings, eval__episodes=n_episodes, eval__noise=noise)
    if settings and spaces_of(task) != who.network.spaces:
        raise TeacherMismatch(
            f"the policies have {who.network.spaces}, the task so set has {spaces_of(task)}"
        )
    if settings:  # another evaluation than the run's or teacher's own
        name = f"{who.name} · {', '.join(settings)}"
        who = replace(who, name=name, folder=Path("runs") / task.name / f"eval-set-{stamp()}")
    return replace(who, task=on_gymnasium(task))


def check_options(task: TaskCard, n_filmed: int | None, only_races: Mapping[str, object]) -> None:
    """Check options that not every task knows.

    Raises:
        CardError: one asks for nothing, or for what only a race has.
    """
    if n_filmed is not None and n_filmed < 1:
        raise CardError(f"expected --video-episodes of at least 1, found {n_filmed}")
    for option, given in only_races.items():
        if given and task.env.simulator != "racer":
            raise CardError(
                f"expected {option} with a racing task, found '{task.name}'; leave it out"
            )


def examine(
    who: Subject,
    seed: int | None,
    n_filmed: int | None,
    render: bool,
    simtrace: Path | None,
    colour: Colour,
) -> None:
    """Evaluate, print a table, and write eval.json, eval-trajectories.png and what is asked for."""
    task, n_episodes = who.task, who.task.eval.episodes
    seeds = who.seeds if seed is None else seed_list(seed, 1) * len(who.seeds)
    if simtrace:
        check_writable(simtrace)  # better now than after the races
    sights = render and task.env.simulator == "racer"
    played = evaluate(
        who.network, task, seeds, n_episodes, purpose=Purpose.SCORE, keep_sights=sights
    )
    out.print(table(who.name, who.seeds, played))
    written = [who.folder / "eval.json"]
    write_text(written[0], json.dumps(summary(who, played, seeds), indent=2) + "\n")
    drawn = who.folder / "eval-trajectories.png"
    title = f"{who.name} · seed {seeds[0]}"
    if draw_trajectories(task, [(f"{n_episodes} episodes", played)], drawn, title, colour):
        written.append(drawn)
    if simtrace:
        written += log_drives(task, played, who.seeds, simtrace)
    if render:
        wanted = min(n_filmed or FILMED[task.env.simulator], n_episodes)
        try:
            film(task, played, who.folder / "video.mp4", who.name, wanted)
            written.append(who.folder / "video.mp4")
        except RenderError:
            say_written(written, who.following)
            raise
    say_written(written, who.following)


def log_drives(task: TaskCard, played: Episodes, seeds: list[int], folder: Path) -> list[Path]:
    """Log races in DeepRacer's layout, several seeds in a folder each; return the files."""
    assert isinstance(task.env, RacerEnv)
    files, now = [], stamp().replace("-", "")
    for s, seed in enumerate(seeds):
        log = Simtrace(folder if len(seeds) == 1 else folder / f"seed-{seed}", task)
        files += log.evaluate_alone(now, traces.played(played, task.env, s))
    return files


def on_gymnasium(task: TaskCard) -> TaskCard:
    """Return the task on Gymnasium's own environment, which alone can film what it played."""
    if isinstance(task.env, GymEnv):
        return task.model_copy(update={"env": task.env.model_copy(update={"backend": "gymnasium"})})
    return task


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
    } | racing_summary(played)
