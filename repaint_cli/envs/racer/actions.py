"""The actions of a card, a list or ranges, beside what the car can do. No arrays are needed."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, Discriminator, Tag, ValidationError, field_validator

from repaint_cli.errors import some
from repaint_cli.settings import Settings, first_problem

STEERING_LIMIT, SPEED_LIMITS = 30.0, (0.1, 4.0)
"""The real car clips every command to these, degrees (to both sides) and m/s."""

FORWARDS = "expected speeds above 0 m/s, as the car only drives forwards"

Action = tuple[float, float]
"""Steering (degrees, left is positive) and speed (m/s)."""


class ActionRanges(Settings):
    """Actions that are any steering and speed within ranges."""

    steering_angle: tuple[float, float]
    """Least and greatest, degrees; left is positive."""
    speed: tuple[float, float]
    """Least and greatest, m/s."""

    @field_validator("steering_angle", "speed")
    @classmethod
    def _with_room(cls, ends: tuple[float, float]) -> tuple[float, float]:
        if ends[0] >= ends[1]:
            raise ValueError("expected a range [low, high] with low below high")
        return ends

    @field_validator("speed")
    @classmethod
    def _forwards(cls, ends: tuple[float, float]) -> tuple[float, float]:
        if ends[0] <= 0:
            raise ValueError(FORWARDS)
        return ends

    @property
    def corners(self) -> tuple[Action, Action]:
        """The least of both numbers, and the greatest."""
        (right, left), (slow, fast) = self.steering_angle, self.speed
        return (right, slow), (left, fast)

    @property
    def texts(self) -> tuple[str, str]:
        """Both ranges for people."""
        (right, slow), (left, fast) = self.corners
        return f"steering_angle from {right:g} to {left:g}°", f"speed from {slow:g} to {fast:g} m/s"


Actions: TypeAlias = Sequence[Action] | ActionRanges
"""What to choose from, (A, 2), or ranges."""


def check_listed(actions: Sequence[Action]) -> None:
    """Check that there is an action, and that each drives forwards.

    Raises:
        ValueError: there is none, or a speed is 0 or below.
    """
    if not actions:
        raise ValueError("expected at least one action, found none")
    for i, (_, speed) in enumerate(actions):
        if speed <= 0:
            raise ValueError(f"{FORWARDS}; action {i} has {speed:g} m/s")


def checked(actions: Actions | Mapping[str, Sequence[float]]) -> Actions:
    """Return actions, or the ranges by name.

    Raises:
        ValueError: there is no action, a range is no range, or a speed is 0 or below.
    """
    if isinstance(actions, Mapping):
        try:
            return ActionRanges.model_validate(actions)
        except ValidationError as error:
            raise ValueError(f"actions: {first_problem(error)}") from error
    if not isinstance(actions, ActionRanges):
        check_listed(actions)
    return actions


def _checked_list(actions: tuple[Action, ...]) -> tuple[Action, ...]:
    check_listed(actions)
    return actions


def _kind(actions: Any) -> str:
    return "[ranges]" if isinstance(actions, Mapping | ActionRanges) else "[list]"


CardActions: TypeAlias = Annotated[
    Annotated[tuple[Action, ...], AfterValidator(_checked_list), Tag("[list]")]
    | Annotated[ActionRanges, Tag("[ranges]")],
    Discriminator(_kind),
]
"""Actions as a setting; messages leave out names in brackets, as of pydantic's own kinds."""


def speeds_of(actions: Actions) -> tuple[float, float]:
    """Return the slowest and the fastest speed, m/s."""
    if isinstance(actions, ActionRanges):
        return actions.speed
    speeds = [speed for _, speed in actions]
    return min(speeds), max(speeds)


def within_limits(action: Action) -> Action:
    """Return what the car makes of an action, degrees and m/s."""
    steering, speed = action
    slowest, fastest = SPEED_LIMITS
    return (
        min(max(steering, -STEERING_LIMIT), STEERING_LIMIT),
        min(max(speed, slowest), fastest),
    )


def beyond_the_car(actions: Actions) -> str | None:
    """Return which actions are beyond the car and what it makes of them; None where none is."""
    changed = list[str]()
    if isinstance(actions, ActionRanges):
        (right, slow), (left, fast) = map(within_limits, actions.corners)
        car = ActionRanges.model_construct(steering_angle=(right, left), speed=(slow, fast))
        pairs = zip(actions.texts, car.texts, strict=True)
        changed = [f"{own} becomes {cars}" for own, cars in pairs if own != cars]
    else:
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
