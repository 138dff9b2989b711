"""Verification of a teacher's file: its contents, its fit to its task, and its score."""

from pathlib import Path

from repaint_cli.errors import CheckpointError, RepaintError
from repaint_cli.files.headers import read_hash
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.zoo.scoring import score
from repaint_cli.zoo.store import read_teacher


def verify(path: Path, *, again: bool = False) -> str:
    """Check a teacher's file; return the result as a line of text.

    The file is whole and its hash is that of its contents, its weights are finite and have the
    shapes of its card's networks, its card is valid, and its policy fits its task.

    Args:
        path: of the file.
        again: whether to measure its score again, on the same seeds.

    Raises:
        CheckpointError: a check fails, the task cannot be played, or the score measured again is
            outside the card's interval.
    """
    network, card = read_teacher(path)
    sound = "sound" if read_hash(path) else "sound, but without a hash: of an earlier version"
    if code := card.task.code_at_risk():
        return f"{sound}; {code} is never run from a teacher's file"
    try:
        spaces = spaces_of(card.task)
        measured_again = score(network, card.task, card.seed) if again else None
    except RepaintError as error:
        raise CheckpointError(f"its own task cannot be played: {error}") from error
    if spaces != card.spaces:
        raise CheckpointError(f"it has {card.spaces}, its own task '{card.task.name}' {spaces}")
    if measured_again is None:
        return sound
    measured = measured_again.interval
    if card.score is None:
        return f"{sound}; its card has no score, measured {measured}"
    if not card.score.low <= measured_again.mean <= card.score.high:
        raise CheckpointError(
            f"its card says a score of {card.score.interval}, measured {measured}"
        )
    return f"{sound}; score {measured}, its card says {card.score.mean:.4g}"
