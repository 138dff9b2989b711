"""Signs of negative transfer during training: what looks wrong in an iteration, and why."""

from collections.abc import Iterator, Sequence
from math import exp
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from repaint_cli.errors import CheckpointError, RepaintError, reported_as
from repaint_cli.files.limits import read_bytes
from repaint_cli.learn.observed import narrow_features
from repaint_cli.policies.normalizer import Normalizer
from repaint_cli.runs.folder import RunFolder, runs_in
from repaint_cli.runs.metrics import Report
from repaint_cli.runs.reader import RecordedRun, read_run
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.record_parts import Alarm
from repaint_cli.settings import first_problem
from repaint_cli.tasks.card import TaskCard

RARE = -4.0
"""Mean log ρ below which the loss on instances has next to no slope."""

LARGE = 1e8
"""Mean squared error of a critic in returns of 10,000 and more."""

IN_A_ROW = 3
"""Iterations under the reference, or with ever shorter episodes, before there is an alarm."""

SHORTER = 0.8
"""Of the length of the first of them: what is shorter is more than chance."""

SAME = 0.02
"""Of what a step earns: what differs less is the same."""


def alarms_of(
    report: Report,
    before: Sequence[np.ndarray],
    lengths: Sequence[np.ndarray],
    reference: np.ndarray | None,
    rule: str = "zeta",
    normalizer: Normalizer | None = None,
) -> list[Alarm]:
    """Return what looks wrong in an iteration.

    Args:
        report: the iteration.
        before: evaluated returns (S, E) after the ones before it, the last `IN_A_ROW` − 1 at least.
        lengths: mean lengths (S,) of the episodes of those.
        reference: evaluated mean returns (S, K) of a run from scratch on the same task, or None.
        rule: of selection; for `auto` it is no alarm to keep nothing.
        normalizer: of the students' observations.
    """
    k = report.stats.iteration
    problems = [] if len(before) else [*_check_scale(report), *_check_observations(normalizer)]
    problems += _check_shortening(report, before, lengths)
    if "kept_reward" in report.stats.metrics:
        problems += [*_check_kept(report, rule), *_check_teachers(report)]
        problems += _check_outcome(report, before[-1:])
    if reference is not None:
        returns = [*before[1 - IN_A_ROW :], report.evaluation.returns]
        problems += _check_against(reference, returns, k)
    return [Alarm(iteration=k, kind=kind, text=f"iteration {k}: {t}") for kind, t in problems]


def _check_scale(report: Report) -> Iterator[tuple[str, str]]:
    """Ask, once, whether rewards are of a size that a critic can learn."""
    error = _mean(report, "value_loss")
    if error > LARGE:
        yield (
            "large-rewards",
            f"rewards are large (the critic's mean squared error is {error:.1g}), and it learns "
            "the slower; smaller weights in [reward] help (of a function: its scale), or "
            "ppo.normalize_rewards",
        )


def _check_observations(normalizer: Normalizer | None) -> Iterator[tuple[str, str]]:
    """Ask, once, whether policies can see what changes in the observations."""
    if line := narrow_features(normalizer):
        yield "narrow-observations", line


def _check_shortening(
    report: Report, before: Sequence[np.ndarray], lengths: Sequence[np.ndarray]
) -> Iterator[tuple[str, str]]:
    """Ask whether students end episodes early, since every step costs them.

    Episodes shorten again and again, and a step still earns less than 0, and no more than before.
    """
    if len(lengths) < IN_A_ROW - 1:
        return
    ends = [*lengths[1 - IN_A_ROW :], report.evaluation.lengths.mean(1)]
    returns = [*before[1 - IN_A_ROW :], report.evaluation.returns]
    steps = np.array([own.mean() for own in ends])
    paid = np.array([own.mean() for own in returns]) / steps
    shortening = (np.diff(steps) < 0).all() and steps[-1] < SHORTER * steps[0]
    if shortening and paid[-1] < 0 and paid[-1] <= paid[0] + SAME * abs(paid[0]):
        yield (
            "ever-shorter",
            f"for {IN_A_ROW} iterations episodes shorten ({steps[0]:.0f} to {steps[-1]:.0f} steps) "
            f"and a step costs no less ({paid[0]:.3g} to {paid[-1]:.3g}): the student learns to "
            "end them, by its goal or by failing; if by failing, a smaller penalty in [reward] "
            "helps",
        )


def _check_kept(report: Report, rule: str) -> Iterator[tuple[str, str]]:
    """Ask whether samples were kept, and whether they were paid more than the students' own."""
    metrics = report.stats.metrics
    teacher_reward, own = metrics["kept_reward"], metrics["student_reward"]
    worse = teacher_reward < own  # not where nothing was kept: the reward is nan
    if not metrics["kept_fraction"].any():
        if rule != "auto":
            advice = "lower --threshold or change select.scale"
            yield "nothing-kept", f"no teacher sample was kept, so nothing was taught; {advice}"
    elif worse.any():
        whose = f" of {worse.sum()} of {len(worse)} seeds" if len(worse) > 1 else ""
        yield (
            "kept-paid-less",
            f"the kept teacher samples{whose} were paid less per step than the student itself "
            f"({teacher_reward[worse].mean():.3g} < {own[worse].mean():.3g}): negative transfer?",
        )


