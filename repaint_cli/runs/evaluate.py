"""Evaluate the policies of a run or a teacher, and write how they did."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from repaint_cli.activity import doing
from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError, UsageError
from repaint_cli.files.atomic import as_json, check_writable, write_text
from repaint_cli.files.provenance import stamp
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.seeding import Purpose
from repaint_cli.runs.figures import draw_trajectories
from repaint_cli.runs.find_policies import Policies
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.owner import evaluation_folder
from repaint_cli.tasks.card import TaskCard


@dataclass(frozen=True)
class Evaluation:
    """How policies did."""

    policies: Policies
    """Which, and in which task."""
    episodes: Episodes
    """Returns, lengths, actions and more, as arrays."""
    written: list[Path]
    """The files of the evaluation."""

    def film(self, n_episodes: int | None = None) -> Path:
        """Film the first seed's first episodes; return the file.

        Args:
            n_episodes: how many; the simulator's own number where absent.

        Raises:
            UsageError: the number is below 1.
            CardError: the film shows observations, which the evaluation did not keep.
            RenderError: no renderer works here.
            StoreError: the file cannot be written.
        """
        check_filmed(n_episodes)
        card, path = self.policies.card, RunFolder(self.policies.folder).film
        if card.env.films_observations and self.episodes.observations is None:
            raise CardError(
                "expected an evaluation that keeps observations: keep_observations=True"
            )
        wanted = n_episodes or card.env.even_episodes(card.env.filmed_episodes)
        with RunFolder(self.policies.folder).locked(), doing("filming"):
            n = min(wanted, self.episodes.returns.shape[1])
            card.env.film(self.episodes, path, self.policies.name, n)
        return path


OnEpisodes = Callable[[Policies, Episodes], object]
"""Is called with the policies and how they did before anything is written."""


def check_filmed(n_episodes: int | None) -> None:
    """Check how many episodes are to be filmed; None is the simulator's own number.

    Raises:
        UsageError: the number is below 1.
    """
    if n_episodes is not None and n_episodes < 1:
        raise UsageError(f"expected --video-episodes of at least 1, found {n_episodes}")


def check_simulator(
    card: TaskCard, noise: str | None, log_folder: Path | None, colour: str
) -> None:
    """Check that a task's simulator has noise, logs and colours where they are asked for.

    Raises:
        CardError: the simulator has no noise, no logs or no colours.
        UsageError: it has other colours.
    """
    colours = card.env.paths.colours if card.env.paths else {}
    known = {
        "--noise": not noise or card.env.has_noise,
        "--simtrace": not log_folder or card.env.logs is not None,
        "--colour": not colour or bool(colours),
    }
    for option, fits in known.items():
        if not fits:
            raise CardError(
                f"expected {option} with a racing task, found '{card.name}'; leave it out"
            )
    if colour and colour not in colours:
        raise UsageError(f"expected --colour {' or '.join(colours)}, found '{colour:.60}'")


def evaluate_policy(
    policies: Policies,
    seed: int | None = None,
    keep_observations: bool = False,
    log_folder: Path | None = None,
    colour: str = "",
    on_episodes: OnEpisodes | None = None,
) -> Evaluation:
    """Evaluate policies; write eval.json, their paths where they have any, and logs if asked for.

    Args:
        policies: which, and in which task.
        seed: of the episodes; the policies' own where absent.
        keep_observations: whether to keep observations where a film shows them.
        log_folder: where to log the episodes in the simulator's format.
        colour: what colours the paths; "" is the simulator's default.
        on_episodes: see `OnEpisodes`.

    Raises:
        UsageError: the seed is negative.
        StoreError: a file cannot be written.
    """
    card, n = policies.card, policies.card.eval.episodes
    if seed is not None and seed < 0:
        raise UsageError(f"expected --seed of at least 0, found {seed}")
    seeds = policies.seeds if seed is None else [seed] * len(policies.seeds)
    if log_folder:
        check_writable(log_folder)  # better now than after the episodes
    episodes = evaluate(
        policies.network, card, seeds, n, purpose=Purpose.SCORE,
        keep_observations=keep_observations and card.env.films_observations,
    )  # fmt: skip
    if on_episodes:
        on_episodes(policies, episodes)
    with evaluation_folder(policies) as files:
        policies = replace(policies, folder=files.path)
        written = _write(policies, episodes, seeds, colour)
        if log_folder:
            written += _log(policies, episodes, log_folder)
    return Evaluation(policies, episodes, written)


def _write(policies: Policies, episodes: Episodes, seeds: list[int], colour: str) -> list[Path]:
    """Write eval.json, and the paths where there are any; return the files."""
    files, n = RunFolder(policies.folder), episodes.returns.shape[1]
    if parts := policies.card.env.parts(episodes, 0):
        n //= len(parts.episodes)
    written = [files.eval_record]
    write_text(written[0], as_json(_summary(policies, episodes, seeds)))
    panels, title = [(f"{n} episodes", episodes)], f"{policies.name} · seed {seeds[0]}"
    if draw_trajectories(policies.card, panels, files.eval_trajectories, title, colour):
        written.append(files.eval_trajectories)
    return written


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
        "precision": policies.network.net.precision,
        "env": card.env.model_dump(mode="json"),
        "eval": card.eval.model_dump(mode="json"),
        "seeds": policies.seeds,
        "episode_seeds": seeds,
        "returns": episodes.returns.tolist(),
        "lengths": episodes.lengths.tolist(),
        "mean_terms": dict(zip(card.reward, terms.tolist(), strict=True)),
    } | card.env.outcomes(episodes)
