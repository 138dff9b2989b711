"""The actions that a card lists, beside what the car can do. Reading a card needs no arrays."""

from collections.abc import Sequence

from repaint_cli.errors import some

STEERING_LIMIT, SPEED_LIMITS = 30.0, (0.1, 4.0)
"""The real car clips every command to these, degrees (to both sides) and m/s."""

Actions = Sequence[tuple[float, float]]
"""Steering (degrees, left is positive) and speed (m/s) to choose from, (A, 2)."""


def check_actions(actions: Actions) -> None:
    """Check that there is an action, and that each drives forwards.

    Raises:
        ValueError: there is none, or a speed is 0 or below.
    """
    if not actions:
        raise ValueError("expected at least one action, found none")
    for i, (_, speed) in enumerate(actions):
        if speed <= 0:
            raise ValueError(
                f"expected speeds above 0 m/s, as the car only drives forwards; action {i} has "
                f"{speed:g} m/s"
            )


def within_limits(action: tuple[float, float]) -> tuple[float, float]:
    """Return what the car makes of an action, degrees and m/s."""
    steering, speed = action
    slowest, fastest = SPEED_LIMITS
    return (
        min(max(steering, -STEERING_LIMIT), STEERING_LIMIT),
        min(max(speed, slowest), fastest),
    )


def beyond_the_car(actions: Actions) -> str | None:
    """Return which actions are beyond the car and what it makes of them; None where none is."""
    changed = []
    for i, action in enumerate(actions):
        (steering, speed), (angle, pace) = action, within_limits(action)
        parts = [f"{steering:g}° becomes {angle:g}°"] * (steering != angle)
        parts += [f"{speed:g} m/s becomes {pace:g} m/s"] * (speed != pace)
        changed += [f"{' and '.join(parts)} in action {i}"] if parts else []
    if not changed:
        return None
    slowest, fastest = SPEED_LIMITS
    return (
        f"env.actions: the car steers by at most {STEERING_LIMIT:g}° and drives at {slowest:g} to "
        f"{fastest:g} m/s: {some(changed)}"
    )