def _check_teachers(report: Report) -> Iterator[tuple[str, str]]:
    """Ask how likely the teachers' actions are under the student, and what they earned."""
    log_ratio = _mean(report, "log_ratio")
    taught, own = _mean(report, "teacher_return"), _mean(report, "student_return")
    if log_ratio < RARE:
        yield (
            "rare-actions",
            f"the student finds the kept actions {exp(log_ratio):.1g} times as likely as the "
            f"teacher did (mean log ρ {log_ratio:.1f}), where the loss has next to no slope; raise "
            "transfer.teacher_min_std or transfer.teacher_temperature",
        )
    if taught < own:
        yield (
            "teacher-behind",
            f"the teacher's episodes return {taught:.4g} here, the student's own {own:.4g}: it has "
            "little left to give; end sooner with --transfer-iterations?",
        )


def _check_outcome(report: Report, before: Sequence[np.ndarray]) -> Iterator[tuple[str, str]]:
    """Ask whether the return fell although the critic expected more of the kept samples."""
    promised = _mean(report, "kept_advantage")
    if not before or not promised > 0:
        return
    (then, old_error), (now, new_error) = map(_evaluated, (before[0], report.evaluation.returns))
    if now < then - 2 * np.hypot(old_error, new_error):
        yield (
            "worse-than-promised",
            f"the kept samples promised {promised:.3g} more than expected, yet the return fell "
            f"from {then:.4g} to {now:.4g}; a smaller transfer.alpha_2 or a higher --threshold "
            "may help",
        )


def _check_against(
    reference: np.ndarray, returns: Sequence[np.ndarray], k: int
) -> Iterator[tuple[str, str]]:
    """Ask whether the last iterations, up to k, were under those of a run from scratch."""
    if len(returns) < IN_A_ROW or k > reference.shape[1]:
        return
    own = np.stack([episodes.mean(1) for episodes in returns], 1)
    scratch = reference[:, k - IN_A_ROW : k]
    error = np.sqrt(_squared_error(own) + _squared_error(scratch))
    if (own.mean(0) < scratch.mean(0) - error).all():
        yield (
            "below-scratch",
            f"for {IN_A_ROW} iterations the return was under that of the run from scratch beside "
            f"this one ({own[:, -1].mean():.4g} against {scratch[:, -1].mean():.4g})",
        )


def _mean(report: Report, name: str) -> float:
    """Return a number's mean over the seeds that have it, nan if none has."""
    known = report.stats.metrics.get(name, np.empty(0))
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else float("nan")


def _evaluated(returns: np.ndarray) -> tuple[float, float]:
    """Return the mean of evaluated returns (S, E) and its standard error over episodes."""
    n = returns.size
    return float(returns.mean()), float(returns.std(axis=1).mean() / np.sqrt(n))


def _squared_error(numbers: np.ndarray) -> np.ndarray | float:
    """Return the squared standard error over seeds of each column of (S, K); 0 of one seed."""
    return numbers.var(0, ddof=1) / len(numbers) if len(numbers) > 1 else 0.0


def reference_of(folder: Path, task: TaskCard, algorithm: str) -> np.ndarray | None:
    """Return evaluated mean returns (S, K) of the newest run from scratch next to a run's folder.

    Its environment, reward, rollouts, evaluation and algorithm are the same; damaged runs are
    passed over.
    """
    references = list[tuple[float, RecordedRun]]()
    for files in runs_in(folder.resolve().parent):
        try:
            run = read_run(files.path)
        except RepaintError:
            continue
        same = run.record.algorithm == algorithm and _basis(run.task) == _basis(task)
        named = "algorithm" in run.record.model_fields_set  # which schema 1 left out
        if run.method == "scratch" and named and same and run.returns.size:
            references.append((files.record.stat().st_mtime, run))
    return max(references, key=lambda pair: pair[0])[1].returns if references else None


def _basis(task: TaskCard) -> tuple[object, ...]:
    ppo = task.ppo
    rollouts = ppo.n_steps, ppo.n_episodes, ppo.objective
    return task.task, rollouts, task.eval


def alarms_until(k: int, files: RunFolder, record: RunRecord) -> list[Alarm]:
    """Return the alarms up to iteration k: those in run.json, and those noted since then.

    Raises:
        CheckpointError: the file of new alarms cannot be read or is damaged.
    """
    data = b""
    if files.new_alarms.exists():
        with reported_as(CheckpointError):
            data = read_bytes(files.new_alarms)
    *lines, _ = data.split(b"\n")  # the text after the last end of a line is half written
    try:
        new = [Alarm.model_validate_json(line) for line in lines]
    except ValidationError as error:
        problem = first_problem(error)
        raise CheckpointError(f"{files.new_alarms} is damaged: {problem}") from error
    return [alarm for alarm in dict.fromkeys([*record.alarms, *new]) if alarm.iteration <= k]
