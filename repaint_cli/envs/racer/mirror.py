"""The racer in a mirror: left is right, the two eyes change places, the lidar's beams are reversed.

The car, its noise, the bots and the rules know no side, so nothing but the actions can prevent it.
"""

from collections.abc import Iterator, Sequence

from repaint_cli.envs.racer.actions import Action, ActionRanges, Actions
from repaint_cli.envs.racer.names import BEAMS
from repaint_cli.symmetry import SignedPermutation, Symmetry

ODD = frozenset({"lane"})
"""A policy that keeps the left lane keeps the right one in the mirror. On a mirrored track `lane`
stays, as the infield changes sides, too; `camlane` is the lane of the next bot, whichever it is."""

MIXED = frozenset({"function"})
"""A user's reward function may pay for anything."""


def symmetries_of(actions: Actions, sensors: str) -> tuple[Symmetry, ...]:
    """Return the reflection from left to right; none where an action has no mirror image.

    Args:
        actions: steering (degrees) and speed (m/s), (A, 2), or ranges.
        sensors: of the card.
    """
    if unpaired_action(actions):
        return ()
    if isinstance(actions, ActionRanges):
        commands = SignedPermutation((0, 1), (-1, 1))
    else:
        order = tuple(i for i in _partners(actions) if i is not None)
        commands = SignedPermutation(order, (1,) * len(order))
    mirror = Symmetry(
        name="mirrored",
        actions=commands,
        vector=None,
        channels=(1, 0) if sensors.startswith("stereo") else (0,),
        beams=tuple(reversed(range(BEAMS))) if sensors.endswith("lidar") else None,
        odd=ODD,
        same_world=False,
        mixed=MIXED,
    )
    return (mirror,)


def unpaired_action(actions: Actions) -> str | None:
    """Return which action has no mirror image and what that were, for people; None if all have."""
    if isinstance(actions, ActionRanges):
        right, left = actions.steering_angle
        if right == -left:
            return None
        return (
            "expected steering as far to the right as to the left in env.actions, found "
            f"{actions.texts[0]}"
        )
    for i, partner in enumerate(_partners(actions)):
        if partner is None:
            steering, speed = actions[i]
            return (
                f"expected a mirror image of each of env.actions; action {i}, {steering:g}° at "
                f"{speed:g} m/s, has none ({-steering:g}° at {speed:g} m/s)"
            )
    return None


def _partners(actions: Sequence[Action]) -> Iterator[int | None]:
    """Yield which action each is in the mirror; of equal ones the first is the first one's."""
    for i, (steering, speed) in enumerate(actions):
        equal = [j for j, action in enumerate(actions) if action == (steering, speed)]
        images = [j for j, action in enumerate(actions) if action == (-steering, speed)]
        place = equal.index(i)
        yield images[place] if place < len(images) else None
