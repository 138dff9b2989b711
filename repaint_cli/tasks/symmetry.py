"""The symmetry that a card names for its environment."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pydantic import field_validator

from repaint_cli.errors import CardError
from repaint_cli.settings import Settings
from repaint_cli.symmetry import SignedPermutation, Symmetry

if TYPE_CHECKING:
    from repaint_cli.policies.spaces import Spaces


class SymmetryConfig(Settings):
    """A reflection of an environment: what its numbers are in the mirror."""

    observation: tuple[int, ...]
    """For each number of the observation, which one stands there in the mirror, counted from 1,
    with a minus if its sign changes."""
    action: tuple[int, ...]
    """The same of actions that are vectors. Of numbered actions, counted from 0 as they are: which
    one each becomes."""
    odd: tuple[str, ...] = ()
    """Reward terms that change their sign for the mirrored policy in the same world."""

    @field_validator("observation")
    @classmethod
    def _vector(cls, numbers: tuple[int, ...]) -> tuple[int, ...]:
        _check_reflection(numbers, first=1)
        return numbers

    @field_validator("action")
    @classmethod
    def _vector_or_numbered(cls, numbers: tuple[int, ...]) -> tuple[int, ...]:
        _check_reflection(numbers, first=0 if 0 in numbers else 1)
        return numbers

    @property
    def numbered(self) -> bool:
        """Whether actions are numbered; then 0 is one of them."""
        return 0 in self.action

    def symmetry(self) -> Symmetry:
        """Return it as simulators name theirs."""
        numbered = SignedPermutation(self.action, (1,) * len(self.action))
        return Symmetry(
            name="mirrored",
            actions=numbered if self.numbered else SignedPermutation.of(self.action),
            vector=SignedPermutation.of(self.observation),
            channels=None,
            beams=None,
            odd=frozenset(self.odd),
        )

    def check_fits(self, spaces: "Spaces") -> None:
        """Check that it maps observations and actions of these spaces.

        Raises:
            CardError: they are of another kind or size.
        """
        if len(spaces.obs_shape) != 1:
            raise CardError(f"[symmetry] expected observations in a vector, found {spaces}")
        if spaces.sizes:
            raise CardError(f"[symmetry] expected actions of one number, found {spaces}")
        if self.numbered != spaces.discrete:
            n = spaces.n_actions
            wanted = f"each of 0 to {n - 1}, as actions are numbered" if spaces.discrete else (
                f"each of 1 to {n}, with a minus where a sign changes, as actions are vectors"
            )  # fmt: skip
            raise CardError(f"[symmetry] action: expected {wanted}, found {[*self.action]}")
        sizes = {
            "observation": (spaces.obs_shape[0], self.observation),
            "action": (spaces.n_actions, self.action),
        }
        for name, (size, numbers) in sizes.items():
            if len(numbers) != size:
                what = f"expected {size} numbers, as the environment has, found {len(numbers)}"
                raise CardError(f"[symmetry] {name}: {what}")

    def check_bounds(self, low: Sequence[float], high: Sequence[float]) -> None:
        """Check that the bounds (A,) of a vector of actions are the same in the mirror.

        Raises:
            CardError: an action within them is out of them in the mirror.
        """
        for i, k in enumerate(self.action):
            own, other = (low[i], high[i]), (low[abs(k) - 1], high[abs(k) - 1])
            if own != (other if k > 0 else (-other[1], -other[0])):
                raise CardError(
                    f"[symmetry] action: {k} stands at {i + 1}, whose bounds of {own[0]:g} to "
                    f"{own[1]:g} are not those of {k}; give the environment equal bounds "
                    "(gymnasium.wrappers.RescaleAction)"
                )


def _check_reflection(numbers: Sequence[int], first: int) -> None:
    """Check that numbers from `first` on, each there once, lead back when they are applied twice.

    Raises:
        ValueError: they do not.
    """
    if not numbers:
        raise ValueError("expected a number for each that the environment has")
    last = len(numbers) - 1 + first
    each_once = sorted(map(abs, numbers)) == list(range(first, last + 1))
    if not each_once or (min(numbers) < 0 and first == 0):
        sign = ", with a minus where a sign changes" if first else ""
        raise ValueError(f"expected each of {first} to {last} once{sign}")
    for i, k in enumerate(numbers, first):
        back = numbers[abs(k) - first]
        wanted = -i if k < 0 else i
        if back != wanted:
            raise ValueError(
                "expected a reflection, which changes nothing when applied twice: "
                f"{k} stands at {i}, so {wanted} must stand at {abs(k)}"
            )
